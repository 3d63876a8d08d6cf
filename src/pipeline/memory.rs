//! Estimates the memory of a render before it begins, and refuses a render that does not fit.

use super::layers::LayerCounts;
use crate::error::{Error, Result};
use crate::estimator::PixelAccumulator;
use crate::estimator::rule::{adaptive, chi_squared, local};
use crate::film::Selection;
use crate::film::output::Shape;
use crate::finish::{self, DenoiserChoice};
use crate::memory;
use crate::plan::Search;
use crate::render::output::layer_shape;
use crate::render::{
    BandwidthRule, Counts, MAX_TECHNIQUES, MIN_ITERATIONS_FOR_ERROR, PHOTON_BYTES, Settings, ShardResult, WHOLE_TILE,
    bytes_per_whole_tile, photons_per_path as mean_photons, sample_bytes,
};
use crate::scene::View;
use crate::transport::{FirstScatter, MergePhoton, Splat};
use std::cell::OnceCell;
use std::fmt::Display;
use std::mem::size_of;

/// Bytes per photon of methods that merge, which carries the terms of its MIS weight: as traced, joined and sorted in
/// this iteration, and in the map of the last iteration.
const MERGED_BYTES: u64 = 5 * size_of::<MergePhoton>() as u64 + 32;

/// Bytes per vertex of a light path that sends light to the film: lists grow to twice their length, and are sorted.
const SPLAT_BYTES: u64 = 2 * size_of::<Splat>() as u64 + 8;

/// Bytes per pixel of the weighted and the unweighted picture of one sampling technique.
const BYTES_PER_TECHNIQUE: u64 = 24;

/// Smallest number of light paths per iteration that a limit on memory may leave.
const MIN_PHOTONS: u64 = 1000;

/// Share of the free memory that photons may take if it does not hold all: other programs take memory meanwhile.
const FREE_SHARE: f64 = 0.75;

/// Mean number of photons per light path above which messages name `--max-depth`. Closed white rooms have thousands.
const LONG_PATH: f64 = 64.0;

/// Bytes per pixel of the objects that each pixel shows, which name the places of the largest errors.
const VISIBLE_BYTES: u64 = 72;

/// Bytes of light paths, Markov chains and the numbers of their pixels, per pixel and per vertex of a path of a chain,
/// which has two more vertices than a light path.
const CHAIN_BYTES: f64 = 70.0;

/// Bytes per pixel of the freed sums of bandwidth levels, light groups and lobes that a finish uses again. The allocator
/// keeps the rest, because they are small pieces.
const REUSED_BYTES: u64 = 150;

/// Memory of photons over that of their map: the allocator keeps the lists in which threads have left them.
const PHOTON_LISTS: f64 = 1.25;

/// The sizes that the memory of a render depends on, besides its settings.
#[derive(Clone, Copy)]
struct Extent {
    /// Width and height of the window that is rendered (pixels).
    film: (u32, u32),
    /// Width and height of the whole picture (pixels).
    whole: (u32, u32),
    /// Layers of the EXR.
    layers: LayerCounts,
    /// Number of light groups (lights with layers of their own).
    groups: usize,
    /// Whether light is recorded by the lobe of the first hit.
    lobes: bool,
    /// Mean number of photons that a light path stores.
    photons_per_path: f64,
    /// Number of kinds of photons with bandwidths.
    kinds: usize,
    /// The denoiser that the user asks for; `None` without a finish.
    finish: Option<DenoiserChoice>,
}

impl Extent {
    fn with_photons(
        view: View<'_>,
        settings: &Settings,
        (layers, finish): (&Selection, Option<DenoiserChoice>),
        photons_per_path: f64,
    ) -> Extent {
        let [film, whole] = view.camera.sizes();
        let groups = view.scene.lights.groups().names.len();
        let layers = LayerCounts::new(&layer_shape(settings, view.scene), layers, finish.is_some());
        let kinds = settings.bandwidth_kinds(&view.scene.survey).iter().filter(|there| **there).count().max(1);
        Extent { film, whole, layers, groups, lobes: settings.lobes, photons_per_path, kinds, finish }
    }

