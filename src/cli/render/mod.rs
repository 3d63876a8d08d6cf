//! `caustique render`: renders a scene to an EXR, and to a PNG if the user asks for one.

mod files;
mod options;
mod preview;
mod sequence;
mod summary;
mod techniques;

pub use options::RenderArgs;

use super::finish_options::warn_missing_denoiser;
use super::progress::{FrameOfRun, Reporter, Waiting};
use super::signals::{Control, Interrupt};
use super::warnings::lines;
use super::{events, output, say, scene};
use caustique::error::{Error, ErrorKind, Result};
use caustique::film::LayerSet;
use caustique::image::Outputs;
use caustique::image::atomic::Draft;
use caustique::options::SceneOptions;
use caustique::pipeline::plan::reason;
use caustique::pipeline::{self, Delivery, Event, Loaded, Observer, Phase, Request};
use caustique::plan::Plan;
use caustique::render::Settings;
use caustique::scene::Scene;
use caustique::scene::description::PictureDefaults;
use caustique::stop::Stop;
use preview::{Preview, Target};
use serde_json::json;
pub use summary::{Summary, place, print_finish, print_picture, warn_unseen};

/// Renders a scene, or frames of its animation, as `caustique render`.
pub fn run(args: &RenderArgs) -> Result<()> {
    let mut args = args.with_outputs();
    super::pool(args.run.threads)?.install(|| match args.options.scene.frames {
        Some(frames) => sequence::run(&args, frames),
        None => {
            sequence::refuse_patterns(&args)?;
            args.run.resume = args.run.resume.take().or_else(|| sequence::left(&args));
            if args.skip_existing && args.run.resume.is_none() && sequence::is_there(&args) {
                pass_over(&args, None, "is there");
                return Ok(());
            }
            render_one(&args, &files::outputs(&args)?, None)
        }
    })
}

/// Says that the output of a picture, of a scene or of a frame, stays as it is, and why.
fn pass_over(args: &RenderArgs, frame: Option<u32>, why: &str) {
    if args.progress.for_people() {
        let frame = frame.map_or(String::new(), |frame| format!("frame {frame}: "));
        say(&format!("{frame}{} {why}", args.output.display()));
    }
    let output = events::path(&args.output);
    events::print("skipped", json!({"frame": frame, "output": output, "message": why}));
}

/// Renders one picture, of a scene or of a frame. Everything that can be wrong is found before the first light path.
fn render_one(args: &RenderArgs, outputs: &Outputs, turn: Option<FrameOfRun>) -> Result<()> {
    let request = check(args)?;
    let mut reports = Reports::new(args, outputs, turn);
    let delivery = pipeline::render(request, &mut reports).map_err(|error| reports.explain(error))?;
    reports.deliver(delivery)?.map_or(Ok(()), |summary| summary.check_interrupted(args))
}

/// Renders one picture of a scene that has been loaded, as another program asks. Returns whether it has fewer iterations
/// than it was to have, because `control` has stopped them.
///
/// # Errors
/// Errors of [`run`]; an output is a pipe or a device, for which the other program would have to wait.
pub fn render_loaded(args: &RenderArgs, loaded: &Loaded, control: Control) -> Result<bool> {
    let outputs = files::outputs(args)?;
    outputs.check_regular()?;
    let request = check(args)?;
    let mut reports = Reports { control: Some(control), ..Reports::new(args, &outputs, None) };
    let delivery = pipeline::render_loaded(request, loaded, &mut reports)?;
    Ok(reports.deliver(delivery)?.is_some_and(|summary| summary.is_interrupted()))
}

/// Checks the options of a render and its files. Returns the request for the pipeline.
fn check(args: &RenderArgs) -> Result<Request> {
    let picture = args.picture_request()?;
    let layers = args.selection()?;
    output::check_render(&args.output)?;
    args.picture.check()?;
    files::check_defaults(args)?;
    files::check_usd_layer(args)?;
    args.preview.as_ref().map_or(Ok(()), Target::check)?;
    files::check_checkpoint(args)?;
    techniques::prepare(args)?;
    Ok(Request {
        scene: args.options.scene.request(),
        picture,
        finish: (!args.options.no_finish).then(|| args.options.finish.request()),
        layers,
        naming: args.run.exr_naming,
        arguments: json!(args),
        reproducible: args.run.reproducible,
        memory: args.run.memory_limit(),
        saving: args.saving(),
        resume: args.run.resume.clone(),
    })
}

