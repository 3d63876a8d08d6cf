//! Error curves of runs, and their slopes.

use super::entry::Metric;
use super::point::Point;
use super::reference::Reference;
use crate::image::Errors;
use crate::stat::{PowerLaw, TRIMMED_SHARE};
use std::fmt;

/// A mean over seeds and its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mean {
    /// Mean over the seeds.
    pub value: f64,
    /// Standard error of the mean; `None` with a single value.
    pub error: Option<f64>,
}

impl Mean {
    /// The mean of `values` and its standard error; `None` if there are no values.
    pub fn of(values: &[f64]) -> Option<Mean> {
        let n = values.len() as f64;
        let value = values.iter().sum::<f64>() / n;
        let squares = values.iter().map(|v| (v - value).powi(2)).sum::<f64>();
        let error = (values.len() > 1).then(|| (squares / (n - 1.0) / n).sqrt());
        (!values.is_empty()).then_some(Mean { value, error })
    }
}

/// A point of an error curve: time, and the error of the picture at this time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint {
    /// Iterations done; samples per pixel for other renderers.
    pub iterations: u64,
    /// Wall-clock seconds of the run so far.
    pub seconds: f64,
    /// Core-seconds of the run so far.
    pub cpu_seconds: f64,
    /// The picture's error, in the curve's metric, after subtraction of the reference's own error.
    pub figure: f64,
    /// Standard error of `figure` over seeds; `None` with a single seed.
    pub spread: Option<f64>,
    /// Whether the figure exceeds the reference's own error; smaller figures are not reported.
    pub reported: bool,
    /// Whether fireflies dominate the error with at least one seed, see [`fireflies`].
    pub fireflies: bool,
}

/// Whether a few bright samples dominate a picture's error: the worst 0.5 % of the pixels hold more than half of its
/// relMSE. With uniform Gaussian noise they hold 2 to 5 %.
pub fn fireflies(errors: &Errors) -> bool {
    (1.0 - TRIMMED_SHARE) * errors.relmse_trimmed < 0.5 * errors.relmse
}

/// The error of the pictures of one run against iterations and seconds.
#[derive(Clone, Debug, Default)]
pub struct Curve {
    /// Points of the mean over seeds, in order of iterations.
    pub mean: Vec<CurvePoint>,
    /// Points of the curve of every seed, in order of iterations.
    pub by_seed: Vec<Vec<CurvePoint>>,
    /// The reference's own error, in the curve's metric.
    pub own: f64,
}

/// Interpolates from `a` to `b` at `t` in 0 to 1: geometrically if both are above zero, else linearly.
pub(super) fn interpolate(a: f64, b: f64, t: f64) -> f64 {
    if a > 0.0 && b > 0.0 { a * (b / a).powf(t) } else { a + t * (b - a) }
}

/// Seconds, core-seconds and figure of a curve after `iterations`, interpolated as a power of iterations; `None`
/// outside the curve.
fn values_at(curve: &[CurvePoint], iterations: u64) -> Option<[f64; 3]> {
    let values = |curve_point: &CurvePoint| [curve_point.seconds, curve_point.cpu_seconds, curve_point.figure];
    let next = curve.iter().position(|curve_point| curve_point.iterations >= iterations)?;
    let after = &curve[next];
    let Some(before) = next.checked_sub(1).map(|i| &curve[i]).filter(|_| after.iterations > iterations) else {
        return (after.iterations == iterations).then_some(values(after));
    };
    let t =
        (iterations as f64 / before.iterations as f64).ln() / (after.iterations as f64 / before.iterations as f64).ln();
    let (before, after) = (values(before), values(after));
    Some(std::array::from_fn(|i| interpolate(before[i], after[i], t)))
}

/// The exponent of a power law fitted to an error curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slope {
    /// Exponent with its standard error: over seeds, or with a single seed from the scatter about the line.
    pub exponent: Mean,
    /// The power law fitted to the mean curve.
    pub line: PowerLaw,
    /// First and last fitted value on the horizontal axis.
    pub range: (f64, f64),
    /// Number of points that the power law is fitted to.
    pub points: usize,
}

/// The reason why no exponent is reported for a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FitFailure {
    /// Fewer than `MIN_POINTS` measurements in the last decade exceed the reference's own error; holds their number.
    Few(usize),
    /// The measurements span a ratio of less than `MIN_SPAN` on the axis.
    Narrow,
    /// Fireflies dominate the error of some measurements; holds their number.
    Fireflies(usize),
    /// The exponent's standard error exceeds `MAX_EXPONENT_ERROR`; holds the standard error.
    Scattered(f64),
    /// The pictures are denoised, and their error follows no power law.
    Denoised,
}

impl fmt::Display for FitFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FitFailure::Few(n) => write!(f, "{n} measurements are too few"),
            FitFailure::Narrow => write!(f, "the measurements span too little"),
            FitFailure::Fireflies(n) => write!(f, "fireflies dominate {n} of the measurements"),
            FitFailure::Scattered(error) => write!(f, "the measurements scatter too much (± {error:.1})"),
            FitFailure::Denoised => write!(f, "denoised pictures follow no power"),
        }
    }
}

