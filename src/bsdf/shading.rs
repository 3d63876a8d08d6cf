//! Scattering in world space: shading normals, decided once.
//!
//! Light whose sides of the shading plane and of the geometric plane differ is not scattered: whether light is
//! reflected or transmitted is then never in doubt, nothing leaks, and a surface is dark where its shading normal faces
//! away from the lamp. A viewer whose sides differ, as on steep normal maps seen from the side, stands for the opposite
//! direction: so there is no black, and since the directions that light is scattered to which are on the wrong side of
//! the surface are just the opposites of those that it is not, each carries what its opposite would have, and all that
//! is scattered leaves. Every algorithm sees the same function. Light carried the other way takes the adjoint of Veach
//! \[1997, 5.3\].

use super::layered::Seen;
use super::{Bsdf, BsdfSample, LobeSet, Transport};
use crate::math::{Frame, Rgb, Vec2, Vec3};

/// A BSDF standing in the world, seen along one direction.
#[derive(Clone, Copy, Debug)]
pub struct Shading<'a> {
    /// Shading frame.
    pub frame: Frame,
    /// Unit geometric normal.
    pub ng: Vec3,
    /// Scattering in the frame.
    pub bsdf: Bsdf<'a>,
    pub(super) seen: Seen,
    /// Cosine of the direction with the geometric normal.
    pub(super) cos_og: f32,
    /// The two normals disagree about its side: `seen` is its opposite.
    opposite: bool,
}

impl<'a> Shading<'a> {
    /// `bsdf` in `frame` on a surface with geometric normal `ng`, seen along the unit direction `wo`.
    #[inline(always)]
    pub fn new(frame: Frame, ng: Vec3, bsdf: Bsdf<'a>, wo: Vec3) -> Shading<'a> {
        let local = frame.to_local(wo);
        let cos = wo.dot(ng);
        let opposite = local.z * cos < 0.0;
        let cos_og = if local.z == 0.0 { 0.0 } else { cos.abs() };
        Shading { frame, ng, bsdf, seen: bsdf.seen(if opposite { -local } else { local }), cos_og, opposite }
    }

    /// `w`, which paths of `transport` come from, in the frame, and its cosine with the geometric normal; `None` where
    /// the two normals disagree about the side of light, be it `w` or the direction seen along.
    #[inline]
    fn local(&self, w: Vec3, transport: Transport) -> Option<(Vec3, f32)> {
        let local = self.frame.to_local(w);
        let cos = w.dot(self.ng);
        let agrees = local.z * cos > 0.0;
        let lit = match transport {
            Transport::Radiance => agrees,
            Transport::Importance => !self.opposite && local.z * cos != 0.0,
        };
        (lit && self.cos_og > 0.0).then_some((if agrees { local } else { -local }, cos.abs()))
    }

    /// The BSDF times the cosine that belongs to it: `f |wi.ns|` for radiance, and for importance
    /// `f |wi.ns| (|wo.ns| |wi.ng|) / (|wo.ng| |wi.ns|)` \[Veach 1997 (5.17)\]; and the density per solid angle with
    /// which [`Shading::sample`] draws `wi`.
    #[inline]
    pub fn evaluate_cos(&self, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        let Some((i, cos_ig)) = self.local(wi, transport) else { return (Rgb::ZERO, 0.0) };
        let (f, pdf) = self.bsdf.evaluate_seen(&self.seen, i, transport, set);
        let cosine = match transport {
            Transport::Radiance => i.z.abs(),
            Transport::Importance => self.seen.o.z * cos_ig / self.cos_og,
        };
        (f * cosine, pdf)
    }

    /// The first part of [`Shading::evaluate_cos`].
    #[inline]
    pub fn eval_cos(&self, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb {
        self.evaluate_cos(wi, transport, set).0
    }

    /// The second part of [`Shading::evaluate_cos`].
    #[inline]
    pub fn pdf(&self, wi: Vec3, transport: Transport, set: LobeSet) -> f32 {
        self.evaluate_cos(wi, transport, set).1
    }

    /// Density per solid angle with which a path that comes along `wi` would be sent along the direction the surface is
    /// seen along.
    #[inline]
    pub fn reverse_pdf(&self, wi: Vec3, transport: Transport, set: LobeSet) -> f32 {
        // Whoever comes along `wi` looks for light if this path does not.
        let own = match transport {
            Transport::Radiance => Transport::Importance,
            Transport::Importance => Transport::Radiance,
        };
        let Some((i, _)) = self.local(wi, own) else { return 0.0 };
        self.bsdf.pdf(i, self.seen.wo(), transport, set)
    }

    /// What a photon from `wi` (unit, towards where it came from) adds to the radiance seen, per flux over kernel area:
    /// photons measure irradiance on the geometric surface where they are, so `f |wi.ns| / cosine`, the latter that of
    /// `wi` with the normal there. That of the normal here would not do: photons that graze it have met another facet
    /// nearby, whose share of them does not vanish with their cosine here.
    #[inline]
    pub fn gather(&self, wi: Vec3, cosine: f32, set: LobeSet) -> Rgb {
        let (true, Some((i, _))) = (cosine > 0.0, self.local(wi, Transport::Radiance)) else {
            return Rgb::ZERO;
        };
        self.bsdf.eval_seen(&self.seen, i, Transport::Radiance, set) * (i.z.abs() / cosine)
    }

    /// Albedo of the lobes of `set`, see [`Bsdf::albedo`].
    #[inline]
    pub fn albedo(&self, set: LobeSet) -> Rgb {
        self.bsdf.albedo_seen(&self.seen, set)
    }

    /// Draws a direction, see [`Bsdf::sample`]; `wi` and the weight are those of the world.
    #[inline]
    pub fn sample(&self, transport: Transport, set: LobeSet, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let importance = transport == Transport::Importance;
        if self.cos_og == 0.0 || (importance && self.opposite) {
            return None;
        }
        let mut sample = self.bsdf.sample_seen(&self.seen, transport, set, u_lobe, u)?;
        let mut wi = self.frame.to_world(sample.wi);
        let mut cos_ig = wi.dot(self.ng);
        if sample.wi.z * cos_ig < 0.0 && importance {
            (wi, cos_ig) = (-wi, -cos_ig);
        }
        if sample.wi.z * cos_ig <= 0.0 {
            return None;
        }
        if importance {
            sample.weight *= self.seen.o.z * cos_ig.abs() / (self.cos_og * sample.wi.z.abs());
        }
        sample.wi = wi;
        Some(sample)
    }
}
