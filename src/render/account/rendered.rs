//! The result of a render: pixels, bandwidths, statistics and estimated error.

use super::error_estimate::ErrorReport;
use super::history::StopReason;
use super::pixel_state::PixelState;
use super::rejections::Rejections;
use super::stats::RenderStats;
use crate::estimator::{BandwidthState, PixelAccumulator};
use crate::photon::Kind;
use crate::render::pass::{TechniquePicture, sample_bytes};
use crate::render::settings::Settings;

/// The result of a render: its pixels, bandwidths, statistics and estimated error.
pub struct Rendered {
    /// Width of the picture (pixels).
    pub width: u32,
    /// Height of the picture (pixels).
    pub height: u32,
    /// Accumulated samples of each pixel, row by row from the top.
    pub pixels: Vec<PixelAccumulator>,
    /// One picture per sampling technique, if [`Settings::techniques`] is set and the method has several; empty
    /// otherwise.
    pub techniques: Vec<TechniquePicture>,
    /// Kernel bandwidths of all pixels in the last iteration.
    pub bandwidths: BandwidthState,
    /// Settings of the render.
    pub settings: Settings,
    /// Counts, times and error history of the render.
    pub stats: RenderStats,
    /// Estimated error of the picture.
    pub error: ErrorReport,
    /// Why the render stopped.
    pub stop: StopReason,
}

impl Rendered {
    /// Bytes per pixel: its sums with those of bandwidth levels and light groups, and the samples that one iteration
    /// keeps of it ([`sample_bytes`]).
    pub fn bytes_per_pixel(&self) -> [usize; 2] {
        [self.pixels.first().map_or(0, PixelAccumulator::size), sample_bytes(&self.settings)]
    }

    /// Whether the photon map had no room for the photons of all light paths; only for a method that traces one map.
    pub fn map_is_full(&self) -> bool {
        let RenderStats { iterations, light_paths, .. } = self.stats;
        self.settings.method.has_one_map() && iterations > 0 && light_paths < u64::from(self.settings.photons)
    }

    /// Estimates the error anew, from the pixels and statistics as they are now.
    pub fn estimate_error(&self) -> ErrorReport {
        self.stats.estimate_error(&PixelState::new(&self.pixels, &self.bandwidths, &self.settings))
    }

    /// Squared bandwidth of photons of `kind` in the last iteration at the pixel `index` (square scene units); level 0
    /// is the smallest.
    pub fn bandwidth2(&self, index: usize, kind: Kind, level: usize) -> f32 {
        self.bandwidths.bandwidth2(index, &self.pixels[index], kind, level)
    }

    /// Number of samples of pixels that were rejected because they were not finite.
    pub fn rejected(&self) -> u64 {
        self.rejections().rejected()
    }

    /// Counts of samples, photons and light paths that were rejected because they were not finite.
    pub fn rejections(&self) -> Rejections {
        Rejections::count(&self.pixels, self.stats.light_rejected)
    }
}
