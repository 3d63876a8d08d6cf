//! What is rendered and how: the options that `caustique render` and `caustique plan` have in common.

use crate::cli::finish::FinishArgs;
use crate::cli::frames::Frames;
use crate::cli::number::{between, positive, relative_error, whole};
use crate::cli::scene::SceneArgs;
use caustique::camera::{Filter, WIDEST};
use caustique::error::{Error, Kind, Result};
use caustique::estimator::InitialBandwidth;
use caustique::estimator::bandwidth::SCREEN_CAP;
use caustique::estimator::rule::chi_squared::ChiSquaredSettings;
use caustique::estimator::rule::volume::ALPHA as VOLUME_ALPHA;
use caustique::finish::{Denoiser, DenoiserChoice, Finish};
use caustique::pipeline::sized;
use caustique::render::Strategy;
use caustique::render::{
    self, DEFAULT_ITERATIONS, DEFAULT_MAP_KNN, DEFAULT_MAP_MEMORY, KernelChoice, Levels, MAX_SHARDS, PHOTON_BYTES,
    Settings, Shard,
};
use caustique::scene::{Crop, MAX_SIZE, View};
use caustique::stat::sum::MOST_TERMS;
use caustique::stop::Stop;
use caustique::transport::MAX_LEVELS;
use clap::ValueEnum;
use serde::Serialize;
use std::ops::Bound::{Excluded, Included};
use std::str::FromStr;

