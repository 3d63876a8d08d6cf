//! glTF's metallic-roughness model: metal, and a dielectric over a diffuse or transmitting base, sharing one rough
//! interface.
//!
//! Everything is a mixture of three surfaces, each reciprocal and free of loss for a white base:
//! - *metal*: GGX with Schlick's Fresnel term;
//! - *matte*: a rough dielectric interface over a diffuse base, coupled as in \[Kelemen and Szirmay-Kalos 2001\]:
//!   diffuse light is what the interface lets in, (1 - E(o)) (1 - E(i)) / (pi (1 - E_avg)). Both sides of the surface
//!   look like its front;
//! - *glass*: a rough dielectric interface between two media \[Walter 2007\], or two equal ones (a thin wall, whose
//!   transmitted lobe is the mirror image of the reflected one).
//!
//! What single scattering between facets loses is given back by a separable lobe, for glass on both sides in the ratio
//! that keeps it reciprocal \[Kulla and Conty 2017\]. The lobe belongs to the class of the lobe it completes.

use super::LobeSet;
use super::cover::Angles;
use super::fresnel::schlick;
use super::interface::{Interface, RoughGlass, again};
use super::profile::Position;
use crate::math::{Rgb, Vec3};
use std::f32::consts::{FRAC_1_PI, PI};

/// Directions nearer to the surface than this (cosine) are in it: nothing comes from there. Below it, products of
/// cosines underflow.
pub(super) const LEAST_COSINE: f32 = 1e-6;

/// Mean of the channels: what lobes are chosen by.
#[inline]
pub(super) fn mean(c: Rgb) -> f32 {
    c.element_sum() * (1.0 / 3.0)
}

/// See the module's documentation.
#[derive(Clone, Copy, Debug)]
pub struct Layered<'a> {
    pub(super) interface: &'a Interface<'a>,
    /// Classes of lobes that are there.
    pub(super) lobes: LobeSet,
    pub(super) has_facets: bool,
    pub(super) base: Rgb,
    pub(super) metal: f32,
    pub(super) matte: f32,
    pub(super) glass: f32,
    /// Weight of the straight lobe.
    pub(super) straight: Rgb,
    /// Diffuse: `diffuse * through(o) * through(i)`; `diffuse_albedo * through(o)` is its albedo.
    pub(super) diffuse: Rgb,
    pub(super) diffuse_albedo: Rgb,
    /// Compensation for reflecting facets: `returned * loss(o) * loss(i)`, and for thin walls `passed` likewise on the
    /// other side; times pi times the average of `loss` they are albedos.
    pub(super) returned: Rgb,
    pub(super) passed: Rgb,
    /// Average reflectance of the facets below a covering.
    pub(super) below: Rgb,
    /// The normal of a clear coat whose reflection is left to [`super::coat::Coat`].
    pub(super) coat_normal: Option<Vec3>,
}

/// Shares of the lobes among the directions drawn for one `wo` and one set of classes; they sum to 1.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shares {
    /// Facets: reflected or transmitted, as Fresnel says at the facet drawn.
    pub facets: f32,
    /// Compensation on the side of `wo`.
    pub returned: f32,
    /// Compensation on the other side.
    pub passed: f32,
    /// Diffuse reflection.
    pub diffuse: f32,
    /// Straight through an index-matched boundary.
    pub straight: f32,
    /// What facets lose below a covering, on the side of `wo`.
    pub below: f32,
    /// Clear coat.
    pub coat: f32,
    /// Sheen.
    pub sheen: f32,
}

impl Shares {
    /// Scaled to sum to 1; `None` where nothing scatters.
    #[inline]
    fn normalised(mut self) -> Option<Shares> {
        let own = self.facets + self.returned + self.passed + self.diffuse + self.straight;
        let sum = own + self.below + self.coat + self.sheen;
        // Written so that NaN scatters nothing.
        let positive = sum > 0.0;
        if !positive {
            return None;
        }
        let scale = 1.0 / sum;
        self.facets *= scale;
        self.returned *= scale;
        self.passed *= scale;
        self.diffuse *= scale;
        self.straight *= scale;
        self.below *= scale;
        self.coat *= scale;
        self.sheen *= scale;
        Some(self)
    }
}

/// A surface seen along one direction: what all directions of light have in common there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// The direction, from the side it is on.
    pub o: Vec3,
    /// 0: it is above; 1: below.
    pub side: usize,
    pub at: Position,
    /// [`super::microfacet::Ggx::root`] of it.
    pub root: f32,
    /// Profiles of the interface along it.
    pub loss: f32,
    pub through: f32,
    /// Estimates of the lobes' albedos, all classes of lobes: their means,
    means: Shares,
    /// and by class: facets with their compensation, diffuse, straight, coat, sheen.
    albedos: [Rgb; 5],
}

impl Seen {
    /// Where only the direction matters.
    #[inline]
    pub(super) fn plain(wo: Vec3) -> Seen {
        Seen {
            o: Vec3::new(wo.x, wo.y, wo.z.abs()),
            side: usize::from(wo.z < 0.0),
            at: Position::default(),
            root: 0.0,
            loss: 0.0,
            through: 1.0,
            means: Shares::default(),
            albedos: [Rgb::ZERO; 5],
        }
    }

