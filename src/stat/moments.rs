//! Mean and variance from sums that do not depend on the order of their terms.
//!
//! The variance is a difference of sums of squares, which cancels: relative variances of single values below 10^-9 are
//! indistinguishable from zero.

use super::sum::{Grid, Rounding, Sum};
use crate::math::{DVec3, Rgb};
use serde::{Deserialize, Serialize};

/// Rounding grids for a sum of values and a sum of their squares, which make both sums independent of order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Grids {
    values: Grid,
    squares: Grid,
}

impl Grids {
    /// The finest grids for values in units of 2^`exponent`, see [`Grid::new`].
    pub fn new(exponent: i32) -> Grids {
        Grids { values: Grid::new(exponent), squares: Grid::new(2 * exponent) }
    }

    /// The grids, coarsened if needed, that can sum values of absolute value up to `max`.
    #[inline]
    #[must_use]
    pub fn with_room_for(self, max: f64) -> Grids {
        Grids { values: self.values.with_room_for(max), squares: self.squares.with_room_for(max * max) }
    }

    /// For values and for squares, the coarser one of the grids of `self` and `other`.
    #[must_use]
    pub fn max(self, other: Grids) -> Grids {
        Grids { values: self.values.max(other.values), squares: self.squares.max(other.squares) }
    }

    /// How values (first) and their squares (second) are rounded to these grids.
    #[inline]
    pub fn rounding(self) -> [Rounding; 2] {
        [self.values.rounding(), self.squares.rounding()]
    }

    /// Converts a sum of values from these grids to the coarser grids `to`.
    #[inline]
    pub fn coarsen_values(self, sum: &mut Sum<DVec3>, to: Grids) {
        sum.coarsen(self.values, to.values);
    }

    /// Converts a sum of squares from these grids to the coarser grids `to`.
    #[inline]
    pub fn coarsen_squares(self, sum: &mut Sum<DVec3>, to: Grids) {
        sum.coarsen(self.squares, to.squares);
    }
}

/// Sums of an RGB quantity and of its squares. The owner stores the grids and the number of values, because many sums
/// share them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Moments {
    /// Sum of the values.
    pub values: Sum<DVec3>,
    /// Sum of the squared values.
    pub squares: Sum<DVec3>,
}

impl Moments {
    /// Adds a value and its square, rounded for grids that must have room for them.
    #[inline(always)]
    pub fn add(&mut self, value: Rgb, [values, squares]: [Rounding; 2]) {
        let value = value.as_dvec3();
        self.values.add(value, values);
        self.squares.add(value * value, squares);
    }

    /// Mean of the values, whose number is `count`; zero if `count` is zero.
    #[inline]
    pub fn mean(&self, count: f64) -> DVec3 {
        if count == 0.0 { DVec3::ZERO } else { self.values.value() / count }
    }

    /// Variance of the mean of the values, whose number is `count`, per channel; see [`variance_of_mean`].
    #[inline]
    pub fn variance_of_mean(&self, count: f64) -> DVec3 {
        variance_of_mean(self.values.value(), self.squares.value(), count)
    }

    /// Converts both sums from the grids `from` to equal or coarser grids `to`.
    #[inline]
    pub fn coarsen(&mut self, from: Grids, to: Grids) {
        from.coarsen_values(&mut self.values, to);
        from.coarsen_squares(&mut self.squares, to);
    }

    /// Adds the sums of other values, which must be on the same grids.
    pub fn join(&mut self, other: &Moments) {
        self.values.join(&other.values);
        self.squares.join(&other.squares);
    }
}

/// Variance of the mean of `count` values, from their sum and the sum of their squares. Infinite for fewer than two
/// values.
#[inline]
pub fn variance_of_mean(sum: DVec3, squares: DVec3, count: f64) -> DVec3 {
    if count < 2.0 {
        return DVec3::INFINITY;
    }
    (squares - sum * sum / count).max(DVec3::ZERO) / (count * (count - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_variance_agree_with_two_pass_formulas() {
        let values: Vec<f64> = (0..1000).map(|i| 1e3 + f64::from((i * 7919) % 101)).collect();
        let grids = Grids::default().with_room_for(2e3);
        let mut moments = Moments::default();
        values.iter().for_each(|&v| moments.add(Rgb::splat(v as f32), grids.rounding()));
        let mean = values.iter().sum::<f64>() / 1000.0;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (1000.0 * 999.0);
        assert!((moments.mean(1000.0).x / mean - 1.0).abs() < 1e-12);
        assert!((moments.variance_of_mean(1000.0).x / variance - 1.0).abs() < 1e-6);
        assert_eq!(Moments::default().variance_of_mean(1.0).x, f64::INFINITY);
    }

    /// The variance of equal values is the rounding error of the sum of squares.
    #[test]
    fn equal_values_have_almost_no_variance() {
        let mut worst = 0.0f64;
        for value in (0..200).map(|i| 1.1f32.powi(i - 100)) {
            let grids = Grids::default().with_room_for(f64::from(value));
            let mut moments = Moments::default();
            (0..100).for_each(|_| moments.add(Rgb::splat(value), grids.rounding()));
            worst = worst.max(99.0 * moments.variance_of_mean(100.0).x / f64::from(value).powi(2));
        }
        assert!(worst < 2f64.powi(-29), "{worst}");
    }
}
