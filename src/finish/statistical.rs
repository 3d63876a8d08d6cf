//! A denoiser without a network: means over neighbours whose difference noise can explain.
//!
//! Two pixels show the same light if their difference is within its standard error, as in the membership tests of
//! \[Sakai et al. 2024, "A Statistical Approach to Monte Carlo Denoising"\], and the same surface if albedo and normal
//! agree (a joint bilateral weight). The first pass tests the noisy estimates, the second the result of the first, which
//! shows fainter differences.

use super::window::window;
use crate::film::Picture;

/// Pixels to each side of a pixel in the window that it is averaged over.
const REACH: usize = 8;
/// Standard deviation, in pixels, of the Gaussian weight of a neighbour by its distance.
const DISTANCE: f32 = 5.0;
/// Standard deviation of the Gaussian weight of a neighbour by its difference in albedo.
const ALBEDO: f32 = 0.04;
/// Standard deviation of the Gaussian weight of a neighbour by the difference of unit normals.
const NORMAL: f32 = 0.2;
/// Largest difference of two pixels that count as estimates of equal light, in standard errors of the difference, in
/// the first and second pass.
const MAX_DIFFERENCE: [f32; 2] = [3.0, 1.0];

/// Input of the denoiser: pictures of equal size.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// Estimated radiance.
    pub mean: &'a Picture,
    /// Standard error of each pixel, raised towards its neighbours' ([`super::bound::spread`]).
    pub spread: &'a Picture,
    /// Reflectances at the first rough hit; `None` if unknown.
    pub albedo: Option<&'a Picture>,
    /// Unit normals at the first rough hit; `None` if unknown.
    pub normal: Option<&'a Picture>,
}

/// Denoises a picture in two passes of weighted means; the result of the first selects the neighbours in the second.
pub fn denoise(input: &Input<'_>) -> Picture {
    let first = pass(input, input.mean, MAX_DIFFERENCE[0]);
    pass(input, &first, MAX_DIFFERENCE[1])
}

/// Means of the estimates over neighbours whose `guide`, the estimates or the first pass's result, differs by less than
/// `max_difference` standard errors.
fn pass(input: &Input<'_>, guide: &Picture, max_difference: f32) -> Picture {
    let Input { mean, spread, albedo, normal } = *input;
    let size = mean.size();
    let of_pixel = |index: usize| {
        let (mut sum, mut total) = ([0f32; 3], 0f32);
        for other in window(size, index, REACH) {
            let values = mean[other];
            if !values.iter().all(|value| value.is_finite()) {
                continue;
            }
            let light = distance2(guide[index], guide[other]) / variance(spread[index], spread[other], max_difference);
            if light > 1.0 {
                continue;
            }
            let (dx, dy) = (index % size.width, index / size.width);
            let (dx, dy) = (dx.abs_diff(other % size.width) as f32, dy.abs_diff(other / size.width) as f32);
            let feature = |plane: Option<&Picture>, scale: f32| {
                plane.map_or(0.0, |plane| distance2(plane[index], plane[other]) / (scale * scale))
            };
            let exponent =
                (dx * dx + dy * dy) / (DISTANCE * DISTANCE) + feature(albedo, ALBEDO) + feature(normal, NORMAL);
            // Epanechnikov's kernel in the difference of the estimates.
            let weight = (1.0 - light) * (-0.5 * exponent).exp();
            sum = std::array::from_fn(|c| sum[c] + weight * values[c]);
            total += weight;
        }
        if total > 0.0 { sum.map(|sum| sum / total) } else { mean[index] }
    };
    Picture::from_fn(size, of_pixel)
}

fn distance2(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).map(|c| (a[c] - b[c]).powi(2)).sum()
}

/// Variance of the difference of two estimates with the standard errors `a` and `b`, summed over channels, times
/// `factor` squared.
fn variance(a: [f32; 3], b: [f32; 3], factor: f32) -> f32 {
    let sum: f32 = (0..3).map(|c| a[c] * a[c] + b[c] * b[c]).sum();
    (factor * factor * sum).max(f32::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Size;
    use crate::random::{Domain, Purpose, Stream};

    /// A step from 1 to 2 with noise of 0.1: the noise is removed, the step stays. Weights over 289 pixels with an
    /// effective number of some 60 leave a seventh of the noise.
    #[test]
    fn noise_is_removed_and_edges_stay() {
        let size = Size { width: 64, height: 48 };
        let truth = |index: usize| if index % size.width < 32 { 1.0 } else { 2.0f32 };
        let noise = |index: usize| {
            let draw = Stream::new(1, 0, Domain::Test, index as u64).vertex(0).one(Purpose::Pixel);
            0.1 * 12f32.sqrt() * (draw - 0.5)
        };
        let mean = Picture::from_fn(size, |index| [truth(index) + noise(index); 3]);
        let spread = Picture::filled(size, [0.1; 3]);
        let input = Input { mean: &mean, spread: &spread, albedo: None, normal: None };
        let error = |picture: &Picture| {
            let squares = picture.iter().enumerate().map(|(index, value)| (value[0] - truth(index)).powi(2));
            (squares.sum::<f32>() / size.pixels() as f32).sqrt()
        };
        let (before, after) = (error(&mean), error(&denoise(&input)));
        assert!(after < 0.3 * before, "{before} to {after}");
        // Light that noise cannot distinguish is separated by the albedo.
        let albedo = Picture::from_fn(size, |index| [0.4 * truth(index); 3]);
        let uncertain = Picture::filled(size, [10.0; 3]);
        let guided = Input { albedo: Some(&albedo), spread: &uncertain, ..input };
        let blurred = Input { albedo: None, ..guided };
        let (guided, blurred) = (error(&denoise(&guided)), error(&denoise(&blurred)));
        assert!(guided < 0.3 * before && blurred > before, "{guided}, {blurred}");
    }
}
