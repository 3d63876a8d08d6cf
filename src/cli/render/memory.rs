//! Whether a render fits into memory, asked before it begins.

use super::options::RenderArgs;
use caustique::error::{Error, Kind, Result};
use caustique::estimator::Pixel;
use std::mem::size_of;

/// Bytes per light path: the photons that a path leaves on average, in the list and in the map.
const PER_LIGHT_PATH: u64 = 150;

/// Bytes that a render holds at its end, when pixels and layers of so many channels are there together.
fn needed((width, height): (u32, u32), channels: usize, photons: u32) -> u64 {
    let per_pixel = (size_of::<Pixel>() + channels * size_of::<f32>()) as u64;
    u64::from(width) * u64::from(height) * per_pixel + u64::from(photons) * PER_LIGHT_PATH
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
pub fn check(args: &RenderArgs, size: (u32, u32), channels: usize) -> Result<()> {
    let needed = needed(size, channels, args.photons);
    let Some(available) = available().filter(|available| needed > *available) else { return Ok(()) };
    let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
    let cause = format!(
        "{} x {} pixels and {} light paths an iteration need about {:.1} GiB of memory, {:.1} GiB are available",
        size.0,
        size.1,
        args.photons,
        gib(needed),
        gib(available)
    );
    let error = Error::new(Kind::Usage, "command line", cause);
    Err(error.hint("use a smaller --width and --height, or fewer --photons"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_picture_does_not_overflow() {
        let one = needed((1, 1), 93, 0);
        assert!(one > 93 * 4);
        assert_eq!(needed((1 << 16, 1 << 16), 93, 1000), (one << 32) + 150_000);
    }
}
