//! `caustique._native`: the library as Python sees it. The package around it, with what is plain Python, is in
//! `caustique/`.
//!
//! Work is done in threads of its own with the interpreter's lock released; what is to be done in Python meanwhile, the
//! calling thread does (`work`).

mod compare;
mod converge;
mod error;
mod image;
mod job;
mod keywords;
mod libraries;
mod merge;
mod progress;
mod scene;
mod value;
mod work;

use pyo3::prelude::*;

/// The native part of the package caustique.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::compare::{compare, finish};
    #[pymodule_export]
    use super::error::{Error, SceneWarning};
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
