//! What the user fixes of the settings. The rest follows from the method, which `auto` may choose, and the size of the
//! picture.

// Help texts have defaults in brackets, which are not links.
#![allow(rustdoc::broken_intra_doc_links)]

use super::values::{BandwidthChoice, GridChoice, MethodChoice, OnOff};
use super::{
    BandwidthRule, Candidate, Counts, DEFAULT_ITERATIONS, DEFAULT_MAP_KNN, LIGHT_PATH_STEPS, Levels, MAX_CONNECTIONS,
    MAX_LIGHT_PATHS_PER_PIXEL, Method, RadiusRule, Settings, Shard,
};
#[cfg(feature = "cli")]
use crate::argument::{Elsewhere, Ranged};
use crate::combine::Purpose;
use crate::error::{Error, Result};
use crate::estimator::rule::chi_squared::ChiSquaredSettings;
use crate::path_class::Switches;
use crate::photon::Kernel;
use crate::render::InitialBandwidth;
use crate::transport::{Indirect, MAX_LEVELS};
use serde::Serialize;
#[cfg(feature = "cli")]
use std::ops::Bound::{Excluded, Included};

/// The method, its settings, and when to stop, as far as the user says.
#[derive(Clone, Debug, Default, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
#[serde(rename_all = "kebab-case")]
pub struct SettingsRequest {
    /// Method that finds the light; 'auto' chooses one for the scene
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t, help_heading = "Method"))]
    pub method: MethodChoice,
    /// Light paths per iteration: more give a smoother start, fewer give faster iterations [default: one per pixel, at
    /// least 100000]
    ///
    /// For ppm, sppm, appm and cppm in each iteration, for pm once, for its one map, by default 2000000. Guided light
    /// paths with --indirect paths are one per pixel in small pictures, too. The other methods send one light path per
    /// camera path, or none
    #[cfg_attr(
        feature = "cli",
        arg(long, value_name = "N", whole = 1_u32..=50_000_000, help_heading = "Method", hide_short_help = true)
    )]
    pub photons: Option<u32>,
    /// Light paths of bdpt and vcm per pixel and iteration, 0 to 4 in steps of 1/16. Neighbouring pixels share fewer
    /// than one. 0 leaves path tracing [default: 1]
    #[cfg_attr(
        feature = "cli",
        arg(long, value_name = "N", between = (Included(0.0), Included(4.0)), help_heading = "Expert")
    )]
    pub light_paths: Option<f64>,
    /// Light paths to whose vertices each camera path of bdpt and vcm connects, 0 to 4 [default: 1]
    #[cfg_attr(feature = "cli", arg(long, value_name = "C", whole = 0..=MAX_CONNECTIONS, help_heading = "Expert"))]
    pub connections: Option<u32>,
    /// Probability that a camera path of vcm merges with photons; 0 leaves bdpt [default: 1]
    #[cfg_attr(
        feature = "cli",
        arg(long, value_name = "P", between = (Included(0.0), Included(1.0)), help_heading = "Expert")
    )]
    pub merging: Option<f64>,
    /// Memory for the photon map of pm in MiB, while it is built: 160 bytes per photon. A full map ends the light
    /// paths, and a warning says so [default: 1024]
    #[cfg_attr(
        feature = "cli",
        arg(long, value_name = "MIB", whole = 1..=u32::MAX, help_heading = "Expert", in_stages = false)
    )]
    pub photon_memory: Option<u32>,
    /// Bandwidth levels of ppm, sppm, appm, cppm and vcm, 1 to 5: each is 1/sqrt(2) of the next larger. Images range
    /// from sharp and noisy to smooth and blurred. The network 'compact' of --model combines 5, networks of the finish
    /// read 1 [default: 5, with a network of the finish 1]
    #[cfg_attr(feature = "cli", arg(long, value_name = "M", whole = 1..=MAX_LEVELS, help_heading = "Expert"))]
    pub levels: Option<usize>,
    /// Camera paths per pixel and iteration with several levels: one for all levels, or two, of which one is for level
    /// 1 alone, as the network 'compact' of --model was trained with. Two take about 1.7 times as long [default: 1,
    /// with that network 2]
    #[cfg_attr(feature = "cli", arg(long, value_name = "1|2", whole = 1_u32..=2, help_heading = "Expert"))]
    pub eye_paths: Option<u32>,
    /// Largest bandwidth at the start: 'knn' is the distance to the k-th nearest photon, 'footprint' is three pixels, a
    /// number is a length in scene units from 1e-9 to 1e9 for all pixels [default: knn; bpm and vcm: footprint]
    #[cfg_attr(feature = "cli", arg(long, value_name = "knn|footprint|R", help_heading = "Expert"))]
    pub initial_bandwidth: Option<BandwidthChoice>,
    /// Photons within the largest bandwidth at the start, 1 to 1024; with pm within every bandwidth [default: 20, with
    /// one level 10; pm: 100]
    #[cfg_attr(feature = "cli", arg(long, value_name = "K", whole = 1_u32..=1024, help_heading = "Expert"))]
    pub knn: Option<u32>,
    /// Rate at which bandwidths shrink, in (0, 1]: smaller values sharpen sooner and stay noisy longer, 1 never shrinks
    /// [default: 2/3; bpm and vcm: 0.75]
    #[cfg_attr(
        feature = "cli",
        arg(long, value_name = "A", between = (Excluded(0.0), Included(1.0)), help_heading = "Expert")
    )]
    pub alpha: Option<f64>,
    /// Annuli and sectors of the cells in which cppm counts photons, at most 64 cells [default: 2,6]
    #[cfg_attr(feature = "cli", arg(long, value_name = "NA,NS", help_heading = "Expert"))]
    pub cppm_grid: Option<GridChoice>,
    /// Factor of cppm on the squared bandwidth if the photons within it are not uniform, in (0, 1) [default: 0.8]
    #[cfg_attr(
        feature = "cli",
        arg(long, value_name = "K", between = (Excluded(0.0), Excluded(1.0)), help_heading = "Expert")
    )]
    pub cppm_k: Option<f64>,
    /// Factor by which the number of photons for a test of cppm grows with every reduction, 1 to 1000 [default: 1.2]
    #[cfg_attr(
        feature = "cli",
        arg(long, value_name = "BETA", between = (Included(1.0), Included(1000.0)), help_heading = "Expert")
    )]
    pub cppm_beta: Option<f64>,
    /// Probability that a test of cppm rejects uniform photons, in (0, 1) [default: 0.05]
    #[cfg_attr(
        feature = "cli",
        arg(long, value_name = "P", between = (Excluded(0.0), Excluded(1.0)), help_heading = "Expert")
    )]
    pub cppm_significance: Option<f64>,
    /// Test red, green and blue of cppm separately, with photons of equal flux: finds edges in colour or brightness
    /// that the number of photons does not show, such as in the picture of a projector. Takes about three times as long
    #[cfg_attr(feature = "cli", arg(long, help_heading = "Expert"))]
    pub cppm_plus: bool,
    /// Rule by which the bandwidths of sppm shrink: 'memoryless' by the number of the iteration, 'local' by the photons
    /// found [default: memoryless; ppm: local]
    #[cfg_attr(feature = "cli", arg(long, value_enum, help_heading = "Expert"))]
    pub radius_rule: Option<RadiusRule>,
    /// Weight of a photon of sppm and appm by its distance: 'box' is constant within the bandwidth, 'epanechnikov' and
    /// 'gaussian' (cut off at three standard deviations, which are the bandwidth) fall towards the rim. ppm, cppm and
    /// the local rule count photons and need box [default: box]
    #[cfg_attr(feature = "cli", arg(long, value_enum, help_heading = "Expert"))]
    pub kernel: Option<Kernel>,
    /// Guided emission: 'on' starts light paths towards mirrors and glass, from the lights and as often as a short
    /// pilot finds useful. The light is the same, the noise differs. Not for path, pm and --cppm-plus [default: off;
    /// auto: on if mirrors or glass focus light]
    #[cfg_attr(feature = "cli", arg(long, value_enum, help_heading = "Expert"))]
    pub guide: Option<OnOff>,
    /// Source of the light of sppm after broad bounces: 'photons', or 'paths', camera paths that continue and leave
    /// caustics to the photons [default: photons]
    #[cfg_attr(feature = "cli", arg(long, value_enum, help_heading = "Expert"))]
    pub indirect: Option<Indirect>,
    /// Longest light path in segments, camera to light; boundaries that do not refract light are not counted [default:
    /// no limit]
    #[cfg_attr(
        feature = "cli",
        arg(long, value_name = "N", whole = 1_u32..=1_000_000, help_heading = "Method", hide_short_help = true)
    )]
    pub max_depth: Option<u32>,
    /// Seed of the noise: the same seed and options give the same picture to the last bit
    #[cfg_attr(
        feature = "cli",
        arg(long, value_name = "S", default_value_t = 0, whole = 0..=u64::MAX, help_heading = "Method")
    )]
    pub seed: u64,

    /// Stop after this many seconds; the running iteration is discarded, unless it is the first
    #[cfg_attr(feature = "cli", arg(long, value_name = "SECONDS|1h30m", seconds = 0.0, help_heading = "When to stop"))]
    pub time: Option<f64>,
    /// Stop after this many iterations [default: 64, if nothing else says when to stop]
    #[cfg_attr(
        feature = "cli",
        arg(long, value_name = "N", whole = 1_u64..=crate::stat::sum::MAX_TERMS, help_heading = "When to stop")
    )]
    pub iterations: Option<u64>,
    /// Stop at this estimated relative error (the root of relMSE); 0.05 is 5 %
    #[cfg_attr(
        feature = "cli",
        arg(long, value_name = "E", between = (Excluded(0.0), Excluded(1.0)), help_heading = "When to stop")
    )]
    pub target_error: Option<f64>,
    /// Render only the iterations i with i mod N = I, for one of N machines
    #[cfg_attr(feature = "cli", arg(long, value_name = "I/N", help_heading = "Running", hide_short_help = true))]
    pub shard: Option<Shard>,

    /// Effects, such as dispersion, that the user has switched on or off.
    #[serde(skip)]
    #[cfg_attr(feature = "cli", arg(skip))]
    pub switches: Switches,
    /// Purpose of the network of the finish, which was trained with a number of levels; `None` without a network.
    #[serde(skip)]
    #[cfg_attr(feature = "cli", arg(skip))]
    pub network: Option<Purpose>,
    /// [`Settings::threads`].
    #[serde(skip)]
    #[cfg_attr(feature = "cli", arg(skip))]
    pub threads: usize,
    /// [`Settings::lobes`].
    #[serde(skip)]
    #[cfg_attr(feature = "cli", arg(skip))]
    pub lobes: bool,
    /// [`Settings::techniques`].
    #[serde(skip)]
    #[cfg_attr(feature = "cli", arg(skip))]
    pub techniques: bool,
}

