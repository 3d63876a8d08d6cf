//! Scattering in world space: shading normals, decided once.
//!
//! A direction whose sides of the shading plane and of the geometric plane differ is scattered neither from nor to: whether light is
//! reflected or transmitted is then never in doubt, nothing leaks, and every algorithm sees the same function. Light carried the other
//! way takes the adjoint of Veach \[1997, 5.3\].

use super::{Bsdf, BsdfSample, LobeSet, Transport};
use crate::math::{Frame, Rgb, Vec2, Vec3};

/// A BSDF standing in the world.
#[derive(Clone, Copy, Debug)]
pub struct Shading<'a> {
    /// Shading frame.
    pub frame: Frame,
    /// Unit geometric normal.
    pub ng: Vec3,
    /// Scattering in the frame.
    pub bsdf: Bsdf<'a>,
}

impl Shading<'_> {
    /// `w` in the frame, and its cosine with the geometric normal; `None` where the two normals disagree about its side.
    #[inline]
    fn local(&self, w: Vec3) -> Option<(Vec3, f32)> {
        let local = self.frame.to_local(w);
        let cos = w.dot(self.ng);
        (local.z * cos > 0.0).then_some((local, cos.abs()))
    }

    /// The BSDF times the cosine that belongs to it: `f |wi.ns|` for radiance, and for importance
    /// `f |wi.ns| (|wo.ns| |wi.ng|) / (|wo.ng| |wi.ns|)` \[Veach 1997 (5.17)\].
    #[inline]
    pub fn eval_cos(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb {
        self.evaluate_cos(wo, wi, transport, set).0
    }

    /// Density per solid angle with which [`Shading::sample`] draws `wi`.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> f32 {
        self.evaluate_cos(wo, wi, transport, set).1
    }

    /// [`Shading::eval_cos`] and [`Shading::pdf`] at the price of one.
    #[inline]
    pub fn evaluate_cos(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        let (Some((o, cos_og)), Some((i, cos_ig))) = (self.local(wo), self.local(wi)) else {
            return (Rgb::ZERO, 0.0);
        };
        let (f, pdf) = self.bsdf.evaluate(o, i, transport, set);
        let cosine = match transport {
            Transport::Radiance => i.z.abs(),
            Transport::Importance => o.z.abs() * cos_ig / cos_og,
        };
        (f * cosine, pdf)
    }

    /// What a photon from `wi` (unit, towards where it came from) adds to the radiance along `wo`, per flux over kernel area: photons
    /// measure irradiance on the geometric surface, so `f |wi.ns| / |wi.ng|`.
    #[inline]
    pub fn gather(&self, wo: Vec3, wi: Vec3, set: LobeSet) -> Rgb {
        let (Some((o, _)), Some((i, cos_ig))) = (self.local(wo), self.local(wi)) else {
            return Rgb::ZERO;
        };
        self.bsdf.eval(o, i, Transport::Radiance, set) * (i.z.abs() / cos_ig)
    }

    /// Albedo of the lobes of `set`, see [`Bsdf::albedo`].
    #[inline]
    pub fn albedo(&self, wo: Vec3, set: LobeSet) -> Rgb {
        self.bsdf.albedo(self.frame.to_local(wo), set)
    }

    /// Draws a direction, see [`Bsdf::sample`]; `wi` and the weight are those of the world.
    #[inline]
    pub fn sample(&self, wo: Vec3, transport: Transport, set: LobeSet, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let (o, cos_og) = self.local(wo)?;
        let mut sample = self.bsdf.sample(o, transport, set, u_lobe, u)?;
        let wi = self.frame.to_world(sample.wi);
        let cos_ig = wi.dot(self.ng);
        if sample.wi.z * cos_ig <= 0.0 {
            return None;
        }
        if transport == Transport::Importance {
            sample.weight *= o.z.abs() * cos_ig.abs() / (cos_og * sample.wi.z.abs());
        }
        sample.wi = wi;
        Some(sample)
    }
}
