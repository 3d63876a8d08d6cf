//! Bandwidth rules, one a file: from a pass, and what it found, to the next bandwidth.

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

/// A rule whose bandwidths follow from the photons found so far. One bandwidth per level of a pixel; the levels of one
/// camera path are counted and updated together.
pub trait CountingRule: Clone + Sync {
    /// State of a level of a pixel, kept between iterations.
    type Bandwidth: Copy + Send + Sync + Serialize + DeserializeOwned;
    /// What is kept beside it.
    type Count: Copy + Default + Send + Sync + Serialize + DeserializeOwned;
    /// What the photons of one camera path add up to, at all its levels.
    type Tally: Default;

    /// Whether photons beyond the largest bandwidth may be counted.
    const BEYOND: bool = false;

    /// Whether it asks for photons' marks.
    const NEEDS_THINNING_KEYS: bool = false;

    /// Counts per bandwidth.
    fn counts(&self) -> usize {
        1
    }
    /// The bandwidth before the first iteration: its radius squared, the photons that the pilot found within it (0: not
    /// known), and by how many levels it is larger than the method's own image's.
    fn begin(&self, radius2: f32, photons: f32, above: i32) -> Self::Bandwidth;
    /// Its radius squared.
    fn radius2(bandwidth: &Self::Bandwidth) -> f32;
    /// Radius squared within which photons are to be counted, if [`CountingRule::BEYOND`].
    #[inline]
    fn reach2(&self, bandwidths: &[Self::Bandwidth], largest2: f32) -> f32 {
        let _ = bandwidths;
        largest2
    }
    /// Photons within reach of a gathering point with this frame, which is one function of the normal in all
    /// iterations.
    fn count(
        &self,
        bandwidths: &[Self::Bandwidth],
        counts: &mut [Self::Count],
        tally: &mut Self::Tally,
        frame: &Frame,
        photons: &FoundPhotons,
    );
    /// After the camera path of iteration `i` (from 1), of whose photons `tally` is.
    fn update(&self, i: u64, bandwidths: &mut [Self::Bandwidth], counts: &mut [Self::Count], tally: &mut Self::Tally);
}
