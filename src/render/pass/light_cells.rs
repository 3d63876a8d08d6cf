//! Which light paths belong to which pixels. Pixels are grouped into cells: single pixels, or whole tiles if pixels share
//! light paths. The camera paths of a cell connect to light paths of their own cell, so that light vertices live only
//! while a tile is rendered.
//!
//! Pixels that connect to the same light path have correlated noise, which denoisers take for texture if the pixels are
//! neighbours. So the pixels of a tile that share light paths form a lattice, whose points are as far apart as possible.

use super::tiles::{SlotPixel, TILE, TILE_PIXELS};
use crate::render::settings::{Counts, LIGHT_PATH_STEPS};
use std::ops::Range;

/// The cells of a picture. Tiles consist of whole cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightCells {
    /// Side of a cell (pixels): 1, or that of a tile.
    side: u32,
    /// Number of light paths of a cell.
    paths: u32,
    /// Number of light paths that each camera path connects to.
    connections: u32,
    /// Number of groups of light paths of a cell; a camera path connects to one group.
    groups: u32,
    /// Number of groups by which the group of a pixel differs from that of the pixel above it.
    shift: u32,
    /// Column and row of the first cell, and number of columns and rows.
    first: (u32, u32),
    extent: (u32, u32),
}

/// Light paths of a cell of pixels.
#[derive(Clone, Copy)]
pub(super) struct Cell {
    /// Index of the cell in its tile.
    pub slot: usize,
    /// Index of its first light path in the iteration. Light paths of a cell have consecutive indices.
    pub first: u32,
}

impl LightCells {
    /// The cells of a window of the picture, given by the column and row of its first pixel and by its size.
    pub fn new(counts: Counts, at: (u32, u32), size: (u32, u32)) -> LightCells {
        let of_pixel = counts.light_paths / LIGHT_PATH_STEPS;
        let is_alone = counts.light_paths.is_multiple_of(LIGHT_PATH_STEPS) && of_pixel >= counts.connections.max(1);
        let side = if is_alone { 1 } else { TILE };
        let paths = counts.light_paths * side * side / LIGHT_PATH_STEPS;
        let groups = (paths / counts.connections.max(1)).max(1);
        let first = (at.0 / side, at.1 / side);
        let extent = ((at.0 + size.0).div_ceil(side) - first.0, (at.1 + size.1).div_ceil(side) - first.1);
        let shift = if is_alone { 0 } else { widest_lattice(groups) };
        LightCells { side, paths, connections: counts.connections, groups, shift, first, extent }
    }

    /// Number of light paths of all cells.
    pub fn count(&self) -> u32 {
        self.extent.0.saturating_mul(self.extent.1).saturating_mul(self.paths)
    }

    /// Whether every pixel has light paths of its own.
    pub fn are_pixels(&self) -> bool {
        self.side == 1
    }

    /// Index in its tile of the cell of a pixel.
    fn slot(&self, pixel: SlotPixel) -> usize {
        let (x, y) = (pixel.x % TILE / self.side, pixel.y % TILE / self.side);
        (y * (TILE / self.side) + x) as usize
    }

    /// The cell whose first pixel (top left) is this one; `None` if the pixel is not the first, or if the cell has no
    /// pixel in the window.
    pub fn starting_at(&self, pixel: SlotPixel) -> Option<Cell> {
        let side = self.side;
        let starts = pixel.x.is_multiple_of(side) && pixel.y.is_multiple_of(side);
        let columns = self.first.0..self.first.0 + self.extent.0;
        let rows = self.first.1..self.first.1 + self.extent.1;
        let inside = columns.contains(&(pixel.x / side)) && rows.contains(&(pixel.y / side));
        (starts && inside).then(|| self.cell(pixel))
    }

    /// The cell of a pixel in the window.
    #[inline]
    pub fn cell(&self, pixel: SlotPixel) -> Cell {
        let (x, y) = (pixel.x / self.side - self.first.0, pixel.y / self.side - self.first.1);
        Cell { slot: self.slot(pixel), first: (y * self.extent.0 + x) * self.paths }
    }

    /// Indices of a cell's light paths in the iteration.
    pub fn paths(&self, cell: Cell) -> Range<u32> {
        cell.first..cell.first + self.paths
    }

    /// Index in its cell of the first light path of the group that the camera path of a pixel connects to.
    #[inline]
    fn group_of(&self, pixel: SlotPixel) -> u32 {
        let (x, y) = (pixel.x % self.side, pixel.y % self.side);
        (x + y * self.shift) % self.groups * self.connections.max(1)
    }

    /// Index of the light path whose wavelength the camera path of a pixel takes, as all of its group do.
    #[inline]
    pub fn wavelength_of_pixel(&self, pixel: SlotPixel) -> u32 {
        self.cell(pixel).first + self.group_of(pixel)
    }

    /// Index of the light path whose wavelength a light path of a cell takes.
    #[inline]
    pub fn wavelength_of_path(&self, cell: Cell, index: u32) -> u32 {
        index - (index - cell.first) % self.connections.max(1)
    }
}

/// The shift between rows for which the pixels of one of `groups` groups are farthest apart.
fn widest_lattice(groups: u32) -> u32 {
    let nearest = |shift: u32| {
        let in_row = |y: u32| {
            let x = y * shift % groups;
            let x = x.min(groups - x);
            x * x + y * y
        };
        (1..TILE).map(in_row).chain([groups * groups]).min()
    };
    (0..groups.min(TILE * TILE)).max_by_key(|&shift| nearest(shift)).unwrap_or(0)
}