/// Reports the progress of a render to people and programs, and writes its files.
struct Reports<'a> {
    args: &'a RenderArgs,
    /// The files that the command writes, of all its frames.
    outputs: &'a Outputs,
    turn: Option<FrameOfRun>,
    interrupt: Option<Interrupt>,
    /// How another program stops the render; `None`: signals do.
    control: Option<Control>,
    waiting: Option<Waiting>,
    reporter: Option<Reporter>,
    preview: Option<Preview<'a>>,
    /// The reason for which `auto` has chosen the method, for the summary.
    reason: Option<String>,
    summary: Option<Summary>,
    /// Seconds that the render has taken.
    seconds: f64,
    /// The unfinished picture, which is kept until the finished picture is written.
    estimate: Option<Draft>,
    /// Explanation to print if the picture turns out black.
    reason_if_black: String,
    /// Frame, exposure and tone curve that the scene asks for.
    made_for: PictureDefaults,
}

impl Observer for Reports<'_> {
    fn accept(&mut self, scene: &Scene) -> Result<()> {
        files::check_inputs(self.args, self.outputs, scene)?;
        self.announce_default_names();
        scene::print_warnings(&self.args.options.scene, &scene.warnings)?;
        self.made_for = scene.picture;
        self.interrupt = if self.control.is_none() { Some(Interrupt::install()?) } else { None };
        Ok(())
    }

    fn event(&mut self, event: Event<'_>) {
        match event {
            Event::PhaseBegins(phase) => self.waiting = Some(Waiting::begin(self.args.progress, &self.describe(phase))),
            Event::PhaseEnds => self.waiting = None,
            Event::Chosen(choice) => self.reason = choice.map(reason),
            Event::FinishOpened { missing } => warn_missing_denoiser(missing),
            Event::Begins { plan, settings } => self.begins(plan, settings),
            Event::Resumed(iterations) if self.args.progress.for_people() => {
                say(&format!("going on after {iterations} iterations"));
            }
            Event::Resumed(_) => {}
            Event::Progress(progress) => {
                self.reporter.as_mut().into_iter().for_each(|reporter| reporter.report(progress));
            }
            Event::Preview { picture, frame } => {
                self.preview.as_mut().into_iter().for_each(|preview| preview.show(picture.clone(), Some(*frame)));
            }
            Event::SaveFailed(error) => {
                say(&format!("warning: the state of the render is not saved: {error}; the render goes on"));
            }
            Event::MomentFailed(error) => {
                say(&format!("warning: {error}; the render ends here, with the iterations so far"));
            }
            Event::Warning(warning) => say(&format!("warning: {warning}")),
            Event::Rendered(rendered) => {
                self.reporter.take().into_iter().for_each(|mut reporter| reporter.finish());
                self.summary = Some(Summary::of(rendered));
                self.seconds = rendered.stats.time.seconds;
            }
            Event::Estimated { set, attributes } => {
                self.estimate = files::write_estimate(self.args, set, attributes, self.seconds);
            }
        }
    }

    fn stop(&self) -> Stop {
        self.control.as_ref().map_or_else(Interrupt::stop, |control| control.stop.clone())
    }

    fn abandons(&self) -> bool {
        self.control.as_ref().is_some_and(|control| (control.abandons)())
    }

    fn wants_preview(&mut self) -> bool {
        self.preview.as_mut().is_some_and(Preview::due)
    }
}

