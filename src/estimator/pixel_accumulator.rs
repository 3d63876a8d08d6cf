//! The state of a pixel: plain numbers that can be saved and joined.

use super::{Coverage, Rejected};
use crate::math::{DVec3, Rgb, Vec3};
use crate::photon::ByKind;
use crate::random;
use crate::stat::sum::Term;
use crate::stat::{Grids, Moments, Sum, Total, variance_of_mean};
use crate::transport::{Cause, MAX_LEVELS, PixelSample};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// Camera depth where nothing is hit.
pub const FAR: f32 = 1e10;

/// What is added to the differences of levels for light gathered in media, relative: bias grows with the radius
/// squared, which from one level to the next grows by 2^(2/3) there and by 2 on surfaces. With this, a difference is
/// the bias of the smaller level for both: `1 / (2^(2/3) - 1) - 1`.
const VOLUME_DIFFERENCE: f32 = 0.702_414_4;

/// Sums over iterations of the additive parts of the level that is the method's own image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parts {
    /// Emitters seen directly or through perfect mirrors and clear glass.
    pub emission: DVec3,
    /// Direct light.
    pub direct: DVec3,
    /// Caustics.
    pub caustic: DVec3,
    /// Everything else from surfaces.
    pub indirect: DVec3,
    /// Light scattered by media on its way to the eye.
    pub volume: DVec3,
}

/// Independent groups of iterations ([`random::QUARTERS`]).
pub const QUARTERS: usize = random::QUARTERS as usize;
/// Additive parts.
const PARTS: usize = 5;

/// Estimates of one quarter of the iterations, of the level that is the method's own image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Quarter {
    sum: Sum<DVec3>,
    count: u32,
}

/// Statistics of one pixel over the iterations so far. All of it are sums and counts that do not depend on the order of
/// iterations: those of disjoint iterations join to the ones of all ([`PixelAccumulator::join`]).
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct PixelAccumulator {
    /// Grids of all sums of light.
    grids: Grids,
    /// Squares of the own image's estimates; their sum is that of the quarters.
    own_squares: Sum<DVec3>,
    /// The own image by independent groups of iterations, whose points share no scramble: what variance and error are
    /// measured by.
    quarters: [Quarter; QUARTERS],
    /// The other levels' estimates, the smallest bandwidth first, and the next larger level minus the own one:
    /// neighbours are correlated, so their difference's variance cannot be had from theirs. Where photons are gathered
    /// in media, the difference is scaled there to tell the bias ([`super::SquaredError`]). Nothing where there is one
    /// level.
    others: Box<[Moments]>,
    /// Emission, direct, caustic, indirect light, light from media.
    parts: [Sum<DVec3>; PARTS],
    /// Light of each group of lights, and its caustics.
    groups: Box<[[Sum<DVec3>; 2]]>,
    /// Sums of G-buffers over all camera paths.
    albedo: DVec3,
    normal: DVec3,
    /// Sum over those paths that have such a hit.
    depth: Total,
    /// Camera paths whose measure was finite.
    features: u32,
    /// Those of them with a hit that is not a perfect mirror or clear glass.
    depths: u32,
    /// First hits of all camera paths.
    pub coverage: Coverage,
    /// Iterations counted.
    pub iterations: u32,
    /// Iterations rejected as not finite.
    pub rejected: Rejected,
    /// Largest initial bandwidth by kind of photons (scene units).
    pub bandwidths: ByKind<f32>,
    /// The same for photons in media; 0 where there are none.
    pub volume_bandwidth: f32,
    /// First visible hit of the first iteration counted.
    first: FirstSeen,
}

/// What an iteration sees first through a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct FirstSeen {
    /// The iteration, from 1.
    pass: u64,
    /// Camera depth; [`FAR`] where there is none.
    z: f32,
    /// Position.
    p: Vec3,
}

impl Default for FirstSeen {
    fn default() -> FirstSeen {
        FirstSeen { pass: u64::MAX, z: FAR, p: Vec3::ZERO }
    }
}

