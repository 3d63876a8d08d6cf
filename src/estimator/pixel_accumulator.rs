//! The accumulator of a pixel: sums and counts that can be saved and joined.

use super::{Coverage, Rejected};
use crate::math::{DVec3, Rgb, Vec3};
use crate::photon::ByKind;
use crate::random;
use crate::stat::sum::Term;
use crate::stat::{Grids, Moments, Sum, Total, variance_of_mean};
use crate::transport::{Cause, INNER_AREAS, LobeLayer, LobeLight, MAX_LEVELS, PixelSample};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// Depth along the camera axis (scene units) that is stored for a camera path that hits nothing.
pub const FAR: f32 = 1e10;

/// Correction of the difference between two bandwidth levels, as a fraction of it, for light gathered in media. Bias
/// grows with the squared bandwidth, which grows by 2^(2/3) from level to level in media, and by 2 on surfaces. With the
/// correction `1 / (2^(2/3) - 1) - 1` a difference is the bias of the smaller level for both.
const VOLUME_DIFFERENCE: f32 = 0.702_414_4;

/// Sums over iterations of the additive parts of a pixel, at the bandwidth level that the picture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parts {
    /// Lights seen directly or through perfect mirrors and clear glass.
    pub emission: DVec3,
    /// Direct light (one bounce at a surface).
    pub direct: DVec3,
    /// Light that mirrors and glass focus on a surface (caustics).
    pub caustic: DVec3,
    /// All other light from surfaces.
    pub indirect: DVec3,
    /// Light that media scatter towards the camera.
    pub volume: DVec3,
}

/// Number of independent groups, called quarters, into which iterations are divided in turn ([`random::QUARTERS`]).
pub const QUARTERS: usize = random::QUARTERS as usize;
/// Number of additive parts of a pixel: emission, direct, caustic, indirect and volume.
const PARTS: usize = 5;

/// Sum of a pixel over one quarter of the iterations, at the bandwidth level that the picture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Quarter {
    sum: Sum<DVec3>,
    count: u32,
}

/// Sums over iterations of a pixel's light by the lobe of the first hit, and of the albedos there.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct LobeSums {
    light: [Sum<DVec3>; LobeLayer::ALL.len()],
    colors: [DVec3; 3],
}

/// Statistics of one pixel over the iterations so far: sums and counts that do not depend on the order of iterations.
/// Accumulators of disjoint iterations join to that of all ([`PixelAccumulator::join`]).
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct PixelAccumulator {
    /// Rounding grids of all sums of light, which make the sums independent of the order of iterations.
    grids: Grids,
    /// Sum over iterations of the squared value of the picture level, the bandwidth level that the picture shows. The
    /// plain sum of this level is that of `quarters`.
    own_squares: Sum<DVec3>,
    /// Sums of the picture level over each quarter of the iterations. Random points of the quarters are scrambled
    /// independently, so variance and error are estimated from them.
    quarters: [Quarter; QUARTERS],
    /// Moments of the bandwidth levels except the picture level, smallest bandwidth first, and, as the last entry, of
    /// the difference between the next larger level and the picture level. Levels are correlated, so the variance of
    /// the difference does not follow from theirs. In media the difference is scaled to equal the bias
    /// ([`super::SquaredError`]). With one level that merges, only the difference to the inner photons
    /// ([`PixelSample::merge_difference`]); with one level otherwise, empty.
    others: Box<[Moments]>,
    /// Sums over iterations of emission, direct, caustic and indirect light, and light from media.
    parts: [Sum<DVec3>; PARTS],
    /// For each light group (lights that the user has put on a layer of their own), the sums of its light and of its
    /// caustics.
    groups: Box<[[Sum<DVec3>; 2]]>,
    /// Sums by the lobe of the first hit; `None` unless layers need them.
    lobes: Option<Box<LobeSums>>,
    /// Sum over camera paths of the albedo in the G-buffer.
    albedo: DVec3,
    normal: DVec3,
    /// Sum over camera paths of the length up to the hit of the G-buffer (scene units).
    depth: Total,
    /// Number of camera paths whose albedo, normal and depth are all finite.
    features: u32,
    /// Number of camera paths with a G-buffer.
    depths: u32,
    /// Counts of camera paths by the instance that they hit first.
    pub coverage: Coverage,
    /// Number of iterations accumulated, without rejected ones.
    pub iterations: u32,
    /// Counts of the iterations that were left out because a value was not finite, by cause.
    pub rejected: Rejected,
    /// Initial bandwidth of the largest bandwidth level, by kind of photons (scene units).
    pub bandwidths: ByKind<f32>,
    /// Initial bandwidth of the largest bandwidth level for photons in media (scene units); 0 without media.
    pub volume_bandwidth: f32,
    /// First hit of the camera path of the first accumulated iteration.
    first: FirstVisible,
}

