//! A render from beginning to end: load -> plan -> choose -> render -> finish -> deliver. Each step takes what the one
//! before gave, plain data in and out. What asks for a render (the command line, a host program) fills an [`Order`],
//! looks on through a [`Watch`] and gets a [`Delivery`]; none of it parses, prints, or knows of files other than those
//! that are read.

pub mod check;
pub mod checkpoint;
mod deliver;
mod facts;
pub mod finish;
mod hurry;
mod judge;
pub mod layers;
pub mod load;
pub mod memory;
pub mod merge;
mod outlook;
pub mod plan;
pub mod records;
mod saver;
pub mod seeds;
pub mod shard;
mod worst;

pub use checkpoint::Saving;
pub use deliver::{Delivery, FINISHED_PICTURE, Reached, tell_stored};
pub use facts::Facts;
pub use finish::Ready;
pub use load::Loaded;
pub use outlook::{Outlook, outlook};
pub use worst::{Place, Tile, Worst};

use checkpoint::Head;
use deliver::{Writing, deliver};
use saver::Saver;
use shard::Tail;

use crate::choose::{self, Choice};
use crate::error::{Error, ErrorKind, Result};
use crate::film::{LayerSet, Naming, Selection, finished_part, output as film};
use crate::finish::{Finish, reads_for_picture};
use crate::image::atomic::is_same_file;
use crate::image::exr;
use crate::plan::{Plan, Switches};
use crate::render::output::layer_shape;
use crate::render::{
    Candidate, Control, Progress, RenderInput, Rendered, Session, Settings, StopReason, TimeSpent, drive,
};
use crate::scene::{CameraRequest, Scene, View};
use crate::stop::Stop;
use serde_json::{Map, Value, json};
use std::path::PathBuf;

/// Settings of a way that auto may choose, for a picture of a size; `None` where other wishes rule it out.
pub type Allowed<'a> = &'a dyn Fn(Candidate, (u32, u32)) -> Option<Settings>;

/// What auto is to choose from, and what its pilots are finished with.
pub struct Auto<'a> {
    /// The ways.
    pub allowed: Allowed<'a>,
    /// The finish.
    pub finish: Finish,
}

/// A render that is asked for.
pub struct Order<'a> {
    /// The scene, and how it is read.
    pub scene: load::Order,
    /// Camera and size.
    pub camera: CameraRequest,
    /// How light is found, and when to stop. With `auto` what its options come to for [`Candidate::GATHERING`].
    pub settings: Settings,
    /// Light paths of an iteration; `None`: what is usual.
    pub photons: Option<u32>,
    /// Longest light path in segments, if one was asked for.
    pub max_depth: Option<u32>,
    /// Effects that are switched.
    pub switches: Switches,
    /// The method is left to us.
    pub auto: Option<Auto<'a>>,
    /// How the estimate becomes the picture; `None`: not at all.
    pub finish: Option<finish::Order>,
    /// Layers that are wanted: `all`, `beauty`, or names separated by commas.
    pub layers: String,
    /// Names of channels, which the attributes of cryptomattes repeat.
    pub naming: Naming,
    /// What was asked for, for the header.
    pub arguments: Value,
    /// Leave clocks and the number of threads out of the header.
    pub reproducible: bool,
    /// The most that photons and pixels may take.
    pub memory: Option<memory::Cap>,
    /// Where the state is saved while it renders, if at all.
    pub saving: Option<Saving>,
    /// A checkpoint from which it goes on.
    pub resume: Option<PathBuf>,
}

/// What may take long without telling how far it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wait {
    /// The scene is read and built.
    Reading,
    /// The method is chosen.
    Choosing,
    /// The picture is finished.
    Finishing,
}

