//! Numbers of samples of the techniques of bidirectional methods.

use serde::{Deserialize, Serialize};

/// Largest number of light paths per pixel and iteration.
pub const MAX_LIGHT_PATHS_PER_PIXEL: u32 = 4;
/// Largest number of light paths that a camera path connects to.
pub const MAX_CONNECTIONS: u32 = 4;
/// Number of steps of [`Counts::light_paths`] per light path and pixel.
pub const LIGHT_PATH_STEPS: u32 = 16;

/// Numbers of samples per iteration of the techniques that `bdpt` and `vcm` combine. MIS weights contain them, so every
/// choice is unbiased; they decide where the work goes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Counts {
    /// Light paths per pixel, in sixteenths.
    pub light_paths: u32,
    /// Number of light paths whose vertices each vertex of a camera path connects to.
    pub connections: u32,
    /// Probability that a camera path merges with photons.
    pub merging: f32,
}

impl Default for Counts {
    fn default() -> Counts {
        Counts { light_paths: LIGHT_PATH_STEPS, connections: 1, merging: 1.0 }
    }
}

impl Counts {
    /// Light paths per pixel and iteration.
    pub fn light_paths_per_pixel(self) -> f64 {
        f64::from(self.light_paths) / f64::from(LIGHT_PATH_STEPS)
    }
}
