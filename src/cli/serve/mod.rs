//! `caustique serve`: keeps a scene and renders it as often as another program asks. docs/server.md has the protocol.

mod command;
mod inbox;
mod outbox;

use super::render::{self, RenderArgs};
use super::{parse_render, signals};
use caustique::argument::threads;
use caustique::error::{Error, ErrorKind, Result};
use caustique::film::{LayerSet, Plane};
use caustique::options::{FinishOptions, SceneOptions};
use caustique::pipeline::edit::{Edit, EditableScene, check_file};
use caustique::pipeline::finish;
use caustique::pipeline::live::{LiveEnd, LiveRequest, Shown, render_live};
use caustique::pipeline::{OpenFinish, PictureRequest};
use caustique::render::output::stop_name;
use caustique::render::{Candidate, Clock, StopReason, peak_memory};
use command::{Command, Kind, View};
use inbox::Inbox;
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;

/// Keep a scene and render it as often as another program asks, by commands on standard input
///
/// Each line of standard input is a command, a JSON object; each line of standard output is an answer. The program ends when
/// its input ends. docs/server.md describes commands and answers.
#[derive(clap::Args)]
pub struct ServeArgs {
    /// Threads; 0 takes all cores
    #[arg(long, value_name = "T", default_value_t = 0, value_parser = threads, help_heading = "Running")]
    threads: usize,
}

/// Runs `caustique serve`.
pub fn run(args: &ServeArgs) -> Result<()> {
    super::pool(args.threads)?.install(serve)
}

fn serve() -> Result<()> {
    let ready = json!({
        "protocol": outbox::PROTOCOL, "version": env!("CARGO_PKG_VERSION"), "threads": rayon::current_num_threads(),
    });
    outbox::send("ready", &Value::Null, ready, &[])?;
    let inbox = Inbox::open()?;
    let mut server = Server { inbox, scene: None, finish: None, choice: None };
    while let Some(Command { id, kind }) = server.inbox.next() {
        if let Err(error) = server.obey(&id, kind) {
            if server.inbox.is_closed() {
                break;
            }
            outbox::error(&id, &error);
        }
    }
    Ok(())
}

/// A program that keeps a scene.
struct Server {
    inbox: Arc<Inbox>,
    scene: Option<KeptScene>,
    /// The open denoiser, with the options that it was opened for and the number of bandwidth levels.
    finish: Option<(FinishOptions, usize, OpenFinish)>,
    /// The candidate that `auto` has chosen for the present scene, with the options that it was chosen for.
    choice: Option<(Vec<String>, Candidate)>,
}

/// A scene with the options that it was read by.
struct KeptScene {
    scene: EditableScene,
    /// Words of the command line: the scene's path and the options.
    words: Vec<String>,
    options: Value,
}

impl Server {
    fn obey(&mut self, id: &Value, kind: Kind) -> Result<()> {
        match kind {
            Kind::Load { scene, arguments } => self.load(id, &scene, arguments),
            Kind::Edit(edits) => self.edit(id, &edits),
            Kind::View(view) => self.view(id, &view),
            Kind::Render { arguments } => self.render(id, &arguments),
            // The thread that reads has answered to them.
            Kind::Stop | Kind::Quit => Ok(()),
        }
    }

    fn load(&mut self, id: &Value, path: &Path, arguments: Vec<String>) -> Result<()> {
        let clock = Clock::start();
        let path = path.to_str().ok_or_else(|| Error::usage("the path of the scene is not UTF-8"))?;
        let words: Vec<String> = [vec![path.to_owned()], arguments].concat();
        let args = parse_render(&words)?;
        let options = &args.options.scene;
        let options = match options.frames {
            None => options.clone(),
            Some(frames) => options.at(frames.single().ok_or_else(|| one_frame(options))?),
        };
        check_file(&options.path)?;
        let mut request = options.request();
        // A later command may ask for motion vectors.
        request.options.motion_vectors = true;
        // The old scene makes room for the new one.
        (self.scene, self.choice) = (None, None);
        let scene = EditableScene::load(request, rayon::current_num_threads(), &self.inbox.stop())?;
        let built = &scene.loaded().scene;
        let cameras: Vec<&String> = built.cameras.iter().map(|camera| &camera.name).collect();
        let answer = json!({
            "seconds": clock.seconds(), "triangles": built.shapes.triangles(), "cameras": cameras, "warnings": built.warnings,
            "peak_memory": peak_memory(),
        });
        let options = json!(args.options.scene);
        self.scene = Some(KeptScene { scene, words, options });
        outbox::send("loaded", id, answer, &[])
    }

