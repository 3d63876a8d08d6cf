//! The chi-squared rule \[CPPM 2020\]: a bandwidth stays while the photons within it look uniform, and shrinks when a
//! test rejects that.
//!
//! The disc of the bandwidth is divided into annuli of equal area, and these into equal sectors (section 5.3). Photons
//! of all iterations since the last reduction are counted by cell, in the frame of their gathering point and projected
//! to its plane \[(27)\].

use super::CountingRule;
use crate::math::{Frame, Vec3};
use crate::transport::{FoundPhotons, MAX_LEVELS};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared as Distribution, ContinuousCDF};
use wide::{CmpGe, CmpGt, CmpLt, f32x8, f64x4, i32x4, u32x4, u64x4};

/// Parameters of the chi-squared bandwidth rule, with the defaults of the paper (section 9.1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChiSquaredSettings {
    /// Number of annuli, n_a, into which the gathering disc is divided to count photons; at least 1.
    pub annuli: usize,
    /// Number of sectors per annulus, n_s; at least 1.
    pub sectors: usize,
    /// Factor of the squared bandwidth, k, in a reduction where no smaller disc looks uniform.
    pub k: f64,
    /// Factor by which the smallest number of photons for a test grows with every reduction, beta.
    pub beta: f64,
    /// Probability with which the test rejects uniform photons, alpha_chi, in (0, 1).
    pub significance: f64,
    /// Whether the color channels are rendered separately, with photons of equal flux (section 9.4), so that the test
    /// also detects variations of flux.
    pub plus: bool,
}

impl Default for ChiSquaredSettings {
    fn default() -> Self {
        ChiSquaredSettings { annuli: 2, sectors: 6, k: 0.8, beta: 1.2, significance: 0.05, plus: false }
    }
}

/// Smallest number of photons for the first test, B_1, even if fewer neighbours set the bandwidth. With fewer photons
/// the statistic does not follow its distribution.
pub const MIN_BOUND: f32 = 10.0;

/// Largest number of photons in all cells of a bandwidth level together; see [`ChiSquared::sums`].
const MAX_COUNT: f64 = (1u32 << 30) as f64;

/// The chi-squared bandwidth rule: a bandwidth shrinks when the photons in the cells of its disc do not look uniform.
#[derive(Clone, Debug)]
pub struct ChiSquared {
    annuli: usize,
    sectors: usize,
    k: f32,
    beta: f32,
    /// Quantile of the chi-squared distribution for the cells of the `j + 1` innermost annuli, at index `j`; infinite
    /// for a single cell.
    critical: Vec<f64>,
    /// Borders between annuli: squared bandwidths over that of the whole disc.
    rings: Vec<f32>,
    /// Unit directions of the borders between sectors, as components along the two axes of the disc. If their number is
    /// even, only the borders in one half of the disc.
    rays: Vec<(f32, f32)>,
    /// Whether the disc has two annuli of six sectors, which are counted by a faster function.
    has_default_cells: bool,
}

/// Number of cells with the default of two annuli of six sectors.
const DEFAULT_CELLS: usize = 12;
/// Bits of a cell in [`Tally::packed`], and the largest number of octets of photons that they can count. Each of four
/// numbers counts a quarter of the photons.
const BITS: u32 = 5;
const MAX_OCTETS: u32 = 15;
const _: () = assert!(2 * MAX_OCTETS < 1 << BITS && DEFAULT_CELLS as u32 * BITS < u64::BITS);
/// Bits of a cell when the four numbers are summed with every other cell left out, and the mask of every other cell.
const WIDE: u32 = 2 * BITS;
const EVEN: u64 = {
    let (mut mask, mut cell) = (0, 0);
    while cell < DEFAULT_CELLS as u32 {
        mask |= ((1 << BITS) - 1) << (cell * BITS);
        cell += 2;
    }
    mask
};

