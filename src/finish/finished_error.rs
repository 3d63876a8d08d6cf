//! The error of a finished picture and its distribution over the pixels, estimated without a reference.
//!
//! A picture `F` is finished from quarters 1 and 2 of the iterations exactly as the whole render is, and compared with
//! quarters 3 and 4 by the cross product
//!
//! ```text
//! p = (F - Q3)(F - Q4)
//! ```
//!
//! whose mean is the squared error at half of the iterations. The mean of the control `q = (Q1 - Q2)(Q3 - Q4)` is zero
//! for any picture, and its variance is four times that of the noise in `p`. Sums of `q` over blocks of pixels give the
//! standard error of the mean of `p`, and over windows the weight of each window's own mean.
//!
//! Bias that all quarters share is estimated from two bandwidth levels. The next larger level has twice the squared
//! bandwidth and so twice the bias \[Knaus and Zwicker 2011, 3\]: the difference of the two is the bias itself. Bias is
//! smooth and most of the two levels' noise is common, so that means over windows show it. In media, where squared
//! bandwidths are a factor 2^(2/3) apart, the difference is 0.59 of the bias. With one bandwidth, pixels estimate their
//! squared bias themselves (`estimator/error.rs`), and windows average it.

use super::window::Windows;
use crate::film::{Picture, Size, channel_mean};
use crate::stat::TRIMMED_SHARE;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Pixels to each side of a pixel in the windows over which squared errors are averaged.
const REACH: usize = 7;
/// Variance of the control `q` relative to that of `p`, Var(q) / Var(p), see the head of this file.
const CONTROL_VARIANCE: f64 = 4.0;
/// Stand-in for an infinite relative variance of a pixel.
const INFINITE_VARIANCE: f64 = 1e30;
/// Least estimated squared error of a pixel, as a share of the error that its variance predicts.
const MIN_PREDICTED_SHARE: f64 = 0.1;

/// Exponent `b` of the error of finished pictures, iterations^-b, before a render has shown its own: the project's
/// scenes show 0.2 to 0.5 (`docs/lab/measurements.md`, slopes of finished pictures).
pub const DEFAULT_CONVERGENCE_RATE: f64 = 0.35;

/// Estimated error of a picture finished from half of a render's iterations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FinishedError {
    /// Squared relative error without the share [`TRIMMED_SHARE`] of the pixels, those of the largest variance; noise around a
    /// small error can make it negative.
    pub noise: f64,
    /// Standard error of `noise`.
    pub deviation: f64,
    /// Squared relative bias that all quarters share; zero if there is no other bandwidth to compare with.
    pub bias: f64,
    /// Share of the estimate's variance in the pixels left out of `noise`, 0 to 1. Near one a few bright samples hold
    /// all noise, and no sample so far predicts how much light others like them will add.
    pub rare: f64,
    /// Squared relative error by light that hardly any photon has carried. The quarters of the iterations do not show
    /// it; the caller adds it from the counts of photons.
    pub unseen: f64,
}

/// Squared errors of every pixel of a finished picture.
#[derive(Clone, Debug)]
pub struct ErrorMap {
    /// Squared error by noise of every pixel and channel, after half of the iterations.
    noise: Picture,
    /// Squared bias of every pixel and channel.
    bias: Picture,
    /// Factors that make squared errors relative: one over the pixel's squared value plus the
    /// [floor](Picture::relative_floor).
    pub weight: Vec<f32>,
}

impl ErrorMap {
    /// Squared errors of the pixels of the picture finished from all iterations. Noise falls at
    /// [`DEFAULT_CONVERGENCE_RATE`], not at the rate that this render has shown: merged shards must give the same map
    /// as one render.
    pub fn squared(&self) -> Picture {
        let fall = (-2.0 * DEFAULT_CONVERGENCE_RATE).exp2() as f32;
        self.noise.zip(&self.bias, |noise, bias| fall * noise + bias)
    }
}

/// The pictures from which the error of a finished picture is estimated, all of one size.
#[derive(Clone, Copy)]
pub struct ErrorEstimator<'a> {
    /// The picture finished from the first half of the iterations: quarters 1 and 2.
    pub half: &'a Picture,
    /// The unfinished pictures that each of four equal parts of the iterations gives.
    pub quarters: &'a [Picture; 4],
    /// Standard error of the unfinished estimate by all iterations.
    pub deviation: &'a Picture,
    /// The bandwidth level that is the method's own image, and the next larger; `None` without levels.
    pub levels: Option<[&'a Picture; 2]>,
    /// Estimated squared bias of every pixel, with noise around zero; `None` with levels or without bias.
    pub squared_bias: Option<&'a Picture>,
}

