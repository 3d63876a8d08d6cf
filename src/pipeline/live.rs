//! A picture for somebody who watches it, such as a viewport: it is shown after the iterations 1, 2, 4 and so on, and
//! restarted often.
//!
//! Iterations are those of [`super::render`], and so is the estimate. The finish is the one of previews: the denoiser works at
//! its lowest quality, and errors and parts are left out. The caller keeps what does not depend on the view, so that a
//! new picture begins at once: the denoiser, and the candidate that `auto` has chosen.

use super::check::check_picture;
use super::choose::{choose, chosen_before};
use super::finish::OpenFinish;
use super::learn::Learnt;
use super::load::Loaded;
use super::memory::{MemoryCheck, MemoryLimit};
use super::request::PictureRequest;
use crate::error::{Error, ErrorKind, Result};
use crate::film::{LayerSet, Selection};
use crate::finish::{DenoiserChoice, reads_for_preview};
use crate::render::{
    Candidate, Control, Progress, RenderInput, Session, Settings, SettingsRequest, StopReason, run_session,
};
use crate::scene::View;
use crate::stop::Stop;
use std::path::Path;
use std::time::Duration;

/// Time after a coarse picture in which the next view may come before the whole picture begins.
const NEXT_VIEW_MILLISECONDS: u64 = 100;
/// Iterations for which `auto` chooses, at most. Its pilot takes a share of the render, and a viewer waits for it.
const MAX_CHOICE_ITERATIONS: u64 = 8;
/// Fewest light paths of an iteration of the coarse picture.
const MIN_COARSE_PHOTONS: u32 = 1000;

/// A picture to show while it renders.
pub struct LiveRequest<'a> {
    /// The picture: camera, size and method.
    pub picture: PictureRequest,
    /// Path of the scene file, for messages.
    pub path: &'a Path,
    /// Limit on the memory of photons, pixels and layers; `None`: the memory of the machine alone.
    pub memory: Option<MemoryLimit>,
    /// The candidate that `auto` has chosen for an earlier picture; `None`: it chooses.
    pub candidate: Option<Candidate>,
    /// Ratio of the sides of the picture to those of a coarse picture of one iteration, which is shown first; 1: there
    /// is none.
    pub coarse: u32,
    /// Ends the picture, also within an iteration.
    pub stop: Stop,
}

/// A picture that is shown.
pub struct Shown<'a> {
    /// The beauty layer alone.
    pub set: LayerSet,
    /// State of the render.
    pub progress: &'a Progress,
    /// Settings of the render.
    pub settings: &'a Settings,
    /// Whether this is the coarse picture.
    pub is_coarse: bool,
}

/// How a picture has ended.
pub struct LiveEnd {
    /// State after the last iteration; `None` if none was done.
    pub progress: Option<Progress>,
    /// Why the render has ended.
    pub reason: StopReason,
    /// The candidate (method and settings) that `auto` has chosen, now or before; `None` if the user names the method.
    pub candidate: Option<Candidate>,
}

