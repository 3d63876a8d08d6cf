//! The phase function of Henyey and Greenstein \[1941, "Diffuse radiation in the galaxy"\].
//!
//! Like a BSDF it is told the directions away from the vertex: `wo` back along the path, `wi` onward. Light that flies
//! straight on has `wi = -wo`. It is normalised and symmetric, so drawing it has weight 1, both ways have one density,
//! and light and importance scatter alike.

use crate::math::{Frame, Vec2, Vec3, one_minus_cos};
use std::f32::consts::{FRAC_1_PI, TAU};

/// The phase function with asymmetry (mean cosine of the deflection) `g`, in (-1, 1): positive scatters forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HenyeyGreenstein {
    /// Mean cosine.
    pub g: f32,
}

impl HenyeyGreenstein {
    /// The value for `wo` and `wi` (per sr), and at once the density with which [`HenyeyGreenstein::sample`] draws
    /// `wi`: `(1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^(3/2))`, cos between the old and the new direction of flight.
    #[inline]
    pub fn pdf_w(&self, wo: Vec3, wi: Vec3) -> f32 {
        let (g, ahead) = self.forward(wo);
        // (1 - g)^2 + 2 g (1 - cos), in which nothing cancels.
        let spread2 = (1.0 - g) * (1.0 - g) + 2.0 * g * one_minus_cos(wi, ahead);
        0.25 * FRAC_1_PI * (1.0 - g) * (1.0 + g) / (spread2 * spread2.sqrt()).max(f32::MIN_POSITIVE)
    }

    /// Draws an onward direction with density [`HenyeyGreenstein::pdf_w`]; `u` uniform on the unit square.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: Vec2) -> Vec3 {
        let (g, ahead) = self.forward(wo);
        // The inverse of the distribution, `cos = (1 + g^2 - s^2) / (2 g)` with `s = (1 - g^2) / (1 + g - 2 g u)`, for
        // 1 - cos: most of it is less than a cosine can tell from one where g is near 1, and without the division by g
        // it holds for g = 0, too.
        let rest = (1.0 - g) + 2.0 * g * (1.0 - u.x);
        let h = (u.x * (1.0 - g) * (1.0 - g) * (1.0 + (1.0 + g) / rest) / rest).min(2.0);
        let sin = (h * (2.0 - h)).sqrt();
        let (s, c) = (TAU * u.y).sin_cos();
        Frame::from_normal(ahead).to_world(Vec3::new(sin * c, sin * s, 1.0 - h)).normalize()
    }

    /// As a function that scatters forward: its asymmetry, and the direction that is forward.
    #[inline]
    fn forward(&self, wo: Vec3) -> (f32, Vec3) {
        (self.g.abs(), if self.g < 0.0 { wo } else { -wo })
    }
}
