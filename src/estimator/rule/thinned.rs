//! The chi-squared rule where photons differ in weight.
//!
//! Guided light paths are dense where the guide sends them, and carry little there. The test counts photons, so it
//! would take the border between what is guided more and what is guided less for an edge in the light. Within a disc
//! each photon therefore counts with a probability in proportion to its weight ([`ThinningKey`](crate::photon::ThinningKey)): what is
//! counted is as dense as the light, whatever the guide does, and is still a Poisson process, so that the test means
//! what it says. Where all weigh the same, one in 250 is lost (weights are told by their leading bits). Where they do
//! not, the heaviest photon that a disc has seen decides how many of the others count, and the test takes longer; when
//! a heavier one comes, those counted before are thinned as if it had been known.

use super::CountingRule;
use super::chi_squared::{self, Bandwidth, ChiSquared, ChiSquaredSettings};
use crate::math::Frame;
use crate::photon::thinning_key;
use crate::random::{GOLDEN, mix};
use crate::transport::{FoundPhotons, MAX_LEVELS};
use wide::f32x8;

/// The rule.
#[derive(Clone, Debug)]
pub struct Thinned(ChiSquared);

impl Thinned {
    /// The rule with its critical values, as [`ChiSquared::new`].
    pub fn new(settings: &ChiSquaredSettings) -> Thinned {
        Thinned(ChiSquared::new(settings))
    }
}

/// Keeps each of so many photons in every cell with a probability.
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

    /// One per cell, and the largest weight.
    fn counts(&self) -> usize {
        self.0.counts() + 1
    }

    fn begin(&self, radius2: f32, photons: f32, above: i32) -> Bandwidth {
        self.0.begin(radius2, photons, above)
    }

    #[inline]
    fn radius2(bandwidth: &Bandwidth) -> f32 {
        ChiSquared::radius2(bandwidth)
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
            let within = |k: usize| distance2[k] < bandwidth.radius2;
            let weight = |k: usize| if within(k) { thinning_key::weight(photons.thinning_keys[k]) } else { 0 };
            let found = (0..8).map(weight).fold(0, u32::max);
            if found > *heaviest {
                tally.settle(counts);
                let seed = u64::from(bandwidth.radius2.to_bits()) << 32 | u64::from(found);
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
            let before = bandwidth.radius2;
            self.0.update(i, std::slice::from_mut(bandwidth), counts, tally);
            if bandwidth.radius2 < before {
                // Counts begin anew, and so does what they are measured by.
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

    /// Share of a thousand discs that are rejected after so many iterations, by the rule and by the one that takes all
    /// photons for alike. On one side of a line through the disc photons are `denser` times as many as on the other and
    /// weigh as much less; beyond that the light is `brighter` on that side.
    fn rejected(denser: f32, brighter: f32) -> [f64; 2] {
        let settings = ChiSquaredSettings::default();
        let (thinned, plain) = (Thinned::new(&settings), ChiSquared::new(&settings));
        let frame = Frame::from_normal(Vec3::Z);
        let mut shrunk = [0.0; 2];
        const TRIALS: u64 = 1000;
        for trial in 0..TRIALS {
            let begin = thinned.begin(1.0, 10.0, 0);
            let (mut a, mut b) = ([begin], [begin]);
            let (mut counts_a, mut counts_b) = ([0u32; 13], [0u32; 12]);
            let mut tally_a = <Thinned as CountingRule>::Tally::default();
            let mut tally_b = chi_squared::Tally::default();
            for i in 0..(240.0 * denser) as u64 {
                let draws = Stream::new(21, trial, Domain::Test, i).vertex(0);
                let u = draws.two(Purpose::Pixel);
                let (sin, cos) = (std::f32::consts::TAU * u.y).sin_cos();
                let (x, y) = (u.x.sqrt() * cos, u.x.sqrt() * sin);
                // Of as many everywhere only some are there.
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
            // One look, so that the chance of a rejection is the significance.
            thinned.update(1, &mut a, &mut counts_a, &mut tally_a);
            plain.update(1, &mut b, &mut counts_b, &mut tally_b);
            shrunk[0] += f64::from(u8::from(a[0].radius2 < 1.0)) / TRIALS as f64;
            shrunk[1] += f64::from(u8::from(b[0].radius2 < 1.0)) / TRIALS as f64;
        }
        shrunk
    }

    /// The gradient of a guide is not light, to this rule; it is to the one that counts all photons (the planted bug).
    /// An edge in the light is seen. The share of 1000 discs that are rejected is 5 % within four standard errors and
    /// the chi-squared approximation's own error (below 1 % with these counts).
    #[test]
    fn a_guides_gradient_is_not_light() {
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

    /// Photons that were counted before a heavier one came are as many as if it had come first, within four standard
    /// errors.
    #[test]
    fn what_was_counted_before_is_thinned() {
        let rule = Thinned::new(&ChiSquaredSettings { significance: 1e-300, ..ChiSquaredSettings::default() });
        let frame = Frame::from_normal(Vec3::Z);
        let count = |heavy_first: bool| -> f64 {
            let mut bandwidths = [rule.begin(1.0, 10.0, 0)];
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
