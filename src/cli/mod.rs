//! The command line, one file per command. Data goes to stdout, messages to stderr. Only this file prints.

mod claim;
mod compare;
mod converge;
mod doctor;
mod events;
mod finish;
mod finish_frames;
mod finish_options;
mod info;
mod layout;
mod merge;
mod output;
mod plan;
mod plot;
mod progress;
mod render;
mod scene;
mod serve;
mod shell;
mod signals;
mod stage;
mod usage;
mod warnings;

use caustique::error::{Error, ErrorKind, Result};
use caustique::scene::gltf::decode_for_program;
use caustique::{processor, system};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use std::ffi::OsString;
use std::fs::File;
use std::io::Write;
use std::num::NonZero;
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
    /// Show which effects a scene calls for, which will be simulated, and why
    Plan(Box<plan::PlanArgs>),
    /// Finish a rendered EXR, also one of another renderer
    #[command(alias = "combine")]
    Finish(finish::FinishArgs),
    /// Merge the shards of a render, or renders of different seeds
    Merge(merge::MergeArgs),
    /// Measure the error of an image against a reference
    Compare(compare::CompareArgs),
    /// Compare methods and settings: accuracy against time
    Converge(Box<converge::ConvergeArgs>),
    /// Show what a scene or an EXR contains
    Info(info::InfoArgs),
    /// Keep a scene and render it as often as another program asks, by commands on standard input
    Serve(serve::ServeArgs),
    /// Show which Embree, ONNX Runtime, Open Image Denoise and USD are found, and how to install missing ones
    Doctor(doctor::DoctorArgs),
    /// Print a script that completes commands and options in a shell
    Completions(shell::CompletionsArgs),
    /// Print a page of the manual
    Man(shell::ManArgs),
    /// Print a description of the options of 'render' as JSON
    #[command(hide = true)]
    Options,
    /// Decode compressed data that another process of the program sends on standard input
    #[command(hide = true)]
    Decode,
}

/// Makes the parser of the command line with all commands, arranged for the help.
fn command_line() -> clap::Command {
    let mut places = 0..;
    Cli::command().mut_subcommands(|command| {
        layout::with_help(layout::arrange(command)).display_order(places.next().unwrap_or_default())
    })
}

/// The command that the program's first argument names; `None` if it names none.
fn named_command(line: &clap::Command) -> Option<&clap::Command> {
    std::env::args_os().nth(1).and_then(|word| line.find_subcommand(word))
}

/// Runs the program and returns its exit code.
pub fn main() -> ExitCode {
    events::use_if_asked(std::env::args_os());
    if let Err(error) = processor::check().and_then(|()| system::survive_large_files().map_err(signals::failed)) {
        return fail(&error);
    }
    let mut line = command_line();
    let matches = line.try_get_matches_from_mut(std::env::args_os());
    let cli = match matches.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        Err(error) => match usage::explain(&error, named_command(&line)) {
            Some(error) => return fail(&error),
            None => {
                // Help and version are data: they go to stdout.
                if error.kind() == clap::error::ErrorKind::DisplayVersion {
                    return print(&doctor::version()).map_or_else(|error| fail(&error), |()| ExitCode::SUCCESS);
                }
                return match error.print() {
                    Err(cause) if cause.kind() != std::io::ErrorKind::BrokenPipe => ExitCode::FAILURE,
                    _ => ExitCode::SUCCESS,
                };
            }
        },
    };
    let command = match stage::add_stage_options(cli.command, std::env::args_os().collect(), &mut line) {
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
        Command::Serve(args) => serve::run(&args),
        Command::Doctor(args) => doctor::run(&args),
        Command::Completions(args) => shell::complete(&args, command_line()),
        Command::Man(args) => shell::man(&args, command_line()),
        Command::Options => shell::options(&command_line()),
        Command::Decode => decode(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => fail(&error),
    }
}

/// Decodes the data on standard input, see [`decode_for_program`].
fn decode() -> Result<()> {
    decode_for_program(std::io::stdin().lock(), std::io::stdout().lock()).map_err(|cause| {
        Error::usage(format!("'decode' cannot read its input: {cause}")).hint("run 'caustique render' instead")
    })
}

/// Parses the options of `caustique render` in `words`: the path of the scene, and options.
///
/// # Errors
/// An option is wrong, or asks for help.
fn parse_render(words: &[String]) -> Result<render::RenderArgs> {
    let before = ["caustique", "render", "--progress", "json"].map(OsString::from);
    let words: Vec<OsString> = before.into_iter().chain(words.iter().map(OsString::from)).collect();
    let mut line = command_line();
    let parsed = line.try_get_matches_from_mut(&words).and_then(|matches| Cli::from_arg_matches(&matches));
    let command = parsed.map_err(|error| {
        let explained = usage::explain(&error, line.find_subcommand("render"));
        explained.unwrap_or_else(|| Error::usage("the options ask for help").hint("run 'caustique render --help'"))
    })?;
    match stage::add_stage_options(command.command, words, &mut line)? {
        Command::Render(args) => Ok(*args),
        _ => {
            Err(Error::usage("these are no options of 'caustique render'").hint("'caustique render --help' lists them"))
        }
    }
}

/// Prints an error with its hint to stderr, and returns its exit code.
fn fail(error: &Error) -> ExitCode {
    if events::are_in_use() {
        events::print_error(error);
    } else {
        say(&error.to_string());
        error.hint.iter().for_each(|hint| say(&format!("hint: {hint}")));
    }
    ExitCode::from(error.exit_code())
}

/// Number of threads per core above which `--threads` is taken for a typing error.
const MAX_THREADS_PER_CORE: usize = 4;

/// Makes the thread pool of a command; 0 threads: one for each core.
fn pool(threads: usize) -> Result<rayon::ThreadPool> {
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
    if threads > MAX_THREADS_PER_CORE * cores {
        say(&format!(
            "warning: --threads {threads}: there are {cores} cores: more threads take memory, and make nothing faster"
        ));
    }
    let builder = rayon::ThreadPoolBuilder::new().num_threads(threads);
    builder.build().map_err(|error| Error::new(ErrorKind::Io, "threads", error).hint("ask for fewer with --threads"))
}

/// Prints a message to stderr: a line, or an event if programs read it.
fn say(line: &str) {
    if events::are_in_use() { events::print_message(line) } else { write_line(&printable(line)) }
}

/// Writes a line to stderr. Ignores errors, so that a render continues after its terminal or its pipe is closed.
fn write_line(line: &str) {
    progress::hide_bar_during(|| {
        let _ = writeln!(std::io::stderr().lock(), "{line}");
    });
}

/// Escapes control characters and changes of text direction, such as `\u{1b}`, so that names from a scene can neither
/// control the terminal nor start a new line.
fn printable(text: &str) -> String {
    text.chars().map(|c| if is_control(c) { c.escape_default().to_string() } else { c.to_string() }).collect()
}

/// Whether a character controls a terminal instead of being shown.
fn is_control(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Prints a text to stdout. A closed pipe is no error.
fn print(text: &str) -> Result<()> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::new(ErrorKind::Io, "standard output", error))
        }
        _ => Ok(()),
    }
}

/// Copies a file to stdout.
fn print_file(path: &Path) -> std::io::Result<()> {
    std::io::copy(&mut File::open(path)?, &mut system::stdout_file()?).map(drop)
}

/// Prints an indented JSON object to stdout.
fn print_json(value: &serde_json::Value) -> Result<()> {
    print(&events::escaped(&format!("{value:#}\n")))
}
