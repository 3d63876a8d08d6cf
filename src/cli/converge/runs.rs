//! Runs from the words of the command line, read with the options of `caustique render`.

use super::options::ConvergeArgs;
use crate::cli::layout;
use crate::cli::render::RenderArgs;
use crate::cli::usage;
use caustique::error::{Error, ErrorKind, Result};
use caustique::options::{MethodChoice, RenderOptions};
use caustique::render::{Method, Settings, TimeSpent};
use caustique::report::entry::Entry;
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, Command, FromArgMatches};

/// Options beside a render's method that are not a run's: those of the picture itself, which all runs have in common,
/// and files of its own.
const COMMON: [&str; 3] = ["seed", "max_depth", "debug_techniques"];
/// Headings of options that may differ from run to run.
const OF_RUN: [&str; 3] = ["Method", "Finish", "Expert"];

/// A run, and the options it was read from.
pub struct Run {
    /// What competes; its finish is not known before libraries are found.
    pub entry: Entry,
    /// All options of a render with this method.
    pub args: RenderOptions,
}

/// All runs that are asked for.
///
/// # Errors
/// Options that a render does not have, or that are not a run's; names given twice.
pub fn all(args: &ConvergeArgs) -> Result<Vec<Run>> {
    let usual = [Method::Path, Method::Sppm, Method::Cppm, Method::Vcm].map(|method| MethodChoice(Some(method)));
    let methods = if args.methods.is_empty() && args.runs.is_empty() { &usual[..] } else { &args.methods };
    let mut runs: Vec<Run> = methods.iter().map(|method| by_method(args, *method)).collect::<Result<_>>()?;
    for text in &args.runs {
        let (name, options) = match text.split_once(':') {
            Some((name, options)) if !name.trim_start().starts_with('-') => (name.trim(), options.trim()),
            _ => (text.trim(), text.trim()),
        };
        let place = format!("--run \"{name}\"");
        let words = shell_words::split(options)
            .map_err(|cause| Error::new(ErrorKind::Usage, &place, cause).hint("close the quotes"))?;
        if name.is_empty() {
            return Err(Error::new(ErrorKind::Usage, "--run", "a run needs a name or options")
                .hint("such as --run 'five levels: --method sppm --levels 5'"));
        }
        runs.push(parse(args, name, options, words).map_err(|mut error| {
            error.place = place;
            error
        })?);
    }
    let name = |run: usize| &runs[run].entry.name;
    if let Some(twice) = (1..runs.len()).find(|&run| (0..run).any(|other| name(other) == name(run))) {
        let error = Error::usage(format!("two runs are called \"{}\"", name(twice)));
        return Err(error.hint("give each --run a name of its own: --run 'NAME: OPTIONS'"));
    }
    Ok(runs)
}

/// A method with its defaults and one level.
pub fn by_method(args: &ConvergeArgs, method: MethodChoice) -> Result<Run> {
    let name = method.name().to_string();
    let mut words = vec!["--method".to_string(), name.clone()];
    if method.0.is_none_or(Method::has_levels) {
        words.extend(["--levels".into(), "1".into()]);
    }
    parse(args, &name, &words.join(" "), words)
}

fn parse(args: &ConvergeArgs, name: &str, options: &str, words: Vec<String>) -> Result<Run> {
    let command = layout::arrange(RenderArgs::augment_args(Command::new("render")));
    let command = command.no_binary_name(true).disable_help_flag(true).args_override_self(true);
    let mut line: Vec<std::ffi::OsString> = words.into_iter().map(Into::into).collect();
    // What a render needs besides.
    line.extend(["-o".into(), "run.exr".into(), args.scene.path.clone().into()]);
    let explain = |error: clap::Error| {
        usage::explain(&error, Some(&command)).unwrap_or_else(|| Error::new(ErrorKind::Usage, "", error))
    };
    let matches = command.clone().try_get_matches_from(line).map_err(explain)?;
    refuse_common(&command, &matches)?;
    let render = RenderArgs::from_arg_matches(&matches).map_err(explain)?;
    let settings = Settings {
        max_depth: args.max_depth.unwrap_or(u32::MAX),
        seed: args.seed,
        classes: args.scene.switches().classes(),
        iterations: None,
        time: None,
        ..render.picture_request()?.method.settings().clone()
    };
    let entry =
        Entry { name: name.into(), options: options.into(), settings, decided: TimeSpent::default(), finish: None };
    let mut job = render.job;
    job.no_finish |= args.no_finish;
    Ok(Run { entry, args: job })
}

/// Errors: an option that is not about the method or the finish of one run.
fn refuse_common(command: &Command, matches: &ArgMatches) -> Result<()> {
    let given = |arg: &&clap::Arg| matches.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine);
    for arg in command.get_arguments().filter(given) {
        let id = arg.get_id().as_str();
        let of_run = arg.get_help_heading().is_some_and(|heading| OF_RUN.contains(&heading)) && !COMMON.contains(&id);
        if !of_run && !["output", "path"].contains(&id) {
            let option = arg.get_long().unwrap_or(id);
            let cause = format!("--{option} cannot differ from run to run");
            return Err(Error::usage(cause)
                .hint("a run has the method and finish options of 'caustique render'; the others, where there are such, concern all runs"));
        }
    }
    Ok(())
}
