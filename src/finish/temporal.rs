//! The temporal finish: averages a frame of an animation with its neighbours, so that the sequence flickers less.
//!
//! Motion vectors lead from a pixel to the pixel of another frame that shows the same surface point. Estimates and
//! denoised pictures are averaged over the frame itself and up to [`REACH`] frames before and after it:
//!
//! ```text
//! M = (M_0 + sum_k w_k M_k) / (1 + sum_k w_k),   w_k = V / (g_k V + b_k^2)
//! ```
//!
//! `V` is the variance of the frame's estimate, averaged over 7 x 7 pixels and over the frames: weights by the variance
//! of single pixels would favour pixels that have missed bright samples. `g_k` is the variance of the other frame
//! relative to this one. `b_k^2` estimates the squared difference of the true values from 3 x 3 pixels
//! (`Pair::squared_bias`). With exact `b`, `g = 1` and n neighbours that all differ by `b`, the bias is at most
//! n / (2 sqrt(n + 1)) standard errors of the estimate: 0.9 for four neighbours. As noise vanishes, so do the weights of
//! all values that differ, and the average is consistent.
//!
//! Light is averaged relative to the albedo, because textures move by fractions of pixels.

use super::Estimate;
use super::parts::Named;
use super::window::{Windows, window};
use crate::error::{Error, ErrorKind, Result};
use crate::estimator::QUARTERS;
use crate::film::{Layer, LayerSet, MOTION, Picture, Size, channel_mean};
use rayon::prelude::*;

/// Number of frames before and after a frame that it is averaged with.
pub const REACH: usize = 2;
/// Number of frames in the window of a frame.
pub const WINDOW: usize = 2 * REACH + 1;
/// Pixels to each side of a pixel in the window over which variances are averaged.
const VARIANCE_REACH: usize = 3;
/// Pixels to each side of a pixel in the window that estimates differences of true values.
const BIAS_REACH: usize = 1;
/// Variance of the mean of the pixels of that window, relative to that of one pixel, if their noise is independent.
const INDEPENDENT: f32 = 1.0 / ((2 * BIAS_REACH + 1) * (2 * BIAS_REACH + 1)) as f32;
/// Largest distance, in pixels, between a pixel and the end of the motion to the other frame and back. It is larger
/// where the point is hidden in the other frame.
const MAX_RETURN: f32 = 1.0;
/// Least cosine of the angle between the normals of one surface in two frames.
const MIN_COSINE: f32 = 0.8;
/// Reflectance that is added to albedos before they are divided.
const MIN_ALBEDO: f32 = 0.02;
/// Largest ratio of the albedos of one surface in two frames.
const MAX_ALBEDO_RATIO: f32 = 2.0;
/// Least share of a frame's pixels that the next frame shows too. With fewer the camera has cut.
const MIN_SEEN: f64 = 0.25;
/// Factor of estimated squared differences: a line of one pixel's width fills a third of the 3 x 3 pixels.
const CAUTION: f32 = 3.0;
/// Stands for the pixel of a point that the other frame does not show.
const HIDDEN: u32 = u32::MAX;

/// The pictures of a frame.
pub(super) struct Pictures {
    pub estimate: Estimate,
    pub denoised: Picture,
    /// Estimate and denoised picture by the first half of the iterations; `None` if their quarters are unknown.
    pub half: Option<[Picture; 2]>,
    /// Number of bandwidth levels that the network has combined.
    pub combined: Option<usize>,
    /// Whether there is a denoiser; otherwise the denoised pictures are the estimates.
    pub is_denoised: bool,
}

/// Most bytes per pixel of a [`Frame`] with `parts` additive parts, of which black ones take no memory.
pub(super) fn bytes_per_pixel(parts: u64) -> u64 {
    112 + 12 * parts
}

/// One frame of an animation, as the temporal finish of its neighbours reads it.
pub struct Frame {
    pictures: Pictures,
    /// Additive parts of the estimate by name; `None` if a part is black.
    parts: Vec<(String, Option<Picture>)>,
    /// Variance of the estimate, mean over RGB, averaged over 7 x 7 pixels; infinite where it is unknown.
    smooth_variance: Vec<f32>,
    /// Variance of the mean of 3 x 3 pixels relative to that of one pixel: 1/9 if their noise is independent, 1 if
    /// photons are shared by all.
    correlation: Vec<f32>,
    motion: Vec<[f32; 4]>,
}

