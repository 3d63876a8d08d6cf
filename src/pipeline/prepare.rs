//! The fifth step: opens the finish and announces the render.

use super::finish::{self, OpenFinish};
use super::layers::finished_parts;
use super::motion::few_moments;
use super::observer::{Event, Observer};
use super::plan::Planned;
use super::request::Request;
use super::slow_iteration;
use crate::error::Result;
use crate::film::output as film;
use crate::plan::Plan;
use crate::render::Settings;
use crate::render::output::layer_shape;
use crate::scene::View;

/// A render that is ready for its first iteration: its settings, finish and plan.
pub(super) struct Prepared {
    /// The settings, with the time limit less the time that the finish takes.
    pub settings: Settings,
    /// The finish (denoiser and network); `None`: the picture stays the unfinished estimate, or is a shard, which is
    /// finished after the merge.
    pub finish: Option<OpenFinish>,
    /// Relative error of the finished picture at which the render stops; `None`: no target. Without a finish the
    /// settings hold it.
    pub target: Option<f64>,
    /// The plan (effects and warnings) for the header, with the warnings of the scene.
    pub plan: Plan,
}

/// Opens the finish (denoiser and network) and announces the render to the observer.
///
/// # Errors
/// The denoiser or the network cannot be opened.
pub(super) fn prepare(
    request: &Request,
    Planned { settings, mut plan }: Planned,
    view: View<'_>,
    observer: &mut dyn Observer,
) -> Result<Prepared> {
    let (finish, settings) = open_finish(request, view, settings, observer)?;
    let (target, target_error) = match &finish {
        Some(_) => (settings.target_error, None),
        None => (None, settings.target_error),
    };
    let settings = Settings { target_error, stop: observer.stop(), ..settings };
    plan.warnings.extend(settings.iterations.and_then(|iterations| few_moments(view.scene, iterations)));
    announce(&mut plan, view, &settings, observer);
    plan.warnings.splice(0..0, view.scene.warnings.iter().cloned());
    Ok(Prepared { settings, finish, target, plan })
}

/// Opens the finish, if there is to be one. Returns it with settings whose time limit leaves out the time that it
/// takes.
fn open_finish(
    request: &Request,
    View { scene, camera }: View<'_>,
    settings: Settings,
    observer: &mut dyn Observer,
) -> Result<(Option<OpenFinish>, Settings)> {
    let Some(wanted) = request.finish_of(&settings) else { return Ok((None, settings)) };
    let mut finish = finish::open(wanted, Some(settings.levels.count))?;
    observer.event(Event::FinishOpened { missing: finish.missing.as_ref() });
    let Some(time) = settings.time else { return Ok((Some(finish), settings)) };
    let parts = finished_parts(&film::names(&layer_shape(&settings, scene)), &request.layers);
    let (width, height) = camera.size();
    let left = time - finish.reserve_time(time, width as usize * height as usize, parts)?;
    Ok((Some(finish), Settings { time: Some(left), ..settings }))
}

/// Sends the plan to the observer. The warning of slow iterations depends on a clock, so the plan does not keep it for
/// the header.
fn announce(plan: &mut Plan, view: View<'_>, settings: &Settings, observer: &mut dyn Observer) {
    let kept = plan.warnings.len();
    plan.warnings.extend(slow_iteration::warning(view, settings));
    observer.event(Event::Begins { plan, settings });
    plan.warnings.truncate(kept);
}
