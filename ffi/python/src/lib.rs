//! `caustique._native`: the Python bindings. The Python part of the package is in `caustique/`.
//!
//! Renders run in separate threads without the interpreter's lock. The calling thread handles signals and callbacks
//! meanwhile (`work`).

mod compare;
mod converge;
mod error;
mod finish;
mod image;
mod keywords;
mod libraries;
mod merge;
mod options;
mod progress;
mod scene;
mod value;
mod work;

use pyo3::prelude::*;

/// The native part of the package caustique.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::compare::compare;
    #[pymodule_export]
    use super::error::{Error, SceneWarning};
    #[pymodule_export]
    use super::finish::{FinishedFrames, finish, finish_frames};
    #[pymodule_export]
    use super::image::{Image, read};
    #[pymodule_export]
    use super::libraries::find_libraries;
    #[pymodule_export]
    use super::merge::merge;
    #[pymodule_export]
    use super::progress::Progress;
    #[pymodule_export]
    use super::scene::Scene;
    use super::{PyModule, PyResult, error};
    use pyo3::prelude::*;

    #[pymodule_init]
    fn start(module: &Bound<'_, PyModule>) -> PyResult<()> {
        caustique::processor::check().map_err(error::raised)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
