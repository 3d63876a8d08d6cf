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
pub mod primaries;

pub use iteration_wavelengths::IterationWavelengths;

use crate::math::Rgb;

/// Number of bands of equal probability into which the spectrum is divided; only paths of one band are connected. With
/// more bands, more photons are wasted where dispersed light is seen through dispersive glass. With fewer, the colours
/// of a single iteration show.
pub const BANDS: u8 = 8;

/// Number of wavelengths, in bands at equal distances, that a split camera path takes at dispersive glass.
pub const SPREAD: u8 = 2;

/// A channel of a wavelength's weight below this counts as zero, and so does this channel of
/// [`Wavelength::inverse_weight`].
const MIN_WEIGHT: f32 = 1e-6;

/// The uniform number in `[0, 1)` that determines the wavelength of a path if it meets dispersive glass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WavelengthSample(f32);

impl WavelengthSample {
    /// The sample that the uniform number `u` in `[0, 1)` determines.
    #[inline]
    pub fn new(u: f32) -> WavelengthSample {
        WavelengthSample(u)
    }

    /// The index of the sample's band of the spectrum, and the position within the band in `[0, 1]`.
    #[inline]
    fn band(self) -> (u8, f32) {
        let x = self.0 * f32::from(BANDS);
        let band = (x as u8).min(BANDS - 1);
        (band, x - f32::from(band))
    }

    /// The sample at the position `offset`, in `[0, 1]`, within a band of the spectrum.
    #[inline]
    fn within(band: u8, offset: f32) -> WavelengthSample {
        WavelengthSample((f32::from(band) + offset) * (1.0 / f32::from(BANDS)))
    }

    /// The wavelength of this sample.
    #[inline]
    pub fn wavelength(self) -> Wavelength {
        let (nm, weight) = observer::sample(self.0);
        Wavelength { nm, weight, band: Band(self.band().0 + 1), pairing: 1.0 }
    }

    /// [`SPREAD`] wavelengths, in bands at equal distances and at one position within their bands: the wavelength of this
    /// sample first.
    #[inline]
    pub fn spread(self) -> impl Iterator<Item = Wavelength> {
        let (band, offset) = self.band();
        let other = move |k: u8| WavelengthSample::within((band + k * (BANDS / SPREAD)) % BANDS, offset).wavelength();
        let own = Wavelength { pairing: f32::from(SPREAD), ..self.wavelength() };
        std::iter::once(own).chain((1..SPREAD).map(move |k| Wavelength { pairing: 0.0, ..other(k) }))
    }

    /// A wavelength for a path that carries only one RGB channel (0 to 2). The number `u`, in `[0, 1)`, draws the band
    /// in proportion to its weight in that channel, so all such paths have equal weights. All three channels of
    /// `weight` are set to it; its mean over offsets is 1.
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

/// The wavelength that a path has taken at dispersive glass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wavelength {
    /// Wavelength (nm).
    pub nm: f32,
    /// Factor of the path's throughput: the RGB colour of the wavelength. At most 3 per channel; the mean over
    /// wavelengths is white.
    pub weight: Rgb,
    /// The band of the spectrum that contains the wavelength.
    pub band: Band,
    /// Factor of the contribution when the path is connected to a light path with an equal [`WavelengthSample`]. Of the
    /// wavelengths of a split path, only one is connected.
    pub pairing: f32,
}

/// The band of the spectrum that contains a path's wavelength (1 to [`BANDS`]), or 0 for a path without a wavelength.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Band(u8);

impl Band {
    /// The value of paths that have not met dispersive glass, and so have no wavelength.
    pub const WHITE: Band = Band(0);

    /// The band that contains a path's wavelength; [`Band::WHITE`] for `None`.
    #[inline]
    pub fn of_wavelength(wavelength: Option<&Wavelength>) -> Band {
        wavelength.map_or(Band::WHITE, |wavelength| wavelength.band)
    }

    /// The band as a number of at most four bits.
    #[inline]
    pub fn bits(self) -> u8 {
        self.0
    }

    /// The band of [`Band::bits`].
    #[inline]
    pub fn from_bits(bits: u8) -> Band {
        Band(bits)
    }
}

impl Wavelength {
    /// Reciprocal of [`Wavelength::weight`]. It removes the weight from one of two subpaths that both contain it.
    #[inline]
    pub fn inverse_weight(&self) -> Rgb {
        Rgb::select(self.weight.cmpgt(Rgb::splat(MIN_WEIGHT)), self.weight.recip(), Rgb::ZERO)
    }

    /// Factor of the contribution when an independent subpath of `band` is connected to or merged with the subpath of
    /// this wavelength. `None` if the bands differ, so that the subpaths are not connected.
    #[inline]
    pub fn connection_factor(&self, band: Band) -> Option<Rgb> {
        if band == Band::WHITE {
            Some(Rgb::ONE)
        } else {
            (band == self.band).then(|| self.inverse_weight() * f32::from(BANDS))
        }
    }
}
