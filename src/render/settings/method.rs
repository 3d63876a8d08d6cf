//! The table of methods: one row per method with all properties that other modules need. `pass/choice.rs` makes its
//! integrator.

use crate::estimator::rule::memoryless;
use crate::plan::Search;
use serde::{Deserialize, Serialize};

/// Smallest default number of light paths per iteration, the number of the papers.
pub const DEFAULT_PHOTONS: u32 = 100_000;
/// Default number of light paths of [`Method::Pm`], which are traced once.
pub const DEFAULT_MAP_PHOTONS: u32 = 2_000_000;
/// Default `k` of [`Method::Pm`], whose bandwidth is the distance to the k-th nearest photon.
pub const DEFAULT_MAP_KNN: usize = 100;
/// Default `k` of the largest initial bandwidth, the distance to the k-th nearest photon: with several levels
/// \[post-reconstruction 2021, 4.1\] and with one.
pub const DEFAULT_KNN: (usize, usize) = (20, 10);

/// Default reduction rate of bandwidths where merging complements connections \[Georgiev et al. 2012\].
const MERGING_ALPHA: f64 = 0.75;

/// Rule by which kernel bandwidths shrink from one iteration to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BandwidthRule {
    /// Bandwidths follow from the number of the iteration alone ([`memoryless`]).
    Memoryless,
    /// Bandwidths follow from the number of photons found ([`local`](crate::estimator::rule::local)).
    Local,
    /// Bandwidths take the least estimated error ([`adaptive`](crate::estimator::rule::adaptive)).
    Adaptive,
    /// Bandwidths shrink where a test finds that photons are not uniform
    /// ([`chi_squared`](crate::estimator::rule::chi_squared)).
    ChiSquared,
}

/// Properties of a rendering method.
struct Row {
    /// Name of the method on the command line and in files.
    name: &'static str,
    /// One line about the method for help texts.
    help: &'static str,
    /// Techniques that find the light, if photons carry all indirect light.
    search: Search,
    /// Techniques that find the light if photons carry caustics alone; `None` if the method does not support that.
    search_with_paths: Option<Search>,
    /// Rules by which bandwidths can shrink, the default first; empty if the method has no shrinking bandwidths.
    rules: &'static [BandwidthRule],
    /// Whether the method can render several bandwidth levels (pictures with different kernel bandwidths).
    has_levels: bool,
    /// Default number of light paths; `None` if the number is no setting: such methods trace one per camera path, or
    /// none.
    photons: Option<u32>,
    /// Default `k` of initial bandwidths, the distance to the k-th nearest photon: with several levels and with one.
    neighbours: (usize, usize),
    /// Default reduction rate of bandwidths under the memoryless rule.
    alpha: f64,
    /// Whether light paths can be guided: started preferably toward objects that focus light.
    guides: bool,
    /// Whether camera paths gather at the same points in every iteration.
    has_fixed_points: bool,
    /// Whether samples are states of Markov chains.
    has_chains: bool,
    /// Method that replaces this one where bandwidth levels must keep a fixed ratio; `None` if none has to.
    pilot: Option<Method>,
}

impl Row {
    /// Defaults for the rows of methods without bias.
    const UNBIASED: Row = Row {
        name: "",
        help: "",
        search: Search::Connections,
        search_with_paths: None,
        rules: &[],
        has_levels: false,
        photons: None,
        neighbours: DEFAULT_KNN,
        alpha: memoryless::ALPHA,
        guides: false,
        has_fixed_points: false,
        has_chains: false,
        pilot: None,
    };

    /// Defaults for the rows of methods whose camera paths gather the photons of a new map in every iteration.
    const GATHERING: Row = Row {
        search: Search::Photons,
        has_levels: true,
        photons: Some(DEFAULT_PHOTONS),
        guides: true,
        ..Row::UNBIASED
    };
}

