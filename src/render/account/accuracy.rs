//! What accuracy costs: the error of the picture as it would be delivered, how it falls, and when it will be small
//! enough.
//!
//! Now and then pictures finished from half of the iterations are judged by the other half ([`FinishedError`]). Their squared
//! error falls as a power of the iterations, `e^2 = a n^(-2 s)`, and the whole picture's is that of twice as many
//! iterations. Few moments tell `s` badly, so they are joined by what is usual: the square of a finished picture's error
//! falls with the power 0.7 ([`DEFAULT_CONVERGENCE_RATE`]), as if that had been measured with a spread of one in the logarithm of
//! iterations. Moments count by how sure they are. Bias that all quarters have in common is told by bandwidth levels,
//! and added.

use super::history::HistoryEntry;
use crate::finish::{DEFAULT_CONVERGENCE_RATE, FinishedError};

/// What a power may come out as: noise alone falls with a half, and nothing rises.
const RANGE: (f64, f64) = (0.1, 0.55);
/// Moments that tell the level of the error: the last ones.
const LATEST: usize = 3;
/// Spread of the logarithm of squared errors from moment to moment, what judges add apart.
const SCATTER: f64 = 0.2;
/// Spread of the logarithm of an error that is told from what it is, what judges add apart: fitted on twelve scenes, and
/// checked on others (`docs/lab/accuracy.md`).
const MODEL: f64 = 0.25;
/// Squared bias over what levels tell of it, where it grows with the bandwidth and not with its square, as it does at
/// edges and on things narrower than the kernel: the next larger level has sqrt(2) times the bias then, not twice.
const OF_EDGES: f64 = 5.828_427;
/// Squared light of three photons over that of the square root of two: no more than three are expected, with a
/// probability of 95 %, where none has come.
const OF_THREE: f64 = 4.5;
/// The share of pictures whose error lies in the interval.
pub const CONFIDENCE: f64 = 0.9;
/// Standard deviations to each side of a normal distribution that hold that share.
const DEVIATIONS: f64 = 1.645;

/// How the error of the finished picture falls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// The power `s`.
    pub exponent: f64,
    /// Logarithm of the squared error of noise after one iteration, as the latest moments tell it.
    level: f64,
    /// Squared bias, which is taken to stay.
    pub squared_bias: f64,
    /// Squared error by light that photons have not brought ([`FinishedError::unseen`]).
    pub squared_unseen: f64,
    /// Standard error of the logarithm of the latest squared error, of what judges add.
    doubt: f64,
    /// Share of the noise that few bright samples hold ([`FinishedError::rare`]).
    pub rare: f64,
    /// Iterations at the last moment that was judged.
    pub judged: u64,
}

/// A moment that was judged, on logarithmic scales.
struct Moment {
    /// Logarithm of the iterations of the picture that was judged, half of all.
    iterations: f64,
    squared: f64,
    /// Standard error of `squared`.
    doubt: f64,
    weight: f64,
}

impl Moment {
    /// `None` where there was no noise at all.
    fn of(iterations: u64, verdict: &FinishedError) -> Option<Moment> {
        // An error that the judges' noise hides is no larger than that, most likely.
        let squared = verdict.noise.max(verdict.deviation);
        let doubt = verdict.deviation / squared;
        let weight = SCATTER.powi(2) / (SCATTER.powi(2) + doubt.powi(2));
        let known = squared > 0.0 && squared.is_finite();
        known.then(|| Moment { iterations: (iterations as f64 / 2.0).ln(), squared: squared.ln(), doubt, weight })
    }
}

impl Accuracy {
    /// From a history; `None` while no moment was judged, or none had noise.
    pub fn of(history: &[HistoryEntry]) -> Option<Accuracy> {
        let judged = || history.iter().filter_map(|moment| Some((moment.iterations, moment.finished?)));
        let moments: Vec<Moment> = judged().filter_map(|(n, verdict)| Moment::of(n, &verdict)).collect();
        let (last, verdict) = judged().next_back()?;
        let latest = &moments[moments.len().saturating_sub(LATEST)..];
        let doubt = latest.last()?.doubt;
        let mean = |of: &[Moment], value: &dyn Fn(&Moment) -> f64| {
            let (sum, weight) = of.iter().fold((0.0, 0.0), |(s, w), m| (s + m.weight * value(m), w + m.weight));
            sum / weight
        };
        let (middle, average) = (mean(&moments, &|m| m.iterations), mean(&moments, &|m| m.squared));
        let spread: f64 = moments.iter().map(|m| m.weight * (m.iterations - middle).powi(2)).sum();
        let fall = |m: &Moment| -0.5 * m.weight * (m.iterations - middle) * (m.squared - average);
        let falls: f64 = moments.iter().map(fall).sum();
        let exponent = ((falls + DEFAULT_CONVERGENCE_RATE) / (spread + 1.0)).clamp(RANGE.0, RANGE.1);
        let level = mean(latest, &|m| m.squared + 2.0 * exponent * m.iterations);
        let FinishedError { bias: squared_bias, rare, unseen: squared_unseen, .. } = verdict;
        Some(Accuracy { exponent, level, squared_bias, squared_unseen, doubt, rare, judged: last })
    }