    fn edit(&mut self, id: &Value, edits: &[Edit]) -> Result<()> {
        let clock = Clock::start();
        let Some(kept) = &mut self.scene else { return Err(no_scene()) };
        let warnings = kept.scene.edit(edits, rayon::current_num_threads(), &self.inbox.stop())?;
        self.choice = None;
        let answer = json!({
            "seconds": clock.seconds(), "triangles": kept.scene.loaded().scene.shapes.triangles(), "warnings": warnings,
            "peak_memory": peak_memory(),
        });
        outbox::send("edited", id, answer, &[])
    }

    /// Sends the pictures of a view until it is done or another command arrives.
    fn view(&mut self, id: &Value, view: &View) -> Result<()> {
        let clock = Clock::start();
        let stop = self.inbox.stop();
        if stop.requested() {
            outbox::stopped(id, 0);
            return Ok(());
        }
        let Some(kept) = &self.scene else { return Err(no_scene()) };
        let sizes = [("--width", view.width), ("--height", view.height)];
        let sizes = sizes.into_iter().filter_map(|(option, side)| Some([option.to_owned(), side?.to_string()]));
        let words: Vec<String> = view.arguments.iter().cloned().chain(sizes.flatten()).collect();
        let args = kept.arguments(&words)?;
        let mut picture = args.options.picture_request()?;
        picture.camera.own.clone_from(&view.camera);
        open_finish(&mut self.finish, &args, &picture)?;
        let finish = self.finish.as_mut().filter(|_| !args.options.no_finish).map(|(.., finish)| finish);
        let denoiser = finish.as_ref().map(|finish| finish.name());
        let known = self.choice.as_ref().filter(|(options, _)| *options == view.arguments);
        let (path, memory) = (&kept.scene.request().path, args.run.memory_limit());
        let (candidate, coarse) = (known.map(|(_, candidate)| *candidate), view.coarse);
        let request = LiveRequest { picture, path, memory, candidate, coarse, stop };
        let mut failed = None;
        let mut show = |shown: Shown<'_>| {
            let Shown { set, progress, settings, is_coarse } = shown;
            let pixels = rgba(&set);
            let header = json!({
                "width": set.width, "height": set.height, "bytes": pixels.len(), "iteration": progress.iteration,
                "iterations": progress.iterations, "error": progress.error, "coarse": is_coarse,
                "method": settings.method, "denoiser": denoiser, "seconds": clock.seconds(),
            });
            failed = outbox::send("picture", id, header, &pixels).err();
            failed.is_none()
        };
        let end = render_live(request, kept.scene.loaded(), finish, &mut show);
        if let Some(error) = failed {
            return Err(error);
        }
        let LiveEnd { progress, reason, candidate } = end?;
        self.choice = candidate.map(|candidate| (view.arguments.clone(), candidate));
        let iterations = progress.map_or(0, |progress| progress.iteration);
        if reason == StopReason::Interrupted {
            outbox::stopped(id, iterations);
            return Ok(());
        }
        let answer = json!({
            "iterations": iterations, "reason": stop_name(reason), "seconds": clock.seconds(),
            "peak_memory": peak_memory(),
        });
        outbox::send("done", id, answer, &[])
    }

    /// Renders to a file, as `caustique render` does.
    fn render(&mut self, id: &Value, words: &[String]) -> Result<()> {
        let clock = Clock::start();
        let Some(kept) = &self.scene else { return Err(no_scene()) };
        let mut args = kept.arguments(words)?;
        if !args.has_output() || super::output::is_stdout(&args.output) {
            let error = Error::usage("a render needs the name of its file, which is not standard output");
            return Err(error.hint("name it with -o OUT.exr, or send the command view"));
        }
        if kept.scene.is_edited() {
            if args.run.checkpoint.is_some() || args.run.resume.is_some() {
                let error = Error::usage("an edited scene has no checkpoints: its file is another scene");
                return Err(error.hint("leave --checkpoint and --resume out"));
            }
            args.run.no_checkpoint = true;
        }
        let inbox = Arc::clone(&self.inbox);
        let stop = signals::Control { stop: inbox.stop(), abandons: Box::new(move || inbox.is_closed()) };
        let done = render::render_loaded(&args, kept.scene.loaded(), stop);
        let interrupted = match done {
            Err(error) if error.kind == ErrorKind::Interrupted => {
                outbox::stopped(id, 0);
                return Ok(());
            }
            done => done?,
        };
        let answer = json!({
            "output": super::events::path(&args.output), "interrupted": interrupted, "seconds": clock.seconds(),
            "peak_memory": peak_memory(),
        });
        outbox::send("done", id, answer, &[])
    }
}

