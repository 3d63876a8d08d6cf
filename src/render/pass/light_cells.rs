//! Which light paths belong to which pixels. Pixels are grouped into cells, which are as small as whole numbers of light
//! paths allow. The camera paths of a cell connect to light paths of their own cell, so that light vertices live only
//! while a tile is rendered.

use super::tiles::{SlotPixel, TILE, TILE_PIXELS};
use crate::render::settings::{Counts, LIGHT_PATH_STEPS};
use std::ops::Range;

/// The cells of a picture. Tiles consist of whole cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightCells {
    /// Width and height of a cell (pixels), powers of two.
    size: (u32, u32),
    /// Number of light paths of a cell.
    paths: u32,
    /// Number of light paths that each camera path connects to.
    connections: u32,
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
        let (mut width, mut height) = (1, 1);
        let paths = |area: u32| counts.light_paths * area / LIGHT_PATH_STEPS;
        let is_whole = |area: u32| (counts.light_paths * area).is_multiple_of(LIGHT_PATH_STEPS);
        while width * height < TILE * TILE
            && !(is_whole(width * height) && paths(width * height) >= counts.connections.max(1))
        {
            if width == height { width *= 2 } else { height *= 2 }
        }
        let first = (at.0 / width, at.1 / height);
        let extent = ((at.0 + size.0).div_ceil(width) - first.0, (at.1 + size.1).div_ceil(height) - first.1);
        LightCells {
            size: (width, height),
            paths: paths(width * height),
            connections: counts.connections,
            first,
            extent,
        }
    }

    /// Number of light paths of all cells.
    pub fn count(&self) -> u32 {
        self.extent.0.saturating_mul(self.extent.1).saturating_mul(self.paths)
    }

    /// Number of slots of a block of pixels whose light paths are traced together, before their camera paths: one if
    /// every pixel has light paths of its own; `None` if cells are larger than blocks.
    pub fn slots_together(&self, block: (u32, u32)) -> Option<usize> {
        match self.size {
            (1, 1) => Some(1),
            (width, height) if width <= block.0 && height <= block.1 => Some((block.0 * block.1) as usize),
            _ => None,
        }
    }

    /// Index in its tile of the cell of a pixel.
    fn slot(&self, pixel: SlotPixel) -> usize {
        let (x, y) = (pixel.x % TILE / self.size.0, pixel.y % TILE / self.size.1);
        (y * (TILE / self.size.0) + x) as usize
    }

    /// The cell whose first pixel (top left) is this one; `None` if the pixel is not the first, or if the cell has no
    /// pixel in the window.
    pub fn starting_at(&self, pixel: SlotPixel) -> Option<Cell> {
        let (width, height) = self.size;
        let starts = pixel.x.is_multiple_of(width) && pixel.y.is_multiple_of(height);
        let columns = self.first.0..self.first.0 + self.extent.0;
        let rows = self.first.1..self.first.1 + self.extent.1;
        let inside = columns.contains(&(pixel.x / width)) && rows.contains(&(pixel.y / height));
        (starts && inside).then(|| self.cell(pixel))
    }

    /// The cell of a pixel in the window.
    #[inline]
    pub fn cell(&self, pixel: SlotPixel) -> Cell {
        let (x, y) = (pixel.x / self.size.0 - self.first.0, pixel.y / self.size.1 - self.first.1);
        Cell { slot: self.slot(pixel), first: (y * self.extent.0 + x) * self.paths }
    }

    /// Indices of a cell's light paths in the iteration.
    pub fn paths(&self, cell: Cell) -> Range<u32> {
        cell.first..cell.first + self.paths
    }
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

    /// The vertices of the light paths that the camera path of a pixel connects to. Pixels of a cell share its light
    /// paths evenly.
    pub fn connected(&self, cells: &LightCells, pixel: SlotPixel) -> Range<usize> {
        if cells.connections == 0 {
            return 0..0;
        }
        let (width, height) = cells.size;
        let order = pixel.y % height * width + pixel.x % width;
        let first = (order * cells.paths / (width * height)).min(cells.paths - cells.connections);
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

    /// By default light path number i starts for pixel number i, row by row.
    #[test]
    fn by_default_every_pixel_has_its_own_light_path() {
        let cells = LightCells::new(Counts::default(), (13, 7), (40, 43));
        assert_eq!((cells.count(), cells.slots_together((4, 2))), (40 * 43, Some(1)));
        let cell = cells.starting_at(SlotPixel { x: 13 + 5, y: 7 + 2 }).unwrap();
        assert_eq!(cell.first, 2 * 40 + 5);
        assert!(cells.starting_at(SlotPixel { x: 12, y: 7 }).is_none());
    }
}
