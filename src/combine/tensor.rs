//! The network's input: the order and scaling of its channels.
//!
//! Version 1 has 4 m + 7 channels for m levels (27 for five): RGB of the levels, standard deviations of the levels, albedo,
//! normal, depth. `scripts/lab/train/normalise.py` implements the same in Python; a test compares the two.

use rayon::prelude::*;

use super::output::Rect;
use super::stack::LevelStack;
use crate::film::{Picture, Size};
use crate::stat::median;

/// Version of the order and scaling of the network's input channels. A network's metadata states the version of its
/// training.
pub const VERSION: u32 = 1;

/// Standard deviations below this value, on the scale of log(1 + x), count as no noise.
const DEVIATION_FLOOR: f32 = 1e-3;

/// Depths from this value on, in scene units, are background (the EXR stores 1e10).
pub const BACKGROUND_DEPTH: f32 = 1e9;

/// The exposure leaves out the brightest 1 / `TRIMMED` of the pixels that are not black.
const TRIMMED: usize = 100;

/// Number of the network's input channels for `levels` bandwidth levels.
pub const fn channels(levels: usize) -> usize {
    4 * levels + 7
}

/// Content of one input channel of the network.
#[derive(Clone, Copy)]
enum Channel {
    /// A colour component of a bandwidth level: index of the level from 0, index of the component.
    Level(usize, usize),
    /// Standard deviation of a bandwidth level, by the index of the level from 0.
    Deviation(usize),
    Albedo(usize),
    Normal(usize),
    Depth,
}

/// The network's input channels for `levels` bandwidth levels, in order.
fn order(levels: usize) -> Vec<Channel> {
    let mut all: Vec<Channel> = (0..levels).flat_map(|j| (0..3).map(move |c| Channel::Level(j, c))).collect();
    all.extend((0..levels).map(Channel::Deviation));
    all.extend((0..3).map(Channel::Albedo));
    all.extend((0..3).map(Channel::Normal));
    all.push(Channel::Depth);
    all
}

/// Scales of a whole image, which make the network's input independent of the units of light and length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normalisation {
    /// Factor on radiance: one over a trimmed mean luminance of the level with the largest bandwidth.
    pub exposure: f32,
    /// Median depth of the pixels that are not background.
    pub depth: f32,
}

impl Normalisation {
    /// The scales of a picture by its smoothest estimate and its depth; 1 for an image without light or depth.
    pub fn new(smoothest: Option<&Picture>, depth: &[f32]) -> Self {
        Normalisation { exposure: exposure(smoothest), depth: median_depth(depth) }
    }

    /// The scales of the picture in `stack`; 1 for an image without light or depth.
    pub fn of(stack: &LevelStack) -> Self {
        Normalisation::new(stack.levels.last(), &stack.depth)
    }
}

/// One over the mean luminance of `level` without black pixels, so that the amount of background does not matter, and
/// without the brightest hundredth, so that fireflies do not.
fn exposure(level: Option<&Picture>) -> f32 {
    let luminance = |rgb: &[f32; 3]| {
        let [r, g, b] = rgb.map(finite);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    let lit = level.into_iter().flatten().map(luminance).filter(|l| *l > 0.0 && l.is_finite());
    let mut lit: Vec<f32> = lit.collect();
    if lit.is_empty() {
        return 1.0;
    }
    let kept = (lit.len() - lit.len() / TRIMMED).max(1);
    lit.select_nth_unstable_by(kept - 1, f32::total_cmp);
    let mean = lit[..kept].iter().map(|l| f64::from(*l)).sum::<f64>() / kept as f64;
    if mean > 1e-30 { (1.0 / mean) as f32 } else { 1.0 }
}

fn median_depth(depth: &[f32]) -> f32 {
    let mut seen: Vec<f32> = depth.iter().copied().filter(|d| *d > 0.0 && *d < BACKGROUND_DEPTH).collect();
    median(&mut seen, f32::total_cmp).unwrap_or(1.0)
}

/// The network's input for the pixels of `rect`, `[channel][y][x]`; zero outside the image, like the padding of a
/// convolution.
pub fn fill(stack: &LevelStack, normalisation: &Normalisation, rect: Rect) -> Vec<f32> {
    let order = order(stack.levels.len());
    rows(stack.size, order.len(), rect, |channel, start, out| row(stack, normalisation, order[channel], start, out))
}

/// A network's input of `channels` channels for the pixels of `rect` of a picture, `[channel][y][x]`; zero outside the
/// picture. `row` fills part of a row of a channel with consecutive pixels from an index on.
pub fn rows(size: Size, channels: usize, rect: Rect, row: impl Fn(usize, usize, &mut [f32]) + Sync) -> Vec<f32> {
    let mut data = vec![0.0; channels * rect.width() * rect.height()];
    // One chunk per row and channel: their size does not depend on the number of threads.
    data.par_chunks_mut(rect.width()).enumerate().for_each(|(k, out)| {
        let (channel, y) = (k / rect.height(), rect.y0 + k % rect.height());
        if y >= size.height {
            return;
        }
        let count = rect.width().min(size.width.saturating_sub(rect.x0));
        row(channel, y * size.width + rect.x0, &mut out[..count]);
    });
    data
}

/// Fills `out`, a row of one input channel, with consecutive pixels from index `start` on.
fn row(stack: &LevelStack, normalisation: &Normalisation, channel: Channel, start: usize, out: &mut [f32]) {
    let scale = normalisation.exposure;
    let n = start..start + out.len();
    match channel {
        Channel::Level(j, c) => {
            map(out, &stack.levels[j][n], |rgb| (finite(rgb[c]).max(0.0) * scale).ln_1p());
        }
        Channel::Deviation(j) => {
            let level = &stack.levels[j][n.clone()];
            for ((out, rgb), variance) in out.iter_mut().zip(level).zip(&stack.variances[j][n]) {
                // The deviation of log(1 + x) is that of x divided by 1 + x. The channel is its logarithm.
                let bright = mean(rgb.map(|v| finite(v).max(0.0) * scale));
                let deviation = mean(variance.map(|v| finite(v).max(0.0))).sqrt() * scale / (1.0 + bright);
                let floor = DEVIATION_FLOOR.ln();
                *out = finite(((deviation + DEVIATION_FLOOR).ln() - floor) / -floor);
            }
        }
        Channel::Albedo(c) => map(out, &stack.albedo[n], |rgb| finite(rgb[c]).clamp(0.0, 1.0)),
        Channel::Normal(c) => map(out, &stack.normal[n], |xyz| finite(xyz[c]).clamp(-1.0, 1.0)),
        Channel::Depth => map(out, &stack.depth[n], |d| {
            // Not `d >= BACKGROUND_DEPTH`, because NaN is background as well.
            if *d < BACKGROUND_DEPTH { d.max(0.0) / (d.max(0.0) + normalisation.depth) } else { 1.0 }
        }),
    }
}

fn map<T>(out: &mut [f32], source: &[T], f: impl Fn(&T) -> f32) {
    out.iter_mut().zip(source).for_each(|(out, value)| *out = f(value));
}

fn mean([r, g, b]: [f32; 3]) -> f32 {
    (r + g + b) / 3.0
}

/// `x`, or zero if it is not finite, because convolutions would spread it to the neighbours.
fn finite(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}
