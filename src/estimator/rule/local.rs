//! The rule of local statistics \[Hachisuka, Ogaki, Jensen 2008; for shared statistics Hachisuka and Jensen 2009\]. Of
//! the photons that an iteration adds, a fraction alpha is kept, and the disc shrinks accordingly.
//!
//! With N photons so far, M new ones and flux tau, all are scaled with the area: `N' = N + alpha M`, `R'^2 / R^2 = N' /
//! (N + M)`, `tau' = (tau + tau_M) R'^2 / R^2` (the course's first talk; its slide omits `tau_M`). The estimate `tau /
//! (pi R^2)` over the number of iterations is therefore the mean over iterations of `tau_M / (pi R^2)`, each with its
//! own bandwidth: `tau' / R'^2 = tau / R^2 + tau_M / R^2`. So flux needs no state, and its variance is known.

use super::CountingRule;
use crate::math::Frame;
use crate::transport::{FoundPhotons, MAX_LEVELS};
use serde::{Deserialize, Serialize};
use wide::{CmpLt, f32x8};

/// The bandwidth rule of progressive photon mapping: each bandwidth shrinks by the number of photons found locally.
#[derive(Clone, Copy, Debug)]
pub struct LocalStatistics {
    /// Fraction of the new photons of each iteration that is kept, in (0, 1]; the rest is removed by shrinking the
    /// bandwidth.
    pub alpha: f64,
}

/// Bandwidth of one level of one pixel, with its photon count.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bandwidth {
    /// Squared bandwidth (m2). In f32, the factor of the millionth iteration would be off by a tenth of its
    /// difference to one.
    pub squared: f64,
    /// Accumulated number of photons, N. Fractional, because only a fraction of each iteration's photons is kept.
    pub photons: f64,
}

impl CountingRule for LocalStatistics {
    type Bandwidth = Bandwidth;
    type Count = ();
    type Tally = [u32; MAX_LEVELS];

    fn initial(&self, squared: f32, _: f32, _: i32) -> Bandwidth {
        Bandwidth { squared: f64::from(squared), photons: 0.0 }
    }

    #[inline]
    fn squared(bandwidth: &Bandwidth) -> f32 {
        bandwidth.squared as f32
    }

    #[inline]
    fn count(
        &self,
        bandwidths: &[Bandwidth],
        _: &mut [()],
        tally: &mut Self::Tally,
        _: &Frame,
        photons: &FoundPhotons,
    ) {
        for (bandwidth, photons_within) in bandwidths.iter().zip(tally) {
            *photons_within +=
                photons.distance2.cmp_lt(f32x8::splat(bandwidth.squared as f32)).move_mask().count_ones();
        }
    }

    fn update(&self, _: u64, bandwidths: &mut [Bandwidth], _: &mut [()], tally: &mut Self::Tally) {
        for (bandwidth, new) in bandwidths.iter_mut().zip(tally.map(f64::from)) {
            if new > 0.0 {
                let kept = bandwidth.photons + self.alpha * new;
                let factor = kept / (bandwidth.photons + new);
                bandwidth.squared = (bandwidth.squared * factor).max(f64::from(f32::MIN_POSITIVE));
                bandwidth.photons = kept;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    /// The papers' recursion against the mean over iterations. Counts never fall, bandwidths never grow and stay positive,
    /// and flux is scaled with the area.
    #[test]
    fn the_papers_recursion_is_a_mean_over_iterations() {
        let rule = LocalStatistics { alpha: 2.0 / 3.0 };
        let mut ours = rule.initial(1.0, 10.0, 0);
        let (mut n, mut squared, mut tau) = (0.0, 1.0f64, 0.0);
        let mut sum = 0.0;
        for i in 1..=3000u64 {
            let u = Stream::new(3, i, Domain::Test, 0).vertex(0).two(Purpose::Pixel);
            let new = (u.x * 20.0 * squared as f32) as u32;
            let flux = f64::from(new) * f64::from(u.y);
            sum += flux / squared;
            if new > 0 {
                let kept = n + 2.0 / 3.0 * f64::from(new);
                let factor = kept / (n + f64::from(new));
                (n, squared, tau) = (kept, squared * factor, (tau + flux) * factor);
            }
            let before = ours;
            rule.update(i, std::slice::from_mut(&mut ours), &mut [], &mut [new, 0, 0, 0, 0]);
            assert!(ours.squared > 0.0 && ours.squared <= before.squared && ours.photons >= before.photons);
            assert!((ours.squared / squared - 1.0).abs() < 1e-12 && (ours.photons - n).abs() < 1e-9 * n);
            assert!((tau / squared - sum).abs() < 1e-9 * sum, "iteration {i}");
        }
        assert!(squared < 0.1);
    }

    /// Under uniform light the number of photons is proportional to the area. The product of the factors is that of the
    /// memoryless rule \[Knaus and Zwicker 2011, 4.2\], started one step earlier: `prod_{k=0}^{i-1} (k + alpha) / (k +
    /// 1)`.
    #[test]
    fn under_uniform_light_it_shrinks_as_the_memoryless_rule() {
        let rule = LocalStatistics { alpha: 0.7 };
        let mut bandwidth = rule.initial(1.0, 10.0, 0);
        for i in 1..=1000 {
            // Enough photons that rounding to integers is negligible.
            let new = (1e8 * bandwidth.squared).round() as u32;
            rule.update(i, std::slice::from_mut(&mut bandwidth), &mut [], &mut [new, 0, 0, 0, 0]);
            let expected = 0.7 * super::super::memoryless::bandwidth2_factor(i, 0.7);
            assert!((bandwidth.squared / expected - 1.0).abs() < 1e-4, "iteration {i}");
        }
    }
}
