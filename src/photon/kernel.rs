//! Kernels of density estimation: the weight of a photon by its distance.
//!
//! The bandwidth is the radius of the support of all kernels. Their argument `s`, in [0, 1), is the squared distance
//! over the squared bandwidth. Values are relative to the box kernel: on surfaces a kernel times 1 / (pi r^2)
//! integrates to one over the disc of radius r, in media a kernel times 3 / (4 pi r^3) over the ball.

use std::f32::consts::PI;
use wide::f32x8;

/// A radially symmetric kernel of density estimation. `s` is the squared distance over the squared bandwidth, 0 to 1.
pub trait Kernel: Copy + Send + Sync + 'static {
    /// Whether the kernel is constant within the bandwidth, so that a photon has equal weight at all bandwidths that
    /// contain it.
    const BOX: bool;
    /// Second moment of the kernel along an axis over the squared bandwidth; bias is proportional to it.
    const SECOND_MOMENT: f32;
    /// Integral of the squared kernel times pi r^2, where r is the bandwidth; variance is proportional to it.
    const ROUGHNESS: f32;
    /// Value of the kernel on surfaces over that of the box kernel; `s` is the squared distance over the squared
    /// bandwidth.
    fn weight(s: f32) -> f32;
    /// Value of the kernel in media over that of the box kernel; `s` is the squared distance over the squared
    /// bandwidth. The shape is that on surfaces, normalised over the ball.
    fn ball_weight(s: f32) -> f32;
}

/// The box kernel: constant within the bandwidth, zero outside \[post-reconstruction 2021, (3)\].
#[derive(Clone, Copy, Debug, Default)]
pub struct Box;

/// `2 (1 - s)`, and `5/2 (1 - s)` in media: the kernel of least asymptotic error \[Epanechnikov 1969\].
#[derive(Clone, Copy, Debug, Default)]
pub struct Epanechnikov;

/// A normal distribution, cut off at three standard deviations (the bandwidth) and normalised.
#[derive(Clone, Copy, Debug, Default)]
pub struct Gaussian;

impl Kernel for Box {
    const BOX: bool = true;
    const SECOND_MOMENT: f32 = 0.25;
    const ROUGHNESS: f32 = 1.0;
    #[inline(always)]
    fn weight(_: f32) -> f32 {
        1.0
    }
    #[inline(always)]
    fn ball_weight(_: f32) -> f32 {
        1.0
    }
}

impl Kernel for Epanechnikov {
    const BOX: bool = false;
    const SECOND_MOMENT: f32 = 1.0 / 6.0;
    const ROUGHNESS: f32 = 4.0 / 3.0;
    #[inline(always)]
    fn weight(s: f32) -> f32 {
        2.0 * (1.0 - s)
    }
    #[inline(always)]
    fn ball_weight(s: f32) -> f32 {
        2.5 * (1.0 - s)
    }
}

/// Half the squared bandwidth over the variance of the Gaussian kernel: the exponent at its rim, three standard
/// deviations from the centre.
const RIM: f32 = 4.5;
/// Fraction of the normal distribution within three standard deviations, in two dimensions: `1 - exp(-RIM)`.
const KEPT: f32 = 0.988_891;
/// Value of the Gaussian kernel at its centre over that of the box kernel, in media: `1 / int_0^1 3 x^2 exp(-RIM x^2)
/// dx`.
const BALL_PEAK: f32 = 7.397_645;

impl Kernel for Gaussian {
    const BOX: bool = false;
    const SECOND_MOMENT: f32 = 0.5 * (1.0 - (1.0 - KEPT) * (1.0 + RIM)) / (RIM * KEPT);
    const ROUGHNESS: f32 = 0.5 * RIM * (2.0 - KEPT) / KEPT;
    #[inline(always)]
    fn weight(s: f32) -> f32 {
        (RIM / KEPT) * (-RIM * s).exp()
    }
    #[inline(always)]
    fn ball_weight(s: f32) -> f32 {
        BALL_PEAK * (-RIM * s).exp()
    }
}

/// Laplacian of a smooth kernel, the triweight `4 / pi (1 - s)^3`; `s` is the squared distance over the squared
/// bandwidth and must be below 1. Summed over photons, with the fourth power of the bandwidth as divisor, it estimates
/// the Laplacian of the photon density.
#[inline]
pub fn laplacian(s: f32x8) -> f32x8 {
    (f32x8::ONE - s) * (s * 3.0 - 1.0) * (48.0 / PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integral of `f(s)` over s from 0 to 1 by the midpoint rule; ds is the area element over pi r^2.
    fn integral(f: impl Fn(f64) -> f64) -> f64 {
        let n = 200_000;
        (0..n).map(|i| f((f64::from(i) + 0.5) / f64::from(n))).sum::<f64>() / f64::from(n)
    }

    fn check<K: Kernel>() {
        let weight = |s: f64| f64::from(K::weight(s as f32));
        assert!((integral(weight) - 1.0).abs() < 1e-5);
        // A round kernel has half of the mean squared distance along each axis.
        assert!((integral(|s| 0.5 * s * weight(s)) - f64::from(K::SECOND_MOMENT)).abs() < 1e-5);
        assert!((integral(|s| weight(s) * weight(s)) - f64::from(K::ROUGHNESS)).abs() < 1e-4);
        assert_eq!(K::BOX, weight(0.0) == weight(0.9));
        // In a ball the volume element over 4/3 pi r^3 is 3/2 sqrt(s) ds.
        let over_ball = |w: fn(f32) -> f32| integral(|s| 1.5 * s.sqrt() * f64::from(w(s as f32)));
        assert!((over_ball(K::ball_weight) - 1.0).abs() < 1e-5);
        assert!(K::BOX || (over_ball(K::weight) - 1.0).abs() > 0.1, "the disc's normalisation goes unnoticed");
        let shape = |s: f32| K::ball_weight(s) / K::weight(s);
        assert!((shape(0.1) - shape(0.7)).abs() < 1e-5);
    }

    #[test]
    fn kernels_are_normalised_and_moments_are_right() {
        check::<Box>();
        check::<Epanechnikov>();
        check::<Gaussian>();
    }

    /// The Laplacian is zero for a constant and 4 for x^2 + y^2, at any bandwidth.
    #[test]
    fn the_laplacian_of_the_kernel_estimates_that_of_the_field() {
        for radius2 in [0.25f32, 1.0, 9.0] {
            let area = f64::from(PI * radius2);
            let of = |field: &dyn Fn(f64) -> f64| {
                area * integral(|s| {
                    f64::from(laplacian(f32x8::splat(s as f32)).to_array()[0] / (radius2 * radius2))
                        * field(s * f64::from(radius2))
                })
            };
            assert!(of(&|_| 1.0).abs() < 1e-3 / f64::from(radius2));
            assert!((of(&|d2| d2) - 4.0).abs() < 1e-3);
        }
    }
}
