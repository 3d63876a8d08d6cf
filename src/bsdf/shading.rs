//! Scattering in world space: shading normals, decided once.
//!
//! Light whose sides of the shading plane and of the geometric plane differ is not scattered: whether light is
//! reflected or transmitted is then never in doubt, nothing leaks, and a surface is dark where its shading normal faces
//! away from the lamp. A viewer whose sides differ, as on steep normal maps seen from the side, stands for the opposite
//! direction: so there is no black, and since the directions that light is scattered to which are on the wrong side of
//! the surface are just the opposites of those that it is not, each carries what its opposite would have, and all that
//! is scattered leaves. Every algorithm sees the same function. Light carried the other way takes the adjoint of Veach
//! \[1997, 5.3\]. Normal maps have a relief besides (`relief.rs`): there the directions that shine would be
//! lost to, seen from the front, are mirrored out of the surface.

use super::coat::Coat;
use super::facing::Facing;
use super::layered::Seen;
use super::relief::{Relief, mirrored};
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
    /// Under a normal map: the interpolated normal.
    pub(super) smooth: Option<Vec3>,
    /// A clear coat above the normal map.
    coat: Option<Coat<'a>>,
}

impl<'a> Shading<'a> {
    /// `bsdf` in `frame` on a surface with geometric normal `ng`, seen along the unit direction `wo`.
    #[inline(always)]
    pub fn new(frame: Frame, ng: Vec3, bsdf: Bsdf<'a>, wo: Vec3) -> Shading<'a> {
        let (Facing { cos_og, opposite, .. }, o) = Facing::new(frame, ng, wo);
        Shading { frame, ng, bsdf, seen: bsdf.seen(o), cos_og, opposite, smooth: None, coat: None }
    }

    /// The same whose frame is that of a normal map on a surface of interpolated normal `smooth`, which a clear coat
    /// keeps.
    #[inline]
    pub fn mapped(mut self, smooth: Vec3) -> Shading<'a> {
        if smooth == self.frame.n {
            return self;
        }
        self.smooth = Some(smooth);
        if let Bsdf::Layered(layered) = &mut self.bsdf
            && let Some(covered) = layered.interface.cover.as_ref().filter(|covered| covered.cover.has_coat())
        {
            layered.coat_normal = Some(self.frame.to_local(smooth));
            let o = self.seen.wo();
            let wo = self.frame.to_world(if self.opposite { -o } else { o });
            self.coat = Some(Coat::new(&covered.cover, smooth, self.ng, wo));
            self.seen = layered.seen(o);
        }
        self
    }

    #[inline]
    fn facing(&self) -> Facing {
        Facing { frame: self.frame, ng: self.ng, cos_og: self.cos_og, opposite: self.opposite }
    }

    /// How light along `l` (world) meets the facets of a normal map. What shines meets it a second time along the
    /// direction in the frame that comes with it, if there is one; the first time is there whenever the second is.
    #[inline]
    fn relief(&self, l: Vec3) -> Option<(Relief, Option<Vec3>)> {
        let relief = Relief::new(l, self.frame.n, self.smooth?, self.ng);
        let second = self.frame.to_local(relief.mirrored);
        Some((relief, (self.shines() && second.z * l.dot(self.ng) > 0.0).then_some(second)))
    }

    /// Not all that is scattered is diffuse.
    #[inline]
    fn shines(&self) -> bool {
        matches!(self.bsdf, Bsdf::Layered(_))
    }

    /// The direction that light comes along where the surface is seen by light: the one it is seen along.
    #[inline]
    fn own(&self) -> Vec3 {
        self.frame.to_world(self.seen.wo())
    }

    #[inline]
    fn local(&self, w: Vec3, transport: Transport) -> Option<(Vec3, f32)> {
        self.facing().local(w, transport)
    }

    /// The coat above a normal map, and the probability of drawing a direction from it, seen along `seen`.
    #[inline]
    fn coat(&self, seen: &Seen, set: LobeSet) -> Option<(&Coat<'a>, f32)> {
        match (&self.coat, &self.bsdf) {
            (Some(coat), Bsdf::Layered(layered)) => Some((coat, layered.coat_share(seen, set))),
            _ => None,
        }
    }

