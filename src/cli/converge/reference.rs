//! The reference of a comparison, read from a file or rendered here.

use super::options::ConvergeArgs;
use super::progress::Reporter;
use super::runs::{self, Run};
use crate::cli::progress::duration;
use crate::cli::say;
use crate::cli::signals::Interrupt;
use caustique::error::{Error, ErrorKind, Result};
use caustique::path_class::Effect;
use caustique::pipeline::choose::Chosen;
use caustique::plan::Presence;
use caustique::render::MethodChoice;
use caustique::render::{Control, Method, Settings};
use caustique::report::reference::{Halves, OwnError, Reference};
use caustique::scene::View;

/// The origin of the reference, the picture that errors are measured against.
pub enum Source {
    /// The reference was read from a file.
    File(Reference),
    /// The reference is to be rendered with these settings.
    Own(Box<Settings>),
}

/// Reads the reference file, or prepares the settings to render one. Adds remarks to `notes`.
///
/// # Errors
/// The file is no suitable reference, or options contradict each other.
pub fn source(
    args: &ConvergeArgs,
    view: View<'_>,
    runs: &[(Run, Chosen)],
    seeds: &[u64],
    notes: &mut Vec<String>,
) -> Result<Source> {
    let metric = args.error_metric;
    let Some(path) = &args.reference else { return reference_settings(args, view).map(Source::Own) };
    let (mut reference, header) = Reference::read(path, view.camera.size())?;
    if let Some(error) = args.reference_error {
        reference.error = OwnError::in_metric(metric, error);
    }
    let mut note = |text: String| {
        say(&format!("warning: {}: {text}", path.display()));
        notes.push(format!("Reference: {text}."));
    };
    if reference.error.of(metric).is_none() {
        note(format!(
            "its own {} is not known, so that figures near it say nothing; --reference-error states it",
            metric.name()
        ));
    }
    let same = |(run, _): &&(Run, Chosen)| header["method"] == run.entry.settings.method.name();
    if let Some((run, _)) = runs.iter().find(same)
        && header["seed"].as_u64().is_some_and(|seed| seeds.contains(&seed))
    {
        let (name, seed) = (&run.entry.name, &header["seed"]);
        note(format!(
            "it has method and seed {seed} of the run \"{name}\", whose error will look too small; choose another --seed"
        ));
    }
    Ok(Source::File(reference))
}

/// Settings for rendering a reference, as the options ask.
fn reference_settings(args: &ConvergeArgs, View { scene, camera }: View<'_>) -> Result<Box<Settings>> {
    let method = match args.reference_method {
        Some(method) => method,
        None if Presence::of(scene, camera).has(Effect::Sds) => MethodChoice(Some(Method::Vcm)),
        None => MethodChoice(Some(Method::Bdpt)),
    };
    let mut settings = runs::by_method(args, method)?.entry.settings;
    if settings.method.has_one_map() {
        let error = Error::usage("pm does not converge: it makes no reference");
        return Err(error.hint("choose another --reference-method"));
    }
    settings.time = args.reference_time;
    settings.iterations = args.reference_iterations;
    if settings.time.is_none() && settings.iterations.is_none() {
        match (super::time(args), args.iterations) {
            (Some(time), _) => settings.time = Some(8.0 * time),
            (None, n) => settings.iterations = n.map(|n| n.saturating_mul(16).max(2)),
        }
    }
    Ok(Box::new(settings))
}

/// Prints how long the rendering of the reference and the `runs` runs after it will take.
fn announce(args: &ConvergeArgs, settings: &Settings, runs: usize) {
    let method = settings.method.name();
    let count = settings.iterations.map(|n| format!("{n} iterations each"));
    let time = settings.time.map(|time| format!("{} together", duration(time)));
    let ends: Vec<String> = [count, time].into_iter().flatten().collect();
    let rest = super::time(args).map(|time| (runs as f64 * time * args.seeds as f64, args.iterations));
    let then = match rest {
        Some((time, None)) => format!(", then {} for {runs} runs", duration(time)),
        Some((time, Some(_))) => format!(", then at most {} for {runs} runs", duration(time)),
        None => String::new(),
    };
    say(&format!(
        "reference: two halves by {method}, {}{then}; --reference takes one that is there, --reference-time sets its time",
        ends.join(" or ")
    ));
}

/// Returns the reference. A reference that is rendered here is also written to the folder.
///
/// # Errors
/// The file cannot be written; a signal has stopped the render, after its file was written.
pub fn get(
    args: &ConvergeArgs,
    source: Source,
    View { scene, camera }: View<'_>,
    interrupt: &Interrupt,
    notes: &mut Vec<String>,
    runs: usize,
) -> Result<Reference> {
    let settings = match source {
        Source::File(reference) => return Ok(reference),
        Source::Own(settings) => settings,
    };
    if args.progress.for_people() {
        announce(args, &settings, runs);
    }
    let mut reporter = Reporter::new(args.progress);
    let halves = Halves::render(scene, camera, &settings, |iterations, seconds| {
        let by_time = settings.time.map_or(0.0, |time| seconds / time);
        let by_count = settings.iterations.map_or(0.0, |n| iterations as f64 / n as f64);
        reporter.reference(iterations, seconds, by_time.max(by_count).min(1.0));
        if interrupt.requested() { Control::Stop } else { Control::Continue }
    });
    reporter.finish();
    let reference = halves.reference();
    let path = args.output.join("reference.exr");
    reference.write(&path, &halves)?;
    if interrupt.requested() {
        let cause =
            format!("interrupted, the reference after {} iterations of each half is written", halves.iterations);
        return Err(Error::new(ErrorKind::Interrupted, path.display(), cause));
    }
    if settings.method.has_bandwidths() {
        notes.push(format!(
            "The reference's stated error is its noise. The remaining bias of {} is common to both halves and does not show in it.",
            settings.method.name()
        ));
    }
    Ok(reference)
}
