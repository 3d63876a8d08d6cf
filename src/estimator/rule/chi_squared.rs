//! The chi-squared rule \[CPPM 2020\]: a bandwidth is kept as long as the photons within it look uniform, and shrinks
//! only when a test says they do not.
//!
//! The disc of the bandwidth is cut into annuli of equal area and these into equal sectors (section 5.3). Photons of
//! all iterations since the last reduction are counted where they fall, turned into the frame of their gathering point
//! and laid flat \[(27)\].

use super::CountingRule;
use crate::math::{Frame, Vec3};
use crate::transport::{FoundPhotons, MAX_LEVELS};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared as Distribution, ContinuousCDF};
use wide::{CmpGe, CmpGt, CmpLt, f32x8, f64x4, i32x4, u32x4, u64x4};

/// Parameters, with the paper's defaults (section 9.1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChiSquaredSettings {
    /// Annuli, n_a.
    pub annuli: usize,
    /// Sectors of an annulus, n_s.
    pub sectors: usize,
    /// Bandwidth squared after a reduction over that before, where no smaller disc looks uniform, k.
    pub k: f64,
    /// Growth of the least count for a test with every reduction, beta.
    pub beta: f64,
    /// Probability of rejecting what is uniform, alpha_chi.
    pub significance: f64,
    /// Channels apart, with photons of equal flux (section 9.4): what varies in flux alone does not escape the test.
    pub plus: bool,
}

impl Default for ChiSquaredSettings {
    fn default() -> Self {
        ChiSquaredSettings { annuli: 2, sectors: 6, k: 0.8, beta: 1.2, significance: 0.05, plus: false }
    }
}

/// Least count for the first test, B_1, however few neighbours set the bandwidth: below it the statistic does not
/// follow its distribution.
pub const LEAST_BOUND: f32 = 10.0;

/// Photons of a level that are counted at most: see [`ChiSquared::sums`].
const MOST_COUNTED: f64 = (1u32 << 30) as f64;

/// The rule.
#[derive(Clone, Debug)]
pub struct ChiSquared {
    annuli: usize,
    sectors: usize,
    k: f32,
    beta: f32,
    /// Quantile for the disc of the `j + 1` innermost annuli; infinite where there is but one cell.
    critical: Vec<f64>,
    /// Borders between annuli: squared radii over that of the disc.
    rings: Vec<f32>,
    /// Directions of the borders between sectors, from the first axis, on one half of the disc if their number is even.
    rays: Vec<(f32, f32)>,
    /// Whether there are two annuli of six sectors: asked for every eight photons.
    usual: bool,
}

/// Cells of two annuli of six sectors.
const USUAL: usize = 12;
/// Bits of a cell in [`Tally::packed`], and how many times eight photons they count at most, of which a quarter are in
/// each number.
const BITS: u32 = 5;
const MOST_EIGHTS: u32 = 15;
const _: () = assert!(2 * MOST_EIGHTS < 1 << BITS && USUAL as u32 * BITS < u64::BITS);
/// Bits of a cell beside every other in the sum of those numbers, and all that every other cell has in them.
const WIDE: u32 = 2 * BITS;
const EVEN: u64 = {
    let (mut mask, mut cell) = (0, 0);
    while cell < USUAL as u32 {
        mask |= ((1 << BITS) - 1) << (cell * BITS);
        cell += 2;
    }
    mask
};

/// What the photons of one camera path add to counts.
#[derive(Debug, Default)]
pub struct Tally {
    /// By level, photons in the usual cells, and last, in the bits that are left over, those that are not within; the
    /// sum of four numbers.
    packed: [u64x4; MAX_LEVELS],
    /// How many times eight photons these may be.
    eights: u32,
    /// By level, whether something has been counted beside those.
    counted: [bool; MAX_LEVELS],
}

