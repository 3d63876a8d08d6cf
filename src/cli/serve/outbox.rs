//! The answers of `caustique serve` on standard output: one JSON object per line, and pixels after the line of a picture.

use crate::cli::events::escaped;
use caustique::error::{Error, ErrorKind, Result};
use serde_json::{Value, json};
use std::io::Write;

/// Version of the protocol. It grows when a command or a key is renamed or removed, not when one is added.
pub const PROTOCOL: u32 = 1;

/// Writes an answer, followed by `pixels`.
///
/// # Errors
/// Standard output is closed.
pub fn send(event: &str, id: &Value, mut fields: Value, pixels: &[u8]) -> Result<()> {
    fields["event"] = event.into();
    if !id.is_null() {
        fields["id"] = id.clone();
    }
    let mut out = std::io::stdout().lock();
    let written = writeln!(out, "{}", escaped(&fields.to_string())).and_then(|()| out.write_all(pixels));
    written.and_then(|()| out.flush()).map_err(|cause| Error::new(ErrorKind::Io, "standard output", cause))
}

/// Answers that a command has failed. A closed output ends the program elsewhere.
pub fn error(id: &Value, error: &Error) {
    let _ = send("error", id, json!({"message": error.to_string(), "hint": error.hint}), &[]);
}

/// Answers that a picture was ended after this number of iterations.
pub fn stopped(id: &Value, iterations: u64) {
    let _ = send("stopped", id, json!({"iterations": iterations}), &[]);
}
