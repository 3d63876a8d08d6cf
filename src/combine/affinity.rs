//! Equation (6) with pairwise weights, from the network output `features`.
//!
//! For each pixel i and pair j of levels the network outputs a point phi_i^j of a low-dimensional space and three scalars.
//! The weight of neighbour i for centre c is always positive:
//!
//! ```text
//! w_i^j = exp(source_i^j + centre_c^j - exp(falloff_c^j) |c - i|^2 - |phi_c^j - phi_i^j|^2)
//! ```
//!
//! with |c - i| in steps of the window. Channels, of P pairs and D dimensions: phi (P D, pair by pair), source (P),
//! centre (P), falloff (P). A network with tens of outputs so defines windows of hundreds of weights: two loops over eight
//! pixels at a time replace the paper's last layer (1444 filters).
//!
//! A network can have several windows, whose steps are its dilations; each has all these channels. After them, a channel
//! for each of its identities holds the logarithm of the weight of z_c^j alone: level 1 is too noisy to correct the bias of
//! a level whose bandwidth is as large as the window.

use std::array::from_fn;

use rayon::prelude::*;

use super::Sums;
use super::output::{NetworkOutput, Rect};
use super::stack::LevelStack;

/// Network output channels per pair of bandwidth levels, besides the feature space: source, centre, falloff.
pub const SCALARS: usize = 3;

/// Largest number of dimensions of the feature space.
pub const MAX_DIMENSIONS: usize = 8;

/// Maximum exponent of an affinity in powers of two (exp(-60)), so that every weight stays positive in f32.
const MAX_DISTANCE: f32 = 60.0 * std::f32::consts::LOG2_E;

/// Least and greatest value of the network's outputs source and centre, as in training; NaN counts as 0.
const LOG_WEIGHT: (f32, f32) = (-12.0, 12.0);
/// Least and greatest value of the network's output falloff, as in training; NaN counts as 0.
const LOG_FALLOFF: (f32, f32) = (-20.0, 0.0);

/// Pixels per SIMD block.
const LANES: usize = 8;

type Lanes = [f32; LANES];

/// Adds the terms of pair `pair` (bandwidth levels 1 and `pair` + 2) of equation (6) to `sums`, over the pixels of
/// `core`.
///
/// `features` covers `core` and a window's radius around it within the image; `valid` says for each pixel of the image
/// whether it can be a neighbour.
pub fn add_pair(
    stack: &LevelStack,
    valid: &[bool],
    core: Rect,
    features: &NetworkOutput,
    pair: usize,
    sums: &mut [Sums],
) {
    let pairs = stack.levels.len() - 1;
    let add = match features.group_channels() / pairs - SCALARS {
        1 => add::<1>,
        2 => add::<2>,
        3 => add::<3>,
        4 => add::<4>,
        5 => add::<5>,
        6 => add::<6>,
        7 => add::<7>,
        _ => add::<MAX_DIMENSIONS>,
    };
    for (group, dilation) in features.dilations.iter().enumerate() {
        let window = Window { pair, dilation: *dilation, first: group * features.group_channels() };
        add(stack, valid, core, features, window, sums);
    }
}

/// Adds the terms of the identities to `sums`: z_c of some pairs, each with a weight of its own.
pub fn add_identities(stack: &LevelStack, core: Rect, features: &NetworkOutput, sums: &mut [Sums]) {
    let first = features.dilations.len() * features.group_channels();
    for (k, pair) in features.identities.iter().enumerate() {
        for (y, sums) in sums.chunks_mut(core.width()).enumerate() {
            let image_y = core.y0 + y;
            let weights = &features.row(first + k, image_y)[core.x0 - features.rect.x0..];
            let correlated = &stack.levels[pair + 1][image_y * stack.size.width + core.x0..];
            for ((sum, weight), z) in sums.iter_mut().zip(weights).zip(correlated) {
                let weight = exp_bounded(*weight, LOG_WEIGHT);
                sum.value = from_fn(|c| sum.value[c] + weight * z[c]);
                sum.weight += weight;
            }
        }
    }
}

/// The window of a pair of levels: the distance of its pixels, and its first channel in the network's output.
#[derive(Clone, Copy)]
struct Window {
    pair: usize,
    dilation: usize,
    first: usize,
}

