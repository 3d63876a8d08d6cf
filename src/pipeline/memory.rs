//! Whether a render fits into memory, asked before it begins.

use crate::error::{Error, Result};
use crate::estimator::PixelAccumulator;
use crate::estimator::rule::{adaptive, chi_squared, local};
use crate::film;
use crate::finish::{BYTES_PER_PIXEL, BYTES_PER_PIXEL_OF_PART, scratch};
use crate::memory;
use crate::photon;
use crate::plan::Search;
use crate::render::{
    BandwidthRule, MAX_TECHNIQUES, PHOTON_BYTES, Settings, WHOLE_TILE, bytes_per_whole_tile, photons_per_path,
    sample_bytes,
};
use crate::scene::View;
use crate::transport::{MergePhoton, Splat};
use std::fmt::Display;
use std::mem::size_of;

/// Bytes per photon that carries what its weights are made of: those of an iteration as traced, joined, and sorted
/// beside the map of the last one.
const MERGED_BYTES: u64 = 5 * size_of::<MergePhoton>() as u64 + 32;

/// Bytes per vertex of a light path that sends light to the film: lists grow to twice what they hold, and are sorted.
const SPLAT_BYTES: u64 = 2 * size_of::<Splat>() as u64 + 8;

/// Bytes per pixel of a technique's weighted and unweighted picture.
const PER_TECHNIQUE: u64 = 24;

/// Bytes that a render holds at its end, when pixels and layers of so many channels are there together.
fn needed(
    [(width, height), whole]: [(u32, u32); 2],
    (channels, groups): (usize, usize),
    settings: &Settings,
    per_light_path: f64,
) -> u64 {
    let pixels = u64::from(width) * u64::from(height);
    let light_paths = 1.0 + f64::from(u8::from(settings.levels.two_paths));
    let method = settings.method;
    let gathered = (f64::from(settings.photons) * per_light_path * PHOTON_BYTES as f64) as u64;
    let (merged, photons) = match (method.takes_photon_count(), method.has_bandwidths()) {
        _ if method.has_one_map() => (0, settings.photon_memory.min(gathered)),
        (true, _) => (0, gathered),
        (false, true) => ((light_paths * per_light_path * MERGED_BYTES as f64) as u64, 0),
        (false, false) => (0, 0),
    };
    // As many of the whole picture's light paths reach a window as have its pixels.
    let connects = method.walks_whole_picture() || method.search() == Search::ConnectionsAndMerging;
    let splats = if connects { (light_paths * per_light_path * SPLAT_BYTES as f64) as u64 } else { 0 };
    let [across, down] = [whole.0, whole.1].map(|side| u64::from(side.div_ceil(WHOLE_TILE)));
    let tiles = if method.walks_whole_picture() { across * down * bytes_per_whole_tile() } else { 0 };
    // At most: few of the pictures are there in a closed scene, none of the deepest in an open one.
    let pictures = if settings.techniques { MAX_TECHNIQUES as u64 * PER_TECHNIQUE } else { 0 };
    // Bandwidths of their own, and counts.
    let cells = settings.chi_squared.annuli * settings.chi_squared.sectors;
    let state = match settings.bandwidth_rule() {
        Some(BandwidthRule::ChiSquared) => {
            // Guided, the largest weight as well.
            size_of::<chi_squared::Bandwidth>() + (cells + usize::from(settings.guided)) * size_of::<u32>()
        }
        Some(BandwidthRule::Adaptive) => size_of::<adaptive::Bandwidth>(),
        Some(BandwidthRule::Local) => size_of::<local::Bandwidth>(),
        Some(BandwidthRule::Memoryless) | None => 0,
    };
    let apart = if settings.has_channels() { 3 } else { 1 };
    // At most: a scene may have photons of one kind alone. Twice, because an iteration that is given up takes them back.
    let own = 2 * (settings.levels.count * apart * photon::Kind::ALL.len() * state) as u64;
    let per_pixel = own
        + pictures
        + (PixelAccumulator::bytes(settings.levels.count, groups) + sample_bytes(settings)) as u64
        + (channels * size_of::<f32>()) as u64
        + merged
        + splats;
    pixels * per_pixel + photons + tiles
}

/// What a finish takes whatever the picture: the library of the denoiser and its network. A bound found by lowering
/// `ulimit -v` (`no_limit_of_memory_aborts` in `tests/cli/limits.rs`).
const FINISH_BYTES: u64 = 192 << 20;

