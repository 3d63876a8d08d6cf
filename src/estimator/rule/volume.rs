//! The memoryless rule in media \[Knaus and Zwicker 2011; Knaus in Hachisuka et al. 2013, "State of the art in photon
//! density estimation", participating media\]: the kernel is a ball, so the rule shrinks the cubed bandwidth.
//!
//! `r_{i+1}^3 / r_i^3 = (i + alpha) / (i + 1)`. From each level to the next smaller one the kernel's volume halves, so
//! bandwidths differ by a factor of 2^(-1/3).

use super::memoryless::bandwidth2_factor;

/// Default of the reduction rate alpha in media. Variance falls as `N^-alpha`, and squared bias, of order r^4, as
/// `N^(-4 (1 - alpha) / 3)`. Both are equally fast for 4/7, where the mean squared error falls as `N^(-4/7)`
/// \[Kaplanyan and Dachsbacher 2013, for kernels in three dimensions\].
pub const ALPHA: f64 = 4.0 / 7.0;

/// Bandwidth in media of iteration `i` (from 1) over the initial one; [`bandwidth2_factor`] is the factor of the
/// cubed bandwidth.
pub fn bandwidth_factor(i: u64, alpha: f64) -> f64 {
    bandwidth2_factor(i, alpha).cbrt()
}

/// Bandwidth in media of bandwidth level `level` (from 0, the smallest) of `count`, over that of the largest
/// level.
pub fn level_factor(level: usize, count: usize) -> f32 {
    (-((count - 1 - level) as f32) / 3.0).exp2()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cube_follows_the_recursion_and_the_rate() {
        let mut by_recursion = 1.0f64;
        for i in 1..=10_000u64 {
            let cube = bandwidth_factor(i, ALPHA).powi(3);
            assert!((cube / by_recursion - 1.0).abs() < 1e-9, "iteration {i}");
            by_recursion *= (i as f64 + ALPHA) / (i as f64 + 1.0);
        }
        assert_eq!(bandwidth_factor(1, ALPHA), 1.0);
        assert_eq!(bandwidth_factor(77, 1.0), 1.0);
        // r^3 ~ i^(alpha - 1): squared bias and variance fall equally fast.
        let slope = (bandwidth_factor(1 << 20, ALPHA) / bandwidth_factor(1 << 16, ALPHA)).ln() / 16f64.ln();
        assert!((slope - (ALPHA - 1.0) / 3.0).abs() < 1e-5);
        assert!((4.0 * slope + ALPHA).abs() < 1e-4, "squared bias falls as {}", 4.0 * slope);
    }

    #[test]
    fn levels_halve_the_volume() {
        for count in 1..=5 {
            assert_eq!(level_factor(count - 1, count), 1.0);
            for level in 1..count {
                let ratio = level_factor(level - 1, count) / level_factor(level, count);
                assert!((ratio.powi(3) - 0.5).abs() < 1e-6);
            }
        }
    }
}