fn add<const D: usize>(
    stack: &LevelStack,
    valid: &[bool],
    core: Rect,
    features: &NetworkOutput,
    window: Window,
    sums: &mut [Sums],
) {
    let pair = window.pair;
    let neighbours = Neighbours::<D>::gather(stack, valid, core, features, window);
    let (_, centre, falloff) = scalar_channels::<D>(stack.levels.len() - 1, window);
    sums.par_chunks_mut(core.width()).enumerate().for_each(|(y, sums)| {
        let image_y = core.y0 + y;
        let from = core.x0 - features.rect.x0;
        let scalar = |channel: usize| &features.row(channel, image_y)[from..from + core.width()];
        let (centre, falloff) = (scalar(centre), scalar(falloff));
        let correlated = &stack.levels[pair + 1][image_y * stack.size.width + core.x0..][..core.width()];
        for (block, sums) in sums.chunks_mut(LANES).enumerate() {
            let x = block * LANES;
            let falloff = from_fn(|l| {
                falloff.get(x + l).map_or(0.0, |f| std::f32::consts::LOG2_E * exp_bounded(*f, LOG_FALLOFF))
            });
            let (difference, weight) = neighbours.window_sums(x, y, falloff);
            for (l, sum) in sums.iter_mut().enumerate() {
                let scale = exp_bounded(centre[x + l], LOG_WEIGHT);
                // The sums of an invalid centre are replaced later; they only must not panic.
                let z = correlated[x + l];
                sum.value = from_fn(|c| sum.value[c] + scale * (difference[c][l] + z[c] * weight[l]));
                sum.weight += scale * weight[l];
            }
        }
    });
}

/// Inputs of equation (6) from every neighbour, in padded planes around the core, so that the loops test no bounds.
struct Neighbours<const D: usize> {
    /// Pixels along the side of the window.
    side: usize,
    /// Distance of these pixels in pixels of the image.
    dilation: usize,
    /// Distance of the outermost pixels from the centre in pixels of the image.
    radius: usize,
    pitch: usize,
    /// The network's features of each pixel, phi, scaled so that squared distances are exponents of two; one plane
    /// each.
    phi: [Vec<f32>; D],
    /// exp(source), zero outside the image and at invalid pixels.
    weight: Vec<f32>,
    /// Difference of the two levels, y - z, in RGB.
    difference: [Vec<f32>; 3],
}

impl<const D: usize> Neighbours<D> {
    fn gather(stack: &LevelStack, valid: &[bool], core: Rect, features: &NetworkOutput, window: Window) -> Self {
        let (pair, dilation) = (window.pair, window.dilation);
        let radius = features.window / 2 * dilation;
        let pitch = core.width().next_multiple_of(LANES) + 2 * radius;
        let rows = core.height() + 2 * radius;
        let (source, ..) = scalar_channels::<D>(stack.levels.len() - 1, window);
        // Image columns in the planes, and their offset in a plane's row.
        let (x0, x1) = (core.x0.saturating_sub(radius), (core.x1 + radius).min(stack.size.width));
        let offset = x0 + radius - core.x0;
        let plane = |value: &(dyn Fn(usize, &mut [f32]) + Sync)| {
            let mut plane = vec![0.0; pitch * rows];
            plane.par_chunks_mut(pitch).enumerate().for_each(|(v, row)| {
                let Some(y) = (core.y0 + v).checked_sub(radius).filter(|y| *y < stack.size.height) else { return };
                value(y, &mut row[offset..offset + x1 - x0]);
            });
            plane
        };
        let channel = |index: usize, f: fn(f32) -> f32| {
            plane(&move |y, row| {
                let values = &features.row(index, y)[x0 - features.rect.x0..];
                row.iter_mut().zip(values).for_each(|(out, value)| *out = f(*value));
            })
        };
        let mask = |y: usize| &valid[y * stack.size.width + x0..y * stack.size.width + x1];
        let mut weight = channel(source, |x| exp_bounded(x, LOG_WEIGHT));
        weight.par_chunks_mut(pitch).enumerate().for_each(|(v, row)| {
            let Some(y) = (core.y0 + v).checked_sub(radius).filter(|y| *y < stack.size.height) else { return };
            row[offset..].iter_mut().zip(mask(y)).filter(|(_, valid)| !**valid).for_each(|(w, _)| *w = 0.0);
        });
        let difference = |c: usize| {
            plane(&move |y, row| {
                let start = y * stack.size.width + x0;
                let pixels = stack.levels[0][start..].iter().zip(&stack.levels[pair + 1][start..]).zip(mask(y));
                for (out, ((independent, correlated), valid)) in row.iter_mut().zip(pixels) {
                    // Zero times a value that is not finite would still be NaN.
                    *out = if *valid { independent[c] - correlated[c] } else { 0.0 };
                }
            })
        };
        let scaled = |x: f32| if x.is_finite() { x * std::f32::consts::LOG2_E.sqrt() } else { 0.0 };
        let phi = from_fn(|d| channel(window.first + pair * D + d, scaled));
        let side = features.window;
        Neighbours { side, dilation, radius, pitch, phi, weight, difference: from_fn(difference) }
    }