impl ErrorEstimator<'_> {
    /// The error of the whole finished picture.
    pub fn error(&self) -> FinishedError {
        let products = Products::of(self);
        self.mean_error(&products, self.bias(&products).as_ref())
    }

    /// The error of the whole finished picture, and the errors of its pixels.
    pub fn error_and_map(&self) -> (FinishedError, ErrorMap) {
        let products = Products::of(self);
        let bias = self.bias(&products);
        let error = self.mean_error(&products, bias.as_ref());
        (error, self.map(products, bias, error))
    }

    fn size(&self) -> Size {
        self.half.size()
    }

    /// Relative variance of pixel `i` of the estimate, mean over RGB; `weight` is the factor that makes squares
    /// relative.
    fn variance(&self, i: usize, weight: f64) -> f64 {
        let variance = self.deviation[i].iter().map(|s| (f64::from(*s).powi(2) * weight).min(INFINITE_VARIANCE));
        variance.sum::<f64>() / 3.0
    }

    fn mean_error(&self, products: &Products, bias: Option<&Picture>) -> FinishedError {
        FinishedError {
            noise: products.average(&products.error),
            deviation: (self.squared_block_sums(products) / CONTROL_VARIANCE).sqrt() / products.count,
            bias: bias.map_or(0.0, |bias| products.average(bias).max(0.0)),
            rare: products.rare,
            unseen: 0.0,
        }
    }

    /// Squared relative bias of every pixel, averaged over windows: the squared difference of the two bandwidth levels, or
    /// the estimate of the pixels themselves; `None` without either.
    fn bias(&self, products: &Products) -> Option<Picture> {
        let windows = Windows::new(self.size(), REACH, &products.kept);
        let relative = |of: &(dyn Fn(usize, usize, f64) -> f64 + Sync)| {
            Picture::from_fn(self.size(), |i| std::array::from_fn(|c| of(i, c, products.weight[i]) as f32))
        };
        if let Some([own, larger]) = self.levels {
            let apart = |i: usize, c: usize| f64::from(larger[i][c]) - f64::from(own[i][c]);
            let smooth = windows.means(&relative(&|i, c, weight| apart(i, c) * weight.sqrt()));
            return Some(Picture::new(self.size(), smooth).map(|d| d * d));
        }
        let squared = self.squared_bias?;
        let squared = relative(&|i, c, weight| f64::from(squared[i][c]) * weight);
        Some(Picture::new(self.size(), windows.means(&squared)))
    }

    /// Squared errors of every pixel: a mean of the window's own `p` and of the error predicted from the variance of
    /// the estimate, which distributes the picture's error over the pixels. The weights are inverse variances; the
    /// variance of the prediction is its square.
    fn map(&self, products: Products, bias: Option<Picture>, error: FinishedError) -> ErrorMap {
        let Products { ref weight, error: ref own, ref control, ref kept, .. } = products;
        let variance = Picture::from_fn(self.size(), |i| {
            self.deviation[i].map(|s| ((f64::from(s).powi(2) * weight[i]).min(INFINITE_VARIANCE)) as f32)
        });
        let scale = error.noise.max(error.deviation) / products.average(&variance).max(f64::MIN_POSITIVE);
        let windows = Windows::new(self.size(), REACH, kept);
        let (predicted, own) = (windows.means(&variance), windows.means(own));
        let mut square = windows.means(control);
        square.par_iter_mut().for_each(|q| *q = q.map(|q| q * q / CONTROL_VARIANCE as f32));
        let noise_of_own = Windows::new(self.size(), 2 * REACH, kept).means(&square);
        let noise = Picture::from_fn(self.size(), |i| {
            std::array::from_fn(|c| {
                let predicted = scale * f64::from(predicted[i][c]);
                let trust = predicted * predicted / (predicted * predicted + f64::from(noise_of_own[i][c]));
                let both = if trust.is_finite() {
                    trust * f64::from(own[i][c]) + (1.0 - trust) * predicted
                } else {
                    predicted
                };
                (both.max(MIN_PREDICTED_SHARE * predicted) / weight[i]) as f32
            })
        });
        let mut bias = bias.unwrap_or_else(|| Picture::filled(self.size(), [0.0; 3]));
        bias.iter_mut()
            .zip(weight)
            .for_each(|(bias, weight)| *bias = bias.map(|b| (f64::from(b.max(0.0)) / weight) as f32));
        ErrorMap { noise, bias, weight: products.weight.into_iter().map(|w| w as f32).collect() }
    }

    /// Sum over square blocks of pixels of the squared sum of the control `q` in each: its expectation is the variance
    /// of the whole sum if pixels farther apart than a block are independent.
    fn squared_block_sums(&self, products: &Products) -> f64 {
        const SIDE: usize = 2 * REACH + 1;
        let Size { width, height } = self.size();
        let across = width.div_ceil(SIDE);
        let mut blocks = vec![0.0; across * height.div_ceil(SIDE)];
        for (i, value) in products.control.iter().enumerate().filter(|(i, _)| products.kept[*i]) {
            let (x, y) = (i % width, i / width);
            blocks[y / SIDE * across + x / SIDE] += channel_mean(*value);
        }
        blocks.iter().map(|sum| sum * sum).sum()
    }
}

