//! Grids of values over a box: the density of a heterogeneous medium, and the light that it emits.

mod emission;
mod ray;

pub use emission::EmissionGrid;
pub use ray::{GridFlight, GridRay, Proxy};

use crate::math::{Rgb, Vec3};

/// Number of cells along each edge of a block.
const BLOCK_CELLS: u32 = 8;

/// A dense grid of values over a box. Between the centres of cells, values are interpolated linearly. In the outer half
/// of the outermost cells they are constant.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Number of cells along x, y and z, each at least 1.
    size: [u32; 3],
    /// Number of values per cell: 1 or 3.
    channels: usize,
    /// Lower and upper corner of the box (m), in the space of the object.
    bounds: [Vec3; 2],
    /// The values, x fastest, then y, then z; the channels of a cell are neighbours.
    values: Vec<f32>,
}

impl Grid {
    /// A grid of `size` cells with 1 or 3 `channels` over the box between the corners `bounds` (m). `None` if a size is
    /// 0, if the number of values does not fit, if a value is negative or not finite, or if the box has no volume.
    pub fn new(size: [u32; 3], channels: usize, bounds: [Vec3; 2], values: Vec<f32>) -> Option<Grid> {
        let cells = size.iter().try_fold(1usize, |cells, &n| cells.checked_mul(n as usize))?;
        let extent = bounds[1] - bounds[0];
        let fits = cells > 0 && matches!(channels, 1 | 3) && cells.checked_mul(channels) == Some(values.len());
        let has_volume = extent.is_finite() && bounds[0].is_finite() && extent.min_element() > 0.0;
        let valid = fits && has_volume && values.iter().all(|x| x.is_finite() && *x >= 0.0);
        valid.then_some(Grid { size, channels, bounds, values })
    }

    /// Number of cells along x, y and z.
    pub fn size(&self) -> [u32; 3] {
        self.size
    }

    /// Lower and upper corner of the box (m), in the space of the object.
    pub fn bounds(&self) -> [Vec3; 2] {
        self.bounds
    }

    /// Number of values per cell: 1 or 3.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Number of cells per metre along each axis.
    #[inline]
    fn cells_per_metre(&self) -> Vec3 {
        let [low, high] = self.bounds;
        Vec3::from_array(self.size.map(|n| n as f32)) / (high - low)
    }

    /// Position of a point of the object's space in cells: the centre of the first cell is at 1/2.
    #[inline]
    pub fn to_cells(&self, p: Vec3) -> Vec3 {
        (p - self.bounds[0]) * self.cells_per_metre()
    }

    /// Index of the lower cell and weight of the upper cell at position `x` (cells) along an axis, and the stride to the
    /// upper cell: 1, or 0 at the ends.
    #[inline]
    fn between(&self, axis: usize, x: f32) -> (usize, f32, usize) {
        let last = self.size[axis] - 1;
        let x = (x - 0.5).clamp(0.0, last as f32);
        let lower = (x as u32).min(last);
        (lower as usize, x - lower as f32, usize::from(lower < last))
    }

    /// The interpolated value of one channel at position `p` in cells.
    #[inline]
    fn channel_at(&self, p: Vec3, channel: usize) -> f32 {
        let [nx, ny, _] = self.size.map(|n| n as usize);
        let [(x, fx, dx), (y, fy, dy), (z, fz, dz)] =
            [self.between(0, p.x), self.between(1, p.y), self.between(2, p.z)];
        let (dx, dy, dz) = (dx * self.channels, dy * nx * self.channels, dz * nx * ny * self.channels);
        let at = ((z * ny + y) * nx + x) * self.channels + channel;
        let lerp = |a: f32, b: f32, f: f32| a + (b - a) * f;
        let row = |at: usize| lerp(self.values[at], self.values[at + dx], fx);
        let plane = |at: usize| lerp(row(at), row(at + dy), fy);
        lerp(plane(at), plane(at + dz), fz)
    }

    /// The interpolated values at position `p` in cells; a single channel counts three times.
    #[inline]
    pub fn color_at(&self, p: Vec3) -> Rgb {
        match self.channels {
            1 => Rgb::splat(self.channel_at(p, 0)),
            _ => Rgb::new(self.channel_at(p, 0), self.channel_at(p, 1), self.channel_at(p, 2)),
        }
    }

