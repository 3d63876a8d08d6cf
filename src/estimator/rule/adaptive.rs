//! The adaptive rule \[Kaplanyan and Dachsbacher 2013\]: the bandwidth of least asymptotic error, from estimates of
//! variance and bias.
//!
//! Photons with a density q of squared contributions give one iteration the variance `q R / (pi r^2)`; a field with
//! Laplacian D gives it the bias `r^2 k D / 2`. R and k are the kernel's roughness and second moment. Over N iterations
//! whose squared bandwidths fall as `i^(-1/3)`, the variance of the mean is 3/4 of the last iteration's over N, and the bias
//! is 3/2 of the last iteration's. The sum of variance and squared bias is least at
//!
//! `r^6 = 2 q R / (3 pi N k^2 D^2)`.
//!
//! q is estimated within the bandwidth. D is estimated with a smooth kernel of its own bandwidth, which shrinks as
//! `i^(-1/10)`, the best rate for second derivatives in the plane. Both are means over all iterations. The square of an
//! estimate of D is too large by its variance, which is subtracted. Otherwise noise would count as curvature, and
//! bandwidths in dim light would shrink without bound.
//!
//! Bandwidths may grow, but stay within constant factors of the memoryless rule's, so that the estimate is consistent
//! in any case.

use super::CountingRule;
use super::memoryless::bandwidth2_factor;
use crate::math::Frame;
use crate::photon::{Kernel, kernel::laplacian};
use crate::transport::FoundPhotons;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use wide::{CmpLt, f32x8};

/// Initial squared bandwidth of the kernel that estimates the Laplacian, over the squared bandwidth of the picture level (the
/// bandwidth level that the picture shows).
const PILOT_RATIO: f32 = 4.0;
/// Smallest and largest squared bandwidth, as multiples of the squared bandwidth of the memoryless rule with alpha 2/3.
const BOUNDS: (f64, f64) = (1.0 / 64.0, 4.0);

/// Smallest number of photons from which bandwidths are estimated.
const MIN_PHOTONS: u32 = 10;

/// The adaptive bandwidth rule of Kaplanyan and Dachsbacher 2013.
#[derive(Clone, Copy, Debug)]
pub struct Adaptive {
    /// The kernel that gathers.
    pub kernel: Kernel,
}

/// Bandwidth of one level of one pixel, with the sums that determine it. The sums of the largest level of a camera path
/// determine all levels, which keep their ratio.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Bandwidth {
    /// Squared bandwidth (m2).
    pub squared: f32,
    /// Squared bandwidth before the first iteration (m2).
    initial2: f32,
    /// Squared bandwidth of this level over that of the level that the picture shows.
    scale: f32,
    /// Squared bandwidth of the kernel that estimates the Laplacian (m2).
    pilot2: f32,
    /// Number of photons found within the bandwidth, over all iterations.
    photons: u32,
    /// Sum over iterations of the estimates of q, the density of squared photon contributions.
    shot: f64,
    /// Sum over iterations of the estimates of D, the Laplacian of the light.
    laplacian: f64,
    /// Sum over iterations of the variances of the estimates of D.
    noise: f64,
}

/// Sums over the photons that one camera path has found.
#[derive(Debug, Default)]
pub struct Tally {
    /// Number of photons within the bandwidth, in this iteration.
    photons: u32,
    /// Sum of the squared contributions of these photons.
    squares: f64,
    /// Estimate of D, the Laplacian of the light, in this iteration.
    laplacian: f64,
    /// Sum of the squared contributions of photons to the estimate of D: its variance, for a Poisson process.
    noise: f64,
}

impl CountingRule for Adaptive {
    type Bandwidth = Bandwidth;
    type Count = ();
    type Tally = Tally;

    const BEYOND: bool = true;

    fn initial(&self, squared: f32, _: f32, above: i32) -> Bandwidth {
        let scale = 2f32.powi(above);
        let pilot2 = PILOT_RATIO * squared / scale;
        Bandwidth { squared, initial2: squared, scale, pilot2, photons: 0, shot: 0.0, laplacian: 0.0, noise: 0.0 }
    }

    #[inline]
    fn squared(bandwidth: &Bandwidth) -> f32 {
        bandwidth.squared
    }

    #[inline]
    fn reach2(&self, bandwidths: &[Bandwidth], largest2: f32) -> f32 {
        bandwidths.last().map_or(largest2, |bandwidth| bandwidth.pilot2.max(largest2))
    }

    #[inline]
    fn count(&self, bandwidths: &[Bandwidth], _: &mut [()], tally: &mut Tally, _: &Frame, photons: &FoundPhotons) {
        let Some(bandwidth) = bandwidths.last() else { return };
        let within = photons.distance2.cmp_lt(f32x8::splat(bandwidth.squared));
        tally.photons += within.move_mask().count_ones();
        tally.squares += f64::from((within & (photons.light * photons.light)).reduce_add());
        let s = photons.distance2 / bandwidth.pilot2;
        let near = photons.distance2.cmp_lt(f32x8::splat(bandwidth.pilot2));
        // Unused lanes are infinitely far away, where the product is NaN, so the mask comes last.
        let parts = near & (photons.light * laplacian(s));
        let scale = f64::from(bandwidth.pilot2).powi(-2);
        tally.laplacian += f64::from(parts.reduce_add()) * scale;
        tally.noise += f64::from((parts * parts).reduce_add()) * scale * scale;
    }