/// Help texts repeat these numbers.
const _: () = assert!(MAX_LEVELS == 5);
const _: () = assert!(MAX_LIGHT_PATHS_PER_PIXEL == 4 && LIGHT_PATH_STEPS == 16 && MAX_CONNECTIONS == 4);

impl SettingsRequest {
    /// Settings of the method that the user names; of the library's default method if `auto` chooses.
    ///
    /// # Errors
    /// Options contradict each other.
    pub fn resolve(&self) -> Result<Settings> {
        // The default method has every option that any candidate of `auto` has, so this finds all contradictions.
        let method = self.method.0.unwrap_or_default();
        let candidate = Candidate {
            guided: self.guide == Some(OnOff::On),
            indirect: self.indirect.unwrap_or_default(),
            counts: self.counts()?,
            ..Candidate::unguided(method)
        };
        self.settings_of(candidate, self.method.0)
    }

    /// Settings of a candidate, one of the methods that `auto` compares, for a picture of `size` pixels (width,
    /// height); `None` if the user excludes the candidate.
    pub fn for_candidate(&self, candidate: Candidate, size: (u32, u32)) -> Option<Settings> {
        let method = candidate.method;
        let guide = match self.guide {
            None => true,
            Some(OnOff::On) => candidate.guided || !method.supports_guiding(),
            Some(OnOff::Off) => !candidate.guided,
        };
        let indirect = self.indirect.is_none_or(|indirect| !method.gathers() || candidate.indirect == indirect);
        let required = self.resolve().ok()?.levels;
        let levels = |settings: &Settings| self.network.is_none() || settings.levels == required;
        let settings = self.settings_of(candidate, Some(method)).ok();
        // Without some techniques another method remains, and the options must have an effect with it, too.
        let fits = |settings: &Settings| {
            settings.method == method || self.check_method(settings.method, None, settings.radius_rule).is_ok()
        };
        let allowed = settings.filter(|settings| guide && indirect && levels(settings) && fits(settings));
        allowed.map(|settings| settings.with_light_paths(self.photons, size))
    }

