//! Every option of `caustique render`: default, unit, range and help in one place. Those about what is rendered and how
//! are in [`super::job`].

use super::job::{Job, idle};
use super::preview::Target;
use crate::cli::frames::numbered;
use crate::cli::number::{positive, threads, whole};
use crate::cli::output::{Naming, PictureArgs};
use crate::cli::progress::Form;
use caustique::error::{Error, Kind, Result};
use caustique::pipeline::Saving;
use caustique::render::Settings;
use clap::builder::{OsStringValueParser, TypedValueParser};
use serde::Serialize;
use std::path::PathBuf;

/// Render a scene to a multichannel EXR, and to a PNG to look at.
///
/// Without options: 64 iterations at 1280 pixels across, seen through the scene's first camera, by the method that
/// suits the scene, denoised as far as its own errors allow. Ctrl-C gives up the running iteration and writes what
/// there is; a second one ends at once.
///
/// An option given twice: the last one holds. -h shows what a person needs first, --help everything.
#[derive(clap::Args, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
#[command(next_line_help = true)]
pub struct RenderArgs {
    /// EXR to write: the picture and every layer that made it; '-' writes to standard output. With --frames '####' in its
    /// name stands for the frame's number. Needed unless the RenderProduct of a stage of USD has a productName
    #[arg(short, long, value_name = "OUT.exr", help_heading = "Output")]
    #[arg(default_value = "", hide_default_value = true, value_parser = OsStringValueParser::new().map(PathBuf::from))]
    #[serde(skip)]
    pub output: PathBuf,

    #[command(flatten)]
    #[serde(flatten)]
    pub job: Job,

    /// Pass over frames whose output is there already, so that a run can go on and several machines share one
    #[arg(long, help_heading = "Running")]
    #[serde(skip)]
    pub skip_existing: bool,

    /// Layers of the EXR: 'all', 'comp' (the picture, its parts, albedo, normal, depth, cryptomattes; half floats where
    /// they serve), 'beauty', or names separated by commas
    #[arg(long, value_name = "all|comp|beauty|LIST", default_value = "all", help_heading = "Output")]
    pub layers: String,
    /// Names of the EXR's channels: 'blender' writes those that Blender's own renders have
    #[arg(long, value_enum, default_value_t = Naming::Plain, help_heading = "Output")]
    pub exr_naming: Naming,
    #[command(flatten)]
    #[serde(flatten)]
    pub picture: PictureArgs,
    /// Also write a layer of USD: a RenderProduct that points to the EXR, and a RenderVar for each of its layers
    #[arg(long, value_name = "OUT.usda", help_heading = "Output")]
    #[serde(skip)]
    pub usd_layer: Option<PathBuf>,

    /// Show the picture while it renders, denoised: a file that is rewritten every few seconds (.png: under --exposure
    /// and --tonemap; .exr: linear light and alpha), or 'tev', that viewer on this machine
    #[arg(long, value_name = "FILE.png|FILE.exr|tev", help_heading = "Running")]
    #[serde(skip)]
    pub preview: Option<Target>,
    /// Save the state of the render every few minutes, so that --resume can go on; kept at the end, to extend the render
    /// [default: beside the output, and removed at the end]
    #[arg(long, value_name = "FILE", help_heading = "Running", conflicts_with = "no_checkpoint")]
    #[serde(skip)]
    pub checkpoint: Option<PathBuf>,
    /// Seconds between two saves
    #[arg(long, value_name = "SECONDS", default_value_t = 300.0, value_parser = positive, help_heading = "Running")]
    #[serde(skip)]
    pub checkpoint_every: f64,
    /// Save nothing
    #[arg(long, help_heading = "Running")]
    #[serde(skip)]
    pub no_checkpoint: bool,
    /// Start anew although the checkpoint of a render that was stopped is there, and replace it
    #[arg(long, help_heading = "Running")]
    #[serde(skip)]
    pub overwrite: bool,
    /// Go on from a checkpoint: the same options, and more --iterations or --time (both count from the start)
    #[arg(long, value_name = "FILE", help_heading = "Running")]
    #[serde(skip)]
    pub resume: Option<PathBuf>,
    /// Threads; 0 takes all cores. The picture does not depend on it
    #[arg(long, value_name = "T", default_value_t = 0, value_parser = threads, help_heading = "Running")]
    #[serde(skip)]
    pub threads: usize,
    /// Also write a picture per sampling technique, weighted and unweighted, as EXR and PNG: how path, light, bdpt, bpm
    /// or vcm share the light among their strategies. Weighted pictures sum to the layer Noisy
    #[arg(long, value_name = "DIR", help_heading = "Expert")]
    #[serde(skip)]
    pub debug_techniques: Option<PathBuf>,
    /// The most that photons, pixels and layers may take, in MiB, beside the scene itself. Where they need more, the light
    /// paths of an iteration become fewer (with pm: the room of its map), and a warning says how many; what cannot fit is
    /// refused [default: what the machine and its limits leave, and nothing becomes fewer]
    #[arg(long, value_name = "MIB", value_parser = whole(1..=u32::MAX), help_heading = "Running")]
    pub memory: Option<u32>,
    /// Leave clocks and the thread count out of the EXR's header, so that equal renders are equal files
    #[arg(long, help_heading = "Running")]
    #[serde(skip)]
    pub reproducible: bool,
    /// Reports on stderr
    #[arg(long, value_enum, default_value_t = Form::Auto, help_heading = "Running")]
    #[serde(skip)]
    pub progress: Form,
}

