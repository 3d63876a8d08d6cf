//! Tiles of constant size: the unit of work of methods whose paths add light to any pixel.

use crate::camera::{Camera, GROUP_SIZE, TilePixel};
use crate::film::Size;

/// Width and height of a tile (pixels).
pub const TILE: u32 = 16;
/// Pixels of a tile.
pub(super) const TILE_PIXELS: usize = (TILE * TILE) as usize;

/// The tiles of the film. If the film is a window, they are tiles of the whole picture, so that sums over a tile are the
/// same in both.
#[derive(Clone, Copy)]
pub(super) struct Tiles {
    width: u32,
    height: u32,
    /// Size of the whole picture, and the first column and row of the film in it (pixels).
    whole: [(u32, u32); 2],
    across: u32,
    down: u32,
}

/// A tile of the whole picture.
#[derive(Clone, Copy)]
pub(super) struct WholeTile {
    /// Index among the tiles of the film; `None` if the tile lies outside the film.
    pub tile: Option<usize>,
    /// First column and row of the tile in the whole picture (pixels).
    corner: (u32, u32),
}

/// Width and height of a block of pixels.
const BLOCK: (u32, u32) = (GROUP_SIZE as u32 / 2, 2);

/// Column and row of a slot of a tile in the whole picture. It may lie outside the picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct SlotPixel {
    pub x: u32,
    pub y: u32,
}

/// A block of neighbouring pixels in a tile of the whole picture.
pub(super) struct PixelBlock {
    /// Place of each pixel in the whole picture, or beyond its edges.
    pub pixels: [SlotPixel; GROUP_SIZE],
    /// Place of each pixel on the film; `None` for pixels outside it.
    pub places: [Option<TilePixel>; GROUP_SIZE],
}

impl Tiles {
    pub fn new(camera: &Camera) -> Tiles {
        let ((width, height), whole) = (camera.size(), camera.whole());
        let (x, y) = (whole[1].0 % TILE, whole[1].1 % TILE);
        Tiles { width, height, whole, across: (x + width).div_ceil(TILE), down: (y + height).div_ceil(TILE) }
    }

    pub fn count(&self) -> usize {
        self.across as usize * self.down as usize
    }

    /// All tiles of the whole picture, row by row.
    pub fn whole_tiles(self) -> impl Iterator<Item = WholeTile> {
        let [size, at] = self.whole;
        let (across, down) = (size.0.div_ceil(TILE), size.1.div_ceil(TILE));
        (0..down).flat_map(move |y| (0..across).map(move |x| (x, y))).map(move |(x, y)| {
            let (i, j) = (x.wrapping_sub(at.0 / TILE), y.wrapping_sub(at.1 / TILE));
            let tile = (i < self.across && j < self.down).then_some((j * self.across + i) as usize);
            WholeTile { tile, corner: (x * TILE, y * TILE) }
        })
    }

    /// Tiles of the whole picture of which the film contains at least a part.
    pub fn film_tiles(self) -> impl Iterator<Item = WholeTile> {
        self.whole_tiles().filter(|tile| tile.tile.is_some())
    }

    /// Width and height of the film.
    pub fn size(&self) -> Size {
        (self.width, self.height).into()
    }

    /// Index of the film's pixel at column `x` and row `y`, row by row.
    #[inline]
    pub fn index(&self, x: u32, y: u32) -> u32 {
        y * self.width + x
    }

    /// Index of the tile that holds the pixel `index` (row by row), and the pixel's index in the tile.
    #[inline]
    pub fn place(&self, index: u32) -> (usize, usize) {
        let first = (self.whole[1].0 % TILE, self.whole[1].1 % TILE);
        let (x, y) = (index % self.width + first.0, index / self.width + first.1);
        ((y / TILE * self.across + x / TILE) as usize, (y % TILE * TILE + x % TILE) as usize)
    }

    /// Position of pixel `index` in buffers that are stored tile by tile.
    #[inline]
    pub fn slot(&self, index: u32) -> usize {
        let (tile, slot) = self.place(index);
        tile * TILE_PIXELS + slot
    }

