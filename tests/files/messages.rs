//! Every message of the loaders, word by word: a case for each (`scene`, `image`, `state`) is kept in
//! `tests/files/messages/snapshots`, and `sources` looks through the code for messages that no case brings up.
//!
//! `cargo insta review`, or `INSTA_UPDATE=always cargo test`, takes over what a change has changed.

mod image;
mod scene;
mod sources;
mod state;
mod validator;

use caustique::error::Error;

/// What is said of cases: a line with what each is, and what was said.
#[derive(Default)]
struct Said(String);

impl Said {
    fn case(&mut self, what: &str, lines: &[String]) {
        self.0 += &format!("# {what}\n{}\n\n", lines.join("\n"));
    }
}

/// An error as the command line shows it.
fn message(error: &Error) -> String {
    error.hint.as_ref().map_or_else(|| error.to_string(), |hint| format!("{error}\nhint: {hint}"))
}

/// The cases of which nothing is said.
fn silent(said: &str) -> Vec<&str> {
    let cases = said.split("# ").skip(1);
    cases.filter(|case| case.trim_end().lines().count() < 2).map(str::trim_end).collect()
}

/// All that is said of all cases.
fn everything_said() -> String {
    [scene::said(), image::said(), state::said()].concat()
}
