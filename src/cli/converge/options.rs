//! The options of `caustique converge`.

use crate::cli::progress::Form;
use caustique::argument::{Ranged, finite, positive, threads};
use caustique::image::tonemap::ToneMap;
use caustique::options::{SceneOptions, SizeOptions};
use caustique::peers::Renderer;
use caustique::render::MethodChoice;
use caustique::report::crop::Window;
use caustique::report::entry::Metric;
use caustique::scene::CameraRequest;
use caustique::stat::sum::MAX_TERMS;
use std::ops::Bound::{Excluded, Included};
use std::path::PathBuf;
use std::str::FromStr;

/// Compare methods and settings: accuracy against time.
///
/// Renders all runs in turns, one iteration of each, and measures their errors against a reference at iterations that
/// form a geometric series. Writes plots, tables, fitted exponents and crops as one page, DIR/index.html, with
/// points.csv, points.json, the plots as SVG and the final pictures as EXR. Ctrl-C finishes the running iteration and
/// writes the results so far.
///
/// The seconds of a run include its pilot and iterations, not the measurements. A run has two curves: NAME is the
/// estimate; 'NAME, finished' is the finished picture, with the time of one finish, as if the run stopped there. With
/// --with, other renderers take turns with ours, and each of their points is a separate render.
#[derive(clap::Args)]
#[command(next_line_help = true)]
pub struct ConvergeArgs {
    /// Folder to write to; created if missing
    #[arg(short, long, value_name = "DIR", help_heading = "Output")]
    pub output: PathBuf,

    /// Methods, with their defaults and one bandwidth level [default: path,sppm,cppm,vcm, unless there is a --run]
    #[arg(long, value_enum, value_name = "LIST", value_delimiter = ',', help_heading = "Runs")]
    pub methods: Vec<MethodChoice>,
    /// A run: its name and its options of 'caustique render', such as 'five levels: --method sppm --levels 5'; may be
    /// repeated. The picture is finished unless --no-finish is given
    #[arg(long = "run", value_name = "NAME: OPTIONS", allow_hyphen_values = true, help_heading = "Runs")]
    pub runs: Vec<String>,
    /// Compare only estimates, no finished pictures
    #[arg(long, help_heading = "Runs")]
    pub no_finish: bool,
    /// Other renderers on the same scene, at budgets that double up to --time, with and without Open Image Denoise
    /// ('scripts/compare/setup.sh peers' installs them)
    #[arg(long = "with", value_enum, value_name = "LIST", value_delimiter = ',', help_heading = "Runs")]
    pub with: Vec<Renderer>,
    /// Stop each run after this many seconds of its own [default: 60, without --iterations]
    #[arg(long, value_name = "SECONDS|1h30m", seconds = 0.0, help_heading = "When to stop")]
    pub time: Option<f64>,
    /// Stop each run after this many iterations
    #[arg(long, value_name = "N", whole = 1_u64..=MAX_TERMS, help_heading = "When to stop")]
    pub iterations: Option<u64>,
    /// Factor between the iterations of two measurements, in (1, 10]
    #[arg(long, value_name = "RATIO", default_value_t = std::f64::consts::SQRT_2, between = (Excluded(1.0), Included(10.0)), help_heading = "Runs")]
    pub moments: f64,
    /// Seed; a reference rendered here has others
    #[arg(long, value_name = "S", default_value_t = 0, whole = 0..=u64::MAX, help_heading = "Runs")]
    pub seed: u64,
    /// Number of seeds; several give means and standard errors
    #[arg(long, value_name = "N", default_value_t = 1, whole = 1_u64..=1000, help_heading = "Runs")]
    pub seeds: u64,