impl PixelAccumulator {
    /// A pixel of an image of so many levels before its first iteration. Sums of light scale exactly with it by powers
    /// of two if `exponent`, that of the scene's light, does ([`Grids::new`]).
    pub fn new(levels: usize, exponent: i32, bandwidths: ByKind<f32>) -> PixelAccumulator {
        let others = vec![Moments::default(); PixelAccumulator::others(levels)].into_boxed_slice();
        PixelAccumulator { grids: Grids::new(exponent), others, bandwidths, ..PixelAccumulator::default() }
    }

    /// With so many groups of lights.
    #[must_use]
    pub fn with_groups(self, groups: usize) -> PixelAccumulator {
        PixelAccumulator { groups: vec![[Sum::default(); 2]; groups].into_boxed_slice(), ..self }
    }

    /// Bytes of a pixel with so many levels and groups.
    pub fn bytes(levels: usize, groups: usize) -> usize {
        size_of::<PixelAccumulator>()
            + PixelAccumulator::others(levels) * size_of::<Moments>()
            + groups * size_of::<[Sum<DVec3>; 2]>()
    }

    /// Bytes of this one.
    pub fn size(&self) -> usize {
        PixelAccumulator::bytes(self.levels(), self.groups.len())
    }

    /// Whether there are sums of so many levels and groups of lights.
    pub fn holds(&self, levels: usize, groups: usize) -> bool {
        self.others.len() == PixelAccumulator::others(levels) && self.groups.len() == groups
    }

    /// Sums of other levels beside the own image's: theirs, and a difference.
    fn others(levels: usize) -> usize {
        if levels > 1 { levels } else { 0 }
    }

    /// Number of levels.
    #[inline]
    pub fn levels(&self) -> usize {
        self.others.len().max(1)
    }

    /// The level (from 0) that is the method's own image, the second largest.
    #[inline]
    fn own(&self) -> usize {
        self.levels().saturating_sub(2)
    }

    /// Mean of a level (from 0, the smallest bandwidth); zero before the first iteration.
    pub fn mean(&self, level: usize) -> DVec3 {
        let count = f64::from(self.iterations);
        match level.cmp(&self.own()) {
            Ordering::Less => self.others[level].mean(count),
            Ordering::Equal if self.iterations == 0 => DVec3::ZERO,
            Ordering::Equal => self.sum() / count,
            Ordering::Greater => self.others[level - 1].mean(count),
        }
    }

    /// Variance of the mean of a level; infinite before two iterations.
    pub fn variance_of_mean(&self, level: usize) -> DVec3 {
        let count = f64::from(self.iterations);
        match level.cmp(&self.own()) {
            Ordering::Less => self.others[level].variance_of_mean(count),
            Ordering::Equal => variance_of_mean(self.sum(), self.own_squares.value(), count),
            Ordering::Greater => self.others[level - 1].variance_of_mean(count),
        }
    }

    /// Mean of the next larger level minus the own one, and the variance of that mean; `None` without levels.
    pub fn difference(&self) -> Option<[DVec3; 2]> {
        let count = f64::from(self.iterations);
        self.others.last().map(|difference| [difference.mean(count), difference.variance_of_mean(count)])
    }

    /// Sum of the own image.
    fn sum(&self) -> DVec3 {
        let mut sum = self.quarters[0].sum;
        self.quarters[1..].iter().for_each(|quarter| sum.join(&quarter.sum));
        sum.value()
    }

    /// Mean of a quarter's iterations of the own image; zero without any.
    pub fn quarter(&self, quarter: usize) -> DVec3 {
        let Quarter { sum, count } = self.quarters[quarter];
        if count == 0 { DVec3::ZERO } else { sum.value() / f64::from(count) }
    }

    /// Sums of the additive parts of the own image.
    pub fn parts(&self) -> Parts {
        let [emission, direct, caustic, indirect, volume] = self.parts.map(|part| part.value());
        Parts { emission, direct, caustic, indirect, volume }
    }

