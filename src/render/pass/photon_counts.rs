//! Numbers of photons in the maps, and of pixel samples that photons have reached.

use crate::photon::{ByKind, Kind};
use serde::{Deserialize, Serialize};

/// Numbers of surface photons stored, and of samples that gathered some, by kind (caustic, indirect).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PhotonCounts {
    /// Number of photons in the maps of all iterations.
    pub stored: ByKind<u64>,
    /// Number of samples of pixels that have gathered light from photons.
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
