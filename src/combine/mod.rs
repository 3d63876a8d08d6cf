//! The learned combiner: levels of one progressive render in, one better image out.
//!
//! A network looks at all levels, their variances and the first hit's features, and says how much the neighbours
//! i of each pixel c count; equation (6) of [Choi and Moon 2021] then combines the independent level y (the smallest
//! bandwidth) with the correlated levels z^j (all larger ones):
//!
//! ```text
//! out_c = 1/W sum_j sum_{i in window of c} w_i^j (y_i + z_c^j - z_i^j)
//! ```
//!
//! Whatever positive weights the network gives, the result is consistent: it tends to the truth where every level does
//! (their appendix A), so nothing is clamped here. Order of work: [`tensor`] makes the network's input for a
//! [`tile`], [`network`] runs it in ONNX Runtime (found by [`runtime`]), [`affinity`] or [`kernel`] evaluates
//! equation (6) with the weights it gives.
//!
//! Source: H. Choi, B. Moon, "Consistent Post-Reconstruction for Progressive Photon Mapping", Pacific Graphics 2021.

pub mod affinity;
pub mod kernel;
mod map;
pub mod model;
pub mod network;
pub mod runtime;
mod stack;
pub mod tensor;
pub mod tile;

#[cfg(test)]
mod tests;

use rayon::prelude::*;

use crate::error::Result;
use crate::film::Picture;
pub use model::Model;
use network::{Network, Weights};
pub use runtime::Runtime;
pub use stack::LevelStack;
use tensor::Normalisation;
use tile::Tile;

/// A network ready to combine stacks of levels.
pub struct Combiner {
    network: Network,
}

impl Combiner {
    /// Loads `model` into `runtime`, with as many threads as the current rayon pool has.
    ///
    /// # Errors
    /// [`ErrorKind::Model`](crate::error::ErrorKind::Model) when the file is no network, or not one of ours.
    pub fn new(model: &Model, runtime: &Runtime) -> Result<Self> {
        Ok(Combiner { network: Network::load(model, runtime, rayon::current_num_threads())? })
    }

    /// What the network says about itself.
    pub fn facts(&self) -> &model::Facts {
        self.network.facts()
    }

    /// The combined image, row by row from the top, in the units of the levels.
    ///
    /// A pixel with a value that is not finite in any level counts for no neighbour; its own result is its first finite
    /// level, else the mean of its finite neighbours in the window, else black.
    ///
    /// # Errors
    /// [`ErrorKind::Image`](crate::error::ErrorKind::Image) when planes differ in size or the number of levels is not the
    /// network's; [`ErrorKind::Model`](crate::error::ErrorKind::Model) when the network fails.
    pub fn run(&mut self, stack: &LevelStack) -> Result<Picture> {
        let pixels = self.network.facts().tile_pixels();
        self.run_tiled(stack, pixels)
    }

    /// [`run`](Self::run) with tiles of about `pixels` pixels; the result does not depend on it beyond rounding.
    pub(crate) fn run_tiled(&mut self, stack: &LevelStack, pixels: usize) -> Result<Picture> {
        let facts = self.network.facts().clone();
        stack.check(facts.levels)?;
        let valid = stack.valid();
        let normalisation = Normalisation::of(stack);
        let mut image = Picture::filled(stack.size, [0.0; 3]);
        for tile in tile::tiles(stack.size, &facts, pixels) {
            let input = tensor::fill(stack, &normalisation, tile.input);
            let weights = self.network.run(&input, tile.input)?;
            let part = combine_tile(stack, &valid, &tile, &weights);
            for (y, row) in part.chunks(tile.core.width()).enumerate() {
                let start = (tile.core.y0 + y) * stack.size.width + tile.core.x0;
                image[start..start + row.len()].copy_from_slice(row);
            }
        }
        stack::fill_invalid(stack, &valid, facts.window / 2, &mut image);
        Ok(image)
    }
}

/// Weighted sums of equation (6) at one pixel: over all pairs, of the values and of the weights.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// sum of w (y_i + z_c - z_i), RGB.
    pub value: [f32; 3],
    /// W, the sum of w.
    pub weight: f32,
}

/// Equation (6) over a tile's core.
fn combine_tile(stack: &LevelStack, valid: &[bool], tile: &Tile, weights: &Weights) -> Vec<[f32; 3]> {
    let mut sums = vec![Sums::default(); tile.core.width() * tile.core.height()];
    for pair in 0..stack.levels.len() - 1 {
        match weights {
            Weights::Features(map) => affinity::add_pair(stack, valid, tile.core, map, pair, &mut sums),
            Weights::Kernel(map) => kernel::add_pair(stack, valid, tile.core, map, pair, &mut sums),
        }
    }
    sums.par_iter().map(|s| s.value.map(|v| v / s.weight)).collect()
}