    /// Settings of a candidate (a method with indirect light and guiding). `chosen` is the method to name in errors,
    /// `None` before `auto` has chosen.
    fn settings_of(&self, candidate: Candidate, chosen: Option<Method>) -> Result<Settings> {
        let method = candidate.method;
        let local = method.rules().first() == Some(&BandwidthRule::Local);
        let radius_rule = self.radius_rule.unwrap_or(if local { RadiusRule::Local } else { RadiusRule::Memoryless });
        self.check_method(method, chosen, radius_rule)?;
        if method.has_one_map() && self.knn == Some(1) {
            // The k-th photon is at the edge of the kernel, so one neighbour would leave no photon inside.
            let error = Error::usage("--knn must be 2 or more with --method pm");
            return Err(error.hint(format!("the default is {DEFAULT_MAP_KNN}")));
        }
        let default = Settings::for_candidate(candidate);
        let levels = self.levels(method);
        let limited = self.time.is_some() || self.target_error.is_some();
        let settings = Settings {
            method,
            seed: self.seed,
            photons: self.photons.unwrap_or(default.photons),
            photon_memory: self.photon_memory.map_or(default.photon_memory, |mib| u64::from(mib) << 20),
            levels,
            lobes: self.lobes,
            techniques: self.techniques,
            initial_bandwidth: self.initial_bandwidth(method, levels.count)?,
            alpha: self.alpha.unwrap_or(default.alpha),
            volume_alpha: self.alpha.unwrap_or(default.volume_alpha),
            radius_rule,
            kernel: self.kernel.unwrap_or(default.kernel),
            chi_squared: self.chi_squared(),
            max_depth: self.max_depth.unwrap_or(default.max_depth),
            iterations: self.iterations.or((!limited).then_some(DEFAULT_ITERATIONS)),
            time: self.time,
            threads: self.threads,
            target_error: self.target_error,
            shard: self.shard.unwrap_or(default.shard),
            guided: candidate.guided,
            classes: self.switches.classes(),
            ..default
        };
        self.check_shard(&settings)?;
        Ok(settings.without_unused_techniques())
    }

