//! Finds the libraries that are loaded on demand.

use caustique::combine::Runtime;
use caustique::finish::denoiser;
use caustique::trace;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::Path;

/// Version, file and origin of a library that was found; or why it was not found, and how to install it.
type Finding = Result<(String, String, &'static str), (String, Option<String>)>;

/// find_libraries() -> dict: where Embree, Open Image Denoise and ONNX Runtime were found.
#[pyfunction]
pub fn find_libraries(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let show = |path: &Path| path.display().to_string();
    let found = py.detach(|| {
        let embree: Finding = match trace::library() {
            Ok(library) => Ok((library.version().to_string(), show(library.path()), trace::origin(&library))),
            Err(error) => Err((error.to_string(), error.hint())),
        };
        let oidn: Finding = match denoiser::library() {
            Ok(library) => Ok((library.version().to_string(), show(library.path()), denoiser::origin(&library))),
            Err(error) => Err((error.to_string(), error.hint())),
        };
        let onnxruntime: Finding = match Runtime::find() {
            Ok(runtime) => {
                let version = runtime.version().unwrap_or("1.17 or later").to_string();
                Ok((version, show(runtime.path()), runtime.origin()))
            }
            Err(error) => Err((error.to_string(), error.hint)),
        };
        [("embree", embree), ("oidn", oidn), ("onnxruntime", onnxruntime)]
    });
    let all = PyDict::new(py);
    for (name, finding) in found {
        let one = PyDict::new(py);
        one.set_item("found", finding.is_ok())?;
        match finding {
            Ok((version, path, origin)) => {
                one.set_item("version", version)?;
                one.set_item("path", path)?;
                one.set_item("from", origin)?;
            }
            Err((cause, hint)) => {
                one.set_item("cause", cause)?;
                one.set_item("hint", hint)?;
            }
        }
        all.set_item(name, one)?;
    }
    Ok(all)
}
