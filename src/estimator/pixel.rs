//! The state of a pixel: plain numbers that can be saved and merged.

use super::Coverage;
use crate::math::{DVec3, Rgb, Vec3};
use crate::photon::ByKind;
use crate::random;
use crate::stat::Welford;
use crate::transport::{EyeMeasure, MAX_LEVELS};
use serde::{Deserialize, Serialize};

/// What is added to the differences of levels for light gathered in media, relative: bias grows with the radius
/// squared, which from one level to the next grows by 2^(2/3) there and by 2 on surfaces. With this, a difference is
/// the bias of the smaller level for both: `1 / (2^(2/3) - 1) - 1`.
const VOLUME_DIFFERENCE: f32 = 0.702_414_4;

/// Sums over iterations of the additive parts of the level that is the method's own image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
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

/// Estimates of one quarter of the iterations, of the level that is the method's own image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quarter {
    /// Sum over the quarter's iterations.
    pub sum: DVec3,
    /// Iterations counted.
    pub count: u32,
}

impl Quarter {
    /// Mean of the quarter's iterations; zero without any.
    pub fn mean(&self) -> DVec3 {
        if self.count == 0 { DVec3::ZERO } else { self.sum / f64::from(self.count) }
    }
}

/// Statistics of one pixel over the iterations so far.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Pixel {
    /// Estimates, level 1 (the smallest bandwidth) first.
    pub levels: [Welford; MAX_LEVELS],
    /// `differences[k]`: level k + 2 minus level k + 1. Neighbours are correlated, so their difference's variance
    /// cannot be had from theirs. Where photons are gathered in media, scaled there to tell the bias
    /// ([`super::SquaredError`]).
    pub differences: [Welford; MAX_LEVELS - 1],
    /// Sums of the parts.
    pub parts: Parts,
    /// The own image by independent groups of iterations, whose points share no scramble: what variance and error are
    /// measured by.
    pub quarters: [Quarter; QUARTERS],
    /// Sums of G-buffers over all eye paths.
    pub albedo: DVec3,
    /// See `albedo`.
    pub normal: DVec3,
    /// Sum over those paths that have such a hit.
    pub depth: f64,
    /// Eye paths whose measure was finite.
    pub features: u32,
    /// Those of them with a hit that is not a perfect mirror or clear glass.
    pub depths: u32,
    /// First hits of all eye paths.
    pub coverage: Coverage,
    /// Iterations counted.
    pub iterations: u32,
    /// Iterations rejected as not finite.
    pub rejected: u32,
    /// Largest initial bandwidth by kind of photons (scene units).
    pub bandwidths: ByKind<f32>,
    /// The same for photons in media; 0 where there are none.
    pub volume_bandwidth: f32,
    /// Camera depth of the first visible hit of the first iteration; 1e10 where there is none.
    pub z: f32,
    /// Its position.
    pub p: Vec3,
}

impl Pixel {
    /// A pixel before its first iteration.
    pub fn new(bandwidths: ByKind<f32>) -> Pixel {
        Pixel { bandwidths, z: 1e10, ..Pixel::default() }
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
        let mean = self.quarters.iter().map(|quarter| quarter.sum).sum::<DVec3>() / total;
        let scatter = self.quarters.iter().map(|quarter| {
            let apart = quarter.mean() - mean;
            apart * apart * f64::from(quarter.count)
        });
        Some(scatter.sum::<DVec3>() / ((QUARTERS - 1) as f64 * total))
    }

    /// Looks at the memory that [`Pixel::add`] is about to change, so that the processor waits for that of several
    /// pixels at once. Returns something that depends on it.
    #[inline]
    pub fn touch(&self) -> f64 {
        let levels: f64 = self.levels.iter().chain(&self.differences).map(|level| level.mean.x).sum();
        levels + self.parts.emission.x + self.parts.indirect.z + self.depth + f64::from(self.bandwidths[0])
    }

