//! The GGX distribution of facet normals with Smith's height-correlated masking.
//!
//! \[Walter 2007\]: Walter, Marschner, Li, Torrance, "Microfacet Models for Refraction through Rough Surfaces".
//! \[Heitz 2014\]: "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs".
//! \[Dupuy and Benyoub 2023\]: "Sampling Visible GGX Normals with Spherical Caps".

use super::{DELTA_ALPHA, LobeSet, SHARP_ALPHA};
use crate::math::{Vec2, Vec3, sqr};
use std::f32::consts::{FRAC_1_PI, TAU};

/// Class of a GGX lobe.
#[inline]
pub(super) fn class_of(alpha_x: f32, alpha_y: f32) -> LobeSet {
    let widest = alpha_x.max(alpha_y);
    if widest < DELTA_ALPHA {
        LobeSet::DELTA
    } else if (alpha_x * alpha_y).sqrt() < SHARP_ALPHA {
        LobeSet::SHARP
    } else {
        LobeSet::BROAD
    }
}

/// How much narrower than a reflection a rough interface of relative index `eta` refracts, against one of glass in air:
/// facets bend light by their slope times the difference of the indices.
#[inline]
pub fn refraction_width(eta: f32) -> f32 {
    (2.0 * (eta.max(1.0 / eta) - 1.0)).min(1.0)
}

/// GGX of widths `alpha_x` and `alpha_y` along the local axes. Directions given to it lie in the upper hemisphere.
#[derive(Clone, Copy, Debug)]
pub struct Ggx {
    /// Width along x.
    pub alpha_x: f32,
    /// Width along y.
    pub alpha_y: f32,
}

impl Ggx {
    /// Density of facet normals (per solid angle, times the cosine integrates to 1) \[Heitz 2014 (85)\].
    #[inline]
    pub fn d(&self, h: Vec3) -> f32 {
        let stretched = sqr(h.x / self.alpha_x) + sqr(h.y / self.alpha_y) + sqr(h.z);
        FRAC_1_PI / (self.alpha_x * self.alpha_y * sqr(stretched))
    }

    /// Smith's Lambda \[Heitz 2014 (72), (80)\].
    #[inline]
    pub fn lambda(&self, w: Vec3) -> f32 {
        let slope2 = (sqr(w.x * self.alpha_x) + sqr(w.y * self.alpha_y)) / sqr(w.z).max(f32::MIN_POSITIVE);
        0.5 * ((1.0 + slope2).sqrt() - 1.0)
    }

    /// `w.z (1 + 2 Lambda(w))`, in which masking of two directions needs no division.
    #[inline]
    pub fn root(&self, w: Vec3) -> f32 {
        (sqr(w.z) + sqr(w.x * self.alpha_x) + sqr(w.y * self.alpha_y)).sqrt()
    }

    /// D G2 / (4 o i) for reflection; what that is to be multiplied with and divided by `o.z + root_o` to give the
    /// density of `i` by reflection at visible normals; the cosine at the facet. `root_o` is [`Ggx::root`] of `o`; both
    /// directions above, their cosines not below 1e-6.
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

    /// A facet normal seen from `w`, with density `d(h) max(w.h, 0) / (w.z (1 + lambda(w)))` \[Dupuy and Benyoub
    /// 2023\].
    #[inline]
    pub fn sample_visible(&self, w: Vec3, u: Vec2) -> Vec3 {
        let stretched = Vec3::new(w.x * self.alpha_x, w.y * self.alpha_y, w.z).normalize();
        let phi = TAU * u.x;
        let z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let cap = Vec3::new(r * phi.cos(), r * phi.sin(), z);
        let h = cap + stretched;
        Vec3::new(h.x * self.alpha_x, h.y * self.alpha_y, h.z.max(1e-9)).normalize()
    }
}

/// Fraction of facets seen from one direction \[Heitz 2014 (43)\].
#[inline]
pub fn g1(lambda: f32) -> f32 {
    1.0 / (1.0 + lambda)
}

/// Fraction seen from both directions on one side: heights correlated \[Heitz 2014 (99)\].
#[inline]
pub fn g2_reflection(lambda_o: f32, lambda_i: f32) -> f32 {
    1.0 / (1.0 + lambda_o + lambda_i)
}

/// Fraction seen from two directions on opposite sides: separable, as in \[Walter 2007 (23)\]. (The exact value, Beta(1
/// + a, 1 + b) \[Heitz 2014 (A.3)\], costs gamma functions; what it would lose more comes back by compensation here.)
#[inline]
pub fn g2_transmission(lambda_o: f32, lambda_i: f32) -> f32 {
    g1(lambda_o) * g1(lambda_i)
}
