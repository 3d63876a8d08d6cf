//! Progress of a render, and what its observer answers.

use crate::render::account::ErrorCoverage;

/// What an observer wants after an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Go on.
    Continue,
    /// Stop here; what is finished is kept.
    Stop,
    /// Stop here: the error that was asked for is reached.
    Reached,
}

/// State after an iteration.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Iterations done.
    pub iteration: u64,
    /// Iterations asked for, when that is what stops the render.
    pub iterations: Option<u64>,
    /// Wall-clock seconds since the render began.
    pub seconds: f64,
    /// Estimated seconds to go, when that can be told.
    pub remaining: Option<f64>,
    /// Light paths emitted so far.
    pub light_paths: u64,
    /// Photons of the last map.
    pub photons: usize,
    /// Estimated relative error of the method's own image (root of relMSE), when two iterations are done and light is
    /// seen.
    pub error: Option<f64>,
    /// Which parts of the error that estimate includes.
    pub error_coverage: ErrorCoverage,
    /// Relative error of the picture as it would be delivered, in place of that above, where it is known.
    pub finished: Option<f64>,
    /// An error that is still to be reached, and in how many seconds it may be.
    pub expected: Option<(f64, f64)>,
}
