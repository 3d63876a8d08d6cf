//! What an estimated error knows of.
//!
//! Variance is told by independent iterations, bias by the next larger of several bandwidth levels
//! ([`crate::estimator::SquaredError`]). Where there is no such level, or the points that gather photons stay where
//! they are, the number lacks a part of the error, and whoever reads it is told so beside it.

use crate::render::settings::Settings;
use serde::Serialize;

/// What the estimate of a render's error is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum ErrorCoverage {
    /// All of the error: of noise, and of bias where the method has any.
    #[serde(rename = "noise and bias")]
    All,
    /// Noise alone: the bias of the bandwidth is not known.
    #[serde(rename = "noise")]
    Noise,
    /// The noise of photons alone: eye paths are the same in every iteration \[Hachisuka et al. 2008\], and what
    /// another set of them would show differs by more than iterations do.
    #[serde(rename = "noise of photons")]
    PhotonNoise,
}

impl ErrorCoverage {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            ErrorCoverage::All => "noise and bias",
            ErrorCoverage::Noise => "noise",
            ErrorCoverage::PhotonNoise => "noise of photons",
        }
    }

    /// What is lacking, to be printed behind the number: ` (noise only)`; nothing where nothing is.
    pub fn note(self) -> &'static str {
        match self {
            ErrorCoverage::All => "",
            ErrorCoverage::Noise => " (noise only)",
            ErrorCoverage::PhotonNoise => " (noise of photons only)",
        }
    }
}

impl Settings {
    /// What the estimated error of such a render knows of.
    pub fn error_coverage(&self) -> ErrorCoverage {
        let compared = self.levels.picture_level() + 1 < self.compared_levels();
        match self.method {
            method if method.has_fixed_points() => ErrorCoverage::PhotonNoise,
            method if method.has_one_map() => ErrorCoverage::Noise,
            method if method.has_bandwidths() && !compared => ErrorCoverage::Noise,
            _ => ErrorCoverage::All,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{Levels, Method, RadiusRule};

    #[test]
    fn bias_is_told_by_a_larger_level() {
        let of = |method: Method, levels: usize, radius_rule: RadiusRule| {
            Settings { method, levels: Levels::new(levels), radius_rule, ..Settings::default() }.error_coverage()
        };
        let memoryless = RadiusRule::Memoryless;
        assert_eq!(of(Method::Sppm, 5, memoryless), ErrorCoverage::All);
        assert_eq!(of(Method::Sppm, 1, memoryless), ErrorCoverage::Noise);
        assert_eq!(of(Method::Sppm, 5, RadiusRule::Local), ErrorCoverage::Noise);
        assert_eq!(of(Method::Cppm, 5, memoryless), ErrorCoverage::Noise);
        assert_eq!(of(Method::Vcm, 1, memoryless), ErrorCoverage::Noise);
        assert_eq!(of(Method::Path, 1, memoryless), ErrorCoverage::All);
        assert_eq!(of(Method::Pm, 1, memoryless), ErrorCoverage::Noise);
        assert_eq!(of(Method::Ppm, 1, RadiusRule::Local), ErrorCoverage::PhotonNoise);
    }
}
