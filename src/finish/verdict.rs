//! How wrong a finished picture is, and where, told by its quarters without a reference.
//!
//! A picture `F` is finished from quarters 1 and 2 as the whole one will be, and judged by those that it has not seen
//! ([`super::told`]). The mean of
//!
//! ```text
//! p = (F - Q3)(F - Q4)
//! ```
//!
//! is the squared error of half the iterations. Beside it stands what its noise alone would tell: the mean of
//! `q = (Q1 - Q2)(Q3 - Q4)` is zero whatever the picture is, and `q` has four times the variance of the judges' part of
//! `p`. Over blocks of pixels it tells how sure the number is, and over windows how far the window's own mean is to be
//! believed.
//!
//! Bias that all quarters have in common is told by bandwidth levels: the next larger has twice the squared bandwidth,
//! and with it twice the bias \[Knaus and Zwicker 2011, 3\], so that the difference of the two is the bias itself. It is
//! smooth, and noise that both levels share drops out, so that a mean over a window shows it. In media, where squared
//! bandwidths are a factor 2^(2/3) apart, the difference is 0.59 of it.

use super::halves::TRIMMED_SHARE;
use super::window::{Size, Windows};
use crate::stat::floor;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Pixels to each side of the windows in which errors of pixels are averaged.
const REACH: usize = 7;
/// What `q` has of the variance of `p`.
const VARIANCES: f64 = 4.0;
/// Relative variance of what nothing is known of.
const UNKNOWN: f64 = 1e30;
/// A pixel's squared error is no smaller share of what its variance lets expect.
const LEAST: f64 = 0.1;

/// The power of the iterations with which errors of finished pictures fall, usually: between 0.2 and 0.5, what the
/// scenes of the project show (`docs/lab/measurements.md`, slopes of finished pictures).
pub const USUAL: f64 = 0.35;

/// The error of a picture finished from half of the iterations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Squared relative error, trimmed of the pixels that the estimate is least sure of ([`TRIMMED_SHARE`]); noise around a small one may
    /// make it negative.
    pub noise: f64,
    /// Standard error of that.
    pub deviation: f64,
    /// Squared relative bias that all quarters have in common, as levels tell it; zero without levels.
    pub bias: f64,
    /// Share of the estimate's variance that lies in the pixels left out, 0 to 1: near one a few bright samples
    /// hold all noise, and what others of their kind will bring no sample so far can tell.
    pub rare: f64,
    /// Squared relative error by light that photons have not brought, which quarters do not tell: whoever counts the
    /// photons adds it.
    pub unseen: f64,
}

/// Squared errors per pixel.
#[derive(Clone, Debug)]
pub struct Errors {
    /// Of noise, at half of the iterations.
    noise: Vec<[f32; 3]>,
    /// Of bias.
    bias: Vec<[f32; 3]>,
    /// What makes them relative: one over the squared value of the pixel plus the [`floor`].
    pub weight: Vec<f32>,
}

impl Errors {
    /// Squared errors of the picture finished from all iterations, whose noise has fallen as is [`USUAL`]: what one render
    /// has shown of its own decay is not the same where shards of it are joined.
    pub fn squared(&self) -> impl Iterator<Item = [f32; 3]> + '_ {
        let fall = (-2.0 * USUAL).exp2() as f32;
        let pairs = self.noise.iter().zip(&self.bias);
        pairs.map(move |(noise, bias)| std::array::from_fn(|c| fall * noise[c] + bias[c]))
    }
}

/// What is judged, and by what.
#[derive(Clone, Copy)]
pub struct Trial<'a> {
    /// Width and height of all planes.
    pub size: Size,
    /// The picture finished from quarters 1 and 2.
    pub half: &'a [[f32; 3]],
    /// The quarters.
    pub quarters: &'a [Vec<[f32; 3]>; 4],
    /// Standard error of the estimate by all iterations.
    pub deviation: &'a [[f32; 3]],
    /// The method's own level, and the next larger.
    pub levels: Option<[&'a [[f32; 3]]; 2]>,
}