/// A picture of a scene, the method, and when to stop.
#[derive(clap::Args, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct Job {
    /// How light is found
    #[arg(long, value_enum, default_value_t = Method::Auto, help_heading = "Method")]
    pub method: Method,
    /// Light paths sent from the lights in an iteration: more give a smoother start, fewer faster iterations [default:
    /// 100000]
    ///
    /// By ppm, sppm, appm and cppm in each iteration, by pm once, for its one map, 2000000 unless told otherwise;
    /// guided ones with --indirect paths send one a pixel, at most 100000. The other methods send one for every eye
    /// path, or none
    #[arg(long, value_name = "N", value_parser = whole(1_u32..=50_000_000), help_heading = "Method")]
    pub photons: Option<u32>,
    /// Memory for the map of pm in MiB, while it is built: 160 bytes a photon. Where it is full, light paths end, and a
    /// warning says so [default: 1024]
    #[arg(long, value_name = "MIB", value_parser = whole(1..=u32::MAX), help_heading = "Expert")]
    pub photon_memory: Option<u32>,
    /// Bandwidth levels of ppm, sppm, appm, cppm and vcm, 1 to 5, each 1/sqrt(2) of the next larger: images from sharp
    /// and noisy to smooth and blurred, from which the combiner makes one. The combiner that comes with the program
    /// takes 5 [default: 5]
    #[arg(long, value_name = "M", value_parser = level_count, help_heading = "Expert")]
    pub levels: Option<usize>,
    /// Eye paths of a pixel in an iteration with several levels: one for all levels, or two, of which one is level 1's
    /// own, as the network of --model was trained with; they take about 1.7 times as long [default: 1, with --model 2]
    #[arg(long, value_name = "1|2", value_parser = whole(1_u32..=2), help_heading = "Expert")]
    pub eye_paths: Option<u32>,
    /// What sets the largest bandwidth to begin with: 'knn' the distance to the k-th nearest photon, 'footprint' three
    /// pixels, or a length in scene units from 1e-9 to 1e9, the same everywhere [default: knn; bpm and vcm: footprint]
    #[arg(long, value_name = "knn|footprint|R", help_heading = "Expert")]
    pub initial_bandwidth: Option<BandwidthChoice>,
    /// Photons within the largest bandwidth to begin with, 1 to 1024; with pm within every bandwidth [default: 20, with
    /// one level 10; pm: 100]
    #[arg(long, value_name = "K", value_parser = whole(1_u32..=1024), help_heading = "Expert")]
    pub knn: Option<u32>,
    /// How fast bandwidths shrink, in (0, 1]: smaller values sharpen sooner and stay noisy longer, 1 never
    /// shrinks [default: 2/3; bpm and vcm: 0.75]
    #[arg(long, value_name = "A", value_parser = between(Excluded(0.0), Included(1.0)), help_heading = "Expert")]
    pub alpha: Option<f64>,
    /// With cppm the cells in which photons are counted: annuli and sectors of each, at most 64 in all [default: 2,6]
    #[arg(long, value_name = "NA,NS", help_heading = "Expert")]
    pub cppm_grid: Option<GridChoice>,
    /// With cppm the factor of the squared bandwidth where nothing within it looks uniform, in (0, 1) [default: 0.8]
    #[arg(long, value_name = "K", value_parser = between(Excluded(0.0), Excluded(1.0)), help_heading = "Expert")]
    pub cppm_k: Option<f64>,
    /// With cppm the growth, with every reduction, of the number of photons it takes for a test: 1 to 1000 [default:
    /// 1.2]
    #[arg(long, value_name = "BETA", value_parser = between(Included(1.0), Included(1000.0)), help_heading = "Expert")]
    pub cppm_beta: Option<f64>,
    /// With cppm the probability of taking uniform photons for others, in (0, 1) [default: 0.05]
    #[arg(long, value_name = "P", value_parser = between(Excluded(0.0), Excluded(1.0)), help_heading = "Expert")]
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
    pub kernel: Option<Kernel>,
    /// Guided emission: 'on' lets light paths start toward mirrors and glass, from the lights and as often as a short
    /// pilot finds them to matter; the light is the same, its noise another. Not for path, pm and --cppm-plus [default:
    /// off; auto: on where light is focused]
    #[arg(long, value_enum, help_heading = "Expert")]
    pub guide: Option<Switch>,
    /// Who brings sppm the light that has bounced broadly: 'photons', or 'paths', eye paths that go on, which leaves
    /// caustics to the photons [default: photons]
    #[arg(long, value_enum, help_heading = "Expert")]
    pub indirect: Option<Indirect>,
    /// Longest light path in segments, camera to light; boundaries that do not bend light are not counted [default: no
    /// limit]
    #[arg(long, value_name = "N", value_parser = whole(1_u32..=1_000_000), help_heading = "Method")]
    pub max_depth: Option<u32>,
    /// Seed: another number, other noise; the same number and options, the same picture to the last bit
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = whole(0..=u64::MAX), help_heading = "Method")]
    pub seed: u64,
    /// Noise of the frames: 'vary' gives frame N the seed S + N, so that what noise is left moves; 'same' gives all of them
    /// the seed S, so that it stays in place
    #[arg(long, value_enum, default_value_t = FrameSeed::Vary, help_heading = "Method")]
    pub frame_seed: FrameSeed,

    /// Stop after so many seconds of rendering; the running iteration is given up, but the first is finished
    #[arg(long, value_name = "SECONDS", value_parser = positive, help_heading = "When to stop")]
    pub time: Option<f64>,
    /// Stop after so many iterations [default: 64, if nothing else says when to stop]
    #[arg(long, value_name = "N", value_parser = whole(1_u64..=MOST_TERMS), help_heading = "When to stop")]
    pub iterations: Option<u64>,
    /// Stop when the estimated relative error (the root of relMSE) is this small; 0.05 is 5 %
    #[arg(long, value_name = "E", value_parser = relative_error, help_heading = "When to stop")]
    pub target_error: Option<f64>,
    /// Render only the iterations i with i mod N = I, for one of N machines
    #[arg(long, value_name = "I/N", help_heading = "Running")]
    pub shard: Option<ShardChoice>,

    /// Width in pixels; without a height the camera's aspect is kept [default: the scene's, else 1280]
    #[arg(long, value_name = "W", value_parser = whole(1..=MAX_SIZE), help_heading = "Picture")]
    pub width: Option<u32>,
    /// Height in pixels; without a width the camera's aspect is kept
    #[arg(long, value_name = "H", value_parser = whole(1..=MAX_SIZE), help_heading = "Picture")]
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

    #[command(flatten)]
    #[serde(flatten)]
    pub scene: SceneArgs,

    /// No finish at all: the picture is the estimator's own, at the usual single bandwidth
    #[arg(long, conflicts_with_all = ["model", "denoise"], help_heading = "Finish")]
    pub no_combine: bool,
    #[command(flatten)]
    #[serde(flatten)]
    pub finish: FinishArgs,
}

/// Methods that exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// vcm, guided where light is focused; elsewhere path or bdpt where a short pilot shows them to be clearly better
    Auto,
    /// Path tracing
    Path,
    /// Light tracing: what mirrors and clear glass show stays black
    Light,
    /// Bidirectional path tracing
    Bdpt,
    /// Classical photon mapping: one map, the nearest photons; tends to a blurred picture
    Pm,
    /// Progressive photon mapping: one fixed point per pixel, so edges are jagged
    Ppm,
    /// Stochastic progressive photon mapping
    Sppm,
    /// Adaptive progressive photon mapping: sppm whose bandwidths have the least estimated error
    Appm,
    /// Chi-squared progressive photon mapping: sppm whose bandwidths shrink only where the photons do not look uniform
    Cppm,
    /// Bidirectional photon mapping: merging alone
    Bpm,
    /// Vertex connection and merging
    Vcm,
    /// Metropolis light transport: chains that stay where light is; what they miss they miss for long
    Mlt,
}

