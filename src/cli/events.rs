//! `--progress json`: every message on stderr is an event, a JSON object on a line. docs/farms.md lists the events.

use super::{is_control, write_line};
use caustique::error::Error;
use serde::Serialize;
use serde_json::json;
use std::borrow::Cow;
use std::ffi::OsString;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Version of the events. It grows when a key is renamed or removed, not when one is added.
const VERSION: u32 = 1;

/// Whether messages are events.
static IN_USE: AtomicBool = AtomicBool::new(false);

/// An event with its own keys first.
#[derive(Serialize)]
struct Line<'a, Fields: Serialize> {
    #[serde(flatten)]
    fields: Fields,
    event: &'a str,
    version: u32,
}

/// Makes all messages events if the last `--progress` of a command line asks for JSON, or if another program sends the
/// commands. Errors of the command line are events, too.
pub fn use_if_asked(arguments: impl Iterator<Item = OsString>) {
    let mut form = None;
    let mut arguments = arguments.map(|word| word.to_string_lossy().into_owned());
    let serves = arguments.by_ref().nth(1).is_some_and(|command| command == "serve");
    while let Some(word) = arguments.next() {
        match word.strip_prefix("--progress") {
            Some("") => form = arguments.next(),
            Some(value) => form = value.strip_prefix('=').map(str::to_owned).or(form),
            None => {}
        }
    }
    IN_USE.store(serves || form.as_deref() == Some("json"), Ordering::Relaxed);
}

/// Whether messages are events.
pub fn are_in_use() -> bool {
    IN_USE.load(Ordering::Relaxed)
}

/// A path as a value of an event. The value of `json!` must be valid UTF-8, which paths need not be.
pub fn path(path: &Path) -> Cow<'_, str> {
    path.to_string_lossy()
}

/// Prints an event with its fields as a line of JSON, with `--progress json`; does nothing otherwise.
pub fn print(event: &str, fields: impl Serialize) {
    if !are_in_use() {
        return;
    }
    if let Ok(line) = serde_json::to_string(&Line { fields, event, version: VERSION }) {
        write_line(&escaped(&line));
    }
}

/// Prints a message as an event: a warning, or a note.
pub fn print_message(line: &str) {
    match line.strip_prefix("warning: ") {
        Some(message) => print("warning", json!({"message": message})),
        None => print("note", json!({"message": line})),
    }
}

/// Prints the event of an error that ends the program.
pub fn print_error(error: &Error) {
    let Error { hint, .. } = error;
    print("error", json!({"message": error.to_string(), "hint": hint, "exit_code": error.exit_code()}));
}

/// JSON with control characters, which occur only within strings, as escapes. Line breaks between elements stay.
pub fn escaped(json: &str) -> String {
    let escape = |c: char| if c != '\n' && is_control(c) { format!("\\u{:04x}", c as u32) } else { c.to_string() };
    json.chars().map(escape).collect()
}
