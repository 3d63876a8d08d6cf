//! The BSDF in world space, with one treatment of shading normals for all methods.
//!
//! Light that comes from different sides of the shading plane and of the geometric plane is not scattered. So it is
//! always clear whether light is reflected or transmitted, no light leaks through, and a surface is dark where its
//! shading normal faces away from the light. If the viewing direction is on different sides, which happens on steep
//! normal maps seen from the side, its opposite replaces it. So there are no black spots. Energy is conserved, because
//! scattered directions on the wrong side of the surface are exactly the opposites of the directions that are left out.
//! Light paths use Veach's adjoint \[1997, 5.3\]. Specular light that would leave on the wrong side of the surface is
//! mirrored out of it, and normal maps shadow diffuse light (`relief.rs`).

use super::coat::Coat;
use super::facing::Facing;
use super::layered::ViewTerms;
use super::relief::{mirrored, unshadowed};
use super::{Bsdf, BsdfSample, LobeSet, Transport};
use crate::math::{Frame, Rgb, Vec2, Vec3};
use bumpalo::Bump;

/// The BSDF of a surface point in world space, seen along one direction.
#[derive(Clone, Copy, Debug)]
pub struct Shading<'a> {
    /// Frame whose z axis is the shading normal.
    pub frame: Frame,
    /// Unit geometric normal on the front of the surface.
    pub ng: Vec3,
    /// The BSDF in the shading frame.
    pub bsdf: Bsdf<'a>,
    pub(super) view: ViewTerms,
    /// Absolute cosine of the viewing direction with the geometric normal.
    pub(super) cos_og: f32,
    /// Whether the opposite of the viewing direction replaces it, see [`Facing`].
    flipped: bool,
    /// The surface below the normal map, if the shading frame is that of a normal map; otherwise `None`. It is a
    /// reference, so that surfaces without a normal map stay small.
    mapped: Option<&'a Mapped<'a>>,
}

/// The surface on which a normal map lies.
#[derive(Clone, Copy, Debug)]
struct Mapped<'a> {
    /// The interpolated normal, without the map.
    interpolated_normal: Vec3,
    /// The clear coat over the map, if the surface has one; otherwise `None`.
    coat: Option<Coat<'a>>,
}

