//! Parsing of options for callers without a command line.

use super::render::RenderOptions;
use super::run::RunOptions;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Args, Command, FromArgMatches, ValueEnum};
use std::error::Error;
use std::ffi::OsString;

/// Why arguments of a render were rejected: the option and the problem.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InvalidOption {
    /// Field name of the invalid option; empty if the error concerns no single option.
    pub option: String,
    /// The problem with the value, or the valid values.
    pub reason: String,
}

/// A clap command with the options of a render.
pub(super) fn command() -> Command {
    let command = RunOptions::augment_args(RenderOptions::augment_args(Command::new("render")));
    command.no_binary_name(true).disable_help_flag(true).args_override_self(true)
}

/// Parses options from command-line arguments such as `--photons=1000`, with the scene as the last one.
///
/// # Errors
/// An option is unknown, or a value is out of range.
pub fn parse(words: impl IntoIterator<Item = OsString>) -> Result<(RenderOptions, RunOptions), InvalidOption> {
    let parsed = command().try_get_matches_from(words);
    let both = |matches| Ok((RenderOptions::from_arg_matches(&matches)?, RunOptions::from_arg_matches(&matches)?));
    parsed.and_then(both).map_err(|error| InvalidOption::of(&error))
}

/// The value of an enumeration with the name `name`, in which `_` may replace `-`.
///
/// # Errors
/// No value has the name; the error lists the valid names.
pub fn one_of<T: ValueEnum>(name: &str) -> Result<T, String> {
    T::from_str(&name.replace('_', "-"), false).map_err(|_| {
        let values = T::value_variants().iter().filter_map(T::to_possible_value);
        listed(values.map(|value| value.get_name().to_string()))
    })
}

fn listed(names: impl Iterator<Item = String>) -> String {
    format!("one of {}", names.map(|name| format!("'{name}'")).collect::<Vec<_>>().join(", "))
}

impl InvalidOption {
    fn of(error: &clap::Error) -> InvalidOption {
        let words = |kind| match error.get(kind) {
            Some(ContextValue::String(text)) => vec![text.clone()],
            Some(ContextValue::Strings(texts)) => texts.clone(),
            _ => Vec::new(),
        };
        let shown = words(ContextKind::InvalidArg).concat();
        let name = shown.trim_start_matches('-').split([' ', '=']).next().unwrap_or_default();
        let reason = match error.kind() {
            ErrorKind::InvalidValue => listed(words(ContextKind::ValidValue).into_iter()),
            ErrorKind::ArgumentConflict => {
                let others = words(ContextKind::PriorArg);
                let names = others.iter().filter_map(|other| other.split(' ').next());
                format!("it contradicts {}", names.collect::<Vec<_>>().join(", "))
            }
            _ => error.source().map_or_else(|| error.kind().to_string(), ToString::to_string),
        };
        InvalidOption { option: name.replace('-', "_"), reason }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_parsed_or_rejected_with_a_reason() {
        let parse = |text: &str| parse(text.split(' ').map(OsString::from));
        let (render, run) = parse("--photons=1000 --filter gaussian 2.5 --memory=64 -- scene.glb").unwrap();
        assert_eq!(
            (render.settings.photons, run.memory, render.scene.path.to_str()),
            (Some(1000), Some(64), Some("scene.glb"))
        );
        for (text, option, reason) in [
            ("--photons=0 a.glb", "photons", "it must be a whole number from 1 to 50000000"),
            ("--max-depth=0 a.glb", "max_depth", "it must be a whole number from 1 to 1000000"),
            ("--kernel=cone a.glb", "kernel", "one of 'box', 'epanechnikov', 'gaussian'"),
            ("--cppm-grid=9,9 a.glb", "cppm_grid", "there must be 2 to 64 cells"),
        ] {
            let expected = InvalidOption { option: option.into(), reason: reason.into() };
            assert_eq!(parse(text).err(), Some(expected), "{text}");
        }
    }
}
