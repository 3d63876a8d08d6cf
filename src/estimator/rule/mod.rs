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

/// A bandwidth rule that counts photons. It has one bandwidth per level of a pixel; the levels of a camera path are
/// counted and updated together.
pub trait CountingRule: Clone + Sync {
    /// State of a level of a pixel.
    type Bandwidth: Copy + Send + Sync + Serialize + DeserializeOwned;
    /// A count that belongs to a bandwidth.
    type Count: Copy + Default + Send + Sync + Serialize + DeserializeOwned;
    /// Summary of the photons that one camera path finds, at all its levels.
    type Tally: Default;

    /// Whether photons beyond the largest bandwidth are counted.
    const BEYOND: bool = false;

    /// Whether the rule needs photons' thinning keys.
    const NEEDS_THINNING_KEYS: bool = false;

    /// Number of counts per bandwidth.
    fn counts(&self) -> usize {
        1
    }
    /// The bandwidth before the first iteration: `radius2` is the squared radius, `photons` the number of the pilot's
    /// photons within it (0 if unknown), `above` the number of levels by which it is larger than the picture level.
    fn initial(&self, radius2: f32, photons: f32, above: i32) -> Self::Bandwidth;
    /// Squared radius of a bandwidth.
    fn radius2(bandwidth: &Self::Bandwidth) -> f32;
    /// Squared radius within which photons are counted, if [`CountingRule::BEYOND`].
    #[inline]
    fn reach2(&self, bandwidths: &[Self::Bandwidth], largest2: f32) -> f32 {
        let _ = bandwidths;
        largest2
    }
    /// Counts photons around a gathering point with this frame, which is a fixed function of the normal.
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
