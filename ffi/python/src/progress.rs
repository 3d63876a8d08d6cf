//! How far a render is.

use pyo3::prelude::*;

/// The state of a render after an iteration.
#[pyclass(frozen, get_all, module = "caustique")]
pub struct Progress {
    /// Iterations done.
    pub iteration: u64,
    /// Iterations asked for, where that is what ends the render; else None.
    pub iterations: Option<u64>,
    /// Wall-clock seconds since the render began.
    pub seconds: f64,
    /// Estimated seconds to go, where that can be told.
    pub remaining: Option<f64>,
    /// Light paths emitted so far.
    pub light_paths: u64,
    /// Estimated relative error of the estimate (the root of relMSE); None before the second iteration.
    pub error: Option<f64>,
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
        let caustique::render::Progress { iteration, iterations, seconds, remaining, light_paths, error, .. } =
            *progress;
        Progress { iteration, iterations, seconds, remaining, light_paths, error }
    }
}