/// Counts of the photons that one camera path finds, by bandwidth level.
#[derive(Debug, Default)]
pub struct Tally {
    /// By bandwidth level, number of photons in each of the default cells, packed into bits. The remaining bits count
    /// photons outside. The counts are the sums of four numbers.
    packed: [u64x4; MAX_LEVELS],
    /// Number of groups of eight photons that have been added.
    octets: u32,
    /// By bandwidth level, whether photons have been counted without `packed`.
    counted: [bool; MAX_LEVELS],
}

impl Tally {
    /// Adds the packed photons of one bandwidth level to its cell counts. Returns whether there are any.
    #[inline(always)]
    fn unpack(&mut self, level: usize, counts: &mut [u32]) -> bool {
        let packed = std::mem::take(&mut self.packed[level]).to_array();
        // Sums of every other cell, which do not overflow into each other.
        let even = packed.iter().fold(0, |sum, packed| sum + (packed & EVEN));
        let odd = packed.iter().fold(0, |sum, packed| sum + (packed >> BITS & EVEN));
        if even | odd == 0 {
            return self.counted[level];
        }
        let Some(counts) = counts.first_chunk_mut::<DEFAULT_CELLS>() else { return false };
        let (fours, _) = counts.as_chunks_mut::<4>();
        for (k, four) in fours.iter_mut().enumerate() {
            let [even, odd] = [even, odd].map(|cells| (cells >> (2 * WIDE * k as u32)) as u32);
            let added = u32x4::from([even, odd, even, odd]) >> u32x4::from([0, 0, WIDE, WIDE]);
            *four = (u32x4::from(*four) + (added & u32x4::splat((1 << WIDE) - 1))).to_array();
        }
        true
    }

    /// Adds the packed photons of all bandwidth levels to their cell counts.
    #[cold]
    #[inline(never)]
    pub fn settle(&mut self, counts: &mut [u32]) {
        for (level, counts) in counts.chunks_exact_mut(DEFAULT_CELLS).enumerate() {
            self.counted[level] = self.unpack(level, counts);
        }
        self.octets = 0;
    }
}

/// Bandwidth of one level of one pixel, with the state of its test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bandwidth {
    /// Squared bandwidth (m2).
    pub squared: f32,
    /// Number of photons required before the next test, B.
    pub bound: f32,
}

impl ChiSquared {
    /// The rule with its critical values. Annuli and sectors must be at least 1, `significance` in (0, 1).
    pub fn new(settings: &ChiSquaredSettings) -> ChiSquared {
        let ChiSquaredSettings { annuli, sectors, k, beta, significance, plus: _ } = *settings;
        let quantile = |cells: usize| match Distribution::new((cells - 1) as f64) {
            Ok(distribution) => distribution.inverse_cdf(1.0 - significance),
            Err(_) => f64::INFINITY,
        };
        let half = if sectors.is_multiple_of(2) { sectors / 2 } else { sectors };
        let rays = (1..half)
            .map(|s| (std::f64::consts::TAU * s as f64 / sectors as f64).sin_cos())
            .map(|(sin, cos)| (cos as f32, sin as f32))
            .collect();
        ChiSquared {
            annuli,
            sectors,
            k: k as f32,
            beta: beta as f32,
            critical: (1..=annuli).map(|annuli| quantile(annuli * sectors)).collect(),
            rings: (1..annuli).map(|ring| ring as f32 / annuli as f32).collect(),
            rays,
            has_default_cells: (annuli, sectors) == (2, 6),
        }
    }

