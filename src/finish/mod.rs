//! What is delivered: the estimate, denoised within what its own standard errors allow.
//!
//! 1. The estimate `M`: the usual single-bandwidth image, or what equation (6) of the 2021 paper combines from levels
//!    where its network was asked for.
//! 2. A denoiser's picture `D` of it ([`denoiser`]).
//! 3. `out = M + clip(D - M, -c s, c s)` ([`mod@bound`]), which is consistent whatever `D` is; and the light of the picture
//!    as a whole is kept (`conserve.rs`).
//! 4. The additive parts, finished so that they sum to the picture ([`parts`]).
//! 5. The error of the result, told by independent quarters of the iterations ([`Verdict`]).
//!
//! All of it reads and writes named layers, so that a stored picture, also one of another renderer, is finished as a
//! fresh one is.

pub mod bound;
mod conserve;
pub mod denoiser;
pub mod halves;
pub mod parts;
pub mod statistical;
mod verdict;
mod window;

pub use denoiser::{Denoiser, DenoiserChoice, Quality, scratch};
pub use verdict::{Errors, USUAL, Verdict};
pub use window::{Size, Windows, window};

use crate::combine::{Combiner, LevelStack};
use crate::error::{Error, ErrorKind, Result};
use crate::estimator::QUARTERS;
use crate::film::kind::Use;
use crate::film::{CAUSTIC, LIGHT_GROUP, Layer, LayerSet, Role, finished_part, kind_of, part_names};
pub use bound::Clamped;
use parts::Part;
use rayon::prelude::*;
use verdict::Trial;

/// A standard error over its estimate that is the rounding of single precision sums.
const ROUNDING: f32 = 8.0 * f32::EPSILON;
/// Bytes that a finish takes for a pixel beside its layers, without parts: the estimate by all and by half of the
/// iterations, their pictures, the quarters, and what the error is worked out in.
pub const BYTES_PER_PIXEL: u64 = 384;
/// The same for each part.
pub const BYTES_PER_PIXEL_OF_PART: u64 = 36;
/// The layer of the picture's error.
pub const ERROR: &str = "Error";
/// Whether the picture alone is finished from a layer of ours, which the network may read.
pub fn reads_for_picture(name: &str) -> bool {
    kind_of(name).is_some_and(|(kind, _)| kind.finish == Some(Use::Picture))
}

/// Whether the picture and its error by quarters are finished from a layer of ours.
pub fn reads_for_error(name: &str) -> bool {
    kind_of(name).is_some_and(|(kind, _)| matches!(kind.finish, Some(Use::Picture | Use::Error)))
}

/// Whether finishing reads a layer of ours at all: for the picture, its error, and its parts.
pub fn reads(name: &str) -> bool {
    reads_for_error(name) || finished_part(name).is_some()
}

/// A picture with its noise and what guides a denoiser, row by row from the top.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Width and height of all planes.
    pub size: Size,
    /// Radiance.
    pub mean: Vec<[f32; 3]>,
    /// Standard error of `mean`; infinite where nothing is known.
    pub deviation: Vec<[f32; 3]>,
    /// Reflectance at the first rough hit, 0 to 1.
    pub albedo: Option<Vec<[f32; 3]>>,
    /// Normal there, world space.
    pub normal: Option<Vec<[f32; 3]>>,
    /// Share of a pixel that shows anything, where that is known.
    pub alpha: Option<Vec<f32>>,
}

/// The number of the level that is the method's own image: the second largest.
fn own_level(set: &LayerSet) -> usize {
    let count = (1..).take_while(|level| set.get(&format!("Variance{level}")).is_some()).count();
    count.saturating_sub(1).max(1)
}

