//! The finish: an estimate is denoised within the limits that its own standard errors set, and split into layers.
//!
//! 1. The estimate `M`: the single-bandwidth image, or the bandwidth levels combined by equation (6) of the 2021 paper
//!    if the user has asked for its network.
//! 2. The picture `D` that a denoiser makes of it ([`denoiser`]) and of its additive parts, or that a network makes of
//!    these ([`network`]).
//! 3. `out = M + clip(D - M, -c s, c s)` ([`mod@bound`]), which is consistent for any `D`. The total light of the picture
//!    is kept (`conserve.rs`).
//! 4. The additive parts, finished so that they sum to the picture (`parts.rs`).
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
mod grey;
pub mod network;
mod parts;
pub mod statistical;
pub mod temporal;
mod window;

pub use bound::Clamped;
pub use denoiser::{Denoiser, DenoiserChoice, Quality, held};
pub use estimate::{Estimate, quarters};
pub use finished_error::{DEFAULT_CONVERGENCE_RATE, ErrorMap, FinishedError};
pub use parts::parts_to_finish;
pub use window::{Windows, window};

use crate::combine::model::OutputForm;
use crate::combine::{Combiner, LevelStack, Network};
use crate::error::{Error, Result};
use crate::estimator::QUARTERS;
use crate::film::kind::{SQUARED_BIAS, Use};
use crate::film::{Layer, LayerSet, Picture, Size, finished_part, is_effect, kind_of, part_names};
use crate::memory;
use crate::stop::Stop;
use crate::system;
use bound::Noise;
use estimate::{alpha, estimate_layers, own_level};
use finished_error::ErrorEstimator;
use network::{FinishNetwork, Planes};
use parts::{Named, NamedPart, color_of, lobe_colors, mean_with_parts, part_layers};
use rayon::prelude::*;

/// Bytes per pixel of a finish without parts, beside its layers and the memory of the denoiser: the estimates by all and
/// by half of the iterations, their pictures, the quarters, and the buffers of the error estimate.
const BYTES_PER_PIXEL: u64 = 250;
/// Bytes per pixel of a finish when it splits the picture into parts: the estimate, the picture and its noise.
const BYTES_PER_PIXEL_WITH_PARTS: u64 = 120;
/// Bytes per pixel of each additive part of the picture: its estimate, denoised and finished.
const BYTES_PER_PIXEL_OF_PART: u64 = 36;
/// Bytes per pixel of each part that the picture is made of: its estimate, and denoised.
const BYTES_PER_PIXEL_OF_EFFECT: u64 = 24;
/// Bytes per pixel of the error that is estimated between iterations.
const BYTES_PER_PIXEL_OF_ERROR: u64 = 180;
/// Bytes of the code of the denoiser's library.
const LIBRARY_BYTES: u64 = 12 << 20;
/// Address space that the library and its threads reserve and do not use. A bound found by lowering `ulimit -v`
/// (`no_limit_of_memory_aborts` in `tests/cli/limits.rs`).
const LIBRARY_ADDRESSES: u64 = 132 << 20;
/// Name of the layer with the estimated error of every pixel of the finished picture.
pub const ERROR: &str = "Error";

/// Whether finishing the picture alone, without its error and the parts that are delivered, reads the layer `name`.
pub fn reads_for_picture(name: &str) -> bool {
    is_effect(name) || reads_for_preview(name)
}

/// Whether finishing a preview reads the layer `name`.
pub fn reads_for_preview(name: &str) -> bool {
    kind_of(name).is_some_and(|(kind, _)| kind.finish == Some(Use::Picture))
}

/// Whether estimating the error of the finished picture by quarters, which is made without parts, reads the layer `name`.
pub fn reads_for_error(name: &str) -> bool {
    kind_of(name).is_some_and(|(kind, _)| matches!(kind.finish, Some(Use::Picture | Use::Error)))
}

/// Whether the finish reads the layer `name` for the picture, its error, or its parts.
pub fn reads(name: &str) -> bool {
    reads_for_error(name) || finished_part(name).is_some()
}

/// Bytes that the library of the denoiser takes as long as it is loaded.
pub fn library_bytes() -> u64 {
    LIBRARY_BYTES + if system::counts_unused_addresses() { LIBRARY_ADDRESSES } else { 0 }
}