    /// Sectors of photons at `offset` from the gathering point with this frame, by the direction of the projected
    /// offset \[(27)\]. Photons on the normal count in the first sector. An even number of borders forms lines through
    /// the centre. Then the sector is the half of the disc plus the number of lines that the photon is beyond, so the
    /// lower half is numbered backwards.
    fn sectors(&self, frame: &Frame, offset: &[f32x8; 3]) -> f32x8 {
        let (u, v) = (along(frame.t, offset), along(frame.b, offset));
        if !self.sectors.is_multiple_of(2) {
            let turn = |u: f32, v: f32| (v.atan2(u) / std::f32::consts::TAU).rem_euclid(1.0);
            let (u, v) = (u.to_array(), v.to_array());
            let last = self.sectors as f32 - 1.0;
            let sector = |k: usize| (turn(u[k], v[k]) * self.sectors as f32).floor().min(last);
            return f32x8::from(std::array::from_fn(sector));
        }
        let mut sector = v.cmp_lt(f32x8::ZERO) & f32x8::splat(0.5 * self.sectors as f32);
        for &(c, s) in &self.rays {
            sector += (v * c).cmp_gt(u * s) & f32x8::ONE;
        }
        sector
    }

    /// [`CountingRule::count`] for any numbers of annuli and sectors.
    #[inline(never)]
    fn count_any(
        &self,
        bandwidths: &[Bandwidth],
        counts: &mut [u32],
        tally: &mut Tally,
        frame: &Frame,
        photons: &FoundPhotons,
    ) {
        let sectors = self.sectors(frame, &photons.offset);
        for (level, (bandwidth, counts)) in bandwidths.iter().zip(counts.chunks_exact_mut(self.counts())).enumerate() {
            // A photon on a border belongs to the outer annulus.
            let mut cell = sectors;
            for ring in &self.rings {
                let outside = photons.distance2.cmp_ge(f32x8::splat(bandwidth.squared * ring));
                cell += outside & f32x8::splat(self.sectors as f32);
            }
            let cell = cell.fast_trunc_int().to_array();
            let mut within = photons.distance2.cmp_lt(f32x8::splat(bandwidth.squared)).move_mask();
            tally.counted[level] |= within != 0;
            while within != 0 {
                counts[cell[within.trailing_zeros() as usize] as usize] += 1;
                within &= within - 1;
            }
        }
    }

    /// [`CountingRule::count`] for two annuli of six sectors, without loops over borders or photons. The photons of a
    /// path are first counted with five bits per cell.
    #[inline(always)]
    fn count_default_cells(
        bandwidths: &[Bandwidth],
        counts: &mut [u32],
        tally: &mut Tally,
        frame: &Frame,
        photons: &FoundPhotons,
    ) {
        let by = f32x8::splat;
        // The borders at 60 and 120 degrees.
        let (u, v) = (along(frame.t, &photons.offset) * 3f32.sqrt(), along(frame.b, &photons.offset));
        let [half, sixth, outer] = [3.0, 1.0, 6.0].map(|cells| by(cells * BITS as f32));
        let sector = (v.cmp_lt(by(0.0)) & half) + (v.cmp_gt(u) & sixth) + ((u + v).cmp_lt(by(0.0)) & sixth);
        for (bandwidth, packed) in bandwidths.iter().zip(&mut tally.packed) {
            let outside = photons.distance2.cmp_ge(by(bandwidth.squared * 0.5));
            let within = photons.distance2.cmp_lt(by(bandwidth.squared));
            let place = within.blend(sector + (outside & outer), by((DEFAULT_CELLS as u32 * BITS) as f32));
            let places = place.fast_trunc_int().to_array();
            let ones = |first: usize| u64x4::from(std::array::from_fn(|k| 1 << places[first + k]));
            // Photons outside may overflow the last bit, which nobody reads.
            *packed += ones(0) + ones(4);
        }
        tally.octets += 1;
        if tally.octets == MAX_OCTETS {
            tally.settle(counts);
        }
    }

