//! Tiles of constant size: the unit of work of the methods that add to a film.

use crate::camera::{Camera, GROUP, Place};

/// Width and height of a tile in pixels.
const TILE: u32 = 16;
/// Pixels of a tile.
pub(super) const TILE_PIXELS: usize = (TILE * TILE) as usize;

/// What a tile has of a picture.
pub(super) struct TileOf<'p, T> {
    rows: [&'p mut [T]; TILE as usize],
}

impl<T> TileOf<'_, T> {
    /// What is at a slot of the tile, of those that are in the picture.
    #[inline]
    pub fn at(&mut self, slot: usize) -> &mut T {
        &mut self.rows[slot / TILE as usize][slot % TILE as usize]
    }
}

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

    /// Number of pixels of the film.
    pub fn pixels_of_all(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Cuts a picture, stored row by row, into what each tile has of it.
    pub fn cut<'p, T>(&self, picture: &'p mut [T]) -> Vec<TileOf<'p, T>> {
        let none = || TileOf { rows: std::array::from_fn(|_| &mut [][..]) };
        let mut cut: Vec<_> = std::iter::repeat_with(none).take(self.count()).collect();
        for (y, row) in picture.chunks_mut(self.width as usize).enumerate() {
            let tiles = &mut cut[y / TILE as usize * self.across as usize..];
            for (tile, part) in tiles.iter_mut().zip(row.chunks_mut(TILE as usize)) {
                tile.rows[y % TILE as usize] = part;
            }
        }
        cut
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

    /// Pixels of a tile, neighbours together: a group is a block of two rows. [`Place::at`] is the slot in the tile.
    pub fn groups(self, tile: usize) -> impl Iterator<Item = [Option<Place>; GROUP]> {
        let (x0, y0) = (tile as u32 % self.across * TILE, tile as u32 / self.across * TILE);
        let columns = GROUP as u32 / 2;
        let per_row = TILE / columns;
        (0..TILE * TILE / GROUP as u32)
            .map(move |group| {
                let (dx, dy) = (group % per_row * columns, group / per_row * 2);
                std::array::from_fn(|k| {
                    let (dx, dy) = (dx + k as u32 % columns, dy + k as u32 / columns);
                    let (x, y) = (x0 + dx, y0 + dy);
                    (x < self.width && y < self.height).then_some(Place {
                        pixel: (x, y),
                        index: u64::from(self.index(x, y)),
                        at: (dy * TILE + dx) as usize,
                    })
                })
            })
            .filter(|places: &[Option<Place>; GROUP]| places.iter().any(Option::is_some))
    }

    /// Pixels of a tile, in the order of [`Tiles::groups`].
    pub fn pixels(self, tile: usize) -> impl Iterator<Item = Place> {
        self.groups(tile).flat_map(|places| places.into_iter().flatten())
    }
}