    /// Relative error of the picture finished after so many iterations: the root of trimmed relMSE.
    pub fn error(&self, iterations: u64) -> f64 {
        (self.noise(iterations) + self.squared_bias + self.squared_unseen).sqrt()
    }

    /// Squared error of noise.
    fn noise(&self, iterations: u64) -> f64 {
        (self.level - 2.0 * self.exponent * (iterations as f64).ln()).exp()
    }

    /// Between what the error lies in [`CONFIDENCE`] of all pictures. Where few bright samples hold the noise, the upper
    /// end is what the error would be with all of it: as if the pixels that were left out were as well told as others.
    /// The bias is that of edges there. Light that photons have not brought is none at the lower end, and at the upper as
    /// much as the rule of three says, but no more than all.
    pub fn interval(&self, iterations: u64) -> [f64; 2] {
        let factor = (DEVIATIONS * MODEL.hypot(0.5 * self.doubt)).exp();
        let (noise, bias) = (self.noise(iterations), self.squared_bias);
        let most = (noise + OF_EDGES * bias) * factor * factor / (1.0 - self.rare).max(1e-4);
        [(noise + bias).sqrt() / factor, (most + (OF_THREE * self.squared_unseen).min(1.0)).sqrt()]
    }

    /// Iterations after which the error is this small; `None` where bias forbids it for longer than can be told.
    pub fn iterations_to(&self, error: f64) -> Option<f64> {
        let noise = error * error - self.squared_bias - self.squared_unseen;
        let iterations = ((self.level - noise.ln()) / (2.0 * self.exponent)).exp();
        (noise > 0.0 && iterations.is_finite()).then_some(iterations)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A history judged at some iterations, whose finished error falls as said.
    fn history(judged: &[u64], squared: impl Fn(f64) -> f64, bias: f64) -> Vec<HistoryEntry> {
        let moment = |&iterations: &u64| HistoryEntry {
            seconds: 0.0,
            cpu_seconds: 0.0,
            iterations,
            light_paths: 0,
            estimate: None,
            finished: Some(FinishedError {
                noise: squared(iterations as f64 / 2.0),
                deviation: 1e-9,
                bias,
                rare: 0.0,
                unseen: 0.0,
            }),
        };
        judged.iter().map(moment).collect()
    }

    #[test]
    fn a_power_that_is_usual_is_found_from_one_moment_and_another_from_many() {
        let usual = |n: f64| 0.01 * n.powf(-2.0 * DEFAULT_CONVERGENCE_RATE);
        let one = Accuracy::of(&history(&[8], usual, 0.0)).expect("one moment");
        assert!(
            (one.exponent - DEFAULT_CONVERGENCE_RATE).abs() < 1e-9
                && (one.error(64) / usual(64.0).sqrt() - 1.0).abs() < 1e-9
        );
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
        // Bias that grows with the bandwidth alone is 1 / (sqrt(2) - 1) times what the levels tell.
        let [_, high] = told.interval(1 << 40);
        assert!((high / (0.2 / (2f64.sqrt() - 1.0)) / (DEVIATIONS * MODEL).exp() - 1.0).abs() < 1e-3, "{high}");
        assert_eq!(Accuracy::of(&[]), None);
    }

    /// An error that judges' noise hides is told as that noise, a moment that is unsure counts little, and few bright
    /// samples raise the upper end alone.
    #[test]
    fn doubt_is_told() {
        let mut moments = history(&[8, 16, 32, 64], |n| 0.01 * n.powf(-2.0 * DEFAULT_CONVERGENCE_RATE), 0.0);
        let sure = Accuracy::of(&moments).expect("four moments");
        let [low, high] = sure.interval(64);
        let model = (1.645f64 * MODEL).exp();
        assert!(
            (high / sure.error(64) / model - 1.0).abs() < 1e-6
                && (low * high / sure.error(64).powi(2) - 1.0).abs() < 1e-6
        );
        moments[2].finished = Some(FinishedError { noise: -1.0, deviation: 0.5, bias: 0.0, rare: 0.0, unseen: 0.0 });
        let unsure = Accuracy::of(&moments).expect("four moments");
        // A weight of 1/26 for a squared error that is 350 times too large.
        assert!((unsure.error(64) / sure.error(64)).ln().abs() < 0.15, "{}", unsure.error(64) / sure.error(64));
        moments[3].finished = Some(FinishedError { noise: -1e-6, deviation: 1e-6, bias: 0.0, rare: 0.96, unseen: 0.0 });
        let rare = Accuracy::of(&moments[3..]).expect("one moment");
        assert!((rare.error(32) - 1e-3).abs() < 1e-9, "{}", rare.error(32));
        let [low, high] = rare.interval(32);
        assert!((high / 1e-3 / (1e-3 / low) - 5.0).abs() < 1e-6, "{low} {high}");
    }
}