/// Bytes that a finish of a picture of `pixels` pixels takes besides its layers and the library. `parts`: number of its
/// additive parts.
pub fn bytes(pixels: u64, parts: u64, denoiser: DenoiserChoice) -> u64 {
    let effects = parts.min(part_names().count() as u64);
    let of_picture = BYTES_PER_PIXEL + effects * BYTES_PER_PIXEL_OF_EFFECT;
    let with_parts = BYTES_PER_PIXEL_WITH_PARTS + parts * BYTES_PER_PIXEL_OF_PART;
    held(pixels, denoiser) + pixels * of_picture.max(with_parts)
}

/// Bytes that the estimate of a finished picture's error takes between iterations, besides its layers and the library.
pub fn bytes_for_error(pixels: u64, denoiser: DenoiserChoice) -> u64 {
    held(pixels, denoiser) + pixels * BYTES_PER_PIXEL_OF_ERROR
}

/// The finish of renders: denoises pictures within the limits that their standard errors set, and splits them into
/// layers.
pub struct Finish {
    denoiser: Denoiser,
    /// Whether the finished picture is the denoised one, without a bound on the displacement.
    unbounded: bool,
    /// Whether pictures are previews, which should be ready soon: not bounded, and guides keep their noise.
    pub preview: bool,
    /// Quality of Open Image Denoise.
    pub quality: Quality,
    /// Ends a run of Open Image Denoise early, which is an error then; `None`: each run goes to its end.
    pub stop: Option<Stop>,
    /// The network that combines bandwidth levels to the estimate; `None` without one.
    combiner: Option<Combiner>,
    /// The network that makes the picture towards which the estimate moves; `None`: that is the denoised picture.
    network: Option<FinishNetwork>,
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

/// A combination of bandwidth levels by a network.
struct Combination {
    /// Number of the levels.
    levels: usize,
    /// The estimate before.
    noisy: Picture,
}

/// An estimate that [`Finish::deliver`] finishes.
pub struct Prepared {
    estimate: Estimate,
    denoised: Picture,
    /// The finished picture by the first half of the iterations; `None` if the quarters of the iterations are unknown.
    half: Option<Picture>,
    /// Number of bandwidth levels that the network has combined.
    combined: Option<usize>,
    /// The estimate that the additive parts sum to, if it is not `estimate`; `None` also if it is unknown.
    noisy: Option<Picture>,
    /// The additive parts by effect, as far as they are denoised already.
    effects: Vec<NamedPart>,
    /// The other additive parts of the estimate that are finished too.
    parts: Vec<Named>,
    /// The layers [`LOBE_COLORS`] of the frame.
    colors: Vec<Named>,
}

impl Prepared {
    /// These pictures, with the colours of lobes from the layers of the frame. Where a lobe's colour is black and the
    /// frame itself has no light in it, light of other frames is taken from it.
    #[must_use]
    pub fn with_colors_of(mut self, set: &LayerSet) -> Prepared {
        self.colors = lobe_colors(set);
        for (name, part) in &mut self.parts {
            let Some((color, own)) = color_of(name, &self.colors).zip(set.picture(name)) else { continue };
            part.par_iter_mut().enumerate().for_each(|(index, value)| {
                for c in (0..3).filter(|c| color[index][*c] <= 0.0 && own[index][*c] <= 0.0) {
                    value[c] = 0.0;
                }
            });
        }
        self
    }
}

/// Pictures from which [`Finish::deliver`] estimates the error of the finished picture.
pub struct ErrorSource {
    quarters: [Picture; QUARTERS],
    /// The method's own bandwidth level and the next larger one, if the picture has both.
    levels: Option<[Picture; 2]>,
    /// Squared bias of merging with one bandwidth, if the picture has this layer.
    squared_bias: Option<Picture>,
}

impl ErrorSource {
    /// The pictures in a layer set whose own bandwidth level is number `level`; `None` if a quarter of the iterations is
    /// missing or black.
    fn of(set: &LayerSet, level: usize) -> Option<ErrorSource> {
        let quarters = quarters(set)?;
        let [own, larger] = level_names(level).map(|name| set.picture(&name));
        let levels = own.zip(larger).map(|(own, larger)| [own, larger]);
        Some(ErrorSource { quarters, levels, squared_bias: set.picture(SQUARED_BIAS) })
    }

