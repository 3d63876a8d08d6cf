//! The sixth step: the iterations of a render, with error estimates, previews and checkpoints between them.

use super::checkpoint::Head;
use super::choose::{Chosen, refuse_stop};
use super::finish::OpenFinish;
use super::finished_error;
use super::observer::{Event, Observer};
use super::prepare::Prepared;
use super::request::Request;
use super::resume::Resumption;
use super::saver::Saver;
use super::slow_iteration;
use crate::error::{Error, ErrorKind, Result};
use crate::files;
use crate::finish::reads_for_preview;
use crate::image::exr;
use crate::render::{Control, Progress, RenderInput, Rendered, Session, State, StopReason, TimeSpent, run_session};
use serde_json::json;
use std::path::PathBuf;

/// A render during its iterations.
pub(super) struct Running<'a> {
    session: Session<'a>,
    between: BetweenIterations<'a>,
    head: Head,
}

/// A render whose iterations have ended and whose picture is not finished yet.
pub(super) struct Iterated {
    /// The pixel sums and statistics of the render.
    pub rendered: Rendered,
    /// The identity of the render, which the file of a shard stores.
    pub head: Head,
    /// The denoiser and the network that finish the picture; `None`: it stays unfinished.
    pub finish: Option<OpenFinish>,
    /// Path of a checkpoint that is no longer needed once the picture is written.
    pub obsolete_checkpoint: Option<PathBuf>,
}

impl<'a> Running<'a> {
    /// Starts the iterations of a render, or continues those of a checkpoint.
    ///
    /// # Errors
    /// The checkpoint is of a picture of another size or method.
    pub fn start(
        request: &'a Request,
        stage: &'a RenderInput<'a>,
        chosen: &Chosen,
        Prepared { finish, target, plan, .. }: Prepared,
        Resumption { scene, saved }: Resumption,
        frame: exr::Frame,
        observer: &mut dyn Observer,
    ) -> Result<Running<'a>> {
        // A scene that came through a pipe cannot be read again to continue.
        let saving = request.saving.as_ref().filter(|_| scene.is_some());
        let (session, plan) = match saved {
            None => (Session::with_time_spent(stage, chosen.spent()), json!(plan)),
            Some((head, state)) => (resume(request, stage, state, observer)?, head.plan),
        };
        let head = Head {
            version: env!("CARGO_PKG_VERSION").into(),
            scene: scene.unwrap_or_default(),
            arguments: request.arguments.clone(),
            candidate: chosen.candidate,
            plan,
            finished: false,
        };
        let saver = saving.map(|saving| {
            let continues = request.resume.as_deref().is_some_and(|resume| files::is_same(resume, &saving.path));
            Saver::new(saving, head.clone(), continues)
        });
        let between = BetweenIterations { finish, target, frame, saver };
        Ok(Running { session, between, head })
    }

    /// Iterates until the settings, the error of the finished picture or the user end the render.
    ///
    /// # Errors
    /// The user has stopped the render before its first iteration; a shard whose paths the time limit has cut.
    pub fn iterate(self, observer: &mut dyn Observer) -> Result<Iterated> {
        let Running { mut session, mut between, head } = self;
        let stop = run_session(&mut session, |progress, session| between.after_iteration(progress, session, observer));
        if let Some(failure) = session.take_failure() {
            if session.iterations() == 0 {
                return Err(failure);
            }
            observer.event(Event::MomentFailed(&failure));
        }
        if session.iterations() == 0 && stop == StopReason::Interrupted {
            refuse_stop(observer)?;
        }
        if session.has_cut_paths() && session.settings().is_shard() {
            return Err(slow_iteration::error(session.settings()));
        }
        let BetweenIterations { finish, saver, .. } = between;
        // A render that continued from cut paths would lack their light.
        let saver = saver.filter(|_| !session.has_cut_paths());
        let obsolete_checkpoint = saver.and_then(|saver| saver.save_at_end(&session, stop, observer));
        Ok(Iterated { rendered: session.finish(stop), head, finish, obsolete_checkpoint })
    }
}

/// Continues the iterations of a checkpoint.
fn resume<'a>(
    request: &Request,
    stage: &'a RenderInput<'a>,
    state: State,
    observer: &mut dyn Observer,
) -> Result<Session<'a>> {
    observer.event(Event::Resumed(state.iterations()));
    let path = request.resume.as_deref().unwrap_or("".as_ref());
    let other = || Error::new(ErrorKind::Usage, path.display(), "is of a picture of another size or method");
    let unrecorded = || {
        let cause = "does not hold the light by the lobe of the first hit, which --layers asks for";
        Error::new(ErrorKind::Usage, path.display(), cause)
            .hint("leave DiffuseDirect and the like out of --layers, or start anew without --resume")
    };
    let state = state.with_lobes(stage.settings().lobes).ok_or_else(unrecorded)?;
    Session::resume(stage, state).ok_or_else(other)
}

/// The work of a render between two iterations: error estimates, previews and checkpoints.
struct BetweenIterations<'a> {
    finish: Option<OpenFinish>,
    /// Relative error of the finished picture at which the render stops; `None`: no target.
    target: Option<f64>,
    frame: exr::Frame,
    saver: Option<Saver<'a>>,
}

impl BetweenIterations<'_> {
    fn after_iteration<'a>(
        &mut self,
        progress: &Progress,
        session: &mut Session<'a>,
        observer: &mut dyn Observer,
    ) -> Control {
        let estimated = finished_error::estimate(session, self.finish.as_mut(), self.target);
        // A denoiser that fails here fails again in the finish, which reports the error and keeps the estimate.
        let (accuracy, failed) = estimated.map_or((None, true), |accuracy| (accuracy, false));
        let progress = finished_error::add_to_progress(progress, session, accuracy, self.target);
        observer.event(Event::Progress(&progress));
        self.preview(session, observer);
        if let Some(saver) = self.saver.as_mut().filter(|_| !session.has_cut_paths()) {
            saver.save_if_due(session, observer);
        }
        match self.target {
            _ if failed || observer.stop().requested() => Control::Stop,
            Some(target) if finished_error::is_reached(&progress, session, accuracy, target) => Control::Reached,
            _ => Control::Continue,
        }
    }

    /// Sends a preview if the observer wants one, finished at the lowest quality.
    fn preview(&mut self, session: &mut Session<'_>, observer: &mut dyn Observer) {
        if !observer.wants_preview() {
            return;
        }
        let BetweenIterations { finish, frame, .. } = self;
        let mut spent = TimeSpent::default();
        spent.measure(|| {
            let wanted = |name: &str| name.is_empty() || (finish.is_some() && reads_for_preview(name));
            let picture = session.layers(wanted).and_then(|mut set| {
                if let Some(finish) = finish {
                    finish.apply_to_preview(&mut set, None)?;
                }
                set.layers.retain(|layer| layer.name.is_empty());
                Ok(set)
            });
            observer.event(Event::Preview { picture, frame });
        });
        session.add_time(spent);
    }
}