impl Estimate {
    /// The estimate in a picture of ours (`Noisy`, `Variance1`, ...), or in one of another renderer: its beauty, and
    /// its layer `Variance` (of the mean) or two independent halves, `Half1` and `Half2` or `HalfA` and `HalfB`. Albedo
    /// and normal by the names that renderers give them.
    ///
    /// # Errors
    /// There is no picture, or nothing tells its noise.
    pub fn of(set: &LayerSet) -> Result<Estimate> {
        let size = Size { width: set.width, height: set.height };
        let mean = set.get("Noisy").map_or_else(|| set.beauty(), |layer| Ok(layer.triples()))?;
        let variance = set.get(&format!("Variance{}", own_level(set))).or_else(|| set.get("Variance"));
        let halves = [["Half1", "Half2"], ["HalfA", "HalfB"]].iter().find_map(|names| {
            let [a, b] = names.map(|name| set.get(name).map(Layer::triples));
            a.zip(b)
        });
        let deviation = match (variance, halves) {
            (Some(variance), _) => {
                let root = |rgb: [f32; 3]| rgb.map(|v| if v >= 0.0 { v.sqrt() } else { f32::INFINITY });
                variance.triples().into_par_iter().map(root).collect()
            }
            // Half the difference of two halves has the variance of their mean.
            (None, Some((a, b))) => {
                a.par_iter().zip(&b).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] - b[c]).abs())).collect()
            }
            (None, None) => {
                let error = Error::new(
                    ErrorKind::Image,
                    "",
                    "nothing tells how noisy the picture is: there is no layer Variance1, Variance, or Half1 and Half2",
                );
                return Err(
                    error.hint("render with --layers all, or add the variance of the mean, or two independent halves")
                );
            }
        };
        let guide = |role| set.find(role).filter(|layer| layer.planes.len() >= 3).map(Layer::triples);
        let (albedo, normal, alpha) = (guide(Role::Albedo), guide(Role::Normal), alpha(set));
        Ok(Estimate { size, mean, deviation, albedo, normal, alpha })
    }

    /// Whether all samples of a pixel have shown the same: a light without noise, or nothing at all. A black surface is
    /// none of these, because its light may be rare.
    pub(crate) fn is_exact(&self, index: usize) -> bool {
        let (mean, error) = (self.mean[index], self.deviation[index]);
        let most = mean.into_iter().fold(0.0, f32::max);
        let shows_nothing = most == 0.0 && self.alpha.as_ref().is_some_and(|alpha| alpha[index] == 0.0);
        (most > 0.0 || shows_nothing) && error.into_iter().all(|error| error <= ROUNDING * most)
    }

    /// The estimate by the first two quarters alone.
    #[must_use]
    pub fn first_half(&self, quarters: &[Vec<[f32; 3]>; QUARTERS]) -> Estimate {
        self.of_some(halves::mean([&quarters[0], &quarters[1]]), 2.0)
    }

    /// The estimate by some of the iterations, whose mean is given; all are `fewer` times as many.
    #[must_use]
    pub fn of_some(&self, mean: Vec<[f32; 3]>, fewer: f32) -> Estimate {
        let deviation = self.deviation.iter().map(|s| s.map(|s| s * fewer.sqrt())).collect();
        let (albedo, normal, alpha) = (self.albedo.clone(), self.normal.clone(), self.alpha.clone());
        Estimate { size: self.size, mean, deviation, albedo, normal, alpha }
    }
}

/// The share of each pixel that shows anything; `None` where the picture does not tell.
fn alpha(set: &LayerSet) -> Option<Vec<f32>> {
    set.find(Role::Beauty).and_then(|beauty| beauty.plane("A")).map(|plane| plane.values.clone())
}

/// The pictures of the four quarters of the iterations; `None` where one is missing or black.
pub fn quarters(set: &LayerSet) -> Option<[Vec<[f32; 3]>; QUARTERS]> {
    let layers: Vec<Vec<[f32; 3]>> =
        (1..=QUARTERS).filter_map(|k| set.get(&format!("Quarter{k}"))).map(Layer::triples).collect();
    let quarters = <[Vec<[f32; 3]>; QUARTERS]>::try_from(layers).ok()?;
    let black = |quarter: &Vec<[f32; 3]>| quarter.iter().flatten().all(|value| *value == 0.0);
    (!quarters.iter().any(black)).then_some(quarters)
}

/// What finishes pictures.
pub struct Finish {
    denoiser: Denoiser,
    /// Quality of Open Image Denoise.
    pub quality: Quality,
    network: Option<Combiner>,
}

/// What was done.
#[derive(Clone, Debug)]
pub struct Account {
    /// Levels that equation (6) has combined, if it has.
    pub combined: Option<usize>,
    /// The error of a picture finished from half of the iterations, where the picture has quarters.
    pub verdict: Option<Verdict>,
    /// The errors of its pixels, where the layer `Error` is wanted.
    pub errors: Option<Errors>,
    /// Pixels that were kept between zero and the brightest estimate around.
    pub clamped: Clamped,
}

impl Finish {
    /// With a denoiser, and perhaps the network of equation (6).
    pub fn new(denoiser: Denoiser, network: Option<Combiner>) -> Finish {
        Finish { denoiser, quality: Quality::High, network }
    }

    /// The finish by which auto's pilots are compared: our own denoiser's where the render has any. The choice is the
    /// same for a whole render and for each of its shards then, with and without the library of another denoiser.
    pub fn of_pilots(choice: DenoiserChoice) -> Finish {
        let none = choice == DenoiserChoice::None;
        Finish::new(if none { Denoiser::None } else { Denoiser::Own }, None)
    }

    /// The denoiser's name.
    pub fn denoiser(&self) -> String {
        self.denoiser.name()
    }