    /// Mean light of a group of lights, and of its caustics.
    pub fn group(&self, group: usize) -> [DVec3; 2] {
        let count = f64::from(self.iterations.max(1));
        self.groups[group].map(|sum| sum.value() / count)
    }

    /// Mean albedo of all camera paths.
    pub fn albedo(&self) -> DVec3 {
        if self.features == 0 { DVec3::ZERO } else { self.albedo / f64::from(self.features) }
    }

    /// Camera paths whose albedo, normal or depth was not finite.
    pub fn features_rejected(&self) -> u32 {
        self.coverage.paths() - self.features
    }

    /// Direction of the mean normal; zero where there is none.
    pub fn normal(&self) -> DVec3 {
        self.normal.normalize_or_zero()
    }

    /// Mean distance along camera paths to their first rough hit, of those that have one.
    pub fn depth(&self) -> Option<f64> {
        (self.depths > 0).then(|| self.depth.value() / f64::from(self.depths))
    }

    /// Camera depth of the first visible hit of the first iteration ([`FAR`] where there is none), and its position.
    pub fn first(&self) -> (f32, Vec3) {
        (self.first.z, self.first.p)
    }

    /// Variance of the mean of the own image as the quarters tell it, which is right also where iterations are not
    /// independent within a quarter: the scatter of group means about their weighted mean, over the degrees of freedom.
    /// `None` where a quarter is empty.
    #[inline]
    pub fn variance_by_quarters(&self) -> Option<DVec3> {
        if self.quarters.iter().any(|quarter| quarter.count == 0) {
            return None;
        }
        let total: f64 = self.quarters.iter().map(|quarter| f64::from(quarter.count)).sum();
        let mean = self.sum() / total;
        let scatter = (0..QUARTERS).map(|quarter| {
            let apart = self.quarter(quarter) - mean;
            apart * apart * f64::from(self.quarters[quarter].count)
        });
        Some(scatter.sum::<DVec3>() / ((QUARTERS - 1) as f64 * total))
    }

    /// Keeps what iteration `pass` (from 1) sees first, its camera depth and position, if none has been counted before.
    /// To be called before [`PixelAccumulator::add`].
    #[inline]
    pub fn record_first_hit(&mut self, pass: u64, first: impl FnOnce() -> Option<(f32, Vec3)>) {
        if self.iterations == 0 {
            let (z, p) = first().unwrap_or((FAR, Vec3::ZERO));
            self.first = FirstSeen { pass, z, p };
        }
    }

    /// Adds iteration `pass` (from 1): level 1 from `independent`, the others from `correlated` (of one level less), or
    /// all from `independent` when they share one camera path.
    #[inline]
    pub fn add(&mut self, pass: u64, independent: &PixelSample, correlated: Option<&PixelSample>) {
        self.add_with_groups(pass, independent, correlated, &[]);
    }

