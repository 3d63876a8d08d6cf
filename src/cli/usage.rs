//! Errors of the command line in the form of all others: `command line: cause`, `hint: remedy`.

use caustique::error::{Error, Kind};
use clap::error::ErrorKind;

/// What clap has to say; `None` when help or the version was asked for.
pub fn explain(error: &clap::Error) -> Option<Error> {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => None,
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            let error = Error::new(Kind::Usage, "command line", "a command is missing");
            Some(error.hint("'caustique --help' lists the commands"))
        }
        _ => Some(rephrase(&error.render().to_string())),
    }
}

/// clap writes paragraphs: the fault, tips, the usage, where help is.
fn rephrase(text: &str) -> Error {
    let words = |paragraph: &str| paragraph.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut paragraphs = text.split("\n\n");
    let fault = paragraphs.next().map(words).unwrap_or_default();
    let cause = fault.strip_prefix("error: ").unwrap_or(&fault);
    let tips: Vec<String> = paragraphs
        .flat_map(str::lines)
        .filter_map(|line| line.trim_start().strip_prefix("tip: "))
        // How to pass an unknown option as a value: no value of ours looks like one.
        .filter(|tip| !tip.starts_with("to pass "))
        .map(str::to_string)
        .collect();
    let hint = if tips.is_empty() { "'--help' explains every option".to_string() } else { tips.join("; ") };
    Error::new(Kind::Usage, "command line", cause).hint(hint)
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
