//! The finish: an estimate is denoised within the limits that its own standard errors set, and split into layers.
//!
//! 1. The estimate `M`: the single-bandwidth image, or the bandwidth levels combined by equation (6) of the 2021 paper
//!    if the user has asked for its network.
//! 2. The picture `D` that a denoiser makes of it ([`denoiser`]).
//! 3. `out = M + clip(D - M, -c s, c s)` ([`mod@bound`]), which is consistent for any `D`. The total light of the picture
//!    is kept (`conserve.rs`).
//! 4. The additive parts, finished so that they sum to the picture ([`parts`]).
//! 5. The error of the result, estimated from independent quarters of the iterations ([`FinishedError`]).
//!
//! Frames of an animation are averaged with their neighbours after step 2 ([`temporal`]).
//!
//! Input and output are named layers, so that a stored picture, also of another renderer, is finished like a new one.

pub mod bound;
mod conserve;
pub mod denoiser;
mod estimate;
mod finished_error;
pub mod parts;
pub mod statistical;
pub mod temporal;
mod window;

pub use bound::Clamped;
pub use denoiser::{Denoiser, DenoiserChoice, Quality, scratch};
pub use estimate::{Estimate, quarters};
pub use finished_error::{DEFAULT_CONVERGENCE_RATE, ErrorMap, FinishedError};
pub use window::{Windows, window};

use crate::combine::{Combiner, LevelStack};
use crate::error::Result;
use crate::film::kind::Use;
use crate::film::{
    CAUSTIC, LIGHT_GROUP, Layer, LayerSet, Picture, Size, finished_part, kind_of, lobe_names, part_names,
};
use bound::Noise;
use estimate::{alpha, own_level};
use finished_error::ErrorEstimator;
use parts::Part;

/// Bytes of memory per pixel that a finish without parts needs beside its layers: the estimates by all and by half of
/// the iterations, their pictures, the quarters, and the buffers of the error estimate.
pub const BYTES_PER_PIXEL: u64 = 384;
/// Bytes of memory per pixel that the finish needs for each additive part of the picture.
pub const BYTES_PER_PIXEL_OF_PART: u64 = 36;
/// Name of the layer with the estimated error of every pixel of the finished picture.
pub const ERROR: &str = "Error";

/// Whether finishing the picture alone, without its error and parts, reads the layer `name`.
pub fn reads_for_picture(name: &str) -> bool {
    kind_of(name).is_some_and(|(kind, _)| kind.finish == Some(Use::Picture))
}

/// Whether finishing the picture and estimating its error by quarters reads the layer `name`.
pub fn reads_for_error(name: &str) -> bool {
    kind_of(name).is_some_and(|(kind, _)| matches!(kind.finish, Some(Use::Picture | Use::Error)))
}

/// Whether the finish reads the layer `name` for the picture, its error, or its parts.
pub fn reads(name: &str) -> bool {
    reads_for_error(name) || finished_part(name).is_some()
}

/// The finish of renders: denoises pictures within the limits that their standard errors set, and splits them into
/// layers.
pub struct Finish {
    denoiser: Denoiser,
    /// Quality of Open Image Denoise.
    pub quality: Quality,
    network: Option<Combiner>,
}

/// The result of [`Finish::apply`], beside the layers.
#[derive(Clone, Debug)]
pub struct Finished {
    /// Number of bandwidth levels that the network has combined by equation (6); `None` without the network.
    pub combined: Option<usize>,
    /// Error of a picture finished from half of the iterations; `None` if the set lacks the quarters of the iterations.
    pub error: Option<FinishedError>,
    /// Errors of the pixels of the finished picture; `None` unless the layer [`ERROR`] is wanted.
    pub error_map: Option<ErrorMap>,
    /// Numbers of pixels that were clamped between zero and the brightest estimate around them.
    pub clamped: Clamped,
}

/// A layer's name and its picture.
type Named = (String, Picture);

/// An estimate, its denoised picture, and what the finish makes of half of the iterations.
struct Prepared {
    estimate: Estimate,
    denoised: Picture,
    /// The finished picture by the first half of the iterations; `None` if the quarters of the iterations are unknown.
    half: Option<Picture>,
    /// Number of bandwidth levels that the network has combined.
    combined: Option<usize>,
}