    fn update(&self, i: u64, bandwidths: &mut [Bandwidth], _: &mut [()], found: &mut Tally) {
        let Some(last) = bandwidths.last_mut() else { return };
        last.photons = last.photons.saturating_add(found.photons);
        last.shot += found.squares / (PI * f64::from(last.squared));
        last.laplacian += found.laplacian;
        last.noise += found.noise;
        let picture2 = f64::from(last.initial2 / last.scale);
        let next = i + 1;
        last.pilot2 = (f64::from(PILOT_RATIO) * picture2 * (next as f64).powf(-0.2)) as f32;
        let n = i as f64;
        let memoryless2 = picture2 * bandwidth2_factor(next, 2.0 / 3.0);
        let squared = (last.laplacian * last.laplacian - last.noise).max(0.0) / (n * n);
        let optimum = optimum2(self.kernel, last.shot / n, squared, n);
        let known = last.photons >= MIN_PHOTONS && !optimum.is_nan();
        let picture2 = if known { optimum } else { memoryless2 };
        let picture2 = picture2.clamp(BOUNDS.0 * memoryless2, BOUNDS.1 * memoryless2) as f32;
        for bandwidth in bandwidths {
            bandwidth.squared = (picture2 * bandwidth.scale).max(f32::MIN_POSITIVE);
        }
    }
}

/// Squared bandwidth of least error after `n` iterations; `shot` is the density q of squared contributions, `squared` the
/// squared Laplacian D^2. NaN if nothing is known.
fn optimum2(kernel: Kernel, shot: f64, squared: f64, n: f64) -> f64 {
    let bias2 = f64::from(kernel.second_moment()).powi(2) * squared;
    (2.0 * shot * f64::from(kernel.roughness()) / (3.0 * PI * n * bias2)).cbrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::photon::ThinningKey;
    use crate::random::{Domain, Purpose, Stream};

    /// The closed form against a search over constants c of bandwidths `c i^(-1/6)`.
    #[test]
    fn the_optimum_has_the_least_error() {
        for kernel in [Kernel::Box, Kernel::Epanechnikov] {
            let (q, d, n) = (3.0, 20.0, 4096.0);
            let error = |last2: f64| {
                let bandwidths = (1..=n as u64).map(|i| last2 * (n / i as f64).cbrt());
                let (mut variance, mut bias) = (0.0, 0.0);
                for r2 in bandwidths {
                    variance += q * f64::from(kernel.roughness()) / (PI * r2) / (n * n);
                    bias += 0.5 * f64::from(kernel.second_moment()) * d * r2 / n;
                }
                variance + bias * bias
            };
            let best = optimum2(kernel, q, d * d, n);
            assert!(error(best) < error(best * 1.05) && error(best) < error(best * 0.95));
        }
    }

    /// Photons of density 30,000 (1 + d / 4 (x^2 + y^2)), whose Laplacian is 30,000 d. Estimates are unbiased within
    /// five standard errors (3 % for d = 80). The bandwidth grows without curvature and shrinks with it.
    #[test]
    fn curvature_is_estimated_and_shrinks_bandwidths() {
        let run = |d: f64| {
            let rule = Adaptive { kernel: Kernel::Box };
            let mut bandwidth = rule.initial(0.01, 10.0, 0);
            for i in 1..=400u64 {
                let mut tally = Tally::default();
                for k in 0..54_000u64 {
                    let u = Stream::new(5, i, Domain::Test, k).vertex(0);
                    let p = (u.two(Purpose::Pixel) - 0.5) * 1.0;
                    let keep = (1.0 + d / 4.0 * f64::from(p.length_squared())) / 1.8;
                    let photon = FoundPhotons::one(Vec3::ZERO, p.length_squared(), 1.0, ThinningKey::default());
                    if p.length_squared() < 0.04 && f64::from(u.one(Purpose::Lobe)) < keep {
                        let bandwidths = std::slice::from_ref(&bandwidth);
                        rule.count(bandwidths, &mut [], &mut tally, &Frame::from_normal(Vec3::Z), &photon);
                    }
                }
                rule.update(i, std::slice::from_mut(&mut bandwidth), &mut [], &mut tally);
                assert!(bandwidth.squared > 0.0 && bandwidth.squared.is_finite());
            }
            bandwidth
        };
        let (flat, curved) = (run(0.0), run(80.0));
        let memoryless = 0.01 * bandwidth2_factor(401, 2.0 / 3.0);
        println!("flat {flat:?}, curved {curved:?}, memoryless {memoryless}");
        assert!((flat.shot / 400.0 / 30_000.0 - 1.0).abs() < 0.05);
        assert!((curved.laplacian / 400.0 / 2.4e6 - 1.0).abs() < 0.15, "{}", curved.laplacian / 400.0);
        assert!(flat.laplacian.abs() < 0.15 * curved.laplacian);
        assert!(f64::from(flat.squared) > 1.2 * memoryless && flat.squared > 1.5 * curved.squared);
    }
}