/// First hit of the camera path of one iteration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct FirstVisible {
    /// Number of the iteration, from 1; `u64::MAX` before a hit is recorded.
    iteration: u64,
    /// Depth along the camera axis (scene units); [`FAR`] if the path hits nothing.
    z: f32,
    /// Position of the hit; zero if the path hits nothing.
    p: Vec3,
}

impl Default for FirstVisible {
    fn default() -> FirstVisible {
        FirstVisible { iteration: u64::MAX, z: FAR, p: Vec3::ZERO }
    }
}

impl PixelAccumulator {
    /// The empty accumulator of a pixel with `levels` bandwidth levels and these initial bandwidths (scene units). Sums of
    /// light are exact on grids in units of 2^`exponent`: if all light of the scene is scaled by a power of two, and
    /// `exponent` with it, the sums scale exactly ([`Grids::new`]).
    pub fn new(levels: usize, exponent: i32, bandwidths: ByKind<f32>) -> PixelAccumulator {
        let others = vec![Moments::default(); PixelAccumulator::others(levels, false)].into_boxed_slice();
        PixelAccumulator { grids: Grids::new(exponent), others, bandwidths, ..PixelAccumulator::default() }
    }

    /// Adds empty moments of the difference that shows the bias of merging with one bandwidth, if `merges` is true.
    #[must_use]
    pub fn with_merges(self, merges: bool) -> PixelAccumulator {
        let others = vec![Moments::default(); PixelAccumulator::others(self.levels(), merges)].into_boxed_slice();
        PixelAccumulator { others, ..self }
    }

    /// Replaces the sums of light groups by empty sums for `groups` light groups.
    #[must_use]
    pub fn with_groups(self, groups: usize) -> PixelAccumulator {
        PixelAccumulator { groups: vec![[Sum::default(); 2]; groups].into_boxed_slice(), ..self }
    }

    /// Adds empty sums by the lobe of the first hit if `lobes` is true.
    #[must_use]
    pub fn with_lobes(self, lobes: bool) -> PixelAccumulator {
        PixelAccumulator { lobes: lobes.then(Box::default), ..self }
    }

    /// Whether the accumulator has sums by the lobe of the first hit.
    pub fn has_lobes(&self) -> bool {
        self.lobes.is_some()
    }

    /// Memory in bytes of an accumulator with `levels` bandwidth levels (the only one merges if `merges` is true) and
    /// `groups` light groups, and with sums by the lobe of the first hit if `lobes` is true.
    pub fn bytes(levels: usize, merges: bool, groups: usize, lobes: bool) -> usize {
        size_of::<PixelAccumulator>()
            + PixelAccumulator::others(levels, merges) * size_of::<Moments>()
            + groups * size_of::<[Sum<DVec3>; 2]>()
            + if lobes { size_of::<LobeSums>() } else { 0 }
    }

    /// Memory of this accumulator in bytes.
    pub fn size(&self) -> usize {
        PixelAccumulator::bytes(self.levels(), self.others.len() == 1, self.groups.len(), self.lobes.is_some())
    }

    /// Whether the accumulator has sums for exactly `levels` bandwidth levels (the only one merges if `merges` is true)
    /// and `groups` light groups, and sums by the lobe of the first hit exactly if `lobes` is true.
    pub fn holds(&self, levels: usize, merges: bool, groups: usize, lobes: bool) -> bool {
        self.others.len() == PixelAccumulator::others(levels, merges)
            && self.groups.len() == groups
            && self.lobes.is_some() == lobes
    }

