//! The state of a render between two iterations, as checkpoints store it.

use crate::estimator::PixelAccumulator;
use crate::render::account::RenderStats;
use serde::{Deserialize, Serialize};

/// State of a render between two iterations. Pilots, guides and photon maps are not in it: they follow from scene, camera,
/// settings and the number of the iteration.
#[derive(Debug, Serialize, Deserialize)]
pub struct State<P = Vec<PixelAccumulator>> {
    /// Accumulated samples of each pixel, row by row from the top.
    pub(super) pixels: P,
    pub(super) counters: Counters,
    /// State of the method's passes, packed by them.
    pub(super) passes: Vec<u8>,
}

/// Counts of a render, and its position in its sequence of iterations.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Counters {
    pub(super) stats: RenderStats,
    /// Number of the next iteration, from 0.
    pub(super) next: u64,
    /// Number of iterations after which the error history gets its next entry.
    pub(super) next_record: u64,
    /// Wall-clock seconds spent on the pilot and other preparations, before the first iteration.
    pub(super) pilot_seconds: f64,
}

impl<P> State<P> {
    /// Exchanges the pixels of the state. Returns the state with the new pixels, and the old pixels.
    pub fn replace_pixels<Q>(self, pixels: Q) -> (State<Q>, P) {
        (State { pixels, counters: self.counters, passes: self.passes }, self.pixels)
    }
}

impl State {
    /// The state of a render whose light is recorded by the lobe of the first hit exactly if `lobes` is true; `None` if
    /// this is wanted and was not recorded.
    pub fn with_lobes(mut self, lobes: bool) -> Option<State> {
        if lobes {
            return self.pixels.iter().all(PixelAccumulator::has_lobes).then_some(self);
        }
        self.pixels = self.pixels.into_iter().map(|pixel| pixel.with_lobes(false)).collect();
        Some(self)
    }

    /// Iterations done.
    pub fn iterations(&self) -> u64 {
        self.counters.stats.iterations
    }
}
