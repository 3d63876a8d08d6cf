//! The squared error of a pixel without a reference, bias included.
//!
//! The kernel's bias grows with the squared bandwidth \[Knaus and Zwicker 2011, 3\]. The next larger level has twice
//! the squared bandwidth in every iteration, so its bias is `2 b` if that of level k is `b`, and the difference of the
//! two means has the expectation `b`. Its square has the expectation `b^2` plus the variance of the difference, which
//! is estimated from the iterations and subtracted. The estimate may be negative where bias is small. Sums over pixels
//! keep the sign and stay unbiased; a single pixel clamps it to zero.
//!
//! In media, squared bandwidths of neighbouring levels differ by 2^(2/3). The difference is scaled so that it equals
//! the bias there, too ([`PixelAccumulator::add`]).
//!
//! Vertex connection and merging with one bandwidth has no larger level. There the same photons within a quarter of the
//! bandwidth give a second estimate, whose bias is 1/16 of `b`, or 1/4 at edges and on narrow caustics. The difference of the
//! two, 15/16 to 3/4 of `b`, is taken for `b`.
//!
//! Levels show the bias where light varies smoothly over the kernel. At edges narrower than the bandwidth, bias falls more
//! slowly with the bandwidth, and the estimate is too small.

use super::PixelAccumulator;
use crate::math::DVec3;

/// Estimated squared error of the radiance of one pixel, per channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquaredError {
    /// Variance of the mean over iterations.
    pub variance: DVec3,
    /// Squared bias of the gathering kernel. Negative values are noise around zero. Zero if there is no other bandwidth
    /// for comparison.
    pub squared_bias: DVec3,
}

impl SquaredError {
    /// Estimates the error of bandwidth level `own` (from 0, the smallest) of `count` levels; `None` before two
    /// iterations.
    pub fn of(pixel: &PixelAccumulator, own: usize, count: usize) -> Option<SquaredError> {
        if pixel.iterations < 2 {
            return None;
        }
        let squared_bias = match pixel.difference() {
            Some([mean, variance]) if own + 1 < count || pixel.levels() == 1 => mean * mean - variance,
            _ => DVec3::ZERO,
        };
        Some(SquaredError { variance: pixel.variance_of_mean(own), squared_bias })
    }

    /// Estimated standard error including bias, per channel: the root of variance plus squared bias, with the latter
    /// clamped to zero.
    pub fn root(&self) -> DVec3 {
        let total = self.variance + self.squared_bias.max(DVec3::ZERO);
        total.map(f64::sqrt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Rgb;
    use crate::random::{Domain, Purpose, Stream};
    use crate::transport::PixelSample;

    /// Levels with bias `b` and `2 b` and uniform noise: averaged over pixels, the estimate is the squared bias, and
    /// zero without bias. Over 4000 pixels of 16 iterations the mean of (D^2 - var) has a standard error of about
    /// 0.0004; a missing variance term would add 0.007.
    #[test]
    fn squared_bias_is_estimated_without_noise() {
        for bias in [0.0, 0.3] {
            let (mut squared_bias, mut variance) = (0.0, 0.0);
            for index in 0..4000 {
                let mut pixel = PixelAccumulator::new(2, 0, [1.0; 2]);
                for i in 1..=16 {
                    let draws = Stream::new(9, i, Domain::Test, index).vertex(0);
                    let noise = draws.two(Purpose::Pixel);
                    let small = 1.0 + bias + 0.8 * (noise.x - 0.5);
                    let large = 1.0 + 2.0 * bias + 0.8 * (noise.y - 0.5);
                    let mut sample = PixelSample::default();
                    sample.indirect_photons[..2].copy_from_slice(&[small, large].map(Rgb::splat));
                    pixel.add(i, &sample, None);
                }
                let error = SquaredError::of(&pixel, 0, 2).expect("two iterations are done");
                squared_bias += error.squared_bias.x / 4000.0;
                variance += error.variance.x / 4000.0;
                assert!(error.root().x >= error.variance.x.sqrt());
            }
            let expected = f64::from(bias * bias);
            assert!((squared_bias - expected).abs() < 0.0016 + 0.005 * f64::from(bias), "{bias}: {squared_bias}");
            // 0.8^2 / 12 / 16
            assert!((variance - 0.64 / 192.0).abs() < 1e-4, "{variance}");
        }
    }

    #[test]
    fn one_iteration_gives_no_error() {
        let mut pixel = PixelAccumulator::new(5, 0, [1.0; 2]);
        pixel.add(1, &PixelSample::default(), None);
        assert_eq!(SquaredError::of(&pixel, 3, 5), None);
    }
}