impl Method {
    /// The method that renders.
    pub fn chosen(self) -> render::Method {
        match self {
            Method::Auto | Method::Sppm => render::Method::Sppm,
            Method::Path => render::Method::Path,
            Method::Light => render::Method::Light,
            Method::Bdpt => render::Method::Bdpt,
            Method::Pm => render::Method::Pm,
            Method::Ppm => render::Method::Ppm,
            Method::Appm => render::Method::Appm,
            Method::Cppm => render::Method::Cppm,
            Method::Bpm => render::Method::Bpm,
            Method::Vcm => render::Method::Vcm,
            Method::Mlt => render::Method::Mlt,
        }
    }
}

/// Who brings indirect light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Indirect {
    /// Photons
    Photons,
    /// Eye paths, which go on; photons bring caustics alone
    Paths,
}

impl From<Indirect> for caustique::transport::Indirect {
    fn from(indirect: Indirect) -> Self {
        match indirect {
            Indirect::Photons => caustique::transport::Indirect::Photons,
            Indirect::Paths => caustique::transport::Indirect::Paths,
        }
    }
}

/// On or off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Switch {
    /// On
    On,
    /// Off
    Off,
}

/// Seeds of frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum FrameSeed {
    /// Another for each
    Vary,
    /// The same for all
    Same,
}

/// Rules by which bandwidths shrink.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum RadiusRule {
    /// By the iteration's number alone
    Memoryless,
    /// By the photons found
    Local,
}

/// Kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kernel {
    /// Alike within the bandwidth
    Box,
    /// Falling with the squared distance
    Epanechnikov,
    /// A normal distribution cut off at three standard deviations
    Gaussian,
}

/// `--initial-bandwidth`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum BandwidthChoice {
    /// By neighbours.
    Knn,
    /// By pixels.
    Footprint,
    /// Scene units.
    #[serde(untagged)]
    Length(f64),
}

impl FromStr for BandwidthChoice {
    type Err = String;
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "knn" => Ok(BandwidthChoice::Knn),
            "footprint" => Ok(BandwidthChoice::Footprint),
            length => match length.parse::<f64>() {
                Ok(r) if (1e-9..=1e9).contains(&r) => Ok(BandwidthChoice::Length(r)),
                Ok(_) => Err("a length must be from 1e-9 to 1e9".into()),
                Err(_) => Err("it is neither 'knn' nor 'footprint' nor a length".into()),
            },
        }
    }
}

/// `--cppm-grid NA,NS`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct GridChoice {
    /// Annuli.
    pub annuli: usize,
    /// Sectors of each.
    pub sectors: usize,
}

impl FromStr for GridChoice {
    type Err = String;
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts = text.split_once(',').and_then(|(a, s)| Some((a.parse().ok()?, s.parse().ok()?)));
        let cells =
            |annuli: usize, sectors: usize| annuli.checked_mul(sectors).filter(|cells| (2..=64).contains(cells));
        match parts {
            Some((annuli, sectors)) if cells(annuli, sectors).is_some() => Ok(GridChoice { annuli, sectors }),
            Some(_) => Err("there must be 2 to 64 cells".into()),
            None => Err("it must be NA,NS, such as 2,6".into()),
        }
    }
}

/// `--shard I/N`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ShardChoice {
    /// Which one, from 0.
    pub index: u64,
    /// Of how many.
    pub count: u64,
}

/// A window of the picture.
#[derive(Clone, Debug, Serialize)]
pub struct CropChoice {
    /// As it was written.
    pub window: String,
    /// What it means.
    #[serde(skip)]
    pub crop: Crop,
}

