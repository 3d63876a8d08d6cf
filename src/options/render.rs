//! Options that `caustique render`, `caustique plan` and Python's `render` have in common, and the [`Settings`] that
//! follow from them.

// Help texts have defaults in brackets, which are not links.
#![allow(rustdoc::broken_intra_doc_links)]

use super::finish::FinishOptions;
use super::frames::Frames;
use super::number::Ranged;
use super::scene::SceneOptions;
use super::values::{BandwidthChoice, CropChoice, FrameSeed, GridChoice, MethodChoice, OnOff, filter};
use crate::camera::Filter;
use crate::error::{Error, Result};
use crate::estimator::InitialBandwidth;
use crate::estimator::bandwidth::SCREEN_CAP;
use crate::estimator::rule::chi_squared::ChiSquaredSettings;
use crate::estimator::rule::volume::ALPHA as VOLUME_ALPHA;
use crate::finish::{Denoiser, DenoiserChoice, Finish};
use crate::pipeline::sized;
use crate::render::{
    BandwidthRule, Candidate, DEFAULT_ITERATIONS, DEFAULT_MAP_KNN, DEFAULT_MAP_MEMORY, KernelChoice, Levels, Method,
    PHOTON_BYTES, RadiusRule, Settings, Shard,
};
use crate::scene::{CameraRequest, MAX_SIZE};
use crate::stat::sum::MAX_TERMS;
use crate::stop::Stop;
use crate::transport::{Indirect, MAX_LEVELS};
use serde::Serialize;
use std::ops::Bound::{Excluded, Included, Unbounded};