    /// Words of a hint that name the length of light paths if they are long; empty otherwise.
    fn long_paths(&self) -> String {
        let photons = self.photons_per_path;
        if photons < LONG_PATH {
            return String::new();
        }
        format!(", or --max-depth {LONG_PATH} for shorter light paths (they have {photons:.0} vertices on average)")
    }

    /// Largest number of bytes that the render takes at a time, without the libraries: for an iteration, for the error
    /// of the finished picture between iterations, for the layers beside the sums, or for the finish.
    fn bytes(&self, settings: &Settings) -> u64 {
        let [across, down] = [self.whole.0, self.whole.1].map(|side| u64::from(side.div_ceil(WHOLE_TILE)));
        let walks_whole_picture = settings.method.walks_whole_picture();
        let tiles = if walks_whole_picture { across * down * bytes_per_whole_tile() } else { 0 };
        let (pixels, map, lists) = (pixels(self.film), self.bytes_of_map(settings), self.light_lists(settings));
        let sums =
            PixelAccumulator::bytes(settings.levels.count, settings.merges_one_level(), self.groups, self.lobes) as u64;
        // An upper bound: most scenes leave some of the techniques without a picture.
        let techniques = if settings.techniques { MAX_TECHNIQUES as u64 * BYTES_PER_TECHNIQUE } else { 0 };
        let [layers, of_error] = [self.layers.channels, self.layers.channels_of_error].map(|n| 4 * n as u64);
        let motion = if self.layers.motion { 16 } else { 0 };
        let bandwidths = bytes_of_bandwidths(settings, self.kinds);
        let between = sums + sample_bytes(settings) as u64 + 2 * bandwidths + techniques + motion + lists;
        let kept_between = pixels * between + map + tiles;
        // Measured: an iteration that only merges takes the memory of its light paths twice.
        let again = if settings.method.search() == Search::Merging { lists } else { 0 };
        let iterating = kept_between + pixels * again;
        let kept = pixels * (sums + bandwidths + techniques + motion + layers + lists / 2) + map;
        let Some(denoiser) = self.finish else { return iterating.max(kept) };
        let parts = self.layers.parts as u64;
        let pieces = match settings.is_shard() {
            true => sums,
            false => (sums - size_of::<PixelAccumulator>() as u64).saturating_sub(REUSED_BYTES) + lists / 2,
        };
        let finishing = pixels * (layers + motion + VISIBLE_BYTES + pieces) + finish::bytes(pixels, parts, denoiser);
        let estimates = settings.iterations_of_shard().is_none_or(|n| n >= MIN_ITERATIONS_FOR_ERROR);
        // The denoiser keeps its memory for the next estimate.
        let (estimating, held) = match estimates {
            true => (
                kept_between + pixels * of_error + finish::bytes_for_error(pixels, denoiser),
                finish::held(pixels, denoiser),
            ),
            false => (0, 0),
        };
        iterating.max(estimating).max(kept + pixels * VISIBLE_BYTES + held).max(finishing)
    }

    /// Bytes of the photon map while it is built.
    fn bytes_of_map(&self, settings: &Settings) -> u64 {
        let bytes = (f64::from(settings.photons) * self.photons_per_path * PHOTON_LISTS * PHOTON_BYTES as f64) as u64;
        match settings.method {
            method if method.has_one_map() => settings.photon_memory.min(bytes),
            method if method.takes_photon_count() => bytes,
            _ => 0,
        }
    }

