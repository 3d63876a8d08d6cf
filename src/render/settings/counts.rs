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
        Counts::DEFAULT
    }
}

impl Counts {
    /// One light path per pixel, connected to the camera path of its pixel, and merges of all camera paths.
    pub const DEFAULT: Counts = Counts { light_paths: LIGHT_PATH_STEPS, connections: 1, merging: 1.0 };
    /// No light paths: path tracing.
    pub const PATHS: Counts = Counts { light_paths: 0, connections: 0, merging: 0.0 };

    /// Light paths per pixel and iteration.
    pub fn light_paths_per_pixel(self) -> f64 {
        f64::from(self.light_paths) / f64::from(LIGHT_PATH_STEPS)
    }

    /// Whether a camera path has less than one connection or merge with a light path per vertex on average. Nothing makes
    /// up for short camera paths then, and roulette has to spare them as in path tracing.
    pub fn leave_camera_paths_alone(self, merges: bool) -> bool {
        let merged = if merges { f64::from(self.merging) * self.light_paths_per_pixel() } else { 0.0 };
        f64::from(self.connections) + merged < 1.0
    }

    /// The numbers in words, such as `1/4 light path per pixel, no connections`; empty for the default ones.
    pub fn describe(self) -> String {
        let mut words = Vec::new();
        let paths = |n: u32| if n <= LIGHT_PATH_STEPS { "light path" } else { "light paths" };
        if self.light_paths != LIGHT_PATH_STEPS {
            let n = match self.light_paths {
                n if n.is_multiple_of(LIGHT_PATH_STEPS) => (n / LIGHT_PATH_STEPS).to_string(),
                n if LIGHT_PATH_STEPS.is_multiple_of(n.max(1)) => format!("1/{}", LIGHT_PATH_STEPS / n.max(1)),
                _ => self.light_paths_per_pixel().to_string(),
            };
            words.push(format!("{n} {} per pixel", paths(self.light_paths)));
        }
        match self.connections {
            0 => words.push("no connections".into()),
            1 => {}
            n => words.push(format!("connections to {n} light paths")),
        }
        if self.merging < 1.0 {
            words.push(format!("merges with probability {}", self.merging));
        }
        words.join(", ")
    }
}
