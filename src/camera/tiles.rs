//! Pixels in an order that keeps neighbours together.

use rayon::prelude::*;

/// Rows of pixels per unit of work, and width of the tiles in which they are visited.
const TILE: usize = 16;

/// Calls `f(scratch, (x, y), pixel)` for every pixel of a picture stored row by row, in tiles and within them along a Z-order curve: neighbours
/// in time are neighbours in the picture, in both directions. `scratch` is made once per unit of work or less often, so nothing may depend
/// on what is in it.
pub fn par_pixels<T: Send, S>(
    pixels: &mut [T],
    width: u32,
    scratch: impl Fn() -> S + Send + Sync,
    f: impl Fn(&mut S, (u32, u32), &mut T) + Send + Sync,
) {
    let width = width as usize;
    let even_bits = |i: usize| (i & 1) | (i >> 1 & 2) | (i >> 2 & 4) | (i >> 3 & 8);
    pixels.par_chunks_mut(width * TILE).enumerate().for_each_init(scratch, |scratch, (band, pixels)| {
        let height = pixels.len() / width;
        for x0 in (0..width).step_by(TILE) {
            for i in 0..TILE * TILE {
                let (x, dy) = (x0 + even_bits(i), even_bits(i >> 1));
                if x < width && dy < height {
                    f(scratch, (x as u32, (band * TILE + dy) as u32), &mut pixels[dy * width + x]);
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
            par_pixels(&mut pixels, width, || (), |(), (x, y), pixel| *pixel += 1 + y * width + x);
            assert!(pixels.iter().enumerate().all(|(i, &pixel)| pixel == 1 + i as u32), "{width} x {height}");
        }
    }
}
