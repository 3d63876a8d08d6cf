//! Comparison of small pictures tile by tile and channel by channel.

use super::stats::{ERROR_RATE, mean_and_error, t_critical};
use caustique::render::{Method, Rendered};

/// Side of the picture (pixels).
pub const SIZE: u32 = 16;
/// Side of a tile (pixels).
pub const TILE: u32 = 8;
/// Number of tiles of a picture.
pub const TILES: usize = (SIZE / TILE * SIZE / TILE) as usize;

/// Means of every channel of every tile.
pub fn tiles(rendered: &Rendered) -> Vec<f64> {
    let own = rendered.settings.levels.picture_level();
    let mut sums = vec![0.0; 3 * TILES];
    for (index, pixel) in (0..).zip(&rendered.pixels) {
        let tile = (index / SIZE / TILE * (SIZE / TILE) + index % SIZE / TILE) as usize;
        for c in 0..3 {
            sums[3 * tile + c] += pixel.mean(own)[c] / f64::from(TILE * TILE);
        }
    }
    sums
}

/// Means of every channel of every tile, one list per seed, printed with their errors.
pub fn seeds(method: Method, seeds: u64, render: impl Fn(u64) -> Rendered) -> Vec<Vec<f64>> {
    let images: Vec<Vec<f64>> = (0..seeds).map(|seed| tiles(&render(seed))).collect();
    let (means, relative): (Vec<f64>, Vec<f64>) = (0..3 * TILES)
        .map(|at| {
            let (mean, error) = of(&images, at);
            (mean, error / mean)
        })
        .unzip();
    println!("{method:?}: {means:.4?} +- {relative:.3?}");
    images
}

/// Mean and standard error over seeds of one channel of one tile.
fn of(images: &[Vec<f64>], at: usize) -> (f64, f64) {
    mean_and_error(&images.iter().map(|image| image[at]).collect::<Vec<_>>())
}

/// The tiles and channels in which two sets of renders differ by more than noise and `bias` (relative) allow.
pub fn disagreeing(a: &[Vec<f64>], b: &[Vec<f64>], bias: f64) -> Vec<String> {
    let critical = t_critical(ERROR_RATE, 3 * TILES, (a.len().min(b.len()) - 1) as f64);
    let fault = |at: usize| {
        let ((mean_a, error_a), (mean_b, error_b)) = (of(a, at), of(b, at));
        let allowed = critical * error_a.hypot(error_b) + bias * mean_b.abs() + 1e-9;
        ((mean_a - mean_b).abs() > allowed)
            .then(|| format!("tile {}, channel {}: {mean_a:.5} and {mean_b:.5}, allowed {allowed:.5}", at / 3, at % 3))
    };
    (0..3 * TILES).filter_map(fault).collect()
}

/// Checks that `a` agrees with the reference `b`, and that `a` brighter by `planted` (relative) does not.
pub fn agree(what: &str, a: &[Vec<f64>], b: &[Vec<f64>], bias: f64, planted: f64) {
    let found = disagreeing(a, b, bias);
    assert!(found.is_empty(), "{what}: {found:#?}");
    let wrong: Vec<Vec<f64>> = a.iter().map(|image| image.iter().map(|x| x * (1.0 + planted)).collect()).collect();
    assert!(!disagreeing(&wrong, b, bias).is_empty(), "{what}: a picture brighter by {planted} is not detected");
}