impl Tally {
    /// Adds the photons of a level to its counts, and says whether any were there.
    #[inline(always)]
    fn unpack(&mut self, level: usize, counts: &mut [u32]) -> bool {
        let packed = std::mem::take(&mut self.packed[level]).to_array();
        // Sums of cells that have room beside each other.
        let even = packed.iter().fold(0, |sum, packed| sum + (packed & EVEN));
        let odd = packed.iter().fold(0, |sum, packed| sum + (packed >> BITS & EVEN));
        if even | odd == 0 {
            return self.counted[level];
        }
        let Some(counts) = counts.first_chunk_mut::<USUAL>() else { return false };
        let (fours, _) = counts.as_chunks_mut::<4>();
        for (k, four) in fours.iter_mut().enumerate() {
            let [even, odd] = [even, odd].map(|cells| (cells >> (2 * WIDE * k as u32)) as u32);
            let added = u32x4::from([even, odd, even, odd]) >> u32x4::from([0, 0, WIDE, WIDE]);
            *four = (u32x4::from(*four) + (added & u32x4::splat((1 << WIDE) - 1))).to_array();
        }
        true
    }

    /// Adds the photons of all levels to their counts.
    #[cold]
    #[inline(never)]
    pub fn settle(&mut self, counts: &mut [u32]) {
        for (level, counts) in counts.chunks_exact_mut(USUAL).enumerate() {
            self.counted[level] = self.unpack(level, counts);
        }
        self.eights = 0;
    }
}

/// The bandwidth of one level of one pixel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bandwidth {
    /// Radius squared (m2).
    pub radius2: f32,
    /// Photons it takes for a test, B.
    pub bound: f32,
}

