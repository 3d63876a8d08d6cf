//! The two photon maps \[Jensen 1996\].

use super::map::PhotonMap;

/// What a photon has come through. Photons of caustics are dense where they are and have paths of their own sent to
/// make them; all others are sparse and even. Bandwidths that the one kind sets would be too small or too wide for the
/// other, so each has a map and bandwidths of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// At least one broad lobe or medium.
    Indirect,
    /// Narrow lobes alone.
    Caustic,
}

impl Kind {
    /// Both, in the order of [`ByKind`].
    pub const ALL: [Kind; 2] = [Kind::Indirect, Kind::Caustic];
}

/// Something of each kind, at `kind as usize`.
pub type ByKind<T> = [T; 2];

/// Adds more of each kind.
pub fn append<T>(all: &mut ByKind<Vec<T>>, more: ByKind<Vec<T>>) {
    for (all, more) in all.iter_mut().zip(more) {
        all.extend(more);
    }
}

/// Number of both.
pub fn count<T>(all: &ByKind<Vec<T>>) -> usize {
    all.iter().map(Vec::len).sum()
}

/// The photons on surfaces of a pass.
pub type PhotonMaps = ByKind<PhotonMap>;
