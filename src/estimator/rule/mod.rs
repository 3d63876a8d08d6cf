//! Bandwidth rules, one per file: each computes the next bandwidth from the last one and the photons of an iteration.

pub mod adaptive;
pub mod chi_squared;
pub mod local;
pub mod memoryless;
pub mod thinned;
pub mod volume;

use crate::math::Frame;
use crate::transport::FoundPhotons;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A rule that shrinks the bandwidths of a pixel by the photons counted around its gathering points. It has one
/// bandwidth per level of a pixel; the levels of a camera path are counted and updated together.
pub trait CountingRule: Clone + Sync {
    /// State of one bandwidth level of one pixel: its squared bandwidth and the statistics that determine it.
    type Bandwidth: Copy + Send + Sync + Serialize + DeserializeOwned;
    /// A photon count in the state of a bandwidth level, for example in one cell of its disc.
    type Count: Copy + Default + Send + Sync + Serialize + DeserializeOwned;
    /// Summary of the photons that one camera path finds, at all its bandwidth levels.
    type Tally: Default;

    /// Whether photons further away than the largest bandwidth are counted.
    const BEYOND: bool = false;

    /// Whether the rule reads the thinning keys of photons, from which it decides which photons it counts.
    const NEEDS_THINNING_KEYS: bool = false;

    /// Number of counts in the state of each bandwidth.
    fn counts(&self) -> usize {
        1
    }
    /// The bandwidth of a level before the first iteration: `squared` is its square, `photons` the number of
    /// photons of the pilot iteration within it (0 if unknown), `above` by how many levels it is larger than the level
    /// that the picture shows (negative if smaller).
    fn initial(&self, squared: f32, photons: f32, above: i32) -> Self::Bandwidth;
    /// Squared bandwidth of a bandwidth (m2).
    fn squared(bandwidth: &Self::Bandwidth) -> f32;
    /// Squared bandwidth within which photons are counted, if [`CountingRule::BEYOND`]; `largest2` is the largest squared
    /// bandwidth.
    #[inline]
    fn reach2(&self, bandwidths: &[Self::Bandwidth], largest2: f32) -> f32 {
        let _ = bandwidths;
        largest2
    }
    /// Counts photons around a gathering point. The frame is a fixed function of the normal there.
    fn count(
        &self,
        bandwidths: &[Self::Bandwidth],
        counts: &mut [Self::Count],
        tally: &mut Self::Tally,
        frame: &Frame,
        photons: &FoundPhotons,
    );
    /// Updates bandwidths after the camera path of iteration `i` (from 1); `tally` summarises its photons.
    fn update(&self, i: u64, bandwidths: &mut [Self::Bandwidth], counts: &mut [Self::Count], tally: &mut Self::Tally);
}
