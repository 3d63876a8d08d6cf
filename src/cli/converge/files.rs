//! What a comparison leaves in its folder.

use super::options::ConvergeArgs;
use crate::cli::say;
use caustique::error::{Error, Result};
use caustique::film::{Layer, LayerSet};
use caustique::image::atomic;
use caustique::image::exr::{self, Attributes};
use caustique::report::curve::Axis;
use caustique::report::race::{Outcome, Point};
use caustique::report::summary::{Subject, Summary};
use caustique::report::{data, page, plot};
use serde_json::json;
use std::path::Path;

/// Checks that files can be written to the folder, or that it can be made.
///
/// # Errors
/// They cannot.
pub fn check(folder: &Path) -> Result<()> {
    if folder.is_dir() {
        return atomic::check_writable(&folder.join("index.html"));
    }
    // The nearest folder that is there would get the first new one.
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

/// Writes everything, the numbers first: a disk that is full keeps them longest.
///
/// # Errors
/// The file system.
pub fn write(
    args: &ConvergeArgs,
    subject: &Subject,
    outcome: &mut Outcome,
    summary: &Summary,
    threads: usize,
) -> Result<()> {
    let folder = &args.output;
    let bytes = |name: &str, bytes: &[u8]| atomic::write_bytes(&folder.join(name), bytes);
    bytes("points.csv", &data::csv(subject, outcome)?)?;
    bytes("points.json", format!("{:#}\n", data::json(subject, outcome, summary)).as_bytes())?;
    let mut plots = Vec::new();
    for (axis, heading, name) in [
        (Axis::Seconds, "Error against seconds", "error-seconds.svg"),
        (Axis::Iterations, "Error against iterations", "error-iterations.svg"),
    ] {
        if let Some(svg) = plot::svg(subject, summary, axis)? {
            bytes(name, svg.as_bytes())?;
            plots.push((heading, svg));
        }
    }
    let plots: Vec<(&str, &str)> = plots.iter().map(|(heading, svg)| (*heading, svg.as_str())).collect();
    bytes("index.html", page::html(subject, summary, &plots)?.as_bytes())?;
    pictures(folder, subject, outcome, threads)?;
    if args.progress.for_people() {
        say(&format!(
            "{}: the report; points.csv, points.json, plots and pictures are beside it",
            folder.join("index.html").display()
        ));
    }
    Ok(())
}

/// The last picture of every run with the first seed, as EXR.
fn pictures(folder: &Path, subject: &Subject, outcome: &mut Outcome, threads: usize) -> Result<()> {
    let mut names: Vec<String> = Vec::new();
    for run in 0..outcome.renders.len() {
        let entry = &subject.entries[run];
        let mut name = slug(&entry.name);
        if name == "reference" || names.contains(&name) {
            name += &format!("-{}", run + 1);
        }
        let mine = |point: &&Point| point.run == run && point.picture.is_some();
        let Some(point) = outcome.points.iter().rfind(mine).cloned() else { continue };
        let Some(picture) = outcome.picture(&point)? else { continue };
        let mut header = outcome.renders[run].account(Some(threads));
        header.insert("name".into(), entry.name.as_str().into());
        header.insert("options".into(), entry.options.as_str().into());
        header.insert("combined".into(), entry.finish.as_ref().map(|name| json!({"finish": name})).into());
        let mut set = LayerSet::new(subject.reference.width, subject.reference.height);
        set.push(Layer::interleaved("", "RGB", picture))?;
        let path = folder.join(format!("{name}.exr"));
        exr::write(&path, &set, &Attributes::of(&header)?, exr::Options::default())?;
        names.push(name);
    }
    Ok(())
}

/// A name as a file's: small letters, digits and hyphens.
fn slug(name: &str) -> String {
    let plain: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { ' ' }).collect();
    let joined: String = plain.split_whitespace().collect::<Vec<_>>().join("-").chars().take(60).collect();
    if joined.is_empty() { "run".into() } else { joined }
}