impl FromStr for CropChoice {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let fault =
            || "it must be X,Y,W,H, in pixels (320,0,640,720) or in shares of the picture (0.25,0,0.5,1)".to_string();
        let parts: Vec<&str> = text.split(',').map(str::trim).collect();
        let parts: [&str; 4] = parts.try_into().map_err(|_| fault())?;
        let shares = parts.iter().any(|part| part.contains('.')) || parts[2..] == ["1", "1"];
        let crop = if shares {
            let numbers = parts.map(|part| part.parse::<f64>().ok().filter(|x| (0.0..=1.0).contains(x)));
            let [Some(x), Some(y), Some(w), Some(h)] = numbers else { return Err(fault()) };
            Crop::Shares([x, y, w, h])
        } else {
            let numbers = parts.map(|part| part.parse::<u32>().ok());
            let [Some(x), Some(y), Some(w), Some(h)] = numbers else { return Err(fault()) };
            Crop::Pixels([x, y, w, h])
        };
        // What is empty or beyond any picture is beyond this one.
        match crop.window((MAX_SIZE, MAX_SIZE)) {
            Some(_) => Ok(CropChoice { window: text.into(), crop }),
            None => Err("the window is empty or not within the picture".into()),
        }
    }
}

/// The filter of a name and perhaps a width.
fn filter(words: &[String]) -> Result<Filter> {
    let fault = |cause: String| {
        let error = Error::new(Kind::Usage, "command line", cause);
        error.hint(
            "give --filter box, gaussian or blackman-harris and perhaps a width in pixels, and the scene before it",
        )
    };
    let width = match words.get(1) {
        None => None,
        Some(text) => match text.parse::<f32>().ok().filter(|width| (0.1..=WIDEST).contains(width)) {
            Some(width) => Some(width),
            None => return Err(fault(format!("--filter: '{text}' is no width from 0.1 to {WIDEST} pixels"))),
        },
    };
    match words.first().map(String::as_str) {
        Some("box") => Ok(Filter::Box(width.unwrap_or(1.0))),
        Some("gaussian") => Ok(Filter::Gaussian(width.unwrap_or(1.5))),
        Some("blackman-harris") => Ok(Filter::BlackmanHarris(width.unwrap_or(1.5))),
        other => Err(fault(format!("--filter: there is no filter '{}'", other.unwrap_or_default()))),
    }
}

impl FromStr for ShardChoice {
    type Err = String;
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((index, count)) if (Shard { index, count }).is_sound() => Ok(ShardChoice { index, count }),
            Some((_, 0)) => Err("there is no shard of 0".into()),
            Some((_, count)) if count <= MAX_SHARDS => Err(format!("shards of {count} are 0 to {}", count - 1)),
            Some(_) => Err(format!("there are at most {MAX_SHARDS} shards")),
            None => Err("it must be I/N, such as 0/4".into()),
        }
    }
}

/// The helps of `--levels` and `--photon-memory` name these.
const _: () = assert!(MAX_LEVELS == 5 && PHOTON_BYTES == 160);

fn level_count(text: &str) -> std::result::Result<usize, String> {
    let range = format!("it must be a whole number from 1 to {MAX_LEVELS}");
    text.parse().ok().filter(|m| (1..=MAX_LEVELS).contains(m)).ok_or(range)
}

/// The error of an option that says nothing to a method; it does to another.
pub(super) fn idle(option: &str, method: &str, other: &str) -> Error {
    let cause = format!("{option} has no effect with --method {method}");
    Error::new(Kind::Usage, "command line", cause).hint(format!("leave {option} out, or choose --method {other}"))
}

impl Job {
    /// The picture asked for.
    ///
    /// # Errors
    /// A filter that there is not.
    pub fn view(&self) -> Result<View> {
        let crop = self.crop.as_ref().map(|choice| choice.crop);
        let filter = self.filter.as_deref().map_or(Ok(Filter::default()), filter)?;
        Ok(View { camera: self.camera.clone(), width: self.width, height: self.height, crop, filter })
    }

