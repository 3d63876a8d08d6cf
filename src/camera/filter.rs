//! Pixel filters: how a pixel weighs the light that falls on and around it.
//!
//! Eye paths draw the point of the film by the filter itself, so that they all weigh the same (filter importance
//! sampling \[Ernst, Stamminger, Greiner 2006\]). What a light path sends to a point of the film goes to one of the pixels
//! that see the point, drawn by their filters there. Filters are products of one function per axis, `f(d)` with `d` from
//! the middle of a pixel in pixels, `integral f = 1`.

use std::f64::consts::TAU;

/// A pixel filter; widths are counted as Blender counts them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Filter {
    /// The same everywhere on a square of this side (pixels).
    Box(f32),
    /// A bell `exp(-8 d^2 / width^2)`, cut off at 1.5 widths.
    Gaussian(f32),
    /// The window of Blackman and Harris, two widths wide.
    BlackmanHarris(f32),
}

/// Widest filter, in pixels.
pub const MAX_FILTER_WIDTH: f32 = 8.0;

/// Coefficients of the window of Blackman and Harris \[Harris 1978\], 4 terms, over their sum at the middle.
const TERMS: [f64; 4] = [0.35875, 0.48829, 0.14128, 0.01168];

impl Default for Filter {
    /// One pixel, no overlap.
    fn default() -> Filter {
        Filter::Box(1.0)
    }
}

impl Filter {
    /// Pixels from the middle beyond which it is zero.
    pub fn radius(self) -> f32 {
        match self {
            Filter::Box(width) => 0.5 * width,
            Filter::Gaussian(width) => 1.5 * width,
            Filter::BlackmanHarris(width) => width,
        }
    }

    /// `f(d)`, per pixel.
    pub fn density(self, d: f32) -> f32 {
        let radius = self.radius();
        if d.abs() >= radius {
            return 0.0;
        }
        match self {
            Filter::Box(width) => 1.0 / width,
            Filter::Gaussian(width) => {
                let (d, width) = (f64::from(d), f64::from(width));
                // Standard deviation of a quarter of the width; six of them lie within the cut.
                let norm = statrs::function::erf::erf(6.0 / std::f64::consts::SQRT_2);
                ((-8.0 * d * d / (width * width)).exp() * 4.0 / (width * TAU.sqrt() * norm)) as f32
            }
            Filter::BlackmanHarris(_) => {
                let phase = TAU * (0.5 + 0.5 * f64::from(d / radius));
                let [a, b, c, e] = TERMS;
                let value = a - b * phase.cos() + c * (2.0 * phase).cos() - e * (3.0 * phase).cos();
                (value / (a * 2.0 * f64::from(radius))) as f32
            }
        }
    }

    /// The `d` below which a share `u` of the filter lies, for `u` in \[0, 1).
    pub fn inverse(self, u: f32) -> f32 {
        let radius = self.radius();
        match self {
            Filter::Box(width) => (u - 0.5) * width,
            Filter::Gaussian(width) => {
                let most = statrs::function::erf::erf(6.0 / std::f64::consts::SQRT_2);
                let x = statrs::function::erf::erf_inv((2.0 * f64::from(u) - 1.0) * most);
                ((0.25 * std::f64::consts::SQRT_2 * f64::from(width) * x) as f32).clamp(-radius, radius)
            }
            Filter::BlackmanHarris(_) => 2.0 * radius * (inverse_window(f64::from(u)) as f32 - 0.5),
        }
    }
}

/// The place in \[0, 1\] below which a share `u` of the window of Blackman and Harris lies: Newton's steps, kept between
/// bounds that close in.
fn inverse_window(u: f64) -> f64 {
    let [a, b, c, e] = TERMS;
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

/// One of the pixels along an axis that see the point `x` (pixels; the middle of pixel `k` is at `k + 1/2`), drawn by `u`
/// in \[0, 1) in proportion to their filters there, and the sum of these.
pub fn choose(filter: Filter, x: f32, u: f32) -> (i64, f32) {
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

    /// The integral is one, and the inverse is that of the integral.
    #[test]
    fn densities_and_inverses_belong_together() {
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

    /// Light on one point reaches every pixel as much as its filter says: the mean over draws of (chosen, sum).
    #[test]
    fn pixels_are_chosen_by_their_filters() {
        for filter in ALL {
            let x = 3.3;
            let mut found = std::collections::HashMap::<i64, f64>::new();
            let draws = 10_000;
            for i in 0..draws {
                let (k, sum) = choose(filter, x, (i as f32 + 0.5) / draws as f32);
                *found.entry(k).or_default() += f64::from(sum) / f64::from(draws);
            }
            for k in -6..14 {
                let expected = f64::from(filter.density(x - 0.5 - k as f32));
                let got = found.get(&k).copied().unwrap_or(0.0);
                assert!((got - expected).abs() < 2e-3, "{filter:?}, pixel {k}: {got}, expected {expected}");
            }
        }
        assert_eq!(choose(Filter::default(), 3.3, 0.9), (3, 1.0));
    }
}
