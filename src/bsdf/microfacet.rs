//! The GGX distribution of facet normals with Smith's height-correlated masking.
//!
//! \[Walter 2007\]: Walter, Marschner, Li, Torrance, "Microfacet Models for Refraction through Rough Surfaces".
//! \[Heitz 2014\]: "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs".
//! \[Dupuy and Benyoub 2023\]: "Sampling Visible GGX Normals with Spherical Caps".

use super::{DELTA_ALPHA, LobeSet, SHARP_ALPHA};
use crate::math::{Vec2, Vec3, sqr, warp};
use std::f32::consts::FRAC_1_PI;

/// Lobe class (delta, sharp or broad) of a GGX lobe with these alphas.
#[inline]
pub(super) fn lobe_class(alpha_x: f32, alpha_y: f32) -> LobeSet {
    let widest = alpha_x.max(alpha_y);
    if widest < DELTA_ALPHA {
        LobeSet::DELTA
    } else if (alpha_x * alpha_y).sqrt() < SHARP_ALPHA {
        LobeSet::SHARP
    } else {
        LobeSet::BROAD
    }
}

/// Width of the refracted lobe of a rough interface of relative index `eta`, relative to glass in air (at most 1).
/// Facets deflect light by their slope times the difference of the indices.
#[inline]
pub fn refraction_width(eta: f32) -> f32 {
    (2.0 * (eta.max(1.0 / eta) - 1.0)).min(1.0)
}

/// The GGX distribution. All directions passed to its functions are in the upper hemisphere.
#[derive(Clone, Copy, Debug)]
pub struct Ggx {
    /// Roughness alpha along x.
    pub alpha_x: f32,
    /// Roughness alpha along y.
    pub alpha_y: f32,
}

impl Ggx {
    /// Density of facet normals per solid angle, whose product with the cosine integrates to 1 \[Heitz 2014 (85)\].
    #[inline]
    pub fn d(&self, h: Vec3) -> f32 {
        let stretched = sqr(h.x / self.alpha_x) + sqr(h.y / self.alpha_y) + sqr(h.z);
        FRAC_1_PI / (self.alpha_x * self.alpha_y * sqr(stretched))
    }

    /// Smith's function Lambda of masking and shadowing for the direction `w` \[Heitz 2014 (72), (80)\].
    #[inline]
    pub fn lambda(&self, w: Vec3) -> f32 {
        let slope2 = (sqr(w.x * self.alpha_x) + sqr(w.y * self.alpha_y)) / sqr(w.z).max(f32::MIN_POSITIVE);
        0.5 * ((1.0 + slope2).sqrt() - 1.0)
    }

    /// The term `w.z (1 + 2 Lambda(w))`. In terms of it, masking-shadowing needs no division.
    #[inline]
    pub fn root(&self, w: Vec3) -> f32 {
        (sqr(w.z) + sqr(w.x * self.alpha_x) + sqr(w.y * self.alpha_y)).sqrt()
    }

    /// Evaluates reflection. Returns the value D G2 / (4 o.z i.z), a factor f, and the cosine at the facet. The density
    /// of sampling `i` by visible normals is value * f / (o.z + root_o). `root_o` is [`Ggx::root`] of `o`. Both cosines
    /// must be at least 1e-6.
    #[inline]
    pub fn reflection(&self, o: Vec3, root_o: f32, i: Vec3) -> (f32, f32, f32) {
        let h = o + i;
        let length2 = h.length_squared();
        let stretched = (sqr(h.x / self.alpha_x) + sqr(h.y / self.alpha_y) + sqr(h.z)) / length2;
        // With root = z (1 + 2 Lambda), G2 / (4 o i) = 1 / (2 (root_o i + root_i o)) and G1 / (4 o) = 1 / (2 (o +
        // root_o)).
        let both = root_o * i.z + self.root(i) * o.z;
        let value = (0.5 * FRAC_1_PI) / (self.alpha_x * self.alpha_y * sqr(stretched) * both);
        (value, both, (0.5 * length2.sqrt()).min(1.0))
    }

    /// Samples a facet normal visible from `w`, with the density `d(h) max(w.h, 0) / (w.z (1 + lambda(w)))` \[Dupuy and
    /// Benyoub 2023\].
    #[inline]
    pub fn sample_visible(&self, w: Vec3, u: Vec2) -> Vec3 {
        let stretched = Vec3::new(w.x * self.alpha_x, w.y * self.alpha_y, w.z).normalize();
        let z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
        let cap = warp::around_z((1.0 - z * z).max(0.0).sqrt(), z, u.x);
        let h = cap + stretched;
        Vec3::new(h.x * self.alpha_x, h.y * self.alpha_y, h.z.max(1e-9)).normalize()
    }
}

/// Masking: share of facets that are visible from one direction \[Heitz 2014 (43)\].
#[inline]
pub fn g1(lambda: f32) -> f32 {
    1.0 / (1.0 + lambda)
}

/// Masking-shadowing for two directions on one side, with correlated heights \[Heitz 2014 (99)\].
#[inline]
pub fn g2_reflection(lambda_o: f32, lambda_i: f32) -> f32 {
    1.0 / (1.0 + lambda_o + lambda_i)
}

/// Masking-shadowing for two directions on opposite sides, separable as in \[Walter 2007 (23)\]. The exact value,
/// Beta(1 + a, 1 + b) \[Heitz 2014 (A.3)\], needs gamma functions, and energy compensation makes up for the difference.
#[inline]
pub fn g2_transmission(lambda_o: f32, lambda_i: f32) -> f32 {
    g1(lambda_o) * g1(lambda_i)
}
