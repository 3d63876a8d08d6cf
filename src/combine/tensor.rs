//! The network's input: which layer sits in which channel, how each is scaled. No other file knows.
//!
//! Version 1, for m levels 4 m + 7 channels (27 for five): the levels' RGB, the levels' deviations, albedo, normal,
//! depth. `scripts/lab/train/normalise.py` is the same in Python; a fixture holds the two together.

use rayon::prelude::*;

use super::map::Rect;
use super::stack::LevelStack;
use crate::film::Picture;
use crate::stat::median;

/// Version of channel order and scaling; a network states the one it was trained with.
pub const VERSION: u32 = 1;

/// Deviations below this, in tone-mapped units, are all "no noise".
const DEVIATION_FLOOR: f32 = 1e-3;

/// Depth from here on is background (the EXR writes 1e10).
const BACKGROUND_DEPTH: f32 = 1e9;

/// Part of the lit pixels, the brightest, that the exposure ignores: one in so many.
const TRIMMED: usize = 100;

/// Number of channels for `levels` levels.
pub const fn channels(levels: usize) -> usize {
    4 * levels + 7
}

/// What one channel shows.
#[derive(Clone, Copy)]
enum Channel {
    /// Level index, colour component.
    Level(usize, usize),
    /// Level index.
    Deviation(usize),
    Albedo(usize),
    Normal(usize),
    Depth,
}

/// The model's order.
fn order(levels: usize) -> Vec<Channel> {
    let mut all: Vec<Channel> = (0..levels).flat_map(|j| (0..3).map(move |c| Channel::Level(j, c))).collect();
    all.extend((0..levels).map(Channel::Deviation));
    all.extend((0..3).map(Channel::Albedo));
    all.extend((0..3).map(Channel::Normal));
    all.push(Channel::Depth);
    all
}

/// Scales of one whole image, so that neither light units nor scene units change the network's input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normalisation {
    /// Factor on radiance: reciprocal of a robust mean luminance of the smoothest level.
    pub exposure: f32,
    /// Median depth of what is not background.
    pub depth: f32,
}

impl Normalisation {
    /// The scales of `stack`; 1 where there is nothing to measure.
    pub fn of(stack: &LevelStack) -> Self {
        Normalisation { exposure: exposure(stack.levels.last()), depth: median_depth(&stack.depth) }
    }
}

/// The mean leaves out black pixels (how much background a picture has should not matter) and the brightest hundredth
/// (a firefly should not either).
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

/// The input of `rect`, `[channel][y][x]`; zero where `rect` leaves the image, as a convolution's padding is.
pub fn fill(stack: &LevelStack, normalisation: &Normalisation, rect: Rect) -> Vec<f32> {
    let (width, area) = (rect.width(), rect.width() * rect.height());
    let order = order(stack.levels.len());
    let mut data = vec![0.0; order.len() * area];
    // Rows of all channels are equal work: chunks of constant size whatever the number of threads.
    data.par_chunks_mut(width).enumerate().for_each(|(k, out)| {
        let (channel, y) = (order[k / rect.height()], rect.y0 + k % rect.height());
        if y >= stack.size.height {
            return;
        }
        let start = y * stack.size.width + rect.x0;
        let count = width.min(stack.size.width.saturating_sub(rect.x0));
        row(stack, normalisation, channel, start, &mut out[..count]);
    });
    data
}

/// One row of one channel, from pixel `start` on.
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
                // The deviation of log(1 + x): that of x over 1 + x, on a logarithmic scale.
                let bright = mean(rgb.map(|v| finite(v).max(0.0) * scale));
                let deviation = mean(variance.map(|v| finite(v).max(0.0))).sqrt() * scale / (1.0 + bright);
                let floor = DEVIATION_FLOOR.ln();
                *out = finite(((deviation + DEVIATION_FLOOR).ln() - floor) / -floor);
            }
        }
        Channel::Albedo(c) => map(out, &stack.albedo[n], |rgb| finite(rgb[c]).clamp(0.0, 1.0)),
        Channel::Normal(c) => map(out, &stack.normal[n], |xyz| finite(xyz[c]).clamp(-1.0, 1.0)),
        Channel::Depth => map(out, &stack.depth[n], |d| {
            // Not `d >= BACKGROUND_DEPTH`: a depth that is no number is background too.
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

/// `x`, or zero if it is not finite: one bad channel must not poison the neighbours through the convolutions.
fn finite(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}
