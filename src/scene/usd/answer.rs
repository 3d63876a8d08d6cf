//! What the converter answers besides its .glb: options, or a fault.

use crate::error::{Error, ErrorKind, Result};
use serde::Deserialize;
use std::path::Path;

/// A fault, as the converter tells it.
#[derive(Deserialize)]
struct Fault {
    prim: String,
    fault: String,
    hint: Option<String>,
}

/// The options of `caustique render` that the converter prints about a stage.
///
/// # Errors
/// It prints something else.
pub fn options(printed: &[u8], stage: &Path) -> Result<Vec<String>> {
    serde_json::from_slice(printed).map_err(|cause| {
        Error::new(ErrorKind::Scene, stage.display(), format!("the converter does not say options: {cause}"))
    })
}

/// The error that a converter that failed has told about a stage.
pub fn failure(told: &[u8], stage: &Path) -> Error {
    let told = String::from_utf8_lossy(told);
    let fault = told.lines().rev().find_map(|line| serde_json::from_str::<Fault>(line).ok());
    let Some(Fault { prim, fault, hint }) = fault else {
        let last = told.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("it says nothing");
        let cause = format!("the converter (scripts/usd) failed: {}", last.trim());
        return Error::new(ErrorKind::Scene, stage.display(), cause).hint("'caustique doctor' says what is found");
    };
    Error { hint, ..Error::new(ErrorKind::Scene, prim, fault).within(stage.display()) }
}
