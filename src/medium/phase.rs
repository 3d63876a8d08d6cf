//! The phase function of Henyey and Greenstein \[1941, "Diffuse radiation in the galaxy"\].
//!
//! Both directions point away from the vertex: `wo` back along the path, `wi` onward. Unscattered light has `wi = -wo`.
//! The function is normalized and symmetric. So sampling it has weight 1, densities are equal in both directions, and
//! radiance and importance scatter alike.

use crate::math::{Frame, Vec2, Vec3, one_minus_cos, warp};
use std::f32::consts::FRAC_1_PI;

/// The Henyey-Greenstein phase function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HenyeyGreenstein {
    /// Asymmetry: mean cosine of the scattering angle, in (-1, 1). Positive values scatter forward.
    pub g: f32,
}

impl HenyeyGreenstein {
    /// Value of the phase function (1/sr), which is also the density with which [`HenyeyGreenstein::sample`] draws
    /// `wi`: `(1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^(3/2))`, with the cosine between `-wo` and `wi`.
    #[inline]
    pub fn pdf_w(&self, wo: Vec3, wi: Vec3) -> f32 {
        let (g, ahead) = self.forward(wo);
        // 1 + g^2 - 2 g cos as a sum of positive terms: (1 - g)^2 + 2 g (1 - cos).
        let spread2 = (1.0 - g) * (1.0 - g) + 2.0 * g * one_minus_cos(wi, ahead);
        0.25 * FRAC_1_PI * (1.0 - g) * (1.0 + g) / (spread2 * spread2.sqrt()).max(f32::MIN_POSITIVE)
    }

    /// Samples an onward direction with density [`HenyeyGreenstein::pdf_w`]; `u` is uniform on the unit square.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: Vec2) -> Vec3 {
        let (g, ahead) = self.forward(wo);
        // The inverse of the distribution is `cos = (1 + g^2 - s^2) / (2 g)` with `s = (1 - g^2) / (1 + g - 2 g u)`.
        // This form computes 1 - cos, because the cosine rounds to 1 where g is near 1. It also holds for g = 0.
        let rest = (1.0 - g) + 2.0 * g * (1.0 - u.x);
        let h = (u.x * (1.0 - g) * (1.0 - g) * (1.0 + (1.0 + g) / rest) / rest).min(2.0);
        let sin = (h * (2.0 - h)).sqrt();
        Frame::from_normal(ahead).to_world(warp::around_z(sin, 1.0 - h, u.y)).normalize()
    }

    /// The phase function rewritten with an asymmetry that is not negative: the absolute asymmetry, and the direction
    /// that is then forward.
    #[inline]
    fn forward(&self, wo: Vec3) -> (f32, Vec3) {
        (self.g.abs(), if self.g < 0.0 { wo } else { -wo })
    }
}
