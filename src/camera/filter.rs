//! Pixel reconstruction filters.
//!
//! Camera paths sample the film point from the filter, so that all have the same weight (filter importance sampling
//! \[Ernst, Stamminger, Greiner 2006\]). The contribution of a light path to a film point goes to one of the pixels
//! whose filters cover the point, drawn in proportion to the filters there. A filter is the product of `f(dx)` and
//! `f(dy)`, with distances from the centre of the pixel in pixels, and `integral f = 1`.

use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A pixel filter with its width in pixels, as Blender defines filter widths.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Filter {
    /// Constant on a square whose side is the width.
    Box(f32),
    /// `exp(-8 d^2 / width^2)`, cut off at 1.5 widths from the centre.
    Gaussian(f32),
    /// The Blackman-Harris window, cut off at one width from the centre.
    BlackmanHarris(f32),
}

/// Largest width of a filter (pixels).
pub const MAX_FILTER_WIDTH: f32 = 8.0;

/// Coefficients of the 4-term Blackman-Harris window \[Harris 1978\].
const BLACKMAN_HARRIS: [f64; 4] = [0.35875, 0.48829, 0.14128, 0.01168];

impl Default for Filter {
    /// The default filter, a box of one pixel: filters of neighbouring pixels do not overlap.
    fn default() -> Filter {
        Filter::Box(1.0)
    }
}

impl Filter {
    /// Distance from the pixel's centre along an axis (pixels) beyond which the filter is zero.
    pub fn radius(self) -> f32 {
        match self {
            Filter::Box(width) => 0.5 * width,
            Filter::Gaussian(width) => 1.5 * width,
            Filter::BlackmanHarris(width) => width,
        }
    }

    /// Value of the filter along one axis (1/pixel), at a distance `d` in pixels from the pixel's centre.
    pub fn density(self, d: f32) -> f32 {
        let radius = self.radius();
        if d.abs() >= radius {
            return 0.0;
        }
        match self {
            Filter::Box(width) => 1.0 / width,
            Filter::Gaussian(width) => {
                let (d, width) = (f64::from(d), f64::from(width));
                // The standard deviation is a quarter of the width, so the cut-off is at six standard deviations.
                let norm = statrs::function::erf::erf(6.0 / std::f64::consts::SQRT_2);
                ((-8.0 * d * d / (width * width)).exp() * 4.0 / (width * TAU.sqrt() * norm)) as f32
            }
            Filter::BlackmanHarris(_) => {
                let phase = TAU * (0.5 + 0.5 * f64::from(d / radius));
                let [a, b, c, e] = BLACKMAN_HARRIS;
                let value = a - b * phase.cos() + c * (2.0 * phase).cos() - e * (3.0 * phase).cos();
                (value / (a * 2.0 * f64::from(radius))) as f32
            }
        }
    }

    /// Distance from the pixel's centre (pixels) below which the share `u`, in \[0, 1), of the filter along an axis
    /// lies.
    pub fn inverse(self, u: f32) -> f32 {
        let radius = self.radius();
        match self {
            Filter::Box(width) => (u - 0.5) * width,
            Filter::Gaussian(width) => {
                let norm = statrs::function::erf::erf(6.0 / std::f64::consts::SQRT_2);
                let x = statrs::function::erf::erf_inv((2.0 * f64::from(u) - 1.0) * norm);
                ((0.25 * std::f64::consts::SQRT_2 * f64::from(width) * x) as f32).clamp(-radius, radius)
            }
            Filter::BlackmanHarris(_) => 2.0 * radius * (inverse_window(f64::from(u)) as f32 - 0.5),
        }
    }
}

