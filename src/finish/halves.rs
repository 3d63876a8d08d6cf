//! The error of the finished picture, told by independent quarters of the iterations, without a reference.
//!
//! With `F` the picture finished from quarters 1 and 2, the product `(F - Q3)(F - Q4)` has the mean `(F - truth)^2`
//! where quarters are unbiased: the noise of `Q3` and that of `Q4` are independent of each other and of `F`, so they
//! drop out. It is the error of half the iterations; the whole picture's lies between 0.7 of that and all of it. Where
//! photons are gathered all quarters have the kernel's bias in common, which this cannot see.

use crate::stat::floor;
use rayon::prelude::*;

/// Share of the pixels left out, those where the judging quarters differ most. Which pixels these are does not depend
/// on `F`.
pub use crate::stat::TRIMMED_SHARE;

/// What two judges tell of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Judged {
    /// Its squared relative error; noise around a small one may make it negative.
    pub error: f64,
    /// What the judges' noise adds to that, by channel: its derivative by a judge times how far the two are apart.
    pub pulls: [f64; 3],
}

/// Squared relative errors of the pixels of `picture`, as two `judges` tell them that share no noise with it or each
/// other: means over RGB of `(F - J1)(F - J2) / (mean_RGB(V)^2 + floor)`, where the picture `values` says what pixels
/// are worth, and what the [`floor`] is. Without the worst pixels, those where judges differ most; in the same order
/// for all pictures that are judged alike.
///
/// Judged alike, pictures differ by their own errors alone: the judges' noise is the same in all, but for what it takes
/// from each by `pulls`.
pub fn judge(picture: &[[f32; 3]], judges: [&[[f32; 3]]; 2], values: &[[f32; 3]]) -> Vec<Judged> {
    let mean = |index: usize| values[index].iter().map(|value| f64::from(*value)).sum::<f64>() / 3.0;
    let floor = floor::relative_to_mean((0..picture.len()).map(mean));
    let of_pixel = |index: usize| {
        let (f, [a, b]) = (picture[index], judges.map(|judge| judge[index].map(f64::from)));
        let (f, mean) = (f.map(f64::from), mean(index));
        let scale = 1.0 / (3.0 * (mean * mean + floor));
        let over = |of: &dyn Fn(usize) -> f64| (0..3).map(of).sum::<f64>() * scale;
        let apart = over(&|c| (a[c] - b[c]).powi(2));
        let error = over(&|c| (f[c] - a[c]) * (f[c] - b[c]));
        let pulls = std::array::from_fn(|c| scale * (f[c] - 0.5 * (a[c] + b[c])) * (a[c] - b[c]));
        (apart, Judged { error, pulls })
    };
    let pixels: Vec<(f64, Judged)> = (0..picture.len()).into_par_iter().map(of_pixel).collect();
    let mut apart: Vec<f64> = pixels.iter().map(|(apart, _)| *apart).collect();
    let kept = apart.len() - (apart.len() as f64 * TRIMMED_SHARE) as usize;
    if kept == 0 {
        return Vec::new();
    }
    let most = *apart.select_nth_unstable_by(kept - 1, f64::total_cmp).1;
    pixels.into_iter().filter(|(apart, _)| *apart <= most).map(|(_, judged)| judged).collect()
}

/// Mean of two quarters per pixel, of equal numbers of iterations but for one.
pub fn mean(quarters: [&[[f32; 3]]; 2]) -> Vec<[f32; 3]> {
    let pairs = quarters[0].par_iter().zip(quarters[1]);
    pairs.map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    /// The mean of the errors that [`judge`] tells.
    fn squared_error(picture: &[[f32; 3]], judges: [&[[f32; 3]]; 2], values: &[[f32; 3]]) -> f64 {
        let pixels = judge(picture, judges, values);
        pixels.iter().map(|pixel| pixel.error).sum::<f64>() / pixels.len().max(1) as f64
    }

    /// A picture that is off by a tenth, judged by halves whose noise is five times that: the error is found with a
    /// standard error of 0.0005 (12,000 pixels of three equal channels); a judge used twice would tell its own
    /// variance, 26 times as much.
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
