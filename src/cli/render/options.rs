//! The options of `caustique render`: the library's ([`caustique::options`]), and files that only the program writes.

use super::preview::Target;
use crate::cli::output::PictureArgs;
use crate::cli::progress::Form;
use caustique::argument::Elsewhere;
use caustique::error::{Error, Result};
use caustique::film::Selection;
use caustique::options::{RenderOptions, RunOptions, is_pattern, path_of_frame};
use caustique::pipeline::{PictureRequest, Saving};
use clap::builder::{OsStringValueParser, TypedValueParser};
use serde::Serialize;
use std::path::PathBuf;

/// Render a scene to a multichannel EXR, and to a PNG to look at.
///
/// Without options: 64 iterations, 1280 pixels wide, through the scene's first camera, by a method that suits the scene,
/// denoised as far as the estimated error allows. Ctrl-C discards the running iteration and writes the picture so far;
/// a second Ctrl-C ends the program at once.
///
/// If an option is given twice, the last one counts. -h shows the options that you need first, --help all.
#[derive(clap::Args, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
#[command(next_line_help = true)]
pub struct RenderArgs {
    /// EXR to write: the picture and its layers; '-' is standard output
    ///
    /// With --frames, '####' in its name stands for the number of the frame. Default: the productName of a USD stage's
    /// RenderProduct, else an EXR and a PNG beside the scene, with its name
    #[arg(short, long, value_name = "OUT.exr", help_heading = "Output")]
    #[arg(default_value = "", hide_default_value = true, value_parser = OsStringValueParser::new().map(PathBuf::from))]
    #[serde(skip)]
    #[arg(not_in_python = "the picture is an Image: its method save writes it")]
    pub output: PathBuf,

    #[command(flatten)]
    #[serde(flatten)]
    pub options: RenderOptions,

    /// Skip frames whose output exists, so that a run can continue and several machines can share one
    #[arg(long, help_heading = "Running")]
    #[serde(skip)]
    #[arg(hide_short_help = true)]
    #[arg(not_in_python = "a Scene is one frame")]
    pub skip_existing: bool,

    /// After the last frame, finish the frames again, each with up to two neighbours on each side: they flicker less
    ///
    /// The files then also have the layers that this needs, such as Motion, Noisy, Variance1 and Quarter1, whatever
    /// --layers says. Frames of one seed cannot be averaged
    #[arg(long, requires = "frames", conflicts_with = "no_finish", help_heading = "Finish")]
    #[serde(skip)]
    #[arg(hide_short_help = true)]
    #[arg(not_in_python = "a Scene is one frame", in_stages = false)]
    pub temporal: bool,

    #[command(flatten)]
    #[serde(flatten)]
    pub run: RunOptions,
    #[command(flatten)]
    #[serde(flatten)]
    pub picture: PictureArgs,
    /// Also write a layer of USD: a RenderProduct that points to the EXR, and a RenderVar for each of its layers
    #[arg(long, value_name = "OUT.usda", help_heading = "Output")]
    #[serde(skip)]
    #[arg(hide_short_help = true)]
    #[arg(not_in_python = "a file beside the EXR")]
    pub usd_layer: Option<PathBuf>,

    /// Show the picture while it renders: in a file that is rewritten every few seconds, or in the viewer 'tev'
    ///
    /// The preview is denoised. A .png has --exposure and --tonemap; an .exr has linear light and alpha. tev runs on
    /// this machine
    #[arg(long, value_name = "FILE.png|FILE.exr|tev", help_heading = "Running")]
    #[serde(skip)]
    #[arg(not_in_python = "the callback progress shows how a render goes")]
    pub preview: Option<Target>,
    /// Also write a picture per sampling technique, weighted and unweighted, as EXR and PNG
    ///
    /// Shows how path, light, bdpt, bpm or vcm share the light among their techniques. Weighted pictures sum to the
    /// layer Noisy
    #[arg(long, value_name = "DIR", help_heading = "Expert")]
    #[serde(skip)]
    #[arg(not_in_python = "files beside the EXR")]
    pub debug_techniques: Option<PathBuf>,
    /// Form of the reports on stderr
    #[arg(long, value_enum, default_value_t = Form::Auto, help_heading = "Running")]
    #[serde(skip)]
    #[arg(not_in_python = "its progress is a callback")]
    pub progress: Form,
    /// Whether the outputs have their default names, which a message then gives.
    #[arg(skip)]
    #[serde(skip)]
    pub names_are_default: bool,
}

