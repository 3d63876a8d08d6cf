//! How the error of the finished picture falls with the number of iterations, and when it reaches a target.
//!
//! At some moments a picture is finished from half of the iterations, and its error is measured against the other half
//! ([`FinishedError`]). The squared error is modelled as a power of the iterations, `e^2 = a n^(-2 s)`; the picture of all
//! iterations has the error of twice as many. The exponent `s` is a weighted least-squares fit with a prior: the mean
//! [`DEFAULT_CONVERGENCE_RATE`], with a spread of one in the logarithm of the iterations. Moments have weights by their
//! noise. Bias that all quarters share is estimated from bandwidth levels, and added.

use super::history::HistoryEntry;
use crate::finish::{DEFAULT_CONVERGENCE_RATE, FinishedError};

/// Range of the fitted exponent `s`: noise falls as iterations^-s. Pure noise has 0.5, and finished pictures of the
/// project's scenes 0.2 to 0.5. The cost of half the error, a factor 2^(1/s), would have no meaning below that.
const EXPONENT_RANGE: (f64, f64) = (0.2, 0.55);
/// Number of moments of the error history, the last ones, that determine the level of the error.
const LATEST_MOMENTS: usize = 3;
/// Standard deviation of log(squared error) between moments of the error history, without the noise of the measurement.
const MOMENT_SPREAD: f64 = 0.2;
/// Standard deviation of log(estimated error / true error), without the noise of the measurement. Fitted on twelve scenes
/// and checked on others (`docs/lab/accuracy.md`).
const MODEL_SPREAD: f64 = 0.25;
/// Squared bias relative to its estimate, if bias grows with the bandwidth and not with its square. That happens at edges
/// and on objects narrower than the kernel: there the next larger level has sqrt(2) times the bias, not twice the bias.
const EDGE_BIAS_FACTOR: f64 = 5.828_427;
/// Factor on the estimated squared error by light that photons have not brought, for the upper end of
/// [`Accuracy::interval`]: squared light of three photons relative to that of sqrt(2) photons. Where no photon has
/// arrived, the expected number is below three with a probability of 95 %.
const UNSEEN_FACTOR: f64 = 4.5;
/// Share of pictures whose error is inside [`Accuracy::interval`].
pub const CONFIDENCE: f64 = 0.9;
/// Half the width, in standard deviations, of the interval of a normal distribution with probability [`CONFIDENCE`].
const CONFIDENCE_DEVIATIONS: f64 = 1.645;

/// Model of how the finished picture's error falls with the number of iterations, fitted to errors measured during the
/// render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Exponent `s`: noise falls as iterations^-s.
    pub exponent: f64,
    /// Logarithm of the squared relative noise after one iteration, fitted to the latest moments of the history.
    log_noise: f64,
    /// Squared relative bias, which does not change with the iterations.
    pub squared_bias: f64,
    /// Squared relative error by light that photons have not brought ([`FinishedError::unseen`]).
    pub squared_unseen: f64,
    /// Standard error of the logarithm of the latest squared error, from the noise of its measurement.
    measurement_error: f64,
    /// Share of the noise that a few bright samples hold, 0 to 1 ([`FinishedError::rare`]).
    pub rare: f64,
    /// Number of iterations at the last moment of the history with a measured error.
    pub measured_at: u64,
}

/// Measured error of the finished picture at a moment of the history, on logarithmic scales.
struct Moment {
    /// Logarithm of the number of iterations in the measured picture, which is half of the render's iterations so far.
    log_iterations: f64,
    /// Logarithm of the squared relative error.
    log_squared: f64,
    /// Standard error of `log_squared`.
    measurement_error: f64,
    weight: f64,
}

impl Moment {
    /// Takes the logarithms of an error that was measured after `iterations`; `None` if the picture has no noise.
    fn new(iterations: u64, measured: &FinishedError) -> Option<Moment> {
        // If the noise of the measurement hides the error, the error is most likely not larger than that noise.
        let squared = measured.noise.max(measured.deviation);
        let measurement_error = measured.deviation / squared;
        let weight = MOMENT_SPREAD.powi(2) / (MOMENT_SPREAD.powi(2) + measurement_error.powi(2));
        let known = squared > 0.0 && squared.is_finite();
        known.then(|| Moment {
            log_iterations: (iterations as f64 / 2.0).ln(),
            log_squared: squared.ln(),
            measurement_error,
            weight,
        })
    }
}