    /// Length of the field `others` for a number of bandwidth levels: all levels but one, plus one difference; for one
    /// level 1 if it merges, and 0 otherwise.
    fn others(levels: usize, merges: bool) -> usize {
        if levels > 1 { levels } else { usize::from(merges) }
    }

    /// Number of bandwidth levels of the pixel, at least 1.
    #[inline]
    pub fn levels(&self) -> usize {
        self.others.len().max(1)
    }

    /// Index of the bandwidth level that the picture shows: the second largest, or 0 if there is only one level.
    #[inline]
    fn picture_level(&self) -> usize {
        self.levels().saturating_sub(2)
    }

    /// Mean radiance over iterations of a bandwidth level (from 0, the smallest); zero before the first iteration.
    pub fn mean(&self, level: usize) -> DVec3 {
        let count = f64::from(self.iterations);
        match level.cmp(&self.picture_level()) {
            Ordering::Less => self.others[level].mean(count),
            Ordering::Equal if self.iterations == 0 => DVec3::ZERO,
            Ordering::Equal => self.sum() / count,
            Ordering::Greater => self.others[level - 1].mean(count),
        }
    }

    /// Variance of the mean radiance of a bandwidth level (from 0, the smallest), per channel; infinite before two
    /// iterations.
    pub fn variance_of_mean(&self, level: usize) -> DVec3 {
        let count = f64::from(self.iterations);
        match level.cmp(&self.picture_level()) {
            Ordering::Less => self.others[level].variance_of_mean(count),
            Ordering::Equal => variance_of_mean(self.sum(), self.own_squares.value(), count),
            Ordering::Greater => self.others[level - 1].variance_of_mean(count),
        }
    }

    /// Mean over iterations of the radiance of the next larger bandwidth level minus that of the picture level, and the
    /// variance of this mean. With one level that merges, the radiance minus that of merging within a quarter of the
    /// bandwidth; with one level otherwise, `None`.
    pub fn difference(&self) -> Option<[DVec3; 2]> {
        let count = f64::from(self.iterations);
        let scale = if self.others.len() == 1 { f64::from(INNER_AREAS) } else { 1.0 };
        let of = |moments: &Moments| [moments.mean(count) * scale, moments.variance_of_mean(count) * (scale * scale)];
        self.others.last().map(of)
    }

    /// Sum over all iterations of the radiance of the picture level, the bandwidth level that the picture shows.
    fn sum(&self) -> DVec3 {
        let mut sum = self.quarters[0].sum;
        self.quarters[1..].iter().for_each(|quarter| sum.join(&quarter.sum));
        sum.value()
    }

    /// Mean radiance of the picture level over one quarter (0 to 3) of the iterations; zero if the quarter is empty.
    pub fn quarter(&self, quarter: usize) -> DVec3 {
        let Quarter { sum, count } = self.quarters[quarter];
        if count == 0 { DVec3::ZERO } else { sum.value() / f64::from(count) }
    }

    /// Sums over iterations of emission, direct, caustic and indirect light and of light from media, at the picture
    /// level.
    pub fn parts(&self) -> Parts {
        let [emission, direct, caustic, indirect, volume] = self.parts.map(|part| part.value());
        Parts { emission, direct, caustic, indirect, volume }
    }

    /// Mean over iterations of the light of one light group (by index), and of the caustics in it.
    pub fn group(&self, group: usize) -> [DVec3; 2] {
        let count = f64::from(self.iterations.max(1));
        self.groups[group].map(|sum| sum.value() / count)
    }

    /// Mean over iterations of the light in a layer by the lobe of the first hit; zero if the pixel has no such sums.
    pub fn lobe_light(&self, layer: LobeLayer) -> DVec3 {
        let sum = self.lobes.as_ref().map_or(DVec3::ZERO, |lobes| lobes.light[layer as usize].value());
        sum / f64::from(self.iterations.max(1))
    }

    /// Mean over iterations of the albedos of the diffuse, glossy and transmitting lobes at the first hit; zero if the
    /// pixel has no such sums.
    pub fn lobe_colors(&self) -> [DVec3; 3] {
        let count = f64::from(self.iterations.max(1));
        self.lobes.as_ref().map_or([DVec3::ZERO; 3], |lobes| lobes.colors.map(|sum| sum / count))
    }