impl RenderArgs {
    /// The picture and its method as the pipeline, which renders it, wants them.
    ///
    /// # Errors
    /// Options contradict each other.
    pub fn picture_request(&self) -> Result<PictureRequest> {
        let mut request = self.options.picture_request()?;
        request.settings.threads = self.run.threads;
        if self.debug_techniques.is_none() {
            return Ok(request);
        }
        request.settings.techniques = true;
        request.settings.resolve()?;
        if self.run.checkpoint.is_some() || self.run.resume.is_some() {
            let error = Error::usage("pictures per technique are not part of a checkpoint");
            return Err(error.hint("leave --debug-techniques out"));
        }
        Ok(request)
    }

    /// The layers to write: those of `--layers`, and those that the temporal finish needs.
    ///
    /// # Errors
    /// No layer has such a name.
    pub fn selection(&self) -> Result<Selection> {
        let chosen = self.run.selection()?;
        Ok(if self.temporal { Selection::Temporal(Box::new(chosen)) } else { chosen })
    }

    /// Whether the command line or the USD stage names the EXR.
    pub fn has_output(&self) -> bool {
        !self.output.as_os_str().is_empty()
    }

    /// These options, with the default outputs if no output is named: an EXR and a PNG beside the scene.
    pub fn with_outputs(&self) -> RenderArgs {
        let mut args = self.clone();
        if !self.has_output() {
            let scene = &self.options.scene;
            let number = if scene.frames.is_some() && !is_pattern(&scene.path) { "####." } else { "" };
            let beside = |kind| scene.path.with_extension(format!("{number}{kind}"));
            args.output = beside("exr");
            args.picture.png.get_or_insert_with(|| beside("png"));
            args.names_are_default = true;
        }
        args
    }

    /// The options for one frame, with its number in the names of files.
    pub fn at(&self, frame: u32) -> RenderArgs {
        let named = |path: &PathBuf| path_of_frame(path, frame).unwrap_or_else(|| path.clone());
        RenderArgs {
            output: named(&self.output),
            options: RenderOptions { scene: self.options.scene.at(frame), ..self.options.clone() },
            picture: PictureArgs { png: self.picture.png.as_ref().map(named), ..self.picture.clone() },
            usd_layer: self.usd_layer.as_ref().map(named),
            run: RunOptions {
                checkpoint: self.run.checkpoint.as_ref().map(named),
                resume: self.run.resume.as_ref().map(named),
                ..self.run.clone()
            },
            debug_techniques: self.debug_techniques.as_ref().map(named),
            ..self.clone()
        }
    }

    /// Options and paths of the files that each frame writes or reads.
    pub fn files(&self) -> impl Iterator<Item = (&'static str, &PathBuf)> {
        let files = [
            ("--output", Some(&self.output)),
            ("--png", self.picture.png.as_ref()),
            ("--usd-layer", self.usd_layer.as_ref()),
            ("--checkpoint", self.run.checkpoint.as_ref()),
            ("--resume", self.run.resume.as_ref()),
            ("--debug-techniques", self.debug_techniques.as_ref()),
        ];
        files.into_iter().filter_map(|(option, path)| Some((option, path?)))
    }

    /// Where and how often the checkpoint of the render is saved; `None`: nowhere.
    pub fn saving(&self) -> Option<Saving> {
        // Checkpoints do not hold pictures per technique.
        if self.debug_techniques.is_some() { None } else { self.run.saving(Some(&self.output)) }
    }
}