    /// Sum of cell counts, and sum of their squares. Exact while these are below 2^53 and each count is below 2^31.
    #[inline]
    fn sums(counts: &[u32]) -> (f64, f64) {
        let (mut totals, mut squares) = (f64x4::ZERO, f64x4::ZERO);
        let mut add = |count: f64x4| {
            totals += count;
            squares += count * count;
        };
        let (fours, rest) = counts.as_chunks::<4>();
        // Converting a signed integer takes one instruction, an unsigned one three.
        let signed = |four: &[u32; 4]| f64x4::from_i32x4(i32x4::from(four.map(u32::cast_signed)));
        match fours {
            // Without a loop for the default cells.
            [a, b, c] => [a, b, c].into_iter().for_each(|four| add(signed(four))),
            fours => fours.iter().for_each(|four| add(signed(four))),
        }
        rest.iter().for_each(|&count| add(f64x4::from([f64::from(count), 0.0, 0.0, 0.0])));
        (totals.reduce_add(), squares.reduce_add())
    }

    /// Chi-squared statistic of cell counts with equal expectations \[(12)\]; 0 without photons.
    pub fn statistic(counts: &[u32]) -> f64 {
        let (total, squares) = Self::sums(counts);
        if total == 0.0 {
            return 0.0;
        }
        squares * counts.len() as f64 / total - total
    }

    /// Whether the photons in this number of innermost annuli pass the test for uniformity, given the
    /// [`ChiSquared::sums`] of their cells. Compares the statistic times the total with the quantile, which needs no
    /// division.
    #[inline]
    fn looks_uniform(&self, annuli: usize, total: f64, squares: f64) -> bool {
        squares * (annuli * self.sectors) as f64 <= total * (total + self.critical[annuli - 1])
    }

    /// Halves all cell counts of a bandwidth level, before they exceed signed integers. Photons that look uniform after
    /// a thousand million still do with half of the counts.
    #[cold]
    #[inline(never)]
    fn halve(counts: &mut [u32]) {
        counts.iter_mut().for_each(|count| *count /= 2);
    }

    /// Tests the cell counts of a level after an iteration if there are enough photons, and shrinks the bandwidth if
    /// they do not look uniform. Returns whether it has shrunk.
    #[inline(always)]
    fn test(&self, bandwidth: &mut Bandwidth, counts: &mut [u32]) -> bool {
        let (total, squares) = Self::sums(counts);
        let rejected = total >= f64::from(bandwidth.bound) && !self.looks_uniform(self.annuli, total, squares);
        if rejected {
            self.shrink(bandwidth, counts);
        } else if total >= MAX_COUNT {
            Self::halve(counts);
        }
        rejected
    }

    /// Shrinks the bandwidth to the largest inner disc that looks uniform, or by k if none does \[6.1, (13), (14)\],
    /// and resets the counts.
    #[cold]
    #[inline(never)]
    fn shrink(&self, bandwidth: &mut Bandwidth, counts: &mut [u32]) {
        let passes = |annuli: usize| {
            let (total, squares) = Self::sums(&counts[..annuli * self.sectors]);
            // A disc without photons is not tested.
            total > 0.0 && self.looks_uniform(annuli, total, squares)
        };
        let factor = match (1..self.annuli).rev().find(|&annuli| passes(annuli)) {
            Some(annuli) => annuli as f32 / self.annuli as f32,
            None => self.k,
        };
        // The bandwidth must stay above zero.
        bandwidth.squared = (bandwidth.squared * factor).max(f32::MIN_POSITIVE);
        bandwidth.bound *= self.beta;
        counts.fill(0);
    }
}

/// Components of eight vectors along an axis.
#[inline(always)]
fn along(axis: Vec3, [x, y, z]: &[f32x8; 3]) -> f32x8 {
    x.mul_add(f32x8::splat(axis.x), y.mul_add(f32x8::splat(axis.y), *z * axis.z))
}

impl CountingRule for ChiSquared {
    type Bandwidth = Bandwidth;
    type Count = u32;
    type Tally = Tally;

    /// Number of counts per bandwidth: one per cell of the disc.
    fn counts(&self) -> usize {
        self.annuli * self.sectors
    }

    fn initial(&self, squared: f32, photons: f32, _: i32) -> Bandwidth {
        Bandwidth { squared, bound: photons.max(MIN_BOUND) }
    }

