//! Which parts of the error an error estimate includes.
//!
//! The variance is estimated from independent iterations, the bias from the next larger of several bandwidth levels, or
//! from the inner part of one bandwidth ([`crate::estimator::SquaredError`]). Without either, or with fixed gather points,
//! the estimate lacks a part of the error, and a note beside the number says so.

use crate::render::settings::Settings;
use serde::Serialize;

/// Parts of a picture's true error (noise, bias) that its error estimate includes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum ErrorCoverage {
    /// Noise, and bias if the method has any.
    #[serde(rename = "noise and bias")]
    All,
    /// Noise alone: the bias by the bandwidth is unknown.
    #[serde(rename = "noise")]
    Noise,
    /// Noise of photons alone: camera paths are the same in every iteration \[Hachisuka et al. 2008\], so their noise is
    /// not visible as a difference between iterations.
    #[serde(rename = "noise of photons")]
    PhotonNoise,
}

impl ErrorCoverage {
    /// Name of this coverage in the header of the EXR.
    pub fn name(self) -> &'static str {
        match self {
            ErrorCoverage::All => "noise and bias",
            ErrorCoverage::Noise => "noise",
            ErrorCoverage::PhotonNoise => "noise of photons",
        }
    }

    /// Note to print after an error estimate, such as ` (noise only)`; empty if the estimate includes all parts of the
    /// error.
    pub fn note(self) -> &'static str {
        match self {
            ErrorCoverage::All => "",
            ErrorCoverage::Noise => " (noise only)",
            ErrorCoverage::PhotonNoise => " (noise of photons only)",
        }
    }
}

impl Settings {
    /// Parts of the error that estimates for a render with these settings include.
    pub fn error_coverage(&self) -> ErrorCoverage {
        let compared = self.levels.picture_level() + 1 < self.compared_levels();
        match self.method {
            method if method.has_fixed_points() => ErrorCoverage::PhotonNoise,
            method if method.has_one_map() => ErrorCoverage::Noise,
            method if method.has_bandwidths() && !compared && !self.merges_one_level() => ErrorCoverage::Noise,
            _ => ErrorCoverage::All,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{Levels, Method, RadiusRule};

    #[test]
    fn bias_is_included_if_there_is_another_bandwidth_to_compare_with() {
        let coverage = |method: Method, levels: usize, radius_rule: RadiusRule| {
            Settings { method, levels: Levels::new(levels), radius_rule, ..Settings::default() }.error_coverage()
        };
        let memoryless = RadiusRule::Memoryless;
        assert_eq!(coverage(Method::Sppm, 5, memoryless), ErrorCoverage::All);
        assert_eq!(coverage(Method::Sppm, 1, memoryless), ErrorCoverage::Noise);
        assert_eq!(coverage(Method::Sppm, 5, RadiusRule::Local), ErrorCoverage::Noise);
        assert_eq!(coverage(Method::Cppm, 5, memoryless), ErrorCoverage::Noise);
        assert_eq!(coverage(Method::Vcm, 1, memoryless), ErrorCoverage::All);
        assert_eq!(coverage(Method::Path, 1, memoryless), ErrorCoverage::All);
        assert_eq!(coverage(Method::Pm, 1, memoryless), ErrorCoverage::Noise);
        assert_eq!(coverage(Method::Ppm, 1, RadiusRule::Local), ErrorCoverage::PhotonNoise);
    }
}