    /// Finishes a grey picture with a quality of the denoiser, so that the caller can time it; the first time loads what
    /// later ones find ready.
    ///
    /// # Errors
    /// The denoiser fails.
    pub fn rehearse(&mut self, size: Size, quality: Quality) -> Result<()> {
        let plane = || vec![[0.5; 3]; size.pixels()];
        let (albedo, normal) = (Some(plane()), Some(plane()));
        let estimate = Estimate { size, mean: plane(), deviation: plane(), albedo, normal, alpha: None };
        let before = std::mem::replace(&mut self.quality, quality);
        let finished = self.picture(&estimate);
        self.quality = before;
        finished.map(|_| ())
    }

    /// Whether the denoiser has qualities.
    pub fn has_qualities(&self) -> bool {
        matches!(self.denoiser, Denoiser::Oidn { .. })
    }

    /// The finished picture of an estimate.
    ///
    /// # Errors
    /// The denoiser fails.
    pub fn picture(&mut self, estimate: &Estimate) -> Result<Vec<[f32; 3]>> {
        self.with_spread(estimate).map(|([picture, _], _)| picture)
    }

    /// The finished picture, and the spread that bounds it; and what was clamped.
    fn with_spread(&mut self, estimate: &Estimate) -> Result<([Vec<[f32; 3]>; 2], Clamped)> {
        let denoised = self.denoiser.run(estimate, self.quality)?;
        let spread = bound::spread(estimate);
        let (mut picture, clamped) = bound::bounded_and_counted(&estimate.mean, &denoised, &spread, estimate.size);
        conserve::give_back(&mut picture, (&estimate.mean, &denoised), (estimate, &spread));
        Ok(([picture, spread], clamped))
    }

    /// Finishes the picture of `set` and makes the result its beauty; alpha stays. Adds `CombinedDirect` and the other
    /// parts where the picture has parts and they are wanted by name. Rows of pixels do not depend on the number of
    /// threads, but for what [`caustique_oidn`] says of its own.
    ///
    /// # Errors
    /// Layers are missing ([`Estimate::of`]), or the denoiser or the network fails; the set is as it was then.
    pub fn apply(&mut self, set: &mut LayerSet, wanted: impl Fn(&str) -> bool) -> Result<Account> {
        let mut estimate = Estimate::of(set)?;
        let combined = match &mut self.network {
            Some(network) => {
                estimate.mean = network.run(&LevelStack::of(set)?)?;
                Some(network.facts().levels)
            }
            None => None,
        };
        let ([picture, spread], clamped) = self.with_spread(&estimate)?;
        let (verdict, errors) = self.judged(set, &estimate, wanted(ERROR))?.unzip();
        let errors = errors.flatten();
        let parts = self.parts(set, &estimate, (&picture, &spread), wanted)?;
        let alpha = alpha(set);
        set.layers.retain(|layer| layer.name != "Combined");
        set.push(match alpha {
            Some(alpha) => {
                let pixels = picture.into_iter().zip(alpha).map(|([r, g, b], a)| [r, g, b, a]);
                Layer::interleaved("", "RGBA", pixels)
            }
            None => Layer::interleaved("", "RGB", picture),
        })?;
        if let Some(errors) = &errors {
            set.layers.retain(|layer| layer.name != ERROR);
            // As in layers of variances: what is known to be large is not to look as if nothing were known.
            let root = |square: f32| square.sqrt().min(f32::MAX);
            set.push(Layer::interleaved(ERROR, "RGB", errors.squared().map(|rgb| rgb.map(root))))?;
        }
        for (name, values) in parts {
            set.push(Layer::interleaved(name, "RGB", values))?;
        }
        Ok(Account { combined, verdict, errors, clamped })
    }

    /// The error of a picture finished from half of its iterations, as the other half tells it; `None` where a quarter is
    /// missing or empty.
    ///
    /// # Errors
    /// Layers are missing, or the denoiser fails.
    pub fn verdict(&mut self, set: &LayerSet) -> Result<Option<Verdict>> {
        let estimate = Estimate::of(set)?;
        Ok(self.judged(set, &estimate, false)?.map(|(verdict, _)| verdict))
    }

    /// The same, with the errors of pixels if they are wanted.
    fn judged(
        &mut self,
        set: &LayerSet,
        estimate: &Estimate,
        of_pixels: bool,
    ) -> Result<Option<(Verdict, Option<Errors>)>> {
        let Some(quarters) = quarters(set) else { return Ok(None) };
        let half = self.picture(&estimate.first_half(&quarters))?;
        let own = own_level(set);
        let levels = [own, own + 1].map(|level| set.get(&format!("Level{level}")).map(Layer::triples));
        let [own, larger] = &levels;
        let trial = Trial {
            size: estimate.size,
            half: &half,
            quarters: &quarters,
            deviation: &estimate.deviation,
            levels: own.as_deref().zip(larger.as_deref()).map(|(own, larger)| [own, larger]),
        };
        Ok(Some(if of_pixels {
            let (verdict, errors) = trial.judge();
            (verdict, Some(errors))
        } else {
            (trial.verdict(), None)
        }))
    }

