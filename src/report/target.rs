//! Time to target: iterations and seconds until a run's error has fallen to a given one, as Table 1 of \[CPPM 2020\].

use super::curve::{Curve, Mean, Spot};

/// An error to reach, and why this one.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// The error, in the report's metric.
    pub error: f64,
    /// Where it is from, such as `sppm after 1000 iterations`; empty for a number that was given.
    pub of: String,
}

/// When a run reaches a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reached {
    /// Means over seeds.
    After {
        /// Iterations, interpolated.
        iterations: Mean,
        /// Seconds, interpolated.
        seconds: Mean,
        /// Whether the first measurement was below already, so that these are upper bounds.
        at_once: bool,
    },
    /// Not within the run, which ended after so many iterations and seconds.
    Never(u64, f64),
    /// The reference is no better than the target.
    BelowReference,
    /// Nothing was measured.
    Unknown,
}

/// Where a curve first falls to `target`: iterations, seconds, and whether it began there. Between two moments the error is a power of each.
pub fn first(curve: &[Spot], target: f64) -> Option<(f64, f64, bool)> {
    let at = curve.iter().position(|spot| spot.figure <= target)?;
    let after = &curve[at];
    let Some(before) = at.checked_sub(1).map(|i| &curve[i]) else {
        return Some((after.iterations as f64, after.seconds, true));
    };
    let fall = before.figure.ln() - after.figure.ln();
    let t = if fall > 0.0 { (before.figure.ln() - target.ln()) / fall } else { 1.0 };
    let between = |a: f64, b: f64| if a > 0.0 && b > 0.0 { a * (b / a).powf(t) } else { b };
    let iterations = between(before.iterations as f64, after.iterations as f64);
    Some((iterations, between(before.seconds, after.seconds), false))
}

/// When a run reaches a target; `own` is the reference's error.
pub fn reach(curve: &Curve, target: f64, own: f64) -> Reached {
    if target <= own {
        return Reached::BelowReference;
    }
    let found: Vec<Option<(f64, f64, bool)>> = curve.by_seed.iter().map(|spots| first(spots, target)).collect();
    let all: Vec<(f64, f64, bool)> = found.iter().flatten().copied().collect();
    let values = |get: fn(&(f64, f64, bool)) -> f64| Mean::of(&all.iter().map(get).collect::<Vec<_>>());
    match (values(|f| f.0), values(|f| f.1)) {
        (Some(iterations), Some(seconds)) if all.len() == found.len() => {
            Reached::After { iterations, seconds, at_once: all.iter().any(|f| f.2) }
        }
        _ => {
            let ends: Vec<&Spot> = curve.by_seed.iter().filter_map(|spots| spots.last()).collect();
            let longest = ends.iter().max_by(|a, b| a.seconds.total_cmp(&b.seconds));
            longest.map_or(Reached::Unknown, |end| Reached::Never(end.iterations, end.seconds))
        }
    }
}

/// Targets where none are asked for: at most four errors of 1, 2, 5 times a power of ten, the smallest that two runs reach (one, if it is alone).
pub fn usual(curves: &[Curve], own: f64) -> Vec<Target> {
    let reported = |curve: &Curve| curve.mean.iter().filter(|spot| spot.reported).map(|s| s.figure).collect::<Vec<_>>();
    let figures: Vec<Vec<f64>> = curves.iter().map(reported).collect();
    let largest = figures.iter().flatten().copied().fold(0.0, f64::max);
    let reach = |error: f64| figures.iter().filter(|f| f.iter().any(|figure| *figure <= error)).count();
    let ladder = (-12..6).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10f64.powi(power)));
    let mut targets: Vec<f64> =
        ladder.filter(|&error| error > own && error < largest && reach(error) >= curves.len().min(2)).take(4).collect();
    targets.reverse();
    targets.into_iter().map(|error| Target { error, of: String::new() }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spots(figures: &[(u64, f64, f64)]) -> Vec<Spot> {
        let spot = |&(iterations, seconds, figure): &(u64, f64, f64)| Spot {
            iterations,
            seconds,
            figure,
            spread: None,
            reported: true,
        };
        figures.iter().map(spot).collect()
    }

    #[test]
    fn between_moments_the_error_is_a_power_of_time() {
        // N^-1/2 and a tenth of a second an iteration.
        let curve = spots(&[(1, 0.1, 1.0), (4, 0.4, 0.5), (16, 1.6, 0.25)]);
        let (n, s, at_once) = first(&curve, 1.0 / 3.0).expect("it is reached");
        assert!((n - 9.0).abs() < 1e-9 && (s - 0.9).abs() < 1e-9 && !at_once, "{n} {s}");
        assert_eq!(first(&curve, 2.0), Some((1.0, 0.1, true)));
        assert_eq!(first(&curve, 0.25).map(|f| f.0), Some(16.0));
        assert_eq!(first(&curve, 0.2), None);
    }

    #[test]
    fn answers_of_the_table() {
        let curve = |factor: f64| spots(&[(1, 0.1, factor), (4, 0.4, 0.5 * factor), (16, 1.6, 0.25 * factor)]);
        let two = Curve { mean: curve(1.0), by_seed: vec![curve(1.0), curve(1.0)] };
        assert_eq!(reach(&two, 0.1, 0.2), Reached::BelowReference);
        assert_eq!(reach(&two, 0.1, 0.0), Reached::Never(16, 1.6));
        let Reached::After { iterations, .. } = reach(&two, 0.5, 0.0) else { panic!("it is reached") };
        assert_eq!(iterations, Mean { value: 4.0, error: Some(0.0) });
        assert_eq!(reach(&Curve::default(), 0.5, 0.0), Reached::Unknown);
        let targets: Vec<f64> = usual(&[two.clone(), two], 0.0).iter().map(|t| t.error).collect();
        assert_eq!(targets, [0.5]);
    }
}
