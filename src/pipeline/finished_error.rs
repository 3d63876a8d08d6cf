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

/// Number of error estimates of a render that reaches its target error after `iterations` iterations: one each time that
/// their number has grown by a factor of the root of two ([`Session::is_recorded`]).
pub(super) fn estimates_until(iterations: f64) -> f64 {
    1.0 + (2.0 * (iterations / MIN_ITERATIONS_FOR_ERROR as f64).log2()).max(0.0).floor()
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::SQRT_2;

    /// The number of estimates is that of the recorded moments until then, or one more.
    #[test]
    fn estimates_are_as_many_as_recorded_moments() {
        let mut moments = vec![1u64];
        while *moments.last().unwrap() < 10_000 {
            moments.push((*moments.last().unwrap() as f64 * SQRT_2).ceil() as u64);
        }
        for iterations in [1, MIN_ITERATIONS_FOR_ERROR, 11, 16, 100, 9999] {
            let until = iterations.max(MIN_ITERATIONS_FOR_ERROR);
            let recorded =
                moments.iter().filter(|&&at| (MIN_ITERATIONS_FOR_ERROR..=until).contains(&at)).count() as f64;
            let more = estimates_until(iterations as f64) - recorded;
            assert!((0.0..=1.0).contains(&more), "{iterations}: {recorded} and {more}");
        }
    }
}
