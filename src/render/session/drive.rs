//! The loop over iterations that all methods share: when it stops, and what it reports.

use super::control::{Control, Progress};
use super::{RenderInput, Session};
use crate::camera::Camera;
use crate::estimator::{PixelAccumulator, QUARTERS};
use crate::render::account::Rendered;
use crate::render::account::StopReason;
use crate::render::settings::Settings;

use crate::scene::Scene;

/// Iterations before which the estimated error ends no render: two in every quarter, by whose scatter the variance is
/// told.
pub const MIN_ITERATIONS_FOR_ERROR: u64 = 2 * QUARTERS as u64;

/// Renders. `observe` is called after every iteration and may stop the render; it also gets the pixels, to show or save
/// them.
///
/// Methods without bandwidth levels write one. With [`Method::Path`](crate::render::Method::Path) and the methods that merge or
/// connect, `settings.photons` is not used: there are as many light paths as eye paths, or none.
pub fn render(
    scene: &Scene,
    camera: &Camera,
    settings: &Settings,
    mut observe: impl FnMut(&Progress, &[PixelAccumulator]) -> Control,
) -> Rendered {
    let stage = RenderInput::new(scene, camera, settings);
    let mut session = Session::new(&stage);
    let stop = drive(&mut session, |progress, session| observe(progress, session.pixels()));
    session.finish(stop)
}

/// Iterates until the session's settings, or `observe`, stop it; returns what has. What `observe` takes of the time is the
/// render's own where it says so ([`Session::charge`]).
pub fn drive<'a>(
    session: &mut Session<'a>,
    mut observe: impl FnMut(&Progress, &mut Session<'a>) -> Control,
) -> StopReason {
    let settings = session.settings();
    loop {
        if session.is_finished() {
            return StopReason::Iterations;
        }
        // A picture is the least that is wanted: the first iteration may take longer.
        let left = settings.time.filter(|_| session.iterations() > 0).map(|time| time - session.spent().seconds);
        if !session.step_within(left) {
            return if settings.stop.requested() { StopReason::Interrupted } else { StopReason::Time };
        }
        let progress = session.progress();
        match observe(&progress, session) {
            Control::Continue => {}
            Control::Stop => return StopReason::Interrupted,
            Control::Reached => return StopReason::Error,
        }
        // Without a light the black picture is right.
        let error = progress.error.or(session.has_no_lights().then_some(0.0));
        let error = error.filter(|_| progress.iteration >= MIN_ITERATIONS_FOR_ERROR);
        if let Some(reason) = settings.stops(session.spent().seconds, error) {
            return reason;
        }
    }
}

impl Settings {
    /// Whether time or error end the render.
    fn stops(&self, seconds: f64, error: Option<f64>) -> Option<StopReason> {
        if self.time.is_some_and(|t| seconds >= t) {
            Some(StopReason::Time)
        } else if self.target_error.is_some_and(|e| error.is_some_and(|x| x <= e)) {
            Some(StopReason::Error)
        } else {
            None
        }
    }
}
