//! Measurements and times of runs.

use crate::image::Errors;
use crate::render::{Phases, TimeSpent};

/// A measurement: the error of one picture.
#[derive(Clone, Debug)]
pub struct Point {
    /// Index of the curve in [`Outcome::lines`](super::equal_time::Outcome::lines).
    pub line: usize,
    /// Seed of the run.
    pub seed: u64,
    /// Iterations done; samples per pixel for other renderers.
    pub iterations: u64,
    /// Light paths emitted.
    pub light_paths: u64,
    /// Wall-clock seconds of a run that ends here, including the finish.
    pub seconds: f64,
    /// Core-seconds of a run that ends here, including the finish.
    pub cpu_seconds: f64,
    /// Wall-clock seconds of the finish, for finished pictures: the median over the run, because every finish does the
    /// same work. For denoised pictures of other renderers, seconds of the denoiser.
    pub finish_seconds: Option<f64>,
    /// Error against the reference, including the reference's own error.
    pub errors: Errors,
    /// Squared relative error that the render has estimated itself; for estimates that are not finished.
    pub estimate: Option<f64>,
    /// Number of the picture in the store, if it is stored.
    pub picture: Option<u64>,
}

/// Times of a run at its end.
#[derive(Clone, Debug)]
pub struct RunEnd {
    /// Index of the entry.
    pub run: usize,
    /// Seed of the run.
    pub seed: u64,
    /// Iterations done.
    pub iterations: u64,
    /// Time of pilot and iterations.
    pub spent: TimeSpent,
    /// Core-seconds by phase.
    pub phases: Phases,
    /// Median time of the finish.
    pub finish: Option<TimeSpent>,
}