/// Who looks on while a render goes on.
pub trait Watch {
    /// Something begins that may take long; `None`: it is over.
    fn waits(&mut self, wait: Option<Wait>);
    /// The scene is there. An error ends the render.
    ///
    /// # Errors
    /// What is looked at will not do.
    fn loaded(&mut self, scene: &Scene) -> Result<()>;
    /// What asks for an end, also in the midst of an iteration.
    fn stop(&self) -> Stop;
    /// An end is asked for.
    fn stops(&self) -> bool {
        self.stop().requested()
    }
    /// It is decided how to render. An error ends the render before its first iteration.
    ///
    /// # Errors
    /// An end was asked for.
    fn chosen(&mut self, choice: Option<&Choice>) -> Result<()>;
    /// The finish is ready; where its library is missing and another takes its place, the error says how to get it.
    fn finishes(&mut self, missing: Option<&Error>);
    /// The render begins.
    fn begins(&mut self, plan: &Plan, settings: &Settings);
    /// An iteration is done.
    fn progress(&mut self, progress: &Progress);
    /// Whether the picture as it is now is to be shown.
    fn looks(&mut self) -> bool {
        false
    }
    /// The picture as it is: the beauty alone (radiance), or why there is none; and where it is in the whole one. The
    /// render goes on either way.
    fn picture(&mut self, picture: Result<LayerSet>, frame: &exr::Frame) {
        let _ = (picture, frame);
    }
    /// It goes on after so many iterations, of a checkpoint.
    fn resumed(&mut self, iterations: u64) {
        let _ = iterations;
    }
    /// The state could not be saved; the render goes on.
    fn unsaved(&mut self, error: &Error) {
        let _ = error;
    }
    /// All are; the pixels are still there.
    fn rendered(&mut self, rendered: &Rendered);
    /// The finish begins: the estimate with all that the finish reads. A file of it is what is left if the process is
    /// ended meanwhile.
    fn estimated(&mut self, set: &LayerSet, attributes: &exr::Attributes) {
        let _ = (set, attributes);
    }
}

/// Renders. All that can be wrong is found before the first light path, but for a finish that fails, which loses no
/// picture ([`Delivery::refusal`]).
///
/// # Errors
/// The scene, options that contradict it, memory, or an end that was asked for before the first iteration.
pub fn render(order: Order<'_>, watch: &mut dyn Watch) -> Result<Delivery> {
    watch.waits(Some(Wait::Reading));
    let loaded = load::load(&order.scene, rayon::current_num_threads(), &watch.stop())?;
    watch.waits(None);
    render_loaded(order, &loaded, watch)
}

