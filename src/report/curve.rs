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
    /// The error without the reference's own, not below that.
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
    /// The curve of a run with so many seeds.
    pub fn of(run: usize, points: &[Point], metric: Metric, reference: &Reference) -> Curve {
        let own = reference.error.of(metric).unwrap_or(0.0);
        let mut seeds: Vec<u64> = Vec::new();
        let mine: Vec<&Point> = points.iter().filter(|point| point.run == run).collect();
        for point in &mine {
            if !seeds.contains(&point.seed) {
                seeds.push(point.seed);
            }
        }
        let spot = |group: &[&Point]| {
            let figures: Vec<f64> = group.iter().map(|point| metric.of(&point.errors) - own).collect();
            let mean = Mean::of(&figures)?;
            let seconds = group.iter().map(|point| point.seconds).sum::<f64>() / group.len() as f64;
            let reported = mean.value > own && mean.value > 0.0;
            let figure = mean.value.max(own);
            Some(Spot { iterations: group[0].iterations, seconds, figure, spread: mean.error, reported })
        };
        let curve = |seed: &u64| mine.iter().filter(|p| p.seed == *seed).filter_map(|p| spot(&[p])).collect();
        let by_seed: Vec<Vec<Spot>> = seeds.iter().map(curve).collect();
        let mut moments: Vec<u64> = mine.iter().map(|point| point.iterations).collect();
        moments.sort_unstable();
        moments.dedup();
        // A mean needs all seeds: runs that a clock stops end after different numbers of iterations.
        let group = |n: u64| mine.iter().filter(|point| point.iterations == n).copied().collect::<Vec<_>>();
        let groups = moments.into_iter().map(group).filter(|group| group.len() == seeds.len());
        Curve { mean: groups.filter_map(|group| spot(&group)).collect(), by_seed }
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