/// Inverse of the cumulative distribution of the Blackman-Harris window on \[0, 1\], found by Newton's method, with
/// bisection as a fallback.
fn inverse_window(u: f64) -> f64 {
    let [a, b, c, e] = BLACKMAN_HARRIS;
    let below = |t: f64| {
        t - (b / a) * (TAU * t).sin() / TAU + (c / a) * (2.0 * TAU * t).sin() / (2.0 * TAU)
            - (e / a) * (3.0 * TAU * t).sin() / (3.0 * TAU)
    };
    let density =
        |t: f64| 1.0 - (b / a) * (TAU * t).cos() + (c / a) * (2.0 * TAU * t).cos() - (e / a) * (3.0 * TAU * t).cos();
    let (mut low, mut high) = (0.0, 1.0);
    let mut t = 0.5 + 0.3 * (u - 0.5);
    for _ in 0..40 {
        let excess = below(t) - u;
        if excess > 0.0 {
            high = t
        } else {
            low = t
        }
        if excess.abs() < 1e-9 {
            break;
        }
        let next = t - excess / density(t);
        t = if next > low && next < high { next } else { 0.5 * (low + high) };
    }
    t
}

/// Draws one of the pixels along an axis whose filters cover the point `x`, in proportion to their filters there. Pixel
/// `k` has its centre at `k + 1/2`; `u` is in \[0, 1). Returns the index of the pixel, and the sum of the filters at
/// `x`.
pub fn sample_pixel(filter: Filter, x: f32, u: f32) -> (i64, f32) {
    let radius = filter.radius();
    let (first, last) = ((x - 0.5 - radius).ceil() as i64, (x - 0.5 + radius).floor() as i64);
    let weight = |k: i64| filter.density(x - 0.5 - k as f32);
    let sum: f32 = (first..=last).map(weight).sum();
    let mut left = u * sum;
    for k in first..=last {
        left -= weight(k);
        if left < 0.0 {
            return (k, sum);
        }
    }
    (x.floor() as i64, sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Filter; 5] = [
        Filter::Box(1.0),
        Filter::Box(2.5),
        Filter::Gaussian(1.5),
        Filter::BlackmanHarris(1.5),
        Filter::BlackmanHarris(4.0),
    ];

    /// The integral of the density is one, and `inverse` inverts its cumulative distribution.
    #[test]
    fn inverses_match_densities() {
        for filter in ALL {
            let radius = filter.radius();
            let steps = 20_000;
            let at = |i: usize| radius * (2.0 * (i as f32 + 0.5) / steps as f32 - 1.0);
            let step = f64::from(2.0 * radius) / steps as f64;
            let whole: f64 = (0..steps).map(|i| f64::from(filter.density(at(i))) * step).sum();
            assert!((whole - 1.0).abs() < 1e-4, "{filter:?}: {whole}");
            for u in [0.001f32, 0.1, 0.25, 0.5, 0.77, 0.999] {
                let d = filter.inverse(u);
                let below: f64 =
                    (0..steps).map(at).filter(|x| *x < d).map(|x| f64::from(filter.density(x)) * step).sum();
                assert!((below - f64::from(u)).abs() < 1e-3, "{filter:?}, {u}: {below}");
            }
        }
    }

    /// The expected contribution of light at one point to each pixel is the pixel's filter there.
    #[test]
    fn pixels_are_sampled_in_proportion_to_their_filters() {
        for filter in ALL {
            let x = 3.3;
            let mut found = std::collections::HashMap::<i64, f64>::new();
            let draws = 10_000;
            for i in 0..draws {
                let (k, sum) = sample_pixel(filter, x, (i as f32 + 0.5) / draws as f32);
                *found.entry(k).or_default() += f64::from(sum) / f64::from(draws);
            }
            for k in -6..14 {
                let expected = f64::from(filter.density(x - 0.5 - k as f32));
                let got = found.get(&k).copied().unwrap_or(0.0);
                assert!((got - expected).abs() < 2e-3, "{filter:?}, pixel {k}: {got}, expected {expected}");
            }
        }
        assert_eq!(sample_pixel(Filter::default(), 3.3, 0.9), (3, 1.0));
    }
}
