//! The error of the finished picture, told by independent quarters of the iterations, without a reference.
//!
//! With `F` the picture finished from quarters 1 and 2, the product `(F - Q3)(F - Q4)` has the mean `(F - truth)^2` where quarters are
//! unbiased: the noise of `Q3` and that of `Q4` are independent of each other and of `F`, so they drop out. It is the error of half the iterations;
//! the whole picture's lies between 0.7 of that and all of it. Where photons are gathered all quarters have the kernel's bias in common, which this cannot see.

use crate::stat::floor;
use rayon::prelude::*;

/// Share of the pixels left out, those where the judging quarters differ most: one bright sample in either would rule the mean. Which pixels these are
/// does not depend on `F`.
pub const WORST: f64 = 0.005;

/// Squared relative errors of the pixels of `picture`, as two `judges` tell them that share no noise with it or each
/// other: means over RGB of `(F - J1)(F - J2) / (mean_RGB(V)^2 + floor)`, where the picture `values` says what pixels
/// are worth, and what the [`floor`] is. Without the worst pixels, those where judges differ most; in the same order
/// for all pictures that are judged alike. Noise around a small error may make them and their mean negative.
///
/// Judged alike, pictures differ by their own errors alone: the judges' noise is the same in all.
pub fn squared_errors(picture: &[[f32; 3]], judges: [&[[f32; 3]]; 2], values: &[[f32; 3]]) -> Vec<f64> {
    let mean = |index: usize| values[index].iter().map(|value| f64::from(*value)).sum::<f64>() / 3.0;
    let floor = floor::relative((0..picture.len()).map(mean));
    let of_pixel = |index: usize| {
        let (f, [a, b]) = (picture[index], judges.map(|judge| judge[index]));
        let mean = mean(index);
        let scale = 1.0 / (3.0 * (mean * mean + floor));
        let over = |of: &dyn Fn(usize) -> f64| (0..3).map(of).sum::<f64>() * scale;
        let apart = over(&|c| f64::from(a[c] - b[c]).powi(2));
        let product = over(&|c| f64::from(f[c] - a[c]) * f64::from(f[c] - b[c]));
        (apart, product)
    };
    let pixels: Vec<(f64, f64)> = (0..picture.len()).into_par_iter().map(of_pixel).collect();
    let mut apart: Vec<f64> = pixels.iter().map(|(apart, _)| *apart).collect();
    let kept = apart.len() - (apart.len() as f64 * WORST) as usize;
    if kept == 0 {
        return Vec::new();
    }
    let most = *apart.select_nth_unstable_by(kept - 1, f64::total_cmp).1;
    pixels.into_iter().filter(|(apart, _)| *apart <= most).map(|(_, product)| product).collect()
}

/// The mean of [`squared_errors`].
pub fn squared_error(picture: &[[f32; 3]], judges: [&[[f32; 3]]; 2], values: &[[f32; 3]]) -> f64 {
    let errors = squared_errors(picture, judges, values);
    errors.iter().sum::<f64>() / errors.len().max(1) as f64
}

/// Means of quarters 1 and 2 per pixel, of equal numbers of iterations but for one.
pub fn first_half(quarters: &[Vec<[f32; 3]>; 4]) -> Vec<[f32; 3]> {
    let pairs = quarters[0].par_iter().zip(&quarters[1]);
    pairs.map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    /// A picture that is off by a tenth, judged by halves whose noise is five times that: the error is found with a standard error of 0.0005 (12,000 pixels of
    /// three equal channels); a judge used twice would tell its own variance, 26 times as much.
    #[test]
    fn errors_far_below_the_judges_noise_are_found() {
        let pixels = 12_000;
        let noisy = |seed: u64| -> Vec<[f32; 3]> {
            let draw = |index: u64| Stream::new(seed, 0, Domain::Test, index).vertex(0).one(Purpose::Pixel);
            (0..pixels).map(|index| [1.0 + 0.5 * 12f32.sqrt() * (draw(index) - 0.5); 3]).collect()
        };
        let (a, b) = (noisy(1), noisy(2));
        let picture = vec![[1.1; 3]; pixels as usize];
        let expected = 0.01 / (1.01 * 1.21);
        let told = squared_error(&picture, [&a, &b], &picture);
        // 0.25 / sqrt(12000) / 1.22 is one standard error of the product's mean.
        assert!((told - expected).abs() < 4.0 * 0.25 / 110.0 / 1.22, "{told}, not {expected}");
        assert!(squared_error(&picture, [&a, &a], &picture) > 20.0 * expected);
        assert_eq!(squared_error(&[], [&[], &[]], &[]), 0.0);
    }

    /// A judge's firefly is left out.
    #[test]
    fn a_bright_sample_does_not_rule() {
        let (picture, mut judge) = (vec![[1.0; 3]; 1000], vec![[1.0; 3]; 1000]);
        judge[7] = [1e6; 3];
        let other = vec![[1.1; 3]; 1000];
        assert!(squared_error(&picture, [&judge, &other], &picture).abs() < 1e-9);
    }
}