/// What a finish takes beside pixels and layers; the denoiser works in tiles where there is no more.
fn finish_bytes((width, height): (u32, u32), groups: usize) -> u64 {
    let pixels = u64::from(width) * u64::from(height);
    // Parts by effect, and those of light groups and their caustics.
    let parts = (film::part_names().count() + 2 * groups) as u64;
    FINISH_BYTES + pixels * (BYTES_PER_PIXEL + parts * BYTES_PER_PIXEL_OF_PART) + scratch(pixels)
}

/// Fewer light paths than this make no picture: a cap below is refused.
const LEAST_PHOTONS: u32 = 1000;

/// A limit that is asked for, on what photons and pixels take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cap {
    /// Bytes.
    pub bytes: u64,
}

impl Cap {
    /// Settings that keep to it, and what they do without, if anything. Only photons can be fewer: those of an iteration
    /// where they are counted, and the room of the one map of `pm`; pixels and layers take what they take.
    ///
    /// # Errors
    /// Not even the least fits.
    pub fn plan(
        self,
        View { scene, camera }: View<'_>,
        settings: Settings,
        channels: usize,
    ) -> Result<(Settings, Option<String>)> {
        let planes = (channels, scene.lights.groups().names.len());
        let per_light_path = photons_per_path(scene, camera, &settings);
        self.keep(camera.sizes(), settings, planes, per_light_path)
    }

    fn keep(
        self,
        sizes: [(u32, u32); 2],
        settings: Settings,
        planes: (usize, usize),
        per_light_path: f64,
    ) -> Result<(Settings, Option<String>)> {
        let needs = |settings: &Settings| needed(sizes, planes, settings, per_light_path);
        let whole = needs(&settings);
        if whole <= self.bytes {
            return Ok((settings, None));
        }
        let mib = self.bytes >> 20;
        let pixels = needs(&Settings { photons: 0, ..settings.clone() });
        let left = self.bytes.saturating_sub(pixels);
        let least = (f64::from(LEAST_PHOTONS) * per_light_path * PHOTON_BYTES as f64) as u64;
        if !settings.method.takes_photon_count() || left < least {
            let least = if settings.method.takes_photon_count() { pixels + least } else { whole };
            let cause = format!(
                "{} x {} pixels with --method {} need {} MiB at least, and --memory allows {mib}",
                sizes[0].0,
                sizes[0].1,
                settings.method.name(),
                least.div_ceil(1 << 20)
            );
            let fewer =
                "use a smaller --width and --height, --crop, fewer --levels, another --method, or more --memory";
            return Err(Error::usage(cause).hint(fewer));
        }
        if settings.method.has_one_map() {
            let told = format!(
                "--memory {mib}: the photon map has room for {} MiB instead of {}",
                left >> 20,
                settings.photon_memory >> 20
            );
            return Ok((Settings { photon_memory: left, ..settings }, Some(told)));
        }
        let photons = (left as f64 / (per_light_path * PHOTON_BYTES as f64)) as u32;
        let told = format!("--memory {mib}: {photons} light paths an iteration instead of {}", settings.photons);
        Ok((Settings { photons, ..settings }, Some(told)))
    }
}

/// Checks that the picture and its photons fit into what the machine leaves, and the finish, if there is to be one.
///
/// # Errors
/// They need more memory than there is.
pub fn check(view: View<'_>, settings: &Settings, channels: usize, finishes: bool) -> Result<()> {
    let View { scene, camera } = view;
    let size = camera.size();
    let groups = scene.lights.groups().names.len();
    let needed = needed(camera.sizes(), (channels, groups), settings, photons_per_path(scene, camera, settings));
    let needed = needed + if finishes { finish_bytes(size, groups) } else { 0 };
    let paths = if settings.method.takes_photon_count() {
        let each = if settings.method.has_one_map() { "" } else { " an iteration" };
        format!(" and {} light paths{each}", settings.photons)
    } else {
        format!(" with --method {}", settings.method.name())
    };
    let method = settings.method;
    let fewer = match (method.takes_photon_count(), method.has_levels()) {
        (true, _) => "fewer --photons",
        (false, true) => "fewer --levels",
        (false, false) => "--crop for a part of the picture",
    };
    refuse(needed, format_args!("{} x {} pixels{paths}", size.0, size.1), fewer)
}

/// Channels of the layers that the combiner reads.
const COMBINED_CHANNELS: usize = 37;

