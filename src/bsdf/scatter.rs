//! Values, densities and directions of the layered model.

use super::fresnel::{reflect, refract};
use super::layered::{LEAST_COSINE, Layered, Shares, mean};
use super::microfacet::{g1, g2_reflection, g2_transmission};
use super::profile::{Position, Profile};
use super::{BsdfSample, LobeSet, Transport};
use crate::math::{Rgb, Vec2, Vec3, sqr, warp};
use std::f32::consts::FRAC_1_PI;

impl Layered<'_> {
    /// Probability of reflecting at a facet.
    #[inline]
    fn reflect_probability(reflected: Rgb, transmitted: Rgb) -> f32 {
        let (r, t) = (mean(reflected), mean(transmitted));
        if t > 0.0 { r / (r + t) } else { 1.0 }
    }

    /// What a transmitted path weighs more than the adjoint of this transport mode: radiance is denser where the index is higher.
    #[inline]
    fn radiance_scale(&self, side: usize, transport: Transport) -> f32 {
        match transport {
            Transport::Radiance if !self.thin => self.index2(side) / self.index2(1 - side),
            _ => 1.0,
        }
    }

    /// The BSDF without cosine, and the density per solid angle of `wi`, over the lobes of `set` that are not delta.
    #[inline]
    pub(super) fn evaluate(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        let side = usize::from(wo.z < 0.0);
        let (mu_o, mu_i) = (wo.z.abs(), wi.z.abs());
        if mu_o.min(mu_i) < LEAST_COSINE || !(set & LobeSet::SMOOTH).has(self.lobes()) {
            return (Rgb::ZERO, 0.0);
        }
        // Delta lobes take their share of the directions drawn from the set.
        let at = Position::new(mu_o);
        let Some(shares) = self.shares(mu_o, at, side, set) else { return (Rgb::ZERO, 0.0) };
        self.evaluate_shares(wo, wi, at, side, transport, set, &shares)
    }

    /// Where only diffuse reflection is in `set`: the BSDF for `wo` over its dependence on `wi`, and that dependence.
    #[inline]
    pub(super) fn diffuse_from(&self, wo: Vec3, set: LobeSet) -> Option<(Rgb, &Profile<'_>)> {
        let facets = self.has_facets && set.has(self.class);
        if facets || self.cover.is_some() || wo.z.abs() < LEAST_COSINE {
            return None;
        }
        Some((self.diffuse * self.through.at(Position::new(wo.z.abs())), &self.through))
    }

    /// The first part of [`Layered::evaluate`], where that is cheaper: no densities, so no shares.
    #[inline]
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb {
        let (mu_o, mu_i) = (wo.z.abs(), wi.z.abs());
        // A covering asks its shares which of its lobes are in the set.
        if self.cover.is_some() || mu_o.min(mu_i) < LEAST_COSINE {
            return self.evaluate(wo, wi, transport, set).0;
        }
        let side = usize::from(wo.z < 0.0);
        self.evaluate_shares(wo, wi, Position::new(mu_o), side, transport, set, &Shares::default()).0
    }

    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn evaluate_shares(
        &self,
        wo: Vec3,
        wi: Vec3,
        at_o: Position,
        side: usize,
        transport: Transport,
        set: LobeSet,
        shares: &Shares,
    ) -> (Rgb, f32) {
        let o = Vec3::new(wo.x, wo.y, wo.z.abs());
        // As seen from the side of `wo`.
        let i = Vec3::new(wi.x, wi.y, if wo.z < 0.0 { -wi.z } else { wi.z });
        let at_i = Position::new(i.z.abs());
        let facets = self.has_facets && self.class != LobeSet::DELTA && set.has(self.class);
        if i.z > 0.0 {
            self.evaluate_reflected(o, i, (at_o, at_i), side, set, facets, shares)
        } else if facets && self.glass > 0.0 {
            let (f, pdf) = self.evaluate_transmitted(o, i, (at_o, at_i), side, shares);
            (f * self.radiance_scale(side, transport), pdf)
        } else {
            (Rgb::ZERO, 0.0)
        }
    }

    #[inline]
    #[allow(clippy::too_many_arguments)]
    fn evaluate_reflected(
        &self,
        o: Vec3,
        i: Vec3,
        (at_o, at_i): (Position, Position),
        side: usize,
        set: LobeSet,
        facets: bool,
        shares: &Shares,
    ) -> (Rgb, f32) {
        let broad = set.has(LobeSet::BROAD);
        let (mut f, mut pdf) = (Rgb::ZERO, 0.0);
        // Facets and separable lobes pass a covering differently.
        let (mut single, mut separable) = (Rgb::ZERO, [Rgb::ZERO; 3]);
        if facets {
            if let Some(h) = (o + i).try_normalize() {
                let (r, t, _) = self.fresnel(o.dot(h).clamp(0.0, 1.0), side);
                let (value, density) = self.reflecting_facets(o, i, h);
                single = r * value;
                pdf += shares.facets * Self::reflect_probability(r, t) * density;
            }
            let (loss_i, mut density) = self.loss.at_with_pdf_w(at_i, i.z);
            separable[0] = self.returned * (self.loss.at(at_o) * loss_i);
            if self.is_rough_solid() {
                let profile = &self.glass_loss[side];
                let loss_i;
                (loss_i, density) = profile.at_with_pdf_w(at_i, i.z);
                separable[1] = Rgb::splat(self.glass_returned[side] * profile.at(at_o) * loss_i);
            }
            pdf += shares.returned * density;
        }
        if broad && self.diffuse.max_element() > 0.0 {
            separable[2] = self.diffuse * (self.through.at(at_o) * self.through.at(at_i));
            pdf += shares.diffuse * i.z * FRAC_1_PI;
        }
        match &self.cover {
            None => f += single + separable[0] + separable[1] + separable[2],
            Some(c) => {
                let passes = c.cover.passes(at_o) * c.cover.passes(at_i);
                let sum = separable[0] * c.loss + separable[1] * c.glass_loss[side] + separable[2] * c.through;
                f += single * c.cover.passes_both(at_o, at_i) + sum * passes;
                if facets {
                    for (below, profile) in c.below.iter().zip(&c.profiles) {
                        f += *below * (profile.at(at_o) * profile.at(at_i));
                    }
                    pdf += shares.below * i.z * FRAC_1_PI;
                }
                if shares.coat > 0.0 && c.cover.coat_class != LobeSet::DELTA {
                    let (value, density) = c.cover.coat(o, i);
                    f += Rgb::splat(value);
                    pdf += shares.coat * density;
                }
                if shares.sheen > 0.0 {
                    f += c.cover.sheen(o, i, at_o, at_i);
                    pdf += shares.sheen * 0.5 * FRAC_1_PI;
                }
            }
        }
        (f, pdf)
    }

    /// Flux transmitted from `o` (above) to `i` (below).
    #[inline]
    fn evaluate_transmitted(
        &self,
        o: Vec3,
        i: Vec3,
        (at_o, at_i): (Position, Position),
        side: usize,
        shares: &Shares,
    ) -> (Rgb, f32) {
        let (mut single, mut pdf) = (Rgb::ZERO, 0.0);
        let (separable, norm);
        if self.thin {
            let mirrored = Vec3::new(i.x, i.y, -i.z);
            if let Some(h) = (o + mirrored).try_normalize() {
                let (r, t, _) = self.fresnel(o.dot(h).clamp(0.0, 1.0), side);
                let (value, density) = self.reflecting_facets(o, mirrored, h);
                single = t * value;
                pdf += shares.facets * (1.0 - Self::reflect_probability(r, t)) * density;
            }
            let (loss_i, density) = self.loss.at_with_pdf_w(at_i, -i.z);
            separable = self.passed * (self.loss.at(at_o) * loss_i);
            pdf += shares.passed * density;
            norm = self.cover.map_or(1.0, |c| c.loss);
        } else {
            let density;
            (single, density) = self.transmitting_facets(o, i, side);
            pdf += shares.facets * density;
            let (loss_i, density) = self.glass_loss[1 - side].at_with_pdf_w(at_i, -i.z);
            separable = self.glass_passed * (self.glass_loss[side].at(at_o) * loss_i * self.index2(1 - side));
            pdf += shares.passed * density;
            norm = self.cover.map_or(1.0, |c| (c.glass_loss[0] * c.glass_loss[1]).sqrt());
        }
        let f = match &self.cover {
            None => single + separable,
            Some(c) => {
                let passes = c.cover.passes(at_o) * c.cover.passes(at_i);
                single * c.cover.passes_both(at_o, at_i) + separable * (norm * passes)
            }
        };
        (f, pdf)
    }

    /// D G2 / (4 o i), and the density of `i` by reflection at visible normals.
    #[inline]
    fn reflecting_facets(&self, o: Vec3, i: Vec3, h: Vec3) -> (f32, f32) {
        let (lambda_o, lambda_i) = (self.ggx.lambda(o), self.ggx.lambda(i));
        let d = self.ggx.d(h) / (4.0 * o.z);
        (d * g2_reflection(lambda_o, lambda_i) / i.z, d * g1(lambda_o))
    }

    /// Rough refraction \[Walter 2007 (17), (21)\] for flux that comes along `o` (above) and leaves along `i` (below), and the
    /// density of `i`.
    #[inline]
    fn transmitting_facets(&self, o: Vec3, i: Vec3, side: usize) -> (Rgb, f32) {
        let eta = self.eta_from(side);
        let Some(h) = (o + i * eta).try_normalize() else { return (Rgb::ZERO, 0.0) };
        let h = if h.z < 0.0 { -h } else { h };
        let (cos_o, cos_i) = (o.dot(h), i.dot(h));
        if cos_o <= 0.0 || cos_i >= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let (r, t, _) = self.fresnel(cos_o.min(1.0), side);
        let (lambda_o, lambda_i) = (self.ggx.lambda(o), self.ggx.lambda(-i));
        let jacobian = sqr(eta) * -cos_i / sqr(cos_o + eta * cos_i);
        let visible = self.ggx.d(h) * cos_o / o.z * jacobian;
        let value = t * (visible * g2_transmission(lambda_o, lambda_i) / -i.z);
        (value, (1.0 - Self::reflect_probability(r, t)) * visible * g1(lambda_o))
    }

    /// Draws a direction from the lobes of `set`.
    #[inline]
    pub(super) fn sample(
        &self,
        wo: Vec3,
        transport: Transport,
        set: LobeSet,
        u_lobe: f32,
        u: Vec2,
    ) -> Option<BsdfSample> {
        let side = usize::from(wo.z < 0.0);
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let o = Vec3::new(wo.x, wo.y, wo.z.abs());
        if o.z < LEAST_COSINE {
            return None;
        }
        let at = Position::new(o.z);
        let shares = self.shares(o.z, at, side, set)?;
        let back = |w: Vec3| Vec3::new(w.x, w.y, sign * w.z);
        let delta = |wi: Vec3, weight: Rgb, probability: f32| {
            let transmitted = wi.z < 0.0;
            (probability > 0.0).then(|| BsdfSample {
                wi: back(wi),
                weight: weight / probability,
                pdf_w: probability,
                lobe: LobeSet::DELTA,
                transmitted,
            })
        };
        // What a covering leaves of delta lobes.
        let passes = |wi: Vec3| self.cover.map_or(1.0, |c| c.cover.passes_both(at, Position::new(wi.z.abs())));
        let mut u_lobe = u_lobe;
        let mut chosen = |share: f32| {
            let hit = u_lobe < share;
            u_lobe = if hit { u_lobe / share } else { u_lobe - share };
            hit.then_some(u_lobe)
        };
        let (i, lobe) = if let Some(u_facet) = chosen(shares.facets) {
            let smooth = self.class == LobeSet::DELTA;
            let h = if smooth { Vec3::Z } else { self.ggx.sample_visible(o, u) };
            let (r, t, cos_t) = self.fresnel(o.dot(h).clamp(0.0, 1.0), side);
            let p = Self::reflect_probability(r, t);
            let mirrored = reflect(o, h);
            if u_facet < p {
                if smooth {
                    return delta(mirrored, r * passes(mirrored), shares.facets * p);
                }
                (mirrored.z > 0.0).then_some((mirrored, self.class))?
            } else {
                let i = if self.thin {
                    if mirrored.z <= 0.0 {
                        return None;
                    }
                    Vec3::new(mirrored.x, mirrored.y, -mirrored.z)
                } else {
                    refract(o, h, self.eta_from(side), cos_t)
                };
                if smooth {
                    let weight = t * (self.radiance_scale(side, transport) * passes(i));
                    return delta(i, weight, shares.facets * (1.0 - p));
                }
                (i.z < 0.0).then_some((i, self.class))?
            }
        } else if chosen(shares.diffuse).is_some() {
            (warp::hemisphere_cosine(u), LobeSet::BROAD)
        } else if chosen(shares.returned).is_some() {
            let profile = if self.is_rough_solid() { &self.glass_loss[side] } else { &self.loss };
            (profile.sample(u)?, self.class)
        } else if chosen(shares.passed).is_some() {
            let profile = if self.is_rough_solid() { &self.glass_loss[1 - side] } else { &self.loss };
            (-profile.sample(u)?, self.class)
        } else if chosen(shares.straight).is_some() {
            return delta(-o, self.straight * passes(o), shares.straight);
        } else {
            // Rounding can lead here without a covering.
            let c = self.cover.as_ref()?;
            if chosen(shares.below).is_some() {
                (warp::hemisphere_cosine(u), self.class)
            } else if chosen(shares.coat).is_some() {
                let i = c.cover.sample_coat(o, u);
                if c.cover.coat_class == LobeSet::DELTA {
                    return delta(i, c.cover.albedos(o.z, at, LobeSet::DELTA)[0], shares.coat);
                }
                (i.z > 0.0).then_some((i, c.cover.coat_class))?
            } else if chosen(shares.sheen).is_some() {
                let mut i = warp::sphere_uniform(u);
                i.z = i.z.abs();
                (i, LobeSet::BROAD)
            } else {
                return None;
            }
        };
        let wi = back(i.normalize());
        let (f, pdf_w) = self.evaluate_shares(wo, wi, at, side, transport, set, &shares);
        let sample = BsdfSample { wi, weight: f * (wi.z.abs() / pdf_w), pdf_w, lobe, transmitted: i.z < 0.0 };
        (pdf_w > 0.0 && i.z.abs() >= LEAST_COSINE).then_some(sample)
    }
}
