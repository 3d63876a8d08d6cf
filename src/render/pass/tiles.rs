//! Tiles of constant size: the unit of work of the methods that add to a film.

use crate::camera::{Camera, GROUP_SIZE, TilePixel};
use crate::film::Size;

/// Width and height of a tile in pixels.
pub const TILE: u32 = 16;
/// Pixels of a tile.
pub(super) const TILE_PIXELS: usize = (TILE * TILE) as usize;

/// The film's tiles. They are tiles of the whole picture, of which the film may be a window, so that sums over them are
/// the same there.
#[derive(Clone, Copy)]
pub(super) struct Tiles {
    width: u32,
    height: u32,
    /// Size of the whole picture, and where the film begins in it.
    whole: [(u32, u32); 2],
    across: u32,
    down: u32,
}

/// A tile of the whole picture.
#[derive(Clone, Copy)]
pub(super) struct WholeTile {
    /// Its number among the film's tiles, if it is one.
    pub tile: Option<usize>,
    /// Its first column and row.
    corner: (u32, u32),
}

/// Pixels of a tile of the whole picture, neighbours together.
pub(super) struct Group {
    /// Their indices in the whole picture, row by row.
    pub keys: [Option<u64>; GROUP_SIZE],
    /// Those of them that are on the film.
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

    /// The tiles of the whole picture, row by row.
    pub fn of_whole(self) -> impl Iterator<Item = WholeTile> {
        let [size, at] = self.whole;
        let (across, down) = (size.0.div_ceil(TILE), size.1.div_ceil(TILE));
        (0..down).flat_map(move |y| (0..across).map(move |x| (x, y))).map(move |(x, y)| {
            let (i, j) = (x.wrapping_sub(at.0 / TILE), y.wrapping_sub(at.1 / TILE));
            let tile = (i < self.across && j < self.down).then_some((j * self.across + i) as usize);
            WholeTile { tile, corner: (x * TILE, y * TILE) }
        })
    }

    /// Those of them that are the film's.
    pub fn of_film(self) -> impl Iterator<Item = WholeTile> {
        self.of_whole().filter(|tile| tile.tile.is_some())
    }

    /// Width and height of the film.
    pub fn size(&self) -> Size {
        (self.width, self.height).into()
    }

    /// Index of a pixel, row by row.
    #[inline]
    pub fn index(&self, x: u32, y: u32) -> u32 {
        y * self.width + x
    }

    /// The tile of pixel `index` (row by row), and its slot there.
    #[inline]
    pub fn place(&self, index: u32) -> (usize, usize) {
        let first = (self.whole[1].0 % TILE, self.whole[1].1 % TILE);
        let (x, y) = (index % self.width + first.0, index / self.width + first.1);
        ((y / TILE * self.across + x / TILE) as usize, (y % TILE * TILE + x % TILE) as usize)
    }

    /// Where pixel `index` is kept, tile by tile.
    #[inline]
    pub fn slot(&self, index: u32) -> usize {
        let (tile, slot) = self.place(index);
        tile * TILE_PIXELS + slot
    }

    /// All pixels of a tile of the whole picture: a group is a block of two rows. [`TilePixel::at`] is the slot in the tile.
    pub fn all_groups(self, tile: WholeTile) -> impl Iterator<Item = Group> {
        let [size, at] = self.whole;
        let columns = GROUP_SIZE as u32 / 2;
        let per_row = TILE / columns;
        (0..TILE * TILE / GROUP_SIZE as u32).map(move |group| {
            let (dx, dy) = (group % per_row * columns, group / per_row * 2);
            let slots: [(u32, u32); GROUP_SIZE] =
                std::array::from_fn(|k| (dx + k as u32 % columns, dy + k as u32 / columns));
            let pixels = slots.map(|(dx, dy)| (tile.corner.0 + dx, tile.corner.1 + dy));
            let key = |(x, y): (u32, u32)| {
                (x < size.0 && y < size.1).then(|| u64::from(y) * u64::from(size.0) + u64::from(x))
            };
            let place = |k: usize| {
                let ((dx, dy), (x, y)) = (slots[k], pixels[k]);
                let (x, y) = (x.checked_sub(at.0)?, y.checked_sub(at.1)?);
                (x < self.width && y < self.height).then_some(TilePixel {
                    pixel: (x, y),
                    index: u64::from(self.index(x, y)),
                    at: (dy * TILE + dx) as usize,
                })
            };
            Group { keys: pixels.map(key), places: std::array::from_fn(place) }
        })
    }

    /// The film's pixels of one of its tiles, in the order of [`Tiles::all_groups`].
    pub fn groups(self, tile: usize) -> impl Iterator<Item = [Option<TilePixel>; GROUP_SIZE]> {
        let at = self.whole[1];
        let (i, j) = (tile as u32 % self.across + at.0 / TILE, tile as u32 / self.across + at.1 / TILE);
        self.all_groups(WholeTile { tile: Some(tile), corner: (i * TILE, j * TILE) })
            .map(|group| group.places)
            .filter(|places| places.iter().any(Option::is_some))
    }

    /// The same, one after the other.
    pub fn pixels(self, tile: usize) -> impl Iterator<Item = TilePixel> {
        self.groups(tile).flat_map(|places| places.into_iter().flatten())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Projection;
    use crate::math::{DVec3, Mat3, Vec2};

    /// Tiles of a window are those of the whole picture; every pixel is in one, where its index says.
    #[test]
    fn windows_have_tiles_of_the_whole_picture() {
        let projection = Projection::Perspective(Vec2::ONE);
        let whole = Camera::new(DVec3::ZERO, Mat3::IDENTITY, projection, (0.0, 1.0), (70, 50));
        for [x, y, width, height] in [[0, 0, 70, 50], [16, 32, 16, 16], [13, 7, 40, 43], [69, 49, 1, 1]] {
            let camera = whole.crop([x, y, width, height]);
            let tiles = Tiles::new(&camera);
            let (mut on_film, mut keys, mut numbers) = (Vec::new(), Vec::<u64>::new(), Vec::<usize>::new());
            for tile in tiles.of_whole() {
                numbers.extend(tile.tile);
                for group in tiles.all_groups(tile) {
                    keys.extend(group.keys.iter().flatten());
                    for (key, place) in group.keys.iter().zip(&group.places) {
                        let Some(place) = place else { continue };
                        assert_eq!(*key, Some(camera.pixel_key(place.pixel)));
                        assert_eq!(tiles.place(place.index as u32), (tile.tile.unwrap(), place.at));
                        on_film.push(place.index);
                    }
                }
            }
            let by_tile: Vec<u64> =
                tiles.of_film().flat_map(|tile| tiles.pixels(tile.tile.unwrap())).map(|place| place.index).collect();
            assert_eq!(on_film, by_tile);
            assert!(numbers.iter().copied().eq(0..tiles.count()));
            on_film.sort_unstable();
            keys.sort_unstable();
            assert!(on_film.into_iter().eq(0..u64::from(width * height)) && keys.into_iter().eq(0..70 * 50));
        }
    }
}