    /// The BSDF times the cosine that belongs to it: `f |wi.ns|` for radiance, and for importance
    /// `f |wi.ns| (|wo.ns| |wi.ng|) / (|wo.ng| |wi.ns|)` \[Veach 1997 (5.17)\]; and the density per solid angle with
    /// which [`Shading::sample`] draws `wi`.
    #[inline]
    pub fn evaluate_cos(&self, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        let (value, pdf) = self.evaluate_base(wi, transport, set);
        match self.coat(&self.seen, set) {
            Some((coat, share)) if share > 0.0 => {
                let (coated, density) = coat.evaluate_cos(wi, transport);
                (value + Rgb::splat(coated), pdf + (density - pdf) * share)
            }
            _ => (value, pdf),
        }
    }

    /// The same but for a coat above a normal map.
    #[inline]
    fn evaluate_base(&self, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        let Some((i, cos_ig)) = self.local(wi, transport) else { return (Rgb::ZERO, 0.0) };
        let adjoint = cos_ig / self.cos_og;
        if self.smooth.is_some() {
            let (value, pdf) = self.evaluate_relief(wi, i, transport, set);
            return (if transport == Transport::Importance { value * adjoint } else { value }, pdf);
        }
        let (f, pdf) = self.bsdf.evaluate_seen(&self.seen, i, transport, set);
        let cosine = match transport {
            Transport::Radiance => i.z.abs(),
            Transport::Importance => self.seen.o.z * adjoint,
        };
        (f * cosine, pdf)
    }

    /// Under a normal map: the BSDF times the cosine of light with the facet, summed over the ways on which light meets
    /// it, and the density of `wi`, which is `i` in the frame.
    #[inline(never)]
    fn evaluate_relief(&self, wi: Vec3, i: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        let radiance = transport == Transport::Radiance;
        let Some((relief, second)) = self.relief(if radiance { wi } else { self.own() }) else {
            return (Rgb::ZERO, 0.0);
        };
        let (f, pdf) = self.bsdf.evaluate_dimmed(relief.diffuse, &self.seen, i, transport, set);
        let first = f * if radiance { i.z.abs() } else { self.seen.o.z };
        let Some(second) = second else { return (first, pdf) };
        let (f, more) = if radiance {
            self.bsdf.evaluate_dimmed(0.0, &self.seen, second, transport, set)
        } else {
            self.bsdf.evaluate_dimmed(0.0, &self.bsdf.seen(second), i, transport, set)
        };
        (first + f * second.z.abs(), if radiance { pdf + more } else { 0.5 * (pdf + more) })
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
        let pdf = self.reverse_base_pdf(wi, transport, set);
        if self.coat.is_none() {
            return pdf;
        }
        let (_, o) = Facing::new(self.frame, self.ng, wi);
        match self.coat(&self.bsdf.seen(o), set) {
            Some((coat, share)) if share > 0.0 => pdf + (coat.reverse_pdf(wi, transport) - pdf) * share,
            _ => pdf,
        }
    }

    #[inline]
    fn reverse_base_pdf(&self, wi: Vec3, transport: Transport, set: LobeSet) -> f32 {
        // Whoever comes along `wi` looks for light if this path does not.
        let Some((i, _)) = self.local(wi, transport.reversed()) else { return 0.0 };
        let to = self.seen.wo();
        let pdf = self.bsdf.pdf(i, to, transport, set);
        let light = if transport == Transport::Radiance { self.own() } else { wi };
        let Some((_, Some(second))) = self.relief(light) else { return pdf };
        match transport {
            Transport::Radiance => pdf + self.bsdf.pdf(i, second, transport, set),
            Transport::Importance => 0.5 * (pdf + self.bsdf.pdf(second, to, transport, set)),
        }
    }