impl ChiSquared {
    /// The rule with its critical values. Annuli and sectors at least 1, `significance` in (0, 1).
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
            usual: (annuli, sectors) == (2, 6),
        }
    }

    /// Sectors of photons at `offset` from the gathering point with this frame. The direction of its projection decides
    /// \[(27)\]; a photon on the normal through the point has none and counts in the first sector. The borders are
    /// lines through the centre, if their number is even, so that a sector is the half it is in and the lines that it
    /// is beyond: the lower half is numbered backwards.
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

    /// [`CountingRule::count`] for any cells.
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
            // A border belongs to the annulus outside.
            let mut cell = sectors;
            for ring in &self.rings {
                let outside = photons.distance2.cmp_ge(f32x8::splat(bandwidth.radius2 * ring));
                cell += outside & f32x8::splat(self.sectors as f32);
            }
            let cell = cell.fast_trunc_int().to_array();
            let mut within = photons.distance2.cmp_lt(f32x8::splat(bandwidth.radius2)).move_mask();
            tally.counted[level] |= within != 0;
            while within != 0 {
                counts[cell[within.trailing_zeros() as usize] as usize] += 1;
                within &= within - 1;
            }
        }
    }

    /// The same for two annuli of six sectors, without a loop over borders, nor one over photons: those of a path are
    /// first counted by five bits a cell.
    #[inline(always)]
    fn count_usual(
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
            let outside = photons.distance2.cmp_ge(by(bandwidth.radius2 * 0.5));
            let within = photons.distance2.cmp_lt(by(bandwidth.radius2));
            let place = within.blend(sector + (outside & outer), by((USUAL as u32 * BITS) as f32));
            let places = place.fast_trunc_int().to_array();
            let ones = |first: usize| u64x4::from(std::array::from_fn(|k| 1 << places[first + k]));
            // Those not within may run over the last bit, and are nobody's.
            *packed += ones(0) + ones(4);
        }
        tally.eights += 1;
        if tally.eights == MOST_EIGHTS {
            tally.settle(counts);
        }
    }

    /// Sum of counts, and of their squares; exact as long as those are below 2^53, and each count below 2^31.
    #[inline]
    fn sums(counts: &[u32]) -> (f64, f64) {
        let (mut totals, mut squares) = (f64x4::ZERO, f64x4::ZERO);
        let mut add = |count: f64x4| {
            totals += count;
            squares += count * count;
        };
        let (fours, rest) = counts.as_chunks::<4>();
        // Numbers with a sign are converted by one instruction, those without by three.
        let signed = |four: &[u32; 4]| f64x4::from_i32x4(i32x4::from(four.map(u32::cast_signed)));
        match fours {
            // Those of the usual cells without a loop.
            [a, b, c] => [a, b, c].into_iter().for_each(|four| add(signed(four))),
            fours => fours.iter().for_each(|four| add(signed(four))),
        }
        rest.iter().for_each(|&count| add(f64x4::from([f64::from(count), 0.0, 0.0, 0.0])));
        (totals.reduce_add(), squares.reduce_add())
    }

    /// Statistic of counts that should be equal \[(12)\]; 0 without any.
    pub fn statistic(counts: &[u32]) -> f64 {
        let (total, squares) = Self::sums(counts);
        if total == 0.0 {
            return 0.0;
        }
        squares * counts.len() as f64 / total - total
    }

    /// Whether counts in the innermost annuli pass the test, by [`ChiSquared::sums`]: the statistic, times the total,
    /// against the quantile, without a division.
    #[inline]
    fn looks_uniform(&self, annuli: usize, (total, squares): (f64, f64)) -> bool {
        squares * (annuli * self.sectors) as f64 <= total * (total + self.critical[annuli - 1])
    }

    /// Halves counts before they are no longer numbers with a sign: photons that look uniform after a thousand million
    /// of them do so by half as many. What an iteration adds is far less than what is left.
    #[cold]
    #[inline(never)]
    fn halve(counts: &mut [u32]) {
        counts.iter_mut().for_each(|count| *count /= 2);
    }

    /// After an iteration: tests if there are photons enough, and shrinks the bandwidth where they do not look uniform.
    /// Returns whether it shrank.
    #[inline(always)]
    fn test(&self, bandwidth: &mut Bandwidth, counts: &mut [u32]) -> bool {
        let all = Self::sums(counts);
        let rejected = all.0 >= f64::from(bandwidth.bound) && !self.looks_uniform(self.annuli, all);
        if rejected {
            self.shrink(bandwidth, counts);
        } else if all.0 >= MOST_COUNTED {
            Self::halve(counts);
        }
        rejected
    }

    /// Shrinks the bandwidth to the largest inner disc that looks uniform, or by k where none does \[6.1, (13), (14)\];
    /// then all counts are dropped.
    #[cold]
    #[inline(never)]
    fn shrink(&self, bandwidth: &mut Bandwidth, counts: &mut [u32]) {
        let passes = |annuli: usize| {
            let inner = Self::sums(&counts[..annuli * self.sectors]);
            // A disc without photons says nothing.
            inner.0 > 0.0 && self.looks_uniform(annuli, inner)
        };
        let factor = match (1..self.annuli).rev().find(|&annuli| passes(annuli)) {
            Some(annuli) => annuli as f32 / self.annuli as f32,
            None => self.k,
        };
        // A radius that is no longer a number above zero is none.
        bandwidth.radius2 = (bandwidth.radius2 * factor).max(f32::MIN_POSITIVE);
        bandwidth.bound *= self.beta;
        counts.fill(0);
    }
}

/// Along an axis.
#[inline(always)]
fn along(axis: Vec3, [x, y, z]: &[f32x8; 3]) -> f32x8 {
    x.mul_add(f32x8::splat(axis.x), y.mul_add(f32x8::splat(axis.y), *z * axis.z))
}

impl CountingRule for ChiSquared {
    type Bandwidth = Bandwidth;
    type Count = u32;
    type Tally = Tally;

    /// One per cell.
    fn counts(&self) -> usize {
        self.annuli * self.sectors
    }

    fn begin(&self, radius2: f32, photons: f32, _: i32) -> Bandwidth {
        Bandwidth { radius2, bound: photons.max(LEAST_BOUND) }
    }

