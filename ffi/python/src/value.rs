//! Converts between JSON and Python objects with Python's module json.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::Value;

/// Converts a JSON value to Python objects.
pub fn to_python<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (value.to_string(),))
}

/// Converts keyword arguments to a JSON object. Objects that JSON does not have become their `str`.
pub fn to_json(arguments: &Bound<'_, PyDict>) -> PyResult<Value> {
    let py = arguments.py();
    let options = PyDict::new(py);
    options.set_item("default", py.import("builtins")?.getattr("str")?)?;
    options.set_item("sort_keys", true)?;
    let text: String = py.import("json")?.call_method("dumps", (arguments,), Some(&options))?.extract()?;
    // Python writes infinities, which are no valid JSON.
    Ok(serde_json::from_str(&text).unwrap_or(Value::String(text)))
}
