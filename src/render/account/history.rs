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
    /// The time is up.
    Time,
    /// The estimated error is reached.
    Error,
    /// The observer stopped it.
    Interrupted,
}

/// One moment of a render's history.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct History {
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Processor seconds of the whole process.
    pub cpu_seconds: f64,
    /// Iterations done.
    pub iterations: u64,
    /// Light paths emitted.
    pub light_paths: u64,
    /// Estimated squared relative error, when two iterations are done.
    pub estimate: Option<ErrorEstimate>,
    /// The error of the picture finished from half of these iterations, where it was judged.
    pub finished: Option<FinishedError>,
}
