//! The picture that the finish starts from, with its noise and the denoiser's guides.

use crate::error::{Error, ErrorKind, Result};
use crate::estimator::QUARTERS;
use crate::film::{Layer, LayerSet, Picture, Role};

/// Largest ratio of standard error to estimate that rounding of single-precision sums alone can produce.
pub(super) const ROUNDING: f32 = 8.0 * f32::EPSILON;

/// Names of two layers with independent halves of the samples.
const HALVES: [[&str; 2]; 2] = [["Half1", "Half2"], ["HalfA", "HalfB"]];

/// An unfinished picture, its noise, and the guides of a denoiser, all of one size.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Estimated radiance.
    pub mean: Picture,
    /// Standard error of `mean`, by channel; infinite where it is unknown.
    pub deviation: Picture,
    /// Reflectance at the first rough hit, 0 to 1; `None` if unknown.
    pub albedo: Option<Picture>,
    /// World-space normal at the first rough hit; `None` if unknown.
    pub normal: Option<Picture>,
    /// Whether albedo and normal have no noise, which the denoiser would keep.
    pub clean_guides: bool,
    /// Coverage of each pixel, 0 to 1; `None` if the picture has no alpha.
    pub alpha: Option<Vec<f32>>,
    /// Number of independent samples that `deviation` is estimated from; `None` if unknown, and taken for many.
    pub samples: Option<u64>,
}

impl Estimate {
    /// An estimate without guides and alpha, of an unknown number of samples.
    #[cfg(test)]
    pub(super) fn unguided(mean: Picture, deviation: Picture) -> Estimate {
        let (albedo, normal, alpha, samples) = (None, None, None, None);
        Estimate { mean, deviation, albedo, normal, clean_guides: false, alpha, samples }
    }

    /// The estimate in a picture of caustique (`Noisy`, `Variance1`, ...) or of another renderer: its beauty, and its
    /// layer `Variance` (of the mean) or two independent halves, `Half1` and `Half2` or `HalfA` and `HalfB`. Albedo and
    /// normal are found by the names of the common renderers.
    ///
    /// # Errors
    /// There is no picture, or no layer for its noise.
    pub fn of(set: &LayerSet) -> Result<Estimate> {
        let mean = set.picture("Noisy").map_or_else(|| set.beauty(), Ok)?;
        let variance = set.picture(&format!("Variance{}", own_level(set))).or_else(|| set.picture("Variance"));
        let halves = HALVES.iter().find_map(|names| {
            let [a, b] = names.map(|name| set.picture(name));
            a.zip(b)
        });
        let deviation = match (variance, halves) {
            (Some(variance), _) => variance.map(|v| if v >= 0.0 { v.sqrt() } else { f32::INFINITY }),
            (None, Some((a, b))) => a.half_difference(&b),
            (None, None) => {
                let cause =
                    "nothing tells how noisy the picture is: there is no layer Variance1, Variance, or Half1 and Half2";
                let hint = "render with --layers all, or add the variance of the mean, or two independent halves";
                return Err(Error::new(ErrorKind::Image, "", cause).hint(hint));
            }
        };
        let guide = |role| set.find(role).filter(|layer| layer.planes.len() >= 3).map(|layer| set.picture_of(layer));
        let (albedo, normal, alpha) = (guide(Role::Albedo), guide(Role::Normal), alpha(set));
        Ok(Estimate { mean, deviation, albedo, normal, clean_guides: false, alpha, samples: set.iterations })
    }

    /// Whether all samples of pixel `index` have been equal: a light seen without noise, or nothing at all. A black
    /// surface is not exact, because rare light may have missed it.
    pub(super) fn is_exact(&self, index: usize) -> bool {
        let (mean, error) = (self.mean[index], self.deviation[index]);
        let most = mean.into_iter().fold(0.0, f32::max);
        (most > 0.0 || (most == 0.0 && self.has_alpha_0(index)))
            && error.into_iter().all(|error| error <= ROUNDING * most)
    }

    /// Whether alpha is known to be 0 at pixel `index`.
    pub(super) fn has_alpha_0(&self, index: usize) -> bool {
        self.alpha.as_ref().is_some_and(|alpha| alpha[index] == 0.0)
    }

    /// The estimate by the first half of the iterations: the mean of the first two of the four quarters.
    #[must_use]
    pub fn first_half(&self, quarters: &[Picture; QUARTERS]) -> Estimate {
        let mean = quarters[0].average(&quarters[1]);
        let deviation = self.deviation.map(|error| error * std::f32::consts::SQRT_2);
        let (albedo, normal, alpha) = (self.albedo.clone(), self.normal.clone(), self.alpha.clone());
        let samples = self.samples.map(|samples| samples / 2);
        Estimate { mean, deviation, albedo, normal, alpha, samples, ..*self }
    }
}

/// The layers of a set, which may lack its values, that [`Estimate::of`] and [`quarters`] read.
pub(super) fn estimate_layers(set: &LayerSet) -> impl Iterator<Item = &Layer> {
    let roles = [Role::Beauty, Role::Albedo, Role::Normal].into_iter().filter_map(|role| set.find(role));
    let reads = |name: &str| {
        let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
        ["Noisy", "Variance", "Quarter"].contains(&stem) || HALVES.iter().flatten().any(|half| *half == name)
    };
    roles.chain(set.layers.iter().filter(move |layer| reads(&layer.name)))
}

/// Number, from 1, of the bandwidth level that is the method's own image: the second largest.
pub(super) fn own_level(set: &LayerSet) -> usize {
    level_count(set).saturating_sub(1).max(1)
}

/// Number of bandwidth levels of a picture; 0 if it is another renderer's.
pub(super) fn level_count(set: &LayerSet) -> usize {
    (1..).take_while(|level| set.get(&format!("Variance{level}")).is_some()).count()
}

/// Coverage of each pixel, 0 to 1; `None` if the beauty has no alpha.
pub(super) fn alpha(set: &LayerSet) -> Option<Vec<f32>> {
    set.find(Role::Beauty).and_then(|beauty| beauty.plane("A")).map(|plane| plane.values.clone())
}

/// The pictures that each of four equal parts of the iterations gives; `None` if one is missing or black.
pub fn quarters(set: &LayerSet) -> Option<[Picture; QUARTERS]> {
    let pictures: Vec<Picture> = (1..=QUARTERS).filter_map(|k| set.picture(&format!("Quarter{k}"))).collect();
    let quarters = <[Picture; QUARTERS]>::try_from(pictures).ok()?;
    (!quarters.iter().any(Picture::is_black)).then_some(quarters)
}