impl Frame {
    /// A frame from its pictures, the additive parts of its estimate, its motion vectors and its [`correlation`].
    pub(super) fn new(pictures: Pictures, parts: Vec<Named>, motion: Vec<[f32; 4]>, correlation: Vec<f32>) -> Frame {
        let deviation = &pictures.estimate.deviation;
        let single: Vec<[f32; 1]> = deviation.par_iter().map(|s| [variance(*s)]).collect();
        let known: Vec<bool> = single.iter().map(|[v]| v.is_finite()).collect();
        let means = Windows::new(deviation.size(), VARIANCE_REACH, &known).means(&single);
        let smooth_variance = means.iter().zip(&known).map(|([v], known)| if *known { *v } else { f32::INFINITY });
        let smooth_variance = smooth_variance.collect();
        let parts = parts.into_iter().map(|(name, part)| (name, (!part.is_black()).then_some(part))).collect();
        Frame { pictures, parts, smooth_variance, correlation, motion }
    }

    /// Variance of the estimate of pixel `i`, mean over RGB.
    fn variance(&self, i: usize) -> f32 {
        variance(self.pictures.estimate.deviation[i])
    }

    /// The estimate and the denoised picture, by all or by `half` of the iterations.
    fn pictures(&self, half: bool) -> Option<[&Picture; 2]> {
        let Pictures { estimate, denoised, half: halves, .. } = &self.pictures;
        if half { halves.as_ref().map(|halves| halves.each_ref()) } else { Some([&estimate.mean, denoised]) }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> Size {
        self.pictures.estimate.mean.size()
    }

    fn guide(&self, of: impl Fn(&Estimate) -> &Option<Picture>) -> Option<&Picture> {
        of(&self.pictures.estimate).as_ref()
    }

    /// Displacement in pixels, to the right and down, from a pixel to its point in the next or the previous frame.
    fn step(&self, pixel: usize, forward: bool) -> [f32; 2] {
        let [x, y, z, w] = self.motion[pixel];
        if forward { [-z, w] } else { [x, -y] }
    }

    /// Whether pixel `i` and pixel `j` of another frame may show one surface, by their normals and albedos.
    fn agrees(&self, i: usize, other: &Frame, j: usize) -> bool {
        let normals = self.guide(|estimate| &estimate.normal).zip(other.guide(|estimate| &estimate.normal)).is_none_or(
            |(a, b)| {
                let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
                let (a, b) = (a[i], b[j]);
                let lengths = (dot(a, a) * dot(b, b)).sqrt();
                dot(a, b) >= MIN_COSINE * lengths && (lengths > 0.0 || a == b)
            },
        );
        let similar = |ratio: f32| (MAX_ALBEDO_RATIO.recip()..=MAX_ALBEDO_RATIO).contains(&ratio);
        normals && self.albedo_ratio(i, other, j).into_iter().all(similar)
    }

    /// Factor from light at pixel `j` of another frame to light at pixel `i` of this one, if both have one irradiance.
    fn albedo_ratio(&self, i: usize, other: &Frame, j: usize) -> [f32; 3] {
        let Some((own, other)) = self.guide(|estimate| &estimate.albedo).zip(other.guide(|estimate| &estimate.albedo))
        else {
            return [1.0; 3];
        };
        std::array::from_fn(|c| own[i][c].max(MIN_ALBEDO) / other[j][c].max(MIN_ALBEDO))
    }
}

/// Mean over RGB of squared standard errors.
fn variance(deviation: [f32; 3]) -> f32 {
    channel_mean(deviation.map(|s| s * s)) as f32
}

/// The layers that may hold motion vectors, the best first.
pub(super) fn motion_layers(set: &LayerSet) -> impl Iterator<Item = &Layer> {
    let last = |layer: &Layer, name: &str| layer.name.rsplit('.').next() == Some(name);
    [MOTION, "Vector"].into_iter().filter_map(move |name| set.layers.iter().find(|layer| last(layer, name)))
}

/// The motion vectors of a picture.
///
/// # Errors
/// The layer is missing.
pub(super) fn motion(set: &LayerSet) -> Result<Vec<[f32; 4]>> {
    let planes = motion_layers(set).find_map(|layer| {
        <[_; 4]>::try_from(["X", "Y", "Z", "W"].iter().filter_map(|c| layer.plane(c)).collect::<Vec<_>>()).ok()
    });
    let Some(planes) = planes else {
        let cause = "there is no layer Motion, which says where surfaces are in the frames before and after";
        return Err(Error::new(ErrorKind::Image, "", cause)
            .hint("render with --temporal, or with --layers all,Motion,Quarter; or finish each frame alone"));
    };
    Ok((0..set.pixels()).map(|i| planes.map(|plane| plane.values[i])).collect())
}

/// Variance of the mean over 3 x 3 pixels relative to that of one pixel, averaged over 7 x 7 pixels. The three contrasts
/// of the quarters of the iterations have the noise of the estimate and no light. Without quarters, noise counts as
/// independent.
pub(super) fn correlation(size: Size, quarters: Option<&[Picture; QUARTERS]>) -> Vec<f32> {
    let Some(quarters) = quarters else { return vec![INDEPENDENT; size.pixels()] };
    let all = vec![true; size.pixels()];
    let small = Windows::new(size, BIAS_REACH, &all);
    let mut squares = vec![[0f32; 2]; size.pixels()];
    for signs in [[1.0, 1.0, -1.0, -1.0], [1.0, -1.0, 1.0, -1.0], [1.0, -1.0, -1.0, 1.0f32]] {
        let contrast = Picture::from_fn(size, |i| {
            std::array::from_fn(|c| {
                let sum = (0..QUARTERS).map(|k| signs[k] * quarters[k][i][c]).sum::<f32>();
                if sum.is_finite() { sum } else { 0.0 }
            })
        });
        let square = |rgb: [f32; 3]| channel_mean(rgb.map(|x| x * x)) as f32;
        let means = small.means(&contrast);
        squares.iter_mut().enumerate().for_each(|(i, [of_mean, of_pixel])| {
            *of_mean += square(means[i]);
            *of_pixel += square(contrast[i]);
        });
    }
    let squares = Windows::new(size, VARIANCE_REACH, &all).means(&squares);
    let share = |[mean, pixel]: &[f32; 2]| if *pixel > 0.0 { (mean / pixel).clamp(INDEPENDENT, 1.0) } else { 1.0 };
    squares.iter().map(share).collect()
}

/// The frames around a frame, in order; the middle one is the frame itself. `None`: there is no such frame, or the camera
/// cuts before it.
pub type Window<'a> = [Option<&'a Frame>; WINDOW];

