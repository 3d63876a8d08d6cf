//! Equation (6) with explicit weights, from the network output `weights` (the paper's own form).
//!
//! Channel (j K + v) K + u holds the weight w_i^j, for pair j (levels 1 and j + 2), of the neighbour
//! i = c + (u - K/2, v - K/2), K the window's side.

use std::array::from_fn;

use rayon::prelude::*;

use super::Sums;
use super::output::{NetworkOutput, Rect};
use super::stack::LevelStack;

/// Range to which the network's weights are clamped, so that they and their sums stay positive and finite.
const WEIGHT_RANGE: (f32, f32) = (1e-20, 1e20);

/// Adds the terms of pair `pair` of levels of equation (6) to `sums`, over the pixels of `core`, which `weights`
/// covers.
pub fn add_pair(
    stack: &LevelStack,
    valid: &[bool],
    core: Rect,
    weights: &NetworkOutput,
    pair: usize,
    sums: &mut [Sums],
) {
    let (side, radius) = (weights.window, weights.window / 2);
    let (independent, correlated) = (&stack.levels[0], &stack.levels[pair + 1]);
    sums.par_chunks_mut(core.width()).enumerate().for_each(|(y, sums)| {
        let y = core.y0 + y;
        // Sums of w (y_i - z_i) and of w. The centre's z is added once at the end, so that equal levels give no rounding
        // error.
        let mut window = vec![Sums::default(); sums.len()];
        for v in 0..side {
            let Some(row) = (y + v).checked_sub(radius).filter(|row| *row < stack.size.height) else { continue };
            for u in 0..side {
                let w = &weights.row((pair * side + v) * side + u, y)[core.x0 - weights.rect.x0..];
                for (x, (sum, w)) in (core.x0..).zip(window.iter_mut().zip(w)) {
                    let column = (x + u).checked_sub(radius).filter(|column| *column < stack.size.width);
                    let Some(i) = column.map(|column| row * stack.size.width + column).filter(|i| valid[*i]) else {
                        continue;
                    };
                    // Not `clamp`, which keeps NaN.
                    let w = w.max(WEIGHT_RANGE.0).min(WEIGHT_RANGE.1);
                    sum.value = from_fn(|c| sum.value[c] + w * (independent[i][c] - correlated[i][c]));
                    sum.weight += w;
                }
            }
        }
        let centre = &correlated[y * stack.size.width + core.x0..];
        for ((sum, part), z) in sums.iter_mut().zip(&window).zip(centre) {
            sum.value = from_fn(|c| sum.value[c] + (part.value[c] + z[c] * part.weight));
            sum.weight += part.weight;
        }
    });
}