/// A picture of a scene, the method, and when to stop.
#[derive(clap::Args, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct RenderOptions {
    /// How light is found
    #[arg(long, value_enum, default_value_t, help_heading = "Method")]
    pub method: MethodChoice,
    /// Light paths sent from the lights in an iteration: more give a smoother start, fewer faster iterations [default:
    /// 100000]
    ///
    /// By ppm, sppm, appm and cppm in each iteration, by pm once, for its one map, 2000000 unless told otherwise;
    /// guided ones with --indirect paths send one a pixel, at most 100000. The other methods send one for every eye
    /// path, or none
    #[arg(long, value_name = "N", whole = 1_u32..=50_000_000, help_heading = "Method")]
    pub photons: Option<u32>,
    /// Memory for the map of pm in MiB, while it is built: 160 bytes a photon. Where it is full, light paths end, and a
    /// warning says so [default: 1024]
    #[arg(long, value_name = "MIB", whole = 1..=u32::MAX, help_heading = "Expert")]
    pub photon_memory: Option<u32>,
    /// Bandwidth levels of ppm, sppm, appm, cppm and vcm, 1 to 5, each 1/sqrt(2) of the next larger: images from sharp
    /// and noisy to smooth and blurred, from which the combiner makes one. The combiner that comes with the program
    /// takes 5 [default: 5]
    #[arg(long, value_name = "M", whole = 1..=MAX_LEVELS, help_heading = "Expert")]
    pub levels: Option<usize>,
    /// Eye paths of a pixel in an iteration with several levels: one for all levels, or two, of which one is level 1's
    /// own, as the network of --model was trained with; they take about 1.7 times as long [default: 1, with --model 2]
    #[arg(long, value_name = "1|2", whole = 1_u32..=2, help_heading = "Expert")]
    pub eye_paths: Option<u32>,
    /// What sets the largest bandwidth to begin with: 'knn' the distance to the k-th nearest photon, 'footprint' three
    /// pixels, or a length in scene units from 1e-9 to 1e9, the same everywhere [default: knn; bpm and vcm: footprint]
    #[arg(long, value_name = "knn|footprint|R", help_heading = "Expert")]
    pub initial_bandwidth: Option<BandwidthChoice>,
    /// Photons within the largest bandwidth to begin with, 1 to 1024; with pm within every bandwidth [default: 20, with
    /// one level 10; pm: 100]
    #[arg(long, value_name = "K", whole = 1_u32..=1024, help_heading = "Expert")]
    pub knn: Option<u32>,
    /// How fast bandwidths shrink, in (0, 1]: smaller values sharpen sooner and stay noisy longer, 1 never
    /// shrinks [default: 2/3; bpm and vcm: 0.75]
    #[arg(long, value_name = "A", between = (Excluded(0.0), Included(1.0)), help_heading = "Expert")]
    pub alpha: Option<f64>,
    /// With cppm the cells in which photons are counted: annuli and sectors of each, at most 64 in all [default: 2,6]
    #[arg(long, value_name = "NA,NS", help_heading = "Expert")]
    pub cppm_grid: Option<GridChoice>,
    /// With cppm the factor of the squared bandwidth where nothing within it looks uniform, in (0, 1) [default: 0.8]
    #[arg(long, value_name = "K", between = (Excluded(0.0), Excluded(1.0)), help_heading = "Expert")]
    pub cppm_k: Option<f64>,
    /// With cppm the growth, with every reduction, of the number of photons it takes for a test: 1 to 1000 [default:
    /// 1.2]
    #[arg(long, value_name = "BETA", between = (Included(1.0), Included(1000.0)), help_heading = "Expert")]
    pub cppm_beta: Option<f64>,
    /// With cppm the probability of taking uniform photons for others, in (0, 1) [default: 0.05]
    #[arg(long, value_name = "P", between = (Excluded(0.0), Excluded(1.0)), help_heading = "Expert")]
    pub cppm_significance: Option<f64>,
    /// With cppm red, green and blue apart, with photons of equal flux: finds what differs in colour or brightness but
    /// not in the number of photons, such as the picture of a projector; takes about three times as long
    #[arg(long, help_heading = "Expert")]
    pub cppm_plus: bool,
    /// How bandwidths of sppm shrink: 'memoryless' by the iteration's number alone, 'local' by the photons found
    /// [default: memoryless; ppm: local]
    #[arg(long, value_enum, help_heading = "Expert")]
    pub radius_rule: Option<RadiusRule>,
    /// How sppm and appm weigh photons by their distance: 'box' alike within the bandwidth, 'epanechnikov' and
    /// 'gaussian' (cut off at three standard deviations, which are the bandwidth) less towards the rim; ppm, cppm and
    /// the local rule count photons and need box [default: box]
    #[arg(long, value_enum, help_heading = "Expert")]
    pub kernel: Option<KernelChoice>,
    /// Guided emission: 'on' lets light paths start toward mirrors and glass, from the lights and as often as a short
    /// pilot finds them to matter; the light is the same, its noise another. Not for path, pm and --cppm-plus [default:
    /// off; auto: on where light is focused]
    #[arg(long, value_enum, help_heading = "Expert")]
    pub guide: Option<OnOff>,
    /// Who brings sppm the light that has bounced broadly: 'photons', or 'paths', eye paths that go on, which leaves
    /// caustics to the photons [default: photons]
    #[arg(long, value_enum, help_heading = "Expert")]
    pub indirect: Option<Indirect>,
    /// Longest light path in segments, camera to light; boundaries that do not bend light are not counted [default: no
    /// limit]
    #[arg(long, value_name = "N", whole = 1_u32..=1_000_000, help_heading = "Method")]
    pub max_depth: Option<u32>,
    /// Seed: another number, other noise; the same number and options, the same picture to the last bit
    #[arg(long, value_name = "S", default_value_t = 0, whole = 0..=u64::MAX, help_heading = "Method")]
    pub seed: u64,
    /// Noise of the frames: 'vary' gives frame N the seed S + N, so that what noise is left moves; 'same' gives all of them
    /// the seed S, so that it stays in place
    #[arg(long, value_enum, default_value_t, help_heading = "Method")]
    pub frame_seed: FrameSeed,

    /// Stop after so many seconds of rendering; the running iteration is given up, but the first is finished
    #[arg(long, value_name = "SECONDS", between = (Excluded(0.0), Unbounded), help_heading = "When to stop")]
    pub time: Option<f64>,
    /// Stop after so many iterations [default: 64, if nothing else says when to stop]
    #[arg(long, value_name = "N", whole = 1_u64..=MAX_TERMS, help_heading = "When to stop")]
    pub iterations: Option<u64>,
    /// Stop when the estimated relative error (the root of relMSE) is this small; 0.05 is 5 %
    #[arg(long, value_name = "E", between = (Excluded(0.0), Excluded(1.0)), help_heading = "When to stop")]
    pub target_error: Option<f64>,
    /// Render only the iterations i with i mod N = I, for one of N machines
    #[arg(long, value_name = "I/N", help_heading = "Running")]
    pub shard: Option<Shard>,

    /// Width in pixels; without a height the camera's aspect is kept [default: the scene's, else 1280]
    #[arg(long, value_name = "W", whole = 1..=MAX_SIZE, help_heading = "Picture")]
    pub width: Option<u32>,
    /// Height in pixels; without a width the camera's aspect is kept
    #[arg(long, value_name = "H", whole = 1..=MAX_SIZE, help_heading = "Picture")]
    pub height: Option<u32>,
    /// Render a window of the picture alone: left edge, top edge, width and height, in pixels, or in shares such as
    /// 0.25,0,0.5,1 [default: the scene's, else all]
    #[arg(long, value_name = "X,Y,W,H", help_heading = "Picture")]
    pub crop: Option<CropChoice>,
    /// Pixel filter and its width in pixels, as Blender counts it: 'box' [1], 'gaussian' [1.5] or 'blackman-harris' [1.5]
    /// [default: box 1]
    #[arg(long, num_args = 1..=2, action = clap::ArgAction::Set, value_names = ["box|gaussian|blackman-harris", "WIDTH"])]
    #[arg(help_heading = "Picture")]
    pub filter: Option<Vec<String>>,
    /// Camera by name [default: the scene's first]
    #[arg(long, value_name = "NAME", help_heading = "Picture")]
    pub camera: Option<String>,

    /// The scene and how it is read.
    #[command(flatten)]
    #[serde(flatten)]
    pub scene: SceneOptions,

    /// No finish at all: the picture is the estimator's own, at the usual single bandwidth
    #[arg(long, conflicts_with_all = ["model", "denoise"], help_heading = "Finish")]
    pub no_combine: bool,
    /// How the estimate becomes the picture.
    #[command(flatten)]
    #[serde(flatten)]
    pub finish: FinishOptions,
}