    /// The same with the light of each group of lights, and its caustics, in the own image.
    pub fn add_with_groups(
        &mut self,
        pass: u64,
        independent: &PixelSample,
        correlated: Option<&PixelSample>,
        groups: &[[Rgb; 2]],
    ) {
        let (count, own) = (self.levels(), self.own());
        let mut values = [Rgb::ZERO; MAX_LEVELS];
        for (level, value) in values[..count].iter_mut().enumerate() {
            *value = match correlated {
                Some(correlated) if level > 0 => correlated.radiance(level - 1),
                _ => independent.radiance(level),
            };
        }
        let (sample, level) = self.own_of(independent, correlated);
        let parts: [Rgb; PARTS] = [
            sample.emission,
            sample.direct,
            sample.caustic_photons[level],
            sample.indirect + sample.indirect_photons[level],
            sample.volume + sample.volume_photons[level],
        ];
        let difference = if count > 1 { self.difference_of(&values, independent, correlated) } else { Rgb::ZERO };
        let all =
            || values[..count].iter().chain(&parts).chain(std::iter::once(&difference)).chain(groups.as_flattened());
        let rejection = independent.rejection.or_else(|| correlated.and_then(|sample| sample.rejection));
        if let Some(cause) = rejection.or_else(|| (!all().all(|value| value.is_finite())).then_some(Cause::Sum)) {
            return self.rejected.count(cause);
        }
        self.iterations += 1;
        let most = all().fold(Rgb::ZERO, |most, value| most.max(value.abs()));
        self.coarsen_grids(self.grids.with_room_for(f64::from(most.max_element())));
        let rounding = self.grids.rounding();
        let quarter = &mut self.quarters[random::quarter(pass) as usize];
        let light = values[own].as_dvec3();
        quarter.sum.add(light, rounding[0]);
        quarter.count += 1;
        self.own_squares.add(light * light, rounding[1]);
        if let Some((last, others)) = self.others.split_last_mut() {
            for (level, other) in others.iter_mut().enumerate() {
                other.add(values[level + usize::from(level >= own)], rounding);
            }
            last.add(difference, rounding);
        }
        for (sum, part) in self.parts.iter_mut().zip(parts) {
            sum.add(part.as_dvec3(), rounding[0]);
        }
        for (sum, light) in self.groups.as_flattened_mut().iter_mut().zip(groups.as_flattened()) {
            sum.add(light.as_dvec3(), rounding[0]);
        }
        for sample in std::iter::once(independent).chain(correlated) {
            self.coverage.add(sample.first.map(|first| first.instance));
            let features = sample.features;
            if features.albedo.is_finite() && features.normal.is_finite() && features.depth.is_finite() {
                self.albedo += on_fixed_grid(features.albedo);
                self.normal += on_fixed_grid(features.normal);
                self.depth.add(f64::from(features.depth));
                self.features += 1;
                self.depths += u32::from(features.depth > 0.0);
            }
        }
    }

    /// The measure that has the own image's level, and where.
    #[inline]
    pub fn own_of<'m>(
        &self,
        independent: &'m PixelSample,
        correlated: Option<&'m PixelSample>,
    ) -> (&'m PixelSample, usize) {
        match (correlated, self.own()) {
            (Some(correlated), own @ 1..) => (correlated, own - 1),
            (_, own) => (independent, own),
        }
    }

    /// The next larger level minus the own one.
    #[inline]
    fn difference_of(
        &self,
        values: &[Rgb; MAX_LEVELS],
        independent: &PixelSample,
        correlated: Option<&PixelSample>,
    ) -> Rgb {
        let own = self.own();
        let mut difference = values[own + 1] - values[own];
        if self.volume_bandwidth > 0.0 {
            let in_media = |level: usize| match correlated {
                Some(correlated) if level > 0 => correlated.volume_photons[level - 1],
                _ => independent.volume_photons[level],
            };
            difference += VOLUME_DIFFERENCE * (in_media(own + 1) - in_media(own));
        }
        difference
    }

    /// Takes all sums of light to grids that are no finer.
    #[inline]
    fn coarsen_grids(&mut self, to: Grids) {
        let from = std::mem::replace(&mut self.grids, to);
        if from == to {
            return;
        }
        from.coarsen_squares(&mut self.own_squares, to);
        let quarters = self.quarters.iter_mut().map(|quarter| &mut quarter.sum);
        quarters
            .chain(&mut self.parts)
            .chain(self.groups.as_flattened_mut())
            .for_each(|sum| from.coarsen_values(sum, to));
        self.others.iter_mut().for_each(|moments| moments.coarsen(from, to));
    }

    /// Adds other iterations of the same pixel: the same bits as if all had been added here, whatever their order.
    pub fn join(&mut self, mut other: PixelAccumulator) {
        let grids = self.grids.max(other.grids);
        self.coarsen_grids(grids);
        other.coarsen_grids(grids);
        self.own_squares.join(&other.own_squares);
        for (own, other) in self.quarters.iter_mut().zip(&other.quarters) {
            own.sum.join(&other.sum);
            own.count += other.count;
        }
        self.others.iter_mut().zip(&other.others).for_each(|(own, other)| own.join(other));
        self.parts.iter_mut().zip(&other.parts).for_each(|(own, other)| own.join(other));
        let groups = self.groups.as_flattened_mut().iter_mut();
        groups.zip(other.groups.as_flattened()).for_each(|(own, other)| own.join(other));
        self.albedo += other.albedo;
        self.normal += other.normal;
        self.depth.join(&other.depth);
        self.features += other.features;
        self.depths += other.depths;
        self.coverage.join(&other.coverage);
        // The first that is counted; where none is, the last one looked at.
        let of = |pixel: &PixelAccumulator| {
            if pixel.iterations > 0 { (0, pixel.first.pass) } else { (1, !pixel.first.pass) }
        };
        if of(&other) < of(self) {
            self.first = other.first;
        }
        self.iterations += other.iterations;
        self.rejected.join(&other.rejected);
    }
}

