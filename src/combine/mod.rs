//! The learned combiner: turns the bandwidth levels of one render into one image with a smaller error.
//!
//! A network reads all levels, their variances and the features of the first hit, and outputs weights for the neighbours i
//! of each pixel c. Equation (6) of [Choi and Moon 2021] then combines the independent level y (the smallest bandwidth)
//! with the correlated levels z^j (all larger ones):
//!
//! ```text
//! out_c = 1/W sum_j sum_{i in window of c} w_i^j (y_i + z_c^j - z_i^j)
//! ```
//!
//! The result is consistent for any positive weights: it converges to the truth if every level does (their appendix A), so
//! that nothing is clamped here. [`tensor`] makes the network's input for a [`tile`], [`network`] runs it in ONNX Runtime
//! (found by [`runtime`]), and [`affinity`] or [`kernel`] evaluates equation (6) with its weights.
//!
//! Source: H. Choi, B. Moon, "Consistent Post-Reconstruction for Progressive Photon Mapping", Pacific Graphics 2021.

pub mod affinity;
pub mod kernel;
pub mod model;
pub mod network;
pub mod output;
pub mod runtime;
pub(crate) mod stack;
pub mod tensor;
pub mod tile;

#[cfg(test)]
mod tests;

use rayon::prelude::*;

use crate::error::Result;
use crate::film::Picture;
use model::OutputForm;
pub use model::{Model, Purpose};
pub use network::Network;
use output::NetworkOutput;
pub use runtime::Runtime;
pub use stack::LevelStack;
use tensor::Normalisation;
use tile::Tile;

/// A loaded neural network that combines the bandwidth levels of a render into one picture.
pub struct Combiner {
    network: Network,
}

/// The network's weights for equation (6) over one tile, in one of two forms.
#[derive(Debug)]
enum Weights {
    /// Affinities from features, see [`affinity`].
    Features(NetworkOutput),
    /// Explicit weights for every pixel of the window, see [`kernel`].
    Kernel(NetworkOutput),
}

impl Combiner {
    /// A combiner by a network that outputs weights.
    pub fn new(network: Network) -> Self {
        Combiner { network }
    }

    /// The network's metadata: its numbers of levels and its window, among others.
    pub fn metadata(&self) -> &model::Metadata {
        self.network.metadata()
    }

    /// Combines the bandwidth levels of a stack into one picture, in the units of the levels.
    ///
    /// A pixel that is not finite in every level contributes to no neighbour. Its own result is its first finite level, else
    /// the mean of the finite pixels in its window, else black.
    ///
    /// # Errors
    /// [`ErrorKind::Image`](crate::error::ErrorKind::Image): planes differ in size, or the number of levels is not the
    /// network's; [`ErrorKind::Model`](crate::error::ErrorKind::Model): the network fails.
    pub fn run(&mut self, stack: &LevelStack) -> Result<Picture> {
        let pixels = self.network.metadata().tile_pixels();
        self.run_tiled(stack, pixels)
    }

    /// [`run`](Self::run) in tiles of about `pixels` pixels; their size changes the result by rounding only.
    pub(crate) fn run_tiled(&mut self, stack: &LevelStack, pixels: usize) -> Result<Picture> {
        let metadata = self.network.metadata().clone();
        stack.check(metadata.levels)?;
        let valid = stack.valid();
        let normalisation = Normalisation::of(stack);
        let input = |rect| tensor::fill(stack, &normalisation, rect);
        let combined = |tile: &Tile, output| {
            let weights = match metadata.form {
                OutputForm::Weights => Weights::Kernel(output),
                _ => Weights::Features(output),
            };
            combine_tile(stack, &valid, tile, &weights)
        };
        let mut image = self.network.run_tiled(stack.size, pixels, input, combined)?;
        stack::fill_invalid(stack, &valid, metadata.window / 2, &mut image);
        Ok(image)
    }
}

/// Sums of equation (6) at one pixel, over all pairs of bandwidth levels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// sum of w (y_i + z_c - z_i), RGB.
    pub value: [f32; 3],
    /// W, the sum of w.
    pub weight: f32,
}

/// The colours that equation (6) gives the pixels of a tile's core, row by row. `valid`: finite in all levels, per
/// pixel.
fn combine_tile(stack: &LevelStack, valid: &[bool], tile: &Tile, weights: &Weights) -> Vec<[f32; 3]> {
    let mut sums = vec![Sums::default(); tile.core.width() * tile.core.height()];
    for pair in 0..stack.levels.len() - 1 {
        match weights {
            Weights::Features(output) => affinity::add_pair(stack, valid, tile.core, output, pair, &mut sums),
            Weights::Kernel(output) => kernel::add_pair(stack, valid, tile.core, output, pair, &mut sums),
        }
    }
    if let Weights::Features(output) = weights {
        affinity::add_identities(stack, tile.core, output, &mut sums);
    }
    sums.par_iter().map(|s| s.value.map(|v| v / s.weight)).collect()
}