    /// Errors: options that say nothing to the method.
    fn check_method(&self, method: render::Method, rule: render::RadiusRule) -> Result<()> {
        use render::Method as M;
        let local = rule == render::RadiusRule::Local;
        let idle_rule = match self.radius_rule {
            None => false,
            Some(RadiusRule::Local) => !matches!(method, M::Ppm | M::Sppm),
            Some(RadiusRule::Memoryless) => !matches!(method, M::Sppm | M::Bpm | M::Vcm),
        };
        let given = [
            (self.photons.is_some() && !method.counts_photons(), "--photons"),
            (self.photon_memory.is_some() && method != render::Method::Pm, "--photon-memory"),
            (self.levels.is_some_and(|m| m > 1) && !method.has_levels(), "--levels"),
            (self.knn.is_some() && !method.counts_photons(), "--knn"),
            (self.initial_bandwidth.is_some() && !method.has_bandwidths(), "--initial-bandwidth"),
            (
                self.initial_bandwidth == Some(BandwidthChoice::Knn) && !method.counts_photons(),
                "--initial-bandwidth knn",
            ),
            (self.alpha.is_some() && (!method.has_bandwidths() || matches!(method, M::Appm | M::Cppm)), "--alpha"),
            (idle_rule, "--radius-rule"),
            (self.cppm_grid.is_some() && method != render::Method::Cppm, "--cppm-grid"),
            (self.cppm_k.is_some() && method != render::Method::Cppm, "--cppm-k"),
            (self.cppm_beta.is_some() && method != render::Method::Cppm, "--cppm-beta"),
            (self.cppm_significance.is_some() && method != render::Method::Cppm, "--cppm-significance"),
            (self.cppm_plus && method != render::Method::Cppm, "--cppm-plus"),
            (self.guide == Some(Switch::On) && (!method.guides() || self.cppm_plus), "--guide"),
            (self.indirect == Some(Indirect::Paths) && (method != M::Sppm || local), "--indirect"),
        ];
        if self.kernel.is_some_and(|kernel| kernel != Kernel::Box) && (local || !matches!(method, M::Sppm | M::Appm)) {
            let what = if local { "the local rule" } else { method.name() };
            let error = Error::new(Kind::Usage, "command line", format!("{what} needs the box kernel"));
            return Err(error.hint("leave --kernel out, or choose --method sppm with the memoryless rule, or appm"));
        }
        let Some((_, option)) = given.iter().find(|(idle, _)| *idle) else { return Ok(()) };
        let plus = if self.cppm_plus { " --cppm-plus" } else { "" };
        let other = match *option {
            "--photon-memory" => "pm",
            option if option.starts_with("--cppm") => "cppm",
            _ => "sppm",
        };
        Err(idle(option, &format!("{}{plus}", method.name()), other))
    }

    /// The render asked for.
    ///
    /// # Errors
    /// Options that contradict each other.
    pub fn settings(&self) -> Result<Settings> {
        self.settings_of(self.way())
    }

    /// The way to render that the options ask for; with auto that which needs no trial.
    pub fn way(&self) -> Strategy {
        let indirect = self.indirect.map_or(Strategy::GATHERING.indirect, Into::into);
        Strategy { method: self.method.chosen(), guided: self.guide == Some(Switch::On), indirect }
    }

    /// What denoises the picture.
    fn denoiser(&self) -> DenoiserChoice {
        if self.no_combine { DenoiserChoice::None } else { self.finish.denoise.into() }
    }

    /// The finish of auto's pilots.
    pub fn pilot_finish(&self) -> Finish {
        Finish::of_pilots(self.denoiser())
    }

    /// The finish of a pilot that tells the error of the render: as the render's, but for a network.
    ///
    /// # Errors
    /// A library that was asked for by name is missing.
    pub fn outlook_finish(&self) -> Result<Finish> {
        Ok(Finish::new(Denoiser::open(self.denoiser())?.0, None))
    }

    /// Settings of a way that auto may choose, for a picture of that size; `None` where the options rule it out.
    pub fn allowed(&self, way: Strategy, size: (u32, u32)) -> Option<Settings> {
        let guide = match self.guide {
            None => true,
            Some(Switch::On) => way.guided || !way.method.guides(),
            Some(Switch::Off) => !way.guided,
        };
        let indirect = self.indirect.is_none_or(|asked| !way.method.gathers() || way.indirect == asked.into());
        // A network combines as many levels as it has learnt.
        let usual = self.settings().ok()?.levels;
        let levels = |settings: &Settings| self.finish.model.is_none() || settings.levels == usual;
        let allowed = self.settings_of(way).ok().filter(|settings| guide && indirect && levels(settings));
        allowed.map(|settings| sized(settings, self.photons, size))
    }

    /// The seed of the frame that is rendered.
    fn seed_of_frame(&self) -> u64 {
        let frame = self.scene.frames.and_then(Frames::single);
        match (self.frame_seed, frame) {
            (FrameSeed::Vary, Some(frame)) => self.seed.wrapping_add(frame.into()),
            _ => self.seed,
        }
    }

    /// Parameters of the chi-squared rule.
    fn chi_squared(&self) -> ChiSquaredSettings {
        let usual = ChiSquaredSettings::default();
        ChiSquaredSettings {
            annuli: self.cppm_grid.map_or(usual.annuli, |grid| grid.annuli),
            sectors: self.cppm_grid.map_or(usual.sectors, |grid| grid.sectors),
            k: self.cppm_k.unwrap_or(usual.k),
            beta: self.cppm_beta.unwrap_or(usual.beta),
            significance: self.cppm_significance.unwrap_or(usual.significance),
            plus: self.cppm_plus,
        }
    }