    /// Error metric of curves, targets and exponents
    #[arg(long, value_enum, default_value_t, help_heading = "Error")]
    pub error_metric: Metric,
    /// Errors for the table of times to an error [default: some that two runs reach]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = positive, help_heading = "Error")]
    pub targets: Vec<f64>,
    /// Another target: the error of a run after N iterations, such as sppm@1000; may be repeated
    #[arg(long, value_name = "RUN@N", help_heading = "Error")]
    pub target_of: Vec<TargetOf>,
    /// Reference EXR [default: one is rendered to DIR/reference.exr]
    #[arg(long, value_name = "FILE.exr", help_heading = "Error")]
    pub reference: Option<PathBuf>,
    /// Error of the reference in the chosen metric, if its header does not state it: smaller errors are not reported
    #[arg(long, value_name = "E", value_parser = positive, requires = "reference", help_heading = "Error")]
    pub reference_error: Option<f64>,
    /// Method of a reference rendered here [default: bdpt; vcm if the scene has caustics seen through glass or in mirrors]
    #[arg(long, value_enum, value_name = "METHOD", conflicts_with = "reference", help_heading = "Error")]
    pub reference_method: Option<MethodChoice>,
    /// Seconds for a reference rendered here, both halves together [default: 8 times --time]
    #[arg(long, value_name = "SECONDS|1h30m", seconds = 0.0, conflicts_with = "reference", help_heading = "Error")]
    pub reference_time: Option<f64>,
    /// Iterations of each half of a reference rendered here [default: 16 times --iterations, without --time]
    #[arg(long, value_name = "N", whole = 2_u64..=MAX_TERMS, conflicts_with = "reference", help_heading = "Error")]
    pub reference_iterations: Option<u64>,

    /// Width and height of the pictures.
    #[command(flatten)]
    pub size: SizeOptions,
    /// Name of the camera [default: the scene's first]
    #[arg(long, value_name = "NAME", help_heading = "Picture")]
    pub camera: Option<String>,
    /// Longest light path in segments, camera to light, of all runs [default: no limit]
    #[arg(long, value_name = "N", whole = 1_u32..=1_000_000, help_heading = "Picture")]
    pub max_depth: Option<u32>,

    #[command(flatten)]
    pub scene: SceneOptions,

    /// A window of the picture to show side by side; may be repeated [default: two, where the runs differ most]
    #[arg(long, value_name = "X,Y,W,H", help_heading = "Page")]
    pub crop: Vec<CropChoice>,
    /// Exposure of the page's pictures in stops
    #[arg(long, value_name = "EV", default_value_t = 0.0, value_parser = finite, allow_negative_numbers = true, help_heading = "Page")]
    pub exposure: f64,
    /// Tone curve of the page's pictures
    #[arg(long, value_enum, default_value_t, help_heading = "Page")]
    pub tonemap: ToneMap,

    /// Threads; 0 takes all cores
    #[arg(long, value_name = "T", default_value_t = 0, value_parser = threads, help_heading = "Running")]
    pub threads: usize,
    /// Form of the reports on stderr
    #[arg(long, value_enum, default_value_t = Form::Auto, help_heading = "Running")]
    pub progress: Form,
}

impl ConvergeArgs {
    /// The camera and the size of the compared pictures.
    pub fn camera_request(&self) -> CameraRequest {
        CameraRequest {
            orbit: None,
            camera: self.camera.clone(),
            width: self.size.width,
            height: self.size.height,
            ..CameraRequest::default()
        }
    }
}

/// The value of `--target-of RUN@N`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TargetOf {
    /// Name of the run whose error is a target.
    pub run: String,
    /// Number of iterations of the run at which its error is the target.
    pub iterations: u64,
}

impl FromStr for TargetOf {
    type Err = String;
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts = text.rsplit_once('@').and_then(|(run, n)| Some((run.trim(), n.trim().parse().ok()?)));
        match parts {
            Some((run, iterations)) if iterations > 0 => Ok(TargetOf { run: run.into(), iterations }),
            _ => Err("it must be RUN@N, such as sppm@1000".into()),
        }
    }
}

/// The value of `--crop X,Y,W,H`, a window of the picture (pixels).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CropChoice(pub Window);

impl FromStr for CropChoice {
    type Err = String;
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let numbers: Option<Vec<usize>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[x, y, width, height]) if width > 0 && height > 0 => Ok(CropChoice(Window { x, y, width, height })),
            _ => Err("it must be X,Y,W,H in pixels, such as 120,40,64,64".into()),
        }
    }
}
