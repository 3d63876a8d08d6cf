//! The methods: one row each, with all that others ask about a method. Its pass is made in `choice.rs`.

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

/// Default reduction rate where merging complements connections \[Georgiev et al. 2012\].
const MERGING_ALPHA: f64 = 0.75;

/// The rule that a method's bandwidths follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BandwidthRule {
    /// The iteration's number alone ([`memoryless`]).
    Memoryless,
    /// The number of photons found ([`local`](crate::estimator::rule::local)).
    Local,
    /// The least estimated error ([`adaptive`](crate::estimator::rule::adaptive)).
    Adaptive,
    /// A test of uniformity ([`chi_squared`](crate::estimator::rule::chi_squared)).
    ChiSquared,
}

/// What others ask about a method.
struct Row {
    /// Name on the command line and in files.
    name: &'static str,
    /// One line for help texts.
    help: &'static str,
    /// Techniques, where photons bring all indirect light.
    search: Search,
    /// Techniques where photons bring caustics alone, if the method can leave the rest to camera paths.
    search_with_paths: Option<Search>,
    /// Rules that its bandwidths can follow, the default first. Empty: it has no bandwidths that shrink.
    rules: &'static [BandwidthRule],
    /// Whether its bandwidths are several levels.
    has_levels: bool,
    /// Default number of light paths where that is a setting. The other methods trace one per camera path, or none.
    photons: Option<u32>,
    /// Default number of neighbours that set bandwidths, with several levels and with one.
    neighbours: (usize, usize),
    /// Default reduction rate of the memoryless rule.
    alpha: f64,
    /// Whether its light paths can be guided.
    guides: bool,
    /// Whether camera paths gather at the same points in every iteration.
    has_fixed_points: bool,
    /// Whether its samples are Markov chains.
    has_chains: bool,
    /// Method that takes its place in pilots, where levels must keep the ratio of their bandwidths.
    pilot: Option<Method>,
}

impl Row {
    /// An unbiased method.
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

    /// A method whose camera paths gather the photons of a new map in every iteration.
    const GATHERING: Row = Row {
        search: Search::Photons,
        has_levels: true,
        photons: Some(DEFAULT_PHOTONS),
        guides: true,
        ..Row::UNBIASED
    };
}

