//! Turns errors of the library into Python exceptions.

use caustique::error::{Error as Fault, ErrorKind};
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyUserWarning};
use pyo3::prelude::*;

create_exception!(
    caustique,
    Error,
    PyException,
    "An error of the renderer. str() has place, cause and remedy; `hint` is the remedy or None, `place` the file and \
     the place in it, `kind` one of 'usage', 'scene', 'image', 'io', 'library', 'model' and 'interrupted'."
);
create_exception!(
    caustique,
    SceneWarning,
    PyUserWarning,
    "Something in the scene is ignored or approximated, or looks like a mistake."
);

/// The Python exception for an error of the library.
pub fn raised(fault: Fault) -> PyErr {
    Python::attach(|py| {
        let (hint, cause) = (fault.hint.as_deref().map(in_python), in_python(&fault.cause));
        // The place "command line" means nothing in Python; the cause names the argument.
        let place = if fault.place == "command line" { String::new() } else { in_python(&fault.place) };
        let shown = Fault::new(fault.kind, &place, cause);
        let advice = hint.as_ref().map(|hint| format!("\nhint: {hint}")).unwrap_or_default();
        let error = Error::new_err(format!("{shown}{advice}"));
        let value = error.value(py);
        let set = value
            .setattr("hint", hint)
            .and_then(|()| value.setattr("place", place))
            .and_then(|()| value.setattr("kind", name(fault.kind)));
        set.err().unwrap_or(error)
    })
}

/// Options of the command line, and the Python arguments that have other names for them.
const RENAMED: [(&str, &str); 7] = [
    ("no-combine", "finish=False"),
    ("no-finish", "finish=False"),
    ("frames", "frame"),
    ("env", "environment"),
    ("env-rotation", "environment_rotation"),
    ("env-strength", "environment_strength"),
    ("png", "save"),
];

/// Options that error messages name together with a value.
const WITH_VALUE: [&str; 2] = ["method", "indirect"];

/// Splits a text behind its leading letters and digits.
fn split_word(text: &str) -> (&str, &str) {
    text.split_at(text.find(|c: char| !c.is_alphanumeric()).unwrap_or(text.len()))
}

/// Replaces options of the command line in a message by Python arguments: `--max-depth` by `max_depth`.
pub fn in_python(text: &str) -> String {
    let is_name = |c: char| c.is_ascii_lowercase() || c == '-';
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find("--") {
        let (before, option) = (&rest[..at], &rest[at + 2..]);
        let name = option.split(|c| !is_name(c)).next().unwrap_or("").trim_end_matches('-');
        out.push_str(before);
        // Dashes within a name of a file or a node start no option.
        let stands_alone = !before.ends_with(|c: char| c.is_alphanumeric() || "-_/.".contains(c));
        if stands_alone && name.starts_with(|c: char| c.is_ascii_lowercase()) {
            let renamed = RENAMED.iter().find(|(from, _)| *from == name).map(|(_, to)| (*to).to_owned());
            out.push_str(&renamed.unwrap_or_else(|| name.replace('-', "_")));
            rest = &option[name.len()..];
            // Quote the value that follows.
            if let Some((value, after)) = rest.strip_prefix(' ').filter(|_| WITH_VALUE.contains(&name)).map(split_word)
            {
                out.push_str(&format!("='{value}'"));
                rest = after;
            }
        } else {
            out.push_str("--");
            rest = option;
        }
    }
    out + rest
}

/// The Python exception for wrong arguments of a call, with the cause and a hint.
pub fn usage(cause: impl std::fmt::Display, hint: impl std::fmt::Display) -> PyErr {
    raised(Fault::new(ErrorKind::Usage, "", cause).hint(hint))
}

fn name(kind: ErrorKind) -> &'static str {
    match kind {
        ErrorKind::Usage => "usage",
        ErrorKind::Scene => "scene",
        ErrorKind::Image => "image",
        ErrorKind::Io => "io",
        ErrorKind::Library => "library",
        ErrorKind::Model => "model",
        ErrorKind::Interrupted => "interrupted",
    }
}

#[cfg(test)]
mod tests {
    use super::in_python;

    #[test]
    fn options_become_arguments() {
        for (text, expected) in [
            ("give fewer --photons, or --no-combine", "give fewer photons, or finish=False"),
            ("--max-depth: 0 (--env-rotation decides)", "max_depth: 0 (environment_rotation decides)"),
            ("use a smaller --width and --height.", "use a smaller width and height."),
            ("render with '--compression none'", "render with 'compression none'"),
            ("a--b.glb: /x/--seed, a -- b, --", "a--b.glb: /x/--seed, a -- b, --"),
            ("leave it out, or choose --method sppm.", "leave it out, or choose method='sppm'."),
            ("", ""),
        ] {
            assert_eq!(in_python(text), expected);
        }
    }
}
