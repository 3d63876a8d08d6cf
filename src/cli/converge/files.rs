//! Writes the report of a comparison to its folder.

use super::options::ConvergeArgs;
use crate::cli::say;
use caustique::error::{Error, Result};
use caustique::files;
use caustique::film::{Layer, LayerSet};
use caustique::image::exr::{self, Attributes};
use caustique::image::{Outputs, atomic};
use caustique::report::curve::Axis;
use caustique::report::entry::{Line, Metric, PictureSource};
use caustique::report::equal_time::Outcome;
use caustique::report::page::Plots;
use caustique::report::point::Point;
use caustique::report::summary::{Subject, Summary};
use caustique::report::verdict::verdict;
use caustique::report::{data, page, plot};
use caustique::scene::Scene;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Checks that the output folder of a comparison is writable or can be created.
///
/// # Errors
/// The folder is neither.
pub fn check(folder: &Path) -> Result<()> {
    if folder.is_dir() {
        return atomic::check_writable(&folder.join("index.html"));
    }
    // The first missing folder would be created in the nearest existing one.
    let mut new = folder;
    while let Some(parent) = new.parent().filter(|p| !p.as_os_str().is_empty() && !p.exists()) {
        new = parent;
    }
    if new.exists() {
        return std::fs::read_dir(new)
            .map(|_| ())
            .map_err(|cause| Error::io(folder, &cause).hint("-o names a folder; a file of that name is there"));
    }
    atomic::check_writable(new)
}

/// The files that a comparison reads.
pub fn inputs(args: &ConvergeArgs, scene: &Scene) -> Vec<PathBuf> {
    scene.files.iter().chain(&args.reference).cloned().collect()
}

/// Checks that no file with a fixed name in the output folder is an input.
///
/// # Errors
/// One is an input.
pub fn check_inputs(args: &ConvergeArgs, inputs: &[PathBuf]) -> Result<()> {
    let plots = AXES.iter().flat_map(|(_, _, name)| ERRORS.map(|error| plot_name(error, name)));
    let reference = args.reference.is_none().then(|| "reference.exr".to_owned());
    let names = TABLES.map(str::to_owned).into_iter().chain(reference).chain(plots);
    let outputs = Outputs::new(names.map(|name| args.output.join(name)))?;
    outputs.check(inputs.iter().map(PathBuf::as_path))
}

/// Names of the files with the figures and the page.
const TABLES: [&str; 3] = ["points.csv", "points.json", "index.html"];
/// Axes of the plots, with their headings and names.
const AXES: [(Axis, &str, &str); 3] = [
    (Axis::Seconds, "Error against seconds", "seconds"),
    (Axis::CoreSeconds, "Error against core-seconds", "core-seconds"),
    (Axis::Iterations, "Error against iterations", "iterations"),
];
/// Names of the errors of the plots: in the chosen metric, trimmed, and of all pixels.
const ERRORS: [&str; 3] = ["error", "trimmed", "all"];

/// Name of the file of a plot.
fn plot_name(error: &str, axis: &str) -> String {
    format!("{error}-{axis}.svg")
}

/// Writes all files of a comparison, the figures first, so that a full disk does not lose them.
///
/// # Errors
/// A file cannot be written.
pub fn write(
    args: &ConvergeArgs,
    subject: &Subject,
    outcome: &mut Outcome,
    summary: &Summary,
    inputs: &[PathBuf],
    threads: usize,
) -> Result<()> {
    let folder = &args.output;
    let bytes = |name: &str, bytes: &[u8]| atomic::write_bytes(&folder.join(name), bytes);
    bytes("points.csv", &data::csv(subject, outcome)?)?;
    bytes("points.json", format!("{:#}\n", data::json(subject, outcome, summary)).as_bytes())?;
    let mut plots = Vec::new();
    let beside = &summary.second;
    let trimmed = if beside.metric == Metric::RelMseTrimmed { "trimmed" } else { "all" };
    for (axis, heading, name) in AXES {
        let mut row = Plots { heading, plots: Vec::new() };
        for (what, metric, curves) in
            [("error", subject.metric, &summary.curves), (trimmed, beside.metric, &beside.curves)]
        {
            if let Some(svg) = plot::svg(subject, summary, metric, curves, axis)? {
                bytes(&plot_name(what, name), svg.as_bytes())?;
                row.plots.push((metric, svg));
            }
        }
        plots.push(row);
    }
    bytes("index.html", page::html(subject, outcome, summary, &plots)?.as_bytes())?;
    write_pictures(folder, subject, outcome, inputs, threads)?;
    if args.progress.for_people() {
        if let Some(verdict) = verdict(subject, summary) {
            say(&verdict);
        }
        say(&format!(
            "{}: the report; points.csv, points.json, plots and pictures are beside it",
            folder.join("index.html").display()
        ));
    }
    Ok(())
}

/// Writes the last picture of every curve (the errors of a run over time) with the first seed as EXR, under names that no
/// input has.
fn write_pictures(
    folder: &Path,
    subject: &Subject,
    outcome: &mut Outcome,
    inputs: &[PathBuf],
    threads: usize,
) -> Result<()> {
    let path = |name: &str| folder.join(format!("{name}.exr"));
    let is_input = |name: &str| inputs.iter().any(|input| files::is_same(input, &path(name)));
    let mut names: Vec<String> = Vec::new();
    for (line, of) in subject.lines.iter().enumerate() {
        let mut name = slug(&of.name);
        while name == "reference" || names.contains(&name) || is_input(&name) {
            name += &format!("-{}", line + 1);
        }
        let mine = |point: &&Point| point.line == line && point.picture.is_some();
        let Some(point) = outcome.points.iter().rfind(mine).cloned() else { continue };
        let Some(picture) = outcome.picture(&point)? else { continue };
        let header = header(subject, outcome, of, threads);
        let mut set = LayerSet::new(picture.size().width, picture.size().height);
        set.push(Layer::interleaved("", "RGB", picture))?;
        exr::write(&path(&name), &set, &Attributes::of(&header)?, exr::Options::default())?;
        names.push(name);
    }
    Ok(())
}

/// The JSON header for the last picture of a curve, the errors of a run over time.
fn header(subject: &Subject, outcome: &Outcome, line: &Line, threads: usize) -> Value {
    let mut header = match line.source {
        PictureSource::Estimate(run) | PictureSource::Finished(run) => {
            let mut header = outcome.renders[run].header(Some(threads));
            header.insert("options".into(), subject.entries[run].options.as_str().into());
            Value::Object(header)
        }
        PictureSource::Peer(peer) | PictureSource::Denoised(peer) => {
            json!({"renderer": subject.peers[peer].name, "renderer_version": outcome.peers[peer].version})
        }
    };
    header["name"] = line.name.as_str().into();
    header["combined"] = match line.source {
        PictureSource::Finished(run) => json!({"finish": subject.entries[run].finish}),
        PictureSource::Denoised(_) => json!({"finish": "Open Image Denoise"}),
        _ => Value::Null,
    };
    header
}

/// Turns a run's name into a file name: lower-case letters, digits and hyphens.
fn slug(name: &str) -> String {
    let plain: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { ' ' }).collect();
    let joined: String = plain.split_whitespace().collect::<Vec<_>>().join("-").chars().take(60).collect();
    if joined.is_empty() { "run".into() } else { joined }
}
