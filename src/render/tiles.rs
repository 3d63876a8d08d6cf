//! Tiles of constant size: the unit of work of the methods that add to a film.

use crate::camera::Camera;

/// Width and height of a tile in pixels.
const TILE: u32 = 16;
/// Pixels of a tile.
pub(super) const TILE_PIXELS: usize = (TILE * TILE) as usize;

/// The film's tiles.
#[derive(Clone, Copy)]
pub(super) struct Tiles {
    width: u32,
    height: u32,
    across: u32,
}

impl Tiles {
    pub fn new(camera: &Camera) -> Tiles {
        let (width, height) = camera.size();
        Tiles { width, height, across: width.div_ceil(TILE) }
    }

    pub fn count(&self) -> usize {
        self.across as usize * self.height.div_ceil(TILE) as usize
    }

    /// Index of a pixel, row by row.
    #[inline]
    pub fn index(&self, x: u32, y: u32) -> u32 {
        y * self.width + x
    }

    /// The tile of pixel `index` (row by row), and its slot there.
    #[inline]
    pub fn place(&self, index: u32) -> (usize, usize) {
        let (x, y) = (index % self.width, index / self.width);
        ((y / TILE * self.across + x / TILE) as usize, (y % TILE * TILE + x % TILE) as usize)
    }

    /// Where pixel `index` is kept, tile by tile.
    #[inline]
    pub fn slot(&self, index: u32) -> usize {
        let (tile, slot) = self.place(index);
        tile * TILE_PIXELS + slot
    }

    /// Pixels of a tile: slot in the tile and place on the film.
    pub fn pixels(self, tile: usize) -> impl Iterator<Item = (usize, (u32, u32))> {
        let (x0, y0) = (tile as u32 % self.across * TILE, tile as u32 / self.across * TILE);
        (0..TILE * TILE)
            .map(move |i| (i as usize, (x0 + i % TILE, y0 + i / TILE)))
            .filter(move |(_, (x, y))| *x < self.width && *y < self.height)
    }
}