    /// Bytes per pixel of the light paths that methods without a number of photons send for each pixel.
    fn light_lists(&self, settings: &Settings) -> u64 {
        let method = settings.method;
        let light_paths = settings.counts.light_paths_per_pixel() * if settings.levels.two_paths { 2.0 } else { 1.0 };
        let vertices = light_paths * self.photons_per_path;
        if method.has_chains() {
            return (CHAIN_BYTES * (2.0 + vertices)) as u64;
        }
        let merges = method.has_bandwidths() && !method.takes_photon_count() && !method.has_one_map();
        let merged = if merges { (vertices * MERGED_BYTES as f64) as u64 } else { 0 };
        // On average a window receives one light path per pixel, as the whole picture does.
        let connects = method.walks_whole_picture() || method.search() == Search::ConnectionsAndMerging;
        let splat_bytes = SPLAT_BYTES + if self.lobes { 2 * size_of::<FirstScatter>() as u64 } else { 0 };
        merged + if connects { (vertices * splat_bytes as f64) as u64 } else { 0 }
    }
}

fn pixels((width, height): (u32, u32)) -> u64 {
    u64::from(width) * u64::from(height)
}

/// Bytes per pixel for its bandwidths and photon counts, for a number of `kinds` of photons.
fn bytes_of_bandwidths(settings: &Settings, kinds: usize) -> u64 {
    let cells = settings.chi_squared.annuli * settings.chi_squared.sectors;
    let state = match settings.bandwidth_rule() {
        Some(BandwidthRule::ChiSquared) => {
            // Guided light paths also need the largest weight of each cell's photons.
            size_of::<chi_squared::Bandwidth>() + (cells + usize::from(settings.guided)) * size_of::<u32>()
        }
        Some(BandwidthRule::Adaptive) => size_of::<adaptive::Bandwidth>(),
        Some(BandwidthRule::Local) => size_of::<local::Bandwidth>(),
        Some(BandwidthRule::Memoryless) | None => 0,
    };
    let channels = if settings.has_channels() { 3 } else { 1 };
    (settings.levels.count * channels * kinds * state) as u64
}

/// Checks that there is memory to merge the shards of a render, and to finish its picture by `finish`.
///
/// # Errors
/// There is not.
pub(super) fn check_merge(
    part: &ShardResult,
    shape: &Shape,
    selection: &Selection,
    finish: Option<DenoiserChoice>,
) -> Result<()> {
    let ((width, height), pixels) = (part.size, pixels(part.size));
    let layers = LayerCounts::new(shape, selection, finish.is_some());
    let sums =
        PixelAccumulator::bytes(part.settings.levels.count, shape.merges, shape.groups.len(), shape.lobes) as u64;
    let channels = 4 * layers.channels as u64;
    let pieces = (sums - size_of::<PixelAccumulator>() as u64).saturating_sub(REUSED_BYTES);
    let joined = pixels * (sums + channels);
    let needed = finish.map_or(joined, |denoiser| {
        let finishing =
            pixels * (channels + VISIBLE_BYTES + pieces) + finish::bytes(pixels, layers.parts as u64, denoiser);
        finish::library_bytes() + (joined + pixels * VISIBLE_BYTES).max(finishing)
    });
    let outcome = memory::require(needed, format_args!("the sums and layers of {width} x {height} pixels"));
    outcome.map_err(|error| error.hint("merge where more memory is free, or with --no-finish"))
}

/// A limit on the memory of photons, pixels and layers, set by the user.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryLimit {
    /// Most bytes that they may take.
    pub bytes: u64,
}

impl MemoryLimit {
    /// Changes the settings so that they keep to the limit, and returns a warning of what they go without. Only the
    /// photons can shrink: the light paths per iteration or per pixel, or the one map of `pm`.
    fn fit(self, extent: Extent, settings: Settings, method: &str) -> Result<(Settings, Option<String>)> {
        let whole = extent.bytes(&settings);
        if whole <= self.bytes {
            return Ok((settings, None));
        }
        let (fitted, less) = self.shrink(extent, &settings).map_err(|least| self.refuse(extent.film, method, least))?;
        Ok((fitted, Some(format!("--memory {}: {less}", self.bytes >> 20))))
    }