impl Trial<'_> {
    /// The verdict.
    pub fn verdict(&self) -> Verdict {
        let evidence = Evidence::of(self);
        self.number(&evidence, self.bias(&evidence).as_deref())
    }

    /// The verdict, and the errors of pixels.
    pub fn judge(&self) -> (Verdict, Errors) {
        let evidence = Evidence::of(self);
        let bias = self.bias(&evidence);
        let verdict = self.number(&evidence, bias.as_deref());
        (verdict, self.errors(evidence, bias, verdict))
    }

    /// Relative variance of a pixel of the estimate.
    fn variance(&self, i: usize, weight: f64) -> f64 {
        let variance = self.deviation[i].iter().map(|s| (f64::from(*s).powi(2) * weight).min(UNKNOWN));
        variance.sum::<f64>() / 3.0
    }

    fn number(&self, evidence: &Evidence, bias: Option<&[[f32; 3]]>) -> Verdict {
        Verdict {
            noise: evidence.average(&evidence.told),
            deviation: (self.squares_of_blocks(evidence) / VARIANCES).sqrt() / evidence.count,
            bias: bias.map_or(0.0, |bias| evidence.average(bias)),
            rare: evidence.rare,
            unseen: 0.0,
        }
    }

    /// Squared relative bias of pixels, where levels tell it.
    fn bias(&self, evidence: &Evidence) -> Option<Vec<[f32; 3]>> {
        let [own, larger] = self.levels?;
        let root = |i: usize| {
            let weight = evidence.weight[i].sqrt();
            std::array::from_fn(|c| ((f64::from(larger[i][c]) - f64::from(own[i][c])) * weight) as f32)
        };
        let difference: Vec<[f32; 3]> = (0..self.size.pixels()).into_par_iter().map(root).collect();
        let mut smooth = Windows::new(self.size, REACH, &evidence.kept).means(&difference);
        smooth.par_iter_mut().for_each(|d| *d = d.map(|d| d * d));
        Some(smooth)
    }

    /// A window's own mean, and what the variance of the estimate lets expect of it: the picture's error, spread as that
    /// is. Each counts by how sure it is; what is expected by as much as it is.
    fn errors(&self, evidence: Evidence, bias: Option<Vec<[f32; 3]>>, verdict: Verdict) -> Errors {
        let Evidence { ref weight, ref told, ref control, ref kept, .. } = evidence;
        let variance = |i: usize| self.deviation[i].map(|s| ((f64::from(s).powi(2) * weight[i]).min(UNKNOWN)) as f32);
        let variance: Vec<[f32; 3]> = (0..self.size.pixels()).into_par_iter().map(variance).collect();
        let scale = verdict.noise.max(verdict.deviation) / evidence.average(&variance).max(f64::MIN_POSITIVE);
        let windows = Windows::new(self.size, REACH, kept);
        let (expected, seen) = (windows.means(&variance), windows.means(told));
        let mut square = windows.means(control);
        square.par_iter_mut().for_each(|q| *q = q.map(|q| q * q / VARIANCES as f32));
        let doubt = Windows::new(self.size, 2 * REACH, kept).means(&square);
        let of_pixel = |i: usize| -> [f32; 3] {
            std::array::from_fn(|c| {
                let expected = scale * f64::from(expected[i][c]);
                let sure = expected * expected / (expected * expected + f64::from(doubt[i][c]));
                let known =
                    if sure.is_finite() { sure * f64::from(seen[i][c]) + (1.0 - sure) * expected } else { expected };
                (known.max(LEAST * expected) / weight[i]) as f32
            })
        };
        let noise = (0..self.size.pixels()).into_par_iter().map(of_pixel).collect();
        let mut bias = bias.unwrap_or_else(|| vec![[0.0; 3]; self.size.pixels()]);
        bias.iter_mut().zip(weight).for_each(|(bias, weight)| *bias = bias.map(|b| (f64::from(b) / weight) as f32));
        Errors { noise, bias, weight: evidence.weight.into_iter().map(|w| w as f32).collect() }
    }

    /// Sum over square blocks of the square of what the control sums to in each: its expectation is the variance of the
    /// whole sum, where pixels farther apart than a block share nothing.
    fn squares_of_blocks(&self, evidence: &Evidence) -> f64 {
        const SIDE: usize = 2 * REACH + 1;
        let across = self.size.width.div_ceil(SIDE);
        let mut blocks = vec![0.0; across * self.size.height.div_ceil(SIDE)];
        for (i, value) in evidence.control.iter().enumerate().filter(|(i, _)| evidence.kept[*i]) {
            let (x, y) = (i % self.size.width, i / self.size.width);
            blocks[y / SIDE * across + x / SIDE] += mean(value);
        }
        blocks.iter().map(|sum| sum * sum).sum()
    }
}

/// What the quarters say, pixel by pixel.
struct Evidence {
    /// What makes squares relative.
    weight: Vec<f64>,
    /// `p`, relative.
    told: Vec<[f32; 3]>,
    /// `q`, relative.
    control: Vec<[f32; 3]>,
    /// Pixels that are not among the worst.
    kept: Vec<bool>,
    /// How many these are.
    count: f64,
    /// See [`Verdict::rare`].
    rare: f64,
}

