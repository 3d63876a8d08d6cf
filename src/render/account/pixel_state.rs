//! Pixels after an iteration, as error estimates read them.

use crate::estimator::{BandwidthState, PixelAccumulator};
use crate::photon::Kind;
use crate::render::settings::Settings;
use crate::stat::floor;
use crate::transport::Indirect;

/// Pixels and bandwidths of a render after its last iteration, from which its error is estimated.
pub(in crate::render) struct PixelState<'a> {
    pub pixels: &'a [PixelAccumulator],
    pub settings: &'a Settings,
    bandwidths: &'a BandwidthState,
    /// Value of each pixel, the mean of RGB, in the bandwidth level that is the picture.
    pub values: Vec<f64>,
    /// Floor of relative errors: added to the squared value by which a squared error is divided.
    pub floor: f64,
}

impl<'a> PixelState<'a> {
    pub fn new(
        pixels: &'a [PixelAccumulator],
        bandwidths: &'a BandwidthState,
        settings: &'a Settings,
    ) -> PixelState<'a> {
        let level = settings.levels.picture_level();
        let values: Vec<f64> = pixels.iter().map(|pixel| pixel.mean(level).element_sum() / 3.0).collect();
        let floor = floor::relative_to_mean(values.iter().copied());
        PixelState { pixels, settings, bandwidths, values, floor }
    }

    /// Squared bandwidth of photons of `kind` at the pixel `index`, in the picture's level (square scene units). With
    /// [`Indirect::Paths`] only caustic photons have one.
    pub fn bandwidth2(&self, index: usize, kind: Kind) -> f32 {
        let kind = if self.settings.indirect == Indirect::Paths { Kind::Caustic } else { kind };
        self.bandwidths.bandwidth2(index, &self.pixels[index], kind, self.settings.levels.picture_level())
    }
}
