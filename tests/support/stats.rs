//! Statistical tests with declared error rates.

/// Mean and standard error of the mean of independent values.
pub fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Student's t statistic of "the mean of `values` is `expected`".
pub fn t_statistic(values: &[f64], expected: f64) -> f64 {
    let (mean, error) = mean_and_error(values);
    (mean - expected) / error.max(1e-12 * expected.abs().max(1e-300))
}

/// Two-sided critical value of Student's t for `tests` simultaneous tests at a family-wise error rate of `alpha` (Sidak), with
/// `freedom` degrees of freedom.
pub fn t_critical(alpha: f64, tests: usize, freedom: f64) -> f64 {
    use statrs::distribution::{ContinuousCDF, StudentsT};
    let single = 1.0 - (1.0 - alpha).powf(1.0 / tests as f64);
    match StudentsT::new(0.0, 1.0, freedom) {
        Ok(t) => t.inverse_cdf(1.0 - 0.5 * single),
        Err(error) => panic!("no t distribution with {freedom} degrees of freedom: {error}"),
    }
}
