//! The progress of a render, for callbacks.

use caustique::pipeline::FINISHED_PICTURE;
use pyo3::prelude::*;

/// The state of a render after an iteration.
#[pyclass(frozen, get_all, module = "caustique")]
pub struct Progress {
    /// Number of finished iterations.
    pub iteration: u64,
    /// Number of iterations after which the render ends; None if another limit ends it.
    pub iterations: Option<u64>,
    /// Wall-clock seconds since the start of the render.
    pub seconds: f64,
    /// Estimated remaining seconds, if known.
    pub remaining: Option<f64>,
    /// Light paths emitted so far.
    pub light_paths: u64,
    /// Estimated relative error (the root of relMSE), if known.
    pub error: Option<f64>,
    /// Subject of `error`: 'finished picture', or the parts of the estimate's error that it includes.
    pub error_of: &'static str,
}

#[pymethods]
impl Progress {
    fn __repr__(&self) -> String {
        let of = self.iterations.map(|n| format!(" of {n}")).unwrap_or_default();
        format!("<caustique.Progress: iteration {}{of}, {:.1} s>", self.iteration, self.seconds)
    }
}

impl From<&caustique::render::Progress> for Progress {
    fn from(progress: &caustique::render::Progress) -> Progress {
        let caustique::render::Progress { iteration, iterations, seconds, remaining, light_paths, .. } = *progress;
        let error = progress.finished.or(progress.error);
        let error_of = if progress.finished.is_some() { FINISHED_PICTURE } else { progress.error_coverage.name() };
        Progress { iteration, iterations, seconds, remaining, light_paths, error, error_of }
    }
}
