//! Time to target: iterations and seconds until the error of a run has fallen to a target, as Table 1 of \[CPPM 2020\].

use super::curve::{Curve, CurvePoint, Mean, interpolate};

/// A target error, to which the report compares the times of runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// The error, in the report's metric.
    pub error: f64,
    /// Origin of the target, such as `sppm after 1000 iterations`; empty for a number that the user has given.
    pub origin: String,
}

/// When a run reaches a target error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reached {
    /// The run reaches the target after these means over seeds.
    After {
        /// Iterations until the target, interpolated.
        iterations: Mean,
        /// Wall-clock seconds until the target, interpolated.
        seconds: Mean,
        /// Core-seconds until the target, interpolated.
        core_seconds: Mean,
        /// Whether the first measurement was already below the target, so that the numbers are upper bounds.
        at_once: bool,
    },
    /// The run ended before it reached the target; holds its iterations and seconds.
    Never(u64, f64),
    /// The target is not above the reference's own error, so that reaching it cannot be measured.
    BelowReference,
    /// Nothing was measured for the run.
    Unknown,
}

/// Iterations, seconds and core-seconds from which on a curve stays at or below the error `target`, and whether it was
/// always there. The error is interpolated as a power of each; `None` if the curve ends above the target.
pub fn crossing(curve: &Curve, target: f64) -> Option<([f64; 3], bool)> {
    let place =
        |curve_point: &CurvePoint| [curve_point.iterations as f64, curve_point.seconds, curve_point.cpu_seconds];
    let curve_points = &curve.mean;
    let Some(last_above) = curve_points.iter().rposition(|curve_point| curve_point.figure > target) else {
        return curve_points.first().map(|first| (place(first), true));
    };
    let (before, after) = (&curve_points[last_above], curve_points.get(last_above + 1)?);
    // Errors below the reference's own are unknown.
    let [high, low] = [before.figure, after.figure].map(|figure| figure.max(curve.own));
    let t = if low > 0.0 && high > low { (high / target).ln() / (high / low).ln() } else { 1.0 };
    let (before, after) = (place(before), place(after));
    Some((std::array::from_fn(|i| interpolate(before[i], after[i], t)), false))
}

/// When a run reaches a target error, by its mean curve, with the jackknife's standard error over seeds.
pub fn reach(curve: &Curve, target: f64) -> Reached {
    if target <= curve.own {
        return Reached::BelowReference;
    }
    let Some((place, at_once)) = crossing(curve, target) else {
        return curve.last().map_or(Reached::Unknown, |end| Reached::Never(end.iterations, end.seconds));
    };
    let without: Vec<Curve> = curve.without_each_seed();
    let others: Vec<[f64; 3]> = without.iter().filter_map(|curve| Some(crossing(curve, target)?.0)).collect();
    let jackknife = |i: usize| {
        let n = others.len() as f64;
        let mean = others.iter().map(|other| other[i]).sum::<f64>() / n;
        let squares: f64 = others.iter().map(|other| (other[i] - mean).powi(2)).sum();
        (n > 1.0 && others.len() == curve.by_seed.len()).then(|| (squares * (n - 1.0) / n).sqrt())
    };
    let [iterations, seconds, core_seconds] = std::array::from_fn(|i| Mean { value: place[i], error: jackknife(i) });
    Reached::After { iterations, seconds, core_seconds, at_once }
}

/// Default target errors: at most four errors of 1, 2 or 5 times a power of ten, the smallest that two runs reach (or
/// the only run). `own` is the reference's own error.
pub fn default_targets(curves: &[Curve], own: f64) -> Vec<Target> {
    let reported = |curve: &Curve| {
        curve.mean.iter().filter(|curve_point| curve_point.reported).map(|s| s.figure).collect::<Vec<_>>()
    };
    let figures: Vec<Vec<f64>> = curves.iter().map(reported).collect();
    let largest = figures.iter().flatten().copied().fold(0.0, f64::max);
    let reach = |error: f64| figures.iter().filter(|f| f.iter().any(|figure| *figure <= error)).count();
    let ladder = (-12..6).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10f64.powi(power)));
    let mut targets: Vec<f64> =
        ladder.filter(|&error| error > own && error < largest && reach(error) >= curves.len().min(2)).take(4).collect();
    targets.reverse();
    targets.into_iter().map(|error| Target { error, origin: String::new() }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    fn curve_points(figures: &[(u64, f64, f64)]) -> Vec<CurvePoint> {
        let curve_point = |&(iterations, seconds, figure): &(u64, f64, f64)| CurvePoint {
            iterations,
            seconds,
            cpu_seconds: 2.0 * seconds,
            figure,
            spread: None,
            reported: true,
            fireflies: false,
        };
        figures.iter().map(curve_point).collect()
    }

    fn one(figures: &[(u64, f64, f64)]) -> Curve {
        Curve::from_seeds(vec![curve_points(figures)], 0.0)
    }

    #[test]
    fn the_error_is_interpolated_as_a_power_of_time() {
        // N^-1/2, and 0.1 s per iteration.
        let curve = one(&[(1, 0.1, 1.0), (4, 0.4, 0.5), (16, 1.6, 0.25)]);
        let ([n, s, c], at_once) = crossing(&curve, 1.0 / 3.0).expect("it is reached");
        assert!((n - 9.0).abs() < 1e-9 && (s - 0.9).abs() < 1e-9 && (c - 1.8).abs() < 1e-9 && !at_once, "{n} {s} {c}");
        assert_eq!(crossing(&curve, 2.0), Some(([1.0, 0.1, 0.2], true)));
        assert_eq!(crossing(&curve, 0.25).map(|f| f.0[0]), Some(16.0));
        assert_eq!(crossing(&curve, 0.2), None);
        // After a firefly the error must fall again: the last crossing counts.
        let curve = one(&[(1, 0.1, 1.0), (4, 0.4, 0.5), (8, 0.8, 2.0), (32, 3.2, 0.5)]);
        assert_eq!(crossing(&curve, 1.0), Some(([16.0, 1.6, 3.2], false)));
    }

    #[test]
    fn targets_have_the_right_results() {
        let of = |factor: f64| curve_points(&[(1, 0.1, factor), (4, 0.4, 0.5 * factor), (16, 1.6, 0.25 * factor)]);
        let two = |own: f64| Curve::from_seeds(vec![of(1.0), of(1.0)], own);
        assert_eq!(reach(&two(0.2), 0.1), Reached::BelowReference);
        assert_eq!(reach(&two(0.0), 0.1), Reached::Never(16, 1.6));
        let Reached::After { iterations, .. } = reach(&two(0.0), 0.5) else { panic!("it is reached") };
        assert_eq!(iterations, Mean { value: 4.0, error: Some(0.0) });
        assert_eq!(reach(&Curve::default(), 0.5), Reached::Unknown);
        let targets: Vec<f64> = default_targets(&[two(0.0), two(0.0)], 0.0).iter().map(|t| t.error).collect();
        assert_eq!(targets, [0.5]);
    }
}
