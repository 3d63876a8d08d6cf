//! The loop over iterations, and its stop conditions.

use super::Session;
use super::control::{Control, Progress};
use crate::camera::Camera;
use crate::estimator::{PixelAccumulator, QUARTERS};
use crate::render::account::{Rendered, StopReason};
use crate::render::input::RenderInput;
use crate::render::pass::learn_light;
use crate::render::settings::Settings;
use crate::scene::{Scene, View};

/// Iterations that an estimated error needs before it may stop a render: two in every quarter, whose spread gives the
/// variance.
pub const MIN_ITERATIONS_FOR_ERROR: u64 = 2 * QUARTERS as u64;

/// Renders a picture. `observe` is called after every iteration with the progress and the pixels, and may stop the render.
///
/// Methods without bandwidth levels render one level. `settings.photons` applies to methods for which
/// [`Method::takes_photon_count`](crate::render::Method::takes_photon_count) is true.
pub fn render(
    scene: &Scene,
    camera: &Camera,
    settings: &Settings,
    mut observe: impl FnMut(&Progress, &[PixelAccumulator]) -> Control,
) -> Rendered {
    let lit = scene.with_learnt(&learn_light(View::new(scene, camera), settings));
    let input = RenderInput::new(lit.as_ref().unwrap_or(scene), camera, settings);
    let mut session = Session::new(&input);
    let stop = run_session(&mut session, |progress, session| observe(progress, session.pixels()));
    session.finish(stop)
}

/// Iterates until the session's settings or `observe` stop it, and returns the reason. Time that `observe` takes counts as
/// part of the render if it adds it by [`Session::add_time`].
pub fn run_session<'a>(
    session: &mut Session<'a>,
    mut observe: impl FnMut(&Progress, &mut Session<'a>) -> Control,
) -> StopReason {
    let settings = session.settings();
    loop {
        if session.is_finished() {
            return StopReason::Iterations;
        }
        let left = settings.time.map(|time| time - session.spent().seconds);
        // A picture needs one iteration.
        let done = if session.iterations() > 0 { session.step_within(left) } else { session.step_or_cut(left) };
        if !done {
            return if settings.stop.requested() || session.failure.is_some() {
                StopReason::Interrupted
            } else {
                StopReason::Time
            };
        }
        let progress = session.progress();
        match observe(&progress, session) {
            Control::Continue if session.has_cut_paths() => return StopReason::Time,
            Control::Continue => {}
            Control::Stop => return StopReason::Interrupted,
            Control::Reached => return StopReason::Error,
        }
        // In a scene without lights the black picture is exact.
        let error = progress.error.or(session.has_no_lights().then_some(0.0));
        let error = error.filter(|_| progress.iteration >= MIN_ITERATIONS_FOR_ERROR);
        if let Some(reason) = settings.stop_reason(session.spent().seconds, error) {
            return reason;
        }
    }
}

impl Settings {
    /// The reason to stop after `seconds` with the estimated relative error `error`; `None` to continue.
    fn stop_reason(&self, seconds: f64, error: Option<f64>) -> Option<StopReason> {
        if self.time.is_some_and(|t| seconds >= t) {
            Some(StopReason::Time)
        } else if self.target_error.is_some_and(|e| error.is_some_and(|x| x <= e)) {
            Some(StopReason::Error)
        } else {
            None
        }
    }
}
