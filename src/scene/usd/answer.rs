//! Parses the output of the converter: options on stdout, or an error on stderr.

use crate::error::{Error, ErrorKind, Result};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

/// Longest text of another program in a message, in characters.
const MAX_LENGTH: usize = 500;

/// An error as the USD converter prints it, in JSON.
#[derive(Deserialize)]
struct Fault {
    prim: String,
    fault: String,
    hint: Option<String>,
}

/// The options of `caustique render` that the USD converter printed for a stage.
///
/// # Errors
/// The converter printed something else.
pub fn options(printed: &[u8], stage: &Path) -> Result<Vec<String>> {
    parse(printed, stage, "options")
}

/// The files that the USD converter printed: those that the stage is read from or names, the stage included.
///
/// # Errors
/// The converter printed something else.
pub fn files(printed: &[u8], stage: &Path) -> Result<Vec<PathBuf>> {
    parse(printed, stage, "files")
}

fn parse<T: DeserializeOwned>(printed: &[u8], stage: &Path, what: &str) -> Result<T> {
    serde_json::from_slice(printed).map_err(|cause| {
        Error::new(ErrorKind::Scene, stage.display(), format!("the converter printed no {what}: {cause}"))
    })
}

/// The error for a stage whose converter failed and printed `stderr`.
pub fn failure(stderr: &[u8], stage: &Path) -> Error {
    let stderr = String::from_utf8_lossy(stderr);
    let fault = stderr.lines().rev().find_map(|line| serde_json::from_str::<Fault>(line).ok());
    let Some(Fault { prim, fault, hint }) = fault else {
        let last = stderr.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("it says nothing");
        let shortened: String = last.trim().chars().take(MAX_LENGTH).collect();
        let cause = format!("the converter (scripts/usd) failed: {shortened}");
        return Error::new(ErrorKind::Scene, stage.display(), cause).hint("'caustique doctor' lists what is found");
    };
    Error { hint, ..Error::new(ErrorKind::Scene, prim, fault).within(stage.display()) }
}
