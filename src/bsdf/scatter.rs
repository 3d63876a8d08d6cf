//! Evaluation and sampling of the layered model.

use super::fresnel::{reflect, refract};
use super::interface::{CoverEffect, Interface};
use super::layered::{Layered, LobeWeights, MIN_COSINE, ViewTerms, mean};
use super::microfacet::{g1, g2_transmission};
use super::profile::Position;
use super::{BsdfSample, LobeSet, Transport};
use crate::math::{Rgb, Vec2, Vec3, sqr, warp};
use std::f32::consts::FRAC_1_PI;

impl Layered<'_> {
    /// Probability of sampling reflection, not transmission, at a facet with these two amounts of light.
    #[inline]
    fn reflect_probability(reflected: Rgb, transmitted: Rgb) -> f32 {
        let (r, t) = (mean(reflected), mean(transmitted));
        if t > 0.0 { r / (r + t) } else { 1.0 }
    }

    /// Factor of transmission from the viewer's side relative to that of flux: radiance is scaled by the squared ratio
    /// of the indices.
    #[inline]
    fn radiance_scale(&self, side: usize, transport: Transport) -> f32 {
        match transport {
            Transport::Radiance if !self.interface.thin => {
                self.interface.index2(side) / self.interface.index2(1 - side)
            }
            _ => 1.0,
        }
    }

    /// Value (1/sr, without cosine) and density per solid angle of `wi`, of the non-delta lobes of `set`.
    #[inline]
    pub(super) fn evaluate(&self, view: &ViewTerms, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        if view.o.z.min(wi.z.abs()) < MIN_COSINE || !(set & LobeSet::SMOOTH).intersects(self.lobes) {
            return (Rgb::ZERO, 0.0);
        }
        // Delta lobes of the set reduce the probabilities of the others.
        let Some(probabilities) = self.lobe_probabilities(view, set) else { return (Rgb::ZERO, 0.0) };
        self.evaluate_with::<true>(view, wi, transport, set, &probabilities)
    }

    /// If `set` contains only Lambertian reflection: its factor without the profile `through` at `wi`. Otherwise
    /// `None`.
    #[inline]
    pub(super) fn diffuse_only(&self, view: &ViewTerms, set: LobeSet) -> Option<Rgb> {
        let facets = self.has_facets && set.intersects(self.interface.class);
        let Interface { cover, rough_diffuse, .. } = self.interface;
        if facets || cover.is_some() || rough_diffuse.is_some() || view.o.z < MIN_COSINE || self.transmits_diffusely() {
            return None;
        }
        Some(self.diffuse * view.through)
    }

    /// Whether the surface has reflecting facets in `set` that neither transmit nor have a cover.
    #[inline]
    pub(super) fn has_plain_facets(&self, view: &ViewTerms, set: LobeSet) -> bool {
        let n = self.interface;
        let facets = self.has_facets && n.class != LobeSet::DELTA && set.intersects(n.class);
        facets
            && self.glass == 0.0
            && !self.transmits_diffusely()
            && n.cover.is_none()
            && n.rough_diffuse.is_none()
            && n.dielectric.film.is_none()
            && n.anisotropic_loss.is_none()
            && n.dielectric.smooth[0].is_from_thin()
            && view.o.z >= MIN_COSINE
    }

    /// The value that [`Layered::evaluate`] returns, without computing the density.
    #[inline]
    pub(super) fn eval(&self, view: &ViewTerms, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb {
        if view.o.z.min(wi.z.abs()) < MIN_COSINE {
            return Rgb::ZERO;
        }
        self.evaluate_with::<false>(view, wi, transport, set, &LobeWeights::default()).0
    }

    #[inline(always)]
    fn evaluate_with<const PDF: bool>(
        &self,
        view: &ViewTerms,
        wi: Vec3,
        transport: Transport,
        set: LobeSet,
        probabilities: &LobeWeights,
    ) -> (Rgb, f32) {
        // `wi` with z > 0 on the side of `wo`.
        let i = Vec3::new(wi.x, wi.y, if view.side == 1 { -wi.z } else { wi.z });
        let n = self.interface;
        let facets = self.has_facets && n.class != LobeSet::DELTA && set.intersects(n.class);
        if i.z > 0.0 {
            return self.evaluate_reflected::<PDF>(view, i, set, facets, probabilities);
        }
        let (mut f, mut pdf) = (Rgb::ZERO, 0.0);
        if facets && self.glass > 0.0 {
            (f, pdf) = self.evaluate_transmitted(view, i, probabilities);
            f *= self.radiance_scale(view.side, transport);
        }
        if self.transmits_diffusely() && set.intersects(LobeSet::BROAD) {
            f += self.evaluate_diffuse_transmission(view, i);
            pdf -= probabilities.diffuse_transmitted * i.z * FRAC_1_PI;
        }
        (f, pdf)
    }

    /// Value of the BSDF (1/sr) for light transmitted diffusely from `o` (above) to `i` (below).
    #[inline]
    pub(super) fn evaluate_diffuse_transmission(&self, view: &ViewTerms, i: Vec3) -> Rgb {
        let at_i = Position::new(-i.z);
        let f = self.diffuse_transmitted * (view.through * self.interface.through.at(at_i));
        let Some(c) = &self.interface.cover else { return f };
        let [(cos_o, from), (cos_i, to)] = [(view.o, view.at), (i, at_i)].map(|(w, at)| self.angles(view.side, w, at));
        let f = f * (c.through * c.cover.transmittance(from) * c.cover.transmittance(to));
        c.cover.absorption(cos_o, cos_i).map_or(f, |absorption| f * absorption)
    }

    /// Value of the BSDF (1/sr) for light reflected diffusely from `o` to `i` (both above), without the cover. `at_i` is
    /// the table position of the cosine of `i`.
    #[inline]
    pub(super) fn diffuse_reflection(&self, view: &ViewTerms, i: Vec3, at_i: Position) -> Rgb {
        let through = view.through * self.interface.through.at(at_i);
        match &self.interface.rough_diffuse {
            None => self.diffuse * through,
            Some(rough) => {
                let [single, multiple] = rough.values(view.o, view.at, i, at_i);
                (self.diffuse * single + self.diffuse_multiple * multiple) * through
            }
        }
    }

    #[inline]
    fn evaluate_reflected<const PDF: bool>(
        &self,
        view: &ViewTerms,
        i: Vec3,
        set: LobeSet,
        facets: bool,
        probabilities: &LobeWeights,
    ) -> (Rgb, f32) {
        let n = self.interface;
        let at_i = Position::new(i.z);
        let mut pdf = 0.0;
        // A cover attenuates facets and separable lobes differently.
        let (mut single, mut separable) = (Rgb::ZERO, [Rgb::ZERO; 3]);
        if facets {
            let (value, both, cos) = n.ggx.reflection(view.o, view.root, i);
            let (r, t, _) = self.fresnel(cos, view.side);
            single = r * value;
            let (loss_i, mut density) = n.loss_with_pdf_w(at_i, i);
            separable[0] = self.reflected_compensation * (view.loss * loss_i);
            if let Some(glass) = self.rough_glass() {
                let side = view.side;
                let loss_i;
                (loss_i, density) = glass.loss_with_pdf_w(side, at_i, i);
                let lost = glass.loss_along(side, view.at, view.o) * loss_i;
                separable[1] = n.dielectric.color * (self.glass * glass.reflected_compensation[side] * lost);
            }
            if PDF {
                let visible = value * both / (view.o.z + view.root);
                pdf += probabilities.facets * Self::reflect_probability(r, t) * visible
                    + probabilities.reflected_compensation * density;
            }
        }
        if set.intersects(LobeSet::BROAD) {
            separable[2] = self.diffuse_reflection(view, i, at_i);
            match &n.rough_diffuse {
                None => pdf += probabilities.diffuse * i.z * FRAC_1_PI,
                Some(rough) if PDF => pdf += probabilities.diffuse * rough.pdf_w(view.o, i),
                Some(_) => {}
            }
        }
        let Some(c) = &n.cover else { return (single + separable[0] + separable[1] + separable[2], pdf) };
        let at_o = view.at;
        let [(cos_o, from), (cos_i, to)] = [(view.o, at_o), (i, at_i)].map(|(w, at)| self.angles(view.side, w, at));
        let transmittance = c.cover.transmittance(from) * c.cover.transmittance(to);
        let sum = separable[0] * c.loss + separable[1] * c.glass_loss[view.side] + separable[2] * c.through;
        let mut f = single * c.cover.facet_transmittance(from, to) + sum * transmittance;
        if facets {
            for (scale, profile) in c.loss_scale.iter().zip(&c.loss_profiles) {
                f += self.facet_average * (scale * profile.at(at_o) * profile.at(at_i));
            }
            pdf += probabilities.covered_loss * i.z * FRAC_1_PI;
        }
        let absorption = c.cover.absorption(cos_o, cos_i);
        if let Some(absorption) = absorption {
            f *= absorption;
        }
        if c.cover.has_coat() && self.coat_normal.is_none() && set.intersects(c.cover.coat_class & LobeSet::SMOOTH) {
            let (value, density) = c.cover.coat(view.o, i);
            f += Rgb::splat(value);
            pdf += probabilities.coat * density;
        }
        if c.cover.has_sheen() && set.intersects(LobeSet::BROAD) {
            let sheen = c.cover.sheen(view.o, i, from, to);
            f += absorption.map_or(sheen, |absorption| sheen * absorption);
            pdf += probabilities.sheen * 0.5 * FRAC_1_PI;
        }
        (f, pdf)
    }

    /// Value of the BSDF (1/sr) for flux transmitted from `o` (above) to `i` (below), and the density per solid angle
    /// of sampling `i`.
    #[inline]
    fn evaluate_transmitted(&self, view: &ViewTerms, i: Vec3, probabilities: &LobeWeights) -> (Rgb, f32) {
        let n = self.interface;
        let at_i = Position::new(-i.z);
        let (mut single, mut pdf) = (Rgb::ZERO, 0.0);
        let (separable, norm);
        match self.rough_glass() {
            None => {
                // A thin wall.
                let (value, both, cos) = n.ggx.reflection(view.o, view.root, Vec3::new(i.x, i.y, -i.z));
                let (r, t, _) = self.fresnel(cos, view.side);
                single += t * value;
                let visible = value * both / (view.o.z + view.root);
                pdf += probabilities.facets * (1.0 - Self::reflect_probability(r, t)) * visible;
                let (loss_i, density) = n.loss_with_pdf_w(at_i, i);
                separable = self.transmitted_compensation * (view.loss * loss_i);
                pdf += probabilities.transmitted_compensation * density;
                norm = n.cover.as_ref().map_or(1.0, |c| c.loss);
            }
            Some(glass) => {
                let density;
                (single, density) = self.transmitting_facets(view, i);
                pdf += probabilities.facets * density;
                let side = view.side;
                let (loss_i, density) = glass.loss_with_pdf_w(1 - side, at_i, i);
                let scale =
                    self.glass * glass.transmitted_compensation * glass.loss_along(side, view.at, view.o) * loss_i;
                separable = self.base * (scale * n.index2(1 - side));
                pdf += probabilities.transmitted_compensation * density;
                norm = n.cover.as_ref().map_or(1.0, |c| (c.glass_loss[0] * c.glass_loss[1]).sqrt());
            }
        }
        let f = match &n.cover {
            None => single + separable,
            Some(c) => {
                let [(cos_o, from), (cos_i, to)] =
                    [(view.o, view.at), (i, at_i)].map(|(w, at)| self.angles(view.side, w, at));
                let transmittance = c.cover.transmittance(from) * c.cover.transmittance(to);
                let f = single * c.cover.facet_transmittance(from, to) + separable * (norm * transmittance);
                c.cover.absorption(cos_o, cos_i).map_or(f, |absorption| f * absorption)
            }
        };
        (f, pdf)
    }

    /// Value of rough refraction \[Walter 2007 (17), (21)\] of flux from `o` (above) to `i` (below), and the density of
    /// sampling `i`.
    #[inline]
    fn transmitting_facets(&self, view: &ViewTerms, i: Vec3) -> (Rgb, f32) {
        let (o, ggx) = (view.o, &self.interface.ggx);
        let eta = self.interface.dielectric.smooth[view.side].eta;
        let Some(h) = (o + i * eta).try_normalize() else { return (Rgb::ZERO, 0.0) };
        let h = if h.z < 0.0 { -h } else { h };
        let (cos_o, cos_i) = (o.dot(h), i.dot(h));
        if cos_o <= 0.0 || cos_i >= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let (r, t, _) = self.fresnel(cos_o.min(1.0), view.side);
        let (lambda_o, lambda_i) = (ggx.lambda(o), ggx.lambda(-i));
        let jacobian = sqr(eta) * -cos_i / sqr(cos_o + eta * cos_i);
        let visible = ggx.d(h) * cos_o / o.z * jacobian;
        let value = t * (visible * g2_transmission(lambda_o, lambda_i) / -i.z);
        (value, (1.0 - Self::reflect_probability(r, t)) * visible * g1(lambda_o))
    }

    /// Samples a direction from the lobes whose class is in `set`.
    #[inline]
    pub(super) fn sample(
        &self,
        view: &ViewTerms,
        transport: Transport,
        set: LobeSet,
        u_lobe: f32,
        u: Vec2,
    ) -> Option<BsdfSample> {
        let ViewTerms { o, side, .. } = *view;
        if o.z < MIN_COSINE {
            return None;
        }
        let probabilities = self.lobe_probabilities(view, set)?;
        let n = self.interface;
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let back = |w: Vec3| Vec3::new(w.x, w.y, sign * w.z);
        let mut rest = u_lobe;
        let mut chosen = |share: f32| {
            let hit = rest < share;
            rest = if hit { rest / share } else { rest - share };
            hit.then_some(rest)
        };
        let drawn = if let Some(u_facet) = chosen(probabilities.facets) {
            self.sample_facets(view, transport, probabilities.facets, u_facet, u)?
        } else if let Some(u_rest) = chosen(probabilities.diffuse) {
            let i =
                n.rough_diffuse.as_ref().map_or_else(|| warp::hemisphere_cosine(u), |rough| rough.sample(o, u_rest, u));
            SampledDirection::Lobe(i, LobeSet::BROAD)
        } else if chosen(probabilities.reflected_compensation).is_some() {
            let drawn = self.rough_glass().map_or_else(|| n.sample_loss(u), |glass| glass.sample(side, u));
            SampledDirection::Lobe(drawn?, n.class)
        } else if chosen(probabilities.transmitted_compensation).is_some() {
            let drawn = self.rough_glass().map_or_else(|| n.sample_loss(u), |glass| glass.sample(1 - side, u));
            SampledDirection::Lobe(-drawn?, n.class)
        } else if chosen(probabilities.straight).is_some() {
            SampledDirection::delta(-o, self.straight * self.cover_transmittance(view, -o), probabilities.straight)
        } else if chosen(probabilities.covered_loss).is_some() {
            SampledDirection::Lobe(warp::hemisphere_cosine(u), n.class)
        } else if chosen(probabilities.coat).is_some() {
            self.sample_coat(view, probabilities.coat, u)?
        } else if chosen(probabilities.sheen).is_some() {
            let i = warp::sphere_uniform(u);
            SampledDirection::Lobe(Vec3::new(i.x, i.y, i.z.abs()), LobeSet::BROAD)
        } else if chosen(probabilities.diffuse_transmitted).is_some() {
            SampledDirection::Lobe(-warp::hemisphere_cosine(u), LobeSet::BROAD)
        } else {
            return None;
        };
        let (i, lobe) = match drawn {
            SampledDirection::Lobe(i, lobe) => (i, lobe),
            SampledDirection::Delta { i, weight, probability } => {
                return (probability > 0.0).then(|| BsdfSample {
                    wi: back(i),
                    weight: weight / probability,
                    pdf_w: probability,
                    lobe: LobeSet::DELTA,
                    transmitted: i.z < 0.0,
                });
            }
        };
        let wi = back(i.normalize());
        if wi.z.abs() < MIN_COSINE {
            return None;
        }
        let (f, pdf_w) = self.evaluate_with::<true>(view, wi, transport, set, &probabilities);
        let sample = BsdfSample { wi, weight: f * (wi.z.abs() / pdf_w), pdf_w, lobe, transmitted: i.z < 0.0 };
        (pdf_w > 0.0).then_some(sample)
    }

    /// Factor (0 to 1) by which the cover attenuates a delta lobe towards `wi`.
    #[inline]
    fn cover_transmittance(&self, view: &ViewTerms, wi: Vec3) -> Rgb {
        let transmittance = |c: &CoverEffect| {
            let [(cos_o, from), (cos_i, to)] =
                [view.o, wi].map(|w| self.angles(view.side, w, Position::new(w.z.abs())));
            let transmittance = Rgb::splat(c.cover.facet_transmittance(from, to));
            c.cover.absorption(cos_o, cos_i).map_or(transmittance, |absorption| transmittance * absorption)
        };
        self.interface.cover.as_ref().map_or(Rgb::ONE, transmittance)
    }

    /// Samples a direction from the facets, whose lobe has been chosen with the probability `share`; `u_facet` chooses
    /// reflection or transmission.
    #[inline]
    fn sample_facets(
        &self,
        view: &ViewTerms,
        transport: Transport,
        share: f32,
        u_facet: f32,
        u: Vec2,
    ) -> Option<SampledDirection> {
        let (n, o, side) = (self.interface, view.o, view.side);
        let smooth = n.class == LobeSet::DELTA;
        let h = if smooth { Vec3::Z } else { n.ggx.sample_visible(o, u) };
        let (r, t, cos_t) = self.fresnel(o.dot(h).clamp(0.0, 1.0), side);
        let p = Self::reflect_probability(r, t);
        let mirrored = reflect(o, h);
        if u_facet < p {
            if smooth {
                return Some(SampledDirection::delta(
                    mirrored,
                    r * self.cover_transmittance(view, mirrored),
                    share * p,
                ));
            }
            return (mirrored.z > 0.0).then_some(SampledDirection::Lobe(mirrored, n.class));
        }
        let i = if n.thin {
            if mirrored.z <= 0.0 {
                return None;
            }
            Vec3::new(mirrored.x, mirrored.y, -mirrored.z)
        } else {
            refract(o, h, n.dielectric.smooth[side].eta, cos_t)
        };
        if smooth {
            let weight = t * (self.cover_transmittance(view, i) * self.radiance_scale(side, transport));
            return Some(SampledDirection::delta(i, weight, share * (1.0 - p)));
        }
        (i.z < 0.0).then_some(SampledDirection::Lobe(i, n.class))
    }

    /// Samples a direction from the coat, whose lobe has been chosen with the probability `share`; `None` if it is
    /// below the surface, or if there is no coat.
    #[inline]
    fn sample_coat(&self, view: &ViewTerms, share: f32, u: Vec2) -> Option<SampledDirection> {
        // Rounding errors can lead here without a cover.
        let cover = &self.interface.cover.as_ref()?.cover;
        let i = cover.sample_coat(view.o, u);
        if cover.coat_class == LobeSet::DELTA {
            return Some(SampledDirection::delta(i, Rgb::splat(cover.coat_reflectance(view.o.z)), share));
        }
        (i.z > 0.0).then_some(SampledDirection::Lobe(i, cover.coat_class))
    }
}

/// A sampled direction, with z > 0 on the side of `wo`.
enum SampledDirection {
    /// A direction from a lobe of this class, which is not a delta lobe.
    Lobe(Vec3, LobeSet),
    /// The direction of a delta lobe, the lobe's weight, and the probability of choosing it.
    Delta { i: Vec3, weight: Rgb, probability: f32 },
}

impl SampledDirection {
    #[inline]
    fn delta(i: Vec3, weight: Rgb, probability: f32) -> SampledDirection {
        SampledDirection::Delta { i, weight, probability }
    }
}
