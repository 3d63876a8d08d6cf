//! Options from keyword arguments. Each argument becomes an argument of the command line, which the library parses, so
//! names, ranges and defaults are those of [`caustique::options`].

use crate::error::usage;
use crate::keywords::{Keywords, choice};
use caustique::options::catalogue::{OptionDescription, ValueKind, of_python, of_scene};
use caustique::options::{FrameSeed, InvalidOption, RenderOptions, RunOptions, SceneOptions, parse};
use caustique::pipeline::FinishRequest;
use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;

/// Headings of the options that may differ between the runs of a comparison.
const HEADINGS_OF_RUN: [&str; 3] = ["Method", "Finish", "Expert"];
/// Names of options under these headings that all runs of a comparison share nevertheless.
const SHARED: [&str; 2] = ["seed", "max_depth"];

/// Descriptions of the options of `render`.
pub fn of_render() -> Vec<OptionDescription> {
    of_python()
}

/// Descriptions of the options of `plan`: picture, method and finish, but neither output nor running.
pub fn of_plan() -> Vec<OptionDescription> {
    chosen(|entry| !["Output", "Running"].contains(&entry.heading.as_str()))
}

/// Descriptions of the options of one run of a comparison.
pub fn of_run() -> Vec<OptionDescription> {
    chosen(|entry| HEADINGS_OF_RUN.contains(&entry.heading.as_str()) && !SHARED.contains(&entry.name.as_str()))
}

/// Descriptions of the options with these names.
pub fn named(names: &[&str]) -> Vec<OptionDescription> {
    chosen(|entry| names.contains(&entry.name.as_str()))
}

fn chosen(wanted: impl Fn(&OptionDescription) -> bool) -> Vec<OptionDescription> {
    of_python().into_iter().filter(wanted).collect()
}

/// The finish of a render, by the arguments `denoise` and `model` of `call`.
pub fn finish_request(call: &str, denoise: &str, model: Option<String>) -> PyResult<FinishRequest> {
    Ok(FinishRequest { denoiser: choice(&format!("{call}: denoise"), denoise)?, model })
}

/// Takes the options of a render from the keyword arguments.
///
/// # Errors
/// An argument has the wrong type or is out of range.
pub fn take(
    keywords: &mut Keywords<'_>,
    options: &[OptionDescription],
    scene: &SceneOptions,
) -> PyResult<(RenderOptions, RunOptions)> {
    let (mut render, run) = parsed(keywords, options, Vec::new())?;
    render.scene = scene.clone();
    // The scene is one frame, so the seed is not varied by the frame's number.
    render.frame_seed = FrameSeed::Same;
    Ok((render, run))
}

/// Takes the options of a scene from the keyword arguments. `more`: arguments of the command line for arguments taken
/// before.
///
/// # Errors
/// An argument has the wrong type or is out of range.
pub fn take_scene(keywords: &mut Keywords<'_>, more: Vec<OsString>) -> PyResult<SceneOptions> {
    Ok(parsed(keywords, &of_scene(), more)?.0.scene)
}

/// The options of a render by a method without a finish, for a comparison; with one bandwidth level if it has levels.
pub fn single(method: &str, has_levels: bool) -> PyResult<RenderOptions> {
    let mut words = vec![format!("--method={method}"), "--no-finish".into()];
    words.extend(has_levels.then(|| "--levels=1".to_string()));
    words.push("scene".into());
    let parsed = parse(words.into_iter().map(OsString::from));
    parsed.map(|(render, _)| render).map_err(|invalid| usage(invalid.option, invalid.reason))
}

fn parsed(
    keywords: &mut Keywords<'_>,
    options: &[OptionDescription],
    more: Vec<OsString>,
) -> PyResult<(RenderOptions, RunOptions)> {
    let mut words = more;
    for entry in options {
        words.extend(self::words(keywords, entry)?);
    }
    words.extend(["--".into(), "scene".into()]);
    parse(words).map_err(|invalid| invalid_argument(keywords, options, &invalid))
}

/// The Python exception for an argument that the library rejects.
fn invalid_argument(
    keywords: &Keywords<'_>,
    options: &[OptionDescription],
    InvalidOption { option, reason }: &InvalidOption,
) -> PyErr {
    let entry = options.iter().find(|entry| entry.name == *option);
    let name = entry.and_then(|entry| entry.python.as_deref()).unwrap_or(option);
    let fault = if reason.starts_with("one of") { "does not exist" } else { "is not valid" };
    usage(format!("{}: {name}={} {fault}", keywords.call(), keywords.shown(name)), reason)
}

/// The arguments of the command line for the keyword argument of an option; empty if it is missing.
fn words(keywords: &mut Keywords<'_>, entry: &OptionDescription) -> PyResult<Vec<OsString>> {
    let name = entry.python.as_deref().unwrap_or(&entry.name);
    let option = &entry.option;
    let word = |text: OsString| {
        let mut word = OsString::from(format!("{option}="));
        word.push(text);
        vec![word]
    };
    let given = match entry.kind {
        _ if keywords.has_taken(name) => None,
        ValueKind::Flag => {
            // `finish=False` is `--no-finish`.
            let flag = name != "finish";
            keywords.take::<bool>(name)?.filter(|on| *on == flag).map(|_| vec![OsString::from(option)])
        }
        ValueKind::Switch => keywords.take::<bool>(name)?.map(|on| word(if on { "on" } else { "off" }.into())),
        ValueKind::Integer => keywords.take::<u64>(name)?.map(|number| word(number.to_string().into())),
        ValueKind::Number => keywords.take::<f64>(name)?.map(|number| word(format!("{number:?}").into())),
        ValueKind::Choice => keywords.take::<String>(name)?.map(|text| word(text.into())),
        ValueKind::Path => keywords.take::<PathBuf>(name)?.map(|path| word(path.into())),
        ValueKind::Text => match keywords.take::<Bound<'_, PyAny>>(name)? {
            None => None,
            Some(value) => Some(match texts(&value)? {
                // Options with several values, such as `--filter gaussian 2`.
                texts if entry.values.len() > 1 => std::iter::once(option.into()).chain(texts).collect(),
                // The placeholder of the value shows its separator: `I/N`, `X,Y,W,H`.
                texts => {
                    let separator = if entry.values.iter().any(|value| value == "I/N") { "/" } else { "," };
                    word(texts.join(OsString::from(separator).as_os_str()))
                }
            }),
        },
    };
    Ok(given.unwrap_or_default())
}

/// The value as texts for the command line: one, or one for each item of a sequence.
fn texts(value: &Bound<'_, PyAny>) -> PyResult<Vec<OsString>> {
    if let Ok(text) = value.extract::<PathBuf>() {
        return Ok(vec![text.into()]);
    }
    let text = |item: Bound<'_, PyAny>| Ok(OsString::from(item.str()?.to_string()));
    match value.try_iter() {
        Ok(items) => items.map(|item| text(item?)).collect(),
        Err(_) => Ok(vec![text(value.clone())?]),
    }
}
