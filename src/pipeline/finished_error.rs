//! The error of the finished picture, estimated at some iterations of a render.
//!
//! The iterations follow from counts alone, never from clocks, so a render that stops at a target error stops after the
//! same iteration wherever it runs and however often it is interrupted.

use super::finish::OpenFinish;
use crate::error::Result;
use crate::finish::reads_for_error;
use crate::render::{Accuracy, ExpectedError, MIN_ITERATIONS_FOR_ERROR, Progress, Session, TimeSpent};

/// Factor by which the iterations grow between two estimates of the finished picture's error, without a target error.
const GROWTH: u64 = 4;
/// Share by which the iterations grow between two estimates of the finished picture's error, once it is expected to
/// reach the target.
const GROWTH_NEAR_TARGET: f64 = 0.1;

/// Estimates the error of the finished picture if an estimate is due. Returns how the error falls with the iterations,
/// `None` until that is known.
///
/// # Errors
/// The denoiser fails.
pub(super) fn estimate(
    session: &mut Session<'_>,
    finish: Option<&mut OpenFinish>,
    target: Option<f64>,
) -> Result<Option<Accuracy>> {
    let Some(finish) = finish else { return Ok(None) };
    let (iterations, known) = (session.iterations(), Accuracy::fit(session.history()));
    let last = session.history().iter().rev().find(|moment| moment.finished.is_some());
    let last = last.map_or(0, |moment| moment.iterations);
    let due = match target {
        None => iterations >= GROWTH * last,
        Some(target) => {
            let reached = known.is_some_and(|known| known.error(iterations) <= target);
            session.is_recorded() || (reached && iterations as f64 >= (1.0 + GROWTH_NEAR_TARGET) * last as f64)
        }
    };
    if iterations < MIN_ITERATIONS_FOR_ERROR || iterations == last || !due {
        return Ok(known);
    }
    let mut spent = TimeSpent::default();
    let error = spent.measure(|| {
        let set = session.layers(reads_for_error)?;
        finish.finish().estimate_error(&set)
    });
    session.add_time(spent);
    session.record_finished_error(error?);
    Ok(Accuracy::fit(session.history()))
}

/// Progress with the error of the finished picture, and the time at which that error reaches the target, or half of its
/// value if there is no target.
pub(super) fn add_to_progress(
    progress: &Progress,
    session: &Session<'_>,
    accuracy: Option<Accuracy>,
    target: Option<f64>,
) -> Progress {
    let Some(accuracy) = accuracy else { return *progress };
    let error = accuracy.error(session.iterations());
    let next = target.unwrap_or(0.5 * error);
    let seconds = accuracy.iterations_to(next).map(|iterations| session.seconds_until(iterations));
    let expected = seconds.filter(|seconds| *seconds > 0.0).map(|seconds| ExpectedError { error: next, seconds });
    Progress { finished: Some(error), expected, ..*progress }
}

/// Whether the picture has reached the target error: by the estimate for the finished picture after this iteration, or,
/// if noise hides that error, by the error of the unfinished estimate.
pub(super) fn is_reached(progress: &Progress, session: &Session<'_>, accuracy: Option<Accuracy>, target: f64) -> bool {
    let iterations = session.iterations();
    let error = match accuracy {
        Some(accuracy) => Some(accuracy.error(iterations)).filter(|_| accuracy.measured_at == iterations),
        None => progress.error,
    };
    // A scene without lights is black, without any error.
    let error = error.or(session.has_no_lights().then_some(0.0));
    iterations >= MIN_ITERATIONS_FOR_ERROR && error.is_some_and(|error| error <= target)
}