/// Like [`render`], of a scene that has been loaded as the order says, and that can be rendered again.
///
/// # Errors
/// Those of [`render`].
pub fn render_loaded(mut order: Order<'_>, loaded: &Loaded, watch: &mut dyn Watch) -> Result<Delivery> {
    let Loaded { scene, removed } = loaded;
    let auto = order.auto.take();
    watch.loaded(scene)?;
    let camera = scene.camera(&order.camera)?;
    let view = View::new(scene, &camera);
    let (settings, selection) = checked(&order, view)?;
    let kept = order.saving.is_some() || order.resume.is_some() || settings.is_shard();
    let identity = if kept { order.hash(scene)? } else { None };
    let saved = order.resume.as_deref().map(checkpoint::read).transpose()?;
    if let (Some(path), Some((head, _))) = (&order.resume, &saved) {
        checkpoint::check(path, head, identity.as_deref(), &order.arguments)?;
    }
    let decided = saved.as_ref().map(|(head, _)| head.candidate);
    let (choice, settings, candidate) = match decided {
        // What was chosen holds.
        Some(candidate) => {
            (None, settings_of_candidate(&auto, candidate, camera.size()).unwrap_or(settings), candidate)
        }
        None => {
            let choice = choose(&order, auto, view, &settings, watch)?;
            let settings = choice.as_ref().map_or(settings, |choice| choice.settings.clone());
            let candidate = choice.as_ref().map(|choice| choice.candidate);
            (choice, settings, candidate)
        }
    };
    let (settings, less) = fitted(&order, view, settings)?;
    let asked = plan::Asked { choice: choice.as_ref(), max_depth: order.max_depth, switches: order.switches };
    let mut plan = plan::plan(&asked, settings.method, view, removed);
    plan.warnings.extend(less);
    plan.warnings.extend(ungrouped(scene, &settings));
    let dark = layers::dark(&selection, &layer_shape(&settings, scene), order.finish.is_some());
    plan.warnings.extend(dark.iter().map(|name| format!("layer \"{name}\" is black: the render has no such light")));
    let (mut ready, settings) = readied(&order, view, settings, &selection, watch)?;
    // The error that is asked for is that of the picture that is delivered.
    let (target, settings) = match (&ready, settings.target_error) {
        (Some(_), Some(target)) => (Some(target), Settings { target_error: None, ..settings }),
        _ => (None, settings),
    };
    let settings = Settings { stop: watch.stop(), ..settings };
    // ErrorCoverage, but not kept in the header: a clock says so.
    let kept = plan.warnings.len();
    plan.warnings.extend(hurry::warn(view, &settings));
    watch.begins(&plan, &settings);
    plan.warnings.truncate(kept);
    // As a plan of its own tells it.
    plan.warnings.splice(0..0, scene.warnings.iter().cloned());
    let facts = Facts::new(scene, &order.camera, &settings)?;
    let stage = RenderInput::new(scene, &camera, &settings);
    let (mut session, told) = match saved {
        None => {
            let spent = choice.as_ref().map(|choice| choice.spent).unwrap_or_default();
            (Session::with_time_spent(&stage, spent), json!(plan))
        }
        Some((head, state)) => {
            watch.resumed(state.iterations());
            let path = order.resume.clone().unwrap_or_default();
            let other = || Error::new(ErrorKind::Usage, path.display(), "is of a picture of another size or method");
            let session = Session::resume(&stage, state).ok_or_else(other)?;
            (session, head.plan)
        }
    };
    // What a pipe has brought nobody can bring again.
    let saving = order.saving.as_ref().filter(|_| identity.is_some());
    let head = Head {
        version: env!("CARGO_PKG_VERSION").into(),
        scene: identity.unwrap_or_default(),
        arguments: order.arguments.clone(),
        candidate,
        plan: told,
        finished: false,
    };
    let goes_on = |saving: &Saving| order.resume.as_deref().is_some_and(|resume| is_same_file(resume, &saving.path));
    let mut saver = saving.map(|saving| Saver::new(saving, head.clone(), goes_on(saving)));
    let mut judging = None;
    let stop = drive(&mut session, |progress, session| {
        let accuracy = match judge::judge(session, ready.as_mut(), target) {
            Ok(accuracy) => accuracy,
            Err(error) => {
                judging.get_or_insert(error);
                None
            }
        };
        let progress = judge::told(progress, session, accuracy, target);
        watch.progress(&progress);
        preview(session, ready.as_mut(), &facts.frame, watch);
        if let Some(saver) = &mut saver {
            saver.save_if_due(session, watch);
        }
        match target {
            _ if watch.stops() || judging.is_some() => Control::Stop,
            Some(target) if judge::reached(&progress, session, accuracy, target) => Control::Reached,
            _ => Control::Continue,
        }
    });
    if session.iterations() == 0 && stop == StopReason::Interrupted {
        // There is as much to write as before its beginning.
        watch.chosen(None)?;
    }
    let spent_checkpoint = saver.and_then(|saver| saver.finish(&session, stop, watch));
    let rendered = session.finish(stop);
    watch.rendered(&rendered);
    watch.waits(Some(Wait::Finishing));
    let writing = Writing {
        facts: &facts,
        selection: &selection,
        naming: order.naming,
        plan: &head.plan,
        arguments: &order.arguments,
        reproducible: order.reproducible,
        more: Map::new(),
    };
    let part = rendered.settings.is_shard().then(|| rendered.shard_result());
    let delivered = deliver(writing, rendered, (ready.as_mut(), Some(watch)), part.is_some());
    watch.waits(None);
    let (delivery, pixels) = delivered?;
    let tail = part.map(|part| Tail { head, facts, part, pixels });
    Ok(Delivery { tail, spent_checkpoint, ..delivery })
}

impl Order<'_> {
    /// A hash of the files that it reads.
    fn hash(&self, scene: &Scene) -> Result<Option<String>> {
        let environment = match &self.scene.environment {
            Some(load::Environment::File(path)) => Some(path.as_path()),
            _ => None,
        };
        let converted = scene.converted.as_deref();
        checkpoint::hash(&self.scene.path, converted, environment, self.scene.options.allow_outside)
    }
}

/// What is to be said where lights have groups and the method does not tell them apart.
fn ungrouped(scene: &Scene, settings: &Settings) -> Option<String> {
    let groups = scene.lights.groups().names.len();
    let lost = groups > 0 && layer_shape(settings, scene).groups.is_empty();
    let name = settings.method.name();
    lost.then(|| format!("its {groups} light groups have no layers: --method {name} does not tell lights apart (auto, path, light, bdpt, bpm and vcm do)"))
}

/// Settings of a way that auto has chosen before.
fn settings_of_candidate(auto: &Option<Auto<'_>>, candidate: Option<Candidate>, size: (u32, u32)) -> Option<Settings> {
    (auto.as_ref()?.allowed)(candidate?, size)
}

