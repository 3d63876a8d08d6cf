//! Light that a way finds so rarely that a pilot does not see it: no variance tells of it, and it would stay out of the picture.
//!
//! Connections find some caustics well and others hardly ever, those seen through the glass that makes them first of all. Merging finds both. So blocks of pixels whose
//! caustics connections leave darker than merging does, by more than chance, are taken for missing light, and that for an error.

use super::trial::{mean, scale};
use crate::estimator::Pixel;
use crate::math::DVec3;
use crate::stat::Welford;
use std::ops::{AddAssign, Div};

/// Pixels of a pilot's picture along a block's side.
const SIDE: usize = 4;
/// Standard errors from which on a difference is no chance: one block in 700 is beyond them by chance.
const SIGNIFICANT: f64 = 3.0;

/// Caustics by block, an iteration a sample.
#[derive(Clone, Debug, Default)]
pub(super) struct Caustics {
    blocks: Vec<Welford>,
    /// Sum of the blocks so far.
    before: Vec<DVec3>,
    iterations: f64,
}

/// Means over the blocks, row by row, of something that the pixels of a picture so wide have.
fn means<T>(pixels: impl ExactSizeIterator<Item = T>, width: usize) -> Vec<T>
where
    T: Copy + Default + AddAssign + Div<f64, Output = T>,
{
    let (columns, rows) = (width.div_ceil(SIDE), (pixels.len() / width).div_ceil(SIDE));
    let mut sums = vec![(T::default(), 0.0); columns * rows];
    for (index, value) in pixels.enumerate() {
        let (sum, count) = &mut sums[index / width / SIDE * columns + index % width / SIDE];
        *sum += value;
        *count += 1.0;
    }
    sums.into_iter().map(|(sum, count)| sum / count).collect()
}

impl Caustics {
    /// Adds what an iteration has brought to the pixels of a picture so wide.
    pub fn add(&mut self, pixels: &[Pixel], width: usize) {
        let now = means(pixels.iter().map(|pixel| pixel.parts.caustic), width);
        self.blocks.resize(now.len(), Welford::default());
        self.before.resize(now.len(), DVec3::ZERO);
        self.iterations += 1.0;
        for ((block, before), now) in self.blocks.iter_mut().zip(&mut self.before).zip(now) {
            block.add((now - *before).as_vec3(), 1.0 / self.iterations);
            *before = now;
        }
    }

    /// relMSE that light makes which these lack and `complete` ones have; `values` are what the pixels are worth.
    pub fn missing(&self, complete: &Caustics, values: &[f64], width: usize) -> f64 {
        let of = |caustics: &Caustics, block: usize| {
            let block = &caustics.blocks[block];
            (mean(block.mean), mean(block.variance_of_mean(caustics.iterations)))
        };
        let values = means(values.iter().copied(), width);
        let error = |(index, value): (usize, f64)| {
            let ((own, own_noise), (all, noise)) = (of(self, index), of(complete, index));
            let (lacks, noise) = (all - own, own_noise + noise);
            if lacks > SIGNIFICANT * noise.sqrt() { (lacks * lacks - noise) * scale(value) } else { 0.0 }
        };
        let blocks = values.len().max(1) as f64;
        values.into_iter().enumerate().map(error).sum::<f64>() / blocks
    }
}

#[cfg(test)]
mod tests {
    use super::super::trial::DARK;
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    const SIZE: (usize, usize) = (64, 48);
    const ITERATIONS: u64 = 24;
    /// Pixels that lack light, in four blocks.
    const DARK_CORNER: usize = 8;

    /// Caustics of mean 1 that are found in one iteration of five and are five times as bright then, noise of 4 a pixel and iteration; in a corner they are found
    /// with `share`.
    fn caustics(seed: u64, share: f64) -> Caustics {
        let mut pixels = vec![Pixel::default(); SIZE.0 * SIZE.1];
        let mut caustics = Caustics::default();
        for i in 0..ITERATIONS {
            for (index, pixel) in pixels.iter_mut().enumerate() {
                let u = Stream::new(seed, i, Domain::Test, index as u64).vertex(0).two(Purpose::Pixel).x;
                let corner = index % SIZE.0 < DARK_CORNER && index / SIZE.0 < DARK_CORNER;
                let chance = if corner { 0.2 * share } else { 0.2 };
                pixel.parts.caustic += if f64::from(u) < chance { DVec3::splat(5.0) } else { DVec3::ZERO };
            }
            caustics.add(&pixels, SIZE.0);
        }
        caustics
    }

    /// What is missing is found where it is most of the light there; of what is all there one block in 700 is taken for darker, by three standard errors
    /// of sqrt(2 4 / (16 24)) each, which is 0.001 of relMSE.
    #[test]
    fn missing_light_is_found() {
        let values = vec![1.0; SIZE.0 * SIZE.1];
        let missing =
            |seed: u64, share: f64| caustics(2 * seed, share).missing(&caustics(2 * seed + 1, 1.0), &values, SIZE.0);
        let corner = (DARK_CORNER * DARK_CORNER) as f64 / (SIZE.0 * SIZE.1) as f64;
        let mean = |share: f64| (0..40).map(|seed| missing(seed, share)).sum::<f64>() / 40.0;
        let (all, none) = (mean(1.0), mean(0.0));
        println!("{all} where nothing is missing, {none} where a share of {corner} has nothing");
        assert!(all < 0.001, "{all}");
        assert!((none / (corner / (1.0 + DARK)) - 1.0).abs() < 0.1, "{none} for {corner}");
    }

    /// Blocks at the borders are smaller, pictures of a pixel are a block, those of none have none.
    #[test]
    fn blocks_cover_pictures_of_any_size() {
        let sizes = |width: usize, height: usize| means(vec![1.0; width * height].into_iter(), width);
        assert_eq!(sizes(9, 5), vec![1.0; 6]);
        assert_eq!(sizes(1, 1), vec![1.0]);
        assert_eq!(means(std::iter::empty::<f64>(), 1), Vec::<f64>::new());
        let ramp = means((0..8 * 4).map(|i| f64::from(i % 8)), 8);
        assert_eq!(ramp, [1.5, 5.5]);
    }
}