/// The products `p` and `q` of differences of the quarters, pixel by pixel, see the head of this file.
struct Products {
    /// Factor of each pixel that makes squares relative.
    weight: Vec<f64>,
    /// `p` of each pixel, a noisy estimate of its squared error, relative.
    error: Picture,
    /// `q` of each pixel, the control with mean zero, relative.
    control: Picture,
    /// Whether each pixel counts: all but the share [`TRIMMED_SHARE`], which has the largest variance.
    kept: Vec<bool>,
    /// Number of pixels that count, at least 1.
    count: f64,
    /// Share of the estimate's variance in the pixels that do not count, see [`FinishedError::rare`].
    rare: f64,
}

impl Products {
    fn of(estimator: &ErrorEstimator<'_>) -> Products {
        let (f, q) = (estimator.half, estimator.quarters);
        let floor = f.relative_floor();
        let weight: Vec<f64> = f.par_iter().map(|rgb| 1.0 / (channel_mean(*rgb).powi(2) + floor)).collect();
        let plane = |product: &(dyn Fn([f64; 4], f64) -> f64 + Sync)| {
            let of_channel = |i: usize, c: usize| {
                product(std::array::from_fn(|k| f64::from(q[k][i][c])), f64::from(f[i][c])) * weight[i]
            };
            Picture::from_fn(f.size(), |i| std::array::from_fn(|c| of_channel(i, c) as f32))
        };
        let error = plane(&|q, f| (f - q[2]) * (f - q[3]));
        let control = plane(&|q, _| (q[0] - q[1]) * (q[2] - q[3]));
        // Chosen by the variance, which does not depend on the signs of the quarters' errors. A choice by the difference
        // of the quarters, or by their distance from the picture, would bias the mean of their products.
        let variances: Vec<f64> = (0..f.len()).map(|i| estimator.variance(i, weight[i])).collect();
        let (kept, rare) = without_worst(&variances);
        let count = kept.iter().filter(|kept| **kept).count().max(1) as f64;
        Products { weight, error, control, kept, count, rare }
    }

    /// Mean of `plane` over the pixels that count, and over channels.
    fn average(&self, plane: &Picture) -> f64 {
        let kept = plane.iter().zip(&self.kept).filter(|(_, kept)| **kept);
        kept.map(|(value, _)| channel_mean(*value)).sum::<f64>() / self.count
    }
}

