//! From points to a curve per run, and its slope.

use super::entry::Metric;
use super::race::Point;
use super::reference::Reference;
use crate::stat::PowerLaw;

/// A mean over seeds and its standard error, which one seed does not tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mean {
    /// The mean.
    pub value: f64,
    /// Its standard error.
    pub error: Option<f64>,
}

impl Mean {
    /// Of values; `None` if there are none.
    pub fn of(values: &[f64]) -> Option<Mean> {
        let n = values.len() as f64;
        let value = values.iter().sum::<f64>() / n;
        let squares = values.iter().map(|v| (v - value).powi(2)).sum::<f64>();
        let error = (values.len() > 1).then(|| (squares / (n - 1.0) / n).sqrt());
        (!values.is_empty()).then_some(Mean { value, error })
    }
}

/// A run at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Iterations done.
    pub iterations: u64,
    /// Wall-clock seconds.
    pub seconds: f64,
    /// The error without the reference's own.
    pub figure: f64,
    /// Its standard error over seeds.
    pub spread: Option<f64>,
    /// Whether the figure is above the reference's own error, so that it may be reported.
    pub reported: bool,
}

/// A run's error against iterations and seconds.
#[derive(Clone, Debug, Default)]
pub struct Curve {
    /// Mean over seeds, by iterations.
    pub mean: Vec<Spot>,
    /// Of every seed.
    pub by_seed: Vec<Vec<Spot>>,
    /// The reference's own error.
    pub own: f64,
}

/// A share `t` of the way from `a` to `b`: a power where both are above zero.
pub(super) fn between(a: f64, b: f64, t: f64) -> f64 {
    if a > 0.0 && b > 0.0 { a * (b / a).powf(t) } else { a + t * (b - a) }
}

/// Seconds and figure after so many iterations, between two moments as a power of iterations.
fn at(curve: &[Spot], iterations: u64) -> Option<(f64, f64)> {
    let next = curve.iter().position(|spot| spot.iterations >= iterations)?;
    let after = &curve[next];
    let Some(before) = next.checked_sub(1).map(|i| &curve[i]).filter(|_| after.iterations > iterations) else {
        return (after.iterations == iterations).then_some((after.seconds, after.figure));
    };
    let t =
        (iterations as f64 / before.iterations as f64).ln() / (after.iterations as f64 / before.iterations as f64).ln();
    Some((between(before.seconds, after.seconds, t), between(before.figure, after.figure, t)))
}

/// A fitted exponent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slope {
    /// Exponent with its standard error: over seeds, or, with one, from the scatter about the line.
    pub exponent: Mean,
    /// The line through the mean curve.
    pub line: PowerLaw,
    /// The axis where the fit begins and ends.
    pub range: (f64, f64),
    /// Points on the mean curve.
    pub points: usize,
}

/// The axis of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Iterations.
    Iterations,
    /// Wall-clock seconds.
    Seconds,
}

impl Axis {
    /// A spot's place on it.
    pub fn of(self, spot: &Spot) -> f64 {
        match self {
            Axis::Iterations => spot.iterations as f64,
            Axis::Seconds => spot.seconds,
        }
    }
}

impl Curve {
    /// The curve of a run.
    pub fn of(run: usize, points: &[Point], metric: Metric, reference: &Reference) -> Curve {
        let own = reference.error.of(metric).unwrap_or(0.0);
        let mut by_seed: Vec<(u64, Vec<Spot>)> = Vec::new();
        for point in points.iter().filter(|point| point.run == run) {
            let figure = metric.of(&point.errors) - own;
            let reported = reference.figure(metric, &point.errors).is_some();
            let Point { iterations, seconds, .. } = *point;
            let spot = Spot { iterations, seconds, figure, spread: None, reported };
            match by_seed.iter_mut().find(|(seed, _)| *seed == point.seed) {
                Some((_, spots)) => spots.push(spot),
                None => by_seed.push((point.seed, vec![spot])),
            }
        }
        Curve::from_seeds(by_seed.into_iter().map(|(_, spots)| spots).collect(), own)
    }