    /// Settings with the largest number of light paths or photons that fits the limit, and a message with that number.
    ///
    /// # Errors
    /// The bytes that the render needs at least, which are more than the limit.
    fn shrink(self, extent: Extent, settings: &Settings) -> std::result::Result<(Settings, String), u64> {
        let method = settings.method;
        let with = |number: u64| match method {
            _ if method.has_one_map() => Settings { photon_memory: number, ..settings.clone() },
            _ if method.takes_photon_count() => Settings { photons: number as u32, ..settings.clone() },
            _ => Settings { counts: Counts { light_paths: number as u32, ..settings.counts }, ..settings.clone() },
        };
        let (least, asked) = match method {
            _ if method.has_one_map() => (MIN_PHOTONS * PHOTON_BYTES, settings.photon_memory),
            _ if method.takes_photon_count() => (MIN_PHOTONS, u64::from(settings.photons)),
            _ if method.takes_counts() => (1, u64::from(settings.counts.light_paths)),
            _ => return Err(extent.bytes(settings)),
        };
        let fits = |number: u64| extent.bytes(&with(number)) <= self.bytes;
        let (mut fitting, mut large) = (least.min(asked), asked);
        if !fits(fitting) {
            return Err(extent.bytes(&with(fitting)));
        }
        while fitting + 1 < large {
            let middle = fitting + (large - fitting) / 2;
            *if fits(middle) { &mut fitting } else { &mut large } = middle;
        }
        let fitted = with(fitting);
        let less = if method.has_one_map() {
            format!("the photon map has room for {} MiB instead of {}", fitting >> 20, asked >> 20)
        } else if method.takes_photon_count() {
            format!("{fitting} light paths an iteration instead of {asked}")
        } else {
            let [few, all] = [&fitted, settings].map(|settings| settings.counts.light_paths_per_pixel());
            format!("--light-paths {few} instead of {all}")
        };
        Ok((fitted, less))
    }

    /// Makes the error of a render that needs at least `least` bytes, more than the limit.
    fn refuse(self, (width, height): (u32, u32), method: &str, least: u64) -> Error {
        let (least, mib) = (least.div_ceil(1 << 20), self.bytes >> 20);
        let cause = format!(
            "{width} x {height} pixels with --method {method} need {least} MiB at least, and --memory allows {mib}"
        );
        Error::usage(cause)
            .hint("use a smaller --width and --height, --crop, fewer --levels, another --method, or more --memory")
    }
}

/// A render whose need of memory is checked, and the limit that it has to keep to.
#[derive(Clone, Copy)]
pub(super) struct MemoryCheck<'a> {
    /// Scene and camera of the render.
    pub view: View<'a>,
    /// Value of `--method`, for messages.
    pub method: &'a str,
    /// The layers to write.
    pub layers: &'a Selection,
    /// The denoiser that the user asks for; `None` without a finish.
    pub finish: Option<DenoiserChoice>,
    /// The user's limit; `None`: the memory of the machine alone.
    pub limit: Option<MemoryLimit>,
}