/// The help texts of `--levels` and `--photon-memory` repeat these numbers.
const _: () = assert!(MAX_LEVELS == 5 && PHOTON_BYTES == 160);

impl RenderOptions {
    /// The requested camera, size, window and pixel filter.
    ///
    /// # Errors
    /// The filter is invalid.
    pub fn camera_request(&self) -> Result<CameraRequest> {
        let crop = self.crop.as_ref().map(|choice| choice.crop);
        let filter = self.filter.as_deref().map_or(Ok(Filter::default()), filter)?;
        Ok(CameraRequest { camera: self.camera.clone(), width: self.width, height: self.height, crop, filter })
    }

    /// The settings of the requested render. With `--method auto`, the settings of the default method, which pilots use to
    /// weigh effects.
    ///
    /// # Errors
    /// Options contradict each other.
    pub fn settings(&self) -> Result<Settings> {
        // Before `auto` has chosen, the default method stands in. No candidate takes an option that it does not take.
        let method = self.method.0.unwrap_or_default();
        let candidate =
            Candidate { method, guided: self.guide == Some(OnOff::On), indirect: self.indirect.unwrap_or_default() };
        self.settings_of(candidate, self.method.0)
    }

    /// The denoiser of the picture.
    fn denoiser(&self) -> DenoiserChoice {
        if self.no_combine { DenoiserChoice::None } else { self.finish.denoise }
    }

