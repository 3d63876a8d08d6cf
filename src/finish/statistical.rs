//! A denoiser without a network: means over neighbours that the noise cannot tell apart.
//!
//! Whether two pixels show the same light is asked of their difference and its standard error, as in the membership
//! tests of \[Sakai et al. 2024, "A Statistical Approach to Monte Carlo Denoising"\]; whether they show the same
//! surface is asked of albedo and normal (a joint bilateral weight). A first pass asks the noisy estimates, a second
//! one the first's result, in which fainter differences show.

use super::window::window;
use crate::film::Picture;

/// Pixels to each side of the window that is averaged.
const REACH: usize = 8;
/// Standard deviation of the weight by distance, in pixels.
const NEAR: f32 = 5.0;
/// Differences of albedo and of unit normals at which a weight has fallen to exp(-1/2).
const ALBEDO: f32 = 0.04;
const NORMAL: f32 = 0.2;
/// Standard errors of the difference beyond which two estimates are taken for different light: passes one and two.
const APART: [f32; 2] = [3.0, 1.0];

/// What is denoised.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// Estimates.
    pub mean: &'a Picture,
    /// Standard errors ([`super::bound::spread`]).
    pub spread: &'a Picture,
    /// Reflectances, or nothing.
    pub albedo: Option<&'a Picture>,
    /// Unit normals, or nothing.
    pub normal: Option<&'a Picture>,
}

/// The denoised picture.
pub fn denoise(input: &Input<'_>) -> Picture {
    let first = pass(input, input.mean, APART[0]);
    pass(input, &first, APART[1])
}

/// Means of the estimates over neighbours whose `guide` differs by less than so many standard errors.
fn pass(input: &Input<'_>, guide: &Picture, apart: f32) -> Picture {
    let Input { mean, spread, albedo, normal } = *input;
    let size = mean.size();
    let of_pixel = |index: usize| {
        let (mut sum, mut total) = ([0f32; 3], 0f32);
        for other in window(size, index, REACH) {
            let values = mean[other];
            if !values.iter().all(|value| value.is_finite()) {
                continue;
            }
            let light = distance2(guide[index], guide[other]) / variance(spread[index], spread[other], apart);
            if light > 1.0 {
                continue;
            }
            let (dx, dy) = (index % size.width, index / size.width);
            let (dx, dy) = (dx.abs_diff(other % size.width) as f32, dy.abs_diff(other / size.width) as f32);
            let feature = |plane: Option<&Picture>, scale: f32| {
                plane.map_or(0.0, |plane| distance2(plane[index], plane[other]) / (scale * scale))
            };
            let exponent = (dx * dx + dy * dy) / (NEAR * NEAR) + feature(albedo, ALBEDO) + feature(normal, NORMAL);
            // A weight that falls to zero where estimates are apart (Epanechnikov's).
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

/// Variance of the difference of two estimates, all channels together, times `apart` squared.
fn variance(a: [f32; 3], b: [f32; 3], apart: f32) -> f32 {
    let sum: f32 = (0..3).map(|c| a[c] * a[c] + b[c] * b[c]).sum();
    (apart * apart * sum).max(f32::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Size;
    use crate::random::{Domain, Purpose, Stream};

    /// A step twice as bright on one side, with noise of a tenth: the noise goes, the step stays. Averages over 289
    /// pixels with weights that keep some 60 of them leave a seventh of the noise.
    #[test]
    fn noise_goes_and_edges_stay() {
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
        // Equal light on two surfaces of another colour stays apart.
        let albedo = Picture::from_fn(size, |index| [0.4 * truth(index); 3]);
        let unsure = Picture::filled(size, [10.0; 3]);
        let guided = Input { albedo: Some(&albedo), spread: &unsure, ..input };
        let blurred = Input { albedo: None, ..guided };
        let (guided, blurred) = (error(&denoise(&guided)), error(&denoise(&blurred)));
        assert!(guided < 0.3 * before && blurred > before, "{guided}, {blurred}");
    }
}
