//! Sums that do not depend on the order of their terms, so that shards of a render join to the bytes of one render
//! \[Demmel and Nguyen 2015, "Parallel Reproducible Summation"\].
//!
//! A grid is the set of multiples of a power of two; consecutive grids are 30 powers apart. A term is split in two: a
//! multiple of the grid that fits the largest term so far, and the remainder, rounded to the next finer grid. Both
//! parts are summed exactly, so the order does not matter. All terms lose the same low bits, less than 2^-30 of the
//! largest term. When a larger term needs a coarser grid, the coarse sum becomes the fine sum, as if that grid had been
//! used from the start.

use crate::math::DVec3;
use serde::{Deserialize, Serialize};
use std::ops::{Add, AddAssign, Sub};

/// Powers of two from one rounding grid to the next coarser one.
const STEP: i16 = 30;
/// Exponent of the finest rounding grid for sums: below the squares of all f32 values.
const MIN_EXPONENT: i16 = -330;
/// Number of terms that can be added before a sum may lose a bit: a term has at most 30 bits above its grid, an f64 has
/// 53 bits.
pub const MAX_TERMS: u64 = 1 << (53 - STEP as u64);

/// A number or vector that can be summed independently of order.
pub trait Term: Copy + Default + Add<Output = Self> + AddAssign + Sub<Output = Self> {
    /// Rounds to the nearest multiple of the spacing of f64 numbers around `magic`, by adding and subtracting it.
    #[must_use]
    fn rounded(self, magic: f64) -> Self;
}

impl Term for f64 {
    #[inline(always)]
    fn rounded(self, magic: f64) -> f64 {
        (self + magic) - magic
    }
}

impl Term for DVec3 {
    #[inline(always)]
    fn rounded(self, magic: f64) -> DVec3 {
        (self + magic) - magic
    }
}

/// A number around which f64 numbers are spaced by 2^`exponent`.
#[inline]
fn magic(exponent: i16) -> f64 {
    1.5 * two_to(52 + exponent)
}

/// 2^`exponent`, for exponents of normal f64 numbers.
#[inline]
fn two_to(exponent: i16) -> f64 {
    f64::from_bits(((1023 + i64::from(exponent)) as u64) << 52)
}

/// Rounding grid of a sum: the multiples of two to this exponent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Grid(i16);

impl Default for Grid {
    fn default() -> Grid {
        Grid::new(0)
    }
}

impl Grid {
    /// The finest grid for values in units of 2^`exponent`. If all terms are scaled by 2^k and `exponent` grows by k,
    /// sums scale exactly by 2^k.
    pub fn new(exponent: i32) -> Grid {
        Grid(MIN_EXPONENT + exponent.rem_euclid(i32::from(STEP)) as i16)
    }

    /// This grid, or the next coarser one that can sum terms of absolute value up to `max`, which must be finite.
    #[inline]
    #[must_use]
    pub fn with_room_for(self, max: f64) -> Grid {
        let mut grid = self;
        // Half the spacing of the next grid: larger terms would not round to zero there.
        while max >= two_to(grid.0 + STEP - 1) {
            grid.0 += STEP;
        }
        grid
    }

    /// How terms are rounded to this grid, and their rests to the next finer one.
    #[inline]
    pub fn rounding(self) -> Rounding {
        Rounding { coarse: magic(self.0), fine: magic(self.0 - STEP) }
    }
}

/// How the terms of a sum are rounded to a [`Grid`], and their rests to the next finer one.
#[derive(Clone, Copy, Debug)]
pub struct Rounding {
    coarse: f64,
    fine: f64,
}

/// An order-independent sum. The owner stores the grid, because many sums share one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sum<T> {
    coarse: T,
    fine: T,
}

impl<T: Term> Sum<T> {
    /// Adds a term, for which the grid must have room.
    #[inline(always)]
    pub fn add(&mut self, term: T, rounding: Rounding) {
        let coarse = term.rounded(rounding.coarse);
        self.coarse += coarse;
        self.fine += (term - coarse).rounded(rounding.fine);
    }

    /// Value of the sum.
    #[inline]
    pub fn value(&self) -> T {
        self.coarse + self.fine
    }