/// Whether the camera has cut between a frame and the next: hardly any pixel of the one shows a surface of the other.
pub fn is_cut(frame: &Frame, next: &Frame) -> bool {
    let [places, _] = follow(&[frame, next], true);
    let seen = places.iter().filter(|place| **place != HIDDEN).count();
    (seen as f64) < MIN_SEEN * places.len() as f64
}

/// The pixels of consecutive frames that show the points of the first frame's pixels: for each frame after the first, the
/// pixel of each pixel, or [`HIDDEN`]. `forward`: the frames are in order of time.
fn follow(frames: &[&Frame], forward: bool) -> [Vec<u32>; REACH] {
    let Some(own) = frames.first() else { return [const { Vec::new() }; REACH] };
    let size = own.size();
    let add = |a: [f32; 2], b: [f32; 2]| [a[0] + b[0], a[1] + b[1]];
    let places = |i: usize| {
        let mut found = [HIDDEN; REACH];
        let (mut at, mut pixel) = ([(i % size.width) as f32, (i / size.width) as f32], i);
        for (pair, found) in frames.windows(2).zip(&mut found) {
            let (from, to) = (pair[0], pair[1]);
            let there = add(at, from.step(pixel, forward));
            let inside = |at: f32, end: usize| (at >= -0.5 && at < end as f32 - 0.5).then(|| at.round() as usize);
            let Some((x, y)) = inside(there[0], size.width).zip(inside(there[1], size.height)) else { break };
            let next = y.min(size.height - 1) * size.width + x.min(size.width - 1);
            let back = add(there, to.step(next, !forward));
            let apart = (back[0] - at[0]).abs().max((back[1] - at[1]).abs());
            // NaN is not close.
            let is_close = apart <= MAX_RETURN;
            if !is_close || !own.agrees(i, to, next) {
                break;
            }
            (*found, at, pixel) = (next as u32, there, next);
        }
        found
    };
    let all: Vec<[u32; REACH]> = (0..size.pixels()).into_par_iter().map(places).collect();
    std::array::from_fn(|k| all.iter().map(|places| places[k]).collect())
}

/// A frame of the window beside the frame itself.
struct Neighbour<'a> {
    frame: &'a Frame,
    /// The pixel that shows the point of each pixel of the frame itself, or [`HIDDEN`].
    places: Vec<u32>,
    /// Variance relative to the frame itself: `g_k`.
    ratio: f32,
}

