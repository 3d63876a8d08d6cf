//! Parses the runs of a comparison with the options of `caustique render`.

use super::options::ConvergeArgs;
use crate::cli::layout;
use crate::cli::render::RenderArgs;
use crate::cli::usage;
use caustique::error::{Error, ErrorKind, Result};
use caustique::options::RenderOptions;
use caustique::render::{Method, MethodChoice, Settings, SettingsRequest, TimeSpent};
use caustique::report::entry::Entry;
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, Command, FromArgMatches};

/// Options under [`HEADINGS_OF_RUN`] that a single run may not have: all runs share them, or they write files.
const NOT_OF_RUN: [&str; 3] = ["seed", "max_depth", "debug_techniques"];
/// Help headings of the options that may differ between runs.
const HEADINGS_OF_RUN: [&str; 3] = ["Method", "Finish", "Expert"];

/// A run, one of the compared renders, with its options.
pub struct Run {
    /// Name and settings of the run for the report. The finish is set when its libraries have been found.
    pub entry: Entry,
    /// The requested settings of the run, with its limits.
    pub request: SettingsRequest,
    /// Options of the run, those of `caustique render`.
    pub args: RenderOptions,
}

/// The runs that `--methods` and `--run` ask for.
///
/// # Errors
/// A run has an option that a render does not have, or that may not differ between runs; two runs have the same name.
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

/// A run of a method with its defaults and one bandwidth level.
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
    // Required arguments of a render.
    line.extend(["-o".into(), "run.exr".into(), args.scene.path.clone().into()]);
    let explain = |error: clap::Error| {
        usage::explain(&error, Some(&command)).unwrap_or_else(|| Error::new(ErrorKind::Usage, "", error))
    };
    let matches = command.clone().try_get_matches_from(line).map_err(explain)?;
    check_options_of_run(&command, &matches)?;
    let render = RenderArgs::from_arg_matches(&matches).map_err(explain)?;
    let request = SettingsRequest {
        max_depth: args.max_depth,
        seed: args.seed,
        switches: args.scene.switches(),
        iterations: args.iterations,
        time: super::time(args),
        threads: args.threads,
        ..render.picture_request()?.settings
    };
    let settings = Settings { iterations: None, time: None, ..request.resolve()? };
    let entry =
        Entry { name: name.into(), options: options.into(), settings, decided: TimeSpent::default(), finish: None };
    let mut options = render.options;
    options.no_finish |= args.no_finish;
    Ok(Run { entry, request, args: options })
}

/// Fails if an option concerns neither the method nor the finish of one run.
fn check_options_of_run(command: &Command, matches: &ArgMatches) -> Result<()> {
    let given = |arg: &&clap::Arg| matches.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine);
    for arg in command.get_arguments().filter(given) {
        let id = arg.get_id().as_str();
        let of_run = arg.get_help_heading().is_some_and(|heading| HEADINGS_OF_RUN.contains(&heading))
            && !NOT_OF_RUN.contains(&id);
        if !of_run && !["output", "path"].contains(&id) {
            let option = arg.get_long().unwrap_or(id);
            let cause = format!("--{option} cannot differ from run to run");
            return Err(Error::usage(cause)
                .hint("a run has the method and finish options of 'caustique render'; the others, where there are such, concern all runs"));
        }
    }
    Ok(())
}
