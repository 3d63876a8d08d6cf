//! Settings of small renders of the same view, and the values that errors of their pixels are relative to.

use crate::estimator::PixelAccumulator;
use crate::film::Size;
use crate::finish::window;
use crate::math::DVec3;
use crate::photon::MAX_NEIGHBOURS;
use crate::render::{InitialBandwidth, Levels, Settings, Shard};
use crate::stat::median;
use crate::transport::MAX_LEVELS;

/// Share of the render's light paths per iteration in pictures that measure effects.
pub(super) const EFFECTS_PHOTON_SHARE: f64 = 0.125;
/// Share of the pixels, those with the largest noise, that means over a pilot's pixels leave out. One bright sample in
/// about a hundred pixels says next to nothing about how frequent such samples are.
pub(super) const TRIMMED_PILOT_SHARE: f64 = 0.01;
/// Pixels on each side of the middle one in the window of a median.
const MEDIAN_REACH: usize = 2;

/// Settings of a pilot, a small render: `photon_share` of the light paths, and bandwidths as much larger as an equal
/// number of neighbours needs.
pub fn pilot_settings(settings: &Settings, photon_share: f64) -> Settings {
    with_fewer_photons(settings, photon_share, 1.0 / photon_share as f32)
}

/// Reduces the light paths to `photon_share` and enlarges the area of the largest bandwidths by `area_factor`.
fn with_fewer_photons(settings: &Settings, photon_share: f64, area_factor: f32) -> Settings {
    let [surface, volume] = settings.max_initial_bandwidth;
    Settings {
        photons: ((f64::from(settings.photons) * photon_share) as u32).max(1),
        max_initial_bandwidth: [surface * area_factor.sqrt(), volume * area_factor.cbrt()],
        iterations: None,
        time: None,
        target_error: None,
        techniques: false,
        shard: Shard { index: 0, count: 1 },
        ..settings.clone()
    }
}

/// Settings like [`pilot_settings`] with all bandwidth levels, and a camera path for level 1 alone, which
/// [`reference_values`] needs.
pub(super) fn with_all_levels(settings: &Settings, photon_share: f64) -> Settings {
    // Bandwidths that follow photon counts do not keep the ratio of their levels.
    let method = settings.method.pilot_method();
    // A single level is like the second largest of several, which has half the area of the largest.
    let larger = if settings.levels.count == 1 { 2 } else { 1 };
    let initial_bandwidth = match settings.initial_bandwidth {
        InitialBandwidth::Nearest(k) => InitialBandwidth::Nearest((larger * k).min(MAX_NEIGHBOURS)),
        other => other,
    };
    let levels = Levels::decorrelated(if method.has_levels() { MAX_LEVELS } else { 1 });
    let fewer = with_fewer_photons(settings, photon_share, larger as f32 / photon_share as f32);
    Settings { method, levels, initial_bandwidth, ..fewer }
}

/// Mean over red, green and blue.
pub(super) fn mean(v: DVec3) -> f64 {
    v.element_sum() / 3.0
}

/// Weight that makes a squared difference relative to the value of a pixel, with the [`floor`](crate::stat::floor) of the
/// picture.
pub(super) fn relative_weight(value: f64, floor: f64) -> f64 {
    1.0 / (value * value + floor)
}

/// Values of pixels that errors are relative to: the median of the neighbourhood at the level with the largest bandwidth.
/// The mean of the pixel itself would hide errors: where one bright sample is all light of a pixel, the mean is as large
/// as the error. It is used where it exceeds the median and two camera paths agree on it, as on visible lights.
pub(super) fn reference_values(pixels: &[PixelAccumulator], (width, height): (u32, u32), levels: Levels) -> Vec<f64> {
    let smoothest = levels.count - 1;
    let medians = median_around((width, height), |index| mean(pixels[index].mean(smoothest)));
    let value = |(own, median): (&PixelAccumulator, f64)| {
        if levels.two_paths { median.max(mean(own.mean(0)).min(mean(own.mean(smoothest)))) } else { median }
    };
    pixels.iter().zip(medians).map(value).collect()
}

/// Median of the values around each pixel.
pub(super) fn median_around((width, height): (u32, u32), value: impl Fn(usize) -> f64) -> Vec<f64> {
    let size = Size { width: width as usize, height: height as usize };
    let around = |index: usize| {
        let mut near: Vec<f64> = window(size, index, MEDIAN_REACH).map(&value).collect();
        median(&mut near, f64::total_cmp).unwrap_or(0.0)
    };
    (0..size.pixels()).map(around).collect()
}
