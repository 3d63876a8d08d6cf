//! Shares of diffuse, glossy and transmitting lobes in the light that a surface scatters, for layers by lobe.
//!
//! Diffuse are diffuse reflection and transmission, and sheen. All other light that leaves on the side on which it
//! arrives is glossy: mirrors, facets and their energy compensation, and coats. All other light that leaves on the other
//! side is transmitted.

use super::layered::{Layered, MIN_COSINE, ViewTerms};
use super::profile::Position;
use super::{Bsdf, BsdfSample, LobeSet, Shading, Transport};
use crate::math::{Rgb, Vec3};

impl Layered<'_> {
    /// Value (1/sr, without cosine) of the diffuse lobes, multiplied by `share` (0 to 1), and of the sheen.
    fn diffuse_value(&self, share: f32, view: &ViewTerms, wi: Vec3) -> Rgb {
        if view.o.z.min(wi.z.abs()) < MIN_COSINE {
            return Rgb::ZERO;
        }
        let i = Vec3::new(wi.x, wi.y, if view.side == 1 { -wi.z } else { wi.z });
        if i.z <= 0.0 {
            let transmits = self.transmits_diffusely();
            return if transmits { self.evaluate_diffuse_transmission(view, i) * share } else { Rgb::ZERO };
        }
        let at_i = Position::new(i.z);
        let matte = self.diffuse_reflection(view, i, at_i) * share;
        let Some(c) = &self.interface.cover else { return matte };
        let [(cos_o, from), (cos_i, to)] = [(view.o, view.at), (i, at_i)].map(|(w, at)| self.angles(view.side, w, at));
        let below = matte * (c.through * c.cover.transmittance(from) * c.cover.transmittance(to));
        let diffuse = if c.cover.has_sheen() { below + c.cover.sheen(view.o, i, from, to) } else { below };
        c.cover.absorption(cos_o, cos_i).map_or(diffuse, |absorption| diffuse * absorption)
    }

    /// Estimated albedos of the diffuse, glossy and transmitting lobes.
    fn lobe_albedos(&self, view: &ViewTerms) -> [Rgb; 3] {
        let [facets, diffuse, straight, coat, sheen] = view.albedos;
        let transmitted = facets * self.transmitted_share(view);
        let all = [diffuse + sheen, facets - transmitted + coat, transmitted + straight];
        all.map(|albedo| albedo.max(Rgb::ZERO).min(Rgb::ONE))
    }
}

impl Bsdf<'_> {
    /// Value (1/sr, without cosine) of the diffuse lobes, multiplied by `share` (0 to 1), and of the sheen.
    pub(super) fn diffuse_value(&self, share: f32, view: &ViewTerms, wi: Vec3) -> Rgb {
        match self {
            Bsdf::Matte(_) => self.evaluate_view(view, wi, Transport::Radiance, LobeSet::BROAD).0 * share,
            Bsdf::Layered(layered) => layered.diffuse_value(share, view, wi),
        }
    }

    /// Estimated albedos of the diffuse, glossy and transmitting lobes.
    fn lobe_albedos(&self, view: &ViewTerms) -> [Rgb; 3] {
        match self {
            Bsdf::Matte(color) => [*color, Rgb::ZERO, Rgb::ZERO],
            Bsdf::Layered(layered) => layered.lobe_albedos(view),
        }
    }
}

impl Shading<'_> {
    /// Estimated albedos of the diffuse, glossy and transmitting lobes, see [`Bsdf::albedo`].
    pub fn lobe_albedos(&self) -> [Rgb; 3] {
        self.bsdf.lobe_albedos(&self.view)
    }

    /// Whether `wi` is on the other side of the surface than the viewing direction.
    pub fn transmits_to(&self, wi: Vec3) -> bool {
        (wi.dot(self.ng) < 0.0) != (self.view.side == 1)
    }

    /// Shares by channel of the diffuse, glossy and transmitting lobes in `value`, which is what the lobes of `set`
    /// scatter from `wi`, times the cosine ([`Shading::evaluate_cos`]). They sum to one.
    pub fn lobe_shares(&self, wi: Vec3, transport: Transport, set: LobeSet, value: Rgb) -> [Rgb; 3] {
        let diffuse = if set.intersects(LobeSet::BROAD) {
            let share = self.diffuse_cos(wi, transport) / value;
            // Also false for the NaN of a black channel.
            Rgb::select(share.cmpge(Rgb::ZERO), share.min(Rgb::ONE), Rgb::ZERO)
        } else {
            Rgb::ZERO
        };
        let rest = Rgb::ONE - diffuse;
        if self.transmits_to(wi) { [diffuse, Rgb::ZERO, rest] } else { [diffuse, rest, Rgb::ZERO] }
    }

    /// Shares of the lobes in a direction that was sampled from the lobes of `set`.
    pub fn shares_of_sample(&self, sample: &BsdfSample, transport: Transport, set: LobeSet) -> [Rgb; 3] {
        let set = if sample.lobe == LobeSet::DELTA { LobeSet::DELTA } else { set };
        let value = if set.intersects(LobeSet::BROAD) { self.eval_cos(sample.wi, transport, set) } else { Rgb::ZERO };
        self.lobe_shares(sample.wi, transport, set, value)
    }
}