    /// What a photon from `wi` (unit, towards where it came from) adds to the radiance seen, per flux over kernel area:
    /// photons measure irradiance on the geometric surface where they are, so `f |wi.ns| / cosine`, the latter that of
    /// `wi` with the normal there. That of the normal here would not do: photons that graze it have met another facet
    /// nearby, whose share of them does not vanish with their cosine here.
    #[inline]
    pub fn gather(&self, wi: Vec3, cosine: f32, set: LobeSet) -> Rgb {
        if self.smooth.is_some() && cosine > 0.0 {
            return self.evaluate_cos(wi, Transport::Radiance, set).0 / cosine;
        }
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
        match self.coat(&self.seen, set) {
            Some((coat, share)) if share > 0.0 => self.sample_coated((coat, share), transport, set, u_lobe, u),
            _ => self.sample_base(transport, set, u_lobe, u),
        }
    }

    /// From a coat above a normal map, which is chosen with the probability `share`, or from what lies below it.
    #[inline(never)]
    fn sample_coated(
        &self,
        (coat, share): (&Coat<'_>, f32),
        transport: Transport,
        set: LobeSet,
        u_lobe: f32,
        u: Vec2,
    ) -> Option<BsdfSample> {
        let (drawn, chance) = if u_lobe < share {
            (coat.sample(transport, u), share)
        } else {
            (self.sample_base(transport, set, (u_lobe - share) / (1.0 - share), u), 1.0 - share)
        };
        let mut sample = drawn?;
        if sample.lobe == LobeSet::DELTA {
            sample.weight /= chance;
            sample.pdf_w *= chance;
            return Some(sample);
        }
        let (value, pdf_w) = self.evaluate_cos(sample.wi, transport, set);
        (sample.weight, sample.pdf_w) = (value / pdf_w, pdf_w);
        (pdf_w > 0.0).then_some(sample)
    }

    #[inline]
    fn sample_base(&self, transport: Transport, set: LobeSet, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let importance = transport == Transport::Importance;
        if self.cos_og == 0.0 || (importance && self.opposite) {
            return None;
        }
        // Under a normal map light leaves by the one way on which it meets the facet or by the other.
        let second = if importance { self.relief(self.own()).and_then(|(_, second)| second) } else { None };
        let Some(second) = second else { return self.sample_seen(&self.seen, 1.0, transport, set, u_lobe, u) };
        if u_lobe < 0.5 {
            return self.sample_seen(&self.seen, 0.5, transport, set, 2.0 * u_lobe, u);
        }
        self.sample_seen(&self.bsdf.seen(second), 0.5, transport, set, 2.0 * u_lobe - 1.0, u)
    }

    /// [`Shading::sample`] as seen along `seen`, which has been chosen with the probability `chance`.
    #[inline(always)]
    fn sample_seen(
        &self,
        seen: &Seen,
        chance: f32,
        transport: Transport,
        set: LobeSet,
        u_lobe: f32,
        u: Vec2,
    ) -> Option<BsdfSample> {
        let importance = transport == Transport::Importance;
        let mut sample = self.bsdf.sample_seen(seen, transport, set, u_lobe, u)?;
        let mut wi = self.frame.to_world(sample.wi);
        let mut cos_ig = wi.dot(self.ng);
        if sample.wi.z * cos_ig < 0.0 {
            if importance {
                (wi, cos_ig) = (-wi, -cos_ig);
            } else if self.smooth.is_some() && self.shines() {
                (wi, cos_ig) = (mirrored(wi, self.ng), -cos_ig);
            }
        }
        if sample.wi.z * cos_ig <= 0.0 {
            return None;
        }
        let local = std::mem::replace(&mut sample.wi, wi);
        if self.smooth.is_some() && sample.lobe != LobeSet::DELTA {
            let (value, pdf_w) = self.evaluate_base(wi, transport, set);
            (sample.weight, sample.pdf_w) = (value / pdf_w, pdf_w);
            return (pdf_w > 0.0).then_some(sample);
        }
        if importance {
            sample.weight *= seen.o.z * cos_ig.abs() / (self.cos_og * local.z.abs() * chance);
            sample.pdf_w *= chance;
        }
        Some(sample)
    }
}