impl KeptScene {
    /// The options of a picture of the scene: those that it was read by, and `words`.
    ///
    /// # Errors
    /// An option is wrong, or the scene would have to be read again.
    fn arguments(&self, words: &[String]) -> Result<RenderArgs> {
        let args = parse_render(&[&self.words, words].concat())?;
        if args.run.threads != 0 {
            return Err(Error::usage("--threads: the program has its threads already").hint("give them to 'serve'"));
        }
        if json!(args.options.scene) != self.options {
            let error = Error::usage("an option about reading the scene differs from those that it was loaded with");
            return Err(error.hint("give such options, as --env and --effects, to the command load"));
        }
        Ok(args)
    }
}

fn no_scene() -> Error {
    Error::usage("there is no scene").hint("send the command load first")
}

fn one_frame(options: &SceneOptions) -> Error {
    let first = options.frames.and_then(|frames| frames.iter().next()).unwrap_or(1);
    Error::usage("--frames: a scene is loaded at one frame").hint(format!("give one, such as --frames {first}"))
}

/// Opens the denoiser and the network that the options ask for, unless they are open.
fn open_finish(
    open: &mut Option<(FinishOptions, usize, OpenFinish)>,
    args: &RenderArgs,
    picture: &PictureRequest,
) -> Result<()> {
    let (options, levels) = (&args.options.finish, picture.settings.resolve()?.levels.count);
    let same = |of: &FinishOptions| of.denoise == options.denoise && of.model == options.model;
    // The number of levels matters to the network alone.
    let is_open =
        |(of, with, _): &(FinishOptions, usize, OpenFinish)| same(of) && (of.model.is_none() || *with == levels);
    if args.options.no_finish || open.as_ref().is_some_and(is_open) {
        return Ok(());
    }
    *open = Some((options.clone(), levels, finish::open(&options.request(), Some(levels))?));
    Ok(())
}

/// The picture as red, green, blue and alpha of each pixel, top row first, in little-endian floats.
fn rgba(set: &LayerSet) -> Vec<u8> {
    let beauty = set.get("");
    let planes = ["R", "G", "B", "A"].map(|name| beauty.and_then(|layer| layer.plane(name)));
    let value = |plane: Option<&Plane>, pixel: usize| plane.and_then(|plane| plane.values.get(pixel).copied());
    let pixels = (0..set.width * set.height).flat_map(|pixel| planes.map(|plane| value(plane, pixel).unwrap_or(1.0)));
    pixels.flat_map(f32::to_le_bytes).collect()
}