impl RenderArgs {
    /// The render asked for.
    ///
    /// # Errors
    /// Options that contradict each other.
    pub fn settings(&self) -> Result<Settings> {
        let settings = self.job.settings()?;
        if self.debug_techniques.is_some() && !settings.method.has_techniques() {
            return Err(idle("--debug-techniques", settings.method.name(), "vcm"));
        }
        if self.debug_techniques.is_some() && (self.checkpoint.is_some() || self.resume.is_some()) {
            let cause = "pictures per technique are not part of a checkpoint";
            return Err(Error::new(Kind::Usage, "command line", cause).hint("leave --debug-techniques out"));
        }
        Ok(Settings { techniques: self.debug_techniques.is_some(), ..settings })
    }

    /// Whether there is a name for the EXR: the command line's, or the stage's.
    pub fn has_output(&self) -> bool {
        !self.output.as_os_str().is_empty()
    }

    /// The same for one frame alone, its number in the names of files.
    pub fn at(&self, frame: u32) -> RenderArgs {
        let named = |path: &PathBuf| numbered(path, frame).unwrap_or_else(|| path.clone());
        RenderArgs {
            output: named(&self.output),
            job: Job { scene: self.job.scene.at(frame), ..self.job.clone() },
            picture: PictureArgs { png: self.picture.png.as_ref().map(named), ..self.picture.clone() },
            usd_layer: self.usd_layer.as_ref().map(named),
            checkpoint: self.checkpoint.as_ref().map(named),
            resume: self.resume.as_ref().map(named),
            debug_techniques: self.debug_techniques.as_ref().map(named),
            ..self.clone()
        }
    }

    /// Files that are written or read for each frame, with their options.
    pub fn files(&self) -> impl Iterator<Item = (&'static str, &PathBuf)> {
        let files = [
            ("--output", Some(&self.output)),
            ("--png", self.picture.png.as_ref()),
            ("--usd-layer", self.usd_layer.as_ref()),
            ("--checkpoint", self.checkpoint.as_ref()),
            ("--resume", self.resume.as_ref()),
            ("--debug-techniques", self.debug_techniques.as_ref()),
        ];
        files.into_iter().filter_map(|(option, path)| Some((option, path?)))
    }

    /// Where the state is saved, if at all.
    pub fn saving(&self) -> Option<Saving> {
        let beside = || {
            let name = self.output.file_name().filter(|_| self.output.extension().is_some())?;
            let mut name = name.to_owned();
            name.push(".checkpoint");
            Some(self.output.with_file_name(name))
        };
        // Pictures per technique are no part of the state.
        let saved = !self.no_checkpoint && self.debug_techniques.is_none();
        let path = saved.then(|| self.checkpoint.clone().or_else(beside)).flatten()?;
        Some(Saving { path, every: self.checkpoint_every, keep: self.checkpoint.is_some() })
    }
}