/// Declares [`Method`] and its rows.
macro_rules! methods {
    ($($(#[$attribute:meta])* $method:ident = $row:expr;)*) => {
        /// How light is found.
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

    /// Light tracing with connections to the camera; of eye paths only what mirrors and clear glass show of lights.
    Light = Row {
        name: "light",
        help: "Light tracing: what mirrors and clear glass show stays black",
        search: Search::LightPaths,
        guides: true,
        ..Row::UNBIASED
    };

    /// Bidirectional path tracing.
    Bdpt = Row { name: "bdpt", help: "Bidirectional path tracing", guides: true, ..Row::UNBIASED };

    /// Classical photon mapping: photons traced once, nearest neighbours.
    Pm = Row {
        name: "pm",
        help: "Classical photon mapping: one map, the nearest photons; tends to a blurred picture",
        search: Search::Map,
        photons: Some(DEFAULT_MAP_PHOTONS),
        neighbours: (DEFAULT_MAP_KNN, DEFAULT_MAP_KNN),
        ..Row::UNBIASED
    };

    /// Progressive photon mapping: measurement points stay where they are, bandwidths follow local statistics.
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

    /// Adaptive progressive photon mapping: the bandwidths of least estimated error.
    Appm = Row {
        name: "appm",
        help: "Adaptive progressive photon mapping: sppm whose bandwidths have the least estimated error",
        rules: &[BandwidthRule::Adaptive],
        ..Row::GATHERING
    };

    /// Chi-squared progressive photon mapping: bandwidths shrink where photons do not look uniform.
    Cppm = Row {
        name: "cppm",
        help: "Chi-squared progressive photon mapping: sppm whose bandwidths shrink only where the photons do not look \
               uniform",
        rules: &[BandwidthRule::ChiSquared],
        pilot: Some(Method::Sppm),
        ..Row::GATHERING
    };

    /// Bidirectional photon mapping: merging at all vertices, nothing else.
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
    /// Name on the command line and in files.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// The method of that name.
    pub fn named(name: &str) -> Option<Method> {
        Method::ALL.iter().copied().find(|method| method.name() == name)
    }

    /// One line for help texts.
    pub fn help(self) -> &'static str {
        self.row().help
    }

    /// How it looks for light, where photons bring all indirect light.
    pub fn search(self) -> Search {
        self.row().search
    }

    /// How it looks for light where photons bring caustics alone, if it can leave the rest to camera paths.
    pub fn search_with_paths(self) -> Option<Search> {
        self.row().search_with_paths
    }

    /// Rules that its bandwidths can follow, the default first; empty without bandwidths that shrink.
    pub fn rules(self) -> &'static [BandwidthRule] {
        self.row().rules
    }

    /// The rule that its bandwidths follow where `asked` is asked for, if they follow one.
    pub fn rule(self, asked: BandwidthRule) -> Option<BandwidthRule> {
        let rules = self.rules();
        rules.iter().find(|rule| **rule == asked).or(rules.first()).copied()
    }

    /// Whether it weighs sampling techniques against each other path by path, or has but one.
    pub fn has_techniques(self) -> bool {
        !self.takes_photon_count() && !self.has_chains()
    }

    /// Whether its samples are Markov chains.
    pub fn has_chains(self) -> bool {
        self.row().has_chains
    }

    /// Whether its bandwidths are several levels.
    pub fn has_levels(self) -> bool {
        self.row().has_levels
    }

    /// Whether it has bandwidths that shrink.
    pub fn has_bandwidths(self) -> bool {
        !self.rules().is_empty()
    }

    /// Whether a reduction rate sets how fast its bandwidths shrink.
    pub fn takes_alpha(self) -> bool {
        self.rules().iter().any(|rule| matches!(rule, BandwidthRule::Memoryless | BandwidthRule::Local))
    }

    /// Whether it weighs photons by any kernel when its bandwidths follow a rule; the box is for all.
    pub fn takes_kernels(self, rule: BandwidthRule) -> bool {
        self.gathers() && matches!(self.rule(rule), Some(BandwidthRule::Memoryless | BandwidthRule::Adaptive))
    }

    /// Whether every iteration gathers the photons of a map of its own: progressive photon mapping, of whatever rule.
    pub fn gathers(self) -> bool {
        self.search() == Search::Photons
    }

    /// Whether all iterations gather the photons of one map, so that bias stays.
    pub fn has_one_map(self) -> bool {
        self.search() == Search::Map
    }

    /// Whether camera paths gather at the same points in every iteration.
    pub fn has_fixed_points(self) -> bool {
        self.row().has_fixed_points
    }

    /// Whether it walks the light paths of the whole picture to render a window of it: they all may send light there.
    pub fn walks_whole_picture(self) -> bool {
        matches!(self.search(), Search::LightPaths | Search::Connections) && !self.has_chains()
    }

    /// Whether the number of light paths (of an iteration; of all, for one map) is a setting; the other methods have
    /// one for every eye path, or none.
    pub fn takes_photon_count(self) -> bool {
        self.row().photons.is_some()
    }

    /// Whether its light paths can be guided.
    pub fn supports_guiding(self) -> bool {
        self.row().guides
    }

    /// Default number of light paths of methods where it is a setting.
    pub fn default_photons(self) -> u32 {
        self.row().photons.unwrap_or(DEFAULT_PHOTONS)
    }

    /// Default number of neighbours that set bandwidths.
    pub fn default_neighbours(self, levels: usize) -> usize {
        let (several, one) = self.row().neighbours;
        if levels == 1 { one } else { several }
    }

    /// Default reduction rate of the memoryless rule.
    pub fn default_alpha(self) -> f64 {
        self.row().alpha
    }

    /// The method that is tried in its place by pilots, where levels must keep the ratio of their bandwidths.
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

    /// Names are those that serde writes into checkpoints, and each is one method's.
    #[test]
    fn names_are_those_in_files() {
        for method in Method::ALL {
            assert_eq!(serde_json::to_value(method).unwrap(), method.name());
            assert_eq!(Method::named(method.name()), Some(*method));
            assert!(!method.help().is_empty() && !method.help().ends_with('.'));
        }
        assert_eq!(Method::named("photons"), None);
    }
}
