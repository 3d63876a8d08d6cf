//! `caustique render`: a scene in, an EXR and perhaps a PNG out.

mod claim;
mod files;
mod options;
mod preview;
mod sequence;
mod summary;
mod techniques;

pub use options::RenderArgs;

use super::finish::tell_missing;
use super::progress::{Reporter, Turn, Waiting};
use super::signals::Interrupt;
use super::{output, say, scene};
use caustique::choose::Choice;
use caustique::error::{Error, Result};
use caustique::film::LayerSet;
use caustique::image::exr;
use caustique::pipeline::plan::why;
use caustique::pipeline::{self, Auto, Delivery, Order, Wait, Watch, layers};
use caustique::plan::Plan;
use caustique::render::output::layer_shape_of;
use caustique::render::{Progress, Rendered, Settings};
use caustique::scene::description::PictureDefaults;
use caustique::scene::{Scene, Survey};
use caustique::stop::Stop;
use preview::Preview;
use serde_json::json;
use std::path::{Path, PathBuf};
pub use summary::{Summary, place, tell_finish, tell_picture, tell_unseen};

/// Renders a scene, or frames of it.
pub fn run(args: &RenderArgs) -> Result<()> {
    if !args.has_output() {
        let cause = "the following required arguments were not provided: --output <OUT.exr>";
        return Err(Error::usage(cause).hint("'--help' explains every option"));
    }
    super::pool(args.run.threads)?.install(|| match args.job.scene.frames {
        Some(frames) => sequence::run(args, frames),
        None => {
            sequence::refuse_patterns(args)?;
            one(args, None)
        }
    })
}

/// Renders one picture: everything that can be wrong is found before the first light path.
fn one(args: &RenderArgs, turn: Option<Turn>) -> Result<()> {
    let settings = args.settings()?;
    // What is in the scene is not known yet.
    let anything = Survey { environment: true, scattering: true, narrow_lobes: true, ..Survey::default() };
    let groups = layers::groups_named(&args.run.layers);
    layers::selection(&args.run.layers, &layer_shape_of(&settings, &anything, &groups), !args.job.no_combine)?;
    output::check_render(&args.output)?;
    args.picture.check()?;
    files::check_usd_layer(args)?;
    files::check_inputs(args)?;
    args.preview.as_ref().map_or(Ok(()), |target| target.check(&args.output))?;
    files::check_checkpoint(args)?;
    techniques::prepare(args)?;
    render(args, turn, settings)
}

fn render(args: &RenderArgs, turn: Option<Turn>, settings: Settings) -> Result<()> {
    let allowed = |candidate, size| args.job.candidate_settings(candidate, size);
    let auto = args.job.method.0.is_none().then(|| Auto { allowed: &allowed, finish: args.job.pilot_finish() });
    let order = Order {
        scene: args.job.scene.order(),
        camera: args.job.camera_request()?,
        settings,
        photons: args.job.photons,
        max_depth: args.job.max_depth,
        switches: args.job.scene.switches(),
        auto,
        finish: (!args.job.no_combine).then(|| args.job.finish.order()),
        layers: args.run.layers.clone(),
        naming: args.run.exr_naming,
        arguments: json!(args),
        reproducible: args.run.reproducible,
        memory: args.run.cap(),
        saving: args.saving(),
        resume: args.run.resume.clone(),
    };
    let mut told = Telling {
        args,
        turn,
        interrupt: None,
        waiting: None,
        reporter: None,
        preview: None,
        why: None,
        summary: None,
        seconds: 0.0,
        estimate: None,
        reason_if_black: String::new(),
        made_for: PictureDefaults::default(),
    };
    let delivery = pipeline::render(order, &mut told)?;
    told.deliver(delivery)
}

/// Tells people and programs how a render goes.
struct Telling<'a> {
    args: &'a RenderArgs,
    turn: Option<Turn>,
    interrupt: Option<Interrupt>,
    waiting: Option<Waiting>,
    reporter: Option<Reporter>,
    preview: Option<Preview<'a>>,
    /// Why auto has chosen what it has.
    why: Option<String>,
    summary: Option<Summary>,
    /// Seconds that the render has taken.
    seconds: f64,
    /// The file of the estimate, until the finished picture is written.
    estimate: Option<PathBuf>,
    /// Why the picture is black, should it be.
    reason_if_black: String,
    /// The picture that the scene was made for.
    made_for: PictureDefaults,
}