impl<'a> Neighbour<'a> {
    /// A neighbour with its variance relative to `own`, from the mean share of the neighbour in the sum of both variances.
    fn new(own: &Frame, frame: &'a Frame, places: Vec<u32>) -> Neighbour<'a> {
        let shares = places.iter().enumerate().filter(|(_, place)| **place != HIDDEN).filter_map(|(i, place)| {
            let [a, b] = [own.smooth_variance[i], frame.smooth_variance[*place as usize]].map(f64::from);
            Some(b / (a + b)).filter(|share| share.is_finite())
        });
        let (sum, count) = shares.fold((0.0, 0), |(sum, count), share| (sum + share, count + 1));
        let share = if count > 0 { (sum / f64::from(count)).clamp(1e-6, 1.0 - 1e-6) } else { 0.5 };
        Neighbour { frame, places, ratio: (share / (1.0 - share)) as f32 }
    }

    /// The pixel that shows the point of pixel `i`; `None` if it is hidden.
    fn place(&self, i: usize) -> Option<usize> {
        (self.places[i] != HIDDEN).then_some(self.places[i] as usize)
    }
}

/// The neighbours in a window that are connected to the frame in its middle.
fn neighbours<'a>(window: &Window<'a>, own: &'a Frame) -> Vec<Neighbour<'a>> {
    let mut found = Vec::new();
    for forward in [false, true] {
        let step = |k: usize| if forward { REACH + k } else { REACH - k };
        let frames: Vec<&Frame> = (0..=REACH).map_while(|k| window[step(k)]).collect();
        let others = frames.iter().skip(1).zip(follow(&frames, forward));
        found.extend(others.map(|(frame, places)| Neighbour::new(own, frame, places)));
    }
    found
}

/// The average of a frame with its neighbours.
pub(super) struct Averaged<T> {
    pub estimate: Estimate,
    pub denoised: Picture,
    /// Number of bandwidth levels that the network has combined.
    pub combined: Option<usize>,
    /// The picture by the first halves of the iterations; `None` if a frame lacks its halves.
    pub half: Option<T>,
    /// The additive parts of the estimate.
    pub parts: Vec<Named>,
}

/// Averages the frame in the middle of a window with its neighbours; `None` if the middle is empty. `finish_half` makes a
/// picture of the average of the first halves of the iterations, and of their denoised picture. `parts` names the additive
/// parts that are averaged too.
pub(super) fn average<T>(
    window: &Window<'_>,
    finish_half: impl FnOnce(&Estimate, &Picture) -> T,
    parts: &[String],
) -> Option<Averaged<T>> {
    let own = window[REACH]?;
    let neighbours = neighbours(window, own);
    let variance = pooled_variance(own, &neighbours);
    let guided = |mean: Picture, deviation: Picture| {
        let Estimate { albedo, normal, clean_guides, alpha, samples, .. } = &own.pictures.estimate;
        let (albedo, normal, alpha) = (albedo.clone(), normal.clone(), alpha.clone());
        Estimate { mean, deviation, albedo, normal, clean_guides: *clean_guides, alpha, samples: *samples }
    };
    // The halves come first, so that their pictures do not lie in memory beside the others.
    let half = Average::new(own, &neighbours, &variance, true).map(|average| {
        let [mean, denoised] = average.pictures();
        let deviation = average.deviation().map(|s| s * std::f32::consts::SQRT_2);
        drop(average);
        finish_half(&guided(mean, deviation), &denoised)
    });
    let whole = Average::new(own, &neighbours, &variance, false)?;
    let [mean, denoised] = whole.pictures();
    let estimate = guided(mean, whole.deviation());
    Some(Averaged { estimate, denoised, combined: own.pictures.combined, half, parts: whole.parts(parts) })
}

/// The variance of the frame's estimate, averaged over the frames that show a pixel's point.
fn pooled_variance(own: &Frame, neighbours: &[Neighbour<'_>]) -> Vec<f32> {
    let pooled = |i: usize| {
        let (mut sum, mut count) = (own.smooth_variance[i], 1.0);
        for other in neighbours {
            let Some(place) = other.place(i) else { continue };
            let variance = other.frame.smooth_variance[place] / other.ratio;
            if variance.is_finite() {
                (sum, count) = (sum + variance, count + 1.0);
            }
        }
        sum / count
    };
    (0..own.size().pixels()).into_par_iter().map(pooled).collect()
}

/// Differences between a frame and another one.
struct Pair {
    size: Size,
    /// The difference of each pixel; `None` where the other frame does not show its point.
    pixels: Vec<Option<Difference>>,
}

/// The difference between a pixel of a frame and its counterpart in another frame.
struct Difference {
    /// Difference of the estimates.
    estimate: [f32; 3],
    /// Squared difference of the denoised pictures, mean over RGB; zero without a denoiser.
    denoised: f32,
    /// Variance of the difference of the estimates, mean over RGB: averaged over 7 x 7 pixels, and of the pixel alone.
    variance: [f32; 2],
    /// The part of the variance that the mean over 3 x 3 pixels keeps.
    correlation: f32,
}

impl Pair {
    /// The differences to a neighbour, by all or by `half` of the iterations; `None` if a frame lacks its halves.
    fn new(own: &Frame, other: &Neighbour<'_>, half: bool) -> Option<Pair> {
        let [mean, denoised] = own.pictures(half)?;
        let [mean_there, denoised_there] = other.frame.pictures(half)?;
        let factor = if half { 2.0 } else { 1.0 };
        let is_denoised = own.pictures.is_denoised && other.frame.pictures.is_denoised;
        let of_pixel = |i: usize| {
            let j = other.place(i)?;
            let ratio = own.albedo_ratio(i, other.frame, j);
            let scale = channel_mean(ratio.map(|r| r * r)) as f32;
            let apart = |here: &Picture, there: &Picture| -> [f32; 3] {
                std::array::from_fn(|c| ratio[c] * there[j][c] - here[i][c])
            };
            let sum = |a: f32, b: f32| factor * (a + scale * b);
            let (a, b) = (own.smooth_variance[i], other.frame.smooth_variance[j]);
            let (estimate, denoised) = (apart(mean, mean_there), apart(denoised, denoised_there));
            let denoised = if is_denoised { channel_mean(denoised.map(|d| d * d)) as f32 } else { 0.0 };
            let variance = [sum(a, b), sum(own.variance(i), other.frame.variance(j))];
            let kept = factor * (own.correlation[i] * a + other.frame.correlation[j] * scale * b);
            let finite = estimate.iter().chain(&variance).chain([&denoised]).all(|value| value.is_finite());
            let correlation = if variance[0] > 0.0 { kept / variance[0] } else { 1.0 };
            finite.then_some(Difference { estimate, denoised, variance, correlation })
        };
        let size = own.size();
        Some(Pair { size, pixels: (0..size.pixels()).into_par_iter().map(of_pixel).collect() })
    }

    /// A cautious estimate, from 3 x 3 pixels, of the squared difference of the true values, mean over RGB. The largest of:
    /// [`CAUTION`] times the square of the mean difference beyond its noise, as much of the mean of the squares beyond
    /// theirs, and the mean squared difference of the denoised pictures, which have little noise. `None` where the other
    /// frame does not show the point.
    fn squared_bias(&self, i: usize) -> Option<f32> {
        let correlation = self.pixels[i].as_ref()?.correlation;
        let (mut mean, mut square, mut denoised, mut variance, mut count) = ([0f32; 3], 0.0, 0.0, [0f32; 2], 0.0);
        for there in window(self.size, i, BIAS_REACH).filter_map(|j| self.pixels[j].as_ref()) {
            mean = std::array::from_fn(|c| mean[c] + there.estimate[c]);
            square += channel_mean(there.estimate.map(|d| d * d)) as f32;
            denoised += there.denoised;
            variance = std::array::from_fn(|k| variance[k] + there.variance[k]);
            count += 1.0;
        }
        // The variance of single pixels is large where they hold rare bright samples, as is their difference.
        let variance = variance[0].max(variance[1]) / count;
        let of_mean = channel_mean(mean.map(|sum| (sum / count).powi(2))) as f32;
        let kept = correlation.max(1.0 / count);
        // With correlated noise, the mean of few squares varies by as much as their expectation.
        let beyond = (of_mean - kept * variance).max(square / count - (1.0 + kept) * variance);
        Some((CAUTION * beyond).max(denoised / count))
    }
}

/// A weighted average of a frame and its neighbours.
struct Average<'a> {
    own: &'a Frame,
    neighbours: &'a [Neighbour<'a>],
    half: bool,
    /// Weights of the pixels of each neighbour, 0 to 1 divided by the neighbour's ratio of variances.
    weights: Vec<Vec<f32>>,
}

