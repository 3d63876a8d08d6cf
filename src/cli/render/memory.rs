//! Whether a render fits into memory, asked before it begins.

use caustique::error::{Error, Kind, Result};
use caustique::estimator::Pixel;
use caustique::estimator::rule::{adaptive, chi_squared, local};
use caustique::photon;
use caustique::render::{MAX_TECHNIQUES, Method, Settings};
use caustique::transport::EyeMeasure;
use std::mem::size_of;

/// Bytes per light path: the photons that a path leaves on average, in the list and in the map.
const PER_LIGHT_PATH: u64 = 150;
/// The same where photons carry what their weights are made of, and every bounce leaves one.
const PER_MERGED_PATH: u64 = 800;

/// Bytes per pixel of a technique's weighted and unweighted picture.
const PER_TECHNIQUE: u64 = 24;

/// Bytes that a render holds at its end, when pixels and layers of so many channels are there together.
fn needed((width, height): (u32, u32), channels: usize, settings: &Settings) -> u64 {
    let pixels = u64::from(width) * u64::from(height);
    let eye_paths = 1 + u64::from(settings.levels.two_paths);
    let (method, measure) = (settings.method, size_of::<EyeMeasure>() as u64);
    let (per_path, photons) = match (method.counts_photons(), method.has_bandwidths()) {
        _ if method == Method::Pm => (0, settings.photon_memory.min(u64::from(settings.photons) * PER_LIGHT_PATH)),
        (true, _) => (0, u64::from(settings.photons) * PER_LIGHT_PATH),
        (false, true) => (measure + PER_MERGED_PATH, 0),
        (false, false) => (measure, 0),
    };
    // At most: few of the pictures are there in a closed scene, none of the deepest in an open one.
    let pictures = if settings.techniques { MAX_TECHNIQUES as u64 * PER_TECHNIQUE } else { 0 };
    // Bandwidths of their own, and counts.
    let cells = settings.chi_squared.annuli * settings.chi_squared.sectors;
    let state = match method {
        Method::Cppm => {
            // Guided, the largest weight as well.
            size_of::<chi_squared::Bandwidth>() + (cells + usize::from(settings.guided)) * size_of::<u32>()
        }
        Method::Appm => size_of::<adaptive::Bandwidth>(),
        _ if method.gathers() && !settings.is_memoryless() => size_of::<local::Bandwidth>(),
        _ => 0,
    };
    let apart = if method == Method::Cppm && settings.chi_squared.plus { 3 } else { 1 };
    // At most: a scene may have photons of one kind alone.
    let own = (settings.levels.count * apart * photon::Kind::ALL.len() * state) as u64;
    let per_pixel = own + pictures + (size_of::<Pixel>() + channels * size_of::<f32>()) as u64 + eye_paths * per_path;
    pixels * per_pixel + photons
}

/// Bytes that the system can give without swapping; `None` where it does not tell.
fn available() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}

/// Checks that the picture and its photons fit.
///
/// # Errors
/// They need more memory than there is.
pub fn check(settings: &Settings, size: (u32, u32), channels: usize) -> Result<()> {
    let needed = needed(size, channels, settings);
    let Some(available) = available().filter(|available| needed > *available) else { return Ok(()) };
    let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
    let paths = if settings.method.counts_photons() {
        let each = if settings.method == Method::Pm { "" } else { " an iteration" };
        format!(" and {} light paths{each}", settings.photons)
    } else {
        format!(" with --method {}", settings.method.name())
    };
    let cause = format!(
        "{} x {} pixels{paths} need about {:.1} GiB of memory, {:.1} GiB are available",
        size.0,
        size.1,
        gib(needed),
        gib(available)
    );
    let error = Error::new(Kind::Usage, "command line", cause);
    Err(error.hint("use a smaller --width and --height, or fewer --photons"))
}

/// Channels of the layers that the combiner reads.
const COMBINED_CHANNELS: usize = 37;

/// Checks that several renders fit, that go on at the same time.
///
/// # Errors
/// They need more memory than there is.
pub fn check_all<'a>(all: impl Iterator<Item = &'a Settings>, size: (u32, u32)) -> Result<()> {
    let needed: u64 = all.map(|settings| needed(size, COMBINED_CHANNELS, settings)).sum();
    let Some(available) = available().filter(|available| needed > *available) else { return Ok(()) };
    let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
    let cause = format!(
        "all runs together need about {:.1} GiB of memory at {} x {} pixels, {:.1} GiB are available",
        gib(needed),
        size.0,
        size.1,
        gib(available)
    );
    let error = Error::new(Kind::Usage, "command line", cause);
    Err(error.hint("use a smaller --width and --height, or fewer runs"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_picture_does_not_overflow() {
        let none = Settings { photons: 0, ..Settings::default() };
        let some = Settings { photons: 1000, ..Settings::default() };
        let one = needed((1, 1), 93, &none);
        assert!(one > 93 * 4);
        assert_eq!(needed((1 << 16, 1 << 16), 93, &some), (one << 32) + 150_000);
        let merged = Settings { method: Method::Vcm, ..none };
        assert!(needed((1, 1), 93, &merged) > one);
    }
}