    /// Converts the sum from one grid to an equal or coarser one.
    #[inline]
    pub fn coarsen(&mut self, from: Grid, to: Grid) {
        match to.0 - from.0 {
            0 => {}
            STEP => *self = Sum { coarse: T::default(), fine: self.coarse },
            _ => *self = Sum::default(),
        }
    }

    /// Adds another sum on the same grid.
    pub fn join(&mut self, other: &Sum<T>) {
        self.coarse += other.coarse;
        self.fine += other.fine;
    }
}

/// An order-independent sum that stores its own grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Total {
    grid: Grid,
    sum: Sum<f64>,
}

impl Total {
    /// Adds a finite term.
    #[inline]
    pub fn add(&mut self, term: f64) {
        self.coarsen_to(self.grid.with_room_for(term.abs()));
        self.sum.add(term, self.grid.rounding());
    }

    /// Value of the sum.
    pub fn value(&self) -> f64 {
        self.sum.value()
    }

    /// Adds another sum, of any grid.
    pub fn join(&mut self, other: &Total) {
        let mut other = *other;
        let grid = self.grid.max(other.grid);
        self.coarsen_to(grid);
        other.coarsen_to(grid);
        self.sum.join(&other.sum);
    }

    #[inline]
    fn coarsen_to(&mut self, grid: Grid) {
        if grid != self.grid {
            self.sum.coarsen(self.grid, grid);
            self.grid = grid;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    /// Terms of both signs over 60 powers of ten, so that grids change many times.
    fn terms(count: u64) -> Vec<f64> {
        let draw = |index| Stream::new(5, 1, Domain::Test, index).vertex(0).two(Purpose::Pixel);
        let term = |u: crate::math::Vec2| {
            let size = 10f32.powf(60.0 * u.x - 30.0);
            f64::from(if u.y < 0.4 { -size } else { size })
        };
        (0..count).map(|index| term(draw(index))).collect()
    }

    fn total(terms: &[f64]) -> Total {
        let mut total = Total::default();
        terms.iter().for_each(|&term| total.add(term));
        total
    }

    #[test]
    fn the_order_of_terms_and_of_parts_changes_no_bit() {
        let terms = terms(4000);
        let whole = total(&terms);
        let mut backwards = terms.clone();
        backwards.reverse();
        assert_eq!(total(&backwards), whole);
        for parts in [2, 3, 7, 64] {
            let part = |index: usize| total(&terms.iter().copied().skip(index).step_by(parts).collect::<Vec<_>>());
            let mut joined = part(parts - 1);
            (0..parts - 1).for_each(|index| joined.join(&part(index)));
            assert_eq!(joined, whole, "{parts} parts");
        }
        // Plain f64 sums in the two orders differ, so the test is sensitive.
        assert_ne!(terms.iter().sum::<f64>(), backwards.iter().sum::<f64>());
    }

    #[test]
    fn the_error_of_a_sum_is_below_1e_9_of_its_largest_term_per_term() {
        for range in [1e-30, 1.0, 1e30] {
            let terms: Vec<f64> = terms(1000).iter().map(|term| range * term.abs().powf(0.01)).collect();
            let largest = terms.iter().fold(0.0, |most: f64, term| most.max(*term));
            let (plain, sum) = (terms.iter().sum::<f64>(), total(&terms).value());
            assert!((sum - plain).abs() < 1e-9 * largest * 1000.0 && sum > 0.0, "{sum} {plain}");
        }
        assert_eq!(total(&[]).value(), 0.0);
        let squares = [f64::from(f32::MAX).powi(2), f64::from(f32::MIN_POSITIVE).powi(2)];
        assert!(squares.iter().all(|&square| (total(&[square]).value() / square - 1.0).abs() < 1e-9));
    }

    #[test]
    fn sums_scale_exactly_with_their_grids() {
        for power in [-70, -31, -1, 0, 3, 29, 30, 90] {
            let scale = f64::from(power).exp2();
            let scaled = |exponent: i32, scale: f64| {
                let mut total = Total { grid: Grid::new(exponent), ..Total::default() };
                [0.3, 1.7e4, 2.9e-6, 0.1].iter().for_each(|term| total.add(term * scale));
                total.value()
            };
            assert_eq!(scaled(power, scale), scaled(0, 1.0) * scale);
        }
    }
}
