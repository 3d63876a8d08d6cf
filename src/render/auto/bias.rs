//! The bias of bandwidths that a trial has not tried: what its levels differ by, and how that changes with the area.
//!
//! Squared bias, summed over a picture, grows as a power of the kernel's area A. Where light varies smoothly over a kernel, bias grows with A and its square
//! with the exponent 2 \[Knaus and Zwicker 2011, 3\]; an edge is blurred by as much whatever the kernel's size, within an area that grows with its radius: 1/2.
//! Which of them rules is what the differences of three pairs of levels tell, each pair of twice the area of the one before.

use super::trial::mean;
use crate::estimator::Pixel;

/// Exponents of edges and of smooth light, between which it is searched, and in how many steps.
const EXPONENTS: (f64, f64) = (0.5, 2.0);
const STEPS: u32 = 30;

/// Squared bias over the squared difference between a level and the next larger one, summed across a straight edge. A box kernel at u radii from it takes
/// `f(u) = (acos u - u sqrt(1 - u^2)) / pi` from the other side: the integral of f(u)^2 over that of `(f(u / sqrt 2) - f(u))^2`, for u from 0 to where these end.
/// In smooth light a difference is the bias.
const EDGES: f64 = 9.367;

/// Levels (from 0) that are compared with the next larger one; the first has an eye path of its own.
const PAIRS: std::ops::Range<usize> = 1..4;

/// Sums over pixels of squared relative differences of levels without their noise, and of that noise.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Differences {
    squared: [f64; PAIRS.end - PAIRS.start],
    noise: [f64; PAIRS.end - PAIRS.start],
}

impl Differences {
    /// Adds a pixel whose squares are relative by this factor.
    pub fn add(&mut self, pixel: &Pixel, scale: f64) {
        let n = f64::from(pixel.iterations);
        for (at, difference) in pixel.differences[PAIRS].iter().enumerate() {
            let noise = mean(difference.variance_of_mean(n)) * scale;
            self.squared[at] += mean(difference.mean * difference.mean) * scale - noise;
            self.noise[at] += noise;
        }
    }

    /// The bias per pixel, of so many.
    pub fn bias(&self, pixels: f64) -> Bias {
        // What a square is off by goes with the noise.
        let weights = self.noise.map(|noise| 1.0 / (noise * noise).max(f64::MIN_POSITIVE));
        // Of the squared difference at the largest area, for an exponent: least squares, and what they leave.
        let fit = |exponent: f64| {
            let powers: [f64; 3] = std::array::from_fn(|k| 2f64.powf(exponent * (k as f64 - 2.0)));
            let all = || self.squared.iter().zip(&powers).zip(&weights);
            let scale = all().map(|((d, power), w)| w * d * power).sum::<f64>()
                / all().map(|((_, power), w)| w * power * power).sum::<f64>();
            let scale = scale.max(0.0);
            (all().map(|((d, power), w)| w * (d - scale * power).powi(2)).sum::<f64>(), scale)
        };
        let exponents =
            (0..=STEPS).map(|i| EXPONENTS.0 + (EXPONENTS.1 - EXPONENTS.0) * f64::from(i) / f64::from(STEPS));
        let best = exponents.map(|exponent| (fit(exponent), exponent)).min_by(|a, b| a.0.0.total_cmp(&b.0.0));
        let ((_, squared), exponent) = best.unwrap_or(((0.0, 0.0), EXPONENTS.0));
        // From the one to the other as the exponent.
        let over = EDGES.powf((EXPONENTS.1 - exponent) / (EXPONENTS.1 - EXPONENTS.0));
        let squared = over * squared / pixels;
        Bias { squared: if squared.is_finite() { squared } else { 0.0 }, exponent }
    }
}

/// Squared relative bias: `squared` times the area, over that of the trial, to the exponent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Bias {
    pub squared: f64,
    pub exponent: f64,
}

impl Bias {
    /// The same where areas are so many times as large.
    pub fn scaled(self, area: f64) -> Bias {
        Bias { squared: self.at(area), ..self }
    }

    /// Squared bias where areas are so many times as large.
    pub fn at(self, area: f64) -> f64 {
        self.squared * area.powf(self.exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_the_integrals() {
        let share = |u: f64| if u < 1.0 { (u.acos() - u * (1.0 - u * u).sqrt()) / std::f64::consts::PI } else { 0.0 };
        let steps = (0..200_000).map(|i| (f64::from(i) + 0.5) * 1e-5);
        let (bias, difference) = steps.fold((0.0, 0.0), |(bias, difference), u| {
            let (own, larger) = (share(u), share(u / 2f64.sqrt()));
            (bias + own * own, difference + (larger - own).powi(2))
        });
        assert!((bias / difference / EDGES - 1.0).abs() < 1e-3, "{}", bias / difference);
    }

    /// Differences that follow either law give its exponent and its bias, those in between are in between, and those of noise alone none.
    #[test]
    fn exponents_are_found() {
        let of = |exponent: f64| {
            let squared = std::array::from_fn(|k| 3.0 * 2f64.powf(exponent * (k as f64 - 2.0)));
            Differences { squared, noise: [0.4, 0.2, 0.1] }.bias(2.0)
        };
        let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-9;
        let (smooth, edges, between) = (of(2.0), of(0.5), of(1.25));
        assert!(
            close(smooth.exponent, 2.0) && close(smooth.squared, 1.5) && close(smooth.at(0.5), 0.375),
            "{smooth:?}"
        );
        assert!(close(edges.exponent, 0.5) && close(edges.squared, 1.5 * EDGES), "{edges:?}");
        assert!(close(between.exponent, 1.25) && close(between.squared, 1.5 * EDGES.sqrt()), "{between:?}");
        // Beyond either law.
        assert_eq!((of(0.0).exponent, of(3.0).exponent), EXPONENTS);
        let noise = Differences { squared: [-0.1, 0.05, -0.2], noise: [0.4, 0.2, 0.1] }.bias(2.0);
        assert_eq!(noise.squared, 0.0);
        assert_eq!(Differences::default().bias(1.0).squared, 0.0);
    }
}