    /// The mean of curves, as far as all of them go. Those that a clock has stopped end after different numbers of
    /// iterations: a curve without a moment that another has is interpolated there.
    pub fn from_seeds(by_seed: Vec<Vec<Spot>>, own: f64) -> Curve {
        let mut moments: Vec<u64> = by_seed.iter().flatten().map(|spot| spot.iterations).collect();
        moments.sort_unstable();
        moments.dedup();
        let mean = |&iterations: &u64| {
            let all: Vec<(f64, f64)> = by_seed.iter().map(|curve| at(curve, iterations)).collect::<Option<_>>()?;
            let seconds = Mean::of(&all.iter().map(|spot| spot.0).collect::<Vec<_>>())?.value;
            let figure = Mean::of(&all.iter().map(|spot| spot.1).collect::<Vec<_>>())?;
            let reported = figure.value > own && figure.value > 0.0;
            Some(Spot { iterations, seconds, figure: figure.value, spread: figure.error, reported })
        };
        Curve { mean: moments.iter().filter_map(mean).collect(), by_seed, own }
    }

    /// The curves that leave one seed out; none with a single seed.
    pub fn without_each_seed(&self) -> Vec<Curve> {
        let without = |left: usize| {
            let rest = self.by_seed.iter().enumerate().filter(|(seed, _)| *seed != left);
            Curve::from_seeds(rest.map(|(_, spots)| spots.clone()).collect(), self.own)
        };
        if self.by_seed.len() > 1 { (0..self.by_seed.len()).map(without).collect() } else { Vec::new() }
    }

    /// Where it ends.
    pub fn last(&self) -> Option<&Spot> {
        self.mean.last()
    }

    /// The exponent of the error over the last decade of iterations, where there are four moments or more.
    pub fn slope(&self, axis: Axis) -> Option<Slope> {
        let last = self.last()?.iterations;
        let decade = |spot: &&Spot| spot.reported && spot.iterations * 10 >= last;
        let fit = |curve: &[Spot]| {
            let points: Vec<(f64, f64)> =
                curve.iter().filter(decade).map(|spot| (axis.of(spot), spot.figure)).collect();
            (points.len() >= 4).then(|| PowerLaw::fit(points.iter().copied()).map(|line| (line, points)))?
        };
        let (line, points) = fit(&self.mean)?;
        let seeds: Vec<f64> =
            self.by_seed.iter().filter_map(|curve| fit(curve).map(|(line, _)| line.exponent)).collect();
        let exponent = Mean::of(&seeds).filter(|mean| mean.error.is_some() && seeds.len() == self.by_seed.len());
        let single = Mean { value: line.exponent, error: Some(line.exponent_error) };
        Some(Slope {
            exponent: exponent.unwrap_or(single),
            line,
            range: (points[0].0, points[points.len() - 1].0),
            points: points.len(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_goes_as_far_as_all_seeds_do() {
        let spot = |iterations: u64, figure: f64| Spot {
            iterations,
            seconds: 0.5 * iterations as f64,
            figure,
            spread: None,
            reported: true,
        };
        let power = |factor: f64, moments: &[u64]| moments.iter().map(|&n| spot(n, factor / n as f64)).collect();
        let curve = Curve::from_seeds(vec![power(1.0, &[1, 2, 4, 8]), power(3.0, &[1, 2, 4, 7])], 0.2);
        let shown: Vec<(u64, f64)> = curve.mean.iter().map(|spot| (spot.iterations, spot.figure)).collect();
        assert_eq!(shown.len(), 4);
        assert_eq!((shown[0], shown[2], shown[3].0), ((1, 2.0), (4, 0.5), 7));
        assert!((shown[3].1 - 2.0 / 7.0).abs() < 1e-12 && (curve.mean[3].seconds - 3.5).abs() < 1e-12, "{shown:?}");
        assert_eq!(curve.mean[0].spread, Some(1.0));
        let slope = curve.slope(Axis::Seconds).expect("four moments");
        assert!((slope.exponent.value + 1.0).abs() < 1e-12 && slope.exponent.error.is_some_and(|e| e < 1e-12));
        assert_eq!(curve.without_each_seed()[0].mean[3].iterations, 7);
        // Without a figure above the reference's own error there is nothing to fit.
        assert!(Curve::from_seeds(vec![power(0.1, &[1, 2, 4, 8])], 0.2).slope(Axis::Iterations).is_none());
    }
}