impl<'a> Shading<'a> {
    /// The BSDF `bsdf` in the shading frame `frame`, on a surface with geometric normal `ng`, seen along the unit
    /// direction `wo`.
    #[inline(always)]
    pub fn new(frame: Frame, ng: Vec3, bsdf: Bsdf<'a>, wo: Vec3) -> Shading<'a> {
        let (Facing { cos_og, flipped, .. }, o) = Facing::new(frame, ng, wo);
        Shading { frame, ng, bsdf, view: bsdf.view_terms(o), cos_og, flipped, mapped: None }
    }

    /// Marks the shading frame as that of a normal map, where `interpolated_normal` is the normal without the map, and
    /// `coat_normal` the one of a clear coat. `arena` holds them.
    #[inline]
    pub fn with_normal_map(mut self, interpolated_normal: Vec3, coat_normal: Vec3, arena: &'a Bump) -> Shading<'a> {
        if interpolated_normal == self.frame.n && coat_normal == self.frame.n {
            return self;
        }
        let mut coat = None;
        if let Bsdf::Layered(layered) = &mut self.bsdf
            && let Some(covered) = layered.interface.cover.as_ref().filter(|covered| covered.cover.has_coat())
        {
            layered.coat_normal = Some(arena.alloc(self.frame.to_local(coat_normal)));
            let o = self.view.wo();
            let wo = self.frame.to_world(if self.flipped { -o } else { o });
            coat = Some(Coat::new(&covered.cover, coat_normal, self.ng, wo));
            self.view = layered.view_terms(o);
        }
        self.mapped = Some(arena.alloc(Mapped { interpolated_normal, coat }));
        self
    }

    /// Whether the shading frame is that of a normal map.
    #[inline]
    pub(super) fn has_normal_map(&self) -> bool {
        self.mapped.is_some()
    }

    #[inline]
    fn facing(&self) -> Facing {
        Facing { frame: self.frame, ng: self.ng, cos_og: self.cos_og, flipped: self.flipped }
    }

    /// The second direction, in the shading frame, from which specular light from `l` (world space) reaches the surface,
    /// if any: where the shading normal leans away from the geometric one.
    #[inline]
    fn second(&self, l: Vec3) -> Option<Vec3> {
        if !self.may_be_specular() || self.frame.n == self.ng {
            return None;
        }
        let second = self.frame.to_local(mirrored(l, self.ng));
        (second.z * l.dot(self.ng) > 0.0).then_some(second)
    }

    /// Share (0 to 1) of diffuse light from `l` (world space) that the normal map does not shadow.
    #[inline]
    fn unshadowed(&self, l: Vec3) -> f32 {
        self.mapped.map_or(1.0, |mapped| unshadowed(l, self.frame.n, mapped.interpolated_normal))
    }

    /// Whether the BSDF may have a specular lobe, not only diffuse reflection.
    #[inline]
    fn may_be_specular(&self) -> bool {
        matches!(self.bsdf, Bsdf::Layered(_))
    }

    /// The viewing direction in world space. On a light path it points to the light.
    #[inline]
    fn wo_world(&self) -> Vec3 {
        self.frame.to_world(self.view.wo())
    }

    /// The direction of light: `wi` for radiance, and the viewing direction for importance (world space).
    #[inline]
    fn light(&self, wi: Vec3, transport: Transport) -> Vec3 {
        if transport == Transport::Radiance { wi } else { self.wo_world() }
    }

    #[inline]
    fn local(&self, w: Vec3, transport: Transport) -> Option<(Vec3, f32)> {
        self.facing().local(w, transport)
    }

    #[inline]
    fn coat_over_map(&self) -> Option<&'a Coat<'a>> {
        self.mapped?.coat.as_ref()
    }

    /// The coat over a normal map, and the probability of sampling it among the lobes of `set`; `None` without such a
    /// coat.
    #[inline]
    fn coat(&self, view: &ViewTerms, set: LobeSet) -> Option<(&Coat<'a>, f32)> {
        match (self.coat_over_map(), &self.bsdf) {
            (Some(coat), Bsdf::Layered(layered)) => Some((coat, layered.coat_probability(view, set))),
            _ => None,
        }
    }

    /// The BSDF times the cosine, and the density per solid angle with which [`Shading::sample`] draws `wi`. The first
    /// is `f |wi.ns|` for radiance, and `f |wi.ns| (|wo.ns| |wi.ng|) / (|wo.ng| |wi.ns|)` for importance \[Veach 1997
    /// (5.17)\].
    #[inline]
    pub fn evaluate_cos(&self, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        let (value, pdf) = self.evaluate_base(wi, transport, set);
        match self.coat(&self.view, set) {
            Some((coat, share)) if share > 0.0 => {
                let (coated, density) = coat.evaluate_cos(wi, transport);
                (value + Rgb::splat(coated), pdf + (density - pdf) * share)
            }
            _ => (value, pdf),
        }
    }

    /// [`Shading::evaluate_cos`] for a surface without a coat over a normal map.
    #[inline]
    fn evaluate_base(&self, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        let Some((i, cos_ig)) = self.local(wi, transport) else { return (Rgb::ZERO, 0.0) };
        let adjoint = cos_ig / self.cos_og;
        let light = self.light(wi, transport);
        let second = self.second(light);
        if second.is_some() || self.has_normal_map() {
            let (value, pdf) = self.evaluate_relief(i, second, self.unshadowed(light), transport, set);
            return (if transport == Transport::Importance { value * adjoint } else { value }, pdf);
        }
        let (f, pdf) = self.bsdf.evaluate_view(&self.view, i, transport, set);
        let cosine = match transport {
            Transport::Radiance => i.z.abs(),
            Transport::Importance => self.view.o.z * adjoint,
        };
        (f * cosine, pdf)
    }

    /// The BSDF times the cosine of light with the surface, summed over the directions from which light reaches it, `i`
    /// and `second` if that exists, and the density of `i`. Diffuse light is multiplied by `diffuse`.
    #[inline(never)]
    fn evaluate_relief(
        &self,
        i: Vec3,
        second: Option<Vec3>,
        diffuse: f32,
        transport: Transport,
        set: LobeSet,
    ) -> (Rgb, f32) {
        let radiance = transport == Transport::Radiance;
        let (f, pdf) = self.bsdf.evaluate_dimmed(diffuse, &self.view, i, transport, set);
        let first = f * if radiance { i.z.abs() } else { self.view.o.z };
        let Some(second) = second else { return (first, pdf) };
        let (f, more) = if radiance {
            self.bsdf.evaluate_dimmed(0.0, &self.view, second, transport, set)
        } else {
            self.bsdf.evaluate_dimmed(0.0, &self.bsdf.view_terms(second), i, transport, set)
        };
        (first + f * second.z.abs(), if radiance { pdf + more } else { 0.5 * (pdf + more) })
    }

    /// The part of [`Shading::evaluate_cos`] that diffuse lobes and sheen scatter.
    pub(super) fn diffuse_cos(&self, wi: Vec3, transport: Transport) -> Rgb {
        let Some((i, cos_ig)) = self.local(wi, transport) else { return Rgb::ZERO };
        let (bsdf, radiance) = (&self.bsdf, transport == Transport::Radiance);
        let cosine = if radiance { i.z.abs() } else { self.view.o.z };
        let light = self.light(wi, transport);
        let first = bsdf.diffuse_value(self.unshadowed(light), &self.view, i) * cosine;
        let mirrored = self.second(light).map_or(Rgb::ZERO, |second| {
            let value = if radiance {
                bsdf.diffuse_value(0.0, &self.view, second)
            } else {
                bsdf.diffuse_value(0.0, &bsdf.view_terms(second), i)
            };
            value * second.z.abs()
        });
        let value = first + mirrored;
        if radiance { value } else { value * (cos_ig / self.cos_og) }
    }

    /// The value of [`Shading::evaluate_cos`], the BSDF times the cosine, without its density.
    #[inline]
    pub fn eval_cos(&self, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb {
        self.evaluate_cos(wi, transport, set).0
    }

    /// The density per solid angle of [`Shading::evaluate_cos`].
    #[inline]
    pub fn pdf(&self, wi: Vec3, transport: Transport, set: LobeSet) -> f32 {
        self.evaluate_cos(wi, transport, set).1
    }

    /// Density per solid angle with which a path that arrives from `wi` samples the viewing direction.
    #[inline]
    pub fn reverse_pdf(&self, wi: Vec3, transport: Transport, set: LobeSet) -> f32 {
        let pdf = self.reverse_base_pdf(wi, transport, set);
        if self.coat_over_map().is_none() {
            return pdf;
        }
        let (_, o) = Facing::new(self.frame, self.ng, wi);
        match self.coat(&self.bsdf.view_terms(o), set) {
            Some((coat, share)) if share > 0.0 => pdf + (coat.reverse_pdf(wi, transport) - pdf) * share,
            _ => pdf,
        }
    }

    /// [`Shading::reverse_pdf`] for a surface without a coat over a normal map.
    #[inline]
    fn reverse_base_pdf(&self, wi: Vec3, transport: Transport, set: LobeSet) -> f32 {
        // The path from `wi` transports the other quantity.
        let Some((i, _)) = self.local(wi, transport.reversed()) else { return 0.0 };
        let to = self.view.wo();
        let pdf = self.bsdf.pdf(i, to, transport, set);
        let Some(second) = self.second(self.light(wi, transport.reversed())) else { return pdf };
        match transport {
            Transport::Radiance => pdf + self.bsdf.pdf(i, second, transport, set),
            Transport::Importance => 0.5 * (pdf + self.bsdf.pdf(second, to, transport, set)),
        }
    }

    /// Radiance towards the viewer per flux over kernel area of a photon that arrived from the unit direction `wi`: `f
    /// |wi.ns| / cosine`. Photons measure irradiance on the surface that they hit, so `cosine` is the cosine of `wi`
    /// with the geometric normal there, not here: a photon on a neighbouring facet may graze this surface, and dividing
    /// by its small cosine here would make it too bright.
    #[inline]
    pub fn gather(&self, wi: Vec3, cosine: f32, set: LobeSet) -> Rgb {
        if cosine > 0.0 && (self.has_normal_map() || self.second(wi).is_some()) {
            return self.evaluate_cos(wi, Transport::Radiance, set).0 / cosine;
        }
        let (true, Some((i, _))) = (cosine > 0.0, self.local(wi, Transport::Radiance)) else {
            return Rgb::ZERO;
        };
        self.bsdf.eval_view(&self.view, i, Transport::Radiance, set) * (i.z.abs() / cosine)
    }

    /// Estimated albedo of the lobes whose class is in `set`, see [`Bsdf::albedo`].
    #[inline]
    pub fn albedo(&self, set: LobeSet) -> Rgb {
        self.bsdf.albedo_view(&self.view, set)
    }

    /// Samples a direction, see [`Bsdf::sample`]. `wi` of the sample is in world space, and its weight includes the
    /// adjoint correction of shading normals.
    #[inline]
    pub fn sample(&self, transport: Transport, set: LobeSet, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        match self.coat(&self.view, set) {
            Some((coat, share)) if share > 0.0 => self.sample_coated(coat, share, transport, set, u_lobe, u),
            _ => self.sample_base(transport, set, u_lobe, u),
        }
    }

    /// Reflection and transmission at a smooth interface that has no other lobes, the less probable one first; `None` if one
    /// of the two does not exist. The weights are over the probabilities, as those of [`Shading::sample`].
    #[inline(never)]
    pub fn interface_branches(&self, transport: Transport) -> Option<[BsdfSample; 2]> {
        // Samples ascend through all lobes with the number that chooses them.
        let at = |u_lobe: f32| self.sample(transport, LobeSet::DELTA, u_lobe, Vec2::ZERO);
        let (first, last) = (at(0.0)?, at(1.0 - 0.5 * f32::EPSILON)?);
        let all = first.transmitted != last.transmitted && first.pdf_w + last.pdf_w >= 1.0 - f32::EPSILON;
        all.then_some(if first.pdf_w < last.pdf_w { [first, last] } else { [last, first] })
    }

    /// Samples the coat over a normal map, with the probability `share`, or else the lobes below it.
    #[inline(never)]
    fn sample_coated(
        &self,
        coat: &Coat<'_>,
        share: f32,
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

    /// [`Shading::sample`] for a surface without a coat over a normal map.
    #[inline]
    fn sample_base(&self, transport: Transport, set: LobeSet, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let importance = transport == Transport::Importance;
        if self.cos_og == 0.0 || (importance && self.flipped) {
            return None;
        }
        // One of the two directions from which light reaches the surface is chosen.
        let second = if importance { self.second(self.wo_world()) } else { None };
        let Some(second) = second else { return self.sample_view(&self.view, 1.0, transport, set, u_lobe, u) };
        if u_lobe < 0.5 {
            return self.sample_view(&self.view, 0.5, transport, set, 2.0 * u_lobe, u);
        }
        self.sample_view(&self.bsdf.view_terms(second), 0.5, transport, set, 2.0 * u_lobe - 1.0, u)
    }

    /// [`Shading::sample`] for the viewing direction of `view`, which has been chosen with the probability `chance`:
    /// 1/2 if light is mirrored, otherwise 1.
    #[inline(always)]
    fn sample_view(
        &self,
        view: &ViewTerms,
        chance: f32,
        transport: Transport,
        set: LobeSet,
        u_lobe: f32,
        u: Vec2,
    ) -> Option<BsdfSample> {
        let importance = transport == Transport::Importance;
        let mut sample = self.bsdf.sample_view(view, transport, set, u_lobe, u)?;
        let mut wi = self.frame.to_world(sample.wi);
        let mut cos_ig = wi.dot(self.ng);
        if sample.wi.z * cos_ig < 0.0 {
            if importance {
                (wi, cos_ig) = (-wi, -cos_ig);
            } else if self.may_be_specular() {
                (wi, cos_ig) = (mirrored(wi, self.ng), -cos_ig);
            }
        }
        if sample.wi.z * cos_ig <= 0.0 {
            return None;
        }
        let local = std::mem::replace(&mut sample.wi, wi);
        let mirrors = || if importance { chance < 1.0 } else { self.second(wi).is_some() };
        if sample.lobe != LobeSet::DELTA && (self.has_normal_map() || mirrors()) {
            let (value, pdf_w) = self.evaluate_base(wi, transport, set);
            (sample.weight, sample.pdf_w) = (value / pdf_w, pdf_w);
            return (pdf_w > 0.0).then_some(sample);
        }
        if importance {
            sample.weight *= view.o.z * cos_ig.abs() / (self.cos_og * local.z.abs() * chance);
            sample.pdf_w *= chance;
        }
        Some(sample)
    }
}
