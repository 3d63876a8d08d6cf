//! What is measured.

use crate::image::Errors;
use crate::render::{Phases, TimeSpent};

/// A curve measured at a moment.
#[derive(Clone, Debug)]
pub struct Point {
    /// Which curve of [`Outcome::lines`](super::equal_time::Outcome), from 0.
    pub line: usize,
    /// Its seed.
    pub seed: u64,
    /// Iterations done; samples per pixel of other renderers.
    pub iterations: u64,
    /// Light paths emitted.
    pub light_paths: u64,
    /// Wall-clock seconds, the finish's included, were it to stop here.
    pub seconds: f64,
    /// Processor seconds, likewise.
    pub cpu_seconds: f64,
    /// Wall-clock seconds of the finish and its layers, of finished pictures: the median of all its uses with this
    /// seed, which do the same work; or of denoising another renderer's picture.
    pub finish_seconds: Option<f64>,
    /// Its error as measured against the reference, the reference's own included.
    pub errors: Errors,
    /// The squared relative error that it estimates itself, of estimates.
    pub estimate: Option<f64>,
    /// Number of the picture among those that are kept.
    pub picture: Option<u64>,
}

/// Where a run's time went.
#[derive(Clone, Debug)]
pub struct RunEnd {
    /// Which entry, from 0.
    pub run: usize,
    /// Its seed.
    pub seed: u64,
    /// Iterations done.
    pub iterations: u64,
    /// Time of pilot and iterations.
    pub spent: TimeSpent,
    /// Core-seconds by phase.
    pub phases: Phases,
    /// Time of the finish: the median of its uses.
    pub finish: Option<TimeSpent>,
}