impl Evidence {
    fn of(trial: &Trial<'_>) -> Evidence {
        let pixels = trial.size.pixels();
        let (f, q) = (trial.half, trial.quarters);
        let value = |i: usize| mean(&f[i]);
        let floor = floor::relative_to_mean((0..pixels).map(value));
        let weight: Vec<f64> = (0..pixels).into_par_iter().map(|i| 1.0 / (value(i).powi(2) + floor)).collect();
        let plane = |of: &(dyn Fn([f64; 4], usize, usize) -> f64 + Sync)| -> Vec<[f32; 3]> {
            let at = |i: usize, c: usize| std::array::from_fn(|k| f64::from(q[k][i][c]));
            let of_pixel = |i: usize| std::array::from_fn(|c| (of(at(i, c), i, c) * weight[i]) as f32);
            (0..pixels).into_par_iter().map(of_pixel).collect()
        };
        let told = plane(&|q, i, c| (f64::from(f[i][c]) - q[2]) * (f64::from(f[i][c]) - q[3]));
        let control = plane(&|q, _, _| (q[0] - q[1]) * (q[2] - q[3]));
        // By the variance, which is blind to the signs of the judges' errors: by how far these are apart, or off the
        // picture, those of one sign would be left out more often, and the mean of their products would be off.
        let (kept, rare) = usual(&(0..pixels).map(|i| trial.variance(i, weight[i])).collect::<Vec<_>>());
        let count = kept.iter().filter(|kept| **kept).count().max(1) as f64;
        Evidence { weight, told, control, kept, count, rare }
    }

    /// Mean over pixels that count, and channels.
    fn average(&self, plane: &[[f32; 3]]) -> f64 {
        plane.iter().zip(&self.kept).filter(|(_, kept)| **kept).map(|(value, _)| mean(value)).sum::<f64>() / self.count
    }
}

fn mean(rgb: &[f32; 3]) -> f64 {
    rgb.iter().map(|value| f64::from(*value)).sum::<f64>() / 3.0
}