impl MemoryCheck<'_> {
    /// Settings that keep to the user's limit, and a warning of what they go without.
    ///
    /// # Errors
    /// The render does not fit into the limit, or into the memory of the machine.
    pub fn fit(&self, settings: Settings) -> Result<(Settings, Option<String>)> {
        let photons_per_path = mean_photons(self.view.scene, self.view.camera, &settings);
        let extent = Extent::with_photons(self.view, &settings, (self.layers, self.finish), photons_per_path);
        let (settings, warning) = match self.limit {
            Some(limit) => limit.fit(extent, settings, self.method)?,
            None => (settings, None),
        };
        let library = if self.finish.is_some() { finish::library_bytes() } else { 0 };
        let free = memory::available().map_or(u64::MAX, |available| available.bytes).saturating_sub(library);
        let (settings, warning) = if extent.bytes(&settings) <= free {
            (settings, warning)
        } else {
            let room = MemoryLimit { bytes: (FREE_SHARE * free as f64) as u64 };
            match room.shrink(extent, &settings) {
                Ok((settings, less)) => (settings, Some(format!("memory is short: {less}{}", extent.long_paths()))),
                Err(_) => (settings, warning),
            }
        };
        let (paths, remedy) = self.describe(&settings);
        let (width, height) = extent.film;
        let remedy = format!("{remedy}{}", extent.long_paths());
        require(extent.bytes(&settings) + library, format_args!("{width} x {height} pixels{paths}"), &remedy)?;
        Ok((settings, warning))
    }

    /// Tells which settings fit into memory, without fewer light paths unless their number is an option.
    pub fn admits(self) -> impl Fn(&Settings) -> bool {
        let free = memory::available().map_or(u64::MAX, |available| available.bytes);
        let photons_per_path = OnceCell::new();
        move |settings| {
            if settings.method.takes_photon_count() {
                return true;
            }
            let MemoryCheck { view, layers, finish, limit, .. } = self;
            let photons_per_path = *photons_per_path.get_or_init(|| mean_photons(view.scene, view.camera, settings));
            let bytes = Extent::with_photons(view, settings, (layers, finish), photons_per_path).bytes(settings);
            let library = if finish.is_some() { finish::library_bytes() } else { 0 };
            bytes.saturating_add(library) <= free && limit.is_none_or(|limit| bytes <= limit.bytes)
        }
    }

    /// Two parts of messages: the light paths or the method that need the memory, and what reduces it.
    fn describe(&self, settings: &Settings) -> (String, &'static str) {
        let method = settings.method;
        let is_chosen = method.name() == self.method;
        if is_chosen && method.takes_photon_count() {
            let each = if method.has_one_map() { "" } else { " an iteration" };
            return (format!(" and {} light paths{each}", settings.photons), "fewer --photons");
        }
        let remedy =
            if is_chosen && method.has_levels() { "fewer --levels" } else { "--crop for a part of the picture" };
        (format!(" with --method {}", self.method), remedy)
    }
}

/// Checks that several renders fit into memory at the same time, and one at a time the finishes of those that have a
/// denoiser.
///
/// # Errors
/// They do not fit.
pub fn check_all<'a>(view: View<'_>, all: impl Iterator<Item = (&'a Settings, Option<DenoiserChoice>)>) -> Result<()> {
    let (width, height) = view.camera.size();
    let (mut renders, mut finishing) = (0, 0);
    for (settings, finish) in all {
        let photons_per_path = mean_photons(view.scene, view.camera, settings);
        let alone = (&Selection::Beauty, None);
        renders += Extent::with_photons(view, settings, alone, photons_per_path).bytes(settings);
        if let Some(denoiser) = finish {
            let layers = LayerCounts::new(&layer_shape(settings, view.scene), &Selection::Beauty, true);
            let pixels = pixels((width, height));
            let bytes = 4 * pixels * layers.channels as u64 + finish::bytes(pixels, 0, denoiser);
            finishing = finishing.max(bytes + finish::library_bytes());
        }
    }
    require(renders + finishing, format_args!("all runs together at {width} x {height} pixels"), "fewer runs")
}