    /// Mean albedo over the camera paths with finite features; zero if there are none.
    pub fn albedo(&self) -> DVec3 {
        if self.features == 0 { DVec3::ZERO } else { self.albedo / f64::from(self.features) }
    }

    /// Number of camera paths whose albedo, normal or depth was not finite.
    pub fn features_rejected(&self) -> u32 {
        self.coverage.paths() - self.features
    }

    /// Unit direction of the mean normal over camera paths; zero if there is no normal.
    pub fn normal(&self) -> DVec3 {
        self.normal.normalize_or_zero()
    }

    /// Mean length (scene units) of camera paths up to the hit of the G-buffer; `None` if no path has such a hit.
    pub fn depth(&self) -> Option<f64> {
        (self.depths > 0).then(|| self.depth.value() / f64::from(self.depths))
    }

    /// First hit of the camera path of the first iteration: its depth along the camera axis ([`FAR`] without a hit) and
    /// its position.
    pub fn first(&self) -> (f32, Vec3) {
        (self.first.z, self.first.p)
    }

    /// Variance of the mean radiance of the picture level, estimated from the scatter of the means of the four
    /// quarters. It is correct even if iterations within a quarter are not independent. `None` if a quarter is empty.
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

    /// Records the first hit of the camera path of iteration `i` (from 1), its depth along the camera axis and
    /// position, unless an iteration has been accumulated. Call it before [`PixelAccumulator::add`].
    #[inline]
    pub fn record_first_hit(&mut self, i: u64, first: impl FnOnce() -> Option<(f32, Vec3)>) {
        if self.iterations == 0 {
            let (z, p) = first().unwrap_or((FAR, Vec3::ZERO));
            self.first = FirstVisible { iteration: i, z, p };
        }
    }

    /// Adds the samples of iteration `i` (from 1), or counts a rejection if a value is not finite. With `correlated`,
    /// level 0 comes from `independent` and the larger levels from `correlated`, which has one level less; without, all
    /// levels come from `independent`.
    #[inline]
    pub fn add(&mut self, i: u64, independent: &PixelSample, correlated: Option<&PixelSample>) {
        self.add_with_groups(i, independent, correlated, &[], None);
    }

