//! Measurements and times of runs.

use crate::image::Errors;
use crate::render::{Phases, TimeSpent};

/// A measurement: the error of one picture.
#[derive(Clone, Debug)]
pub struct Point {
    /// Index of the picture's curve in [`Outcome::lines`](super::equal_time::Outcome::lines).
    pub line: usize,
    /// Seed of the picture's run.
    pub seed: u64,
    /// Iterations done for the picture; samples per pixel for other renderers.
    pub iterations: u64,
    /// Number of light paths emitted for the picture.
    pub light_paths: u64,
    /// Wall-clock seconds of a run that ends here, including the finish.
    pub seconds: f64,
    /// Core-seconds of a run that ends here, including the finish.
    pub cpu_seconds: f64,
    /// Wall-clock seconds of the finish, for finished pictures: the median over the run, because every finish does the
    /// same work. For denoised pictures of other renderers, seconds of the denoiser.
    pub finish_seconds: Option<f64>,
    /// Errors of the picture against the reference, including the reference's own error.
    pub errors: Errors,
    /// Squared relative error that the render has estimated itself, without the reference; `None` for finished
    /// pictures.
    pub estimate: Option<f64>,
    /// Number of the picture in the comparison's store of pictures; `None` if it is not stored.
    pub picture: Option<u64>,
}

/// Times of the run of an entry with one seed, at its end.
#[derive(Clone, Debug)]
pub struct RunEnd {
    /// Index of the run's entry.
    pub run: usize,
    /// Seed of the run.
    pub seed: u64,
    /// Iterations done.
    pub iterations: u64,
    /// Time of the pilot, the preparation by test renders, and of the iterations.
    pub spent: TimeSpent,
    /// Core-seconds by phase of the render.
    pub phases: Phases,
    /// Median time of the finish of a picture; `None` without a finish.
    pub finish: Option<TimeSpent>,
}
