//! The library's errors as Python's.

use caustique::error::{Error as Fault, Kind};
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyUserWarning};
use pyo3::prelude::*;

create_exception!(
    caustique,
    Error,
    PyException,
    "What the renderer refuses: str() tells place, fault and remedy; `hint` is the remedy alone or None, `place` the \
     file and the place in it, `kind` one of 'usage', 'scene', 'image', 'io', 'library', 'model' and 'interrupted'."
);
create_exception!(
    caustique,
    SceneWarning,
    PyUserWarning,
    "Something in the scene is ignored or approximated, or looks like a mistake."
);

/// A fault as the exception that tells of it.
pub fn raised(fault: Fault) -> PyErr {
    Python::attach(|py| {
        // Python has no command line; the cause names the option.
        let shown = if fault.place == "command line" { fault.cause.clone() } else { fault.to_string() };
        let hint = fault.hint.as_ref().map(|hint| format!("\nhint: {hint}")).unwrap_or_default();
        let error = Error::new_err(format!("{shown}{hint}"));
        let value = error.value(py);
        let told = value
            .setattr("hint", &fault.hint)
            .and_then(|()| value.setattr("place", &fault.place))
            .and_then(|()| value.setattr("kind", name(fault.kind)));
        told.err().unwrap_or(error)
    })
}

/// An error of a call's arguments.
pub fn usage(cause: impl std::fmt::Display, hint: impl std::fmt::Display) -> PyErr {
    raised(Fault::new(Kind::Usage, "", cause).hint(hint))
}

fn name(kind: Kind) -> &'static str {
    match kind {
        Kind::Usage => "usage",
        Kind::Scene => "scene",
        Kind::Image => "image",
        Kind::Io => "io",
        Kind::Library => "library",
        Kind::Model => "model",
        Kind::Interrupted => "interrupted",
    }
}