    /// What sets the largest initial bandwidth of a method with so many levels.
    fn initial(&self, method: render::Method, levels: usize) -> Result<InitialBandwidth> {
        let usual = if method.counts_photons() { BandwidthChoice::Knn } else { BandwidthChoice::Footprint };
        match (self.initial_bandwidth.unwrap_or(usual), self.knn) {
            (BandwidthChoice::Knn, k) => {
                Ok(InitialBandwidth::Nearest(k.map_or(method.neighbours(levels), |k| k as usize)))
            }
            (_, Some(_)) => {
                let error =
                    Error::new(Kind::Usage, "command line", "--knn has no effect with this --initial-bandwidth");
                Err(error.hint("leave one of the two out"))
            }
            (BandwidthChoice::Footprint, None) => Ok(InitialBandwidth::Footprint),
            (BandwidthChoice::Length(r), None) => Ok(InitialBandwidth::Fixed(r as f32)),
        }
    }

    fn settings_of(&self, way: Strategy) -> Result<Settings> {
        let method = way.method;
        let radius_rule = match (self.radius_rule, method) {
            (Some(RadiusRule::Local), _) | (None, render::Method::Ppm) => render::RadiusRule::Local,
            _ => render::RadiusRule::Memoryless,
        };
        self.check_method(method, radius_rule)?;
        if method == render::Method::Pm && self.knn == Some(1) {
            // The k-th photon is on the rim: with one neighbour there would be none inside.
            let error = Error::new(Kind::Usage, "command line", "--knn must be 2 or more with --method pm");
            return Err(error.hint(format!("the default is {DEFAULT_MAP_KNN}")));
        }
        let count = self.levels.unwrap_or(if method.has_levels() { MAX_LEVELS } else { 1 });
        // Equation (6) of the 2021 paper combines an independent level with correlated ones.
        let two_paths = self.eye_paths.map_or(self.finish.model.is_some(), |paths| paths == 2);
        let levels = if two_paths { Levels::decorrelated(count) } else { Levels::new(count) };
        let initial = self.initial(method, levels.count)?;
        let limited = self.time.is_some() || self.target_error.is_some();
        let iterations = self.iterations.or((!limited).then_some(DEFAULT_ITERATIONS));
        let shard = self.shard.map_or(Shard { index: 0, count: 1 }, |s| Shard { index: s.index, count: s.count });
        if let Some(n) = iterations.filter(|n| shard.index >= *n) {
            let cause = format!("shard {} of {} holds none of {n} iterations", shard.index, shard.count);
            return Err(Error::new(Kind::Usage, "command line", cause).hint("use fewer shards or more --iterations"));
        }
        let settings = render::Settings {
            method,
            seed: self.seed_of_frame(),
            photons: self.photons.unwrap_or(method.photons()),
            photon_memory: self.photon_memory.map_or(DEFAULT_MAP_MEMORY, |mib| u64::from(mib) << 20),
            levels,
            techniques: false,
            initial,
            widest: [SCREEN_CAP; 2],
            alpha: self.alpha.unwrap_or(method.alpha()),
            volume_alpha: self.alpha.unwrap_or(VOLUME_ALPHA),
            radius_rule,
            kernel: match self.kernel {
                None | Some(Kernel::Box) => KernelChoice::Box,
                Some(Kernel::Epanechnikov) => KernelChoice::Epanechnikov,
                Some(Kernel::Gaussian) => KernelChoice::Gaussian,
            },
            chi_squared: self.chi_squared(),
            max_depth: self.max_depth.unwrap_or(u32::MAX),
            iterations,
            time: self.time,
            target_error: self.target_error,
            shard,
            stop: Stop::default(),
            guided: way.guided,
            indirect: way.indirect,
            classes: self.scene.switches().classes(),
        };
        if self.shard.is_some() && !settings.is_memoryless() {
            let rule = if method == render::Method::Sppm { " with local statistics" } else { "" };
            let cause = format!(
                "--shard cannot divide --method {}{rule}: its bandwidths depend on all iterations before",
                method.name()
            );
            return Err(Error::new(Kind::Usage, "command line", cause)
                .hint("choose --method sppm with the memoryless rule, or render on one machine"));
        }
        Ok(settings)
    }
}
