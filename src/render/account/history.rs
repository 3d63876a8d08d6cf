//! The estimated error of a render against time, and why the render stopped.

use super::error_estimate::ErrorEstimate;
use crate::finish::FinishedError;
use serde::{Deserialize, Serialize};

/// Why a render stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// All iterations are done.
    Iterations,
    /// The time limit has passed.
    Time,
    /// The estimated error has reached its target.
    Error,
    /// The observer stopped the render.
    Interrupted,
}

/// State of a render at one moment of its history.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct HistoryEntry {
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Processor seconds of the whole process.
    pub cpu_seconds: f64,
    /// Iterations done.
    pub iterations: u64,
    /// Light paths emitted.
    pub light_paths: u64,
    /// Estimated squared relative error; `None` before two iterations and while the picture is black.
    pub estimate: Option<ErrorEstimate>,
    /// Measured error of the picture finished from half of these iterations, at moments where it was measured.
    pub finished: Option<FinishedError>,
}
