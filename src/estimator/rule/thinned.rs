//! The chi-squared rule for photons of different weights.
//!
//! Guided light paths are dense where the guide sends them, and carry little flux there. The test counts photons, so it
//! would mistake a border between more and less guided regions for an edge in the light. So within a disc each photon
//! counts with a probability proportional to its weight ([`ThinningKey`](crate::photon::ThinningKey)). The counted
//! photons are as dense as the light and still form a Poisson process, so the test keeps its significance. If all
//! weights are equal, one photon in 250 is lost, because weights have limited precision. Otherwise the heaviest photon
//! seen so far determines the probabilities, and the test takes longer. When a heavier one arrives, earlier counts are
//! thinned accordingly.

use super::CountingRule;
use super::chi_squared::{self, Bandwidth, ChiSquared, ChiSquaredSettings};
use crate::math::Frame;
use crate::photon::thinning_key;
use crate::random::{GOLDEN, mix};
use crate::transport::{FoundPhotons, MAX_LEVELS};
use wide::f32x8;

/// The chi-squared bandwidth rule for guided light paths: it counts a random subset of photons, thinned to the density
/// of the heaviest photon.
#[derive(Clone, Debug)]
pub struct Thinned(ChiSquared);

impl Thinned {
    /// Creates the rule as [`ChiSquared::new`].
    pub fn new(settings: &ChiSquaredSettings) -> Thinned {
        Thinned(ChiSquared::new(settings))
    }
}

/// Keeps each of the counted photons with this probability, and reduces the counts accordingly.
#[cold]
fn thin(counts: &mut [u32], probability: f64, seed: u64) {
    let threshold = (probability * 2f64.powi(64)) as u64;
    let mut state = seed;
    let mut kept = || {
        state = state.wrapping_add(GOLDEN);
        mix(state) < threshold
    };
    for count in counts {
        *count = (0..*count).filter(|_| kept()).count() as u32;
    }
}

impl CountingRule for Thinned {
    type Bandwidth = Bandwidth;
    type Count = u32;
    type Tally = [chi_squared::Tally; MAX_LEVELS];

    const NEEDS_THINNING_KEYS: bool = true;

    /// Number of counts per bandwidth: one per cell of the disc, and one for the largest photon weight.
    fn counts(&self) -> usize {
        self.0.counts() + 1
    }

    fn initial(&self, squared: f32, photons: f32, above: i32) -> Bandwidth {
        self.0.initial(squared, photons, above)
    }

    #[inline]
    fn squared(bandwidth: &Bandwidth) -> f32 {
        ChiSquared::squared(bandwidth)
    }

    #[inline]
    fn count(
        &self,
        bandwidths: &[Bandwidth],
        counts: &mut [u32],
        tally: &mut Self::Tally,
        frame: &Frame,
        photons: &FoundPhotons,
    ) {
        let distance2 = photons.distance2.to_array();
        let levels = bandwidths.iter().zip(counts.chunks_exact_mut(self.counts())).zip(tally);
        for ((bandwidth, counts), tally) in levels {
            let Some((heaviest, counts)) = counts.split_last_mut() else { continue };
            let within = |k: usize| distance2[k] < bandwidth.squared;
            let weight = |k: usize| if within(k) { thinning_key::weight(photons.thinning_keys[k]) } else { 0 };
            let found = (0..8).map(weight).fold(0, u32::max);
            if found > *heaviest {
                tally.settle(counts);
                let seed = u64::from(bandwidth.squared.to_bits()) << 32 | u64::from(found);
                thin(counts, f64::from(thinning_key::bound(*heaviest) / thinning_key::bound(found)), seed);
                *heaviest = found;
            }
            let counted = |k: usize| {
                if thinning_key::above(photons.thinning_keys[k], *heaviest) { distance2[k] } else { f32::INFINITY }
            };
            let photons = FoundPhotons { distance2: f32x8::from(std::array::from_fn(counted)), ..*photons };
            self.0.count(std::slice::from_ref(bandwidth), counts, tally, frame, &photons);
        }
    }

