//! Smaller pictures compared tile by tile and channel by channel.

use caustique::render::Rendered;

/// Pixels a side.
pub const SIZE: u32 = 16;
/// Pixels a side of a tile.
pub const TILE: u32 = 8;
/// Tiles of a picture.
pub const TILES: usize = (SIZE / TILE * SIZE / TILE) as usize;

/// Tile means of every channel.
pub fn tiles(rendered: &Rendered) -> Vec<f64> {
    let own = rendered.settings.levels.own();
    let mut sums = vec![0.0; 3 * TILES];
    for (index, pixel) in (0..).zip(&rendered.pixels) {
        let tile = (index / SIZE / TILE * (SIZE / TILE) + index % SIZE / TILE) as usize;
        for c in 0..3 {
            sums[3 * tile + c] += pixel.levels[own].mean[c] / f64::from(TILE * TILE);
        }
    }
    sums
}