/// Mean of a value over moments of the history, by the weights of the moments.
fn mean(moments: &[Moment], value: impl Fn(&Moment) -> f64) -> f64 {
    let add = |(sum, weight): (f64, f64), m: &Moment| (sum + m.weight * value(m), weight + m.weight);
    let (sum, weight) = moments.iter().fold((0.0, 0.0), add);
    sum / weight
}

/// Fits the exponent `s` of the noise to the moments, by weighted least squares with a prior.
fn fit_exponent(moments: &[Moment]) -> f64 {
    let (x, y) = (mean(moments, |m| m.log_iterations), mean(moments, |m| m.log_squared));
    let variance: f64 = moments.iter().map(|m| m.weight * (m.log_iterations - x).powi(2)).sum();
    let slope = |m: &Moment| -0.5 * m.weight * (m.log_iterations - x) * (m.log_squared - y);
    let covariance: f64 = moments.iter().map(slope).sum();
    let (min, max) = EXPONENT_RANGE;
    ((covariance + DEFAULT_CONVERGENCE_RATE) / (variance + 1.0)).clamp(min, max)
}

impl Accuracy {
    /// Fits the model to the error history of a render; `None` if no moment has a measured error, or the pictures have
    /// no noise.
    pub fn fit(history: &[HistoryEntry]) -> Option<Accuracy> {
        let measured = || history.iter().filter_map(|entry| Some((entry.iterations, entry.finished?)));
        let moments: Vec<Moment> = measured().filter_map(|(n, error)| Moment::new(n, &error)).collect();
        let (measured_at, last) = measured().next_back()?;
        let latest = &moments[moments.len().saturating_sub(LATEST_MOMENTS)..];
        let measurement_error = latest.last()?.measurement_error;
        let exponent = fit_exponent(&moments);
        Some(Accuracy {
            exponent,
            log_noise: mean(latest, |m| m.log_squared + 2.0 * exponent * m.log_iterations),
            squared_bias: last.bias,
            squared_unseen: last.unseen,
            measurement_error,
            rare: last.rare,
            measured_at,
        })
    }

    /// Relative error of the picture finished after `iterations`: the root of trimmed relMSE.
    pub fn error(&self, iterations: u64) -> f64 {
        (self.squared_noise(iterations) + self.squared_bias + self.squared_unseen).sqrt()
    }

    fn squared_noise(&self, iterations: u64) -> f64 {
        (self.log_noise - 2.0 * self.exponent * (iterations as f64).ln()).exp()
    }

    /// Interval that contains the relative error of [`CONFIDENCE`] of all pictures. The upper end assumes that the
    /// pixels with few bright samples are as noisy as these samples suggest, that the bias is of edges, and that up to
    /// three photons are expected where none has arrived. The lower end assumes that no light is missing.
    pub fn interval(&self, iterations: u64) -> [f64; 2] {
        let factor = (CONFIDENCE_DEVIATIONS * MODEL_SPREAD.hypot(0.5 * self.measurement_error)).exp();
        let (noise, bias) = (self.squared_noise(iterations), self.squared_bias);
        let most = (noise + EDGE_BIAS_FACTOR * bias) * factor * factor / (1.0 - self.rare).max(1e-4);
        [(noise + bias).sqrt() / factor, (most + (UNSEEN_FACTOR * self.squared_unseen).min(1.0)).sqrt()]
    }

    /// Factor between [`Accuracy::iterations_to`] and the ends of the interval with the iterations that a share
    /// [`CONFIDENCE`] of all renders needs: the noise that they measure varies as here, and the exponent amplifies that.
    pub fn iterations_factor(&self) -> f64 {
        let spread = std::f64::consts::SQRT_2 * MOMENT_SPREAD.hypot(self.measurement_error);
        (CONFIDENCE_DEVIATIONS * spread / (2.0 * self.exponent)).exp()
    }