impl<'a> Average<'a> {
    /// The average by all or by `half` of the iterations; `None` if a frame lacks its halves. `variance` is the pooled
    /// variance by all iterations.
    fn new(own: &'a Frame, neighbours: &'a [Neighbour<'a>], variance: &[f32], half: bool) -> Option<Average<'a>> {
        own.pictures(half)?;
        let factor = if half { 2.0 } else { 1.0 };
        let of_neighbour = |other: &Neighbour<'_>| -> Option<Vec<f32>> {
            let pair = Pair::new(own, other, half)?;
            let weight = |i: usize| {
                let exact = own.pictures.estimate.is_exact(i);
                let Some(bias) = (!exact).then(|| pair.squared_bias(i)).flatten() else { return 0.0 };
                let variance = factor * variance[i];
                let weight = variance / (other.ratio * variance + bias);
                if weight.is_finite() { weight } else { 0.0 }
            };
            Some((0..variance.len()).into_par_iter().map(weight).collect())
        };
        let weights = neighbours.iter().map(of_neighbour).collect::<Option<_>>()?;
        Some(Average { own, neighbours, half, weights })
    }

    /// The averages of the estimates and of the denoised pictures.
    fn pictures(&self) -> [Picture; 2] {
        let own = self.own.pictures(self.half);
        std::array::from_fn(|k| {
            let others: Vec<Option<&Picture>> =
                self.neighbours.iter().map(|other| Some(other.frame.pictures(self.half)?[k])).collect();
            own.map_or_else(Picture::default, |own| self.of(own[k], &others))
        })
    }

    /// The weighted average of one picture per frame, such as the estimate; `None` stands for a black picture.
    fn of(&self, own: &Picture, others: &[Option<&Picture>]) -> Picture {
        Picture::from_fn(own.size(), |i| {
            let (mut sum, mut total) = (own[i], 1.0);
            for ((other, weights), picture) in self.neighbours.iter().zip(&self.weights).zip(others) {
                let Some(j) = other.place(i).filter(|_| weights[i] > 0.0) else { continue };
                let light = picture.map_or([0.0; 3], |picture| picture[j]);
                let ratio = self.own.albedo_ratio(i, other.frame, j);
                sum = std::array::from_fn(|c| sum[c] + weights[i] * ratio[c] * light[c]);
                total += weights[i];
            }
            sum.map(|sum| sum / total)
        })
    }

    /// Standard errors of the average of the frames, from the standard errors of each frame's estimate.
    fn deviation(&self) -> Picture {
        let own = &self.own.pictures.estimate.deviation;
        Picture::from_fn(own.size(), |i| {
            let (mut sum, mut total) = (own[i].map(|s| s * s), 1.0);
            for (other, weights) in self.neighbours.iter().zip(&self.weights) {
                let Some(j) = other.place(i).filter(|_| weights[i] > 0.0) else { continue };
                let ratio = self.own.albedo_ratio(i, other.frame, j);
                let there = other.frame.pictures.estimate.deviation[j];
                sum = std::array::from_fn(|c| sum[c] + (weights[i] * ratio[c] * there[c]).powi(2));
                total += weights[i];
            }
            sum.map(|sum| sum.sqrt() / total)
        })
    }

    /// The averages of the named additive parts of the estimate.
    fn parts(&self, names: &[String]) -> Vec<Named> {
        let part = |frame: &'a Frame, name: &str| -> Option<&'a Picture> {
            frame.parts.iter().find(|(part, _)| part == name).and_then(|(_, picture)| picture.as_ref())
        };
        let average = |name: &String| {
            let black = || Picture::filled(self.own.size(), [0.0; 3]);
            let others: Vec<Option<&Picture>> = self.neighbours.iter().map(|other| part(other.frame, name)).collect();
            match part(self.own, name) {
                Some(own) => self.of(own, &others),
                None if others.iter().all(Option::is_none) => black(),
                None => self.of(&black(), &others),
            }
        };
        let present = names.iter().filter(|name| self.own.parts.iter().any(|(part, _)| part == *name));
        present.map(|name| (name.clone(), average(name))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Domain, Purpose, Stream};

    const SIZE: Size = Size { width: 64, height: 24 };
    const MIDDLE: f64 = REACH as f64;

    /// A frame of a still camera: each pixel is `truth(column)` with independent noise of standard deviation `sigma`.
    fn frame(truth: impl Fn(f32) -> f32, sigma: f32, seed: u64) -> Frame {
        let of_quarter = |k: u64| {
            Picture::from_fn(SIZE, |i| {
                let draw = |c: u64| {
                    let stream = Stream::new(seed * 4 + k, c, Domain::Test, i as u64);
                    2.0 * sigma * 12f32.sqrt() * (stream.vertex(0).one(Purpose::Pixel) - 0.5)
                };
                [0, 1, 2].map(draw)
            })
        };
        let noise = [0, 1, 2, 3].map(of_quarter);
        let light: Vec<f32> = (0..SIZE.pixels()).map(|i| truth((i % SIZE.width) as f32)).collect();
        let quarters = noise.map(|noise| Picture::from_fn(SIZE, |i| noise[i].map(|x| light[i] + x)));
        frame_of(&quarters, sigma)
    }

    fn frame_of(quarters: &[Picture; QUARTERS], sigma: f32) -> Frame {
        let size = quarters[0].size();
        let halves = [quarters[0].average(&quarters[1]), quarters[2].average(&quarters[3])];
        let mean = halves[0].average(&halves[1]);
        let deviation = Picture::filled(size, [sigma; 3]);
        let estimate = Estimate::unguided(mean.clone(), deviation);
        let half = Some([halves[0].clone(), halves[0].clone()]);
        let pictures = Pictures { estimate, denoised: mean, half, combined: None, is_denoised: false };
        Frame::new(pictures, Vec::new(), vec![[0.0; 4]; size.pixels()], correlation(size, Some(quarters)))
    }

    fn averaged(frames: &[Frame]) -> Averaged<Estimate> {
        let window = std::array::from_fn(|k| frames.get(k));
        let half = |estimate: &Estimate, _: &Picture| estimate.clone();
        average(&window, half, &[]).expect("the middle is there")
    }

    /// Frames with a bright line of a width (columns) that moves by `speed` columns per frame across the floor.
    fn caustic(height: f32, width: f32, speed: f32) -> impl Fn(usize) -> Box<dyn Fn(f32) -> f32> {
        move |k| {
            let centre = 28.0 + speed * (k as f64 - MIDDLE) as f32;
            Box::new(move |x| height * (-0.5 * ((x - centre) / width).powi(2)).exp())
        }
    }

    fn mean_square(picture: &Picture, truth: f32) -> f32 {
        let squares = picture.iter().flatten().map(|x| (x - truth).powi(2));
        squares.sum::<f32>() / (3 * picture.len()) as f32
    }

    /// Five frames of one light have a fifth of the variance at best; the stated standard error is right, also by halves.
    #[test]
    fn equal_frames_lose_most_of_their_noise() {
        let frames: Vec<Frame> = (0..WINDOW).map(|k| frame(|_| 1.0, 0.1, k as u64)).collect();
        let average = averaged(&frames);
        let half = average.half.expect("halves");
        for (estimate, variance) in [(&average.estimate, 0.01), (&half, 0.02)] {
            let (found, stated) = (mean_square(&estimate.mean, 1.0), mean_square(&estimate.deviation, 0.0));
            assert!(found < 0.24 * variance, "{found}");
            assert!((stated / found - 1.0).abs() < 0.1, "{stated} {found}");
        }
        // A frame of little noise gains nothing from noisy neighbours, and loses nothing.
        let mut frames: Vec<Frame> = (0..WINDOW).map(|k| frame(|_| 1.0, 1.0, k as u64)).collect();
        frames[REACH] = frame(|_| 1.0, 0.1, 9);
        assert!(mean_square(&averaged(&frames).estimate.mean, 1.0) < 0.0105);
    }

    /// Largest bias of the average in any column, in standard errors of the frame's own estimate, over 24 sequences.
    /// `weights` replaces the weights, as a planted fault.
    fn largest_bias([height, width, speed]: [f32; 3], weights: Option<f32>) -> f32 {
        const ROUNDS: usize = 24;
        let truth = caustic(height, width, speed);
        let mut bias = vec![0.0; SIZE.width];
        for round in 0..ROUNDS {
            let frames: Vec<Frame> = (0..WINDOW).map(|k| frame(truth(k), 1.0, (round * WINDOW + k) as u64)).collect();
            let window = std::array::from_fn(|k| frames.get(k));
            let (own, neighbours) = (&frames[REACH], neighbours(&window, &frames[REACH]));
            let mut average = Average::new(own, &neighbours, &pooled_variance(own, &neighbours), false).unwrap();
            if let Some(fault) = weights {
                average.weights.iter_mut().flatten().for_each(|weight| *weight = fault);
            }
            for (i, rgb) in average.pictures()[0].iter().enumerate() {
                let error = channel_mean(*rgb) as f32 - truth(REACH)((i % SIZE.width) as f32);
                bias[i % SIZE.width] += error / (ROUNDS * SIZE.height) as f32;
            }
        }
        bias.into_iter().map(f32::abs).fold(0.0, f32::max)
    }

    /// Caustics move although the floor under them rests. Means over 24 sequences, 24 rows and 3 channels have standard
    /// errors of at most 0.024: a bias below 0.87 exceeds the limit of one standard error of the estimate with a
    /// probability of less than 1e-4, in any of the columns.
    #[test]
    fn a_moving_caustic_leaves_no_ghost_above_one_standard_error() {
        for (width, speed) in [(0.7, 3.0), (2.0, 2.0), (6.0, 4.0)] {
            for height in [1.0, 4.0, 8.0, 32.0] {
                let bias = largest_bias([height, width, speed], None);
                assert!(bias < 1.0, "width {width}, speed {speed}, height {height}: {bias}");
            }
        }
        let fault = largest_bias([8.0, 2.0, 2.0], Some(1.0));
        assert!(fault > 2.0, "without estimated differences there is a ghost: {fault}");
    }

    /// The average is consistent: as noise vanishes, so does the ghost.
    #[test]
    fn ghosts_vanish_with_the_noise() {
        let truth = caustic(1.0, 2.0, 2.0);
        let frames: Vec<Frame> = (0..WINDOW).map(|k| frame(truth(k), 1e-4, k as u64)).collect();
        let mean = averaged(&frames).estimate.mean;
        for (i, rgb) in mean.iter().enumerate() {
            let x = (i % SIZE.width) as f32;
            let moved = (truth(REACH)(x) - truth(REACH + 1)(x)).abs() > 0.05;
            assert!(!moved || (rgb[0] - truth(REACH)(x)).abs() < 1e-3, "{x}: {}", rgb[0]);
        }
    }

    /// Photons shared by many pixels make noise that looks like light. The quarters of the iterations separate the two:
    /// the average of correlated noise is about as good as that of independent noise.
    #[test]
    fn the_quarters_separate_correlated_noise_from_light() {
        let all = vec![true; SIZE.pixels()];
        let blurred = |k: usize| {
            let noise = frame(|_| 0.0, 1.0, k as u64).pictures.half.expect("halves")[0].clone();
            Picture::new(SIZE, Windows::new(SIZE, 3, &all).means(&noise)).map(|x| 1.0 + x)
        };
        let frames: Vec<Frame> = (0..WINDOW)
            .map(|k| {
                let quarters = [0, 1, 2, 3].map(|quarter| blurred(100 + 4 * k + quarter));
                let sigma = (mean_square(&quarters[0], 1.0) / 4.0).sqrt();
                frame_of(&quarters, sigma)
            })
            .collect();
        let variance = frames[REACH].variance(0);
        assert!(frames[REACH].correlation.iter().sum::<f32>() / SIZE.pixels() as f32 > 0.6);
        let found = mean_square(&averaged(&frames).estimate.mean, 1.0);
        let mut blind: Vec<Frame> = frames;
        blind.iter_mut().for_each(|frame| frame.correlation.fill(INDEPENDENT));
        let without = mean_square(&averaged(&blind).estimate.mean, 1.0);
        assert!(found < 0.5 * variance && found < 0.9 * without, "{found} {without} of {variance}");
    }

    /// Points that the other frame hides or that motion leads out of the picture, other surfaces, and values that are not
    /// finite do not count.
    #[test]
    fn hidden_points_and_holes_do_not_count() {
        let mut frames: Vec<Frame> = (0..WINDOW).map(|k| frame(|_| 1.0, 0.1, k as u64)).collect();
        let hole = 5 * SIZE.width + 5;
        frames[3].pictures.estimate.mean[hole] = [f32::NAN; 3];
        let normal = |x: f32| {
            Some(Picture::from_fn(SIZE, |i| if i % SIZE.width < 40 { [0.0, 0.0, 1.0] } else { [x, 0.0, 0.0] }))
        };
        for (k, frame) in frames.iter_mut().enumerate() {
            frame.pictures.estimate.normal = normal(if k == REACH { 1.0 } else { -1.0 });
            // The left edge moves out of the picture, and row 7 does not come back.
            (0..SIZE.height).for_each(|y| frame.motion[y * SIZE.width] = [-1.0, 0.0, 1.0, 0.0]);
            (0..SIZE.width).for_each(|x| frame.motion[7 * SIZE.width + x] = [0.0, 2.0, 0.0, -2.0]);
        }
        let own = frames[REACH].pictures.estimate.mean.clone();
        let mean = averaged(&frames).estimate.mean;
        for (i, rgb) in mean.iter().enumerate() {
            let (x, y) = (i % SIZE.width, i / SIZE.width);
            let alone = x == 0 || x >= 40 || y == 7;
            assert!(rgb.iter().all(|x| x.is_finite()) && (!alone || *rgb == own[i]), "{x} {y}: {rgb:?}");
        }
        assert!(mean[hole] != own[hole]);
    }

    /// The camera cuts if normals show other surfaces in most of the picture.
    #[test]
    fn cuts_are_found() {
        let mut frames = [0, 1].map(|k| frame(|_| 1.0, 0.1, k));
        assert!(!is_cut(&frames[0], &frames[1]));
        for (frame, normal) in frames.iter_mut().zip([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]) {
            frame.pictures.estimate.normal = Some(Picture::filled(SIZE, normal));
        }
        assert!(is_cut(&frames[0], &frames[1]));
    }
}