/// Of sizes up to a few, whose sums are exact: rounded to multiples of 2^-28.
#[inline]
fn on_fixed_grid(value: Vec3) -> DVec3 {
    /// Neighbours in f64 are 2^-28 apart.
    const MAGIC: f64 = 1.5 * (1u64 << 24) as f64;
    value.as_dvec3().rounded(MAGIC)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};
    use crate::transport::{Features, FirstHit};

    /// A bias of r^2 on surfaces and of r^2 in media, whose levels' radii are apart by other factors: differences tell
    /// their sum.
    #[test]
    fn differences_of_levels_are_the_bias_on_surfaces_and_in_media() {
        let biases = |level: i32| (0.01 * 2f32.powi(level), 0.02 * (2.0 / 3.0 * level as f32).exp2());
        let sample = |first: i32| {
            let mut sample = PixelSample { direct: Rgb::ONE, volume: Rgb::ONE, ..PixelSample::default() };
            for level in 0..MAX_LEVELS {
                let (surface, volume) = biases(first + level as i32);
                sample.indirect_photons[level] = Rgb::splat(surface);
                sample.volume_photons[level] = Rgb::splat(volume);
            }
            sample
        };
        for media in [true, false] {
            let mut pixel = PixelAccumulator {
                volume_bandwidth: if media { 0.1 } else { 0.0 },
                ..PixelAccumulator::new(5, 0, [0.1; 2])
            };
            pixel.add(1, &sample(0), Some(&sample(1)));
            let (surface, volume) = biases(3);
            let [difference, _] = pixel.difference().expect("there are levels");
            let ratio = difference.x / f64::from(surface + volume);
            assert_eq!((ratio - 1.0).abs() < 1e-4, media, "{ratio}");
        }
    }

    /// An iteration of a pixel that sees all kinds of light of sizes far apart, and now and then a sample that is not
    /// finite.
    fn iteration(pass: u64) -> [PixelSample; 2] {
        [0, 1].map(|path| {
            let draw = |index| {
                let draws = Stream::new(1, pass, Domain::Test, 100 * path + index).vertex(0);
                let [a, b] = [draws.two(Purpose::Pixel), draws.two(Purpose::Lens)];
                Rgb::new(a.x, a.y, b.x) * 10f32.powf(16.0 * b.y - 8.0)
            };
            let photons = |first: u64| std::array::from_fn(|level| draw(first + level as u64));
            let rejection = pass % 11 == 1;
            PixelSample {
                emission: if rejection { Rgb::splat(f32::NAN) } else { draw(0) },
                direct: draw(1),
                indirect: draw(2),
                caustic_photons: photons(10),
                indirect_photons: photons(20),
                volume: draw(3),
                volume_photons: photons(30),
                features: Features {
                    albedo: draw(4).normalize() * 0.9,
                    normal: (draw(5) - draw(6)).normalize(),
                    depth: draw(7).x,
                },
                first: (!pass.is_multiple_of(3)).then(|| FirstHit { p: draw(8), instance: (pass % 10) as u32 }),
                rejection: (pass % 13 == 1).then_some(Cause::Splat),
            }
        })
    }

    fn pixel(levels: usize, passes: impl Iterator<Item = u64>) -> PixelAccumulator {
        let mut pixel = PixelAccumulator { volume_bandwidth: 0.1, ..PixelAccumulator::new(levels, 7, [0.1; 2]) };
        for pass in passes {
            let [independent, correlated] = iteration(pass);
            pixel.record_first_hit(pass, || independent.first.map(|first| (first.p.x, first.p)));
            pixel.add(pass, &independent, (levels > 1).then_some(&correlated));
        }
        pixel
    }

    /// All that is told of a pixel, to the last bit.
    fn told(pixel: &PixelAccumulator, levels: usize) -> Vec<u64> {
        let mut all = vec![pixel.albedo(), pixel.normal(), DVec3::splat(pixel.depth().unwrap_or(-1.0))];
        for level in 0..levels {
            all.extend([pixel.mean(level), pixel.variance_of_mean(level)]);
        }
        all.extend(pixel.difference().unwrap_or_default());
        all.extend((0..QUARTERS).map(|quarter| pixel.quarter(quarter)));
        all.extend(pixel.variance_by_quarters());
        let Parts { emission, direct, caustic, indirect, volume } = pixel.parts();
        all.extend([emission, direct, caustic, indirect, volume]);
        let (z, p) = pixel.first();
        all.extend([p.as_dvec3(), DVec3::splat(z.into())]);
        let mut bits: Vec<u64> = all.iter().flat_map(|value| value.to_array()).map(f64::to_bits).collect();
        bits.extend(pixel.rejected.by_cause().map(u64::from));
        bits.extend([pixel.iterations, pixel.coverage.hit_fraction().to_bits()].map(u64::from));
        bits.extend(pixel.coverage.fractions().flat_map(|(id, share)| [id, share.to_bits()].map(u64::from)));
        bits
    }

    #[test]
    fn parts_of_the_iterations_join_in_any_order_to_the_bits_of_all() {
        for levels in [1, 2, 5] {
            let whole = told(&pixel(levels, 1..=100), levels);
            for shards in [2, 3, 7, 100] {
                let part = |index: usize| pixel(levels, (1..=100).skip(index).step_by(shards));
                let mut forward = part(0);
                (1..shards).for_each(|index| forward.join(part(index)));
                let mut backward = part(shards - 1);
                (0..shards - 1).rev().for_each(|index| backward.join(part(index)));
                assert!(told(&forward, levels) == whole && told(&backward, levels) == whole, "{shards} of {levels}");
            }
            // An iteration that is missing, or there twice, is seen.
            assert_ne!(told(&pixel(levels, 1..=99), levels), whole);
            let mut twice = pixel(levels, 1..=100);
            twice.join(pixel(levels, 5..=5));
            assert_ne!(told(&twice, levels), whole);
        }
    }

    /// Plain sums in f64 of the same values, where no large one takes the digits of the others.
    #[test]
    fn means_and_variances_are_those_of_two_passes() {
        let mut values = Vec::new();
        let mut pixel = PixelAccumulator::new(1, 0, [0.0; 2]);
        for pass in 1..=200u64 {
            let draw = Stream::new(2, pass, Domain::Test, 0).vertex(0).two(Purpose::Pixel);
            let direct = Rgb::new(draw.x, draw.y, 0.01 * draw.x);
            pixel.add(pass, &PixelSample { direct, ..PixelSample::default() }, None);
            values.push(direct.as_dvec3());
        }
        let mean = values.iter().sum::<DVec3>() / 200.0;
        let variance = values.iter().map(|&v| (v - mean) * (v - mean)).sum::<DVec3>() / (200.0 * 199.0);
        let apart = |a: DVec3, b: DVec3| (a / b - 1.0).abs();
        let direct = pixel.parts().direct / 200.0;
        assert!(apart(pixel.mean(0), mean).max_element() < 1e-7 && apart(direct, mean).max_element() < 1e-7);
        // Squares are cut off at 2^-31 of the largest: of the dark channel's, a part in 10^4 at most.
        let apart = apart(pixel.variance_of_mean(0), variance);
        assert!(apart.max_element() < 1e-4 && apart.x.max(apart.y) < 1e-7, "{apart}");
        assert_eq!(pixel.parts().caustic, DVec3::ZERO);
    }
}