    /// The direction itself.
    #[inline]
    pub(super) fn wo(&self) -> Vec3 {
        if self.side == 1 { Vec3::new(self.o.x, self.o.y, -self.o.z) } else { self.o }
    }
}

impl<'a> Layered<'a> {
    /// The surface of `base` colour, `metallic` and transmitting in these shares, at `interface`.
    #[inline(always)]
    pub(super) fn new(base: Rgb, metallic: f32, transmission: f32, interface: &'a Interface<'a>) -> Layered<'a> {
        let Interface { matched, class, thin, average, .. } = *interface;
        let metal = metallic;
        let glass = (1.0 - metal) * transmission;
        let matte = (1.0 - metal) * (1.0 - transmission);
        let has_facets = metal > 0.0 || (!matched && (glass > 0.0 || (matte > 0.0 && interface.f90 > 0.0)));
        let straight = if matched { base * glass } else { Rgb::ZERO };
        let glass = if matched { 0.0 } else { glass };
        let (mut returned, mut passed) = (Rgb::ZERO, Rgb::ZERO);
        let metal_average = base + (Rgb::ONE - base) * (1.0 / 21.0);
        if class != LobeSet::DELTA {
            let lost = interface.loss.average;
            let scale = FRAC_1_PI / lost.max(1e-9);
            returned = interface.again * (matte * scale);
            if metal > 0.0 {
                returned += again(metal_average, 1.0 - lost) * (metal * scale);
            }
            if thin {
                returned += average * (glass * scale);
                passed = base * ((1.0 - average.max_element()) * glass * scale);
            }
        }
        let diffuse_albedo = base * matte;
        let diffuse = diffuse_albedo * (FRAC_1_PI / interface.through.average.max(1e-9));
        let mut lobes = LobeSet::empty();
        if has_facets {
            lobes = lobes | class;
        }
        if diffuse.max_element() > 0.0 {
            lobes = lobes | LobeSet::BROAD;
        }
        if straight.max_element() > 0.0 {
            lobes = lobes | LobeSet::DELTA;
        }
        let mut below = Rgb::ZERO;
        if let Some(covered) = &interface.cover {
            lobes = lobes | covered.cover.lobes();
            below = metal_average * metal + average * (1.0 - metal);
        }
        Layered {
            interface,
            lobes,
            has_facets,
            base,
            metal,
            matte,
            glass,
            straight,
            diffuse,
            diffuse_albedo,
            returned,
            passed,
            below,
            coat_normal: None,
        }
    }

    /// Cosine of a direction, as seen from `side`, with the coat's normal, and where its cosines lie; `base` is that with
    /// the base's.
    #[inline]
    pub(super) fn angles(&self, side: usize, w: Vec3, base: Position) -> (f32, Angles) {
        let Some(n) = self.coat_normal else { return (w.z.abs(), base.into()) };
        let up = if side == 1 { -w.z } else { w.z };
        let cos = Vec3::new(w.x, w.y, up).dot(n).abs();
        (cos, Angles { coat: Position::new(cos), base })
    }

    /// The probability of drawing a direction from a coat that has a normal of its own.
    #[inline]
    pub(super) fn coat_share(&self, seen: &Seen, set: LobeSet) -> f32 {
        self.all_shares(seen, set).normalised().map_or(0.0, |shares| shares.coat)
    }

    /// Compensation of solid glass, where there is any.
    #[inline]
    pub(super) fn rough_glass(&self) -> Option<&'a RoughGlass<'a>> {
        if self.glass > 0.0 { self.interface.glass.as_ref() } else { None }
    }

    /// Reflectance of metal and of the matte's interface at a facet.
    #[inline]
    fn opaque(&self, cos: f32) -> Rgb {
        let mut reflected = if self.metal > 0.0 { schlick(self.base, cos) * self.metal } else { Rgb::ZERO };
        if self.matte > 0.0 {
            reflected += self.interface.dielectric(cos, 0).0 * self.matte;
        }
        reflected
    }

    /// Reflectance and transmittance of a facet at the angle of cosine `cos`, and the cosine of the refracted ray.
    #[inline]
    pub(super) fn fresnel(&self, cos: f32, side: usize) -> (Rgb, Rgb, f32) {
        let opaque = self.opaque(cos);
        if self.glass == 0.0 {
            return (opaque, Rgb::ZERO, 0.0);
        }
        let (f, t, cos_t) = self.interface.dielectric(cos, side);
        (opaque + f * self.glass, self.base * (self.glass * t), cos_t)
    }

    /// The surface seen along `wo`.
    #[inline(always)]
    pub(super) fn seen(&self, wo: Vec3) -> Seen {
        let n = self.interface;
        let side = usize::from(wo.z < 0.0);
        let o = Vec3::new(wo.x, wo.y, wo.z.abs());
        let at = Position::new(o.z);
        let through = n.through.at(at);
        let mut seen = Seen {
            o,
            side,
            at,
            root: n.ggx.root(o),
            loss: n.loss.at(at),
            through,
            means: Shares::default(),
            albedos: [Rgb::ZERO, self.diffuse_albedo * through, self.straight, Rgb::ZERO, Rgb::ZERO],
        };
        seen.means.diffuse = mean(seen.albedos[1]);
        seen.means.straight = mean(self.straight);
        if self.has_facets {
            let [single, returned, passed] = self.facet_albedos(&seen);
            seen.albedos[0] = single + returned + passed;
            seen.means.facets = mean(single);
            seen.means.returned = mean(returned);
            seen.means.passed = mean(passed);
        }
        self.cover_albedos(&mut seen);
        // The estimate may vanish where the lobe does not: black metal at normal incidence.
        if self.has_facets && n.class != LobeSet::DELTA {
            seen.means.facets += 0.01;
        }
        seen
    }

    /// Estimates of the albedos of facets, their compensation on the same side, and on the other.
    #[inline(always)]
    fn facet_albedos(&self, seen: &Seen) -> [Rgb; 3] {
        let n = self.interface;
        let cos = n.effective_cosine(seen.o.z);
        let own = PI * n.loss.average * seen.loss;
        let (returned, passed) = (self.returned * own, self.passed * own);
        match self.rough_glass() {
            Some(glass) => {
                let (side, at) = (seen.side, seen.at);
                let loss = glass.loss_along(side, at, seen.o);
                let reflected = glass.reflected_along(side, at, seen.o);
                let transmitted = (1.0 - loss - reflected).max(0.0);
                let smooth = n.dielectric(cos, side).0;
                let tint = smooth / smooth.max_element().max(f32::MIN_POSITIVE);
                let single =
                    self.opaque(cos) * (1.0 - seen.loss) + (tint * reflected + self.base * transmitted) * self.glass;
                let same = self.glass * glass.returned[side] * loss * glass.loss[side].average * PI;
                let other = glass.loss[1 - side].average * n.index2(1 - side);
                let across = self.base * (self.glass * glass.passed * loss * other * PI);
                [single, returned + Rgb::splat(same), passed + across]
            }
            None => {
                let (r, t, _) = self.fresnel(cos, seen.side);
                [(r + t) * (1.0 - seen.loss), returned, passed]
            }
        }
    }

    /// What a covering scatters, and what it leaves of the rest.
    #[inline]
    fn cover_albedos(&self, seen: &mut Seen) {
        let Some(c) = &self.interface.cover else { return };
        let (coat_cos, angles) = self.angles(seen.side, seen.o, seen.at);
        let passes = c.cover.passes(angles);
        for albedo in &mut seen.albedos {
            *albedo *= passes;
        }
        for share in [
            &mut seen.means.facets,
            &mut seen.means.returned,
            &mut seen.means.passed,
            &mut seen.means.diffuse,
            &mut seen.means.straight,
        ] {
            *share *= passes;
        }
        if self.has_facets {
            let mut lost = Rgb::ZERO;
            for (below, profile) in c.below.iter().zip(&c.profiles) {
                lost += self.below * (PI * below * profile.average * profile.at(seen.at));
            }
            seen.albedos[0] += lost;
            seen.means.below = mean(lost);
        }
        let [coat, sheen] = c.cover.albedos(coat_cos, angles);
        (seen.albedos[3], seen.albedos[4]) = (coat, sheen);
        (seen.means.coat, seen.means.sheen) = (mean(coat), mean(sheen));
    }

    /// Which of [`Seen`]'s five groups of lobes are in the set.
    #[inline]
    fn groups(&self, set: LobeSet) -> [bool; 5] {
        let coat = self.interface.cover.as_ref().is_some_and(|c| set.intersects(c.cover.coat_class));
        let broad = set.intersects(LobeSet::BROAD);
        [set.intersects(self.interface.class), broad, set.intersects(LobeSet::DELTA), coat, broad]
    }

    /// Albedo of the lobes of `set`.
    #[inline]
    pub(super) fn albedo(&self, seen: &Seen, set: LobeSet) -> Rgb {
        let mut sum = Rgb::ZERO;
        for (albedo, counts) in seen.albedos.iter().zip(self.groups(set)) {
            if counts {
                sum += *albedo;
            }
        }
        sum.min(Rgb::ONE)
    }

    /// Shares of the lobes among the directions drawn here.
    #[inline]
    pub(super) fn shares(&self, seen: &Seen, set: LobeSet) -> Option<Shares> {
        let all = self.all_shares(seen, set);
        let coat = if self.coat_normal.is_some() { 0.0 } else { all.coat };
        Shares { coat, ..all }.normalised()
    }

    /// Not normalised.
    #[inline]
    fn all_shares(&self, seen: &Seen, set: LobeSet) -> Shares {
        let [facets, diffuse, straight, coat, sheen] = self.groups(set).map(|counts| f32::from(u8::from(counts)));
        let means = &seen.means;
        Shares {
            facets: means.facets * facets,
            returned: means.returned * facets,
            passed: means.passed * facets,
            below: means.below * facets,
            diffuse: means.diffuse * diffuse,
            straight: means.straight * straight,
            coat: means.coat * coat,
            sheen: means.sheen * sheen,
        }
    }
}