impl<'a> Reports<'a> {
    fn new(args: &'a RenderArgs, outputs: &'a Outputs, turn: Option<FrameOfRun>) -> Reports<'a> {
        Reports {
            args,
            outputs,
            turn,
            interrupt: None,
            control: None,
            waiting: None,
            reporter: None,
            preview: None,
            reason: None,
            summary: None,
            seconds: 0.0,
            estimate: None,
            reason_if_black: String::new(),
            made_for: PictureDefaults::default(),
        }
    }

    /// Tells people once which files are written if they name none, after all that could be wrong with the scene.
    fn announce_default_names(&self) {
        let is_first = self.turn.is_none_or(|turn| turn.before == 0);
        if let (Some(png), true) = (&self.args.picture.png, self.args.names_are_default && is_first)
            && self.args.progress.for_people()
        {
            say(&format!("no --output: writing {} and {}", self.args.output.display(), png.display()));
        }
    }

    /// Describes a long part of the render to people who wait.
    fn describe(&self, phase: Phase) -> String {
        match phase {
            Phase::Reading => format!("reading {}", self.args.options.scene.path.display()),
            Phase::Choosing => "choosing a method".into(),
            Phase::Finishing => "finishing the picture".into(),
        }
    }

    /// The number of the frame, if the command renders frames.
    fn frame(&self) -> Option<u32> {
        self.turn.map(|turn| turn.frame)
    }

    fn begins(&mut self, plan: &Plan, settings: &Settings) {
        if let Some(reason) = self.reason.take().filter(|_| self.args.progress.for_people()) {
            say(&format!("method: {reason}"));
        }
        events::print(
            "start",
            json!({
                "scene": events::path(&self.args.options.scene.path), "output": events::path(&self.args.output),
                "frame": self.frame(),
                "method": settings.method, "iterations": settings.iterations, "seconds": self.args.options.settings.time,
                "target_error": settings.target_error,
            }),
        );
        self.reporter = Some(Reporter::new(self.args.progress, settings, self.turn));
        let RenderArgs { output, preview, picture, .. } = self.args;
        self.preview = preview.as_ref().map(|target| Preview::new(target, output, picture, self.made_for));
        print_plan_warnings(&self.args.options.scene, &plan.warnings);
        self.reason_if_black.clone_from(&plan.reason_if_black);
    }

    /// Replaces the error of a render that a signal has stopped before its first iteration by one that says so.
    fn explain(&self, error: Error) -> Error {
        let interrupt = self.interrupt.as_ref().filter(|_| error.kind == ErrorKind::Interrupted);
        interrupt.and_then(|interrupt| interrupt.check_before_first_iteration(&self.args.output).err()).unwrap_or(error)
    }

    /// Writes all files of a render, and reports how it ended.
    fn deliver(self, delivery: Delivery) -> Result<Option<Summary>> {
        let frame = self.frame();
        let Reports { args, summary, preview, made_for, reason_if_black, estimate, .. } = self;
        let Delivery { set, attributes, techniques, sums, .. } = &delivery;
        let Some(summary) = summary else { return Ok(None) };
        let talk = args.progress.for_people();
        // The EXR comes last: where it exists, the frame is done.
        let others = args.picture.write_png(set, &made_for).and(techniques::write(args, techniques, &made_for));
        let others = files::write_usd_layer(args, set).and(others);
        let written = files::write(args, set, attributes, sums.as_ref());
        if let Some(mut preview) = preview {
            preview.show(beauty(set), attributes.frame);
        }
        print_end(args, &summary, &delivery, &reason_if_black);
        written?;
        // The estimate is in the EXR; the checkpoint can make the other pictures again.
        estimate.into_iter().for_each(Draft::remove);
        others?;
        // A file that is already gone is no error.
        delivery.obsolete_checkpoint.iter().for_each(|file| drop(std::fs::remove_file(file)));
        files::remove_leftovers(args);
        if talk {
            Summary::print_files(args, set, techniques.len());
        }
        summary.print_events(args, &delivery, frame);
        if let Some(error) = delivery.finish_error {
            let output = args.output.display();
            return Err(error.hint(format!(
                "the unfinished render is in {output}: 'caustique finish {output} -o OUT.exr' finishes it"
            )));
        }
        Ok(Some(summary))
    }
}

/// Prints time, error and warnings of a render that has ended.
fn print_end(args: &RenderArgs, summary: &Summary, delivery: &Delivery, reason_if_black: &str) {
    let talk = args.progress.for_people();
    if talk {
        summary.print();
        if let Some(name) = &delivery.finished_by {
            print_finish(name, delivery, summary.coverage_of_finished());
        }
    }
    let is_black = || delivery.set.beauty().is_ok_and(|pixels| pixels.iter().flatten().all(|x| *x == 0.0));
    if !reason_if_black.is_empty() && is_black() {
        say(&format!("warning: {}: the picture is black: {reason_if_black}", args.output.display()));
    }
    summary.warn_full_map();
    warn_unseen(&args.output, delivery);
    summary.print_rejected(&args.output, talk);
}

/// The beauty layer of a picture without the other layers.
fn beauty(set: &LayerSet) -> Result<LayerSet> {
    let mut alone = LayerSet::new(set.width, set.height);
    alone.layers.extend(set.get("").cloned());
    Ok(alone)
}

/// Prints the warnings of a render's plan.
pub fn print_plan_warnings(scene: &SceneOptions, warnings: &[String]) {
    for warning in lines(warnings, scene.verbose) {
        say(&format!("warning: {}: {warning}", scene.path.display()));
    }
}
