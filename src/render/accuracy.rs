//! What accuracy costs: the error of the picture as it would be delivered, how it falls, and when it will be small
//! enough.
//!
//! Now and then a picture finished from half of the iterations is judged by the other half ([`History::finished`]). Its
//! squared error falls as a power of the iterations, `e^2 = a n^(-2 s)`, and the whole picture's is that of twice as many
//! iterations. Few moments tell `s` badly, so they are joined by what is usual: the square of a finished picture's error
//! falls with the power 0.7 ([`USUAL`]), as if that had been measured with a spread of one in the logarithm of
//! iterations. Bias that all quarters have in common is told by bandwidth levels, and added.

use super::control::History;

/// The power with which finished errors fall, usually: between 0.2 and 0.5, what the scenes of the project show
/// (`docs/measurements.md`, slopes of finished pictures).
const USUAL: f64 = 0.35;
/// What a power may come out as: noise alone falls with a half, and nothing rises.
const RANGE: (f64, f64) = (0.1, 0.55);
/// Moments that tell the level of the error: the last ones.
const LATEST: usize = 3;

/// How the error of the finished picture falls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// The power `s`.
    pub exponent: f64,
    /// Logarithm of the squared error of noise after one iteration, as the latest moments tell it.
    level: f64,
    /// Squared bias, which is taken to stay.
    squared_bias: f64,
    /// Iterations at the last moment that was judged.
    pub judged: u64,
}

impl Accuracy {
    /// From a history; `None` while no moment was judged, or noise hides all that is to be seen.
    pub fn of(history: &[History]) -> Option<Accuracy> {
        // The picture that was judged has half of the iterations.
        let judged = |moment: &History| {
            let squared = moment.finished.filter(|squared| *squared > 0.0)?;
            Some((moment.iterations, (moment.iterations as f64 / 2.0).ln(), squared.ln()))
        };
        let moments: Vec<(u64, f64, f64)> = history.iter().filter_map(judged).collect();
        let &(last, ..) = moments.last()?;
        let count = moments.len() as f64;
        let mean = |of: fn(&(u64, f64, f64)) -> f64| moments.iter().map(of).sum::<f64>() / count;
        let (middle, average) = (mean(|m| m.1), mean(|m| m.2));
        let spread: f64 = moments.iter().map(|m| (m.1 - middle).powi(2)).sum();
        let falls: f64 = moments.iter().map(|m| -0.5 * (m.1 - middle) * (m.2 - average)).sum();
        let exponent = ((falls + USUAL) / (spread + 1.0)).clamp(RANGE.0, RANGE.1);
        let latest = &moments[moments.len().saturating_sub(LATEST)..];
        let level = latest.iter().map(|m| m.2 + 2.0 * exponent * m.1).sum::<f64>() / latest.len() as f64;
        let told = history.iter().rev().find_map(|moment| moment.estimate);
        Some(Accuracy { exponent, level, squared_bias: told.map_or(0.0, |told| told.squared_bias), judged: last })
    }

    /// Relative error of the picture finished after so many iterations: the root of trimmed relMSE.
    pub fn error(&self, iterations: u64) -> f64 {
        ((self.level - 2.0 * self.exponent * (iterations as f64).ln()).exp() + self.squared_bias).sqrt()
    }

    /// Iterations after which the error is this small; `None` where bias forbids it for longer than can be told.
    pub fn iterations_to(&self, error: f64) -> Option<f64> {
        let noise = error * error - self.squared_bias;
        let iterations = ((self.level - noise.ln()) / (2.0 * self.exponent)).exp();
        (noise > 0.0 && iterations.is_finite()).then_some(iterations)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::ErrorEstimate;

    /// A history judged at some iterations, whose finished error falls as said.
    fn history(judged: &[u64], squared: impl Fn(f64) -> f64, squared_bias: f64) -> Vec<History> {
        let moment = |&iterations: &u64| History {
            seconds: 0.0,
            cpu_seconds: 0.0,
            iterations,
            light_paths: 0,
            estimate: Some(ErrorEstimate { squared_bias, ..ErrorEstimate::default() }),
            finished: Some(squared(iterations as f64 / 2.0)),
        };
        judged.iter().map(moment).collect()
    }

    #[test]
    fn a_power_that_is_usual_is_found_from_one_moment_and_another_from_many() {
        let usual = |n: f64| 0.01 * n.powf(-2.0 * USUAL);
        let one = Accuracy::of(&history(&[8], usual, 0.0)).expect("one moment");
        assert!((one.exponent - USUAL).abs() < 1e-12 && (one.error(64) / usual(64.0).sqrt() - 1.0).abs() < 1e-12);
        let steep = |n: f64| 0.01 / n;
        let many: Vec<u64> = (3..12).map(|power| 1 << power).collect();
        let many = Accuracy::of(&history(&many, steep, 0.0)).expect("nine moments");
        assert!((many.exponent - 0.5).abs() < 0.01, "{}", many.exponent);
        let wanted = 0.5 * many.error(4096);
        let iterations = many.iterations_to(wanted).expect("it comes");
        assert!((iterations / (4096.0 * 4.0) - 1.0).abs() < 0.1, "{iterations}");
        assert!((many.error(iterations as u64) / wanted - 1.0).abs() < 1e-3);
    }

    #[test]
    fn bias_stays_and_nothing_is_told_where_nothing_is_known() {
        let told = Accuracy::of(&history(&[8, 16], |n| 0.01 / n, 0.04)).expect("two moments");
        assert!((told.error(1 << 40) - 0.2).abs() < 1e-3 && told.iterations_to(0.19).is_none());
        assert_eq!(Accuracy::of(&[]), None);
        assert_eq!(Accuracy::of(&history(&[8, 16], |_| -1e-9, 0.0)), None);
    }
}