    /// Mean over the box; a single channel counts three times. Interpolation does not change it.
    fn mean(&self) -> Rgb {
        let mean = |channel: usize| {
            let values = self.values.iter().skip(channel).step_by(self.channels);
            (values.map(|&x| f64::from(x)).sum::<f64>() / (self.values.len() / self.channels) as f64) as f32
        };
        if self.channels == 1 { Rgb::splat(mean(0)) } else { Rgb::new(mean(0), mean(1), mean(2)) }
    }

    /// Means of the interpolated values of a grid of one channel in each cell, in the order of the cells.
    fn cell_means(&self) -> Vec<f32> {
        let [nx, ny, nz] = self.size.map(|n| n as usize);
        let mut means = self.values.clone();
        // The mean of a linear interpolant over a cell weighs its three neighbours along an axis by 1/8, 6/8 and 1/8.
        for (stride, n) in [(1, nx), (nx, ny), (nx * ny, nz)] {
            let before = means.clone();
            for (at, mean) in means.iter_mut().enumerate() {
                let i = at / stride % n;
                let lower = before[if i > 0 { at - stride } else { at }];
                let upper = before[if i + 1 < n { at + stride } else { at }];
                *mean = 0.125 * lower + 0.75 * before[at] + 0.125 * upper;
            }
        }
        means
    }
}

/// Bounds of the density in a block of cells, and its mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    low: f32,
    high: f32,
    mean: f32,
}

/// The density of a heterogeneous medium: the factor by which its coefficients are multiplied inside a box. Outside the
/// box there is no medium.
#[derive(Clone, Debug, PartialEq)]
pub struct DensityGrid {
    grid: Grid,
    /// Number of blocks along x, y and z.
    blocks_size: [u32; 3],
    /// Blocks of [`BLOCK_CELLS`] cells per edge, x fastest. They give the majorants of delta tracking and the control
    /// variates of ratio tracking.
    blocks: Vec<Block>,
    /// The largest density.
    highest: f32,
}

impl DensityGrid {
    /// The density of a grid of one channel; `None` if the grid has several.
    pub fn new(grid: Grid) -> Option<DensityGrid> {
        if grid.channels != 1 {
            return None;
        }
        let blocks_size = grid.size.map(|n| n.div_ceil(BLOCK_CELLS));
        let [bx, by, bz] = blocks_size;
        let mut blocks = Vec::with_capacity(bx as usize * by as usize * bz as usize);
        for z in 0..bz {
            for y in 0..by {
                for x in 0..bx {
                    blocks.push(block(&grid, [x, y, z]));
                }
            }
        }
        let highest = grid.values.iter().fold(0.0, |a: f32, &b| a.max(b));
        Some(DensityGrid { grid, blocks_size, blocks, highest })
    }

    /// The values of the density.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The largest density.
    #[inline]
    pub fn highest(&self) -> f32 {
        self.highest
    }
}

/// The grids of a heterogeneous medium.
#[derive(Clone, Debug, PartialEq)]
pub struct MediumGrids {
    /// Factor of the medium's coefficients.
    pub density: DensityGrid,
    /// The light that the medium emits; `None` if it emits none.
    pub emission: Option<EmissionGrid>,
}

