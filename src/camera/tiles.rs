//! Visits pixels in an order that keeps neighbours together.

use rayon::prelude::*;

/// Side of a square tile in pixels. A row of tiles is a band, the unit of work of a thread.
const TILE: usize = 16;

/// Number of pixels in a group, which a thread visits together.
pub const GROUP_SIZE: usize = 8;

/// A pixel of a group, the pixels that a thread visits together.
#[derive(Clone, Copy, Debug)]
pub struct TilePixel {
    /// Column and row of the pixel in the picture.
    pub pixel: (u32, u32),
    /// Row-major index of the pixel in the picture.
    pub index: u64,
    /// Row-major index of the pixel in its band, a row of tiles.
    pub at: usize,
}

/// Number of pixels in a band, the row of tiles that is the unit of work of [`par_pixels`], of a picture of this width
/// in pixels.
pub fn pixels_per_band(width: u32) -> usize {
    width as usize * TILE
}

/// Calls `f(scratch, band, group)` for all pixels of a row-major picture that is cut into `bands` of
/// [`pixels_per_band`] pixels, in groups of [`GROUP_SIZE`] (`None` beyond the edges). Tiles are visited along a Z-order
/// curve, so consecutive groups are neighbours in both directions. Groups depend only on the size of the picture.
/// `scratch` is created once per band or less often, so results must not depend on its content.
pub fn par_pixels<B: Send, S>(
    bands: impl IndexedParallelIterator<Item = B>,
    (width, height): (u32, u32),
    scratch: impl Fn() -> S + Send + Sync,
    f: impl Fn(&mut S, &mut B, &[Option<TilePixel>; GROUP_SIZE]) + Send + Sync,
) {
    let (width, height) = (width as usize, height as usize);
    let even_bits = |i: usize| (i & 1) | (i >> 1 & 2) | (i >> 2 & 4) | (i >> 3 & 8);
    bands.enumerate().for_each_init(scratch, |scratch, (band, mut pixels)| {
        let height = (height - band * TILE).min(TILE);
        for x0 in (0..width).step_by(TILE) {
            for first in (0..TILE * TILE).step_by(GROUP_SIZE) {
                let group = std::array::from_fn(|k| {
                    let (x, dy) = (x0 + even_bits(first + k), even_bits((first + k) >> 1));
                    let y = band * TILE + dy;
                    let place =
                        TilePixel { pixel: (x as u32, y as u32), index: (y * width + x) as u64, at: dy * width + x };
                    (x < width && dy < height).then_some(place)
                });
                if group.iter().any(Option::is_some) {
                    f(scratch, &mut pixels, &group);
                }
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_is_visited_once() {
        for (width, height) in [(1, 1), (16, 16), (37, 5), (100, 33), (3, 70)] {
            let mut pixels = vec![0u32; (width * height) as usize];
            par_pixels(
                pixels.par_chunks_mut(pixels_per_band(width)),
                (width, height),
                || (),
                |(), pixels, places| {
                    for place in places.iter().flatten() {
                        assert_eq!(place.index, u64::from(place.pixel.1 * width + place.pixel.0));
                        pixels[place.at] += 1 + place.index as u32;
                    }
                },
            );
            assert!(pixels.iter().enumerate().all(|(i, &pixel)| pixel == 1 + i as u32), "{width} x {height}");
        }
    }
}
