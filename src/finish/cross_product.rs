//! Squared errors of a picture by the cross product with two independent estimates, without a reference.
//!
//! With `F` a picture and `A`, `B` unbiased estimates whose noise is independent of each other's and of `F`'s, the
//! product `(F - A)(F - B)` has the expectation `(F - truth)^2`: every term with noise drops out. `F` is finished from
//! the first two quarters of the iterations, `A` and `B` are the other two, so that the product estimates the error at
//! half of the iterations. The whole render's squared error lies between 0.5 and 1 times that. Where photons are
//! gathered all quarters share the kernel's bias, which the product cannot show.

use crate::film::{Picture, channel_mean};
use crate::stat::TRIMMED_SHARE;
use rayon::prelude::*;

/// Squared error of one pixel of a picture, estimated by a cross product with two independent estimates.
#[derive(Clone, Copy, Debug)]
pub struct PixelError {
    /// Squared relative error; noise around a small error can make it negative.
    pub squared: f64,
    /// Noise in `squared` from the two estimates, by channel: the derivative of the product by one estimate, times the
    /// difference of the two.
    pub noise: [f64; 3],
}

/// Squared relative errors of the pixels of `picture` by two independent `estimates`: means over RGB of
/// `(F - A)(F - B) / (mean_RGB(V)^2 + floor)`, with `V` the picture `values` and [`Picture::relative_floor`] of it.
///
/// Leaves out the share [`TRIMMED_SHARE`] of the pixels, those where the estimates differ most. The choice does not depend on
/// `picture`: with the same estimates and `values` the results of several pictures are of the same pixels in the same
/// order, share the term `noise(A) noise(B)`, and otherwise differ by their own errors and [`PixelError::noise`].
pub fn squared_errors(picture: &Picture, estimates: [&Picture; 2], values: &Picture) -> Vec<PixelError> {
    let floor = values.relative_floor();
    let of_pixel = |index: usize| {
        let (f, [a, b]) = (picture[index].map(f64::from), estimates.map(|estimate| estimate[index].map(f64::from)));
        let scale = 1.0 / (3.0 * (channel_mean(values[index]).powi(2) + floor));
        let sum = |term: &dyn Fn(usize) -> f64| (0..3).map(term).sum::<f64>() * scale;
        let difference = sum(&|c| (a[c] - b[c]).powi(2));
        let squared = sum(&|c| (f[c] - a[c]) * (f[c] - b[c]));
        let noise = std::array::from_fn(|c| scale * (f[c] - 0.5 * (a[c] + b[c])) * (a[c] - b[c]));
        (difference, PixelError { squared, noise })
    };
    let pixels: Vec<(f64, PixelError)> = (0..picture.len()).into_par_iter().map(of_pixel).collect();
    let mut differences: Vec<f64> = pixels.iter().map(|(difference, _)| *difference).collect();
    let kept = differences.len() - (differences.len() as f64 * TRIMMED_SHARE) as usize;
    if kept == 0 {
        return Vec::new();
    }
    let most = *differences.select_nth_unstable_by(kept - 1, f64::total_cmp).1;
    pixels.into_iter().filter(|(difference, _)| *difference <= most).map(|(_, error)| error).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Size;
    use crate::random::{Domain, Purpose, Stream};

    /// Mean over the kept pixels of the squared relative errors of `picture`.
    fn mean_error(picture: &Picture, estimates: [&Picture; 2], values: &Picture) -> f64 {
        let pixels = squared_errors(picture, estimates, values);
        pixels.iter().map(|pixel| pixel.squared).sum::<f64>() / pixels.len().max(1) as f64
    }

    /// A picture that is off by a tenth, compared with estimates whose noise is five times that: the error is found with
    /// a standard error of 0.0005 (12,000 pixels of three equal channels). An estimate used twice would add its own
    /// variance, 26 times as much.
    #[test]
    fn errors_far_below_the_noise_of_the_estimates_are_found() {
        let size = Size { width: 120, height: 100 };
        let noisy = |seed: u64| {
            let draw = |index: usize| Stream::new(seed, 0, Domain::Test, index as u64).vertex(0).one(Purpose::Pixel);
            Picture::from_fn(size, |index| [1.0 + 0.5 * 12f32.sqrt() * (draw(index) - 0.5); 3])
        };
        let (a, b) = (noisy(1), noisy(2));
        let picture = Picture::filled(size, [1.1; 3]);
        let expected = 0.01 / (1.01 * 1.21);
        let found = mean_error(&picture, [&a, &b], &picture);
        // 0.25 / sqrt(12000) / 1.22 is one standard error of the product's mean.
        assert!((found - expected).abs() < 4.0 * 0.25 / 110.0 / 1.22, "{found}, not {expected}");
        assert!(mean_error(&picture, [&a, &a], &picture) > 20.0 * expected);
        let empty = Picture::default();
        assert_eq!(mean_error(&empty, [&empty, &empty], &empty), 0.0);
    }

    #[test]
    fn a_firefly_in_an_estimate_is_left_out() {
        let plane = |value: f32| Picture::filled(Size { width: 50, height: 20 }, [value; 3]);
        let (picture, mut estimate, other) = (plane(1.0), plane(1.0), plane(1.1));
        estimate[7] = [1e6; 3];
        assert!(mean_error(&picture, [&estimate, &other], &picture).abs() < 1e-9);
    }
}