    /// The pictures in a file. `header` holds its layers, with or without values; `read` reads the named ones.
    ///
    /// # Errors
    /// Errors of `read`.
    pub fn read(header: &LayerSet, read: impl FnOnce(&[String]) -> Result<LayerSet>) -> Result<Option<ErrorSource>> {
        let level = own_level(header);
        let quarters = (1..=QUARTERS).map(|k| format!("Quarter{k}"));
        let names: Vec<String> = quarters.chain(level_names(level)).chain([SQUARED_BIAS.into()]).collect();
        Ok(ErrorSource::of(&read(&names)?, level))
    }
}

/// Names of the layers of a bandwidth level and of the next larger one.
fn level_names(level: usize) -> [String; 2] {
    [level, level + 1].map(|level| format!("Level{level}"))
}

/// A finished picture with its parts and its error.
pub struct FinishedPicture {
    picture: Picture,
    /// Finished parts, under the names of their layers.
    parts: Vec<Named>,
    account: Finished,
}

impl FinishedPicture {
    /// Whether [`FinishedPicture::insert_into`] replaces the layer `name` without reading it.
    pub fn replaces(&self, name: &str) -> bool {
        (name == ERROR && self.account.error_map.is_some()) || self.parts.iter().any(|(part, _)| part == name)
    }

    /// Makes the picture the beauty of a layer set; alpha stays. Adds its error and its parts.
    ///
    /// # Errors
    /// The set has another size.
    pub fn insert_into(self, set: &mut LayerSet) -> Result<Finished> {
        let FinishedPicture { picture, parts, account } = self;
        let alpha = alpha(set);
        set.layers.retain(|layer| layer.name != "Combined");
        set.push(match alpha {
            Some(alpha) => {
                let pixels = picture.into_iter().zip(alpha).map(|([r, g, b], a)| [r, g, b, a]);
                Layer::interleaved("", "RGBA", pixels)
            }
            None => Layer::interleaved("", "RGB", picture),
        })?;
        if let Some(map) = &account.error_map {
            set.layers.retain(|layer| layer.name != ERROR);
            // A large known error must not become infinity, which means unknown.
            let root = |square: f32| square.sqrt().min(f32::MAX);
            set.push(Layer::interleaved(ERROR, "RGB", map.squared().map(root)))?;
        }
        for (name, part) in parts {
            set.push(Layer::interleaved(name, "RGB", part))?;
        }
        Ok(account)
    }
}

impl Finish {
    /// A finish by the chosen denoiser ([`Denoiser::open`]), and by a network, if there is one: it combines bandwidth
    /// levels with equation (6), or is one of the finish.
    ///
    /// # Errors
    /// As for [`Denoiser::open`].
    pub fn open(choice: DenoiserChoice, network: Option<Network>) -> Result<(Finish, Option<Error>)> {
        let (denoiser, missing) = Denoiser::open(choice)?;
        let unbounded = choice == DenoiserChoice::Full;
        let is_picture = |network: &Network| network.metadata().form == OutputForm::Picture;
        let (network, combiner) = match network {
            Some(network) if is_picture(&network) => (Some(FinishNetwork::new(network)), None),
            other => (None, other.map(Combiner::new)),
        };
        let (preview, quality, stop) = (false, Quality::High, None);
        Ok((Finish { denoiser, unbounded, preview, quality, stop, combiner, network }, missing))
    }

    /// Bytes that a finish of a picture of `pixels` pixels and `parts` additive parts takes besides its layers.
    fn bytes(&self, pixels: u64, parts: u64) -> u64 {
        let of_network = if self.network.is_some() { network::bytes(pixels) } else { 0 };
        bytes(pixels, parts, self.denoiser.choice()) + of_network
    }

    /// Checks that there is memory to finish a layer set, as far as its size and its `parts` parts decide.
    fn require_memory(&self, set: &LayerSet, parts: usize) -> Result<()> {
        let (width, height) = (set.width, set.height);
        let needed = self.bytes(width as u64 * height as u64, parts as u64);
        let outcome = memory::require(needed, format_args!("finishing {width} x {height} pixels with {parts} parts"));
        outcome.map_err(|error| error.hint("finish the picture where more memory is free, or with fewer --layers"))
    }

    /// Name of the denoiser, with the version of Open Image Denoise, and whether its pictures are not bounded.
    pub fn denoiser(&self) -> String {
        self.denoiser.name() + if self.unbounded { ", unbounded" } else { "" }
    }