    /// Iterations after which the relative error has fallen to `error`; `None` if bias or missing light keep it larger.
    pub fn iterations_to(&self, error: f64) -> Option<f64> {
        let noise = error * error - self.squared_bias - self.squared_unseen;
        let iterations = ((self.log_noise - noise.ln()) / (2.0 * self.exponent)).exp();
        (noise > 0.0 && iterations.is_finite()).then_some(iterations)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A history with measured errors at these iterations; `squared` gives the squared noise.
    fn history(iterations: &[u64], squared: impl Fn(f64) -> f64, bias: f64) -> Vec<HistoryEntry> {
        let entry = |&iterations: &u64| HistoryEntry {
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
        iterations.iter().map(entry).collect()
    }

    #[test]
    fn one_moment_gives_the_default_exponent_and_many_give_their_own() {
        let default = |n: f64| 0.01 * n.powf(-2.0 * DEFAULT_CONVERGENCE_RATE);
        let one = Accuracy::fit(&history(&[8], default, 0.0)).expect("one moment");
        assert!(
            (one.exponent - DEFAULT_CONVERGENCE_RATE).abs() < 1e-9
                && (one.error(64) / default(64.0).sqrt() - 1.0).abs() < 1e-9
        );
        let steep = |n: f64| 0.01 / n;
        let many: Vec<u64> = (3..12).map(|power| 1 << power).collect();
        let many = Accuracy::fit(&history(&many, steep, 0.0)).expect("nine moments");
        assert!((many.exponent - 0.5).abs() < 0.01, "{}", many.exponent);
        let wanted = 0.5 * many.error(4096);
        let iterations = many.iterations_to(wanted).expect("the error is reached");
        assert!((iterations / (4096.0 * 4.0) - 1.0).abs() < 0.1, "{iterations}");
        assert!((many.error(iterations as u64) / wanted - 1.0).abs() < 1e-3);
    }

    #[test]
    fn bias_limits_the_error_and_an_empty_history_has_no_model() {
        let biased = Accuracy::fit(&history(&[8, 16], |n| 0.01 / n, 0.04)).expect("two moments");
        assert!((biased.error(1 << 40) - 0.2).abs() < 1e-3 && biased.iterations_to(0.19).is_none());
        // Bias that is linear in the bandwidth is 1 / (sqrt(2) - 1) times the estimate from levels.
        let [_, high] = biased.interval(1 << 40);
        assert!(
            (high / (0.2 / (2f64.sqrt() - 1.0)) / (CONFIDENCE_DEVIATIONS * MODEL_SPREAD).exp() - 1.0).abs() < 1e-3,
            "{high}"
        );
        assert_eq!(Accuracy::fit(&[]), None);
    }

    /// An error that is hidden by the noise of its measurement is taken as that noise. A noisy measurement has little
    /// weight. A few bright samples raise the upper end alone.
    #[test]
    fn noise_of_measurements_widens_the_interval() {
        let mut moments = history(&[8, 16, 32, 64], |n| 0.01 * n.powf(-2.0 * DEFAULT_CONVERGENCE_RATE), 0.0);
        let sure = Accuracy::fit(&moments).expect("four moments");
        let [low, high] = sure.interval(64);
        let model = (1.645f64 * MODEL_SPREAD).exp();
        assert!(
            (high / sure.error(64) / model - 1.0).abs() < 1e-6
                && (low * high / sure.error(64).powi(2) - 1.0).abs() < 1e-6
        );
        moments[2].finished = Some(FinishedError { noise: -1.0, deviation: 0.5, bias: 0.0, rare: 0.0, unseen: 0.0 });
        let unsure = Accuracy::fit(&moments).expect("four moments");
        // A weight of 1/26 for a squared error that is 350 times too large.
        assert!((unsure.error(64) / sure.error(64)).ln().abs() < 0.15, "{}", unsure.error(64) / sure.error(64));
        moments[3].finished = Some(FinishedError { noise: -1e-6, deviation: 1e-6, bias: 0.0, rare: 0.96, unseen: 0.0 });
        let rare = Accuracy::fit(&moments[3..]).expect("one moment");
        // Squared errors of e^(+-0.2) and, where the noise is as large as the error, e^(+-1), seen twice.
        let expected = |spread: f64, of: &Accuracy| (1.645 * spread / (2f64.sqrt() * of.exponent)).exp();
        let factors = [sure, rare].map(|of| of.iterations_factor());
        assert!((factors[0] / expected(0.2, &sure) - 1.0).abs() < 1e-6, "{factors:?}");
        assert!((factors[1] / expected(1f64.hypot(0.2), &rare) - 1.0).abs() < 1e-6, "{factors:?}");
        assert!((rare.error(32) - 1e-3).abs() < 1e-9, "{}", rare.error(32));
        let [low, high] = rare.interval(32);
        assert!((high / 1e-3 / (1e-3 / low) - 5.0).abs() < 1e-6, "{low} {high}");
    }
}
