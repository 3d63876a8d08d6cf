//! Kernels of density estimation: the weight of a photon by its distance.
//!
//! The bandwidth is the radius of the support of all kernels. Their argument `s`, in [0, 1), is the squared distance
//! over the squared bandwidth. Values are relative to the box kernel: on surfaces a kernel times 1 / (pi r^2)
//! integrates to one over the disc of radius r, in media a kernel times 3 / (4 pi r^3) over the ball.

use serde::{Deserialize, Serialize};
use std::f32::consts::PI;
use wide::f32x8;

/// Kernel of photon density estimation: the weight of a photon by its distance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Kernel {
    /// Constant within the bandwidth
    ///
    /// The kernel of \[post-reconstruction 2021, (3)\].
    #[default]
    Box,
    /// Falls with the squared distance
    ///
    /// `2 (1 - s)`, and `5/2 (1 - s)` in media: the kernel of least asymptotic error \[Epanechnikov 1969\].
    Epanechnikov,
    /// A normal distribution cut off at three standard deviations
    ///
    /// They are the bandwidth; the rest is normalised.
    Gaussian,
}

/// Half the squared bandwidth over the variance of the Gaussian kernel: the exponent at its rim, three standard
/// deviations from the centre.
const RIM: f32 = 4.5;
/// Fraction of the normal distribution within three standard deviations, in two dimensions: `1 - exp(-RIM)`.
const KEPT: f32 = 0.988_891;
/// Value of the Gaussian kernel at its centre over that of the box kernel, in media: `1 / int_0^1 3 x^2 exp(-RIM x^2)
/// dx`.
const BALL_PEAK: f32 = 7.397_645;

impl Kernel {
    /// Second moment of the kernel along an axis over the squared bandwidth; bias is proportional to it.
    pub const fn second_moment(self) -> f32 {
        match self {
            Kernel::Box => 0.25,
            Kernel::Epanechnikov => 1.0 / 6.0,
            Kernel::Gaussian => 0.5 * (1.0 - (1.0 - KEPT) * (1.0 + RIM)) / (RIM * KEPT),
        }
    }

    /// Integral of the squared kernel times pi r^2, where r is the bandwidth; variance is proportional to it.
    pub const fn roughness(self) -> f32 {
        match self {
            Kernel::Box => 1.0,
            Kernel::Epanechnikov => 4.0 / 3.0,
            Kernel::Gaussian => 0.5 * RIM * (2.0 - KEPT) / KEPT,
        }
    }

    /// Value of the kernel on surfaces over that of the box kernel; `s` is the squared distance over the squared
    /// bandwidth.
    #[inline]
    pub fn weight(self, s: f32) -> f32 {
        match self {
            Kernel::Box => 1.0,
            Kernel::Epanechnikov => 2.0 * (1.0 - s),
            Kernel::Gaussian => (RIM / KEPT) * (-RIM * s).exp(),
        }
    }

    /// Value of the kernel in media over that of the box kernel; `s` is the squared distance over the squared
    /// bandwidth. The shape is that on surfaces, normalised over the ball.
    #[inline]
    pub fn ball_weight(self, s: f32) -> f32 {
        match self {
            Kernel::Box => 1.0,
            Kernel::Epanechnikov => 2.5 * (1.0 - s),
            Kernel::Gaussian => BALL_PEAK * (-RIM * s).exp(),
        }
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

    #[test]
    fn kernels_are_normalised_and_moments_are_right() {
        for kernel in [Kernel::Box, Kernel::Epanechnikov, Kernel::Gaussian] {
            let weight = |s: f64| f64::from(kernel.weight(s as f32));
            assert!((integral(weight) - 1.0).abs() < 1e-5);
            // A round kernel has half of the mean squared distance along each axis.
            assert!((integral(|s| 0.5 * s * weight(s)) - f64::from(kernel.second_moment())).abs() < 1e-5);
            assert!((integral(|s| weight(s) * weight(s)) - f64::from(kernel.roughness())).abs() < 1e-4);
            assert_eq!(kernel == Kernel::Box, weight(0.0) == weight(0.9));
            // In a ball the volume element over 4/3 pi r^3 is 3/2 sqrt(s) ds.
            let over_ball = |w: fn(Kernel, f32) -> f32| integral(|s| 1.5 * s.sqrt() * f64::from(w(kernel, s as f32)));
            assert!((over_ball(Kernel::ball_weight) - 1.0).abs() < 1e-5);
            let flat = (over_ball(Kernel::weight) - 1.0).abs();
            assert!(kernel == Kernel::Box || flat > 0.1, "the disc's normalisation goes unnoticed");
            let shape = |s: f32| kernel.ball_weight(s) / kernel.weight(s);
            assert!((shape(0.1) - shape(0.7)).abs() < 1e-5);
        }
    }

    /// The Laplacian is zero for a constant and 4 for x^2 + y^2, at any bandwidth.
    #[test]
    fn the_laplacian_of_the_kernel_estimates_that_of_the_field() {
        for bandwidth2 in [0.25f32, 1.0, 9.0] {
            let area = f64::from(PI * bandwidth2);
            let of = |field: &dyn Fn(f64) -> f64| {
                area * integral(|s| {
                    f64::from(laplacian(f32x8::splat(s as f32)).to_array()[0] / (bandwidth2 * bandwidth2))
                        * field(s * f64::from(bandwidth2))
                })
            };
            assert!(of(&|_| 1.0).abs() < 1e-3 / f64::from(bandwidth2));
            assert!((of(&|d2| d2) - 4.0).abs() < 1e-3);
        }
    }
}
