//! The error of the picture as it would be delivered, judged now and then while a render goes on.
//!
//! When that is follows from counts alone, so that what stops at an error stops at the same iteration wherever and
//! however often it is interrupted.

use super::Ready;
use crate::error::Result;
use crate::finish::reads_for_error;
use crate::render::{Accuracy, MIN_ITERATIONS_FOR_ERROR, Progress, Session, TimeSpent};

/// Without a target a picture is judged anew when it has had so many times the iterations.
const RARELY: u64 = 4;
/// Near a target that is thought to be reached, this share of the iterations more.
const NEAR: f64 = 0.1;

/// Judges the picture if that is due; returns how its error falls, once that is known.
///
/// # Errors
/// The denoiser fails.
pub(super) fn judge(
    session: &mut Session<'_>,
    ready: Option<&mut Ready>,
    target: Option<f64>,
) -> Result<Option<Accuracy>> {
    let Some(ready) = ready else { return Ok(None) };
    let (iterations, known) = (session.iterations(), Accuracy::of(session.history()));
    let last = session.history().iter().rev().find(|moment| moment.finished.is_some());
    let last = last.map_or(0, |moment| moment.iterations);
    let due = match target {
        None => iterations >= RARELY * last,
        Some(target) => {
            let reached = known.is_some_and(|known| known.error(iterations) <= target);
            session.is_recorded() || (reached && iterations as f64 >= (1.0 + NEAR) * last as f64)
        }
    };
    if iterations < MIN_ITERATIONS_FOR_ERROR || iterations == last || !due {
        return Ok(known);
    }
    let mut spent = TimeSpent::default();
    let judged = spent.measure(|| {
        let set = session.layers(reads_for_error)?;
        ready.finish().estimate_error(&set)
    });
    session.add_time(spent);
    session.record_finished_error(judged?);
    Ok(Accuracy::of(session.history()))
}

/// Progress with what is known of the finished picture: its error, and when that may be what was asked for, else half of
/// it.
pub(super) fn told(
    progress: &Progress,
    session: &Session<'_>,
    accuracy: Option<Accuracy>,
    target: Option<f64>,
) -> Progress {
    let Some(accuracy) = accuracy else { return *progress };
    let error = accuracy.error(session.iterations());
    let wanted = target.unwrap_or(0.5 * error);
    let seconds = accuracy.iterations_to(wanted).map(|iterations| session.seconds_until(iterations));
    let expected = seconds.filter(|seconds| *seconds > 0.0).map(|seconds| (wanted, seconds));
    Progress { finished: Some(error), expected, ..*progress }
}

/// Whether the error that is asked for is reached: as judged after this iteration, or, where noise hides the error of the
/// finished picture, by that of the estimate.
pub(super) fn reached(progress: &Progress, session: &Session<'_>, accuracy: Option<Accuracy>, target: f64) -> bool {
    let iterations = session.iterations();
    let error = match accuracy {
        Some(accuracy) => Some(accuracy.error(iterations)).filter(|_| accuracy.judged == iterations),
        None => progress.error,
    };
    // Without a light the black picture is right.
    let error = error.or(session.has_no_lights().then_some(0.0));
    iterations >= MIN_ITERATIONS_FOR_ERROR && error.is_some_and(|error| error <= target)
}