impl Watch for Telling<'_> {
    fn waits(&mut self, wait: Option<Wait>) {
        let what = wait.map(|wait| match wait {
            Wait::Reading => format!("reading {}", self.args.job.scene.path.display()),
            Wait::Choosing => "choosing a method".into(),
            Wait::Finishing => "finishing the picture".into(),
        });
        self.waiting = what.map(|what| Waiting::begin(self.args.progress, &what));
    }

    fn loaded(&mut self, scene: &Scene) -> Result<()> {
        scene::tell(&self.args.job.scene, &scene.warnings)?;
        self.made_for = scene.picture;
        self.interrupt = Some(Interrupt::listen()?);
        Ok(())
    }

    fn stop(&self) -> Stop {
        Interrupt::stop()
    }

    fn chosen(&mut self, choice: Option<&Choice>) -> Result<()> {
        self.why = choice.map(why);
        self.interrupt.as_ref().map_or(Ok(()), |interrupt| interrupt.before_the_first_iteration(&self.args.output))
    }

    fn finishes(&mut self, missing: Option<&Error>) {
        tell_missing(missing);
    }

    fn begins(&mut self, plan: &Plan, settings: &Settings) {
        if let Some(why) = self.why.take().filter(|_| self.args.progress.for_people()) {
            say(&format!("method: {why}"));
        }
        self.reporter = Some(Reporter::new(self.args.progress, settings, self.turn));
        let RenderArgs { output, preview, picture, .. } = self.args;
        self.preview = preview.as_ref().map(|target| Preview::new(target, output, picture, self.made_for));
        tell_plan(&self.args.job.scene.path, &plan.warnings);
        self.reason_if_black.clone_from(&plan.reason_if_black);
    }

    fn progress(&mut self, progress: &Progress) {
        if let Some(reporter) = &mut self.reporter {
            reporter.report(progress);
        }
    }

    fn looks(&mut self) -> bool {
        self.preview.as_mut().is_some_and(Preview::due)
    }

    fn picture(&mut self, picture: Result<LayerSet>, frame: &exr::Frame) {
        if let Some(preview) = &mut self.preview {
            preview.show(picture, Some(*frame));
        }
    }

    fn resumed(&mut self, iterations: u64) {
        if self.args.progress.for_people() {
            say(&format!("going on after {iterations} iterations"));
        }
    }

    fn unsaved(&mut self, error: &Error) {
        say(&format!("warning: the state of the render is not saved: {error}; the render goes on"));
    }

    fn rendered(&mut self, rendered: &Rendered) {
        if let Some(mut reporter) = self.reporter.take() {
            reporter.finish();
        }
        self.summary = Some(Summary::of(rendered));
        self.seconds = rendered.stats.time.seconds;
    }

    fn estimated(&mut self, set: &LayerSet, attributes: &exr::Attributes) {
        self.estimate = files::write_estimate(self.args, set, attributes, self.seconds);
    }
}

impl Telling<'_> {
    /// Writes all files, and says what there is to say.
    fn deliver(self, delivery: Delivery) -> Result<()> {
        let Telling { args, summary, preview, made_for, reason_if_black, estimate, .. } = self;
        let Delivery { set, attributes, techniques, tail, .. } = &delivery;
        let Some(summary) = summary else { return Ok(()) };
        let talk = args.progress.for_people();
        let written = files::write(args, set, attributes, tail.as_ref());
        let described = files::write_usd_layer(args, set);
        let pictured = args.picture.write_png(set, &made_for);
        let debugged = techniques::write(args, techniques, &made_for);
        if let Some(mut preview) = preview {
            preview.show(beauty(set), attributes.frame);
        }
        if talk {
            summary.tell();
            if let Some((name, _)) = &delivery.finished {
                tell_finish(name, &delivery, summary.told_of_finished());
            }
        }
        if !reason_if_black.is_empty() && set.beauty().is_ok_and(|pixels| pixels.iter().flatten().all(|x| *x == 0.0)) {
            say(&format!("warning: {}: the picture is black: {reason_if_black}", args.output.display()));
        }
        summary.tell_full();
        tell_unseen(&args.output, &delivery);
        summary.tell_rejected(&args.output, talk);
        written?;
        described?;
        pictured?;
        debugged?;
        // The picture is safe, and nobody misses a file that is not there.
        let spent = [delivery.spent_checkpoint.as_deref(), estimate.as_deref()];
        spent.into_iter().flatten().for_each(|file| drop(std::fs::remove_file(file)));
        if talk {
            Summary::tell_files(args, set, techniques.len());
        }
        if let Some(error) = delivery.refusal {
            let output = args.output.display();
            return Err(error.hint(format!(
                "the unfinished render is in {output}: 'caustique combine {output} -o OUT.exr' finishes it"
            )));
        }
        summary.interrupted(args)
    }
}

/// The picture alone.
fn beauty(set: &LayerSet) -> Result<LayerSet> {
    let mut alone = LayerSet::new(set.width, set.height);
    alone.layers.extend(set.get("").cloned());
    Ok(alone)
}

/// Prints what a plan warns of.
pub fn tell_plan(scene: &Path, warnings: &[String]) {
    for warning in warnings {
        say(&format!("warning: {}: {warning}", scene.display()));
    }
}