    /// All pixels of a tile of the whole picture, in blocks of two rows. [`TilePixel::at`] is the pixel's index in the
    /// tile.
    pub fn blocks(self, tile: WholeTile) -> impl Iterator<Item = PixelBlock> {
        let at = self.whole[1];
        let (columns, rows) = BLOCK;
        let per_row = TILE / columns;
        (0..TILE * TILE / GROUP_SIZE as u32).map(move |group| {
            let (dx, dy) = (group % per_row * columns, group / per_row * rows);
            let slots: [(u32, u32); GROUP_SIZE] =
                std::array::from_fn(|k| (dx + k as u32 % columns, dy + k as u32 / columns));
            let pixels = slots.map(|(dx, dy)| (tile.corner.0 + dx, tile.corner.1 + dy));
            let place = |k: usize| {
                let ((dx, dy), (x, y)) = (slots[k], pixels[k]);
                let (x, y) = (x.checked_sub(at.0)?, y.checked_sub(at.1)?);
                (x < self.width && y < self.height).then_some(TilePixel {
                    pixel: (x, y),
                    index: u64::from(self.index(x, y)),
                    at: (dy * TILE + dx) as usize,
                })
            };
            PixelBlock { pixels: pixels.map(|(x, y)| SlotPixel { x, y }), places: std::array::from_fn(place) }
        })
    }

    /// Pixels of a tile that are on the film, in the blocks of [`Tiles::blocks`].
    pub fn film_blocks(self, tile: usize) -> impl Iterator<Item = [Option<TilePixel>; GROUP_SIZE]> {
        let at = self.whole[1];
        let (i, j) = (tile as u32 % self.across + at.0 / TILE, tile as u32 / self.across + at.1 / TILE);
        self.blocks(WholeTile { tile: Some(tile), corner: (i * TILE, j * TILE) })
            .map(|block| block.places)
            .filter(|places| places.iter().any(Option::is_some))
    }

    /// Pixels of a tile that are on the film, one by one.
    pub fn pixels(self, tile: usize) -> impl Iterator<Item = TilePixel> {
        self.film_blocks(tile).flat_map(|places| places.into_iter().flatten())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Projection;
    use crate::math::{DVec3, Mat3, Vec2};

    /// Every pixel is in one tile, at the slot of its index.
    #[test]
    fn windows_have_the_tiles_of_the_whole_picture() {
        let projection = Projection::Perspective(Vec2::ONE);
        let whole = Camera::new(DVec3::ZERO, Mat3::IDENTITY, projection, (0.0, 1.0), (70, 50));
        for [x, y, width, height] in [[0, 0, 70, 50], [16, 32, 16, 16], [13, 7, 40, 43], [69, 49, 1, 1]] {
            let camera = whole.crop([x, y, width, height]);
            let tiles = Tiles::new(&camera);
            let (mut on_film, mut all, mut numbers) = (Vec::new(), Vec::<(u32, u32)>::new(), Vec::<usize>::new());
            for tile in tiles.whole_tiles() {
                numbers.extend(tile.tile);
                for block in tiles.blocks(tile) {
                    let on_picture = |pixel: &&SlotPixel| pixel.x < 70 && pixel.y < 50;
                    all.extend(block.pixels.iter().filter(on_picture).map(|pixel| (pixel.y, pixel.x)));
                    for (pixel, place) in block.pixels.iter().zip(&block.places) {
                        let Some(place) = place else { continue };
                        assert_eq!((pixel.x, pixel.y), (place.pixel.0 + x, place.pixel.1 + y));
                        assert_eq!(tiles.place(place.index as u32), (tile.tile.unwrap(), place.at));
                        on_film.push(place.index);
                    }
                }
            }
            let by_tile: Vec<u64> =
                tiles.film_tiles().flat_map(|tile| tiles.pixels(tile.tile.unwrap())).map(|place| place.index).collect();
            assert_eq!(on_film, by_tile);
            assert!(numbers.iter().copied().eq(0..tiles.count()));
            on_film.sort_unstable();
            all.sort_unstable();
            assert!(on_film.into_iter().eq(0..u64::from(width * height)));
            assert!(all.into_iter().eq((0..50).flat_map(|y| (0..70).map(move |x| (y, x)))));
        }
    }
}