/// Index of the light paths of a tile that have been traced so far, and of their vertices.
pub(super) struct TracedPaths {
    /// For each light path, the end of its vertices.
    ends: Vec<usize>,
    /// By the index of a cell in its tile: the number of light paths that were traced before its own.
    before: [usize; TILE_PIXELS],
}

impl TracedPaths {
    /// Starts without light paths.
    pub fn new() -> TracedPaths {
        TracedPaths { ends: Vec::new(), before: [0; TILE_PIXELS] }
    }

    /// Forgets all light paths.
    pub fn clear(&mut self) {
        self.ends.clear();
    }

    /// Notes that the light paths of a cell follow.
    pub fn start_cell(&mut self, cell: Cell) {
        self.before[cell.slot] = self.ends.len();
    }

    /// Notes that a light path has been traced, and that there are `vertices` vertices now.
    pub fn end_path(&mut self, vertices: usize) {
        self.ends.push(vertices);
    }

    /// The vertices of the light paths that the camera path of a pixel connects to.
    pub fn connected(&self, cells: &LightCells, pixel: SlotPixel) -> Range<usize> {
        if cells.connections == 0 {
            return 0..0;
        }
        let first = cells.group_of(pixel);
        let first = self.before[cells.slot(pixel)] + first as usize;
        let start = if first == 0 { 0 } else { self.ends[first - 1] };
        start..self.ends[first + cells.connections as usize - 1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For every number of light paths and connections, and windows anywhere: each light path belongs to one cell, and
    /// each pixel connects to the asked number of different light paths of its cell.
    #[test]
    fn every_light_path_is_traced_once_and_every_pixel_has_its_connections() {
        for (light_paths, connections) in [(1, 1), (1, 4), (3, 1), (4, 2), (8, 1), (16, 0), (16, 1), (16, 4), (64, 4)] {
            let counts = Counts { light_paths, connections, merging: 1.0 };
            for (at, size) in [((0, 0), (70, 50)), ((13, 7), (40, 43)), ((69, 49), (1, 1))] {
                let cells = LightCells::new(counts, at, size);
                let mut indices = Vec::new();
                for (tile_x, tile_y) in (0..8).flat_map(|y| (0..8).map(move |x| (x, y))) {
                    let mut traced = TracedPaths::new();
                    let slots = || (0..TILE).flat_map(|y| (0..TILE).map(move |x| (x, y)));
                    let pixel = |(x, y): (u32, u32)| SlotPixel { x: tile_x * TILE + x, y: tile_y * TILE + y };
                    for cell in slots().filter_map(|slot| cells.starting_at(pixel(slot))) {
                        traced.start_cell(cell);
                        for index in cells.paths(cell) {
                            indices.push(index);
                            // One vertex per light path.
                            traced.end_path(traced.ends.len() + 1);
                        }
                    }
                    for pixel in slots().map(pixel) {
                        let inside = |x: u32, at: u32, size: u32| (at..at + size).contains(&x);
                        if inside(pixel.x, at.0, size.0) && inside(pixel.y, at.1, size.1) {
                            assert_eq!(traced.connected(&cells, pixel).len(), connections as usize);
                        }
                    }
                }
                indices.sort_unstable();
                assert!(indices.into_iter().eq(0..cells.count()), "{counts:?} {at:?} {size:?}");
                let wanted = counts.light_paths_per_pixel() * f64::from(size.0 * size.1);
                assert!(f64::from(cells.count()) >= wanted);
            }
        }
    }

    /// Pixels that share light paths are at least as far apart as squares of their share of the tile are wide, nearly.
    #[test]
    fn neighbours_share_no_light_paths() {
        assert_eq!(LightCells::new(Counts::PATHS, (0, 0), (TILE, TILE)).group_of(SlotPixel { x: 3, y: 2 }), 0);
        let counts = [(4, 2, 32), (8, 1, 137), (1, 1, 16), (4, 1, 65), (1, 2, 8), (16, 2, 137)];
        for (light_paths, connections, apart2) in counts {
            let cells = LightCells::new(Counts { light_paths, connections, merging: 1.0 }, (0, 0), (TILE, TILE));
            for group in 0..cells.groups {
                let pixels = (0..TILE).flat_map(|y| (0..TILE).map(move |x| SlotPixel { x, y }));
                let of_group: Vec<SlotPixel> =
                    pixels.filter(|&pixel| cells.group_of(pixel) == group * connections).collect();
                assert!(!of_group.is_empty());
                for (i, a) in of_group.iter().enumerate() {
                    for b in &of_group[..i] {
                        let distance2 = a.x.abs_diff(b.x).pow(2) + a.y.abs_diff(b.y).pow(2);
                        assert!(distance2 >= apart2, "{light_paths} {connections}: {distance2}");
                    }
                }
            }
        }
    }

    /// By default light path number i starts for pixel number i, row by row.
    #[test]
    fn by_default_every_pixel_has_its_own_light_path() {
        let cells = LightCells::new(Counts::default(), (13, 7), (40, 43));
        assert_eq!((cells.count(), cells.are_pixels()), (40 * 43, true));
        let cell = cells.starting_at(SlotPixel { x: 13 + 5, y: 7 + 2 }).unwrap();
        assert_eq!(cell.first, 2 * 40 + 5);
        assert!(cells.starting_at(SlotPixel { x: 12, y: 7 }).is_none());
    }
}
