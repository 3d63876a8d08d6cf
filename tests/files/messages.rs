//! Every message of the loaders, word by word. Each has a case (`scene`, `image`, `state`) in a snapshot in
//! `tests/files/messages/snapshots`. `sources` searches the code for messages without a case.
//!
//! `cargo insta review` or `INSTA_UPDATE=always cargo test` accepts changes.

mod image;
mod scene;
mod sources;
mod state;
mod validator;

use caustique::error::Error;

/// The messages of cases: a title per case and its messages.
#[derive(Default)]
struct Said(String);

impl Said {
    fn case(&mut self, what: &str, lines: &[String]) {
        self.0 += &format!("# {what}\n{}\n\n", lines.join("\n"));
    }
}

/// An error as the command line prints it.
fn message(error: &Error) -> String {
    error.hint.as_ref().map_or_else(|| error.to_string(), |hint| format!("{error}\nhint: {hint}"))
}

/// The cases without messages.
fn silent(said: &str) -> Vec<&str> {
    let cases = said.split("# ").skip(1);
    cases.filter(|case| case.trim_end().lines().count() < 2).map(str::trim_end).collect()
}

/// All messages of all cases.
fn everything_said() -> String {
    [scene::said(), image::said(), state::said()].concat()
}
