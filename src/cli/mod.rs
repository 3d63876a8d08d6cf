//! The command line: one file per command. Data goes to stdout, talk to stderr; only this file prints.

mod compare;
mod converge;
mod doctor;
mod finish;
mod info;
mod layout;
mod merge;
mod output;
mod plan;
mod plot;
mod progress;
mod render;
mod scene;
mod shell;
mod signals;
mod stage;
mod usage;

use caustique::error::{Error, ErrorKind, Result};
use caustique::processor;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use std::fs::File;
use std::io::Write;
use std::num::NonZero;
use std::os::fd::AsFd;
use std::path::Path;
use std::process::ExitCode;

/// Renders caustics, and caustics seen through glass, water and mirrors, with known error.
#[derive(Parser)]
#[command(name = "caustique", version, about, args_override_self = true, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Render a scene to a multichannel EXR, and to a PNG to look at
    Render(Box<render::RenderArgs>),
    /// Say which effects a scene calls for, which will be simulated, and why
    Plan(Box<plan::PlanArgs>),
    /// Finish a rendered EXR, also one of another renderer
    #[command(alias = "combine")]
    Finish(finish::FinishArgs),
    /// Put the shards of a render together, or renders of other seeds
    Merge(merge::MergeArgs),
    /// Measure the error of an image against a reference
    Compare(compare::CompareArgs),
    /// Compare methods and settings: accuracy against time
    Converge(Box<converge::ConvergeArgs>),
    /// Say what a scene or an EXR holds
    Info(info::InfoArgs),
    /// Say which Embree, ONNX Runtime, Open Image Denoise and USD are found, and what to install if not
    Doctor(doctor::DoctorArgs),
    /// Print what completes commands and options in a shell
    Completions(shell::CompletionsArgs),
    /// Print a page of the manual
    Man(shell::ManArgs),
    /// Print a description of the options of 'render' as JSON
    #[command(hide = true)]
    Options,
}

/// The whole command line.
fn command_line() -> clap::Command {
    let mut places = 0..;
    Cli::command().mut_subcommands(|command| {
        layout::with_help(layout::arrange(command)).display_order(places.next().unwrap_or_default())
    })
}

/// The command that the words of the command line begin with.
fn named(line: &clap::Command) -> Option<&clap::Command> {
    std::env::args_os().nth(1).and_then(|word| line.find_subcommand(word))
}

/// Runs the program and returns its exit code.
pub fn main() -> ExitCode {
    if let Err(error) = processor::check().and_then(|()| signals::survive_large_files()) {
        return fail(&error);
    }
    let mut line = command_line();
    let matches = line.try_get_matches_from_mut(std::env::args_os());
    let cli = match matches.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        Err(error) => match usage::explain(&error, named(&line)) {
            Some(error) => return fail(&error),
            None => {
                // Help and version were asked for: data, on stdout.
                return match error.print() {
                    Err(cause) if cause.kind() != std::io::ErrorKind::BrokenPipe => ExitCode::FAILURE,
                    _ => ExitCode::SUCCESS,
                };
            }
        },
    };
    let command = match stage::defaults(cli.command, &mut line) {
        Ok(command) => command,
        Err(error) => return fail(&error),
    };
    let result = match command {
        Command::Render(args) => render::run(&args),
        Command::Plan(args) => plan::run(&args),
        Command::Finish(args) => finish::run(&args),
        Command::Merge(args) => merge::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Converge(args) => converge::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Doctor(args) => doctor::run(&args),
        Command::Completions(args) => shell::complete(&args, command_line()),
        Command::Man(args) => shell::man(&args, command_line()),
        Command::Options => shell::options(&command_line()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => fail(&error),
    }
}

/// The two lines of an error, and its exit code.
fn fail(error: &Error) -> ExitCode {
    say(&error.to_string());
    if let Some(hint) = &error.hint {
        say(&format!("hint: {hint}"));
    }
    ExitCode::from(error.exit_code())
}

/// So many threads to a core are a slip.
const THREADS_PER_CORE: usize = 4;

/// Threads for everything that a command does; 0 takes all cores.
fn pool(threads: usize) -> Result<rayon::ThreadPool> {
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
    if threads > THREADS_PER_CORE * cores {
        say(&format!(
            "warning: --threads {threads}: there are {cores} cores: more threads take memory, and make nothing faster"
        ));
    }
    let builder = rayon::ThreadPoolBuilder::new().num_threads(threads);
    builder.build().map_err(|error| Error::new(ErrorKind::Io, "threads", error).hint("ask for fewer with --threads"))
}

/// Prints a line to stderr. Nobody may be listening any more (a closed pipe, a terminal that is gone): a render goes
/// on.
fn say(line: &str) {
    progress::beside_the_bar(|| {
        let _ = writeln!(std::io::stderr().lock(), "{}", printable(line));
    });
}

/// One line of text in which names of a scene cannot act on a terminal or begin a line of their own: what is not shown
/// but acted on (control characters, changes of direction) is shown as an escape such as `\u{1b}`.
fn printable(text: &str) -> String {
    text.chars().map(|c| if commands(c) { c.escape_default().to_string() } else { c.to_string() }).collect()
}

/// Whether a terminal does something for a character other than to show it.
fn commands(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Prints data to stdout. A reader that has closed the pipe wants no more: that is no error.
fn print(text: &str) -> Result<()> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::new(ErrorKind::Io, "standard output", error))
        }
        _ => Ok(()),
    }
}

/// Sends a file to stdout.
fn print_file(path: &Path) -> std::io::Result<()> {
    let mut out = File::from(std::io::stdout().as_fd().try_clone_to_owned()?);
    std::io::copy(&mut File::open(path)?, &mut out).map(drop)
}

/// Prints a JSON object to stdout, indented. What a terminal would act on stands in strings alone, as escapes.
fn print_json(value: &serde_json::Value) -> Result<()> {
    let escape = |c: char| if c != '\n' && commands(c) { format!("\\u{:04x}", c as u32) } else { c.to_string() };
    print(&format!("{value:#}\n").chars().map(escape).collect::<String>())
}
