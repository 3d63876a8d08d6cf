//! Mean and variance in one pass \[Welford 1962\].

use crate::math::{DVec3, Rgb};
use serde::{Deserialize, Serialize};

/// Running mean and sum of squared deviations of an RGB quantity; the count is kept by the owner, which has many of
/// these.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Welford {
    /// Mean of the values so far.
    pub mean: DVec3,
    /// Sum of squared deviations from the mean.
    pub m2: DVec3,
}

impl Welford {
    /// Adds the n-th value (the first is number 1), given 1 / n.
    #[inline]
    pub fn add(&mut self, value: Rgb, inverse_count: f64) {
        let value = value.as_dvec3();
        let delta = value - self.mean;
        self.mean += delta * inverse_count;
        self.m2 += delta * (value - self.mean);
    }

    /// Variance of the mean of `count` values; infinite for fewer than two: nothing is known.
    #[inline]
    pub fn variance_of_mean(&self, count: f64) -> DVec3 {
        if count < 2.0 { DVec3::INFINITY } else { self.m2 / (count * (count - 1.0)) }
    }

    /// Joins the statistics of `n` and `m` values \[Chan, Golub, LeVeque 1979\].
    #[must_use]
    pub fn merge(&self, n: f64, other: &Welford, m: f64) -> Welford {
        if n + m == 0.0 {
            return *self;
        }
        let delta = other.mean - self.mean;
        Welford { mean: self.mean + delta * (m / (n + m)), m2: self.m2 + other.m2 + delta * delta * (n * m / (n + m)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_two_passes_far_from_zero_and_merges() {
        let values: Vec<f64> = (0..1000).map(|i| 1e4 + f64::from((i * 7919) % 101)).collect();
        let mut whole = Welford::default();
        let (mut a, mut b) = (Welford::default(), Welford::default());
        for (i, &v) in values.iter().enumerate() {
            let rgb = Rgb::splat(v as f32);
            whole.add(rgb, 1.0 / (i + 1) as f64);
            if i < 300 { a.add(rgb, 1.0 / (i + 1) as f64) } else { b.add(rgb, 1.0 / (i - 299) as f64) }
        }
        let mean = values.iter().sum::<f64>() / 1000.0;
        let m2 = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        let merged = a.merge(300.0, &b, 700.0);
        for w in [whole, merged] {
            assert!((w.mean.x - mean).abs() < 1e-9 * mean && (w.m2.x - m2).abs() < 1e-9 * m2);
        }
        assert_eq!(Welford::default().variance_of_mean(1.0).x, f64::INFINITY);
    }
}
