//! The memoryless rule \[Knaus and Zwicker 2011\]: bandwidths depend on the iteration's number only, so iterations may run
//! in any order.
//!
//! `r_{i+1}^2 / r_i^2 = (i + alpha) / (i + 1)` \[post-reconstruction 2021, (4)\].

/// Default of the reduction rate alpha, which balances variance and bias asymptotically \[Kaplanyan and Dachsbacher
/// 2013\].
pub const ALPHA: f64 = 2.0 / 3.0;

/// Squared bandwidth of iteration `i` (from 1) over the initial one: `prod_{k=1}^{i-1} (k + alpha) / (k + 1)` = `Gamma(i +
/// alpha) / (Gamma(1 + alpha) Gamma(i + 1))`, in explicit form to avoid drift. `alpha` is in (0, 1].
pub fn bandwidth2_factor(i: u64, alpha: f64) -> f64 {
    debug_assert!(i >= 1 && alpha > 0.0 && alpha <= 1.0);
    const EXACT: u64 = 32;
    let product = |to: u64| (1..to).map(|k| (k as f64 + alpha) / (k as f64 + 1.0)).product::<f64>();
    if i <= EXACT {
        return product(i);
    }
    // Gamma(x + alpha) / Gamma(x + 1) by Stirling's series. The difference of the large terms is in closed form,
    // because a difference of two log-gammas would lose digits.
    let ratio = |x: f64| {
        let (a, b) = (x + alpha, x + 1.0);
        let series = |z: f64| {
            let z2 = z * z;
            (1.0 / 12.0 - (1.0 / 360.0 - 1.0 / (1260.0 * z2)) / z2) / z
        };
        // (a - 1/2) ln a - a - (b - 1/2) ln b + b, with ln a = ln b + ln(a / b). b - a is computed as 1 - alpha,
        // because the sums lose digits for large x.
        let log_ratio = ((alpha - 1.0) / b).ln_1p();
        ((alpha - 1.0) * b.ln() + (a - 0.5) * log_ratio + (1.0 - alpha) + series(a) - series(b)).exp()
    };
    product(EXACT) * ratio(i as f64) / ratio(EXACT as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_explicit_form_follows_the_recursion_for_a_million_iterations() {
        for alpha in [0.1, 4.0 / 7.0, 2.0 / 3.0, 0.75, 1.0] {
            let mut by_recursion = 1.0f64;
            for i in 1..=1_000_000u64 {
                if i.is_power_of_two() || i % 99_991 == 0 {
                    let explicit = bandwidth2_factor(i, alpha);
                    let error = explicit / by_recursion - 1.0;
                    assert!(error.abs() < 1e-9, "alpha {alpha}, iteration {i}: {error}");
                }
                let k = i as f64;
                by_recursion *= (k + alpha) / (k + 1.0);
            }
        }
    }

    #[test]
    fn bandwidths_stay_positive_and_never_grow() {
        let mut last = f64::INFINITY;
        for i in 1..5000 {
            let factor = bandwidth2_factor(i, ALPHA);
            assert!(factor > 0.0 && factor < last);
            last = factor;
        }
        assert_eq!(bandwidth2_factor(1, ALPHA), 1.0);
        assert_eq!(bandwidth2_factor(100, 1.0), 1.0);
    }
}
