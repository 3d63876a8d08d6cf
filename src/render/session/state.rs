//! The whole state of a render between two iterations, as it is saved and read again.

use crate::estimator::PixelAccumulator;
use crate::render::account::History;
use crate::render::account::PhotonRecord;
use crate::render::clock::Phases;
use crate::render::clock::Spent;
use serde::{Deserialize, Serialize};

/// The state. What follows from scene, camera and settings alone is not in it: pilots, guides, and maps of photons, which
/// are functions of the iteration's number.
#[derive(Debug, Serialize, Deserialize)]
pub struct State<P = Vec<PixelAccumulator>> {
    /// Pixels, row by row from the top.
    pub(super) pixels: P,
    /// All else.
    pub(super) rest: Rest,
}

/// What a state holds besides pixels.
#[derive(Debug, Serialize, Deserialize)]
pub struct Rest {
    /// The next iteration, from 0.
    pub(super) next: u64,
    /// Iterations done.
    pub(super) done: u64,
    /// Light paths emitted.
    pub(super) light_paths: u64,
    /// Photons of the last map.
    pub(super) photons: u64,
    /// Photons and light paths that were not finite.
    pub(super) rejected: u64,
    /// Photons stored and gathered.
    pub(super) photon_record: PhotonRecord,
    /// Iterations done when the error is recorded next.
    pub(super) next_record: u64,
    /// Error against time.
    pub(super) history: Vec<History>,
    /// Core-seconds per phase.
    pub(super) phases: Phases,
    /// Time spent.
    pub(super) spent: Spent,
    /// That of pilots.
    pub(super) pilot_seconds: f64,
    /// What the method's passes have learnt.
    pub(super) passes: Vec<u8>,
}

impl<P> State<P> {
    /// The same with other pixels, and its own.
    pub fn exchange<Q>(self, pixels: Q) -> (State<Q>, P) {
        (State { pixels, rest: self.rest }, self.pixels)
    }
}

impl State {
    /// Iterations done.
    pub fn iterations(&self) -> u64 {
        self.rest.done
    }
}
