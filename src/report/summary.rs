//! Evaluation of a comparison, which [`data`](super::data), [`plot`](super::plot) and [`page`](super::page) write.

use super::crop::Window;
use super::curve::{Axis, Curve, FitFailure, Slope};
use super::entry::{Entry, Metric, PictureSource};
use super::outcome::Outcome;
use super::overhead::{self, Overhead};
use super::point::Point;
use super::reference::Reference;
use super::strips::{self, Gallery};
use super::target::{self, Reached, Target};
use super::theory::{Theory, theory};
use crate::error;
use serde_json::Value;

pub use super::strips::{Crops, Seen, Strip};
pub use super::subject::{ReportOptions, Subject};

/// Mean of the picture of a peer, another renderer, relative to the reference, which shows whether the scene is the
/// same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanRatio {
    /// Mean of the peer's longest renders over the mean of the reference.
    pub ratio: f64,
    /// Standard error of the ratio, if the errors of pixels are independent.
    pub error: f64,
}

/// Largest deviation of a noise-free ratio of means from 1 with which two renderers count as rendering the same scene.
const MAX_DEVIATION: f64 = 0.01;

impl MeanRatio {
    /// Whether the ratio is 1 within `MAX_DEVIATION` and two standard errors, so that the peer renders the same
    /// scene.
    pub fn is_same(&self) -> bool {
        (self.ratio - 1.0).abs() <= MAX_DEVIATION + 2.0 * self.error
    }
}

/// All error curves of a comparison in one metric.
pub struct MetricCurves {
    /// The error metric.
    pub metric: Metric,
    /// One error curve for each line of the report, a run with its pictures either raw or denoised.
    pub curves: Vec<Curve>,
}

/// Evaluation of a comparison's measurements: curves, exponents, times to targets, and crops.
pub struct Summary {
    /// One error curve for each line of the report, in the report's metric.
    pub curves: Vec<Curve>,
    /// Error curves in a second metric: trimmed relMSE, or relMSE if the report's metric is the trimmed one.
    pub second: MetricCurves,
    /// Fitted exponents of each line's error, in iterations and in seconds.
    pub slopes: Vec<[Result<Slope, FitFailure>; 2]>,
    /// Exponent of each line's error by theory; `None` if theory has no closed form.
    pub theories: Vec<Option<Theory>>,
    /// Target errors, to which times are compared.
    pub targets: Vec<Target>,
    /// When each target is reached by each line, indexed by target and then by line.
    pub reached: Vec<Vec<Reached>>,
    /// For each peer, its mean relative to the reference; `None` if it has rendered no picture.
    pub mean_ratios: Vec<Option<MeanRatio>>,
    /// Cost of an iteration of each entry; `None` for a run without iterations.
    pub overhead: Vec<Option<Overhead>>,
    /// Windows, rectangles of pixels, of the crops.
    pub windows: Vec<Window>,
    /// The whole reference picture and its crops.
    pub reference: Crops,
    /// Crops of the curves' pictures at equal time and at equal error.
    pub strips: Vec<Strip>,
    /// The visible errors of the curves' pictures at equal time.
    pub seen: Vec<Seen>,
    /// Remarks about the comparison, in sentences.
    pub notes: Vec<String>,
}

/// Evaluates the measurements of a comparison.
///
/// # Errors
/// A stored picture cannot be read.
pub fn summarize(subject: &Subject, outcome: &mut Outcome, options: &ReportOptions) -> error::Result<Summary> {
    let Subject { entries, lines, metric, reference, .. } = subject;
    let own = reference.error.of(*metric).unwrap_or(0.0);
    let curves_in = |metric: Metric| -> Vec<Curve> {
        (0..lines.len()).map(|line| Curve::of(line, &outcome.points, metric, reference)).collect()
    };
    let curves = curves_in(*metric);
    let other = if *metric == Metric::RelMseTrimmed { Metric::RelMse } else { Metric::RelMseTrimmed };
    let second = MetricCurves { metric: other, curves: curves_in(other) };
    let mut notes = options.notes.clone();
    let mut targets: Vec<Target> =
        options.targets.iter().map(|&error| Target { error, origin: String::new() }).collect();
    for &(run, iterations) in &options.targets_of {
        let name = &entries[run].name;
        let line = lines.iter().position(|line| line.source == PictureSource::Estimate(run)).unwrap_or_default();
        match curves[line].mean.iter().find(|curve_point| curve_point.iterations == iterations) {
            Some(curve_point) => {
                targets.push(Target {
                    error: curve_point.figure,
                    origin: format!("{name} after {}", super::number::iterations(iterations)),
                });
            }
            None => notes.push(format!("{name} ended before {iterations} iterations: no target from there.")),
        }
    }
    if targets.is_empty() {
        targets = target::default_targets(&curves, own);
    }
    let reached = targets.iter().map(|t| curves.iter().map(|c| target::reach(c, t.error)).collect()).collect();
    notes.extend(remarks(*metric, reference, outcome, &curves));
    let Gallery { windows, reference: whole, strips, seen } = strips::gallery(subject, outcome, options, &curves)?;
    Ok(Summary {
        slopes: lines.iter().zip(&curves).map(|(line, curve)| slopes(line.source, curve)).collect(),
        theories: lines.iter().map(|line| theory_of(line.source, entries)).collect(),
        mean_ratios: (0..subject.peers.len()).map(|peer| mean_ratio(peer, subject, outcome)).collect(),
        curves,
        second,
        targets,
        reached,
        overhead: overhead::table(entries, &outcome.endings),
        windows,
        reference: whole,
        strips,
        seen,
        notes,
    })
}

