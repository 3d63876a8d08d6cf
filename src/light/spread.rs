//! Angular distribution of the light of an emissive surface: Lambertian, or within a cone as for area lights of Cycles,
//! with or without a clear coat above.

use crate::bsdf::coat_reflectance;
use crate::math::{Vec2, Vec3, warp};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2};

/// Radiance of an emissive surface as a function of the angle x to its normal, relative to the mean radiance
/// flux / (pi area). Within a cone of half angle h, the relative radiance is (tan h - tan x) / (tan h - h): a
/// Lambertian emitter behind a fine honeycomb, scaled so that the flux does not change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Tangent of the half angle h.
    tan: f32,
    /// Factor 1 / (tan h - h) of the relative radiance.
    scale: f32,
    /// Squared sine of the half angle; 1 for a Lambertian emitter.
    sin2: f32,
    /// Strength of the clear coat above the emitter, 0 to 1, and its index of refraction.
    coat: f32,
    coat_eta: f32,
}

impl Spread {
    /// A Lambertian emitter: equal radiance in all directions.
    pub const LAMBERTIAN: Spread = Spread { tan: f32::INFINITY, scale: 0.0, sin2: 1.0, coat: 0.0, coat_eta: 1.5 };
    /// Smallest half angle (rad), as in Cycles. Cosines of smaller angles have too few digits in f32.
    const MIN_HALF_ANGLE: f32 = 0.5 * std::f32::consts::PI / 180.0;

    /// Emission into a cone of half angle `half` (rad); Lambertian if it is a right angle or more.
    pub fn new(half: f32) -> Spread {
        if half >= FRAC_PI_2 * 0.999 {
            return Spread::LAMBERTIAN;
        }
        let half = f64::from(half.max(Spread::MIN_HALF_ANGLE));
        let (sin, tan) = (half.sin(), half.tan());
        let (tan, scale) = (tan as f32, (1.0 / (tan - half)) as f32);
        Spread { tan, scale, sin2: (sin * sin) as f32, ..Spread::LAMBERTIAN }
    }

    /// Emission below a clear coat of strength `coat` and index `eta`, which reflects part of the light back
    /// (KHR_materials_clearcoat).
    pub fn below_coat(self, coat: f32, eta: f32) -> Spread {
        Spread { coat, coat_eta: eta, ..self }
    }

    /// Radiance over the mean radiance, in a direction with this cosine (above zero) to the normal.
    #[inline]
    pub(super) fn relative_radiance(&self, cos: f32) -> f32 {
        let passes = if self.coat > 0.0 { 1.0 - self.coat * coat_reflectance(cos, self.coat_eta) } else { 1.0 };
        if self.sin2 == 1.0 {
            return passes;
        }
        let tan = (1.0 - cos * cos).max(0.0).sqrt() / cos;
        ((self.tan - tan) * self.scale).max(0.0) * passes
    }

    /// Density per solid angle of [`Spread::sample`], at a cosine to the normal.
    #[inline]
    pub(super) fn pdf_w(&self, cos: f32) -> f32 {
        if self.sin2 == 1.0 {
            cos * FRAC_1_PI
        } else if 1.0 - cos * cos < self.sin2 {
            cos * FRAC_1_PI / self.sin2
        } else {
            0.0
        }
    }

    /// Samples an emitted direction in the cone about +Z, proportionally to the cosine. Returns the direction and the
    /// weight of the sample: its flux over the mean flux.
    #[inline]
    pub(super) fn sample(&self, u: Vec2) -> (Vec3, f32) {
        if self.sin2 == 1.0 {
            let d = warp::hemisphere_cosine(u);
            return (d, self.relative_radiance(d.z));
        }
        let on = warp::disc_concentric(u) * self.sin2.sqrt();
        let cos = (1.0 - on.length_squared()).max(0.0).sqrt();
        (on.extend(cos), self.relative_radiance(cos) * self.sin2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean weight of sampled directions is 1 for every half angle: a cone emits the flux of a Lambertian emitter.
    #[test]
    fn every_half_angle_emits_the_same_flux() {
        for degrees in [0.1f32, 0.5, 1.0, 10.0, 60.0, 89.0, 90.0] {
            let spread = Spread::new(degrees.to_radians());
            let (n, mut mean) = (400, 0.0);
            for i in 0..n * n {
                let u = Vec2::new((0.5 + (i % n) as f32) / n as f32, (0.5 + (i / n) as f32) / n as f32);
                let (d, flux) = spread.sample(u);
                assert!((d.length() - 1.0).abs() < 1e-5);
                assert!(spread.pdf_w(d.z) > 0.0, "{degrees}");
                mean += f64::from(flux) / f64::from(n * n);
            }
            assert!((mean - 1.0).abs() < 3e-3, "{degrees}: {mean}");
        }
    }

    /// The formula of KHR_materials_clearcoat at 0 and 80 degrees, where Fresnel reflectance is 0.04 and 0.388.
    #[test]
    fn a_coat_dims_the_emission_below() {
        let spread = Spread::LAMBERTIAN.below_coat(0.5, 1.5);
        assert!((spread.relative_radiance(1.0) - 0.98).abs() < 1e-6);
        assert!((spread.relative_radiance(80f32.to_radians().cos()) - (1.0 - 0.5 * 0.3877)).abs() < 1e-3);
        let (d, flux) = spread.sample(Vec2::new(0.9, 0.2));
        assert_eq!(flux, spread.relative_radiance(d.z));
    }
}