impl Finish {
    /// A finish by a denoiser, and by the network that combines bandwidth levels with equation (6), if there is one.
    pub fn new(denoiser: Denoiser, network: Option<Combiner>) -> Finish {
        Finish { denoiser, quality: Quality::High, network }
    }

    /// Name of the denoiser, with the version of Open Image Denoise.
    pub fn denoiser(&self) -> String {
        self.denoiser.name()
    }

    /// Finishes a grey picture at a quality of the denoiser, so that the caller can time it. The first call also loads
    /// the denoiser.
    ///
    /// # Errors
    /// The denoiser fails.
    pub fn warm_up(&mut self, size: Size, quality: Quality) -> Result<()> {
        let plane = || Picture::filled(size, [0.5; 3]);
        let (albedo, normal) = (Some(plane()), Some(plane()));
        let estimate = Estimate { mean: plane(), deviation: plane(), albedo, normal, alpha: None };
        let before = std::mem::replace(&mut self.quality, quality);
        let finished = self.picture(&estimate);
        self.quality = before;
        finished.map(|_| ())
    }

    /// Whether the denoiser has levels of quality, as Open Image Denoise has.
    pub fn has_qualities(&self) -> bool {
        matches!(self.denoiser, Denoiser::Oidn { .. })
    }

    /// The finished picture of an unfinished estimate.
    ///
    /// # Errors
    /// The denoiser fails.
    pub fn picture(&mut self, estimate: &Estimate) -> Result<Picture> {
        self.with_spread(estimate).map(|([picture, _], _)| picture)
    }

    /// The finished picture and the [spread](bound::spread) that limits its displacement, and the numbers of clamped
    /// pixels.
    fn with_spread(&mut self, estimate: &Estimate) -> Result<([Picture; 2], Clamped)> {
        let denoised = self.denoiser.run(estimate, self.quality)?;
        Ok(displaced(estimate, &denoised))
    }

    /// The estimate in a layer set, and the number of bandwidth levels that the network has combined to it.
    fn estimate(&mut self, set: &LayerSet) -> Result<(Estimate, Option<usize>)> {
        let mut estimate = Estimate::of(set)?;
        let Some(network) = &mut self.network else { return Ok((estimate, None)) };
        estimate.mean = network.run(&LevelStack::of(set)?)?;
        Ok((estimate, Some(network.metadata().levels)))
    }

    /// Finishes the picture of the layer set and makes the result its beauty; alpha stays. Adds `Error`,
    /// `CombinedDirect` and the other parts if the set has their sources and `wanted` accepts their names. The result
    /// does not depend on the number of threads, except as [`caustique_oidn`] says of Open Image Denoise.
    ///
    /// # Errors
    /// Layers are missing ([`Estimate::of`]), or the denoiser or the network fails; the set is unchanged then.
    pub fn apply(&mut self, set: &mut LayerSet, wanted: impl Fn(&str) -> bool) -> Result<Finished> {
        let (estimate, combined) = self.estimate(set)?;
        let denoised = self.denoiser.run(&estimate, self.quality)?;
        let half = quarters(set).map(|quarters| self.picture(&estimate.first_half(&quarters))).transpose()?;
        self.deliver(set, None, &Prepared { estimate, denoised, half, combined }, wanted)
    }

    /// Reads and denoises a frame of an animation for the temporal finish of itself and of its neighbours.
    ///
    /// # Errors
    /// Layers are missing ([`Estimate::of`]), motion vectors too, or the denoiser or the network fails.
    pub fn frame(&mut self, set: &LayerSet) -> Result<temporal::Frame> {
        let (estimate, combined) = self.estimate(set)?;
        let quarters = quarters(set);
        let mut half = None;
        if let Some(quarters) = &quarters {
            let estimate = estimate.first_half(quarters);
            let denoised = self.denoiser.run(&estimate, self.quality)?;
            half = Some([estimate.mean, denoised]);
        }
        let denoised = self.denoiser.run(&estimate, self.quality)?;
        let is_denoised = !matches!(self.denoiser, Denoiser::None);
        let pictures = temporal::Pictures { estimate, denoised, half, combined, is_denoised };
        temporal::Frame::new(set, pictures, quarters.as_ref())
    }

