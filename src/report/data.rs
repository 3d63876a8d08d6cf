//! The report as CSV and JSON.

use super::curve::{CurvePoint, FitFailure, Mean, Slope, fireflies};
use super::entry::PictureSource;
use super::outcome::Outcome;
use super::point::Point;
use super::summary::{Seen, Subject, Summary, finite};
use super::target::Reached;
use super::verdict::verdict;
use crate::error::{Error, ErrorKind, Result};
use crate::image::Comparison;
use serde::Serialize;
use serde_json::{Value, json};

/// A measurement of one picture: a row of the CSV and an object of the JSON.
#[derive(Serialize)]
struct Row<'a> {
    run: &'a str,
    method: &'static str,
    seed: u64,
    iterations: u64,
    light_paths: u64,
    seconds: f64,
    cpu_seconds: f64,
    finish_seconds: Option<f64>,
    /// The error in the report's metric after subtraction of the reference's own; `None` if it does not exceed that.
    figure: Option<f64>,
    relmse: f64,
    relmse_trimmed: f64,
    mse: f64,
    mean_ratio: Option<f64>,
    estimated_error: Option<f64>,
    fireflies: bool,
}

impl<'a> Row<'a> {
    fn of(subject: &'a Subject, point: &Point) -> Row<'a> {
        let line = &subject.lines[point.line];
        Row {
            run: &line.name,
            method: method(subject, line.source),
            seed: point.seed,
            iterations: point.iterations,
            light_paths: point.light_paths,
            seconds: point.seconds,
            cpu_seconds: point.cpu_seconds,
            finish_seconds: point.finish_seconds,
            figure: subject.reference.figure(subject.metric, &point.errors),
            relmse: point.errors.relmse,
            relmse_trimmed: point.errors.relmse_trimmed,
            mse: point.errors.mse,
            mean_ratio: point.errors.mean_ratio,
            estimated_error: point.estimate.map(f64::sqrt),
            fireflies: fireflies(&point.errors),
        }
    }
}

/// The method of the entry behind a curve, or the mode of another renderer.
fn method(subject: &Subject, source: PictureSource) -> &'static str {
    match source {
        PictureSource::Estimate(entry) | PictureSource::Finished(entry) => {
            subject.entries[entry].settings.method.name()
        }
        PictureSource::Peer(peer) | PictureSource::Denoised(peer) => subject.peers[peer].mode,
    }
}

/// The bytes of `points.csv`: a header line, then a row for each measurement.
///
/// # Errors
/// None beyond lack of memory.
pub fn csv(subject: &Subject, outcome: &Outcome) -> Result<Vec<u8>> {
    let failed = |cause: &dyn std::fmt::Display| Error::new(ErrorKind::Io, "points.csv", cause);
    let mut writer = csv::Writer::from_writer(Vec::new());
    for point in &outcome.points {
        writer.serialize(Row::of(subject, point)).map_err(|cause| failed(&cause))?;
    }
    writer.into_inner().map_err(|cause| failed(&cause))
}

/// `points.json`: the contents of the page without its pictures.
pub fn json(subject: &Subject, outcome: &Outcome, summary: &Summary) -> Value {
    let map = |pairs: &[(String, String)]| {
        pairs.iter().map(|(name, value)| (name.clone(), Value::from(value.as_str()))).collect::<Value>()
    };
    let rules = &subject.rules;
    let runs = (0..subject.lines.len()).map(|line| run(subject, outcome, summary, line));
    let targets = summary.targets.iter().zip(&summary.reached).map(|(target, reached)| {
        let answers = subject.lines.iter().zip(reached).map(|(line, reached)| answer(&line.name, reached));
        let of = Some(&target.origin).filter(|of| !of.is_empty());
        json!({"error": finite(target.error), "of": of, "runs": answers.collect::<Vec<_>>()})
    });
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "scene": subject.scene,
        "width": subject.size.0,
        "height": subject.size.1,
        "metric": subject.metric,
        "settings": map(&subject.settings),
        "machine": map(&subject.machine),
        "time": rules.time,
        "iterations": rules.iterations,
        "moments": rules.ratio,
        "seeds": rules.seeds,
        "interrupted": outcome.interrupted,
        "reference": {
            "from": subject.reference.about,
            "error": subject.reference.error.object(),
        },
        "runs": runs.collect::<Vec<_>>(),
        "targets": targets.collect::<Vec<_>>(),
        "at_equal_time": summary.seen.iter().map(|seen| visible(subject, seen)).collect::<Vec<_>>(),
        "windows": summary.windows,
        "verdict": verdict(subject, summary),
        "notes": summary.notes,
        "points": outcome.points.iter().map(|point| json!(Row::of(subject, point))).collect::<Vec<_>>(),
    })
}

