//! Progress of a render, and the observer's answer to it.

use crate::render::account::ErrorCoverage;
use serde::Serialize;

/// Answer of an observer after an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// The render continues with another iteration.
    Continue,
    /// The render stops and keeps its picture.
    Stop,
    /// The render stops because the target error is reached.
    Reached,
}

/// A smaller relative error than the current one, and the time until the render reaches it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ExpectedError {
    /// The relative error that is expected.
    pub error: f64,
    /// Seconds from now until the render reaches the error.
    pub seconds: f64,
}

/// State of a render after an iteration.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Number of iterations done.
    pub iteration: u64,
    /// Number of iterations that end the render; `None` if their number does not stop it.
    pub iterations: Option<u64>,
    /// Wall-clock seconds since the render began.
    pub seconds: f64,
    /// Estimated seconds to the end; `None` if neither iterations nor time stop the render.
    pub remaining: Option<f64>,
    /// Light paths emitted so far.
    pub light_paths: u64,
    /// Number of photons in the map of the last iteration.
    pub photons: usize,
    /// Estimated relative error (root of relMSE) of the method's own picture; `None` before two iterations and while the
    /// picture is black.
    pub error: Option<f64>,
    /// Which parts of the error that estimate includes.
    pub error_coverage: ErrorCoverage,
    /// Estimated relative error of the finished (combined and denoised) picture; `None` if it has not been measured.
    /// Reports show it instead of `error`.
    pub finished: Option<f64>,
    /// The next smaller error with the time until the render reaches it; `None` if that time is not known.
    pub expected: Option<ExpectedError>,
}