    /// Does the work of [`Finish::apply`] for the layer set of the frame in the middle of a window, averaged with its
    /// neighbours.
    ///
    /// # Errors
    /// As for [`Finish::apply`].
    pub fn apply_in_window(
        &mut self,
        set: &mut LayerSet,
        window: &temporal::Window<'_>,
        wanted: impl Fn(&str) -> bool,
    ) -> Result<Finished> {
        let Some((average, combined)) = temporal::average(window) else { return self.apply(set, wanted) };
        let half = average.half.map(|(estimate, denoised)| displaced(&estimate, &denoised).0[0].clone());
        let prepared = Prepared { estimate: average.estimate, denoised: average.denoised, half, combined };
        self.deliver(set, Some(&average.parts), &prepared, wanted)
    }

    /// Finishes the picture and makes it the beauty of the layer set, with its error and its parts. `parts` holds the
    /// parts of the estimate if it is not the set's own.
    fn deliver(
        &mut self,
        set: &mut LayerSet,
        parts: Option<&LayerSet>,
        prepared: &Prepared,
        wanted: impl Fn(&str) -> bool,
    ) -> Result<Finished> {
        let Prepared { estimate, denoised, half, combined } = prepared;
        let ([picture, spread], clamped) = displaced(estimate, denoised);
        let (error, error_map) =
            half.as_ref().and_then(|half| error_by_quarters(set, estimate, half, wanted(ERROR))).unzip();
        let error_map = error_map.flatten();
        let noise = Noise { estimate, spread: &spread };
        let parts = self.parts(parts.unwrap_or(set), &picture, noise, wanted)?;
        let alpha = alpha(set);
        set.layers.retain(|layer| layer.name != "Combined");
        set.push(match alpha {
            Some(alpha) => {
                let pixels = picture.into_iter().zip(alpha).map(|([r, g, b], a)| [r, g, b, a]);
                Layer::interleaved("", "RGBA", pixels)
            }
            None => Layer::interleaved("", "RGB", picture),
        })?;
        if let Some(map) = &error_map {
            set.layers.retain(|layer| layer.name != ERROR);
            // A large known error must not become infinity, which means unknown.
            let root = |square: f32| square.sqrt().min(f32::MAX);
            set.push(Layer::interleaved(ERROR, "RGB", map.squared().map(root)))?;
        }
        for (name, part) in parts {
            set.push(Layer::interleaved(name, "RGB", part))?;
        }
        Ok(Finished { combined: *combined, error, error_map, clamped })
    }

    /// The error of a picture finished from the first half of the iterations, by the second half; `None` if a quarter
    /// of the iterations is missing or black.
    ///
    /// # Errors
    /// Layers are missing, or the denoiser fails.
    pub fn estimate_error(&mut self, set: &LayerSet) -> Result<Option<FinishedError>> {
        let estimate = Estimate::of(set)?;
        let half = quarters(set).map(|quarters| self.picture(&estimate.first_half(&quarters))).transpose()?;
        Ok(half.and_then(|half| error_by_quarters(set, &estimate, &half, false)).map(|(error, _)| error))
    }

    /// The finished parts of the picture whose names are wanted, with their layers' names. Parts that together sum to
    /// the picture, or to its caustics, are all finished if one of them is wanted.
    fn parts(
        &mut self,
        set: &LayerSet,
        picture: &Picture,
        noise: Noise<'_>,
        wanted: impl Fn(&str) -> bool,
    ) -> Result<Vec<Named>> {
        let present = |names: &mut dyn Iterator<Item = &str>| -> Vec<Named> {
            names.filter_map(|name| Some((finished_part(name)?, set.picture(name)?))).collect()
        };
        let of_group =
            |prefix| present(&mut set.layers.iter().map(|layer| &*layer.name).filter(|name| name.starts_with(prefix)));
        let any = |parts: &[Named]| parts.iter().any(|(name, _)| wanted(name));
        let (effects, groups, caustics) = (present(&mut part_names()), of_group(LIGHT_GROUP), of_group(CAUSTIC));
        let mut finished = Vec::new();
        if any(&effects) || any(&caustics) {
            finished.extend(self.split(effects, picture, noise)?);
        }
        if any(&groups) {
            let groups = with_rest(groups, &noise.estimate.mean);
            finished.extend(self.split(groups, picture, noise)?);
        }
        // They sum to the picture only together. Other renderers have layers with some of these names.
        let lobes = present(&mut lobe_names());
        if lobes.len() == lobe_names().count() && any(&lobes) {
            finished.extend(self.split(lobes, picture, noise)?);
        }
        let whole = finished_part("Caustic").and_then(|name| finished.iter().find(|(part, _)| *part == name)).cloned();
        if let (true, Some((_, whole)), Some(mean)) = (any(&caustics), whole, set.picture("Caustic")) {
            let caustics = with_rest(caustics, &mean);
            finished.extend(self.split(caustics, &whole, noise)?);
        }
        finished.retain(|(name, _)| !name.is_empty() && wanted(name));
        Ok(finished)
    }

