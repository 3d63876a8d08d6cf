//! Small renders of the same view: their settings, and what their pixels are worth.

use crate::estimator::{InitialBandwidth, PixelAccumulator};
use crate::film::Size;
use crate::finish::window;
use crate::math::DVec3;
use crate::photon::MAX_NEIGHBOURS;
use crate::render::{Levels, Settings, Shard};
use crate::stat::median;
use crate::transport::MAX_LEVELS;

/// Share of the light paths that are sent to weigh effects.
pub(super) const PHOTONS: f64 = 0.125;
/// Share of the pixels that are left out of means, those of the largest noise: a bright sample in a hundred or so of
/// pixels says next to nothing about how often there is one.
pub(super) const WORST: f64 = 0.01;

/// Settings of a small render: those of the large one with a share of its light paths, in bandwidths as much wider as
/// the same number of neighbours asks for.
pub fn pilot_settings(of: &Settings, photons: f64) -> Settings {
    widened(of, photons, 1.0 / photons as f32)
}

/// With a share of the light paths, found in so many times the area.
fn widened(of: &Settings, photons: f64, area: f32) -> Settings {
    Settings {
        photons: ((f64::from(of.photons) * photons) as u32).max(1),
        max_initial_bandwidth: [of.max_initial_bandwidth[0] * area.sqrt(), of.max_initial_bandwidth[1] * area.cbrt()],
        iterations: None,
        time: None,
        target_error: None,
        techniques: false,
        shard: Shard { index: 0, count: 1 },
        ..of.clone()
    }
}

/// The same with all levels, level 1 by an eye path of its own, which [`values`] asks for.
pub(super) fn with_levels(of: &Settings, photons: f64) -> Settings {
    // Bandwidths that follow counts shrink on their own.
    let method = of.method.pilot_method();
    // One level alone is what of several is the second largest, of half the area.
    let larger = if of.levels.count == 1 { 2 } else { 1 };
    let initial_bandwidth = match of.initial_bandwidth {
        InitialBandwidth::Nearest(k) => InitialBandwidth::Nearest((larger * k).min(MAX_NEIGHBOURS)),
        other => other,
    };
    let levels = Levels::decorrelated(if method.has_levels() { MAX_LEVELS } else { 1 });
    Settings { method, levels, initial_bandwidth, ..widened(of, photons, larger as f32 / photons as f32) }
}

pub(super) fn mean(v: DVec3) -> f64 {
    v.element_sum() / 3.0
}

/// What makes squares relative to the value of a pixel, above the [`floor`](crate::stat::floor) of the picture.
pub(super) fn scale(value: f64, floor: f64) -> f64 {
    1.0 / (value * value + floor)
}

/// What pixels are worth, so that errors can be relative to it: the median of the neighbourhood, at the smoothest of
/// `levels`. A pixel's own mean would not do: where one bright sample is all that it has, it is as large as its error.
/// It counts where two eye paths agree on it, for lamps stand out.
pub(super) fn values(pixels: &[PixelAccumulator], (width, height): (u32, u32), levels: Levels) -> Vec<f64> {
    let smoothest = levels.count - 1;
    const REACH: usize = 2;
    let size = Size { width: width as usize, height: height as usize };
    let value = |index: usize| {
        let near = window(size, index, REACH);
        let mut near: Vec<f64> = near.map(|index| mean(pixels[index].mean(smoothest))).collect();
        let median = median(&mut near, f64::total_cmp).unwrap_or(0.0);
        let own = &pixels[index];
        if levels.two_paths { median.max(mean(own.mean(0)).min(mean(own.mean(smoothest)))) } else { median }
    };
    (0..pixels.len()).map(value).collect()
}