    /// Cleans the guides of a grey picture, so that the caller can time it. The first call also loads the denoiser.
    ///
    /// # Errors
    /// The denoiser fails.
    pub fn warm_up_guides(&mut self, size: Size) -> Result<()> {
        self.denoiser.clean_guides(&mut grey(size), self.stop.as_ref())
    }

    /// Finishes a grey picture at a quality of the denoiser, so that the caller can time it. The first call also loads
    /// the denoiser.
    ///
    /// # Errors
    /// The denoiser fails.
    pub fn warm_up(&mut self, size: Size, quality: Quality) -> Result<()> {
        let before = std::mem::replace(&mut self.quality, quality);
        let finished = self.picture(&grey(size));
        self.quality = before;
        finished.map(|_| ())
    }

    /// Runs the network of the finish, if there is one, on a grey picture, so that the caller can time it.
    ///
    /// # Errors
    /// The network fails.
    pub fn warm_up_network(&mut self, size: Size) -> Result<()> {
        self.network.as_mut().map_or(Ok(()), |network| network.warm_up(size))
    }

    /// Whether the denoiser has levels of quality, as Open Image Denoise has.
    pub fn has_qualities(&self) -> bool {
        matches!(self.denoiser, Denoiser::Oidn { .. })
    }

    /// The finished picture of an unfinished estimate, without its parts and the network.
    ///
    /// # Errors
    /// The denoiser fails.
    pub fn picture(&mut self, estimate: &Estimate) -> Result<Picture> {
        self.half(estimate, None)
    }

    /// The finished picture of an estimate whose additive parts are unknown, such as one by half of the iterations.
    fn half(&mut self, estimate: &Estimate, planes: Option<&Planes>) -> Result<Picture> {
        let denoised = self.denoised(estimate, &[], planes)?;
        let ([picture, _], _) = self.displaced(estimate, &denoised);
        Ok(picture)
    }

    /// The picture towards which an estimate with these `effects`, or of unknown parts, moves: the mean of the denoised
    /// picture and of the sum of its denoised parts, or that of the network, which reads both and `planes`.
    fn denoised(&mut self, estimate: &Estimate, effects: &[NamedPart], planes: Option<&Planes>) -> Result<Picture> {
        let whole = self.denoiser.run(estimate, self.quality, self.stop.as_ref())?;
        let mean = (!effects.is_empty()).then(|| mean_with_parts(&whole, effects));
        match (&mut self.network, planes) {
            (Some(network), Some(planes)) => network.run(planes, estimate, &whole, mean.as_ref()),
            _ => Ok(mean.unwrap_or(whole)),
        }
    }

    /// An estimate after its bounded displacement towards its denoised picture, the [spread](bound::spread) that limits
    /// it, and the numbers of clamped pixels.
    fn displaced(&self, estimate: &Estimate, denoised: &Picture) -> ([Picture; 2], Clamped) {
        let spread = bound::spread(estimate);
        let (picture, clamped) = conserve::bounded(&estimate.mean, denoised, self.noise(estimate, &spread));
        ([picture, spread], clamped)
    }

    fn noise<'a>(&self, estimate: &'a Estimate, spread: &'a Picture) -> Noise<'a> {
        let noise = Noise::new(estimate, spread);
        if self.unbounded || self.preview { Noise { limit: f32::INFINITY, ..noise } } else { noise }
    }

    /// The estimate in a layer set, and what the network of the finish reads beside it. The guides of the estimate have
    /// no noise, unless it is for a preview, which does without the network.
    fn guided(&mut self, set: &LayerSet) -> Result<(Estimate, Option<Planes>)> {
        let mut estimate = Estimate::of(set)?;
        if self.preview {
            return Ok((estimate, None));
        }
        let planes = self.network.as_ref().map(|_| Planes::of(set, &estimate)).transpose()?;
        self.denoiser.clean_guides(&mut estimate, self.stop.as_ref())?;
        Ok((estimate, planes))
    }

