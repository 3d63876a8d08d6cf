//! A render from beginning to end, in steps that pass plain data on:
//!
//! ```text
//! Request -> load::Loaded -> check::Checked -> choose::Chosen -> plan::Planned
//!         -> prepare::Prepared -> run::Iterated -> deliver::Delivery
//! ```
//!
//! The command line or a host program fills a [`Request`] and receives events through an [`Observer`]. The pipeline
//! neither parses options nor prints, and writes no file but checkpoints.

pub mod check;
pub mod checkpoint;
pub mod choose;
mod deliver;
pub mod edit;
mod facts;
pub mod finish;
mod finished_error;
mod forecast;
pub mod layers;
pub mod learn;
pub mod live;
pub mod load;
pub mod memory;
pub mod merge;
mod motion;
mod motion_vectors;
mod observer;
pub mod plan;
mod prepare;
pub mod records;
mod rendered_file;
mod request;
mod resume;
mod run;
mod saver;
mod scene_info;
pub mod seeds;
pub mod shard;
mod slow_iteration;
pub mod temporal;
mod worst;

pub use deliver::{Delivery, FINISHED_PICTURE, Reached, header_to_finish, write_finish};
pub use facts::SceneFacts;
pub use finish::{FinishRequest, OpenFinish};
pub use forecast::{Forecast, forecast};
pub use load::{Loaded, SceneRequest};
pub use observer::{Event, Observer, Phase};
pub use rendered_file::RenderedFile;
pub use request::{PictureRequest, Request, Saving};
pub use scene_info::scene_info;
pub use worst::{Place, Tile, Worst};

use crate::error::{Error, ErrorKind, Result};
use crate::film::MOTION;
use crate::render::{Motion, RenderInput, Rendered};
use crate::scene::{Scene, View};
use check::Checked;
use choose::Chosen;
use learn::Learnt;
use motion::{MovingScene, few_moments};
use motion_vectors::motion_vectors;
use observer::during;
use resume::Resumption;
use run::Running;

/// Renders. Everything that can be wrong with a request is found before the first light path, except a finish that
/// fails, which keeps the estimate ([`Delivery::finish_error`]).
///
/// # Errors
/// The scene; options that contradict it; memory; a stop before the first iteration; a scene that the observer rejects.
pub fn render(mut request: Request, observer: &mut dyn Observer) -> Result<Delivery> {
    let stop = observer.stop();
    request.scene.options.motion_vectors = request.layers.wants(MOTION);
    let loaded = during(Phase::Reading, observer, |_| load::load(&request.scene, rayon::current_num_threads(), &stop))?;
    render_loaded(request, &loaded, observer)
}

/// Renders a scene that has been loaded, which can be rendered again.
///
/// # Errors
/// Errors of [`render`].
pub fn render_loaded(mut request: Request, loaded: &Loaded, observer: &mut dyn Observer) -> Result<Delivery> {
    request.picture.settings.lobes = request.layers.wants_lobes();
    observer.accept(&loaded.scene)?;
    let Checked { camera, settings } = check::check(&request, &loaded.scene)?;
    let view = View::new(&loaded.scene, &camera);
    let motion = MovingScene::new(&request, view, loaded.file.as_ref(), observer.stop())?;
    // Lights may be dark at the frame, and the camera elsewhere.
    let middle = motion.as_ref().map(|motion| motion.at(0.5)).transpose()?;
    let seen = middle.as_ref().map_or(view, |(scene, camera)| View::new(scene, camera));
    let resumption = Resumption::read(&request, loaded.hash.clone(), &settings)?;
    let learnt = Learnt::new(seen, &settings, &observer.stop());
    let with_learnt = |scene: &Scene| scene.with_learnt(&learnt.light);
    let scene = with_learnt(view.scene);
    let middle = middle.map(|(scene, camera)| (with_learnt(&scene).unwrap_or(scene), camera));
    let motion = motion.map(|motion| motion.with_learnt(learnt.light.clone()));
    let view = View::new(scene.as_ref().unwrap_or(view.scene), &camera);
    let seen = middle.as_ref().map_or(view, |(scene, camera)| View::new(scene, camera));
    let chosen = match &resumption.saved {
        Some((head, _)) => choose::chosen_before(&request.picture.settings, head.candidate, settings, seen),
        None => choose::choose_for_render(&request, settings, seen, observer)?,
    };
    let chosen = Chosen { learning: learnt.spent, ..chosen };
    let planned = plan::plan_render(&request, &chosen, seen, &loaded.removed)?;
    drop(middle);
    let prepared = prepare::prepare(&request, planned, view, observer)?;
    let mut facts = SceneFacts::new(view.scene, &request.picture.camera, &prepared.settings)?;
    facts.motion = motion_vectors(&request, view, loaded.file.as_ref(), &observer.stop())?;
    let stage = RenderInput::new(view.scene, view.camera, &prepared.settings)
        .with_motion(motion.as_ref().map(|motion| motion as &dyn Motion));
    let running = Running::start(&request, &stage, &chosen, prepared, resumption, facts.frame, observer)?;
    let iterated = running.iterate(observer)?;
    if observer.abandons() {
        return Err(Error::new(ErrorKind::Interrupted, "", "the picture is not wanted any more"));
    }
    observer.event(Event::Rendered(&iterated.rendered));
    let Rendered { settings, stats, .. } = &iterated.rendered;
    // Before the render, the plan warns of a small number of iterations that was asked for.
    let planned = |iterations| few_moments(view.scene, iterations).is_some();
    let tells_moments = !settings.is_shard() && !settings.iterations.is_some_and(planned);
    let few = tells_moments.then(|| few_moments(view.scene, stats.iterations)).flatten();
    let cut = slow_iteration::warning_of_cut(settings, request.saving.as_ref());
    for warning in few.into_iter().chain(cut) {
        observer.event(Event::Warning(&warning));
        facts.warnings.push(warning);
    }
    during(Phase::Finishing, observer, |observer| deliver::deliver_render(&request, iterated, facts, observer))
}