/// Minimum number of points to fit an exponent to.
const MIN_POINTS: usize = 4;
/// Minimum ratio of the last to the first fitted value on the axis.
const MIN_SPAN: f64 = 4.0;
/// Maximum standard error of a reported exponent: half the difference between the exponents of theory, 2/3 and 1.
const MAX_EXPONENT_ERROR: f64 = 1.0 / 6.0;

/// The quantity on the horizontal axis of an error curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Iterations of the render.
    Iterations,
    /// Wall-clock seconds of the render.
    Seconds,
    /// Core-seconds of the render.
    CoreSeconds,
}

impl Axis {
    /// The value of a curve's point on this axis.
    pub fn of(self, curve_point: &CurvePoint) -> f64 {
        match self {
            Axis::Iterations => curve_point.iterations as f64,
            Axis::Seconds => curve_point.seconds,
            Axis::CoreSeconds => curve_point.cpu_seconds,
        }
    }
}

impl Curve {
    /// The error curve in a metric of the line with index `line`, from the measurements `points` of all lines.
    pub fn of(line: usize, points: &[Point], metric: Metric, reference: &Reference) -> Curve {
        let own = reference.error.of(metric).unwrap_or(0.0);
        let mut by_seed: Vec<(u64, Vec<CurvePoint>)> = Vec::new();
        for point in points.iter().filter(|point| point.line == line) {
            let figure = metric.of(&point.errors) - own;
            let reported = reference.figure(metric, &point.errors).is_some();
            let Point { iterations, seconds, cpu_seconds, .. } = *point;
            let fireflies = metric == Metric::RelMse && fireflies(&point.errors);
            let curve_point =
                CurvePoint { iterations, seconds, cpu_seconds, figure, spread: None, reported, fireflies };
            match by_seed.iter_mut().find(|(seed, _)| *seed == point.seed) {
                Some((_, curve_points)) => curve_points.push(curve_point),
                None => by_seed.push((point.seed, vec![curve_point])),
            }
        }
        Curve::from_seeds(by_seed.into_iter().map(|(_, curve_points)| curve_points).collect(), own)
    }

    /// The curve of several seeds, one list of points each; its mean ends where the shortest of them ends. Curves that
    /// a clock has stopped end at different iterations: a curve is interpolated where only others have a point. `own`
    /// is the reference's own error.
    pub fn from_seeds(by_seed: Vec<Vec<CurvePoint>>, own: f64) -> Curve {
        let mut moments: Vec<u64> = by_seed.iter().flatten().map(|curve_point| curve_point.iterations).collect();
        moments.sort_unstable();
        moments.dedup();
        let mean = |&iterations: &u64| {
            let all: Vec<[f64; 3]> = by_seed.iter().map(|curve| values_at(curve, iterations)).collect::<Option<_>>()?;
            let mean = |i: usize| Mean::of(&all.iter().map(|curve_point| curve_point[i]).collect::<Vec<_>>());
            let figure = mean(2)?;
            let here = |curve_point: &&CurvePoint| curve_point.iterations == iterations;
            Some(CurvePoint {
                iterations,
                seconds: mean(0)?.value,
                cpu_seconds: mean(1)?.value,
                figure: figure.value,
                spread: figure.error,
                reported: figure.value > own && figure.value > 0.0,
                fireflies: by_seed.iter().flatten().filter(here).any(|curve_point| curve_point.fireflies),
            })
        };
        Curve { mean: moments.iter().filter_map(mean).collect(), by_seed, own }
    }

    /// For each seed the curve of the other seeds, for the jackknife; empty with a single seed.
    pub fn without_each_seed(&self) -> Vec<Curve> {
        let without = |left: usize| {
            let rest = self.by_seed.iter().enumerate().filter(|(seed, _)| *seed != left);
            Curve::from_seeds(rest.map(|(_, curve_points)| curve_points.clone()).collect(), self.own)
        };
        if self.by_seed.len() > 1 { (0..self.by_seed.len()).map(without).collect() } else { Vec::new() }
    }

    /// The last point of the mean curve; `None` for an empty curve.
    pub fn last(&self) -> Option<&CurvePoint> {
        self.mean.last()
    }

