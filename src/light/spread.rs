//! How a glowing surface spreads its light: as a Lambertian emitter, or into a cone, as area lamps of Cycles do; below a
//! clear coat or not.

use crate::bsdf::coat_reflectance;
use crate::math::{Vec2, Vec3, warp};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2};

/// The radiance of a glowing surface by its angle to the normal, over the mean that its flux tells (flux is pi times
/// radiance times area). Into a cone of half angle h it is (tan h - tan x) / (tan h - h), x the angle: that of a
/// Lambertian emitter behind a fine honeycomb, which all the flux leaves all the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Tangent of the half angle.
    tan: f32,
    /// 1 / (tan h - h).
    scale: f32,
    /// Squared sine of the half angle; 1: Lambertian.
    sin2: f32,
    /// Strength of the clear coat above it.
    coat: f32,
}

impl Spread {
    /// The same radiance in all directions.
    pub const LAMBERTIAN: Spread = Spread { tan: f32::INFINITY, scale: 0.0, sin2: 1.0, coat: 0.0 };
    /// Half angles below this (rad) are taken for it, as in Cycles: cosines of less have few digits left.
    const LEAST: f32 = 0.5 * std::f32::consts::PI / 180.0;

    /// Into a cone of this half angle (rad); a right angle and more is Lambertian.
    pub fn new(half: f32) -> Spread {
        if half >= FRAC_PI_2 * 0.999 {
            return Spread::LAMBERTIAN;
        }
        let half = f64::from(half.max(Spread::LEAST));
        let (sin, tan) = (half.sin(), half.tan());
        Spread { tan: tan as f32, scale: (1.0 / (tan - half)) as f32, sin2: (sin * sin) as f32, coat: 0.0 }
    }

    /// The same below a clear coat of this strength, which reflects a part of it back (KHR_materials_clearcoat).
    pub fn below_coat(self, coat: f32) -> Spread {
        Spread { coat, ..self }
    }

    /// Radiance over the mean, at a cosine above zero.
    #[inline]
    pub(super) fn of(&self, cos: f32) -> f32 {
        let passes = if self.coat > 0.0 { 1.0 - self.coat * coat_reflectance(cos) } else { 1.0 };
        if self.sin2 == 1.0 {
            return passes;
        }
        let tan = (1.0 - cos * cos).max(0.0).sqrt() / cos;
        ((self.tan - tan) * self.scale).max(0.0) * passes
    }

    /// Density per solid angle of [`Spread::sample`].
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

    /// A direction about +Z in the cone, by its cosine, and what flux along it is over the mean.
    #[inline]
    pub(super) fn sample(&self, u: Vec2) -> (Vec3, f32) {
        if self.sin2 == 1.0 {
            let d = warp::hemisphere_cosine(u);
            return (d, self.of(d.z));
        }
        let on = warp::disc_concentric(u) * self.sin2.sqrt();
        let cos = (1.0 - on.length_squared()).max(0.0).sqrt();
        (on.extend(cos), self.of(cos) * self.sin2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Flux by the closed form and by the samples' weights is that of a Lambertian emitter, whatever the angle.
    #[test]
    fn all_flux_leaves() {
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

    /// The extension's formula at 0 and 80 degrees, where Fresnel's equations reflect 0.04 and 0.388, by value and by
    /// sample.
    #[test]
    fn a_coat_dims_what_is_below() {
        let spread = Spread::LAMBERTIAN.below_coat(0.5);
        assert!((spread.of(1.0) - 0.98).abs() < 1e-6);
        assert!((spread.of(80f32.to_radians().cos()) - (1.0 - 0.5 * 0.3877)).abs() < 1e-3);
        let (d, flux) = spread.sample(Vec2::new(0.9, 0.2));
        assert_eq!(flux, spread.of(d.z));
    }
}
