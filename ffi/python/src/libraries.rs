//! The libraries that are loaded when they are needed.

use caustique::combine::Runtime;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::Path;

/// Version and file of a library, or why it is not found and how to get it.
type Finding = Result<(String, String), (String, Option<String>)>;

/// find_libraries() -> dict: Embree, Open Image Denoise and ONNX Runtime as they are found.
#[pyfunction]
pub fn find_libraries(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let show = |path: &Path| path.display().to_string();
    let found = py.detach(|| {
        let embree: Finding = match caustique_embree::Library::load() {
            Ok(library) => Ok((library.version().to_string(), show(library.path()))),
            Err(error) => Err((error.to_string(), error.hint())),
        };
        let oidn: Finding = match caustique_oidn::Library::load() {
            Ok(library) => Ok((library.version().to_string(), show(library.path()))),
            Err(error) => Err((error.to_string(), error.hint())),
        };
        let onnxruntime: Finding = match Runtime::find() {
            Ok(runtime) => Ok((runtime.version().unwrap_or("1.17 or later").to_string(), show(runtime.path()))),
            Err(error) => Err((error.to_string(), error.hint)),
        };
        [("embree", embree), ("oidn", oidn), ("onnxruntime", onnxruntime)]
    });
    let all = PyDict::new(py);
    for (name, finding) in found {
        let one = PyDict::new(py);
        one.set_item("found", finding.is_ok())?;
        match finding {
            Ok((version, path)) => {
                one.set_item("version", version)?;
                one.set_item("path", path)?;
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