    /// Fits the exponent of the error over the last decade of iterations.
    ///
    /// # Errors
    /// The reason why the exponent would be meaningless.
    pub fn slope(&self, axis: Axis) -> Result<Slope, FitFailure> {
        let last = self.last().ok_or(FitFailure::Few(0))?.iterations;
        let decade = |curve_point: &&CurvePoint| curve_point.reported && curve_point.iterations * 10 >= last;
        let fit = |curve: &[CurvePoint]| {
            let curve_points: Vec<&CurvePoint> = curve.iter().filter(decade).collect();
            let points: Vec<(f64, f64)> =
                curve_points.iter().map(|curve_point| (axis.of(curve_point), curve_point.figure)).collect();
            let ends = points.first().zip(points.last()).map(|(first, last)| (first.0, last.0));
            let Some(range) = ends.filter(|_| points.len() >= MIN_POINTS) else {
                return Err(FitFailure::Few(points.len()));
            };
            let ruled = curve_points.iter().filter(|curve_point| curve_point.fireflies).count();
            match PowerLaw::fit(points.iter().copied()) {
                _ if range.1 < MIN_SPAN * range.0 => Err(FitFailure::Narrow),
                _ if ruled > 0 => Err(FitFailure::Fireflies(ruled)),
                Some(line) if line.exponent_error <= MAX_EXPONENT_ERROR => Ok((line, range, points.len())),
                Some(line) => Err(FitFailure::Scattered(line.exponent_error)),
                None => Err(FitFailure::Narrow),
            }
        };
        let (line, range, points) = fit(&self.mean)?;
        let seeds: Vec<f64> =
            self.by_seed.iter().filter_map(|curve| fit(curve).ok().map(|(line, ..)| line.exponent)).collect();
        let exponent = Mean::of(&seeds).filter(|mean| mean.error.is_some() && seeds.len() == self.by_seed.len());
        let single = Mean { value: line.exponent, error: Some(line.exponent_error) };
        Ok(Slope { exponent: exponent.unwrap_or(single), line, range, points })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_curve_ends_with_the_shortest_seed() {
        let curve_point = |iterations: u64, figure: f64| CurvePoint {
            iterations,
            seconds: 0.5 * iterations as f64,
            cpu_seconds: iterations as f64,
            figure,
            spread: None,
            reported: true,
            fireflies: false,
        };
        let power = |factor: f64, moments: &[u64]| moments.iter().map(|&n| curve_point(n, factor / n as f64)).collect();
        let curve = Curve::from_seeds(vec![power(1.0, &[1, 2, 4, 8]), power(3.0, &[1, 2, 4, 7])], 0.2);
        let shown: Vec<(u64, f64)> =
            curve.mean.iter().map(|curve_point| (curve_point.iterations, curve_point.figure)).collect();
        assert_eq!(shown.len(), 4);
        assert_eq!((shown[0], shown[2], shown[3].0), ((1, 2.0), (4, 0.5), 7));
        assert!((shown[3].1 - 2.0 / 7.0).abs() < 1e-12 && (curve.mean[3].seconds - 3.5).abs() < 1e-12, "{shown:?}");
        assert!((curve.mean[3].cpu_seconds - 7.0).abs() < 1e-12);
        assert_eq!(curve.mean[0].spread, Some(1.0));
        let slope = curve.slope(Axis::Seconds).expect("four moments");
        assert!((slope.exponent.value + 1.0).abs() < 1e-12 && slope.exponent.error.is_some_and(|e| e < 1e-12));
        assert_eq!(curve.without_each_seed()[0].mean[3].iterations, 7);
        // Without a figure above the reference's own error there is nothing to fit.
        let below = Curve::from_seeds(vec![power(0.1, &[1, 2, 4, 8])], 0.2).slope(Axis::Iterations);
        assert_eq!(below.err(), Some(FitFailure::Few(0)));
    }

    #[test]
    fn meaningless_exponents_are_not_reported() {
        let curve_point = |&(iterations, figure): &(u64, f64)| CurvePoint {
            iterations,
            seconds: iterations as f64,
            cpu_seconds: iterations as f64,
            figure,
            spread: None,
            reported: true,
            fireflies: figure > 1.0,
        };
        let fit = |points: &[(u64, f64)]| {
            Curve::from_seeds(vec![points.iter().map(curve_point).collect()], 0.0).slope(Axis::Iterations)
        };
        let line = [(10, 1.0), (20, 0.5), (40, 0.25), (80, 0.125)];
        assert!(fit(&line).is_ok_and(|slope| (slope.exponent.value + 1.0).abs() < 1e-12 && slope.points == 4));
        assert_eq!(fit(&line[1..]), Err(FitFailure::Few(3)));
        assert_eq!(fit(&[(10, 1.0), (12, 0.8), (14, 0.7), (16, 0.6)]), Err(FitFailure::Narrow));
        assert_eq!(fit(&[(10, 1.0), (20, 1.1), (40, 0.25), (80, 0.125)]), Err(FitFailure::Fireflies(1)));
        assert!(matches!(fit(&[(10, 1.0), (20, 0.1), (40, 0.9), (80, 0.1)]), Err(FitFailure::Scattered(_))));
    }

    /// Uniform Gaussian noise has no fireflies; a few pixels with a hundred times the error are fireflies.
    #[test]
    fn fireflies_are_distinguished_from_noise() {
        let of = |relmse: f64, relmse_trimmed: f64| {
            fireflies(&Errors { relmse, relmse_trimmed, mse: 1.0, mean_ratio: None })
        };
        assert!(!of(1.0, 0.94 / 0.995) && of(1.0, 0.3) && !of(0.0, 0.0));
    }
}
