//! The squared error of a pixel's own level, bias included, without a reference.
//!
//! The kernel's bias grows with the bandwidth squared \[Knaus and Zwicker 2011, 3\], and the next larger level has
//! twice the squared bandwidth in every iteration: with bias `b` at level k it has `2 b`. The difference of the two
//! levels' means therefore expects `b` itself. Squared, it expects `b^2` plus the variance of the difference, which its
//! own iterations tell; what is left estimates the squared bias. It may come out negative where there is little
//! bias: sums over pixels keep the sign and stay unbiased, a single pixel cuts it off at zero.
//!
//! In media squared bandwidths are a factor 2^(2/3) apart; the difference is scaled to tell the bias there, too
//! ([`PixelAccumulator::add`]).
//!
//! This holds where light varies smoothly over the kernel. At edges narrower than the bandwidth the bias falls
//! more slowly than that, and the estimate is too small.

use super::PixelAccumulator;
use crate::math::DVec3;

/// Estimated squared error of one pixel, per channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquaredError {
    /// Variance of the mean.
    pub variance: DVec3,
    /// Squared bias; negative values are noise around zero. Zero when there is no larger level to compare with.
    pub squared_bias: DVec3,
}

impl SquaredError {
    /// The error of level `own` (from 0) of `count`; `None` before two iterations.
    pub fn of(pixel: &PixelAccumulator, own: usize, count: usize) -> Option<SquaredError> {
        if pixel.iterations < 2 {
            return None;
        }
        let squared_bias = match pixel.difference() {
            Some([mean, variance]) if own + 1 < count => mean * mean - variance,
            _ => DVec3::ZERO,
        };
        Some(SquaredError { variance: pixel.variance_of_mean(own), squared_bias })
    }

    /// Estimated standard error with bias: the root of variance plus squared bias, the latter at least zero.
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

    /// Levels whose bias halves from one to the next and whose noise is uniform: over many pixels the estimates average
    /// to the bias squared, and to nothing without bias. Over 4000 pixels of 16 iterations the mean of (D^2 - var) has
    /// a standard error of about 0.0004; a missing variance term would add 0.007.
    #[test]
    fn the_squared_bias_is_found_and_noise_is_not_taken_for_it() {
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
    fn one_iteration_tells_nothing() {
        let mut pixel = PixelAccumulator::new(5, 0, [1.0; 2]);
        pixel.add(1, &PixelSample::default(), None);
        assert_eq!(SquaredError::of(&pixel, 3, 5), None);
    }
}