/// Shows the picture as it is to those who look, finished as the last one will be, if quicker.
fn preview(session: &mut Session<'_>, ready: Option<&mut Ready>, frame: &exr::Frame, watch: &mut dyn Watch) {
    if !watch.looks() {
        return;
    }
    let mut spent = TimeSpent::default();
    spent.measure(|| {
        let wanted = |name: &str| name.is_empty() || (ready.is_some() && reads_for_picture(name));
        let picture = session.layers(wanted).and_then(|mut set| {
            if let Some(ready) = ready {
                ready.preview(&mut set)?;
            }
            set.layers.retain(|layer| layer.name.is_empty());
            Ok(set)
        });
        watch.picture(picture, frame);
    });
    session.add_time(spent);
}

/// The settings for the picture's size, and the layers that are wanted, once both are known to fit the scene.
fn checked(order: &Order<'_>, view: View<'_>) -> Result<(Settings, Selection)> {
    let View { scene, camera } = view;
    check::media(&order.scene.path, &order.settings, scene)?;
    check::bandwidth(&order.scene.path, &order.settings, scene)?;
    let settings = sized(order.settings.clone(), order.photons, camera.size());
    let (shape, finishes) = (layer_shape(&settings, scene), order.finish.is_some());
    let selection = layers::selection(&order.layers, &shape, finishes)?;
    layers::check_names(&selection, &shape, finishes, order.naming)?;
    // Before anything is tried, which takes time.
    fitted(order, view, settings.clone())?;
    Ok((settings, selection))
}

/// Settings that fit into memory, and what the cap that was asked for takes from them.
fn fitted(order: &Order<'_>, view: View<'_>, settings: Settings) -> Result<(Settings, Option<String>)> {
    let channels = layers::channels(&layer_shape(&settings, view.scene));
    let (settings, less) = match order.memory {
        Some(cap) => cap.plan(view, settings, channels)?,
        None => (settings, None),
    };
    memory::check(view, &settings, channels, order.finish.is_some())?;
    Ok((settings, less))
}

/// Settings for a picture of that size: what the number of light paths follows from where none is asked for.
pub fn sized(settings: Settings, photons: Option<u32>, size: (u32, u32)) -> Settings {
    Settings { photons: photons.unwrap_or(settings.default_photons(size)), ..settings }
}

/// What auto chooses, where it is to: among ways whose pictures have the layers asked for.
fn choose(
    order: &Order<'_>,
    auto: Option<Auto<'_>>,
    View { scene, camera }: View<'_>,
    settings: &Settings,
    watch: &mut dyn Watch,
) -> Result<Option<Choice>> {
    let chosen = match auto {
        None => None,
        Some(mut auto) => {
            let has_layers = |of: &Settings| {
                layers::selection(&order.layers, &layer_shape(of, scene), order.finish.is_some()).is_ok()
            };
            let techniques = settings.techniques;
            let make = |candidate: Candidate| {
                let able = !techniques || candidate.method.has_techniques();
                let settings = (auto.allowed)(candidate, camera.size()).filter(|of| able && has_layers(of))?;
                Some(Settings { techniques, ..settings })
            };
            watch.waits(Some(Wait::Choosing));
            let chosen = choose::choose(View { scene, camera }, &mut auto.finish, make, || watch.stops());
            watch.waits(None);
            chosen
        }
    };
    watch.chosen(chosen.as_ref())?;
    Ok(chosen)
}

/// The finish, if there is to be one; its time is part of the time that was asked for. Shards are finished when they are
/// joined.
fn readied(
    order: &Order<'_>,
    View { scene, camera }: View<'_>,
    settings: Settings,
    selection: &Selection,
    watch: &mut dyn Watch,
) -> Result<(Option<Ready>, Settings)> {
    let Some(asked) = order.finish.as_ref().filter(|_| !settings.is_shard()) else { return Ok((None, settings)) };
    let mut ready = finish::open(asked, Some(settings.levels.count))?;
    watch.finishes(ready.missing.as_ref());
    let Some(time) = settings.time else { return Ok((Some(ready), settings)) };
    let parts = film::names(&layer_shape(&settings, scene));
    let wanted = parts.iter().filter_map(|name| finished_part(name)).filter(|part| selection.wants(part)).count();
    let (width, height) = camera.size();
    let left = time - ready.reserve(time, width as usize * height as usize, wanted)?;
    Ok((Some(ready), Settings { time: Some(left), ..settings }))
}