    /// Finishes named parts so that they sum to the picture `whole`, with the guides and standard errors of the whole
    /// picture.
    fn split(&mut self, parts: Vec<Named>, whole: &Picture, noise: Noise<'_>) -> Result<Vec<Named>> {
        let mut of_part = noise.estimate.clone();
        let (mut names, mut estimates) = (Vec::with_capacity(parts.len()), Vec::with_capacity(parts.len()));
        for (name, mean) in parts {
            of_part.mean = mean;
            // Directly visible lights are noisy at their edges only.
            let denoised = if of_part.mean.is_black() || ["CombinedEmission", "CombinedEmit"].contains(&&*name) {
                of_part.mean.clone()
            } else {
                // Parts are looked at less closely than the picture.
                self.denoiser.run(&of_part, Quality::Fast)?
            };
            names.push(name);
            estimates.push(Part { mean: std::mem::take(&mut of_part.mean), denoised });
        }
        let finished = parts::split(&estimates, whole, noise);
        Ok(names.into_iter().zip(finished).collect())
    }
}

/// An estimate after its bounded displacement towards its denoised picture, the [spread](bound::spread) that limits it,
/// and the numbers of clamped pixels.
fn displaced(estimate: &Estimate, denoised: &Picture) -> ([Picture; 2], Clamped) {
    let spread = bound::spread(estimate);
    let (picture, clamped) = conserve::bounded(&estimate.mean, denoised, Noise { estimate, spread: &spread });
    ([picture, spread], clamped)
}

/// The error of the picture `half`, finished from the first half of the iterations, with the errors of the pixels if they
/// are wanted; `None` if a quarter of the iterations is missing or black.
fn error_by_quarters(
    set: &LayerSet,
    estimate: &Estimate,
    half: &Picture,
    wants_map: bool,
) -> Option<(FinishedError, Option<ErrorMap>)> {
    let quarters = quarters(set)?;
    let own = own_level(set);
    let [own, larger] = [own, own + 1].map(|level| set.picture(&format!("Level{level}")));
    let levels = own.as_ref().zip(larger.as_ref()).map(|(own, larger)| [own, larger]);
    let estimator = ErrorEstimator { half, quarters: &quarters, deviation: &estimate.deviation, levels };
    Some(if wants_map {
        let (error, map) = estimator.error_and_map();
        (error, Some(map))
    } else {
        (estimator.error(), None)
    })
}

/// The light of light groups. If lights outside all groups have added any to `whole`, their light comes first, without
/// a name; the last part takes the remainder of rounding.
fn with_rest(mut groups: Vec<Named>, whole: &Picture) -> Vec<Named> {
    /// Largest share of the total light that counts as rounding.
    const ROUNDING: f64 = 1e-5;
    let rest = Picture::from_fn(whole.size(), |index| {
        std::array::from_fn(|c| {
            let known: f32 = groups.iter().map(|(_, group)| group[index][c]).sum();
            (whole[index][c] - known).max(0.0)
        })
    });
    let sum = |light: &Picture| light.iter().flatten().map(|value| f64::from(*value)).sum::<f64>();
    if sum(&rest) > ROUNDING * sum(whole) {
        groups.insert(0, (String::new(), rest));
    }
    groups
}