    /// [`guided`](Self::guided), and what a network has done if it has combined bandwidth levels to the estimate.
    fn estimate(&mut self, set: &LayerSet) -> Result<(Estimate, Option<Planes>, Option<Combination>)> {
        let (mut estimate, planes) = self.guided(set)?;
        let Some(combiner) = &mut self.combiner else { return Ok((estimate, planes, None)) };
        let noisy = std::mem::replace(&mut estimate.mean, combiner.run(&LevelStack::of(set)?)?);
        Ok((estimate, planes, Some(Combination { levels: combiner.metadata().levels, noisy })))
    }

    /// Finishes the picture of the layer set and makes the result its beauty; alpha stays. Adds `Error`,
    /// `CombinedDirect` and the other parts if the set has their sources and `wanted` accepts their names. The result
    /// does not depend on the number of threads, except as [`caustique_oidn`] says of Open Image Denoise.
    ///
    /// # Errors
    /// Layers are missing ([`Estimate::of`]), or the denoiser or the network fails; the set is unchanged then.
    pub fn apply(&mut self, set: &mut LayerSet, wanted: impl Fn(&str) -> bool) -> Result<Finished> {
        let names = parts_to_finish(set, &wanted);
        let of_picture = set.layers.iter().filter(|layer| is_effect(&layer.name)).count();
        self.require_memory(set, names.len().max(of_picture))?;
        let (estimate, planes, combined) = self.estimate(set)?;
        let effects = self.effects(set, &estimate)?;
        let denoised = self.denoised(&estimate, &effects, planes.as_ref())?;
        let of_half = quarters(set).map(|quarters| estimate.first_half(&quarters));
        let half = of_half.map(|of_half| self.half(&of_half, planes.as_ref())).transpose()?;
        drop(planes);
        let others = names.into_iter().filter(|name| effects.iter().all(|(effect, _)| effect != name));
        let parts = others.filter_map(|name| set.picture(&name).map(|picture| (name, picture))).collect();
        let error = ErrorSource::of(set, own_level(set));
        let (combined, noisy) = combined.map(|Combination { levels, noisy }| (levels, noisy)).unzip();
        let prepared = Prepared { estimate, denoised, half, combined, noisy, effects, parts, colors: lobe_colors(set) };
        self.deliver(prepared, error, wanted)?.insert_into(set)
    }

    /// Names of the layers of a set, which may lack its values, that [`Finish::frame`] reads.
    pub fn frame_layers(&self, set: &LayerSet) -> Vec<String> {
        let has_network = self.combiner.is_some() || self.network.is_some();
        let by_network = |name: &str| has_network && reads_for_error(name);
        let of_network = set.layers.iter().filter(|layer| by_network(&layer.name));
        let layers = estimate_layers(set).chain(temporal::motion_layers(set)).chain(part_layers(set)).chain(of_network);
        layers.map(|layer| layer.name.clone()).collect()
    }

    /// Checks that there is memory for `frames` more frames like a set, which may lack its values, and to finish one.
    ///
    /// # Errors
    /// There is not.
    pub fn check_memory_of_frames(&self, set: &LayerSet, frames: usize) -> Result<()> {
        let (width, height) = (set.width, set.height);
        let (pixels, parts) = (width as u64 * height as u64, part_layers(set).count() as u64);
        let channels = set.layers.iter().map(|layer| layer.planes.len() as u64).sum::<u64>();
        let held = frames as u64 * pixels * temporal::bytes_per_pixel(parts);
        // The layers that the finish leaves as they are come last.
        let needed = held + self.bytes(pixels, parts).max(4 * channels * pixels);
        let outcome = memory::require(needed, format_args!("{frames} frames of {width} x {height} pixels"));
        outcome.map_err(|error| error.hint("finish the frames where more memory is free, or with fewer --layers"))
    }

    /// Reads and denoises a frame of an animation for the temporal finish of itself and of its neighbours.
    ///
    /// # Errors
    /// Layers are missing ([`Estimate::of`]), motion vectors too, or the denoiser or the network fails.
    pub fn frame(&mut self, set: LayerSet) -> Result<temporal::Frame> {
        self.require_memory(&set, part_layers(&set).count())?;
        let (estimate, planes, combined) = self.estimate(&set)?;
        let quarters = quarters(&set);
        let motion = temporal::motion(&set)?;
        let parts = part_layers(&set).map(|layer| (layer.name.clone(), set.picture_of(layer))).collect();
        let effects = self.effects(&set, &estimate)?;
        let correlation = temporal::correlation(set.size(), quarters.as_ref());
        // The denoiser runs without the layers in memory.
        drop(set);
        let mut half = None;
        if let Some(quarters) = quarters {
            let of_half = estimate.first_half(&quarters);
            drop(quarters);
            let denoised = self.denoised(&of_half, &[], planes.as_ref())?;
            half = Some([of_half.mean, denoised]);
        }
        let denoised = self.denoised(&estimate, &effects, planes.as_ref())?;
        let is_denoised = !matches!(self.denoiser, Denoiser::None);
        let combined = combined.map(|combination| combination.levels);
        let pictures = temporal::Pictures { estimate, denoised, half, combined, is_denoised };
        Ok(temporal::Frame::new(pictures, parts, motion, correlation))
    }

