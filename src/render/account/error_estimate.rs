//! Relative error of the method's own picture, estimated without a reference.

use super::photon_record::{PhotonRecord, UnseenLight};
use super::pixel_state::PixelState;
use crate::estimator::{PixelAccumulator, SquaredError};
use crate::math::DVec3;
use serde::{Deserialize, Serialize};

/// Estimated squared relative error of the method's own picture, by cause: the mean over pixels of the mean over RGB of
/// the estimated squared error ([`SquaredError`]) over (mean_RGB^2 + floor). This is the papers' relMSE with the estimate
/// in place of the squared difference, and with a [`floor`](crate::stat::floor) relative to the picture.
/// [`Settings::error_coverage`](crate::render::Settings::error_coverage) says which errors it includes.
///
/// A black pixel whose surface could show light is not known to be dark: by Laplace's rule of succession the next of
/// n iterations brings light with probability 1 / (n + 2), and then its value 0 had the relative error 1. A pixel with
/// fewer than two finite samples, where others have them, also counts with the relative error 1.
///
/// A pixel whose value rests on one bright sample counts with about 1, because its mean is as wrong as its variance is
/// large: where such pixels dominate the error, the estimate is too small until they have been sampled several times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorEstimate {
    /// Mean over pixels of the variance relative to the squared value.
    pub variance: f64,
    /// Mean over pixels of the squared bias relative to the squared value, at least 0.
    pub squared_bias: f64,
    /// Mean squared relative error that the samples do not show: pixels without a known value, and [`UnseenLight`].
    pub unknown: f64,
}

/// Estimated error of a picture, and the light that photons have hardly brought to it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ErrorReport {
    /// Squared relative error, unseen light included; `None` before two iterations and while the picture is black.
    pub estimate: Option<ErrorEstimate>,
    /// Light that should reach the picture by photons, of which hardly any have arrived.
    pub unseen: UnseenLight,
}

impl ErrorEstimate {
    /// The relative error: the root of the sum of variance, squared bias and unknown squared error.
    pub fn root(&self) -> f64 {
        (self.variance + self.squared_bias + self.unknown).sqrt()
    }

    /// Estimates the error of pixels by their samples alone, without unseen light; `None` if no pixel is known to be lit.
    fn of_samples(state: &PixelState<'_>) -> Option<ErrorEstimate> {
        let (own, compared) = (state.settings.levels.picture_level(), state.settings.compared_levels());
        let mut sum = ErrorEstimate::default();
        let mut lit = false;
        for (pixel, &mean) in state.pixels.iter().zip(&state.values) {
            let Some(error) = SquaredError::of(pixel, own, compared) else {
                sum.unknown += 1.0;
                continue;
            };
            if mean == 0.0 && could_show_light(pixel) {
                sum.unknown += 1.0 / (f64::from(pixel.iterations) + 2.0);
                continue;
            }
            let scale = 1.0 / (3.0 * (mean * mean + state.floor));
            sum.variance += pixel.variance_by_quarters().unwrap_or(error.variance).element_sum() * scale;
            sum.squared_bias += error.squared_bias.element_sum() * scale;
            lit |= mean != 0.0;
        }
        let count = state.pixels.len() as f64;
        lit.then(|| ErrorEstimate {
            variance: sum.variance / count,
            squared_bias: sum.squared_bias.max(0.0) / count,
            unknown: sum.unknown / count,
        })
    }
}

impl ErrorReport {
    /// Estimates the error of pixels after `light_paths` light paths.
    pub(super) fn new(state: &PixelState<'_>, photons: &PhotonRecord, light_paths: u64) -> ErrorReport {
        let unseen = photons.unseen(state, light_paths);
        let estimate = ErrorEstimate::of_samples(state)
            .map(|error| ErrorEstimate { unknown: error.unknown + unseen.squared, ..error });
        ErrorReport { estimate, unseen }
    }

    /// The relative error: the root of [`ErrorReport::estimate`]; `None` if there is no estimate.
    pub fn relative(&self) -> Option<f64> {
        self.estimate.map(|estimate| estimate.root())
    }
}

/// Whether a pixel sees a surface whose albedo is not black.
fn could_show_light(pixel: &PixelAccumulator) -> bool {
    pixel.depth().is_some() && pixel.albedo() != DVec3::ZERO
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::BandwidthState;
    use crate::math::{Rgb, Vec3};
    use crate::render::{Levels, Settings};
    use crate::transport::{Features, PixelSample};

    /// A pixel with `broken` samples that are not finite, then `finite` samples of `light`. Each sees a surface of this
    /// albedo, or none.
    fn pixel(finite: u64, broken: u64, light: Rgb, albedo: Option<Rgb>) -> PixelAccumulator {
        let mut pixel = PixelAccumulator::new(1, 0, [1.0; 2]);
        for pass in 1..=finite + broken {
            let depth = if albedo.is_some() { 1.0 } else { 0.0 };
            let features = Features { albedo: albedo.unwrap_or_default(), normal: Vec3::ZERO, depth, share: 1.0 };
            let direct = if pass > broken { light } else { Rgb::NAN };
            pixel.add(pass, &PixelSample { direct, features, ..PixelSample::default() }, None);
        }
        pixel
    }

    /// A pixel with two equal samples, so without error.
    fn certain() -> PixelAccumulator {
        pixel(2, 0, Rgb::ONE, None)
    }

    fn relative_error(pixels: &[PixelAccumulator]) -> Option<f64> {
        let settings = Settings { levels: Levels::new(1), ..Settings::default() };
        let bandwidths = BandwidthState::memoryless(settings.schedule(1));
        ErrorEstimate::of_samples(&PixelState::new(pixels, &bandwidths, &settings)).map(|error| error.root())
    }

    #[test]
    fn pixels_with_fewer_than_two_finite_samples_have_relative_error_one() {
        let rejected = || pixel(0, 2, Rgb::ONE, None);
        let once = || pixel(1, 1, Rgb::ONE, None);
        assert_eq!(relative_error(&[certain(), certain()]), Some(0.0));
        assert_eq!(relative_error(&[certain(), rejected(), certain(), certain()]), Some(0.5));
        assert_eq!(relative_error(&[certain(), once(), certain(), certain()]), Some(0.5));
        assert_eq!(relative_error(&[rejected(), once()]), None);
    }

    /// Two of four pixels are lit. A black pixel that shows a surface counts 1 / (iterations + 2), one that shows none
    /// counts nothing. A black picture has no estimate.
    #[test]
    fn black_pixels_with_a_surface_may_still_receive_light() {
        let empty = || pixel(14, 0, Rgb::ZERO, None);
        let dark = || pixel(14, 0, Rgb::ZERO, Some(Rgb::splat(0.5)));
        assert_eq!(relative_error(&[certain(), certain(), empty(), empty()]), Some(0.0));
        assert_eq!(relative_error(&[certain(), certain(), empty(), dark()]), Some(0.125));
        assert_eq!(relative_error(&[dark(), dark(), empty()]), None);
    }
}
