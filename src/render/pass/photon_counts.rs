//! Photons of the maps, and samples of pixels that they have reached.

use crate::photon::{ByKind, Kind};
use serde::{Deserialize, Serialize};

/// Photons of surfaces and what they have brought, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PhotonCounts {
    /// Photons in the maps of all iterations.
    pub stored: ByKind<u64>,
    /// Samples of pixels to which photons have brought light.
    pub gathered: ByKind<u64>,
}

impl PhotonCounts {
    /// Adds the counts of other iterations.
    pub fn add(&mut self, other: &PhotonCounts) {
        for kind in Kind::ALL.map(|kind| kind as usize) {
            self.stored[kind] += other.stored[kind];
            self.gathered[kind] += other.gathered[kind];
        }
    }
}