/// Fails if `what` needs more bytes than there are.
fn require(bytes: u64, what: impl Display, remedy: &str) -> Result<()> {
    memory::require(bytes, what).map_err(|error| error.hint(format!("use a smaller --width and --height, or {remedy}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Method;

    fn extent(film: (u32, u32), whole: (u32, u32)) -> Extent {
        let layers = LayerCounts { channels: 8, ..LayerCounts::default() };
        Extent { film, whole, layers, groups: 0, lobes: false, photons_per_path: 2.5, kinds: 2, finish: None }
    }

    #[test]
    fn a_finish_needs_memory_for_its_pixels_and_parts() {
        let settings = Settings { method: Method::Path, iterations: Some(4), ..Settings::default() };
        let bytes = |size, parts, finish| {
            let layers = LayerCounts { channels: 80, parts, ..LayerCounts::default() };
            Extent { layers, finish, ..extent(size, size) }.bytes(&settings)
        };
        let [small, large] = [(320, 180), (640, 720)].map(|size| bytes(size, 8, Some(DenoiserChoice::Own)));
        assert!(large > 7 * small && large <= 8 * small, "{small} {large}");
        let oidn = bytes((320, 180), 8, Some(DenoiserChoice::Oidn));
        assert!(oidn > small && small > bytes((320, 180), 0, None));
        assert!(bytes((320, 180), 20, Some(DenoiserChoice::Oidn)) > oidn);
        assert!(bytes((1 << 16, 1 << 16), 1000, Some(DenoiserChoice::Oidn)) > 1 << 40);
    }

    #[test]
    fn the_largest_picture_does_not_overflow() {
        let settings = Settings { photons: 0, ..Settings::default() };
        let one = extent((1, 1), (1, 1)).bytes(&settings);
        assert!(one > 8 * 4);
        let largest = (1 << 16, 1 << 16);
        assert_eq!(extent(largest, largest).bytes(&settings), one << 32);
        let merged = Settings { method: Method::Vcm, ..settings };
        assert!(extent((1, 1), (1, 1)).bytes(&merged) > one);
    }

    /// Methods that walk the light paths of the whole picture keep lists for all its tiles, also to render a window.
    #[test]
    fn windows_need_memory_for_their_whole_picture() {
        let bytes = |method: Method, whole: u32| {
            let settings = Settings { method, photons: 1000, ..Settings::default() };
            extent((64, 64), (whole, whole)).bytes(&settings)
        };
        for method in [Method::Light, Method::Bdpt] {
            assert_eq!(bytes(method, 1 << 14) - bytes(method, 64), ((1 << 20) - 16) * bytes_per_whole_tile());
        }
        for method in [Method::Path, Method::Sppm, Method::Vcm] {
            assert_eq!(bytes(method, 1 << 14), bytes(method, 64));
        }
    }

    /// Settings that keep to a limit need at most the limit, and little less. A render that cannot keep to it is refused
    /// with the memory that it needs.
    #[test]
    fn settings_keep_to_a_limit() {
        let extent = extent((64, 64), (64, 64));
        let fit =
            |bytes, settings: &Settings| MemoryLimit { bytes }.fit(extent, settings.clone(), settings.method.name());
        for method in [Method::Sppm, Method::Cppm, Method::Pm, Method::Vcm, Method::Bpm] {
            let photon_memory = u64::MAX;
            let request = Settings { method, photons: 5_000_000, photon_memory, ..Settings::default() };
            let needs = |settings: &Settings| extent.bytes(settings);
            let whole = needs(&request);
            let (kept, warning) = fit(whole, &request).expect("it fits");
            assert_eq!((kept.photons, kept.photon_memory, warning), (request.photons, photon_memory, None));
            let none = fit(1 << 20, &request).expect_err("nothing fits");
            assert!(none.cause.ends_with(" MiB at least, and --memory allows 1"), "{none}");
            assert_eq!(none.exit_code(), 2);
            let most = whole / 4 * 3;
            let fitted = fit(most, &request);
            if method == Method::Bpm {
                assert!(fitted.is_err(), "no photon of it can be left out");
                continue;
            }
            let (kept, warning) = fitted.expect("some fit");
            let step = if method == Method::Vcm { whole / 16 } else { 1000 };
            assert!(needs(&kept) <= most && needs(&kept) > most - step, "{}", method.name());
            assert!(warning.is_some_and(|warning| warning.contains(" instead of ")));
        }
    }
}