    /// Averages the frame in the middle of a window with its neighbours, and the additive parts with these names; `None` if
    /// the middle is empty.
    pub fn average(&self, window: &temporal::Window<'_>, parts: &[String]) -> Option<Prepared> {
        let finish_half = |estimate: &Estimate, denoised: &Picture| {
            let ([picture, _], _) = self.displaced(estimate, denoised);
            picture
        };
        let average = temporal::average(window, finish_half, parts)?;
        let temporal::Averaged { estimate, denoised, combined, half, parts } = average;
        let (effects, colors) = (Vec::new(), Vec::new());
        Some(Prepared { estimate, denoised, half, combined, noisy: None, effects, parts, colors })
    }

    /// Finishes an estimate and its parts, and estimates the error. `wanted` accepts the names of layers to make.
    ///
    /// # Errors
    /// The denoiser fails.
    pub fn deliver(
        &mut self,
        prepared: Prepared,
        error: Option<ErrorSource>,
        wanted: impl Fn(&str) -> bool,
    ) -> Result<FinishedPicture> {
        let Prepared { estimate, denoised, half, combined, noisy, effects, parts, colors } = prepared;
        let error = half.zip(error).map(|(half, source)| error_by_quarters(&source, &estimate, &half, wanted(ERROR)));
        let (error, error_map) = error.unzip();
        let ([picture, spread], clamped) = self.displaced(&estimate, &denoised);
        drop(denoised);
        let noise = self.noise(&estimate, &spread);
        let sum = noisy.as_ref().or(combined.is_none().then_some(&estimate.mean));
        let parts = self.parts((effects, parts), sum, &colors, &picture, noise, wanted)?;
        let account = Finished { combined, error, error_map: error_map.flatten(), clamped };
        Ok(FinishedPicture { picture, parts, account })
    }

    /// The error of a picture finished from the first half of the iterations, by the second half; `None` if a quarter
    /// of the iterations is missing or black.
    ///
    /// # Errors
    /// Layers are missing, or the denoiser fails.
    pub fn estimate_error(&mut self, set: &LayerSet) -> Result<Option<FinishedError>> {
        let (estimate, planes) = self.guided(set)?;
        let of_half = quarters(set).map(|quarters| estimate.first_half(&quarters));
        let half = of_half.map(|of_half| self.half(&of_half, planes.as_ref())).transpose()?;
        let source = ErrorSource::of(set, own_level(set));
        Ok(half.zip(source).map(|(half, source)| error_by_quarters(&source, &estimate, &half, false).0))
    }
}

/// A grey picture with guides.
fn grey(size: Size) -> Estimate {
    let plane = || Picture::filled(size, [0.5; 3]);
    let (albedo, normal) = (Some(plane()), Some(plane()));
    Estimate { mean: plane(), deviation: plane(), albedo, normal, clean_guides: true, alpha: None, samples: None }
}

/// The error of the picture `half`, finished from the first half of the iterations, with the errors of the pixels if they
/// are wanted.
fn error_by_quarters(
    source: &ErrorSource,
    estimate: &Estimate,
    half: &Picture,
    wants_map: bool,
) -> (FinishedError, Option<ErrorMap>) {
    let ErrorSource { quarters, levels, squared_bias } = source;
    let levels = levels.as_ref().map(|levels| levels.each_ref());
    let squared_bias = squared_bias.as_ref();
    let estimator = ErrorEstimator { half, quarters, deviation: &estimate.deviation, levels, squared_bias };
    if wants_map {
        let (error, map) = estimator.error_and_map();
        (error, Some(map))
    } else {
        (estimator.error(), None)
    }
}
