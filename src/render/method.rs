//! The methods, and what of a render's shape follows from the one chosen.

use crate::estimator::rule::memoryless;
use crate::plan::Search;
use serde::{Deserialize, Serialize};

/// Light paths per iteration: the papers' setting.
pub const DEFAULT_PHOTONS: u32 = 100_000;
/// Light paths of [`Method::Pm`], traced once.
pub const DEFAULT_MAP_PHOTONS: u32 = 2_000_000;
/// Neighbours whose distance is its bandwidth.
pub const DEFAULT_MAP_KNN: usize = 100;
/// Neighbours that set the largest initial bandwidth with several levels \[post-reconstruction 2021, 4.1\] and with
/// one.
pub const DEFAULT_KNN: (usize, usize) = (20, 10);

/// How light is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Path tracing with next-event estimation.
    Path,
    /// Light tracing with connections to the camera; of eye paths only what mirrors and clear glass show of lights.
    Light,
    /// Bidirectional path tracing.
    Bdpt,
    /// Classical photon mapping: photons traced once, nearest neighbours.
    Pm,
    /// Progressive photon mapping: measurement points stay where they are, bandwidths follow local statistics.
    Ppm,
    /// Stochastic progressive photon mapping.
    #[default]
    Sppm,
    /// Adaptive progressive photon mapping: the bandwidths of least estimated error.
    Appm,
    /// Chi-squared progressive photon mapping: bandwidths shrink where photons do not look uniform.
    Cppm,
    /// Bidirectional photon mapping: merging at all vertices, nothing else.
    Bpm,
    /// Vertex connection and merging.
    Vcm,
    /// Multiplexed Metropolis light transport.
    Mlt,
}

impl Method {
    /// Its name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Method::Path => "path",
            Method::Light => "light",
            Method::Bdpt => "bdpt",
            Method::Pm => "pm",
            Method::Ppm => "ppm",
            Method::Sppm => "sppm",
            Method::Appm => "appm",
            Method::Cppm => "cppm",
            Method::Bpm => "bpm",
            Method::Vcm => "vcm",
            Method::Mlt => "mlt",
        }
    }

    /// How it looks for light, where photons bring all indirect light.
    pub fn search(self) -> Search {
        match self {
            Method::Path => Search::EyePaths,
            Method::Light => Search::LightPaths,
            Method::Bdpt | Method::Mlt => Search::Connections,
            Method::Pm => Search::Map,
            Method::Ppm | Method::Sppm | Method::Appm | Method::Cppm => Search::Photons,
            Method::Bpm => Search::Merging,
            Method::Vcm => Search::ConnectionsAndMerging,
        }
    }

    /// Whether it weighs sampling techniques against each other path by path, or has but one.
    pub fn has_techniques(self) -> bool {
        !self.counts_photons() && self != Method::Mlt
    }

    /// Whether its bandwidths are several levels.
    pub fn has_levels(self) -> bool {
        self.gathers() || self == Method::Vcm
    }

    /// Whether it has bandwidths.
    pub fn has_bandwidths(self) -> bool {
        self.gathers() || matches!(self, Method::Bpm | Method::Vcm)
    }

    /// Whether every iteration gathers the photons of a map of its own: progressive photon mapping, of whatever rule.
    pub fn gathers(self) -> bool {
        matches!(self, Method::Ppm | Method::Sppm | Method::Appm | Method::Cppm)
    }

    /// Whether the number of light paths (of an iteration; of all, for one map) is a setting; the other methods have
    /// one for every eye path, or none.
    pub fn counts_photons(self) -> bool {
        self.gathers() || self == Method::Pm
    }

    /// Whether its light paths can be guided.
    pub fn guides(self) -> bool {
        self.gathers() || matches!(self, Method::Light | Method::Bdpt | Method::Bpm | Method::Vcm)
    }

    /// Light paths where no number is asked for, of methods that count them.
    pub fn photons(self) -> u32 {
        if self == Method::Pm { DEFAULT_MAP_PHOTONS } else { DEFAULT_PHOTONS }
    }

    /// Neighbours that set bandwidths where no number is asked for.
    pub fn neighbours(self, levels: usize) -> usize {
        match (self, levels) {
            (Method::Pm, _) => DEFAULT_MAP_KNN,
            (_, 1) => DEFAULT_KNN.1,
            _ => DEFAULT_KNN.0,
        }
    }

    /// Reduction rate of the memoryless rule where none is asked for \[Georgiev et al. 2012 for merging with
    /// connections\].
    pub fn alpha(self) -> f64 {
        match self {
            Method::Bpm | Method::Vcm => 0.75,
            _ => memoryless::ALPHA,
        }
    }
}
