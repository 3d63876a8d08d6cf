//! The phase function of Henyey and Greenstein \[1941, "Diffuse radiation in the galaxy"\].
//!
//! Like a BSDF it is told the directions away from the vertex: `wo` back along the path, `wi` onward. Light that flies straight on has
//! `wi = -wo`. It is normalised and symmetric, so drawing it has weight 1, both ways have one density, and light and importance scatter
//! alike.

use crate::math::{Frame, Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, TAU};

/// Below this asymmetry the inversion of the distribution, which divides by g, has lost its digits; it is isotropic to this precision.
const ISOTROPIC: f32 = 1e-3;

/// The phase function with asymmetry (mean cosine of the deflection) `g`, in (-1, 1): positive scatters forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HenyeyGreenstein {
    /// Mean cosine.
    pub g: f32,
}

impl HenyeyGreenstein {
    /// The value for `wo` and `wi` (per sr), and at once the density with which [`HenyeyGreenstein::sample`] draws `wi`:
    /// `(1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^(3/2))`, cos between the old and the new direction of flight.
    #[inline]
    pub fn pdf_w(&self, wo: Vec3, wi: Vec3) -> f32 {
        // 1 + g^2 - 2 g cos as a sum of squares: |wi + g wo|^2, which cannot round below zero.
        let g = self.effective();
        let spread2 = (wi + wo * g).length_squared().max(f32::MIN_POSITIVE);
        0.25 * FRAC_1_PI * (1.0 - g * g) / (spread2 * spread2.sqrt())
    }

    /// Draws an onward direction with density [`HenyeyGreenstein::pdf_w`]; `u` uniform on the unit square.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: Vec2) -> Vec3 {
        let g = self.effective();
        let cos = if g == 0.0 {
            1.0 - 2.0 * u.x
        } else {
            let s = (1.0 - g * g) / (1.0 + g - 2.0 * g * u.x);
            ((1.0 + g * g - s * s) / (2.0 * g)).clamp(-1.0, 1.0)
        };
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (s, c) = (TAU * u.y).sin_cos();
        Frame::from_normal(-wo).to_world(Vec3::new(sin * c, sin * s, cos)).normalize()
    }

    #[inline]
    fn effective(&self) -> f32 {
        if self.g.abs() < ISOTROPIC { 0.0 } else { self.g }
    }
}