    #[inline]
    fn update(&self, i: u64, bandwidths: &mut [Bandwidth], counts: &mut [u32], tally: &mut Self::Tally) {
        let levels = bandwidths.iter_mut().zip(counts.chunks_exact_mut(self.counts())).zip(tally);
        for ((bandwidth, counts), tally) in levels {
            let Some((heaviest, counts)) = counts.split_last_mut() else { continue };
            let before = bandwidth.squared;
            self.0.update(i, std::slice::from_mut(bandwidth), counts, tally);
            if bandwidth.squared < before {
                // Counts start again at zero, and so does the largest weight.
                *heaviest = 0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::photon::ThinningKey;
    use crate::random::{Domain, Purpose, Stream};

    /// Fraction of 1000 discs that are rejected, by this rule and by the rule without thinning. On one side of a line
    /// photons are `denser` times as dense, with weights smaller by that factor. Beyond that, the light on that side is
    /// `brighter`.
    fn rejected(denser: f32, brighter: f32) -> [f64; 2] {
        let settings = ChiSquaredSettings::default();
        let (thinned, plain) = (Thinned::new(&settings), ChiSquared::new(&settings));
        let frame = Frame::from_normal(Vec3::Z);
        let mut shrunk = [0.0; 2];
        const TRIALS: u64 = 1000;
        for trial in 0..TRIALS {
            let begin = thinned.initial(1.0, 10.0, 0);
            let (mut a, mut b) = ([begin], [begin]);
            let (mut counts_a, mut counts_b) = ([0u32; 13], [0u32; 12]);
            let mut tally_a = <Thinned as CountingRule>::Tally::default();
            let mut tally_b = chi_squared::Tally::default();
            for i in 0..(240.0 * denser) as u64 {
                let draws = Stream::new(21, trial, Domain::Test, i).vertex(0);
                let u = draws.two(Purpose::Pixel);
                let (sin, cos) = (std::f32::consts::TAU * u.y).sin_cos();
                let (x, y) = (u.x.sqrt() * cos, u.x.sqrt() * sin);
                // Uniform points, thinned to the wanted density.
                let (dense, light) = (x > 0.3, if x > 0.3 { brighter } else { 1.0 });
                let share = if dense { light } else { light / denser } / brighter.max(1.0);
                if draws.one(Purpose::Lobe) >= share {
                    continue;
                }
                let weight = if dense { 1.0 / denser } else { 1.0 };
                let thinning_key = ThinningKey::new(weight, draws.one(Purpose::Loss));
                let found = FoundPhotons::one(frame.t * x + frame.b * y, u.x, 1.0, thinning_key);
                thinned.count(&a, &mut counts_a, &mut tally_a, &frame, &found);
                plain.count(&b, &mut counts_b, &mut tally_b, &frame, &found);
            }
            // A single test, so that the probability of a rejection is the significance.
            thinned.update(1, &mut a, &mut counts_a, &mut tally_a);
            plain.update(1, &mut b, &mut counts_b, &mut tally_b);
            shrunk[0] += f64::from(u8::from(a[0].squared < 1.0)) / TRIALS as f64;
            shrunk[1] += f64::from(u8::from(b[0].squared < 1.0)) / TRIALS as f64;
        }
        shrunk
    }

    /// A gradient of the guide is not rejected by this rule, but by the rule without thinning (the planted bug). An
    /// edge in the light is rejected. The fraction of 1000 discs rejected is 5 % within four standard errors and the
    /// error of the chi-squared approximation (below 1 % with these counts).
    #[test]
    fn gradients_of_the_guide_are_not_rejected() {
        let allowed = 4.0 * (0.05f64 * 0.95 / 1000.0).sqrt() + 0.01;
        let [alike, alike_plain] = rejected(1.0, 1.0);
        let [guided, guided_plain] = rejected(8.0, 1.0);
        let [edge, _] = rejected(8.0, 3.0);
        println!("alike {alike} {alike_plain}, guided {guided} {guided_plain}, an edge {edge}");
        assert!([alike, alike_plain].iter().all(|share| (share - 0.05).abs() < allowed), "{alike} {alike_plain}");
        assert!((guided - 0.05).abs() < allowed, "{guided}");
        assert!(guided_plain > 0.95, "the planted bug goes unnoticed: {guided_plain}");
        assert!(edge > 0.9, "{edge}");
    }

    /// Photons counted before a heavier one arrives are as many as if it had arrived first, within four standard
    /// errors.
    #[test]
    fn earlier_counts_are_thinned_when_a_heavier_photon_arrives() {
        let rule = Thinned::new(&ChiSquaredSettings { significance: 1e-300, ..ChiSquaredSettings::default() });
        let frame = Frame::from_normal(Vec3::Z);
        let count = |heavy_first: bool| -> f64 {
            let mut bandwidths = [rule.initial(1.0, 10.0, 0)];
            let (mut counts, mut tally) = ([0u32; 13], <Thinned as CountingRule>::Tally::default());
            let heavy = FoundPhotons::one(Vec3::ZERO, 0.0, 1.0, ThinningKey::new(4.0, 0.5));
            if heavy_first {
                rule.count(&bandwidths, &mut counts, &mut tally, &frame, &heavy);
            }
            for i in 0..40_000 {
                let draws = Stream::new(22, 0, Domain::Test, i).vertex(0);
                let found =
                    FoundPhotons::one(Vec3::X * 0.5, 0.25, 1.0, ThinningKey::new(1.0, draws.one(Purpose::Lobe)));
                rule.count(&bandwidths, &mut counts, &mut tally, &frame, &found);
            }
            if !heavy_first {
                rule.count(&bandwidths, &mut counts, &mut tally, &frame, &heavy);
            }
            rule.update(1, &mut bandwidths, &mut counts, &mut tally);
            counts[..12].iter().map(|&c| f64::from(c)).sum()
        };
        let error = (40_000.0f64 * 0.25 * 0.75).sqrt();
        for heavy_first in [false, true] {
            let found = count(heavy_first);
            assert!((found - 10_001.0).abs() < 4.0 * error + 0.005 * 10_001.0, "{found}");
        }
    }
}
