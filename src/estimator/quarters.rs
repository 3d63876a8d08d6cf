//! Variance of noise from the four quarters of the iterations.
//!
//! Iterations within a quarter share low-discrepancy points and are not independent, so the sample variance over them
//! is larger than the variance of their mean. Quarters are scrambled independently, so the scatter of their means is
//! unbiased, but has only three degrees of freedom per pixel. So layers take the shape of the noise from the sample
//! variance, and scale it, over windows, to the variance by quarters.

use super::{PixelAccumulator, SquaredError};
use rayon::prelude::*;

/// Half width, in pixels, of the square windows over which variances are averaged: 9 x 9 pixels with 3 degrees of
/// freedom each.
const REACH: usize = 4;

/// For every pixel, the variance estimated from the four quarters of the iterations over the sample variance, averaged
/// over a window around the pixel; 1 if one of them is unknown or there is no variance. `own` is the bandwidth level
/// that the picture shows (from 0). Pixels are in rows of `width`.
pub fn variance_ratio(pixels: &[PixelAccumulator], width: usize, own: usize) -> Vec<f32> {
    let of_pixel = |pixel: &PixelAccumulator| {
        let sample = SquaredError::of(pixel, own, own + 1).map(|error| error.variance);
        match (pixel.variance_by_quarters(), sample) {
            (Some(quarters), Some(sample)) => [quarters.element_sum(), sample.element_sum()],
            _ => [0.0; 2],
        }
    };
    let own: Vec<[f64; 2]> = pixels.par_iter().map(of_pixel).collect();
    let rows = window_sums(&own, |index| (index % width, width), 1);
    let sums = window_sums(&rows, |index| (index / width, pixels.len() / width), width);
    let ratio = |[quarters, sample]: &[f64; 2]| if *sample > 0.0 { (quarters / sample) as f32 } else { 1.0 };
    sums.par_iter().map(ratio).collect()
}

/// Sums over windows of `2 REACH + 1` values along lines (rows or columns) of a picture, whose values are `step` apart.
/// `place` maps an index to its position in its line and the length of the line.
fn window_sums(values: &[[f64; 2]], place: impl Fn(usize) -> (usize, usize) + Sync, step: usize) -> Vec<[f64; 2]> {
    let sum = |index: usize| {
        let (at, length) = place(index);
        let window = at.saturating_sub(REACH)..(at + REACH + 1).min(length);
        window.fold([0.0; 2], |sum, other| {
            let value = values[index + other * step - at * step];
            [sum[0] + value[0], sum[1] + value[1]]
        })
    };
    (0..values.len()).into_par_iter().map(sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Rgb;
    use crate::random::{Domain, Purpose, QUARTERS, Stream, quarter};
    use crate::transport::PixelSample;

    /// Pixels of a picture with uniform noise. With `antithetic`, the iterations of a quarter form pairs that cancel,
    /// similar to low-discrepancy points.
    fn picture(antithetic: bool) -> Vec<PixelAccumulator> {
        let pixel = |index: u64| {
            let mut pixel = PixelAccumulator::new(1, 0, [0.0; 2]);
            for i in 1..=32u64 {
                let (quarter, at) = (quarter(i), (i - 1) / QUARTERS);
                let pair = if antithetic { at / 2 } else { at };
                let draw = Stream::new(3, quarter * 100 + pair, Domain::Test, index).vertex(0).one(Purpose::Pixel);
                let value = if antithetic && at % 2 == 1 { 1.0 - draw } else { draw };
                let sample = PixelSample { direct: Rgb::splat(value), ..PixelSample::default() };
                pixel.add(i, &sample, None);
            }
            pixel
        };
        (0..32 * 24).map(pixel).collect()
    }

    /// Independent iterations have a ratio of one. Windows have at least 25 pixels with three degrees of freedom each
    /// (channels are equal), so a ratio deviates by more than five of its standard errors of sqrt(2 / 75) with a
    /// probability below 1e-5. Iterations that cancel have a ratio of zero.
    #[test]
    fn independent_iterations_have_a_ratio_of_one_and_stratified_ones_less() {
        let ratios = variance_ratio(&picture(false), 32, 0);
        let mean = ratios.iter().sum::<f32>() / ratios.len() as f32;
        assert!((mean - 1.0).abs() < 0.08, "{mean}");
        assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < 5.0 * (2f32 / 75.0).sqrt()));
        assert!(variance_ratio(&picture(true), 32, 0).iter().all(|ratio| *ratio < 1e-9));
        assert!(
            variance_ratio(&vec![PixelAccumulator::new(1, 0, [0.0; 2]); 6], 3, 0).iter().all(|ratio| *ratio == 1.0)
        );
        let column = picture(false);
        assert_eq!(variance_ratio(&column, 1, 0).len(), column.len());
    }
}