/// Remarks about measurements that are left out, fireflies, failures and interruption.
fn remarks(metric: Metric, reference: &Reference, outcome: &Outcome, curves: &[Curve]) -> Vec<String> {
    let mut notes = Vec::new();
    let left_out = outcome.points.iter().filter(|p| reference.figure(metric, &p.errors).is_none()).count();
    if left_out > 0 {
        notes.push(format!(
            "{left_out} of {} measurements are at or below the reference's own error and are not reported.",
            outcome.points.len()
        ));
    }
    let ruled = curves.iter().filter(|curve| curve.last().is_some_and(|curve_point| curve_point.fireflies)).count();
    if ruled > 0 {
        notes.push(format!(
            "Fireflies dominate the last measurement of {ruled} of {} curves: the worst 0.5 % of the pixels hold more than \
             half of relMSE. Such figures change from seed to seed; trimmed ones leave these pixels out.",
            curves.len()
        ));
    }
    notes.extend(outcome.failures.iter().map(|error| format!("A run ended early: {error}.")));
    if outcome.interrupted {
        notes.push("The comparison was stopped before its end; this is what was done.".into());
    }
    notes
}

/// The fitted exponents of a curve in iterations and in seconds.
fn slopes(source: PictureSource, curve: &Curve) -> [Result<Slope, FitFailure>; 2] {
    [Axis::Iterations, Axis::Seconds]
        .map(|axis| if source.is_raw() { curve.slope(axis) } else { Err(FitFailure::Denoised) })
}

/// Exponent by theory of the error of pictures from `source`; `None` unless they are estimates of an entry, or if
/// theory has no closed form.
fn theory_of(source: PictureSource, entries: &[Entry]) -> Option<Theory> {
    match source {
        PictureSource::Estimate(entry) => theory(&entries[entry].settings),
        _ => None,
    }
}

/// Mean of a peer's pictures relative to the reference, over its longest render with every seed; `None` without a
/// picture.
fn mean_ratio(peer: usize, subject: &Subject, outcome: &Outcome) -> Option<MeanRatio> {
    let Subject { lines, reference, rules, .. } = subject;
    let line = lines.iter().position(|line| line.source == PictureSource::Peer(peer))?;
    let last = |seed: &u64| outcome.points.iter().rfind(|point| point.line == line && point.seed == *seed);
    let ends: Vec<&Point> = rules.seeds.iter().filter_map(last).collect();
    let ratios: Option<Vec<f64>> = ends.iter().map(|point| point.errors.mean_ratio).collect();
    let ratios = ratios.filter(|ratios| !ratios.is_empty())?;
    let n = ratios.len() as f64;
    let values = reference.picture.iter().flatten().map(|v| f64::from(*v)).filter(|v| v.is_finite());
    let mean = values.sum::<f64>() / (3.0 * reference.picture.len() as f64);
    let squares = ends.iter().map(|point| point.errors.mse).sum::<f64>() / n;
    let error = (squares / reference.picture.len() as f64 / n).sqrt() / mean;
    Some(MeanRatio { ratio: ratios.iter().sum::<f64>() / n, error })
}

/// Index of the entry with a name; `None` if there is none.
pub fn find(entries: &[Entry], name: &str) -> Option<usize> {
    entries.iter().position(|entry| entry.name == name)
}

/// A number as JSON; `null` if it is not finite.
pub(super) fn finite(x: f64) -> Value {
    if x.is_finite() { x.into() } else { Value::Null }
}