    /// The finish of the pilots of `auto`.
    pub fn pilot_finish(&self) -> Finish {
        Finish::for_pilots(self.denoiser())
    }

    /// The finish of a pilot that predicts the error of the render: the denoiser of the render, without a network.
    ///
    /// # Errors
    /// The user chose a denoiser whose library is missing.
    pub fn outlook_finish(&self) -> Result<Finish> {
        Ok(Finish::new(Denoiser::open(self.denoiser())?.0, None))
    }

    /// Settings of a candidate of `auto`, for a picture of `size` pixels; `None` if the options exclude the candidate.
    pub fn candidate_settings(&self, candidate: Candidate, size: (u32, u32)) -> Option<Settings> {
        let method = candidate.method;
        let guide = match self.guide {
            None => true,
            Some(OnOff::On) => candidate.guided || !method.supports_guiding(),
            Some(OnOff::Off) => !candidate.guided,
        };
        let indirect = self.indirect.is_none_or(|asked| !method.gathers() || candidate.indirect == asked);
        // A network takes the number of levels that it was trained with.
        let required = self.settings().ok()?.levels;
        let levels = |settings: &Settings| self.finish.model.is_none() || settings.levels == required;
        let settings = self.settings_of(candidate, Some(method)).ok();
        let allowed = settings.filter(|settings| guide && indirect && levels(settings));
        allowed.map(|settings| sized(settings, self.photons, size))
    }

    /// The seed of the rendered frame.
    fn frame_seed(&self) -> u64 {
        let frame = self.scene.frames.and_then(Frames::single);
        match (self.frame_seed, frame) {
            (FrameSeed::Vary, Some(frame)) => self.seed.wrapping_add(frame.into()),
            _ => self.seed,
        }
    }

    /// Parameters of the chi-squared rule.
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

    /// The largest initial bandwidth of a method with `levels` levels.
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

    /// The number of bandwidth levels, and whether level 1 has a camera path of its own.
    fn levels(&self, method: Method) -> Levels {
        let count = self.levels.unwrap_or(if method.has_levels() { MAX_LEVELS } else { 1 });
        // Equation (6) of the 2021 paper combines an independent level with correlated ones.
        let two_paths = self.eye_paths.map_or(self.finish.model.is_some(), |paths| paths == 2);
        if two_paths { Levels::decorrelated(count) } else { Levels::new(count) }
    }

    /// Settings of a candidate. `chosen` is the method to name in errors, `None` before `auto` has chosen.
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
        let levels = self.levels(method);
        let limited = self.time.is_some() || self.target_error.is_some();
        let settings = Settings {
            method,
            seed: self.frame_seed(),
            photons: self.photons.unwrap_or(method.default_photons()),
            photon_memory: self.photon_memory.map_or(DEFAULT_MAP_MEMORY, |mib| u64::from(mib) << 20),
            levels,
            techniques: false,
            initial_bandwidth: self.initial_bandwidth(method, levels.count)?,
            max_initial_bandwidth: [SCREEN_CAP; 2],
            alpha: self.alpha.unwrap_or(method.default_alpha()),
            volume_alpha: self.alpha.unwrap_or(VOLUME_ALPHA),
            radius_rule,
            kernel: self.kernel.unwrap_or_default(),
            chi_squared: self.chi_squared(),
            max_depth: self.max_depth.unwrap_or(u32::MAX),
            iterations: self.iterations.or((!limited).then_some(DEFAULT_ITERATIONS)),
            time: self.time,
            target_error: self.target_error,
            shard: self.shard.unwrap_or(Shard { index: 0, count: 1 }),
            stop: Stop::default(),
            guided: candidate.guided,
            indirect: candidate.indirect,
            classes: self.scene.switches().classes(),
        };
        self.check_shard(&settings)?;
        Ok(settings)
    }
}