    #[inline]
    fn squared(bandwidth: &Bandwidth) -> f32 {
        bandwidth.squared
    }

    #[inline(always)]
    fn count(
        &self,
        bandwidths: &[Bandwidth],
        counts: &mut [u32],
        tally: &mut Tally,
        frame: &Frame,
        photons: &FoundPhotons,
    ) {
        if self.has_default_cells {
            return Self::count_default_cells(bandwidths, counts, tally, frame, photons);
        }
        // Passing a copy keeps photons in registers on the other branch.
        self.count_any(bandwidths, counts, tally, frame, &photons.clone());
    }

    /// Tests bandwidth levels with new photons only: the others have passed the test already.
    #[inline(always)]
    fn update(&self, _: u64, bandwidths: &mut [Bandwidth], counts: &mut [u32], tally: &mut Tally) {
        for (level, (bandwidth, counts)) in
            bandwidths.iter_mut().zip(counts.chunks_exact_mut(self.counts())).enumerate()
        {
            if tally.unpack(level, counts) {
                self.test(bandwidth, counts);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photon::ThinningKey;
    use crate::random::{Domain, Purpose, Stream};

    fn rule() -> ChiSquared {
        ChiSquared::new(&ChiSquaredSettings::default())
    }

    /// A uniform random point of the unit disc, for photon number `i` of a trial.
    fn uniform(trial: u64, i: u64) -> (f32, f32) {
        let u = Stream::new(7, trial, Domain::Test, i).vertex(0).two(Purpose::Pixel);
        let (sin, cos) = (std::f32::consts::TAU * u.y).sin_cos();
        (u.x.sqrt() * cos, u.x.sqrt() * sin)
    }

    fn count(rule: &ChiSquared, counts: &mut [u32], (x, y): (f32, f32)) {
        let frame = Frame::from_normal(Vec3::Z);
        let offset = frame.t * x + frame.b * y;
        let bandwidth = Bandwidth { squared: 1.0, bound: 10.0 };
        let mut tally = Tally::default();
        rule.count(
            &[bandwidth],
            counts,
            &mut tally,
            &frame,
            &FoundPhotons::one(offset, x * x + y * y, 1.0, ThinningKey::default()),
        );
        tally.unpack(0, counts);
    }

    /// Counts that would exceed signed integers are halved together; those that are not uniform are rejected first.
    #[test]
    fn counts_never_exceed_signed_integers() {
        let rule = rule();
        let mut bandwidth = Bandwidth { squared: 1.0, bound: 10.0 };
        let each = (1u32 << 30) / 12 + 1;
        let mut counts = [each; 12];
        assert!(!rule.test(&mut bandwidth, &mut counts));
        assert_eq!((counts, bandwidth.squared), ([each / 2; 12], 1.0));
        // Many iterations later counts are still below the limit.
        for _ in 0..10_000 {
            counts.iter_mut().for_each(|count| *count += 1_000_000);
            assert!(!rule.test(&mut bandwidth, &mut counts));
            assert!(counts.iter().all(|count| *count < 1 << 30));
        }
        counts[3] += 1_000_000;
        assert!(rule.test(&mut bandwidth, &mut counts) && bandwidth.squared < 1.0);
        assert_eq!(counts, [0; 12]);
    }

    #[test]
    fn sectors_follow_the_angle() {
        for sectors in [1, 2, 3, 4, 5, 6, 8, 12] {
            let rule = ChiSquared::new(&ChiSquaredSettings { sectors, ..ChiSquaredSettings::default() });
            let frame = Frame::from_normal(Vec3::new(0.0, 1.0, 0.0));
            let sector = |offset: Vec3| {
                rule.sectors(&frame, &FoundPhotons::one(offset, 0.0, 1.0, ThinningKey::default()).offset).to_array()[0]
                    as usize
            };
            for i in 0..2000 {
                let (x, y) = uniform(0, i);
                let turn = y.atan2(x).rem_euclid(std::f32::consts::TAU) / std::f32::consts::TAU * sectors as f32;
                if (turn - turn.round()).abs() > 1e-4 {
                    let (turn, half) = (turn as usize, sectors / 2);
                    let backwards = sectors.is_multiple_of(2) && turn >= half;
                    let expected = if backwards { sectors + half - 1 - turn } else { turn };
                    assert_eq!(sector(frame.t * x + frame.b * y + frame.n * 0.3), expected, "{x} {y}");
                }
            }
            assert_eq!((sector(Vec3::ZERO), sector(frame.n)), (0, 0));
        }
    }

    /// Levels that are counted together have the counts that each has alone; levels with photons are reported.
    #[test]
    fn levels_counted_together_have_the_counts_of_each_alone() {
        let rule = rule();
        let frame = Frame::from_normal(Vec3::Z);
        let levels: [Bandwidth; MAX_LEVELS] =
            std::array::from_fn(|level| rule.initial([0.3, 1.0, 0.05, 0.3, 0.7][level], 10.0, 0));
        let [mut together, mut apart, mut any] = [[0u32; 12 * MAX_LEVELS]; 3];
        for trial in 0..500 {
            let (mut offset, mut distance2) = ([[0.0f32; 8]; 3], [f32::INFINITY; 8]);
            for k in 0..trial as usize % 9 {
                let (x, y) = uniform(trial, k as u64);
                (offset[0][k], offset[1][k], distance2[k]) = (x, y, x * x + y * y);
            }
            let found = FoundPhotons {
                offset: offset.map(f32x8::from),
                distance2: f32x8::from(distance2),
                light: f32x8::ONE,
                thinning_keys: [0; 8],
            };
            // Up to more octets than a tally can hold.
            let times = trial % 37;
            let (mut tally, mut tally_any) = (Tally::default(), Tally::default());
            for _ in 0..times {
                rule.count(&levels, &mut together, &mut tally, &frame, &found);
                rule.count_any(&levels, &mut any, &mut tally_any, &frame, &found);
            }
            for (level, counts) in apart.chunks_exact_mut(12).enumerate() {
                let mut alone = Tally::default();
                (0..times).for_each(|_| rule.count(&levels[level..=level], counts, &mut alone, &frame, &found));
                let counted = alone.unpack(0, counts);
                assert_eq!(counted, tally.unpack(level, &mut together[12 * level..][..12]));
                assert_eq!(counted, tally_any.unpack(level, &mut any[12 * level..][..12]));
                assert_eq!(counted, times > 0 && distance2.iter().any(|d2| *d2 < levels[level].squared));
            }
            assert_eq!((together, apart), (any, any));
        }
        assert!(together.chunks(12).all(|counts| counts.iter().all(|&count| count > 0)));
    }

    #[test]
    fn both_forms_of_the_statistic_agree() {
        let counts = [3u32, 0, 7, 2, 9, 1];
        let (total, p) = (22.0, 1.0 / 6.0);
        let direct: f64 = counts.iter().map(|&o| (f64::from(o) - total * p).powi(2) / (total * p)).sum();
        assert!((ChiSquared::statistic(&counts) - direct).abs() < 1e-12);
        // The rule's test needs no division.
        let rule = rule();
        let critical = rule.critical[1];
        for trial in 0..2000 {
            let mut counts = [0; 12];
            for i in 0..10 + trial % 50 {
                let (x, y) = uniform(trial, i);
                count(&rule, &mut counts, (x.abs(), y));
            }
            let (statistic, (total, squares)) = (ChiSquared::statistic(&counts), ChiSquared::sums(&counts));
            assert_eq!(rule.looks_uniform(2, total, squares), statistic <= critical, "{statistic} {critical}");
        }
    }

    /// The test rejects 5 % of fields of 120 and 1000 uniform photons, within five standard errors of 10^5 trials plus
    /// the error of the chi-squared approximation, which is below half a percent for 120 photons in 12 cells. Photons
    /// with a gradient are rejected more often.
    #[test]
    fn the_test_rejects_uniform_photons_at_its_significance() {
        let rule = rule();
        for photons in [120, 1000] {
            let trials = if photons == 120 { 100_000 } else { 20_000 };
            let (mut rejected, mut detected) = (0, 0);
            for trial in 0..trials {
                let (mut counts, mut sloped) = ([0; 12], [0; 12]);
                for i in 0..photons {
                    let (x, y) = uniform(trial, i);
                    count(&rule, &mut counts, (x, y));
                    // Density 1 + 0.8 x: rejected photons are mirrored.
                    let keep = Stream::new(8, trial, Domain::Test, i).vertex(0).one(Purpose::Lobe) < 0.5 + 0.4 * x;
                    count(&rule, &mut sloped, (if keep { x } else { -x }, y));
                }
                rejected += i32::from(ChiSquared::statistic(&counts) > rule.critical[1]);
                detected += i32::from(ChiSquared::statistic(&sloped) > rule.critical[1]);
            }
            let size = f64::from(rejected) / trials as f64;
            let allowed = 5.0 * (0.05 * 0.95 / trials as f64).sqrt() + 0.005;
            println!("{photons} photons: size {size}, power {}", f64::from(detected) / trials as f64);
            assert!((size - 0.05).abs() < allowed, "{photons} photons: {size}");
            assert!(f64::from(detected) > 4.0 * 0.05 * trials as f64, "{photons} photons: a slope goes unnoticed");
        }
    }

    #[test]
    fn bandwidths_stay_positive_and_never_grow_and_reductions_reset_counts() {
        let rule = rule();
        let mut bandwidth = Bandwidth { squared: 1.0, bound: 10.0 };
        let mut counts = [0u32; 12];
        let mut reductions = 0;
        for step in 0..2000u64 {
            let before = bandwidth;
            let u = Stream::new(9, step, Domain::Test, 0).vertex(0).one(Purpose::Lobe);
            // Photons in one cell, or in all cells.
            let counted = counts;
            for (cell, c) in counts.iter_mut().enumerate() {
                *c += if u < 0.5 && cell != (step / 40 % 12) as usize { 0 } else { 5 };
            }
            assert!(counts.iter().zip(&counted).all(|(now, then)| now >= then));
            let reduced = rule.test(&mut bandwidth, &mut counts);
            assert!(bandwidth.squared > 0.0 && bandwidth.squared <= before.squared);
            assert_eq!(reduced, bandwidth.bound > before.bound);
            assert!(!reduced || counts.iter().all(|&c| c == 0));
            reductions += usize::from(reduced);
        }
        assert!(reductions > 10);
    }

    /// A reduction takes the largest inner disc that looks uniform, and the factor k if none does.
    #[test]
    fn reductions_follow_the_paper() {
        let rule = rule();
        let shrink = |counts: [u32; 12]| {
            let (mut bandwidth, mut counts) = (Bandwidth { squared: 1.0, bound: 10.0 }, counts);
            assert!(rule.test(&mut bandwidth, &mut counts));
            (bandwidth.squared, bandwidth.bound)
        };
        // Uniform inside, empty outside.
        assert_eq!(shrink([9, 10, 11, 10, 9, 11, 0, 0, 0, 0, 0, 0]), (0.5, 12.0));
        // An edge through the middle.
        assert_eq!(shrink([20, 20, 20, 0, 0, 0, 20, 20, 20, 0, 0, 0]), (0.8, 12.0));
        // All photons in the outer annulus: the inner disc is not tested.
        assert_eq!(shrink([0, 0, 0, 0, 0, 0, 9, 10, 11, 10, 9, 11]), (0.8, 12.0));
        // Too few photons for a test.
        let (mut bandwidth, mut counts) =
            (Bandwidth { squared: 1.0, bound: 10.0 }, [9u32, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        assert!(!rule.test(&mut bandwidth, &mut counts));
    }
}