/// Which pixels are not among the worst by some value, and what share of the sum the worst have.
fn usual(values: &[f64]) -> (Vec<bool>, f64) {
    let count = values.len() - (values.len() as f64 * TRIMMED_SHARE) as usize;
    if count == 0 {
        return (Vec::new(), 0.0);
    }
    let most = *values.to_vec().select_nth_unstable_by(count - 1, f64::total_cmp).1;
    let kept: Vec<bool> = values.iter().map(|value| *value <= most).collect();
    let sum = |of: &mut dyn Iterator<Item = &f64>| of.sum::<f64>();
    let all = sum(&mut values.iter());
    let some = sum(&mut values.iter().filter(|value| **value <= most));
    (kept, if all > 0.0 { 1.0 - some / all } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    const SIZE: Size = Size { width: 160, height: 120 };

    /// A grey one with noise of this standard deviation (uniform), row by row.
    fn noisy(seed: u64, sigma: impl Fn(usize) -> f32) -> Vec<[f32; 3]> {
        let draw = |index: usize| Stream::new(seed, 0, Domain::Test, index as u64).vertex(0).one(Purpose::Pixel);
        (0..SIZE.pixels()).map(|i| [1.0 + sigma(i) * 12f32.sqrt() * (draw(i) - 0.5); 3]).collect()
    }

    fn judged(half: &[[f32; 3]], sigma: impl Fn(usize) -> f32 + Copy, seed: u64) -> (Verdict, Errors) {
        let quarters = [1, 2, 3, 4].map(|k| noisy(10 * seed + k, sigma));
        let deviation: Vec<[f32; 3]> = (0..SIZE.pixels()).map(|i| [0.5 * sigma(i); 3]).collect();
        Trial { size: SIZE, half, quarters: &quarters, deviation: &deviation, levels: None }.judge()
    }

    /// Pictures that are off by a tenth, judged by quarters whose noise is three times that: the number is right, and
    /// its standard error is what twelve sets of quarters show.
    #[test]
    fn the_number_is_right_and_knows_how_sure_it_is() {
        let picture = vec![[1.1; 3]; SIZE.pixels()];
        let truth = 0.01 / (1.01 * 1.21);
        let told: Vec<Verdict> = (0..12).map(|seed| judged(&picture, |_| 0.3, seed).0).collect();
        let apart: Vec<f64> = told.iter().map(|verdict| (verdict.noise - truth) / verdict.deviation).collect();
        // Mean of twelve normal draws, and their mean square, chi-squared of twelve: four standard errors.
        let mean = apart.iter().sum::<f64>() / 12.0;
        let square = apart.iter().map(|z| z * z).sum::<f64>() / 12.0;
        assert!(mean.abs() < 4.0 / 12f64.sqrt() && square < 1.0 + 4.0 * (2f64 / 12.0).sqrt(), "{mean} {square}");
        // Not far too sure, nor too unsure.
        assert!(square > 0.1, "{square}");
        // Uniform noise has no tail: the worst half per cent hold little of it.
        assert!(told.iter().all(|verdict| verdict.rare < 0.05 && verdict.bias == 0.0));
    }

    /// The left half of a picture is off by a fifth, the right half by nothing: pixels tell which.
    #[test]
    fn pixels_tell_where() {
        let left = |i: usize| i % SIZE.width < SIZE.width / 2;
        let picture: Vec<[f32; 3]> = (0..SIZE.pixels()).map(|i| [if left(i) { 1.2 } else { 1.0 }; 3]).collect();
        let (_, errors) = judged(&picture, |_| 0.1, 3);
        let inside = |i: &usize| (i % SIZE.width).abs_diff(SIZE.width / 2) > REACH;
        let mean = |of_left: bool| {
            let chosen: Vec<usize> = (0..SIZE.pixels()).filter(inside).filter(|i| left(*i) == of_left).collect();
            chosen.iter().map(|i| f64::from(errors.noise[*i][1])).sum::<f64>() / chosen.len() as f64
        };
        assert!((mean(true) / 0.04 - 1.0).abs() < 0.1, "{}", mean(true));
        assert!(mean(false) < 0.2 * mean(true), "{}", mean(false));
    }

    /// Where the judges drown everything, the error lies where the variance is.
    #[test]
    fn variance_tells_where_windows_do_not() {
        let sigma = |i: usize| if i % SIZE.width < SIZE.width / 2 { 8.0 } else { 2.0 };
        let picture = vec![[1.0; 3]; SIZE.pixels()];
        let (_, errors) = judged(&picture, sigma, 4);
        let mean = |low: usize, high: usize| {
            let chosen = (0..SIZE.pixels()).filter(|i| (low..high).contains(&(i % SIZE.width)));
            chosen.map(|i| f64::from(errors.noise[i][0])).sum::<f64>()
        };
        assert!(mean(0, 70) > 3.0 * mean(90, 160), "{} {}", mean(0, 70), mean(90, 160));
        assert!(errors.noise.iter().flatten().all(|value| *value >= 0.0 && value.is_finite()));
    }

    /// A bright sample holds all noise: that is said, and the number without it is right.
    #[test]
    fn a_bright_sample_is_said() {
        let picture = vec![[1.1; 3]; SIZE.pixels()];
        let mut quarters = [1, 2, 3, 4].map(|k| noisy(k, |_| 0.05));
        quarters[2][777] = [1e5; 3];
        let mut deviation = vec![[0.025; 3]; SIZE.pixels()];
        deviation[777] = [2.5e4; 3];
        let (verdict, _) =
            Trial { size: SIZE, half: &picture, quarters: &quarters, deviation: &deviation, levels: None }.judge();
        assert!(verdict.rare > 0.99, "{}", verdict.rare);
        assert!((verdict.noise / (0.01 / (1.01 * 1.21)) - 1.0).abs() < 0.05, "{}", verdict.noise);
        assert!(verdict.noise.is_finite() && verdict.deviation.is_finite());
    }

    /// Levels that are off by a tenth and by a fifth tell a bias of a tenth; noise they share tells nothing.
    #[test]
    fn levels_tell_the_bias() {
        let quarters = [1, 2, 3, 4].map(|k| noisy(k, |_| 0.2));
        let own = noisy(9, |_| 0.2);
        let larger: Vec<[f32; 3]> = own.iter().map(|v| v.map(|v| v + 0.1)).collect();
        let deviation = vec![[0.1; 3]; SIZE.pixels()];
        let picture = vec![[1.0; 3]; SIZE.pixels()];
        let levels: Option<[&[[f32; 3]]; 2]> = Some([&own, &larger]);
        let (verdict, errors) =
            Trial { size: SIZE, half: &picture, quarters: &quarters, deviation: &deviation, levels }.judge();
        assert!((verdict.bias / (0.01 / 1.01) - 1.0).abs() < 1e-3, "{}", verdict.bias);
        assert!(errors.bias.iter().flatten().all(|b| (b / 0.01 - 1.0).abs() < 1e-3));
        let fall = 2f32.powf(-0.7);
        assert!(errors.squared().zip(&errors.noise).all(|(all, noise)| (all[0] - fall * noise[0] - 0.01).abs() < 1e-5));
    }
}
