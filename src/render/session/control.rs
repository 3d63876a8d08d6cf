//! Progress of a render, and the observer's answer to it.

use crate::render::account::ErrorCoverage;
use serde::Serialize;

/// Answer of an observer after an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Render another iteration.
    Continue,
    /// Stop and keep the picture.
    Stop,
    /// Stop because the target error is reached.
    Reached,
}

/// A smaller relative error, and the seconds until the render reaches it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ExpectedError {
    /// The relative error.
    pub error: f64,
    /// Seconds from now.
    pub seconds: f64,
}

/// State of a render after an iteration.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Iterations done.
    pub iteration: u64,
    /// Iterations of the render, if their number stops it.
    pub iterations: Option<u64>,
    /// Wall-clock seconds since the render began.
    pub seconds: f64,
    /// Estimated seconds to the end; `None` if neither iterations nor time stop the render.
    pub remaining: Option<f64>,
    /// Light paths emitted so far.
    pub light_paths: u64,
    /// Photons in the map of the last iteration.
    pub photons: usize,
    /// Estimated relative error (root of relMSE) of the method's own picture; `None` before two iterations and while the
    /// picture is black.
    pub error: Option<f64>,
    /// Which parts of the error that estimate includes.
    pub error_coverage: ErrorCoverage,
    /// Estimated relative error of the finished picture, if it has been measured. Shown instead of `error`.
    pub finished: Option<f64>,
    /// The next smaller error, if it is known when the render reaches it.
    pub expected: Option<ExpectedError>,
}
