//! Wavelengths, for paths through glass whose index of refraction depends on them.
//!
//! Scenes and paths are RGB. A path that meets dispersive glass takes one wavelength, which it keeps \[hero wavelength
//! without companions, Wilkie et al. 2014\]. Its throughput is multiplied by the colour of the wavelength
//! ([`observer`]). The mean of these colours is white, so light that is not dispersed keeps its colour.
//!
//! Two paths may only be connected or merged if they have the same wavelength, and its colour must count once. So the
//! spectrum is divided into [`BANDS`] bands of equal probability. Paths of different bands are not connected, and
//! contributions of equal bands are multiplied by [`BANDS`], because two independent paths have equal bands with the
//! probability `1 / BANDS`. Within an iteration all paths of a band have the same wavelength
//! ([`IterationWavelengths`]), so colours are not blurred.

mod iteration_wavelengths;
pub mod observer;

pub use iteration_wavelengths::IterationWavelengths;

use crate::math::Rgb;

/// Number of bands. With more bands, more photons are wasted where dispersed light is seen through dispersive glass.
/// With fewer, the colours of a single iteration show.
pub const BANDS: u8 = 8;

/// Channels of weights below this are treated as zero: [`Wavelength::inverse_weight`] is then zero, too.
const MIN_WEIGHT: f32 = 1e-6;

/// The uniform number in `[0, 1)` that determines the wavelength of a path if it meets dispersive glass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WavelengthSample(f32);

impl WavelengthSample {
    /// From a uniform number in `[0, 1)`.
    #[inline]
    pub fn new(u: f32) -> WavelengthSample {
        WavelengthSample(u)
    }

    /// The index of the band, and the position within it in `[0, 1]`.
    #[inline]
    fn band(self) -> (u8, f32) {
        let x = self.0 * f32::from(BANDS);
        let band = (x as u8).min(BANDS - 1);
        (band, x - f32::from(band))
    }

    /// The sample at `offset`, in `[0, 1]`, within a band.
    #[inline]
    fn within(band: u8, offset: f32) -> WavelengthSample {
        WavelengthSample((f32::from(band) + offset) * (1.0 / f32::from(BANDS)))
    }

    /// The wavelength of this sample.
    #[inline]
    pub fn wavelength(self) -> Wavelength {
        let (nm, weight) = observer::sample(self.0);
        Wavelength { nm, weight, band: Band(self.band().0 + 1) }
    }

    /// A wavelength for a path that carries only one RGB channel (0 to 2). The number `u` draws the band in proportion
    /// to its weight in that channel, so all such paths have the same weight. All three channels of `weight` are set to
    /// it; its mean over offsets is 1.
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
    /// Wavelength (nm).
    pub nm: f32,
    /// Factor of the path's throughput. At most 3 per channel; the mean over wavelengths is white.
    pub weight: Rgb,
    /// The band that contains the wavelength.
    pub band: Band,
}

/// The band of a path's wavelength (1 to [`BANDS`]), or 0 for a path without one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Band(u8);

impl Band {
    /// The band of paths that have not met dispersive glass.
    pub const WHITE: Band = Band(0);

    /// The band of a path's wavelength; [`Band::WHITE`] for `None`.
    #[inline]
    pub fn of_wavelength(wavelength: Option<&Wavelength>) -> Band {
        wavelength.map_or(Band::WHITE, |wavelength| wavelength.band)
    }
}

impl Wavelength {
    /// Reciprocal of [`Wavelength::weight`]. It removes the weight from one of two subpaths that both contain it.
    #[inline]
    pub fn inverse_weight(&self) -> Rgb {
        Rgb::select(self.weight.cmpgt(Rgb::splat(MIN_WEIGHT)), self.weight.recip(), Rgb::ZERO)
    }

    /// Factor of the contribution of an independent subpath of `band` that is connected to or merged with this one.
    /// `None` if the bands differ, so that the subpaths are not connected.
    #[inline]
    pub fn connection_factor(&self, band: Band) -> Option<Rgb> {
        if band == Band::WHITE {
            Some(Rgb::ONE)
        } else {
            (band == self.band).then(|| self.inverse_weight() * f32::from(BANDS))
        }
    }
}