    /// Adds an iteration as [`PixelAccumulator::add`] does, and at the picture level for each light group its light and
    /// the caustics in it, and the light by the lobe of the first hit.
    pub fn add_with_groups(
        &mut self,
        i: u64,
        independent: &PixelSample,
        correlated: Option<&PixelSample>,
        groups: &[[Rgb; 2]],
        lobes: Option<&LobeLight>,
    ) {
        let (count, own) = (self.levels(), self.picture_level());
        let mut values = [Rgb::ZERO; MAX_LEVELS];
        for (level, value) in values[..count].iter_mut().enumerate() {
            *value = match correlated {
                Some(correlated) if level > 0 => correlated.radiance(level - 1),
                _ => independent.radiance(level),
            };
        }
        let (sample, level) = self.picture_sample(independent, correlated);
        let parts: [Rgb; PARTS] = [
            sample.emission,
            sample.direct,
            sample.caustic_photons[level],
            sample.indirect + sample.indirect_photons[level],
            sample.volume + sample.volume_photons[level],
        ];
        let difference = match count {
            1 => independent.merge_difference,
            _ => self.difference_of(&values, independent, correlated),
        };
        let (mut most, mut finite) = (Rgb::ZERO, true);
        let by_lobe = lobes.map_or(&[][..], |lobes| &lobes.layers);
        for list in [&values[..count], &parts, &[difference], groups.as_flattened(), by_lobe] {
            for value in list {
                (most, finite) = (most.max(value.abs()), finite & value.is_finite());
            }
        }
        let rejection = independent.rejection.or_else(|| correlated.and_then(|sample| sample.rejection));
        if let Some(cause) = rejection.or_else(|| (!finite).then_some(Cause::Sum)) {
            return self.rejected.count(cause);
        }
        self.iterations += 1;
        self.coarsen_grids(self.grids.with_room_for(f64::from(most.max_element())));
        let rounding = self.grids.rounding();
        let quarter = &mut self.quarters[random::quarter(i) as usize];
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
            // Most parts of a sample are black.
            if part != Rgb::ZERO {
                sum.add(part.as_dvec3(), rounding[0]);
            }
        }
        for (sum, light) in self.groups.as_flattened_mut().iter_mut().zip(groups.as_flattened()) {
            sum.add(light.as_dvec3(), rounding[0]);
        }
        if let Some((sums, lobes)) = self.lobes.as_mut().zip(lobes) {
            for (sum, light) in sums.light.iter_mut().zip(lobes.layers) {
                sum.add(light.as_dvec3(), rounding[0]);
            }
            for (sum, color) in sums.colors.iter_mut().zip(lobes.colors).filter(|(_, color)| color.is_finite()) {
                *sum += on_fixed_grid(color);
            }
        }
        std::iter::once(independent).chain(correlated).for_each(|sample| self.add_features(sample));
    }

    /// Adds the first hit and the G-buffer of one camera path, unless the G-buffer is not finite.
    #[inline]
    fn add_features(&mut self, sample: &PixelSample) {
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

    /// Chooses between the two camera paths of an iteration: returns the sample that contains the picture level, and
    /// the index of this level in the sample.
    #[inline]
    pub fn picture_sample<'m>(
        &self,
        independent: &'m PixelSample,
        correlated: Option<&'m PixelSample>,
    ) -> (&'m PixelSample, usize) {
        match (correlated, self.picture_level()) {
            (Some(correlated), own @ 1..) => (correlated, own - 1),
            (_, own) => (independent, own),
        }
    }

    /// Radiance of the next larger bandwidth level minus that of the picture level in one iteration, with light in
    /// media corrected by [`VOLUME_DIFFERENCE`].
    #[inline]
    fn difference_of(
        &self,
        values: &[Rgb; MAX_LEVELS],
        independent: &PixelSample,
        correlated: Option<&PixelSample>,
    ) -> Rgb {
        let own = self.picture_level();
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

    /// Rounds all sums of light to the grids `to`, each equal to or coarser than the current one.
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
            .chain(self.lobes.iter_mut().flat_map(|lobes| &mut lobes.light))
            .for_each(|sum| from.coarsen_values(sum, to));
        self.others.iter_mut().for_each(|moments| moments.coarsen(from, to));
    }

    /// Adds an accumulator of other iterations of the pixel. The result is bit for bit that of one accumulator of all
    /// iterations, in any order.
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
        if let Some((own, other)) = self.lobes.as_mut().zip(other.lobes.as_ref()) {
            own.light.iter_mut().zip(&other.light).for_each(|(own, other)| own.join(other));
            own.colors.iter_mut().zip(other.colors).for_each(|(own, other)| *own += other);
        }
        self.albedo += other.albedo;
        self.normal += other.normal;
        self.depth.join(&other.depth);
        self.features += other.features;
        self.depths += other.depths;
        self.coverage.join(&other.coverage);
        // The first accumulated iteration; if there is none, the last rejected one.
        let of = |pixel: &PixelAccumulator| {
            if pixel.iterations > 0 { (0, pixel.first.iteration) } else { (1, !pixel.first.iteration) }
        };
        if of(&other) < of(self) {
            self.first = other.first;
        }
        self.iterations += other.iterations;
        self.rejected.join(&other.rejected);
    }
}