    #[inline]
    fn radius2(bandwidth: &Bandwidth) -> f32 {
        bandwidth.radius2
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
        if self.usual {
            return Self::count_usual(bandwidths, counts, tally, frame, photons);
        }
        // A copy, so that photons need not be in memory for the others.
        self.count_any(bandwidths, counts, tally, frame, &photons.clone());
    }

    /// Tests that have been passed need not be taken again before more photons are there.
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

    /// A uniform point of the unit disc.
    fn uniform(trial: u64, i: u64) -> (f32, f32) {
        let u = Stream::new(7, trial, Domain::Test, i).vertex(0).two(Purpose::Pixel);
        let (sin, cos) = (std::f32::consts::TAU * u.y).sin_cos();
        (u.x.sqrt() * cos, u.x.sqrt() * sin)
    }

    fn count(rule: &ChiSquared, counts: &mut [u32], (x, y): (f32, f32)) {
        let frame = Frame::from_normal(Vec3::Z);
        let offset = frame.t * x + frame.b * y;
        let bandwidth = Bandwidth { radius2: 1.0, bound: 10.0 };
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

    /// Counts that would lose their sign are halved, together; those that are not uniform are rejected first.
    #[test]
    fn counts_stay_numbers() {
        let rule = rule();
        let mut bandwidth = Bandwidth { radius2: 1.0, bound: 10.0 };
        let each = (1u32 << 30) / 12 + 1;
        let mut counts = [each; 12];
        assert!(!rule.test(&mut bandwidth, &mut counts));
        assert_eq!((counts, bandwidth.radius2), ([each / 2; 12], 1.0));
        // Many iterations later: never beyond.
        for _ in 0..10_000 {
            counts.iter_mut().for_each(|count| *count += 1_000_000);
            assert!(!rule.test(&mut bandwidth, &mut counts));
            assert!(counts.iter().all(|count| *count < 1 << 30));
        }
        counts[3] += 1_000_000;
        assert!(rule.test(&mut bandwidth, &mut counts) && bandwidth.radius2 < 1.0);
        assert_eq!(counts, [0; 12]);
    }

    #[test]
    fn cells_are_what_the_angle_says() {
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

    /// Levels that are counted together have what each has alone, and those with photons are told.
    #[test]
    fn levels_do_not_disturb_each_other() {
        let rule = rule();
        let frame = Frame::from_normal(Vec3::Z);
        let levels: [Bandwidth; MAX_LEVELS] =
            std::array::from_fn(|level| rule.begin([0.3, 1.0, 0.05, 0.3, 0.7][level], 10.0, 0));
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
            // As often as a path may find photons at its vertices, and more often than a tally holds.
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
                assert_eq!(counted, times > 0 && distance2.iter().any(|d2| *d2 < levels[level].radius2));
            }
            assert_eq!((together, apart), (any, any));
        }
        assert!(together.chunks(12).all(|counts| counts.iter().all(|&count| count > 0)));
    }

    #[test]
    fn both_forms_of_the_statistic_are_one() {
        let counts = [3u32, 0, 7, 2, 9, 1];
        let (total, p) = (22.0, 1.0 / 6.0);
        let direct: f64 = counts.iter().map(|&o| (f64::from(o) - total * p).powi(2) / (total * p)).sum();
        assert!((ChiSquared::statistic(&counts) - direct).abs() < 1e-12);
        // The rule asks without a division.
        let rule = rule();
        let critical = rule.critical[1];
        for trial in 0..2000 {
            let mut counts = [0; 12];
            for i in 0..10 + trial % 50 {
                let (x, y) = uniform(trial, i);
                count(&rule, &mut counts, (x.abs(), y));
            }
            let statistic = ChiSquared::statistic(&counts);
            assert_eq!(
                rule.looks_uniform(2, ChiSquared::sums(&counts)),
                statistic <= critical,
                "{statistic} {critical}"
            );
        }
    }