/// Checks that several renders fit, that go on at the same time.
///
/// # Errors
/// They need more memory than there is.
pub fn check_all<'a>(view: View<'_>, all: impl Iterator<Item = &'a Settings>) -> Result<()> {
    let View { scene, camera } = view;
    let [(width, height), whole] = camera.sizes();
    let each = |settings| {
        needed([(width, height), whole], (COMBINED_CHANNELS, 0), settings, photons_per_path(scene, camera, settings))
    };
    refuse(all.map(each).sum(), format_args!("all runs together at {width} x {height} pixels"), "fewer runs")
}

/// The error where `what` need more memory than there is.
fn refuse(needed: u64, what: impl Display, fewer: &str) -> Result<()> {
    memory::require(needed, what).map_err(|error| error.hint(format!("use a smaller --width and --height, or {fewer}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Method;

    /// A finish takes what its pixels and parts take; the denoiser works in tiles.
    #[test]
    fn a_finish_is_counted_by_its_pixels_and_parts() {
        let [small, large] = [(320, 180), (1920, 1080)].map(|size| finish_bytes(size, 0) - FINISH_BYTES);
        assert!(large > 20 * small && large < 36 * small, "{small} {large}");
        assert_eq!(finish_bytes((320, 180), 3), finish_bytes((320, 180), 0) + 320 * 180 * 6 * BYTES_PER_PIXEL_OF_PART);
        assert!(finish_bytes((1 << 16, 1 << 16), 1000) > 1 << 40);
    }

    #[test]
    fn the_largest_picture_does_not_overflow() {
        let none = Settings { photons: 0, ..Settings::default() };
        let some = Settings { photons: 1000, ..Settings::default() };
        let one = needed([(1, 1); 2], (93, 0), &none, 2.5);
        assert!(one > 93 * 4);
        assert_eq!(needed([(1 << 16, 1 << 16); 2], (93, 0), &some, 2.5), (one << 32) + 2500 * PHOTON_BYTES);
        let merged = Settings { method: Method::Vcm, ..none };
        assert!(needed([(1, 1); 2], (93, 0), &merged, 2.5) > one);
    }

    /// Of a window, the methods that walk the light paths of the whole picture keep lists for all its tiles.
    #[test]
    fn windows_are_counted_with_their_whole_picture() {
        let bytes = |method: Method, whole: u32| {
            let settings = Settings { method, photons: 1000, ..Settings::default() };
            needed([(64, 64), (whole, whole)], (93, 0), &settings, 2.5)
        };
        for method in [Method::Light, Method::Bdpt] {
            assert_eq!(bytes(method, 1 << 14) - bytes(method, 64), ((1 << 20) - 16) * bytes_per_whole_tile());
        }
        for method in [Method::Path, Method::Sppm, Method::Vcm] {
            assert_eq!(bytes(method, 1 << 14), bytes(method, 64));
        }
    }

    /// What is planned under a cap needs no more than it, and little less; what cannot be is refused with what it takes.
    #[test]
    fn plans_keep_to_their_cap() {
        let sizes = [(64, 64); 2];
        let plan = |bytes, settings: &Settings| Cap { bytes }.keep(sizes, settings.clone(), (93, 0), 2.5);
        for method in [Method::Sppm, Method::Cppm, Method::Pm, Method::Vcm] {
            let photon_memory = u64::MAX;
            let asked = Settings { method, photons: 5_000_000, photon_memory, ..Settings::default() };
            let needs = |settings: &Settings| needed(sizes, (93, 0), settings, 2.5);
            let whole = needs(&asked);
            let (kept, told) = plan(whole, &asked).expect("it fits");
            assert_eq!((kept.photons, kept.photon_memory, told), (asked.photons, photon_memory, None));
            let none = plan(1 << 20, &asked).expect_err("nothing fits");
            assert!(none.cause.ends_with(" MiB at least, and --memory allows 1"), "{none}");
            assert_eq!(none.exit_code(), 2);
            let half = plan(whole / 2, &asked);
            if method == Method::Vcm {
                assert!(half.is_err(), "no photon of it can be left out");
                continue;
            }
            let (kept, told) = half.expect("some fit");
            assert!(needs(&kept) <= whole / 2 && needs(&kept) > whole / 2 - 1000, "{}", method.name());
            assert!(told.is_some_and(|told| told.contains(" instead of ")));
        }
    }
}
