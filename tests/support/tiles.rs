//! Comparison of small pictures tile by tile.

use super::stats::mean_and_error;

/// Side of the picture (pixels).
pub const SIZE: u32 = 32;
/// Side of a tile (pixels).
pub const TILE: u32 = 8;
/// Number of tiles of a picture.
pub const TILES: usize = (SIZE / TILE * SIZE / TILE) as usize;

/// Means of the tiles of a picture with these row-major values.
pub fn tiles(value: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut sums = vec![0.0; TILES];
    for y in 0..SIZE {
        for x in 0..SIZE {
            sums[(y / TILE * (SIZE / TILE) + x / TILE) as usize] +=
                value((y * SIZE + x) as usize) / f64::from(TILE * TILE);
        }
    }
    sums
}

/// The tiles in which two sets of renders differ by more than `critical` standard errors and `bias` (relative).
pub fn disagreeing(a: &[Vec<f64>], b: &[Vec<f64>], critical: f64, bias: f64) -> Vec<String> {
    (0..TILES)
        .filter_map(|tile| {
            let (mean_a, error_a) = mean_and_error(&a.iter().map(|s| s[tile]).collect::<Vec<_>>());
            let (mean_b, error_b) = mean_and_error(&b.iter().map(|s| s[tile]).collect::<Vec<_>>());
            let allowed = critical * error_a.hypot(error_b) + bias * mean_b.abs() + 1e-9;
            ((mean_a - mean_b).abs() > allowed)
                .then(|| format!("tile {tile}: {mean_a:.5} and {mean_b:.5}, allowed {allowed:.5}"))
        })
        .collect()
}

/// Mean over seeds and tiles.
pub fn average(images: &[Vec<f64>]) -> f64 {
    images.iter().flatten().sum::<f64>() / (images.len() * TILES) as f64
}