    /// Of 120 and 1000 uniform photons the test rejects 5 %, within five standard errors of 10^5 trials and the error
    /// of the chi-squared approximation, which 120 photons in 12 cells keep below half a percent. Photons of a slope
    /// are told.
    #[test]
    fn the_size_of_the_test_is_its_significance() {
        let rule = rule();
        for photons in [120, 1000] {
            let trials = if photons == 120 { 100_000 } else { 20_000 };
            let (mut rejected, mut told) = (0, 0);
            for trial in 0..trials {
                let (mut counts, mut sloped) = ([0; 12], [0; 12]);
                for i in 0..photons {
                    let (x, y) = uniform(trial, i);
                    count(&rule, &mut counts, (x, y));
                    // Density 1 + 0.8 x by rejection: what is rejected is mirrored.
                    let keep = Stream::new(8, trial, Domain::Test, i).vertex(0).one(Purpose::Lobe) < 0.5 + 0.4 * x;
                    count(&rule, &mut sloped, (if keep { x } else { -x }, y));
                }
                rejected += i32::from(ChiSquared::statistic(&counts) > rule.critical[1]);
                told += i32::from(ChiSquared::statistic(&sloped) > rule.critical[1]);
            }
            let size = f64::from(rejected) / trials as f64;
            let allowed = 5.0 * (0.05 * 0.95 / trials as f64).sqrt() + 0.005;
            println!("{photons} photons: size {size}, power {}", f64::from(told) / trials as f64);
            assert!((size - 0.05).abs() < allowed, "{photons} photons: {size}");
            assert!(f64::from(told) > 4.0 * 0.05 * trials as f64, "{photons} photons: a slope goes unnoticed");
        }
    }

    #[test]
    fn bandwidths_stay_positive_never_grow_and_start_anew() {
        let rule = rule();
        let mut bandwidth = Bandwidth { radius2: 1.0, bound: 10.0 };
        let mut counts = [0u32; 12];
        let mut reductions = 0;
        for step in 0..2000u64 {
            let before = bandwidth;
            let u = Stream::new(9, step, Domain::Test, 0).vertex(0).one(Purpose::Lobe);
            // Now all in one cell, now everywhere.
            let counted = counts;
            for (cell, c) in counts.iter_mut().enumerate() {
                *c += if u < 0.5 && cell != (step / 40 % 12) as usize { 0 } else { 5 };
            }
            assert!(counts.iter().zip(&counted).all(|(now, then)| now >= then));
            let reduced = rule.test(&mut bandwidth, &mut counts);
            assert!(bandwidth.radius2 > 0.0 && bandwidth.radius2 <= before.radius2);
            assert_eq!(reduced, bandwidth.bound > before.bound);
            assert!(!reduced || counts.iter().all(|&c| c == 0));
            reductions += usize::from(reduced);
        }
        assert!(reductions > 10);
    }

    /// The largest inner disc that looks uniform is taken, k where none does.
    #[test]
    fn reductions_are_the_papers() {
        let rule = rule();
        let shrink = |counts: [u32; 12]| {
            let (mut bandwidth, mut counts) = (Bandwidth { radius2: 1.0, bound: 10.0 }, counts);
            assert!(rule.test(&mut bandwidth, &mut counts));
            (bandwidth.radius2, bandwidth.bound)
        };
        // Uniform within, empty without.
        assert_eq!(shrink([9, 10, 11, 10, 9, 11, 0, 0, 0, 0, 0, 0]), (0.5, 12.0));
        // An edge through the middle.
        assert_eq!(shrink([20, 20, 20, 0, 0, 0, 20, 20, 20, 0, 0, 0]), (0.8, 12.0));
        // All of it in the outer annulus: the inner disc says nothing.
        assert_eq!(shrink([0, 0, 0, 0, 0, 0, 9, 10, 11, 10, 9, 11]), (0.8, 12.0));
        // Too few for a test.
        let (mut bandwidth, mut counts) =
            (Bandwidth { radius2: 1.0, bound: 10.0 }, [9u32, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        assert!(!rule.test(&mut bandwidth, &mut counts));
    }
}