/// Bounds and mean of the interpolated density in the block at `at`, counted in blocks.
fn block(grid: &Grid, at: [u32; 3]) -> Block {
    // Interpolation in a cell also reads its neighbours.
    let range = |axis: usize| {
        let first = at[axis] * BLOCK_CELLS;
        first.saturating_sub(1)..(first + BLOCK_CELLS + 1).min(grid.size[axis])
    };
    let [nx, ny, _] = grid.size.map(|n| n as usize);
    let inside = |axis: usize, i: u32| i / BLOCK_CELLS == at[axis];
    let (mut low, mut high, mut sum, mut count) = (f32::INFINITY, 0f32, 0f64, 0u32);
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                let value = grid.values[(z as usize * ny + y as usize) * nx + x as usize];
                (low, high) = (low.min(value), high.max(value));
                if inside(0, x) && inside(1, y) && inside(2, z) {
                    sum += f64::from(value);
                    count += 1;
                }
            }
        }
    }
    let mean = (sum / f64::from(count.max(1))) as f32;
    Block { low, high, mean: mean.clamp(low, high) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(size: [u32; 3], value: impl Fn(u32, u32, u32) -> f32) -> Grid {
        let [nx, ny, nz] = size;
        let mut values = Vec::new();
        for z in 0..nz {
            for y in 0..ny {
                for x in 0..nx {
                    values.push(value(x, y, z));
                }
            }
        }
        Grid::new(size, 1, [Vec3::ZERO, Vec3::ONE], values).expect("it is valid")
    }

    /// Interpolation reproduces linear functions between the centres of cells, and is constant beyond.
    #[test]
    fn interpolation_is_linear_between_cells() {
        let linear = |x: f32, y: f32, z: f32| 1.0 + x + 2.0 * y + 4.0 * z;
        let grid = grid([5, 4, 3], |x, y, z| linear(x as f32, y as f32, z as f32));
        for p in [Vec3::new(0.5, 0.5, 0.5), Vec3::new(2.3, 1.7, 1.1), Vec3::new(4.5, 3.5, 2.5)] {
            let q = p - 0.5;
            assert!((grid.channel_at(p, 0) - linear(q.x, q.y, q.z)).abs() < 1e-5, "{p}");
        }
        assert_eq!(grid.channel_at(Vec3::new(-3.0, 0.1, 0.0), 0), 1.0);
        assert_eq!(grid.channel_at(Vec3::splat(99.0), 0), linear(4.0, 3.0, 2.0));
    }

    /// The means of cells are those of the interpolant, compared with a sum over many points.
    #[test]
    fn means_of_cells_are_exact() {
        let grid = grid([3, 4, 2], |x, y, z| ((x * 7 + y * 3 + z * 5) % 11) as f32);
        const STEPS: u32 = 20;
        for (at, mean) in grid.cell_means().into_iter().enumerate() {
            let cell = Vec3::new((at % 3) as f32, (at / 3 % 4) as f32, (at / 12) as f32);
            let mut sum = 0.0;
            for i in 0..STEPS.pow(3) {
                let step = Vec3::new((i % STEPS) as f32, (i / STEPS % STEPS) as f32, (i / STEPS / STEPS) as f32);
                sum += grid.channel_at(cell + (step + 0.5) / STEPS as f32, 0);
            }
            assert!((mean - sum / STEPS.pow(3) as f32).abs() < 2e-3 * (1.0 + mean), "cell {at}");
        }
    }

    /// The density anywhere in a block lies between its bounds.
    #[test]
    fn blocks_bound_the_density() {
        let values = |x: u32, y: u32, z: u32| (crate::random::mix(u64::from(x | y << 8 | z << 16)) >> 40) as f32;
        let density = DensityGrid::new(grid([21, 8, 17], values)).expect("one channel");
        let [bx, by, _] = density.blocks_size;
        for i in 0..20_000u64 {
            let random = |axis: u64, n: u32| (crate::random::mix(3 * i + axis) >> 40) as f32 / 16_777_216.0 * n as f32;
            let p = Vec3::new(random(0, 21), random(1, 8), random(2, 17));
            let [x, y, z] = p.to_array().map(|x| x as u32 / BLOCK_CELLS);
            let block = density.blocks[((z * by + y) * bx + x) as usize];
            let value = density.grid.channel_at(p, 0);
            assert!(value >= block.low && value <= block.high, "{p}: {value}, {block:?}");
        }
    }

    #[test]
    fn invalid_grids_are_rejected() {
        let bounds = [Vec3::ZERO, Vec3::ONE];
        assert!(Grid::new([1, 1, 1], 1, bounds, vec![1.0]).is_some());
        assert!(Grid::new([0, 1, 1], 1, bounds, vec![]).is_none());
        assert!(Grid::new([u32::MAX; 3], 1, bounds, vec![]).is_none());
        assert!(Grid::new([1, 1, 1], 2, bounds, vec![1.0; 2]).is_none());
        assert!(Grid::new([1, 1, 1], 1, [Vec3::ZERO, Vec3::X], vec![1.0]).is_none());
        assert!([f32::NAN, -1.0, f32::INFINITY].iter().all(|&x| Grid::new([1; 3], 1, bounds, vec![x]).is_none()));
        let colors = Grid::new([1, 1, 1], 3, bounds, vec![1.0; 3]).expect("it is valid");
        assert!(DensityGrid::new(colors).is_none());
    }
}