    /// Adds iteration `pass` (from 1): level 1 from `independent`, the others from `correlated` (of `count - 1`
    /// levels), or all from `independent` when they share one eye path. `levels`: their number, and the one (from 0)
    /// whose parts are kept.
    pub fn add(
        &mut self,
        pass: u64,
        independent: &EyeMeasure,
        correlated: Option<&EyeMeasure>,
        levels: (usize, usize),
    ) {
        let (count, own) = levels;
        let mut values = [Rgb::ZERO; MAX_LEVELS];
        for (level, value) in values[..count].iter_mut().enumerate() {
            *value = match correlated {
                Some(correlated) if level > 0 => correlated.radiance(level - 1),
                _ => independent.radiance(level),
            };
        }
        if !values[..count].iter().all(|v| v.is_finite()) {
            self.rejected += 1;
            return;
        }
        self.iterations += 1;
        let inverse_count = 1.0 / f64::from(self.iterations);
        let in_media = |level: usize| match correlated {
            Some(correlated) if level > 0 => correlated.volume_photons[level - 1],
            _ => independent.volume_photons[level],
        };
        for level in 0..count {
            self.levels[level].add(values[level], inverse_count);
            if level + 1 < count {
                let mut difference = values[level + 1] - values[level];
                if self.volume_bandwidth > 0.0 {
                    difference += VOLUME_DIFFERENCE * (in_media(level + 1) - in_media(level));
                }
                self.differences[level].add(difference, inverse_count);
            }
        }
        let quarter = &mut self.quarters[random::quarter(pass) as usize];
        quarter.sum += values[own].as_dvec3();
        quarter.count += 1;
        let (measure, level) = match correlated {
            Some(correlated) if own > 0 => (correlated, own - 1),
            _ => (independent, own),
        };
        self.parts.emission += measure.emission.as_dvec3();
        self.parts.direct += measure.direct.as_dvec3();
        self.parts.caustic += measure.caustic_photons[level].as_dvec3();
        self.parts.indirect += (measure.indirect + measure.indirect_photons[level]).as_dvec3();
        self.parts.volume += (measure.volume + measure.volume_photons[level]).as_dvec3();
        for measure in std::iter::once(independent).chain(correlated) {
            self.coverage.add(measure.first.map(|first| first.instance));
            let features = measure.features;
            if features.albedo.is_finite() && features.normal.is_finite() && features.depth.is_finite() {
                self.albedo += features.albedo.as_dvec3();
                self.normal += features.normal.as_dvec3();
                self.depth += f64::from(features.depth);
                self.features += 1;
                self.depths += u32::from(features.depth > 0.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bias of r^2 on surfaces and of r^2 in media, whose levels' radii are apart by other factors: differences tell
    /// their sum.
    #[test]
    fn differences_of_levels_are_the_bias_on_surfaces_and_in_media() {
        let biases = |level: i32| (0.01 * 2f32.powi(level), 0.02 * (2.0 / 3.0 * level as f32).exp2());
        let measure = |first: i32| {
            let mut measure = EyeMeasure { direct: Rgb::ONE, volume: Rgb::ONE, ..EyeMeasure::default() };
            for level in 0..MAX_LEVELS {
                let (surface, volume) = biases(first + level as i32);
                measure.indirect_photons[level] = Rgb::splat(surface);
                measure.volume_photons[level] = Rgb::splat(volume);
            }
            measure
        };
        for media in [true, false] {
            let mut pixel = Pixel { volume_bandwidth: if media { 0.1 } else { 0.0 }, ..Pixel::new([0.1; 2]) };
            pixel.add(1, &measure(0), Some(&measure(1)), (5, 3));
            for (level, difference) in (0..).zip(&pixel.differences) {
                let (surface, volume) = biases(level);
                let expected = f64::from(surface + volume);
                let ratio = difference.mean.x / expected;
                assert_eq!((ratio - 1.0).abs() < 1e-4, media, "level {level}: {ratio}");
            }
        }
    }
}
