//! The report as CSV and JSON.

use super::curve::{Mean, Slope, Spot};
use super::race::{Outcome, Point};
use super::summary::{Subject, Summary, finite};
use super::target::Reached;
use crate::error::{Error, Kind, Result};
use serde::Serialize;
use serde_json::{Value, json};

/// A measurement: a row of the CSV, an object of the JSON.
#[derive(Serialize)]
struct Row<'a> {
    run: &'a str,
    method: &'a str,
    seed: u64,
    iterations: u64,
    light_paths: u64,
    seconds: f64,
    cpu_seconds: f64,
    finish_seconds: Option<f64>,
    /// The error of the report's metric without the reference's own; none at or below that.
    figure: Option<f64>,
    relmse: f64,
    relmse_trimmed: f64,
    mse: f64,
    mean_ratio: Option<f64>,
    estimated_error: Option<f64>,
}

impl<'a> Row<'a> {
    fn of(subject: &'a Subject, point: &Point) -> Row<'a> {
        let entry = &subject.entries[point.run];
        Row {
            run: &entry.name,
            method: entry.settings.method.name(),
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
        }
    }
}

/// `points.csv`: a header line, then a row per run, seed and moment.
///
/// # Errors
/// None that memory would not have.
pub fn csv(subject: &Subject, outcome: &Outcome) -> Result<Vec<u8>> {
    let failed = |cause: &dyn std::fmt::Display| Error::new(Kind::Io, "points.csv", cause);
    let mut writer = csv::Writer::from_writer(Vec::new());
    for point in &outcome.points {
        writer.serialize(Row::of(subject, point)).map_err(|cause| failed(&cause))?;
    }
    writer.into_inner().map_err(|cause| failed(&cause))
}

/// `points.json`: everything that the page shows, but for pictures.
pub fn json(subject: &Subject, outcome: &Outcome, summary: &Summary) -> Value {
    let map = |pairs: &[(String, String)]| {
        pairs.iter().map(|(name, value)| (name.clone(), Value::from(value.as_str()))).collect::<Value>()
    };
    let rules = &subject.rules;
    let runs = subject.entries.iter().enumerate().map(|(run, entry)| {
        let mut object = entry.object();
        object["theory"] = summary.theories[run]
            .map_or(Value::Null, |theory| json!({"exponent": theory.exponent, "because": theory.because}));
        let [by_iterations, by_seconds] = &summary.slopes[run];
        object["fit_iterations"] = by_iterations.as_ref().map_or(Value::Null, slope);
        object["fit_seconds"] = by_seconds.as_ref().map_or(Value::Null, slope);
        object["curve"] = summary.curves[run].mean.iter().filter(|spot| spot.reported).map(spot).collect();
        object["overhead"] = json!(summary.overhead[run]);
        object
    });
    let targets = summary.targets.iter().zip(&summary.reached).map(|(target, reached)| {
        let answers = subject.entries.iter().zip(reached).map(|(entry, reached)| answer(&entry.name, reached));
        let of = Some(&target.of).filter(|of| !of.is_empty());
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
        "windows": summary.windows,
        "notes": summary.notes,
        "points": outcome.points.iter().map(|point| json!(Row::of(subject, point))).collect::<Vec<_>>(),
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

fn spot(spot: &Spot) -> Value {
    let Spot { iterations, seconds, figure, spread, .. } = *spot;
    json!({"iterations": iterations, "seconds": seconds, "figure": finite(figure), "standard_error": spread.map(finite)})
}

fn answer(run: &str, reached: &Reached) -> Value {
    match reached {
        Reached::After { iterations, seconds, at_once } => json!({
            "run": run, "reached": true, "iterations": mean(iterations), "seconds": mean(seconds), "upper_bound": at_once,
        }),
        Reached::Never(iterations, seconds) => json!({
            "run": run, "reached": false, "ended_after": {"iterations": iterations, "seconds": seconds},
        }),
        Reached::BelowReference => json!({"run": run, "reached": null, "because": "below the reference's error"}),
        Reached::Unknown => json!({"run": run, "reached": null, "because": "nothing was measured"}),
    }
}
