//! Wavelengths, for paths through glass whose index of refraction depends on them.
//!
//! Scenes are RGB, and so are paths. One that meets dispersive glass takes a wavelength, the only one it stands for
//! from then on \[hero wavelength, Wilkie et al. 2014, without companions\], and its weight is multiplied by a colour
//! ([`observer`]) whose mean over all wavelengths is white: light that is not dispersed stays as it is.
//!
//! Two paths that are put together must not have taken different wavelengths, nor count a colour twice. So the spectrum
//! is divided into [`BANDS`] of equal probability, paths of different bands do not meet, and those of one band count
//! [`BANDS`] times: of two bands drawn independently, one in so many pairs is equal. Within a pass all paths of a band
//! take the same wavelength ([`IterationWavelengths`]), so nothing is blurred.

mod iteration_wavelengths;
pub mod observer;

pub use iteration_wavelengths::IterationWavelengths;

use crate::math::Rgb;

/// Number of bands. More of them would waste more photons where light comes through dispersive glass and is seen
/// through it; fewer would show in the colours of a single pass.
pub const BANDS: u8 = 8;

/// Weights below this are none: their light is not seen in this colour.
const LEAST_WEIGHT: f32 = 1e-6;

/// A place in the spectrum, uniform on `[0, 1)`: what a path would take if it met dispersive glass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WavelengthSample(f32);

impl WavelengthSample {
    /// From a uniform number in `[0, 1)`.
    #[inline]
    pub fn new(u: f32) -> WavelengthSample {
        WavelengthSample(u)
    }

    /// The band it is in, from 0, and how far, in `[0, 1]`.
    #[inline]
    fn band(self) -> (u8, f32) {
        let x = self.0 * f32::from(BANDS);
        let band = (x as u8).min(BANDS - 1);
        (band, x - f32::from(band))
    }

    #[inline]
    fn within(band: u8, offset: f32) -> WavelengthSample {
        WavelengthSample((f32::from(band) + offset) * (1.0 / f32::from(BANDS)))
    }

    /// The wavelength here.
    #[inline]
    pub fn wavelength(self) -> Wavelength {
        let (nm, weight) = observer::sample(self.0);
        Wavelength { nm, weight, band: Band(self.band().0 + 1) }
    }

    /// A wavelength for a path that carries one channel (0 to 2) alone, drawn from its bands by `u` in proportion to
    /// what they weigh in this channel: so all such paths weigh the same. Its weight is that of the channel, in all
    /// channels; 1 on average.
    #[inline]
    pub fn sample_in_channel(self, channel: usize, u: f32) -> Wavelength {
        let offset = self.band().1;
        let weights: [f32; BANDS as usize] =
            std::array::from_fn(|band| observer::sample(WavelengthSample::within(band as u8, offset).0).1[channel]);
        let sum: f32 = weights.iter().sum();
        let mut left = u * sum;
        let mut band = 0;
        while band + 1 < weights.len() && left >= weights[band] {
            left -= weights[band];
            band += 1;
        }
        let weight = Rgb::splat(sum / f32::from(BANDS));
        Wavelength { weight, ..WavelengthSample::within(band as u8, offset).wavelength() }
    }
}

/// The wavelength that a path has taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wavelength {
    /// Nanometres.
    pub nm: f32,
    /// What light of it weighs: no more than 3, and on average white.
    pub weight: Rgb,
    /// Its band.
    pub band: Band,
}

/// The band of a path's wavelength, if it has taken one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Band(u8);

impl Band {
    /// Of paths that have not met dispersive glass.
    pub const WHITE: Band = Band(0);

    /// Of a path that has taken this wavelength, or none.
    #[inline]
    pub fn of(wavelength: Option<&Wavelength>) -> Band {
        wavelength.map_or(Band::WHITE, |wavelength| wavelength.band)
    }
}

impl Wavelength {
    /// One over the weight: what a path is multiplied with that would count it twice.
    #[inline]
    pub fn inverse_weight(&self) -> Rgb {
        Rgb::select(self.weight.cmpgt(Rgb::splat(LEAST_WEIGHT)), self.weight.recip(), Rgb::ZERO)
    }

    /// What light of a path of some band is multiplied with where this path meets it, both drawn independently; `None`:
    /// they do not meet.
    #[inline]
    pub fn connection_factor(&self, band: Band) -> Option<Rgb> {
        if band == Band::WHITE {
            Some(Rgb::ONE)
        } else {
            (band == self.band).then(|| self.inverse_weight() * f32::from(BANDS))
        }
    }
}
