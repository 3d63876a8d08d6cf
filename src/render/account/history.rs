//! The estimated error of a render against time, and why the render stopped.

use super::error_estimate::ErrorEstimate;
use crate::finish::FinishedError;
use serde::{Deserialize, Serialize};

/// Why a render stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// The render has done all iterations of its settings.
    Iterations,
    /// The time limit of the render has passed.
    Time,
    /// The estimated error has reached its target.
    Error,
    /// The observer, which receives the progress, has stopped the render.
    Interrupted,
}

/// State of a render at one moment of its error history.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct HistoryEntry {
    /// Wall-clock seconds since the render began.
    pub seconds: f64,
    /// Processor seconds of the whole process that the render has taken so far.
    pub cpu_seconds: f64,
    /// Iterations done so far.
    pub iterations: u64,
    /// Light paths emitted so far.
    pub light_paths: u64,
    /// Estimated squared relative error; `None` before two iterations and while the picture is black.
    pub estimate: Option<ErrorEstimate>,
    /// Measured error of the picture finished from half of these iterations, at moments where it was measured.
    pub finished: Option<FinishedError>,
}
