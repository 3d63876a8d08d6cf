//! The kinds of photons, one map each \[Jensen 1996\].

use super::map::PhotonMap;

/// Kind of a photon, by the lobes of its light path. Photons of caustics are locally dense, and light paths are aimed
/// to make them; all others are sparse and even. Bandwidths that suit one kind are too small or too large for the
/// other, so each has its own map and bandwidths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The light path has scattered at a broad lobe or in a medium at least once.
    Indirect,
    /// The light path has scattered at narrow lobes only.
    Caustic,
}

impl Kind {
    /// All kinds of photons, in the order of [`ByKind`].
    pub const ALL: [Kind; 2] = [Kind::Indirect, Kind::Caustic];
}

/// A value for each kind of photons, at index `kind as usize`.
pub type ByKind<T> = [T; 2];

/// Appends the items of each kind of photons in `more` to those in `all`.
pub fn append<T>(all: &mut ByKind<Vec<T>>, more: ByKind<Vec<T>>) {
    for (all, more) in all.iter_mut().zip(more) {
        all.extend(more);
    }
}

/// Number of items of both kinds of photons together.
pub fn count<T>(all: &ByKind<Vec<T>>) -> usize {
    all.iter().map(Vec::len).sum()
}

/// Maps of the photons on surfaces of one iteration, one map for each kind.
pub type PhotonMaps = ByKind<PhotonMap>;