/// The JSON object of the curve with index `line`, with the settings of its entry or the facts about its peer.
fn run(subject: &Subject, outcome: &Outcome, summary: &Summary, line: usize) -> Value {
    let source = subject.lines[line].source;
    let mut object = match source {
        PictureSource::Estimate(entry) | PictureSource::Finished(entry) => subject.entries[entry].object(),
        PictureSource::Peer(peer) | PictureSource::Denoised(peer) => peer_object(subject, outcome, summary, peer),
    };
    object["name"] = subject.lines[line].name.as_str().into();
    object["finish"] = match source {
        PictureSource::Finished(entry) => json!(subject.entries[entry].finish),
        PictureSource::Denoised(_) => "Open Image Denoise".into(),
        _ => Value::Null,
    };
    object["theory"] = summary.theories[line]
        .map_or(Value::Null, |theory| json!({"exponent": theory.exponent, "because": theory.because}));
    for (name, fit) in ["fit_iterations", "fit_seconds"].into_iter().zip(&summary.slopes[line]) {
        object[name] = fit.as_ref().map_or(Value::Null, slope);
    }
    object["no_fit"] = summary.slopes[line][0].as_ref().err().map(FitFailure::to_string).into();
    object["curve"] =
        summary.curves[line].mean.iter().filter(|curve_point| curve_point.reported).map(curve_point).collect();
    if let PictureSource::Estimate(entry) = source {
        object["overhead"] = json!(summary.overhead[entry]);
    }
    object
}

/// The JSON object of the visible errors of a picture.
fn visible(subject: &Subject, seen: &Seen) -> Value {
    let Comparison { relmse_trimmed, flip, grain, inside, .. } = seen.errors;
    json!({
        "run": subject.lines[seen.line].name, "iterations": seen.iterations, "seconds": seen.seconds,
        "relmse_trimmed": relmse_trimmed, "flip": flip, "grain": grain, "inside": inside,
    })
}

/// The JSON object of facts about another renderer, by its index.
fn peer_object(subject: &Subject, outcome: &Outcome, summary: &Summary, peer: usize) -> Value {
    let facts = &outcome.peers[peer];
    let startup = Mean::of(&facts.startups).map(|mean| mean.value);
    let ratio = summary.mean_ratios[peer];
    json!({
        "renderer": format!("{:?}", subject.peers[peer].renderer).to_lowercase(),
        "mode": subject.peers[peer].mode,
        "version": facts.version,
        "startup_seconds": startup,
        "approximations": facts.approximations,
        "unfinished": facts.unfinished,
        "out": facts.left_out,
        "mean_ratio": ratio.map(|mean| json!({"value": finite(mean.ratio), "standard_error": finite(mean.error)})),
        "same_scene": ratio.map(|mean| mean.is_same()),
    })
}

fn mean(mean: &Mean) -> Value {
    json!({"value": finite(mean.value), "standard_error": mean.error.map(finite)})
}

fn slope(slope: &Slope) -> Value {
    json!({
        "exponent": mean(&slope.exponent),
        "factor": finite(slope.line.factor),
        "from": slope.range.0,
        "to": slope.range.1,
        "points": slope.points,
    })
}

fn curve_point(curve_point: &CurvePoint) -> Value {
    let CurvePoint { iterations, seconds, cpu_seconds, figure, spread, fireflies, .. } = *curve_point;
    json!({
        "iterations": iterations, "seconds": seconds, "cpu_seconds": cpu_seconds, "figure": finite(figure),
        "standard_error": spread.map(finite), "fireflies": fireflies,
    })
}

fn answer(run: &str, reached: &Reached) -> Value {
    match reached {
        Reached::After { iterations, seconds, core_seconds, at_once } => json!({
            "run": run, "reached": true, "iterations": mean(iterations), "seconds": mean(seconds),
            "cpu_seconds": mean(core_seconds), "upper_bound": at_once,
        }),
        Reached::Never(iterations, seconds) => json!({
            "run": run, "reached": false, "ended_after": {"iterations": iterations, "seconds": seconds},
        }),
        Reached::BelowReference => json!({"run": run, "reached": null, "because": "below the reference's error"}),
        Reached::Unknown => json!({"run": run, "reached": null, "because": "nothing was measured"}),
    }
}