    /// Sums of w (y_i - z_i) and of w over the windows of the pixels (x .. x + LANES, y) of the core, without the centre's
    /// own factor. `falloff` is in powers of two.
    #[inline]
    fn window_sums(&self, x: usize, y: usize, falloff: Lanes) -> ([Lanes; 3], Lanes) {
        let centre_at = (y + self.radius) * self.pitch + x + self.radius;
        let centre: [Lanes; D] = from_fn(|d| lanes(&self.phi[d], centre_at));
        let (mut sums, mut total) = ([[0.0; LANES]; 3], [0.0; LANES]);
        let middle = (self.side / 2) as f32;
        for v in 0..self.side {
            // Slices of the length read, so that bounds are tested once per row.
            let from = (y + v * self.dilation) * self.pitch + x;
            let part = from..from + 2 * self.radius + LANES;
            let phi: [&[f32]; D] = from_fn(|d| &self.phi[d][part.clone()]);
            let difference: [&[f32]; 3] = from_fn(|c| &self.difference[c][part.clone()]);
            let weight = &self.weight[part.clone()];
            let dy = v as f32 - middle;
            for u in 0..self.side {
                let dx = u as f32 - middle;
                let at = u * self.dilation;
                let squared = dx * dx + dy * dy;
                let mut distance: Lanes = from_fn(|l| falloff[l] * squared);
                for (centre, row) in centre.iter().zip(phi) {
                    let phi = lanes(row, at);
                    for l in 0..LANES {
                        let step = centre[l] - phi[l];
                        distance[l] = fma(step, step, distance[l]);
                    }
                }
                let source = lanes(weight, at);
                let w: Lanes = from_fn(|l| source[l] * exp2_minus(distance[l]));
                for (sum, row) in sums.iter_mut().zip(difference) {
                    let difference = lanes(row, at);
                    for l in 0..LANES {
                        sum[l] = fma(w[l], difference[l], sum[l]);
                    }
                }
                for l in 0..LANES {
                    total[l] += w[l];
                }
            }
        }
        (sums, total)
    }
}

/// The SIMD block of [`LANES`] values of `plane` from index `start` on.
#[inline(always)]
fn lanes(plane: &[f32], start: usize) -> Lanes {
    plane[start..start + LANES].try_into().unwrap_or([0.0; LANES])
}

/// a b + c, fused if the target has the instruction; otherwise `mul_add` is a slow library call.
#[inline(always)]
fn fma(a: f32, b: f32, c: f32) -> f32 {
    if cfg!(any(target_feature = "fma", target_arch = "aarch64")) { a.mul_add(b, c) } else { a * b + c }
}

/// 2^-x for x >= 0, with x clamped at [`MAX_DISTANCE`]; relative error below 5e-7. Has no branch, so that loops vectorise.
#[inline(always)]
fn exp2_minus(x: f32) -> f32 {
    // 2^t = 2^n 2^f with n the nearest integer: after adding 1.5 * 2^23 the last bits of the sum hold n.
    const SHIFT: f32 = 12_582_912.0;
    let t = -if x < MAX_DISTANCE { x } else { MAX_DISTANCE };
    let shifted = t + SHIFT;
    let f = t - (shifted - SHIFT);
    let mut p = TAYLOR[0];
    for coefficient in &TAYLOR[1..] {
        p = fma(p, f, *coefficient);
    }
    f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23))
}

/// Taylor's series of 2^f = exp(f ln 2) to degree 6, highest power first; |f| <= 1/2.
const TAYLOR: [f32; 7] = {
    let mut coefficients = [1.0; 7];
    let (mut term, mut k) = (1.0f64, 0);
    while k < 6 {
        k += 1;
        term *= std::f64::consts::LN_2 / k as f64;
        coefficients[6 - k] = term as f32;
    }
    coefficients
};

/// exp(x) with x clamped to a range; exp(0) for NaN.
fn exp_bounded(x: f32, (least, most): (f32, f32)) -> f32 {
    if x.is_nan() { 1.0 } else { x.clamp(least, most).exp() }
}

/// Indices of the network's channels source, centre and falloff of a window of one of `pairs` pairs.
const fn scalar_channels<const D: usize>(pairs: usize, window: Window) -> (usize, usize, usize) {
    let first = window.first + pairs * D + window.pair;
    (first, first + pairs, first + 2 * pairs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_is_accurate_and_positive() {
        for k in 0..=860_000 {
            let x = k as f32 * 1e-4;
            let (got, want) = (f64::from(exp2_minus(x)), (-f64::from(x)).exp2());
            assert!((got / want - 1.0).abs() < 5e-7, "2^-{x} = {got:e}, not {want:e}");
        }
        for x in [0.0, 1.0, 86.0] {
            assert_eq!(exp2_minus(x), (-x).exp2());
        }
        assert!(exp2_minus(f32::INFINITY) > 0.0 && exp2_minus(f32::MAX) > 0.0);
    }
}