/// Declares [`Method`] and its table of properties, one row per method.
macro_rules! methods {
    ($($(#[$attribute:meta])* $method:ident = $row:expr;)*) => {
        /// Rendering method: the algorithm that finds the light.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Method {
            $($(#[$attribute])* $method,)*
        }

        impl Method {
            /// All methods, in the order of help texts.
            pub const ALL: &[Method] = &[$(Method::$method),*];

            const fn row(self) -> &'static Row {
                match self {
                    $(Method::$method => const { &$row },)*
                }
            }
        }
    };
}

methods! {
    /// Path tracing with next-event estimation.
    Path = Row { name: "path", help: "Path tracing", search: Search::CameraPaths, ..Row::UNBIASED };

    /// Light tracing with connections to the camera. Camera paths show lights in mirrors and clear glass only.
    Light = Row {
        name: "light",
        help: "Light tracing: what mirrors and clear glass show stays black",
        search: Search::LightPaths,
        guides: true,
        ..Row::UNBIASED
    };

    /// Bidirectional path tracing.
    Bdpt = Row { name: "bdpt", help: "Bidirectional path tracing", guides: true, ..Row::UNBIASED };

    /// Classical photon mapping: photons are traced once; the nearest ones estimate the light.
    Pm = Row {
        name: "pm",
        help: "Classical photon mapping: one map, the nearest photons; tends to a blurred picture",
        search: Search::Map,
        photons: Some(DEFAULT_MAP_PHOTONS),
        neighbours: (DEFAULT_MAP_KNN, DEFAULT_MAP_KNN),
        ..Row::UNBIASED
    };

    /// Progressive photon mapping: gather points are fixed, bandwidths follow local statistics.
    Ppm = Row {
        name: "ppm",
        help: "Progressive photon mapping: one fixed point per pixel, so edges are jagged",
        rules: &[BandwidthRule::Local],
        has_fixed_points: true,
        ..Row::GATHERING
    };

    /// Stochastic progressive photon mapping.
    #[default]
    Sppm = Row {
        name: "sppm",
        help: "Stochastic progressive photon mapping",
        search_with_paths: Some(Search::PathsAndPhotons),
        rules: &[BandwidthRule::Memoryless, BandwidthRule::Local],
        ..Row::GATHERING
    };

    /// Adaptive progressive photon mapping: bandwidths have the least estimated error.
    Appm = Row {
        name: "appm",
        help: "Adaptive progressive photon mapping: sppm whose bandwidths have the least estimated error",
        rules: &[BandwidthRule::Adaptive],
        ..Row::GATHERING
    };

    /// Chi-squared progressive photon mapping: bandwidths shrink where photons are not uniform.
    Cppm = Row {
        name: "cppm",
        help: "Chi-squared progressive photon mapping: sppm whose bandwidths shrink only where the photons do not look \
               uniform",
        rules: &[BandwidthRule::ChiSquared],
        pilot: Some(Method::Sppm),
        ..Row::GATHERING
    };

    /// Bidirectional photon mapping: merging at all vertices, no connections.
    Bpm = Row {
        name: "bpm",
        help: "Bidirectional photon mapping: merging alone",
        search: Search::Merging,
        rules: &[BandwidthRule::Memoryless],
        alpha: MERGING_ALPHA,
        guides: true,
        ..Row::UNBIASED
    };

    /// Vertex connection and merging.
    Vcm = Row {
        name: "vcm",
        help: "Vertex connection and merging",
        search: Search::ConnectionsAndMerging,
        rules: &[BandwidthRule::Memoryless],
        has_levels: true,
        alpha: MERGING_ALPHA,
        guides: true,
        ..Row::UNBIASED
    };

    /// Multiplexed Metropolis light transport.
    Mlt = Row {
        name: "mlt",
        help: "Metropolis light transport: chains that stay where light is; what they miss they miss for long",
        has_chains: true,
        ..Row::UNBIASED
    };
}

impl Method {
    /// Name of the method on the command line and in files.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// The method with this name; `None` if there is none.
    pub fn named(name: &str) -> Option<Method> {
        Method::ALL.iter().copied().find(|method| method.name() == name)
    }

    /// One line about the method for help texts.
    pub fn help(self) -> &'static str {
        self.row().help
    }

    /// Techniques that find the light, if photons carry all indirect light.
    pub fn search(self) -> Search {
        self.row().search
    }

    /// Techniques that find the light if photons carry caustics alone; `None` if the method does not support that.
    pub fn search_with_paths(self) -> Option<Search> {
        self.row().search_with_paths
    }

    /// Rules by which bandwidths can shrink, the default first; empty if the method has no shrinking bandwidths.
    pub fn rules(self) -> &'static [BandwidthRule] {
        self.row().rules
    }

    /// The rule `requested`, or the default rule if the method does not support it; `None` without shrinking bandwidths.
    pub fn rule(self, requested: BandwidthRule) -> Option<BandwidthRule> {
        let rules = self.rules();
        rules.iter().find(|rule| **rule == requested).or(rules.first()).copied()
    }

    /// Whether every path belongs to one sampling technique with an MIS weight. It is known, then, which light it comes
    /// from.
    pub fn has_techniques(self) -> bool {
        !self.takes_photon_count() && !self.has_chains()
    }

    /// Whether samples are states of Markov chains.
    pub fn has_chains(self) -> bool {
        self.row().has_chains
    }

    /// Whether the method can render several bandwidth levels (pictures with different kernel bandwidths).
    pub fn has_levels(self) -> bool {
        self.row().has_levels
    }

    /// Whether the method has kernel bandwidths that shrink.
    pub fn has_bandwidths(self) -> bool {
        !self.rules().is_empty()
    }

    /// Whether bandwidths shrink by a reduction rate that is a setting.
    pub fn takes_alpha(self) -> bool {
        self.rules().iter().any(|rule| matches!(rule, BandwidthRule::Memoryless | BandwidthRule::Local))
    }

    /// Whether the method supports, under this bandwidth rule, other kernels than the box.
    pub fn takes_kernels(self, rule: BandwidthRule) -> bool {
        self.gathers() && matches!(self.rule(rule), Some(BandwidthRule::Memoryless | BandwidthRule::Adaptive))
    }

    /// Whether every iteration gathers the photons of its own map: progressive photon mapping with any rule.
    pub fn gathers(self) -> bool {
        self.search() == Search::Photons
    }

    /// Whether all iterations gather the photons of one map, so that bias does not shrink.
    pub fn has_one_map(self) -> bool {
        self.search() == Search::Map
    }

    /// Whether camera paths gather at the same points in every iteration.
    pub fn has_fixed_points(self) -> bool {
        self.row().has_fixed_points
    }

    /// Whether rendering a window takes the light paths of the whole picture, because all of them may send light there.
    pub fn walks_whole_picture(self) -> bool {
        matches!(self.search(), Search::LightPaths | Search::Connections) && !self.has_chains()
    }

    /// Whether the number of light paths is a setting (per iteration; for one map, per render). Other methods trace one
    /// per camera path, or none.
    pub fn takes_photon_count(self) -> bool {
        self.row().photons.is_some()
    }

    /// Whether numbers of light paths and connections are settings ([`Counts`](super::Counts)).
    pub fn takes_counts(self) -> bool {
        matches!(self.search(), Search::Connections | Search::ConnectionsAndMerging) && !self.has_chains()
    }

    /// The method that remains if some of its techniques have no samples: path tracing without light paths, bidirectional
    /// path tracing without merging.
    pub(super) fn with_counts(self, counts: &super::Counts) -> Method {
        match self {
            method if !method.takes_counts() => method,
            _ if counts.light_paths == 0 => Method::Path,
            _ if counts.merging <= 0.0 => Method::Bdpt,
            method => method,
        }
    }

    /// Whether light paths can be guided: started preferably toward objects that focus light.
    pub fn supports_guiding(self) -> bool {
        self.row().guides
    }

    /// Default number of light paths in a small picture, for methods that take it as a setting.
    pub fn default_photons(self) -> u32 {
        self.row().photons.unwrap_or(DEFAULT_PHOTONS)
    }

    /// Default `k` of initial bandwidths, the distance to the k-th nearest photon, with this number of levels.
    pub fn default_neighbours(self, levels: usize) -> usize {
        let (several, one) = self.row().neighbours;
        if levels == 1 { one } else { several }
    }

    /// Default reduction rate of bandwidths under the memoryless rule.
    pub fn default_alpha(self) -> f64 {
        self.row().alpha
    }

    /// Method that replaces this one in pilots whose bandwidth levels must keep a fixed ratio, or this one itself.
    pub fn pilot_method(self) -> Method {
        self.row().pilot.unwrap_or(self)
    }
}

#[cfg(feature = "cli")]
impl clap::ValueEnum for Method {
    fn value_variants<'a>() -> &'a [Self] {
        Method::ALL
    }

    fn to_possible_value(&self) -> Option<clap::builder::PossibleValue> {
        Some(clap::builder::PossibleValue::new(self.name()).help(self.help()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn serde_writes_each_method_by_its_unique_name() {
        for method in Method::ALL {
            assert_eq!(serde_json::to_value(method).unwrap(), method.name());
            assert_eq!(Method::named(method.name()), Some(*method));
            assert!(!method.help().is_empty() && !method.help().ends_with('.'));
        }
        assert_eq!(Method::named("photons"), None);
    }
}
