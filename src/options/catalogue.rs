//! Descriptions of options for Python's arguments and stubs, the render settings of USD stages, the panel of Blender's
//! add-on, and the tables in the documentation.

use super::parse::command;
use crate::argument::{InPython, InStages, NotInPython, OfScene, ValueRange};
use crate::render::{Method, SettingsRequest};
use clap::{Arg, Command, ValueEnum};
use serde::Serialize;
use std::any::TypeId;
use std::path::PathBuf;

/// The description of an option of `caustique render`, from which documents and the Python module are made.
#[derive(Clone, Debug, Serialize)]
pub struct OptionDescription {
    /// Name of the option's field, such as `max_depth`.
    pub name: String,
    /// Name of the option on the command line, such as `--max-depth`.
    pub option: String,
    /// Former names of the option's field, which files may still give.
    pub aliases: Vec<String>,
    /// Kind of value that the option takes.
    pub kind: ValueKind,
    /// Placeholders of the values in the help, one for each value.
    pub values: Vec<String>,
    /// The default value; `None` if there is none or it is not a single value.
    pub default: Option<String>,
    /// Range of a numeric value; `None` for other values and without bounds.
    pub range: Option<ValueRange>,
    /// Names that the option chooses from, each with its help.
    pub choices: Vec<(String, String)>,
    /// Heading under which the help lists the option.
    pub heading: String,
    /// Help text of the option.
    pub help: String,
    /// Names of the methods that take the option; empty if all do.
    pub methods: Vec<&'static str>,
    /// Whether the render settings of a USD stage may contain the option.
    pub stage: bool,
    /// Name of the option as an argument of Python's `render` or `Scene`; `None` if there is no such argument.
    pub python: Option<String>,
    /// Whether the option is an argument of Python's `Scene`.
    pub of_scene: bool,
    /// Why the option is no argument in Python; `None` if it is one.
    pub not_in_python: Option<&'static str>,
}

/// Kind of value that an option takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ValueKind {
    /// The option takes no value: it is present or not.
    Flag,
    /// The option takes a whole number.
    Integer,
    /// The option takes a number.
    Number,
    /// The option takes one of some names.
    Choice,
    /// The option takes `on` or `off`.
    Switch,
    /// The option takes the path of a file.
    Path,
    /// The option takes text in another format.
    Text,
}

/// Headings of the options that a USD stage may set. Stages come from untrusted sources, so only the command line sets
/// files and permissions.
const STAGE_HEADINGS: [&str; 6] = ["Method", "When to stop", "Expert", "Light and glass", "Effects", "Finish"];
/// Describes the options of a command, in the order of its help.
pub fn describe(command: &Command) -> Vec<OptionDescription> {
    command.get_arguments().filter(|arg| arg.get_long().is_some() && arg.get_id() != "help").map(entry).collect()
}

/// Descriptions of the options that are arguments of Python's `render`.
pub fn of_python() -> Vec<OptionDescription> {
    describe(&command()).into_iter().filter(|entry| entry.python.is_some() && !entry.of_scene).collect()
}

/// Descriptions of the options that are arguments of Python's `Scene`.
pub fn of_scene() -> Vec<OptionDescription> {
    describe(&command()).into_iter().filter(|entry| entry.of_scene).collect()
}

fn entry(arg: &Arg) -> OptionDescription {
    let name = arg.get_id().to_string();
    let choices = arg.get_possible_values();
    let help = |value: &clap::builder::PossibleValue| value.get_help().map(ToString::to_string).unwrap_or_default();
    let kind = kind(arg);
    let not_in_python = arg.get().map(|NotInPython(reason)| *reason);
    let of_scene = arg.get().map(|OfScene(name)| *name);
    let renamed = of_scene.or(arg.get().map(|InPython(name)| *name));
    let python = not_in_python.is_none().then(|| renamed.unwrap_or(&name).to_owned());
    let heading = arg.get_help_heading().unwrap_or_default();
    let allowed = arg.get().map(|InStages(allowed)| *allowed);
    let defaults = arg.get_default_values().iter().filter(|_| arg.get_action().takes_values());
    OptionDescription {
        option: format!("--{}", arg.get_long().unwrap_or_default()),
        aliases: arg.get_all_aliases().unwrap_or_default().iter().map(|alias| alias.replace('-', "_")).collect(),
        kind,
        values: arg.get_value_names().unwrap_or_default().iter().map(ToString::to_string).collect(),
        default: defaults.map(|value| value.to_string_lossy().into_owned()).find(|value| !value.is_empty()),
        range: arg.get::<ValueRange>().cloned(),
        choices: choices.iter().map(|value| (value.get_name().to_string(), help(value))).collect(),
        heading: heading.into(),
        help: arg.get_long_help().or(arg.get_help()).map(ToString::to_string).unwrap_or_default(),
        methods: methods(&name),
        stage: kind != ValueKind::Path && allowed.unwrap_or(STAGE_HEADINGS.contains(&heading)),
        python,
        of_scene: of_scene.is_some(),
        not_in_python,
        name,
    }
}

fn kind(arg: &Arg) -> ValueKind {
    let parsed = arg.get_value_parser().type_id();
    let is = |types: &[TypeId]| types.iter().any(|one| parsed == *one);
    let choices = arg.get_possible_values();
    if !arg.get_action().takes_values() {
        ValueKind::Flag
    } else if choices.iter().map(|value| value.get_name()).eq(["on", "off"]) {
        ValueKind::Switch
    } else if !choices.is_empty() {
        ValueKind::Choice
    } else if is(&[TypeId::of::<u32>(), TypeId::of::<u64>(), TypeId::of::<usize>()]) {
        ValueKind::Integer
    } else if is(&[TypeId::of::<f64>()]) {
        ValueKind::Number
    } else if is(&[TypeId::of::<PathBuf>()]) {
        ValueKind::Path
    } else {
        ValueKind::Text
    }
}

/// Names of the methods that take an option; empty if all do.
fn methods(option: &str) -> Vec<&'static str> {
    let taking = Method::value_variants().iter().filter(|method| SettingsRequest::takes(option, **method));
    let names: Vec<&str> = taking.map(|method| method.name()).collect();
    if names.len() == Method::value_variants().len() { Vec::new() } else { names }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_option_is_described_by_its_definition() {
        let all = describe(&command());
        let find = |name: &str| all.iter().find(|entry| entry.name == name).unwrap();
        let photons = find("photons");
        assert_eq!((photons.kind, photons.option.as_str(), photons.stage), (ValueKind::Integer, "--photons", true));
        let range = serde_json::json!(photons.range);
        assert_eq!(range, serde_json::json!({"min": 1, "max": 50_000_000}));
        assert_eq!(photons.methods, ["pm", "ppm", "sppm", "appm", "cppm"]);
        assert_eq!(
            serde_json::json!(find("alpha").range),
            serde_json::json!({"min": 0.0, "above_min": true, "max": 1.0})
        );
        assert_eq!(
            (find("guide").kind, find("model").stage, find("resume").kind),
            (ValueKind::Switch, false, ValueKind::Path)
        );
        assert_eq!(find("method").default.as_deref(), Some("auto"));
    }
}