/// Which of the `values` are not in the largest share [`TRIMMED_SHARE`], and the part of the sum, 0 to 1, that the
/// largest have.
fn without_worst(values: &[f64]) -> (Vec<bool>, f64) {
    let count = values.len() - (values.len() as f64 * TRIMMED_SHARE) as usize;
    if count == 0 {
        return (Vec::new(), 0.0);
    }
    let most = *values.to_vec().select_nth_unstable_by(count - 1, f64::total_cmp).1;
    let kept: Vec<bool> = values.iter().map(|value| *value <= most).collect();
    let all: f64 = values.iter().sum();
    let of_kept: f64 = values.iter().filter(|value| **value <= most).sum();
    (kept, if all > 0.0 { 1.0 - of_kept / all } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    const SIZE: Size = Size { width: 160, height: 120 };

    /// A grey picture with uniform noise of standard deviation `sigma` at each pixel.
    fn noisy(seed: u64, sigma: impl Fn(usize) -> f32 + Sync + Send) -> Picture {
        let draw = |index: usize| Stream::new(seed, 0, Domain::Test, index as u64).vertex(0).one(Purpose::Pixel);
        Picture::from_fn(SIZE, |i| [1.0 + sigma(i) * 12f32.sqrt() * (draw(i) - 0.5); 3])
    }

    fn grey(value: f32) -> Picture {
        Picture::filled(SIZE, [value; 3])
    }

    fn estimated(
        half: &Picture,
        sigma: impl Fn(usize) -> f32 + Copy + Sync + Send,
        seed: u64,
    ) -> (FinishedError, ErrorMap) {
        let quarters = [1, 2, 3, 4].map(|k| noisy(10 * seed + k, sigma));
        let deviation = Picture::from_fn(SIZE, |i| [0.5 * sigma(i); 3]);
        ErrorEstimator { half, quarters: &quarters, deviation: &deviation, levels: None, squared_bias: None }
            .error_and_map()
    }

    /// Pictures that are off by a tenth, with quarters whose noise is three times that: the estimated error is right,
    /// and its standard error is the spread of twelve estimates.
    #[test]
    fn the_error_is_right_and_so_is_its_standard_error() {
        let picture = grey(1.1);
        let truth = 0.01 / (1.01 * 1.21);
        let errors: Vec<FinishedError> = (0..12).map(|seed| estimated(&picture, |_| 0.3, seed).0).collect();
        let apart: Vec<f64> = errors.iter().map(|error| (error.noise - truth) / error.deviation).collect();
        // Mean of twelve normal draws, and their mean square, chi-squared of twelve: four standard errors.
        let mean = apart.iter().sum::<f64>() / 12.0;
        let square = apart.iter().map(|z| z * z).sum::<f64>() / 12.0;
        assert!(mean.abs() < 4.0 / 12f64.sqrt() && square < 1.0 + 4.0 * (2f64 / 12.0).sqrt(), "{mean} {square}");
        // The stated standard error is not far too large either.
        assert!(square > 0.1, "{square}");
        // Uniform noise has no tail: the worst half per cent hold little of it.
        assert!(errors.iter().all(|error| error.rare < 0.05 && error.bias == 0.0));
    }

    /// The left half of a picture is off by a fifth, the right half is exact.
    #[test]
    fn the_map_shows_where_the_error_is() {
        let left = |i: usize| i % SIZE.width < SIZE.width / 2;
        let picture = Picture::from_fn(SIZE, |i| [if left(i) { 1.2 } else { 1.0 }; 3]);
        let (_, map) = estimated(&picture, |_| 0.1, 3);
        let inside = |i: &usize| (i % SIZE.width).abs_diff(SIZE.width / 2) > REACH;
        let mean = |of_left: bool| {
            let chosen: Vec<usize> = (0..SIZE.pixels()).filter(inside).filter(|i| left(*i) == of_left).collect();
            chosen.iter().map(|i| f64::from(map.noise[*i][1])).sum::<f64>() / chosen.len() as f64
        };
        assert!((mean(true) / 0.04 - 1.0).abs() < 0.1, "{}", mean(true));
        assert!(mean(false) < 0.2 * mean(true), "{}", mean(false));
    }

    /// Where the noise of the quarters drowns the error, the map follows the variance.
    #[test]
    fn the_map_follows_the_variance_where_windows_are_too_noisy() {
        let sigma = |i: usize| if i % SIZE.width < SIZE.width / 2 { 8.0 } else { 2.0 };
        let (_, map) = estimated(&grey(1.0), sigma, 4);
        let mean = |low: usize, high: usize| {
            let chosen = (0..SIZE.pixels()).filter(|i| (low..high).contains(&(i % SIZE.width)));
            chosen.map(|i| f64::from(map.noise[i][0])).sum::<f64>()
        };
        assert!(mean(0, 70) > 3.0 * mean(90, 160), "{} {}", mean(0, 70), mean(90, 160));
        assert!(map.noise.iter().flatten().all(|value| *value >= 0.0 && value.is_finite()));
    }

    /// One bright sample holds all noise: `rare` says so, and the error without its pixel is right.
    #[test]
    fn a_bright_sample_is_reported_as_rare() {
        let mut quarters = [1, 2, 3, 4].map(|k| noisy(k, |_| 0.05));
        quarters[2][777] = [1e5; 3];
        let mut deviation = grey(0.025);
        deviation[777] = [2.5e4; 3];
        let half = grey(1.1);
        let error = ErrorEstimator {
            half: &half,
            quarters: &quarters,
            deviation: &deviation,
            levels: None,
            squared_bias: None,
        }
        .error();
        assert!(error.rare > 0.99, "{}", error.rare);
        assert!((error.noise / (0.01 / (1.01 * 1.21)) - 1.0).abs() < 0.05, "{}", error.noise);
        assert!(error.noise.is_finite() && error.deviation.is_finite());
    }

    /// Levels that are off by a tenth and by a fifth show a bias of a tenth; noise that they share shows none.
    #[test]
    fn levels_show_the_bias() {
        let quarters = [1, 2, 3, 4].map(|k| noisy(k, |_| 0.2));
        let own = noisy(9, |_| 0.2);
        let larger = own.map(|v| v + 0.1);
        let levels = Some([&own, &larger]);
        let (half, deviation) = (grey(1.0), grey(0.1));
        let (error, map) =
            ErrorEstimator { half: &half, quarters: &quarters, deviation: &deviation, levels, squared_bias: None }
                .error_and_map();
        assert!((error.bias / (0.01 / 1.01) - 1.0).abs() < 1e-3, "{}", error.bias);
        assert!(map.bias.iter().flatten().all(|b| (b / 0.01 - 1.0).abs() < 1e-3));
        let fall = 2f32.powf(-0.7);
        assert!(
            map.squared().iter().zip(&map.noise).all(|(all, noise)| (all[0] - fall * noise[0] - 0.01).abs() < 1e-5)
        );
    }
}