    /// The finished parts that are wanted, with their layers' names: all or none of those are worked out that sum to
    /// the picture, or to its caustics, together.
    fn parts(
        &mut self,
        set: &LayerSet,
        estimate: &Estimate,
        (picture, spread): (&[[f32; 3]], &[[f32; 3]]),
        wanted: impl Fn(&str) -> bool,
    ) -> Result<Vec<(String, Vec<[f32; 3]>)>> {
        let there = |names: &mut dyn Iterator<Item = &str>| -> Vec<(String, Vec<[f32; 3]>)> {
            let layer = |name: &str| Some((finished_part(name)?, set.get(name)?.triples()));
            names.filter_map(layer).collect()
        };
        let of_group =
            |prefix| there(&mut set.layers.iter().map(|layer| &*layer.name).filter(|name| name.starts_with(prefix)));
        let any = |parts: &[(String, Vec<[f32; 3]>)]| parts.iter().any(|(name, _)| wanted(name));
        let (effects, groups, caustics) = (there(&mut part_names()), of_group(LIGHT_GROUP), of_group(CAUSTIC));
        let mut finished = Vec::new();
        if any(&effects) || any(&caustics) {
            finished.extend(self.shared(effects, estimate, (picture, spread))?);
        }
        if any(&groups) {
            let groups = with_rest(groups, &estimate.mean);
            finished.extend(self.shared(groups, estimate, (picture, spread))?);
        }
        let whole = finished_part("Caustic").and_then(|name| finished.iter().find(|(part, _)| *part == name)).cloned();
        if let (true, Some((_, whole)), Some(mean)) = (any(&caustics), whole, set.get("Caustic")) {
            let caustics = with_rest(caustics, &mean.triples());
            finished.extend(self.shared(caustics, estimate, (&whole, spread))?);
        }
        finished.retain(|(name, _)| !name.is_empty() && wanted(name));
        Ok(finished)
    }

    /// Parts finished so that they sum to `whole`, with their names. Guides and standard errors of the whole picture
    /// serve all.
    fn shared(
        &mut self,
        parts: Vec<(String, Vec<[f32; 3]>)>,
        estimate: &Estimate,
        (whole, spread): (&[[f32; 3]], &[[f32; 3]]),
    ) -> Result<Vec<(String, Vec<[f32; 3]>)>> {
        let mut of_part = estimate.clone();
        let (mut names, mut estimates) = (Vec::with_capacity(parts.len()), Vec::with_capacity(parts.len()));
        for (name, mean) in parts {
            let dark = mean.iter().flatten().all(|value| *value == 0.0);
            of_part.mean = mean;
            // Lamps that are seen have no noise but at their edges.
            let denoised = if dark || name == "CombinedEmission" {
                of_part.mean.clone()
            } else {
                // Parts are looked at less closely than the picture.
                self.denoiser.run(&of_part, Quality::Fast)?
            };
            names.push(name);
            estimates.push(Part { mean: std::mem::take(&mut of_part.mean), denoised });
        }
        let finished = parts::shared(&estimates, whole, (estimate, spread));
        Ok(names.into_iter().zip(finished).collect())
    }
}

/// The light of groups, and that of no group if there is any, without a name and first: what rounding leaves goes to the
/// last.
fn with_rest(mut groups: Vec<(String, Vec<[f32; 3]>)>, whole: &[[f32; 3]]) -> Vec<(String, Vec<[f32; 3]>)> {
    /// Of all light, what rounding may leave.
    const ROUNDING: f64 = 1e-5;
    let rest: Vec<[f32; 3]> = whole
        .iter()
        .enumerate()
        .map(|(index, whole)| {
            std::array::from_fn(|c| {
                let known: f32 = groups.iter().map(|(_, group)| group[index][c]).sum();
                (whole[c] - known).max(0.0)
            })
        })
        .collect();
    let sum = |light: &[[f32; 3]]| light.iter().flatten().map(|value| f64::from(*value)).sum::<f64>();
    if sum(&rest) > ROUNDING * sum(whole) {
        groups.insert(0, (String::new(), rest));
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shards know nothing of each other, and have to choose as one render does.
    #[test]
    fn pilots_are_judged_alike_whatever_denoises_the_picture() {
        for choice in [DenoiserChoice::Auto, DenoiserChoice::Oidn, DenoiserChoice::Own] {
            assert_eq!(Finish::of_pilots(choice).denoiser(), "own");
        }
        assert_eq!(Finish::of_pilots(DenoiserChoice::None).denoiser(), "none");
    }
}
