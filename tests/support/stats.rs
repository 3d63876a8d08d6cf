//! Statistical tests with declared error rates.

/// Mean and standard error of the mean of independent values.
pub fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Student's t statistic of the hypothesis that the mean of `values` is `expected`.
pub fn t_statistic(values: &[f64], expected: f64) -> f64 {
    let (mean, error) = mean_and_error(values);
    (mean - expected) / error.max(1e-12 * expected.abs().max(1e-300))
}

/// Two-sided critical value of Student's t for `tests` simultaneous tests at a family-wise error rate of `alpha`
/// (Sidak), with `freedom` degrees of freedom.
pub fn t_critical(alpha: f64, tests: usize, freedom: f64) -> f64 {
    use statrs::distribution::{ContinuousCDF, StudentsT};
    let single = 1.0 - (1.0 - alpha).powf(1.0 / tests as f64);
    match StudentsT::new(0.0, 1.0, freedom) {
        Ok(t) => t.inverse_cdf(1.0 - 0.5 * single),
        Err(error) => panic!("no t distribution with {freedom} degrees of freedom: {error}"),
    }
}

/// Family-wise error rate of the checks of one kind.
pub const ERROR_RATE: f64 = 1e-3;

/// An expected mean, and the shift that must be rejected.
#[derive(Clone, Copy)]
pub struct Check {
    pub expected: f64,
    /// Known relative bias of the closed form or of the kernel.
    pub bias: f64,
    /// Relative shift of the expectation that must be rejected.
    pub detects: f64,
}

impl Check {
    /// Checks independent values, as one of `tests` simultaneous checks.
    pub fn run(&self, tests: usize, what: &str, values: &[f64]) {
        let Check { expected, bias, detects } = *self;
        let (mean, error) = mean_and_error(values);
        let critical = t_critical(ERROR_RATE, tests, values.len() as f64 - 1.0);
        let passes = |expected: f64| (mean - expected).abs() <= critical * error + (bias + 1e-6) * expected.abs();
        println!("{what}: {mean:.6} +- {error:.6}, expected {expected:.6}");
        assert!(passes(expected), "{what}: {mean} +- {error}, expected {expected}");
        for planted in [1.0 - detects, 1.0 + detects].map(|shift| expected * shift) {
            assert!(!passes(planted), "{what}: cannot distinguish {expected} from {planted} ({mean} +- {error})");
        }
    }
}

/// P-value of Pearson's chi-squared test of counts against expectations. Cells are pooled in the order of their
/// expectation, until each pool expects at least [`MIN_EXPECTED`]. Counts in cells of almost zero expectation make the
/// p-value zero.
pub fn chi_squared_p(counts: &[f64], expected: &[f64]) -> f64 {
    use statrs::distribution::{ChiSquared, ContinuousCDF};
    let mut cells: Vec<(f64, f64)> = expected.iter().copied().zip(counts.iter().copied()).collect();
    cells.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut statistic, mut pools, mut pool) = (0.0, 0, (0.0, 0.0));
    for (i, (e, c)) in cells.iter().enumerate() {
        pool = (pool.0 + e, pool.1 + c);
        let last = i + 1 == cells.len();
        if pool.0 >= MIN_EXPECTED {
            statistic += (pool.1 - pool.0) * (pool.1 - pool.0) / pool.0;
            pools += 1;
            pool = (0.0, 0.0);
        } else if last && pool.1 > pool.0 + 10.0 * MIN_EXPECTED {
            return 0.0;
        }
    }
    if pools < 2 {
        return 1.0;
    }
    match ChiSquared::new(f64::from(pools - 1)) {
        Ok(chi) => 1.0 - chi.cdf(statistic),
        Err(error) => panic!("no chi-squared distribution with {pools} pools: {error}"),
    }
}

/// Smallest expectation of a pool of cells.
pub const MIN_EXPECTED: f64 = 8.0;

/// Significance of one of `tests` simultaneous tests at a family-wise error rate of `alpha` (Sidak).
pub fn sidak(alpha: f64, tests: usize) -> f64 {
    1.0 - (1.0 - alpha).powf(1.0 / tests as f64)
}
