//! Parses the output of a converter: options on stdout, or an error on stderr.

use crate::error::{Error, ErrorKind, Result};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

/// Longest text of another program in a message, in characters.
const MAX_LENGTH: usize = 500;

/// An error as a converter prints it, in JSON.
#[derive(Deserialize)]
struct Fault {
    /// The place in the scene file, such as a prim; empty for the whole file.
    #[serde(alias = "prim")]
    place: String,
    fault: String,
    hint: Option<String>,
}

/// The options of `caustique render` that a converter printed for a scene file.
///
/// # Errors
/// The converter printed something else.
pub fn options(printed: &[u8], scene: &Path) -> Result<Vec<String>> {
    parse(printed, scene, "options")
}

/// The files that a converter printed: those that the scene is read from or names, the scene file included.
///
/// # Errors
/// The converter printed something else.
pub fn files(printed: &[u8], scene: &Path) -> Result<Vec<PathBuf>> {
    parse(printed, scene, "files")
}

/// Parses the last line, because Blender prints lines of its own before it.
fn parse<T: DeserializeOwned>(printed: &[u8], scene: &Path, what: &str) -> Result<T> {
    let last = printed.trim_ascii_end().rsplit(|byte| *byte == b'\n').next().unwrap_or_default();
    serde_json::from_slice(last).map_err(|cause| {
        Error::new(ErrorKind::Scene, scene.display(), format!("the converter printed no {what}: {cause}"))
    })
}

/// The error for a scene file whose converter, the scripts in `scripts`, failed and printed `stderr`.
pub fn failure(stderr: &[u8], scene: &Path, scripts: &str) -> Error {
    let stderr = String::from_utf8_lossy(stderr);
    let fault = stderr.lines().rev().find_map(|line| serde_json::from_str::<Fault>(line).ok());
    let Some(Fault { place, fault, hint }) = fault else {
        let last = stderr.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("it says nothing");
        let shortened: String = last.trim().chars().take(MAX_LENGTH).collect();
        let cause = format!("the converter ({scripts}) failed: {shortened}");
        return Error::new(ErrorKind::Scene, scene.display(), cause).hint("'caustique doctor' lists what is found");
    };
    let whole = place.is_empty();
    let error = Error { hint, ..Error::new(ErrorKind::Scene, place, fault) };
    if whole { Error { place: scene.display().to_string(), ..error } } else { error.within(scene.display()) }
}