/// Renders a picture and shows it. `finish`: the open denoiser and network; `None`: the estimate is shown. `show` returns
/// false to end the render.
///
/// # Errors
/// Options that contradict the scene; memory; the denoiser; motion blur.
pub fn render_live(
    request: LiveRequest<'_>,
    loaded: &Loaded,
    mut finish: Option<&mut OpenFinish>,
    show: &mut dyn FnMut(Shown<'_>) -> bool,
) -> Result<LiveEnd> {
    let scene = &loaded.scene;
    if scene.shutter.is_some() {
        let error = Error::new(ErrorKind::Usage, request.path.display(), "a scene with motion blur is not shown live");
        return Err(error.hint("load it with --shutter 0"));
    }
    let checked = check_picture(&request.picture, request.path, scene)?;
    let view = View::new(scene, &checked.camera);
    let (method, finish_by) =
        (request.picture.settings.method.name(), finish.as_ref().map(|_| DenoiserChoice::default()));
    let memory = MemoryCheck { view, method, layers: &Selection::Beauty, finish: finish_by, limit: request.memory };
    let fit = |settings: Settings| {
        let (settings, _) = memory.fit(settings)?;
        Ok(Settings { stop: request.stop.clone(), target_error: None, ..settings })
    };
    let known = request
        .candidate
        .map(|candidate| chosen_before(&request.picture.settings, Some(candidate), checked.settings.clone(), view));
    if request.coarse > 1 {
        // The choice of a method takes longer than the coarse picture, so it comes later.
        let settings = known.as_ref().map_or(&checked.settings, |chosen| &chosen.settings);
        let camera = checked.camera.downscale(1.0 / f64::from(request.coarse));
        let share = request.coarse.saturating_mul(request.coarse);
        let photons = (settings.photons / share).max(MIN_COARSE_PHOTONS).min(settings.photons);
        // Learning where light paths start takes longer than the coarse picture.
        let settings = fit(Settings { photons, iterations: Some(1), guided: false, ..settings.clone() })?;
        let input = RenderInput::new(scene, &camera, &settings);
        let (progress, reason, failure) = run(&input, finish.as_deref_mut(), true, show)?;
        if let Some(failure) = failure {
            return Err(failure);
        }
        if reason == StopReason::Interrupted {
            return Ok(LiveEnd { progress, reason, candidate: request.candidate });
        }
        wait_for_next(&request.stop);
    }
    let learnt = Learnt::new(view, &checked.settings, &request.stop);
    let lit = scene.with_learnt(&learnt.light);
    let view = View::new(lit.as_ref().unwrap_or(scene), &checked.camera);
    let iterations = checked.settings.iterations;
    let chosen = known.unwrap_or_else(|| {
        let most = iterations.map_or(MAX_CHOICE_ITERATIONS, |iterations| iterations.min(MAX_CHOICE_ITERATIONS));
        let shorter = SettingsRequest { iterations: Some(most), ..request.picture.settings };
        choose(&shorter, checked.settings, view, memory.admits(), &request.stop)
    });
    if request.stop.requested() {
        // A choice that was interrupted is not used again.
        return Ok(LiveEnd { progress: None, reason: StopReason::Interrupted, candidate: request.candidate });
    }
    let candidate = chosen.candidate;
    let settings = fit(Settings { iterations, ..chosen.settings })?;
    let input = RenderInput::new(view.scene, &checked.camera, &settings);
    let (progress, reason, failure) = run(&input, finish, false, show)?;
    failure.map_or(Ok(LiveEnd { progress, reason, candidate }), Err)
}

/// Waits a moment for a request to stop: while a camera moves, the next view comes as soon as the coarse picture of the last
/// one is there, and the memory of the whole picture would be taken for nothing.
fn wait_for_next(stop: &Stop) {
    for _ in 0..NEXT_VIEW_MILLISECONDS {
        if stop.requested() {
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Renders the iterations of a picture, and shows it after the iterations 1, 2, 4 and so on, and after the last one.
fn run(
    input: &RenderInput<'_>,
    mut finish: Option<&mut OpenFinish>,
    is_coarse: bool,
    show: &mut dyn FnMut(Shown<'_>) -> bool,
) -> Result<(Option<Progress>, StopReason, Option<Error>)> {
    let mut session = Session::new(input);
    let (mut last, mut failure) = (None, None);
    let (settings, mut next) = (input.settings(), 1);
    let reason = run_session(&mut session, |progress, session| {
        last = Some(*progress);
        if settings.stop.requested() {
            return Control::Stop;
        }
        if progress.iteration < next && Some(progress.iteration) != progress.iterations {
            return Control::Continue;
        }
        next = 2 * progress.iteration;
        let set = match picture(session, finish.as_deref_mut(), &settings.stop) {
            Ok(set) => set,
            Err(error) => {
                failure = Some(error).filter(|error| error.kind != ErrorKind::Interrupted);
                return Control::Stop;
            }
        };
        if show(Shown { set, progress, settings, is_coarse }) { Control::Continue } else { Control::Stop }
    });
    Ok((last, reason, failure.or(session.take_failure())))
}

/// The picture so far, finished as a preview unless `stop` ends that: the beauty layer alone.
fn picture(session: &Session<'_>, finish: Option<&mut OpenFinish>, stop: &Stop) -> Result<LayerSet> {
    let finishes = finish.is_some();
    let mut set = session.layers(|name| name.is_empty() || (finishes && reads_for_preview(name)))?;
    if let Some(finish) = finish {
        finish.apply_to_preview(&mut set, Some(stop))?;
    }
    set.layers.retain(|layer| layer.name.is_empty());
    Ok(set)
}
