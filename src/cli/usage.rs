//! Turns clap's errors into errors of the program: `command line: cause`, `hint: remedy`.

use caustique::error::Error;
use clap::Command;
use clap::error::{ContextKind, ContextValue, ErrorKind};

/// Options of other renderers, our option for an equal purpose, and the hint if the command has our option. An empty
/// name stands for every command.
const FOREIGN_OPTIONS: [(&[&str], &str, &str); 16] = [
    (
        &["--samples", "--spp", "-s", "--aa-samples", "--num-samples"],
        "iterations",
        "--iterations N sends N camera paths through every pixel; --time SECONDS stops after that time",
    ),
    (
        &["--passes"],
        "layers",
        "--layers LIST chooses the layers of the EXR; --iterations N says how often the picture is rendered",
    ),
    (&["--aovs", "--aov", "--pass", "--channels"], "layers", "--layers LIST chooses the layers of the EXR"),
    (
        &["--size", "--resolution", "--res", "--dimensions"],
        "width",
        "--width W and --height H are the picture's size in pixels; one alone keeps the camera's aspect",
    ),
    (
        &["--max-bounces", "--bounces", "--depth", "--max-path-length", "--path-length"],
        "max-depth",
        "--max-depth N is the longest light path in segments, one more than it has bounces",
    ),
    (&["--frame", "-f"], "frames", "--frames A-B renders frames of the scene's animation, one frame as --frames A"),
    (
        &["--motion-blur", "--motionblur"],
        "shutter",
        "--shutter OPEN,CLOSE blurs what moves while the shutter is open, in frames from the frame: --shutter -0.25,0.25",
    ),
    (&["--quiet", "--silent", "-q"], "progress", "--progress none says nothing but warnings and errors"),
    (&["--denoiser", "--no-denoise"], "denoise", "--denoise auto|oidn|own|none chooses the denoiser"),
    (
        &["--jobs", "-j", "--cores", "--num-threads"],
        "threads",
        "--threads T is the number of threads; 0 takes all cores",
    ),
    (&["--seconds", "--time-limit", "--timeout"], "time", "--time SECONDS stops after that time"),
    (&["--noise-threshold", "--error"], "target-error", "--target-error E stops at this estimated relative error"),
    (&["--integrator", "--renderer"], "method", "--method chooses how light is found"),
    (&["--out", "--outfile", "--output-file"], "output", "--output, or -o, names what is written"),
    (&["--out", "--output", "-o"], "json", "the command prints to standard output: '> FILE' writes to a file"),
    (&["--version", "-v"], "", "'caustique --version' prints the version"),
];

/// The error to print for a command line that clap rejects; `None` if the user asks for help or the version.
pub fn explain(error: &clap::Error, command: Option<&Command>) -> Option<Error> {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => None,
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            let error = Error::usage("a command is missing");
            Some(error.hint("'caustique --help' lists the commands"))
        }
        kind => {
            let said = rephrase(&error.render().to_string());
            let hint = match kind {
                ErrorKind::UnknownArgument => {
                    hint_for_foreign_option(&context(error, ContextKind::InvalidArg), command)
                }
                ErrorKind::ValueValidation => hint_for_percentage(error),
                ErrorKind::InvalidSubcommand if error.get(ContextKind::SuggestedSubcommand).is_none() => {
                    Some("'caustique --help' lists the commands".into())
                }
                _ => None,
            };
            Some(match hint {
                Some(hint) => said.hint(hint),
                None => said,
            })
        }
    }
}

/// A detail of clap's error as text; empty if the error has none.
fn context(error: &clap::Error, kind: ContextKind) -> String {
    match error.get(kind) {
        Some(ContextValue::String(text)) => text.clone(),
        _ => String::new(),
    }
}

/// The hint for an unknown option, if it is a negative number, or another program has it and the command has one for
/// its purpose; `None` otherwise.
fn hint_for_foreign_option(word: &str, command: Option<&Command>) -> Option<String> {
    if word.strip_prefix('-').is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit() || c == '.')) {
        return Some("a value that begins with '-' is joined to its option, as in --option=-1,2".into());
    }
    let has = |option: &str| {
        let options = command.into_iter().flat_map(Command::get_arguments);
        option.is_empty() || options.filter_map(clap::Arg::get_long).any(|long| long == option)
    };
    FOREIGN_OPTIONS
        .iter()
        .find(|(words, option, _)| words.contains(&word) && has(option))
        .map(|(.., hint)| (*hint).to_string())
}

/// The hint for a relative error that the user gives in percent; `None` for other errors.
fn hint_for_percentage(error: &clap::Error) -> Option<String> {
    if !context(error, ContextKind::InvalidArg).starts_with("--target-error ") {
        return None;
    }
    let value = context(error, ContextKind::InvalidValue);
    let percent: f64 = value.trim_end_matches('%').trim().parse().ok()?;
    let fraction = percent / 100.0;
    (fraction > 0.0 && fraction < 1.0).then(|| format!("did you mean {fraction}, which is {percent} %?"))
}

/// Turns clap's message into an error with a cause and a hint. The message has paragraphs: the fault, tips, the usage,
/// a note on help.
fn rephrase(text: &str) -> Error {
    let words = |paragraph: &str| paragraph.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut paragraphs = text.split("\n\n");
    let fault = paragraphs.next().map(words).unwrap_or_default();
    let cause = fault.strip_prefix("error: ").unwrap_or(&fault);
    let tips: Vec<String> = paragraphs
        .flat_map(str::lines)
        .filter_map(|line| line.trim_start().strip_prefix("tip: "))
        // The tip to pass an unknown option as a value does not apply: no value starts with a dash.
        .filter(|tip| !tip.starts_with("to pass "))
        .map(str::to_string)
        .collect();
    let hint = if tips.is_empty() { "'--help' explains every option".to_string() } else { tips.join("; ") };
    Error::usage(cause).hint(hint)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tips_become_hints_and_lists_stay_on_the_line() {
        let error = rephrase(
            "error: unexpected argument '--itertions' found\n\n  tip: a similar argument exists: '--iterations'\n\n\
             Usage: caustique render\n\nFor more information, try '--help'.\n",
        );
        assert_eq!(error.to_string(), "command line: unexpected argument '--itertions' found");
        assert_eq!(error.hint.as_deref(), Some("a similar argument exists: '--iterations'"));
        let error = rephrase(
            "error: unexpected argument '--kernel' found\n\n  tip: to pass '--kernel' as a value, use '-- --kernel'\n\nU",
        );
        assert_eq!(error.hint.as_deref(), Some("'--help' explains every option"));
        let error = rephrase("error: the following required arguments were not provided:\n  --output <OUT.exr>\n\nU");
        assert_eq!(
            error.to_string(),
            "command line: the following required arguments were not provided: --output <OUT.exr>"
        );
        assert_eq!(error.exit_code(), 2);
    }
}