    /// Parameters of the chi-squared rule by which bandwidths of `cppm` shrink.
    fn chi_squared(&self) -> ChiSquaredSettings {
        let default = ChiSquaredSettings::default();
        ChiSquaredSettings {
            annuli: self.cppm_grid.map_or(default.annuli, |grid| grid.annuli),
            sectors: self.cppm_grid.map_or(default.sectors, |grid| grid.sectors),
            k: self.cppm_k.unwrap_or(default.k),
            beta: self.cppm_beta.unwrap_or(default.beta),
            significance: self.cppm_significance.unwrap_or(default.significance),
            plus: self.cppm_plus,
        }
    }

    /// The rule for the largest initial bandwidth of a method with this number of bandwidth levels.
    fn initial_bandwidth(&self, method: Method, levels: usize) -> Result<InitialBandwidth> {
        let default = if method.takes_photon_count() { BandwidthChoice::Knn } else { BandwidthChoice::Footprint };
        match (self.initial_bandwidth.unwrap_or(default), self.knn) {
            (BandwidthChoice::Knn, k) => {
                Ok(InitialBandwidth::Nearest(k.map_or(method.default_neighbours(levels), |k| k as usize)))
            }
            (_, Some(_)) => {
                Err(Error::usage("--knn has no effect with this --initial-bandwidth").hint("leave one of the two out"))
            }
            (BandwidthChoice::Footprint, None) => Ok(InitialBandwidth::Footprint),
            (BandwidthChoice::Length(r), None) => Ok(InitialBandwidth::Fixed(r as f32)),
        }
    }

    /// Numbers of samples of the techniques of bidirectional methods.
    fn counts(&self) -> Result<Counts> {
        let default = Counts::default();
        let steps = self.light_paths.map_or(f64::from(default.light_paths), |n| n * f64::from(LIGHT_PATH_STEPS));
        if steps.fract() != 0.0 {
            let cause = format!("--light-paths must be a multiple of 1/{LIGHT_PATH_STEPS}");
            return Err(Error::usage(cause).hint("0.0625, 0.125, 0.25, 0.5, 1, 2 and 4 are common numbers"));
        }
        let needing = [("connections", self.connections.map(f64::from)), ("merging", self.merging)];
        let refused = needing.into_iter().find(|(_, value)| steps == 0.0 && value.is_some_and(|x| x > 0.0));
        if let Some((option, _)) = refused {
            let error = Error::usage(format!("--{option} needs light paths, and --light-paths 0 traces none"));
            return Err(error.hint(format!("leave --{option} out, or ask for more light paths")));
        }
        Ok(Counts {
            light_paths: steps as u32,
            connections: self.connections.unwrap_or(default.connections),
            merging: self.merging.map_or(default.merging, |probability| probability as f32),
        })
    }

    /// The number of bandwidth levels, and whether level 1 has a camera path of its own.
    fn levels(&self, method: Method) -> Levels {
        let has_levels = method.has_levels() && self.network != Some(Purpose::Finish);
        let count = self.levels.unwrap_or(if has_levels { MAX_LEVELS } else { 1 });
        // Equation (6) of the 2021 paper combines an independent level with correlated ones.
        let two_paths = self.eye_paths.map_or(self.network == Some(Purpose::Levels), |paths| paths == 2);
        if two_paths { Levels::decorrelated(count) } else { Levels::new(count) }
    }
}
