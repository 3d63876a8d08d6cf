//! Fresnel reflectance of smooth interfaces, and reflected and refracted directions.

use crate::math::{Rgb, Vec3, sqr};
use wide::f32x8;

/// Relative indices of refraction that differ from 1 by less than this count as matched: the interface has no effect.
/// For smaller differences, rounding errors dominate the half vector of refraction.
pub const MATCHED: f32 = 2e-3;

/// Relative index of refraction above which the interface reflects all light. The legacy ior 0 of glTF is infinity
/// here.
const MIRROR_ETA: f32 = 1e3;

/// Whether an interface of relative index `eta` has no effect, because the index is (nearly) 1.
#[inline]
pub fn is_matched(eta: f32) -> bool {
    (eta - 1.0).abs() < MATCHED
}

/// Fresnel's equations for unpolarised light at a smooth dielectric. `cos_o`, in `[0, 1]`, is the cosine of the
/// incident ray with the normal, `eta` the index on the far side over the index on the near side. Returns the
/// reflectance and the cosine of the refracted ray; `(1, 0)` at total internal reflection.
#[inline]
pub fn dielectric(cos_o: f32, eta: f32) -> (f32, f32) {
    if is_matched(eta) {
        return (0.0, cos_o);
    }
    if eta > MIRROR_ETA {
        return (1.0, 1.0);
    }
    let sin2_t = (1.0 - cos_o * cos_o).max(0.0) / (eta * eta);
    if sin2_t >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let parallel = (eta * cos_o - cos_t) / (eta * cos_o + cos_t);
    let perpendicular = (cos_o - eta * cos_t) / (cos_o + eta * cos_t);
    (0.5 * (sqr(parallel) + sqr(perpendicular)), cos_t)
}

/// Reflectance of a dielectric of relative index `eta` at normal incidence, which is equal from both sides.
#[inline]
pub fn normal_incidence(eta: f32) -> f32 {
    if is_matched(eta) {
        0.0
    } else if eta > MIRROR_ETA {
        1.0
    } else {
        sqr((eta - 1.0) / (eta + 1.0))
    }
}

/// Schlick's weight of F90: `(1 - cos)^5`.
#[inline]
pub fn schlick_weight(cos: f32) -> f32 {
    let x = (1.0 - cos).clamp(0.0, 1.0);
    sqr(sqr(x)) * x
}

/// A smooth interface seen from one side, with constants precomputed for many angles.
#[derive(Clone, Copy, Debug)]
pub struct Smooth {
    /// Index of refraction on the far side over the index on the near side.
    pub eta: f32,
    inverse_eta2: f32,
    /// Reflectance at normal incidence.
    normal: f32,
    /// Precomputed 1 / (1 - `normal`).
    inverse_rest: f32,
}

impl Smooth {
    /// The interface whose relative index, far side over near side, is `eta`.
    pub fn new(eta: f32) -> Smooth {
        let normal = normal_incidence(eta);
        Smooth { eta, inverse_eta2: 1.0 / (eta * eta), normal, inverse_rest: 1.0 / (1.0 - normal) }
    }

    /// Weight of F90 for an interpolation between F0 (weight 0, normal incidence) and F90 (weight 1, grazing incidence)
    /// that follows the exact Fresnel curve, where KHR_materials_specular has Schlick's. Also returns the cosine of the
    /// refracted ray. `None` at total internal reflection.
    #[inline]
    pub fn grazing_weight(&self, cos_o: f32) -> Option<(f32, f32)> {
        let eta = self.eta;
        if is_matched(eta) {
            return Some((0.0, cos_o));
        }
        if eta > MIRROR_ETA {
            return Some((schlick_weight(cos_o), 1.0));
        }
        let sin2_t = (1.0 - cos_o * cos_o).max(0.0) * self.inverse_eta2;
        // NaN inside of a medium whose interface reflects all light.
        if sin2_t >= 1.0 || sin2_t.is_nan() {
            return None;
        }
        let cos_t = (1.0 - sin2_t).sqrt();
        // Fresnel's equations as in `dielectric`, with a common denominator.
        let (near, far) = (eta * cos_o, eta * cos_t);
        let (a, b) = ((near - cos_t) * (cos_o + far), (near + cos_t) * (cos_o - far));
        let f = 0.5 * (sqr(a) + sqr(b)) / sqr((near + cos_t) * (cos_o + far));
        Some((((f - self.normal) * self.inverse_rest).clamp(0.0, 1.0), cos_t))
    }
}

impl Smooth {
    /// [`Smooth::grazing_weight`] for eight cosines, if the far side is denser or its index matched.
    #[inline]
    pub fn grazing_weight_from_thin(&self, cos_o: f32x8) -> f32x8 {
        if is_matched(self.eta) {
            return f32x8::ZERO;
        }
        let square = |x: f32x8| x * x;
        let sin2_t = (f32x8::ONE - square(cos_o)).fast_max(f32x8::ZERO) * self.inverse_eta2;
        let cos_t = (f32x8::ONE - sin2_t).sqrt();
        let (near, far) = (cos_o * self.eta, cos_t * self.eta);
        let (a, b) = ((near - cos_t) * (cos_o + far), (near + cos_t) * (cos_o - far));
        let f = (square(a) + square(b)) * 0.5 / square((near + cos_t) * (cos_o + far));
        ((f - self.normal) * self.inverse_rest).fast_max(f32x8::ZERO).fast_min(f32x8::ONE)
    }

    /// Whether [`Smooth::grazing_weight_from_thin`] applies: the far side is denser or its index matched.
    pub fn is_from_thin(&self) -> bool {
        self.eta >= 1.0 - MATCHED && self.eta <= MIRROR_ETA
    }
}

/// The direction into which `w` is reflected at a facet with unit normal `h`.
#[inline]
pub fn reflect(w: Vec3, h: Vec3) -> Vec3 {
    h * (2.0 * w.dot(h)) - w
}

/// The direction into which `w` is refracted at a facet with unit normal `h` on the side of `w`. `cos_t` is the cosine
/// that [`dielectric`] returns.
#[inline]
pub fn refract(w: Vec3, h: Vec3, eta: f32, cos_t: f32) -> Vec3 {
    h * (w.dot(h) / eta - cos_t) - w / eta
}

/// Schlick's reflectance of a metal of colour `f0`.
#[inline]
pub fn schlick(f0: Rgb, cos: f32) -> Rgb {
    f0 + (Rgb::ONE - f0) * schlick_weight(cos)
}
