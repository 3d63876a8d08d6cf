//! Values, densities and directions of the layered model.

use super::fresnel::{reflect, refract};
use super::interface::Covered;
use super::layered::{LEAST_COSINE, Layered, Seen, Shares, mean};
use super::microfacet::{g1, g2_transmission};
use super::profile::Position;
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

    /// What a transmitted path weighs more than the adjoint of this transport mode: radiance is denser where the index
    /// is higher.
    #[inline]
    fn radiance_scale(&self, side: usize, transport: Transport) -> f32 {
        match transport {
            Transport::Radiance if !self.interface.thin => {
                self.interface.index2(side) / self.interface.index2(1 - side)
            }
            _ => 1.0,
        }
    }

    /// The BSDF without cosine, and the density per solid angle of `wi`, over the lobes of `set` that are not delta.
    #[inline]
    pub(super) fn evaluate(&self, seen: &Seen, wi: Vec3, transport: Transport, set: LobeSet) -> (Rgb, f32) {
        if seen.o.z.min(wi.z.abs()) < LEAST_COSINE || !(set & LobeSet::SMOOTH).intersects(self.lobes) {
            return (Rgb::ZERO, 0.0);
        }
        // Delta lobes take their share of the directions drawn from the set.
        let Some(shares) = self.shares(seen, set) else { return (Rgb::ZERO, 0.0) };
        self.evaluate_shares::<true>(seen, wi, transport, set, &shares)
    }

    /// Where only diffuse reflection is in `set`: the BSDF over its dependence on `wi`, which is the profile `through`.
    #[inline]
    pub(super) fn diffuse_only(&self, seen: &Seen, set: LobeSet) -> Option<Rgb> {
        let facets = self.has_facets && set.intersects(self.interface.class);
        if facets || self.interface.cover.is_some() || seen.o.z < LEAST_COSINE {
            return None;
        }
        Some(self.diffuse * seen.through)
    }

    /// Facets that only reflect are in `set`, and nothing lies on them.
    #[inline]
    pub(super) fn has_plain_facets(&self, seen: &Seen, set: LobeSet) -> bool {
        let n = self.interface;
        let facets = self.has_facets && n.class != LobeSet::DELTA && set.intersects(n.class);
        facets && self.glass == 0.0 && n.cover.is_none() && n.smooth[0].is_from_thin() && seen.o.z >= LEAST_COSINE
    }

    /// The first part of [`Layered::evaluate`]: no densities, so no shares.
    #[inline]
    pub(super) fn eval(&self, seen: &Seen, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb {
        if seen.o.z.min(wi.z.abs()) < LEAST_COSINE {
            return Rgb::ZERO;
        }
        self.evaluate_shares::<false>(seen, wi, transport, set, &Shares::default()).0
    }

    #[inline(always)]
    fn evaluate_shares<const PDF: bool>(
        &self,
        seen: &Seen,
        wi: Vec3,
        transport: Transport,
        set: LobeSet,
        shares: &Shares,
    ) -> (Rgb, f32) {
        // As seen from the side of `wo`.
        let i = Vec3::new(wi.x, wi.y, if seen.side == 1 { -wi.z } else { wi.z });
        let n = self.interface;
        let facets = self.has_facets && n.class != LobeSet::DELTA && set.intersects(n.class);
        if i.z > 0.0 {
            self.evaluate_reflected::<PDF>(seen, i, set, facets, shares)
        } else if facets && self.glass > 0.0 {
            let (f, pdf) = self.evaluate_transmitted(seen, i, shares);
            (f * self.radiance_scale(seen.side, transport), pdf)
        } else {
            (Rgb::ZERO, 0.0)
        }
    }

    #[inline]
    fn evaluate_reflected<const PDF: bool>(
        &self,
        seen: &Seen,
        i: Vec3,
        set: LobeSet,
        facets: bool,
        shares: &Shares,
    ) -> (Rgb, f32) {
        let n = self.interface;
        let at_i = Position::new(i.z);
        let mut pdf = 0.0;
        // Facets and separable lobes pass a covering differently.
        let (mut single, mut separable) = (Rgb::ZERO, [Rgb::ZERO; 3]);
        if facets {
            let (value, both, cos) = n.ggx.reflection(seen.o, seen.root, i);
            let (r, t, _) = self.fresnel(cos, seen.side);
            single = r * value;
            let (loss_i, mut density) = n.loss.at_with_pdf_w(at_i, i.z);
            separable[0] = self.returned * (seen.loss * loss_i);
            if let Some(glass) = self.rough_glass() {
                let side = seen.side;
                let loss_i;
                (loss_i, density) = glass.loss_with_pdf_w(side, at_i, i);
                let lost = glass.loss_along(side, seen.at, seen.o) * loss_i;
                separable[1] = Rgb::splat(self.glass * glass.returned[side] * lost);
            }
            if PDF {
                let visible = value * both / (seen.o.z + seen.root);
                pdf += shares.facets * Self::reflect_probability(r, t) * visible + shares.returned * density;
            }
        }
        if set.intersects(LobeSet::BROAD) {
            separable[2] = self.diffuse * (seen.through * n.through.at(at_i));
            pdf += shares.diffuse * i.z * FRAC_1_PI;
        }
        let Some(c) = &n.cover else { return (single + separable[0] + separable[1] + separable[2], pdf) };
        let at_o = seen.at;
        let [from, to] = [(seen.o, at_o), (i, at_i)].map(|(w, at)| self.angles(seen.side, w, at).1);
        let passes = c.cover.passes(from) * c.cover.passes(to);
        let sum = separable[0] * c.loss + separable[1] * c.glass_loss[seen.side] + separable[2] * c.through;
        let mut f = single * c.cover.passes_both(from, to) + sum * passes;
        if facets {
            for (below, profile) in c.below.iter().zip(&c.profiles) {
                f += self.below * (below * profile.at(at_o) * profile.at(at_i));
            }
            pdf += shares.below * i.z * FRAC_1_PI;
        }
        if c.cover.has_coat() && self.coat_normal.is_none() && set.intersects(c.cover.coat_class & LobeSet::SMOOTH) {
            let (value, density) = c.cover.coat(seen.o, i);
            f += Rgb::splat(value);
            pdf += shares.coat * density;
        }
        if c.cover.has_sheen() && set.intersects(LobeSet::BROAD) {
            f += c.cover.sheen(seen.o, i, from, to);
            pdf += shares.sheen * 0.5 * FRAC_1_PI;
        }
        (f, pdf)
    }

    /// Flux transmitted from `o` (above) to `i` (below).
    #[inline]
    fn evaluate_transmitted(&self, seen: &Seen, i: Vec3, shares: &Shares) -> (Rgb, f32) {
        let n = self.interface;
        let at_i = Position::new(-i.z);
        let (mut single, mut pdf) = (Rgb::ZERO, 0.0);
        let (separable, norm);
        match self.rough_glass() {
            None => {
                // A thin wall.
                let (value, both, cos) = n.ggx.reflection(seen.o, seen.root, Vec3::new(i.x, i.y, -i.z));
                let (r, t, _) = self.fresnel(cos, seen.side);
                single += t * value;
                let visible = value * both / (seen.o.z + seen.root);
                pdf += shares.facets * (1.0 - Self::reflect_probability(r, t)) * visible;
                let (loss_i, density) = n.loss.at_with_pdf_w(at_i, -i.z);
                separable = self.passed * (seen.loss * loss_i);
                pdf += shares.passed * density;
                norm = n.cover.as_ref().map_or(1.0, |c| c.loss);
            }
            Some(glass) => {
                let density;
                (single, density) = self.transmitting_facets(seen, i);
                pdf += shares.facets * density;
                let side = seen.side;
                let (loss_i, density) = glass.loss_with_pdf_w(1 - side, at_i, i);
                let scale = self.glass * glass.passed * glass.loss_along(side, seen.at, seen.o) * loss_i;
                separable = self.base * (scale * n.index2(1 - side));
                pdf += shares.passed * density;
                norm = n.cover.as_ref().map_or(1.0, |c| (c.glass_loss[0] * c.glass_loss[1]).sqrt());
            }
        }
        let f = match &n.cover {
            None => single + separable,
            Some(c) => {
                let [from, to] = [(seen.o, seen.at), (i, at_i)].map(|(w, at)| self.angles(seen.side, w, at).1);
                let passes = c.cover.passes(from) * c.cover.passes(to);
                single * c.cover.passes_both(from, to) + separable * (norm * passes)
            }
        };
        (f, pdf)
    }

    /// Rough refraction \[Walter 2007 (17), (21)\] for flux that comes along `o` (above) and leaves along `i` (below),
    /// and the density of `i`.
    #[inline]
    fn transmitting_facets(&self, seen: &Seen, i: Vec3) -> (Rgb, f32) {
        let (o, ggx) = (seen.o, &self.interface.ggx);
        let eta = self.interface.smooth[seen.side].eta;
        let Some(h) = (o + i * eta).try_normalize() else { return (Rgb::ZERO, 0.0) };
        let h = if h.z < 0.0 { -h } else { h };
        let (cos_o, cos_i) = (o.dot(h), i.dot(h));
        if cos_o <= 0.0 || cos_i >= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let (r, t, _) = self.fresnel(cos_o.min(1.0), seen.side);
        let (lambda_o, lambda_i) = (ggx.lambda(o), ggx.lambda(-i));
        let jacobian = sqr(eta) * -cos_i / sqr(cos_o + eta * cos_i);
        let visible = ggx.d(h) * cos_o / o.z * jacobian;
        let value = t * (visible * g2_transmission(lambda_o, lambda_i) / -i.z);
        (value, (1.0 - Self::reflect_probability(r, t)) * visible * g1(lambda_o))
    }

    /// Draws a direction from the lobes of `set`.
    #[inline]
    pub(super) fn sample(
        &self,
        seen: &Seen,
        transport: Transport,
        set: LobeSet,
        u_lobe: f32,
        u: Vec2,
    ) -> Option<BsdfSample> {
        let Seen { o, side, .. } = *seen;
        if o.z < LEAST_COSINE {
            return None;
        }
        let shares = self.shares(seen, set)?;
        let n = self.interface;
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let back = |w: Vec3| Vec3::new(w.x, w.y, sign * w.z);
        let mut rest = u_lobe;
        let mut chosen = |share: f32| {
            let hit = rest < share;
            rest = if hit { rest / share } else { rest - share };
            hit.then_some(rest)
        };
        let drawn = if let Some(u_facet) = chosen(shares.facets) {
            self.sample_facets(seen, transport, shares.facets, u_facet, u)?
        } else if chosen(shares.diffuse).is_some() {
            Drawn::Lobe(warp::hemisphere_cosine(u), LobeSet::BROAD)
        } else if chosen(shares.returned).is_some() {
            let drawn = self.rough_glass().map_or_else(|| n.loss.sample(u), |glass| glass.sample(side, u));
            Drawn::Lobe(drawn?, n.class)
        } else if chosen(shares.passed).is_some() {
            let drawn = self.rough_glass().map_or_else(|| n.loss.sample(u), |glass| glass.sample(1 - side, u));
            Drawn::Lobe(-drawn?, n.class)
        } else if chosen(shares.straight).is_some() {
            Drawn::delta(-o, self.straight * self.passes(seen, -o), shares.straight)
        } else if chosen(shares.below).is_some() {
            Drawn::Lobe(warp::hemisphere_cosine(u), n.class)
        } else if chosen(shares.coat).is_some() {
            self.sample_coat(seen, shares.coat, u)?
        } else if chosen(shares.sheen).is_some() {
            let i = warp::sphere_uniform(u);
            Drawn::Lobe(Vec3::new(i.x, i.y, i.z.abs()), LobeSet::BROAD)
        } else {
            return None;
        };
        let (i, lobe) = match drawn {
            Drawn::Lobe(i, lobe) => (i, lobe),
            Drawn::Delta { i, weight, probability } => {
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
        if wi.z.abs() < LEAST_COSINE {
            return None;
        }
        let (f, pdf_w) = self.evaluate_shares::<true>(seen, wi, transport, set, &shares);
        let sample = BsdfSample { wi, weight: f * (wi.z.abs() / pdf_w), pdf_w, lobe, transmitted: i.z < 0.0 };
        (pdf_w > 0.0).then_some(sample)
    }

    /// What a covering leaves of a delta lobe along `wi`.
    #[inline]
    fn passes(&self, seen: &Seen, wi: Vec3) -> f32 {
        let passes = |c: &Covered| {
            let [from, to] = [seen.o, wi].map(|w| self.angles(seen.side, w, Position::new(w.z.abs())).1);
            c.cover.passes_both(from, to)
        };
        self.interface.cover.as_ref().map_or(1.0, passes)
    }

    /// A direction by the facets, which are drawn with the probability `share`: reflected or transmitted, as `u_facet`
    /// says.
    #[inline]
    fn sample_facets(&self, seen: &Seen, transport: Transport, share: f32, u_facet: f32, u: Vec2) -> Option<Drawn> {
        let (n, o, side) = (self.interface, seen.o, seen.side);
        let smooth = n.class == LobeSet::DELTA;
        let h = if smooth { Vec3::Z } else { n.ggx.sample_visible(o, u) };
        let (r, t, cos_t) = self.fresnel(o.dot(h).clamp(0.0, 1.0), side);
        let p = Self::reflect_probability(r, t);
        let mirrored = reflect(o, h);
        if u_facet < p {
            if smooth {
                return Some(Drawn::delta(mirrored, r * self.passes(seen, mirrored), share * p));
            }
            return (mirrored.z > 0.0).then_some(Drawn::Lobe(mirrored, n.class));
        }
        let i = if n.thin {
            if mirrored.z <= 0.0 {
                return None;
            }
            Vec3::new(mirrored.x, mirrored.y, -mirrored.z)
        } else {
            refract(o, h, n.smooth[side].eta, cos_t)
        };
        if smooth {
            let weight = t * (self.radiance_scale(side, transport) * self.passes(seen, i));
            return Some(Drawn::delta(i, weight, share * (1.0 - p)));
        }
        (i.z < 0.0).then_some(Drawn::Lobe(i, n.class))
    }

    /// A direction by the coat, which is drawn with the probability `share`.
    #[inline]
    fn sample_coat(&self, seen: &Seen, share: f32, u: Vec2) -> Option<Drawn> {
        // Rounding can lead here without a covering.
        let cover = &self.interface.cover.as_ref()?.cover;
        let i = cover.sample_coat(seen.o, u);
        if cover.coat_class == LobeSet::DELTA {
            return Some(Drawn::delta(i, Rgb::splat(cover.coat_reflectance(seen.o.z)), share));
        }
        (i.z > 0.0).then_some(Drawn::Lobe(i, cover.coat_class))
    }
}

/// A direction as drawn, as seen from the side of `wo`.
enum Drawn {
    /// By a lobe that has a width.
    Lobe(Vec3, LobeSet),
    /// By a delta lobe: flux over that of `wo`, and the probability of drawing it.
    Delta { i: Vec3, weight: Rgb, probability: f32 },
}

impl Drawn {
    #[inline]
    fn delta(i: Vec3, weight: Rgb, probability: f32) -> Drawn {
        Drawn::Delta { i, weight, probability }
    }
}
