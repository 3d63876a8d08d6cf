//! `caustique completions`, `caustique man` and `caustique options`: the command line as shell completions, as manual
//! pages and as JSON.

use super::{print, print_json};
use caustique::error::{Error, ErrorKind, Result};
use caustique::options::catalogue::describe;
use clap::Command;
use clap_complete::Shell;
use serde_json::json;

/// Print a script that completes commands and options in a shell.
///
/// For bash: caustique completions bash > ~/.local/share/bash-completion/completions/caustique
#[derive(clap::Args)]
pub struct CompletionsArgs {
    /// Shell
    #[arg(value_enum)]
    shell: Shell,
}

/// Print a page of the manual.
///
/// To read one: caustique man render | man -l -
#[derive(clap::Args)]
pub struct ManArgs {
    /// Command [default: the page of the program]
    command: Option<String>,
}

/// Prints a description of the options of `render` as JSON.
pub fn options(whole: &Command) -> Result<()> {
    let options = whole.find_subcommand("render").map(describe).unwrap_or_default();
    print_json(&json!({"render": options}))
}

/// Prints the completions of the whole command line.
pub fn complete(args: &CompletionsArgs, mut whole: Command) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut whole, "caustique", &mut script);
    print(&String::from_utf8_lossy(&script))
}

/// Prints a page of the manual.
pub fn man(args: &ManArgs, mut whole: Command) -> Result<()> {
    whole.build();
    let page = match &args.command {
        None => &whole,
        Some(name) => whole.find_subcommand(name).ok_or_else(|| {
            let error = Error::usage(format!("there is no command '{name}'"));
            error.hint("'caustique --help' lists the commands")
        })?,
    };
    let mut text = Vec::new();
    let rendered = clap_mangen::Man::new(page.clone()).render(&mut text);
    rendered.map_err(|error| Error::new(ErrorKind::Io, "manual", error))?;
    print(&String::from_utf8_lossy(&text))
}
