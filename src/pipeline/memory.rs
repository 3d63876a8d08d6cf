//! Estimates the memory of a render before it begins, and refuses a render that does not fit.

use super::layers;
use crate::error::{Error, Result};
use crate::estimator::PixelAccumulator;
use crate::estimator::rule::{adaptive, chi_squared, local};
use crate::film;
use crate::film::output::Shape;
use crate::finish;
use crate::memory;
use crate::photon;
use crate::plan::Search;
use crate::render::output::layer_shape;
use crate::render::{
    BandwidthRule, Counts, MAX_TECHNIQUES, PHOTON_BYTES, Settings, ShardResult, WHOLE_TILE, bytes_per_whole_tile,
    photons_per_path as mean_photons, sample_bytes,
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

/// Number of channels of the layers that a finish with a network reads.
const FINISH_CHANNELS: usize = 37;

/// Smallest number of light paths per iteration that a limit on memory may leave.
const MIN_PHOTONS: u32 = 1000;

/// Share of the free memory that photons may take if it does not hold all: other programs take memory meanwhile.
const FREE_SHARE: f64 = 0.75;

/// Mean number of photons per light path above which messages name `--max-depth`. Closed white rooms have thousands.
const LONG_PATH: f64 = 64.0;

/// The sizes that the memory of a render depends on, besides its settings.
#[derive(Clone, Copy)]
struct Extent {
    /// Width and height of the window that is rendered (pixels).
    film: (u32, u32),
    /// Width and height of the whole picture (pixels).
    whole: (u32, u32),
    /// Number of channels in all layers of the EXR.
    channels: usize,
    /// Number of light groups (lights with layers of their own).
    groups: usize,
    /// Whether light is recorded by the lobe of the first hit.
    lobes: bool,
    /// Mean number of photons that a light path stores.
    photons_per_path: f64,
}

impl Extent {
    fn new(view: View<'_>, settings: &Settings, channels: usize) -> Extent {
        let photons_per_path = mean_photons(view.scene, view.camera, settings);
        Extent::with_photons(view, settings, channels, photons_per_path)
    }

    fn with_photons(
        View { scene, camera }: View<'_>,
        settings: &Settings,
        channels: usize,
        photons_per_path: f64,
    ) -> Extent {
        let [film, whole] = camera.sizes();
        let groups = scene.lights.groups().names.len();
        Extent { film, whole, channels, groups, lobes: settings.lobes, photons_per_path }
    }

    /// Words of a hint that name the length of light paths if they are long; empty otherwise.
    fn long_paths(&self) -> String {
        let photons = self.photons_per_path;
        if photons < LONG_PATH {
            return String::new();
        }
        format!(", or --max-depth {LONG_PATH} for shorter light paths (they have {photons:.0} vertices on average)")
    }

    /// Bytes at the end of a render, when its pixels and its layers exist together.
    fn bytes(&self, settings: &Settings) -> u64 {
        let [across, down] = [self.whole.0, self.whole.1].map(|side| u64::from(side.div_ceil(WHOLE_TILE)));
        let walks_whole_picture = settings.method.walks_whole_picture();
        let tiles = if walks_whole_picture { across * down * bytes_per_whole_tile() } else { 0 };
        pixels(self.film) * self.bytes_per_pixel(settings) + self.bytes_of_map(settings) + tiles
    }

    /// Bytes of the photon map while it is built.
    fn bytes_of_map(&self, settings: &Settings) -> u64 {
        let bytes = (f64::from(settings.photons) * self.photons_per_path * PHOTON_BYTES as f64) as u64;
        match settings.method {
            method if method.has_one_map() => settings.photon_memory.min(bytes),
            method if method.takes_photon_count() => bytes,
            _ => 0,
        }
    }

    /// Bytes per pixel: sums, bandwidths, layers, and the light paths that methods without a number of photons send for
    /// each pixel.
    fn bytes_per_pixel(&self, settings: &Settings) -> u64 {
        let method = settings.method;
        let light_paths = settings.counts.light_paths_per_pixel() * if settings.levels.two_paths { 2.0 } else { 1.0 };
        let vertices = light_paths * self.photons_per_path;
        let merges = method.has_bandwidths() && !method.takes_photon_count() && !method.has_one_map();
        let merged = if merges { (vertices * MERGED_BYTES as f64) as u64 } else { 0 };
        // On average a window receives one light path per pixel, as the whole picture does.
        let connects = method.walks_whole_picture() || method.search() == Search::ConnectionsAndMerging;
        let splat_bytes = SPLAT_BYTES + if self.lobes { 2 * size_of::<FirstScatter>() as u64 } else { 0 };
        let splats = if connects { (vertices * splat_bytes as f64) as u64 } else { 0 };
        // An upper bound: most scenes leave some of the techniques without a picture.
        let techniques = if settings.techniques { MAX_TECHNIQUES as u64 * BYTES_PER_TECHNIQUE } else { 0 };
        bytes_of_bandwidths(settings)
            + techniques
            + (PixelAccumulator::bytes(settings.levels.count, settings.merges_one_level(), self.groups, self.lobes)
                + sample_bytes(settings)) as u64
            + (self.channels * size_of::<f32>()) as u64
            + merged
            + splats
    }
}

fn pixels((width, height): (u32, u32)) -> u64 {
    u64::from(width) * u64::from(height)
}

/// Bytes per pixel for its bandwidths and photon counts.
fn bytes_of_bandwidths(settings: &Settings) -> u64 {
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
    // An upper bound: a scene may have photons of one kind only. Twice, for iterations that are discarded.
    2 * (settings.levels.count * channels * photon::Kind::ALL.len() * state) as u64
}

/// Bytes that a finish takes besides pixels and layers.
fn finish_bytes(size: (u32, u32), groups: usize, lobes: bool) -> u64 {
    // The parts by effect and by lobe, and for each light group its part and its caustics.
    let lobes = if lobes { film::lobe_names().count() } else { 0 };
    finish::bytes(pixels(size), (film::part_names().count() + lobes + 2 * groups) as u64)
}

/// Checks that there is memory to merge the shards of a render, and to finish its picture if it `finishes`.
///
/// # Errors
/// There is not.
pub(super) fn check_merge(part: &ShardResult, shape: &Shape, finishes: bool) -> Result<()> {
    let (width, height) = part.size;
    let (groups, levels) = (shape.groups.len(), part.settings.levels.count);
    let pixel =
        PixelAccumulator::bytes(levels, shape.merges, groups, shape.lobes) + layers::channels(shape) * size_of::<f32>();
    let finish = if finishes { finish_bytes(part.size, groups, shape.lobes) } else { 0 };
    let needed = pixels(part.size) * pixel as u64 + finish;
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

    /// Settings with the largest number of photons that fits the limit, and a message with that number.
    ///
    /// # Errors
    /// The bytes that the render needs at least, which are more than the limit.
    fn shrink(self, extent: Extent, settings: &Settings) -> std::result::Result<(Settings, String), u64> {
        if settings.method.takes_counts() {
            return self.shrink_light_paths(extent, settings);
        }
        if !settings.method.takes_photon_count() {
            return Err(extent.bytes(settings));
        }
        let pixels = extent.bytes(&Settings { photons: 0, ..settings.clone() });
        let left = self.bytes.saturating_sub(pixels);
        let bytes_per_light_path = extent.photons_per_path * PHOTON_BYTES as f64;
        let least = (f64::from(MIN_PHOTONS) * bytes_per_light_path) as u64;
        if left < least {
            return Err(pixels + least);
        }
        if settings.method.has_one_map() {
            let all = settings.photon_memory >> 20;
            let less = format!("the photon map has room for {} MiB instead of {all}", left >> 20);
            return Ok((Settings { photon_memory: left, ..settings.clone() }, less));
        }
        let photons = (left as f64 / bytes_per_light_path) as u32;
        let less = format!("{photons} light paths an iteration instead of {}", settings.photons);
        Ok((Settings { photons, ..settings.clone() }, less))
    }

    /// [`MemoryLimit::shrink`] of methods with a number of light paths per pixel.
    fn shrink_light_paths(self, extent: Extent, settings: &Settings) -> std::result::Result<(Settings, String), u64> {
        let with = |light_paths: u32| {
            let counts = Counts { light_paths, ..settings.counts };
            Settings { counts, ..settings.clone() }
        };
        let asked = settings.counts.light_paths;
        let fitted = (1..asked).rev().map(with).find(|settings| extent.bytes(settings) <= self.bytes);
        let fitted = fitted.ok_or_else(|| extent.bytes(&with(asked.min(1))))?;
        let [few, all] = [&fitted, settings].map(|settings| settings.counts.light_paths_per_pixel());
        Ok((fitted, format!("--light-paths {few} instead of {all}")))
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
    /// Whether the picture is finished.
    pub finishes: bool,
    /// The user's limit; `None`: the memory of the machine alone.
    pub limit: Option<MemoryLimit>,
}

impl MemoryCheck<'_> {
    /// Settings that keep to the user's limit, and a warning of what they go without.
    ///
    /// # Errors
    /// The render does not fit into the limit, or into the memory of the machine.
    pub fn fit(&self, settings: Settings) -> Result<(Settings, Option<String>)> {
        let channels = layers::channels(&layer_shape(&settings, self.view.scene));
        let extent = Extent::new(self.view, &settings, channels);
        let (settings, warning) = match self.limit {
            Some(limit) => limit.fit(extent, settings, self.method)?,
            None => (settings, None),
        };
        let finish = if self.finishes { finish_bytes(extent.film, extent.groups, extent.lobes) } else { 0 };
        let free = memory::available().map_or(u64::MAX, |available| available.bytes).saturating_sub(finish);
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
        require(extent.bytes(&settings) + finish, format_args!("{width} x {height} pixels{paths}"), &remedy)?;
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
            let MemoryCheck { view: View { scene, camera }, finishes, limit, .. } = self;
            let photons_per_path = *photons_per_path.get_or_init(|| mean_photons(scene, camera, settings));
            let channels = layers::channels(&layer_shape(settings, scene));
            let extent = Extent::with_photons(self.view, settings, channels, photons_per_path);
            let finish = if finishes { finish_bytes(extent.film, extent.groups, extent.lobes) } else { 0 };
            let bytes = extent.bytes(settings);
            bytes.saturating_add(finish) <= free && limit.is_none_or(|limit| bytes <= limit.bytes)
        }
    }

    /// Names, for messages, the light paths or the method of a render, and how it takes less memory.
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

/// Checks that several renders fit into memory at the same time.
///
/// # Errors
/// They do not fit.
pub fn check_all<'a>(view: View<'_>, all: impl Iterator<Item = &'a Settings>) -> Result<()> {
    let (width, height) = view.camera.size();
    let bytes = |settings| Extent { groups: 0, ..Extent::new(view, settings, FINISH_CHANNELS) }.bytes(settings);
    require(all.map(bytes).sum(), format_args!("all runs together at {width} x {height} pixels"), "fewer runs")
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
        Extent { film, whole, channels: 93, groups: 0, lobes: false, photons_per_path: 2.5 }
    }

    #[test]
    fn a_finish_needs_memory_for_its_pixels_and_parts() {
        let [small, large] = [(320, 180), (1920, 1080)].map(|size| finish_bytes(size, 0, false) - finish::bytes(0, 0));
        assert!(large > 20 * small && large < 36 * small, "{small} {large}");
        assert_eq!(
            finish_bytes((320, 180), 3, false),
            finish_bytes((320, 180), 0, false) + 320 * 180 * 6 * finish::BYTES_PER_PIXEL_OF_PART
        );
        assert!(finish_bytes((1 << 16, 1 << 16), 1000, true) > 1 << 40);
    }

    #[test]
    fn the_largest_picture_does_not_overflow() {
        let none = Settings { photons: 0, ..Settings::default() };
        let some = Settings { photons: 1000, ..Settings::default() };
        let one = extent((1, 1), (1, 1)).bytes(&none);
        assert!(one > 93 * 4);
        let largest = (1 << 16, 1 << 16);
        assert_eq!(extent(largest, largest).bytes(&some), (one << 32) + 2500 * PHOTON_BYTES);
        let merged = Settings { method: Method::Vcm, ..none };
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