/// Rounds a value of order one to a multiple of 2^-28, so that sums are exact in any order.
#[inline]
fn on_fixed_grid(value: Vec3) -> DVec3 {
    /// Numbers of this size in f64 are multiples of 2^-28.
    const MAGIC: f64 = 1.5 * (1u64 << 24) as f64;
    value.as_dvec3().rounded(MAGIC)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};
    use crate::transport::{Features, FirstHit};

    /// With a bias of r^2 on surfaces and in media, where bandwidths of levels differ by other factors, differences of
    /// levels equal the sum of both biases.
    #[test]
    fn level_differences_equal_the_bias_on_surfaces_and_in_media() {
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

    /// An iteration of a pixel with all kinds of light, of very different magnitudes, and with some samples that are
    /// not finite.
    fn iteration(i: u64) -> [PixelSample; 2] {
        [0, 1].map(|path| {
            let draw = |index| {
                let draws = Stream::new(1, i, Domain::Test, 100 * path + index).vertex(0);
                let [a, b] = [draws.two(Purpose::Pixel), draws.two(Purpose::Lens)];
                Rgb::new(a.x, a.y, b.x) * 10f32.powf(16.0 * b.y - 8.0)
            };
            let photons = |first: u64| std::array::from_fn(|level| draw(first + level as u64));
            let rejection = i % 11 == 1;
            PixelSample {
                emission: if rejection { Rgb::splat(f32::NAN) } else { draw(0) },
                direct: draw(1),
                indirect: draw(2),
                caustic_photons: photons(10),
                indirect_photons: photons(20),
                volume: draw(3),
                volume_photons: photons(30),
                merge_difference: draw(9),
                features: Features {
                    albedo: draw(4).normalize() * 0.9,
                    normal: (draw(5) - draw(6)).normalize(),
                    depth: draw(7).x,
                    share: 1.0,
                },
                first: (!i.is_multiple_of(3)).then(|| FirstHit { p: draw(8), instance: (i % 10) as u32 }),
                rejection: (i % 13 == 1).then_some(Cause::Splat),
            }
        })
    }

    fn pixel(levels: usize, iterations: impl Iterator<Item = u64>) -> PixelAccumulator {
        let mut pixel = PixelAccumulator { volume_bandwidth: 0.1, ..PixelAccumulator::new(levels, 7, [0.1; 2]) };
        for i in iterations {
            let [independent, correlated] = iteration(i);
            pixel.record_first_hit(i, || independent.first.map(|first| (first.p.x, first.p)));
            pixel.add(i, &independent, (levels > 1).then_some(&correlated));
        }
        pixel
    }

    /// All results of a pixel, as bits for exact comparison.
    fn all_bits(pixel: &PixelAccumulator, levels: usize) -> Vec<u64> {
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
    fn shards_join_in_any_order_to_the_same_bits() {
        for levels in [1, 2, 5] {
            let whole = all_bits(&pixel(levels, 1..=100), levels);
            for shards in [2, 3, 7, 100] {
                let part = |index: usize| pixel(levels, (1..=100).skip(index).step_by(shards));
                let mut forward = part(0);
                (1..shards).for_each(|index| forward.join(part(index)));
                let mut backward = part(shards - 1);
                (0..shards - 1).rev().for_each(|index| backward.join(part(index)));
                assert!(
                    all_bits(&forward, levels) == whole && all_bits(&backward, levels) == whole,
                    "{shards} of {levels}"
                );
            }
            // A missing iteration, and one that is there twice, change the bits.
            assert_ne!(all_bits(&pixel(levels, 1..=99), levels), whole);
            let mut twice = pixel(levels, 1..=100);
            twice.join(pixel(levels, 5..=5));
            assert_ne!(all_bits(&twice, levels), whole);
        }
    }

    /// The accumulator is compared with plain sums in f64. No value is so large that others lose digits.
    #[test]
    fn means_and_variances_agree_with_two_pass_formulas() {
        let mut values = Vec::new();
        let mut pixel = PixelAccumulator::new(1, 0, [0.0; 2]);
        for i in 1..=200u64 {
            let draw = Stream::new(2, i, Domain::Test, 0).vertex(0).two(Purpose::Pixel);
            let direct = Rgb::new(draw.x, draw.y, 0.01 * draw.x);
            pixel.add(i, &PixelSample { direct, ..PixelSample::default() }, None);
            values.push(direct.as_dvec3());
        }
        let mean = values.iter().sum::<DVec3>() / 200.0;
        let variance = values.iter().map(|&v| (v - mean) * (v - mean)).sum::<DVec3>() / (200.0 * 199.0);
        let apart = |a: DVec3, b: DVec3| (a / b - 1.0).abs();
        let direct = pixel.parts().direct / 200.0;
        assert!(apart(pixel.mean(0), mean).max_element() < 1e-7 && apart(direct, mean).max_element() < 1e-7);
        // Squares are cut off at 2^-31 of the largest: in the dark channel a relative error of at most 1e-4.
        let apart = apart(pixel.variance_of_mean(0), variance);
        assert!(apart.max_element() < 1e-4 && apart.x.max(apart.y) < 1e-7, "{apart}");
        assert_eq!(pixel.parts().caustic, DVec3::ZERO);
    }
}
