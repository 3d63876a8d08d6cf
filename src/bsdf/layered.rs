//! The metallic-roughness model of glTF: a metal, and a dielectric over a diffuse or transmitting base, with one rough
//! interface.
//!
//! The BSDF is a mixture of three surfaces. Each is reciprocal, and conserves energy if its base colour is white:
//! - *metal*: GGX with Schlick's Fresnel term;
//! - *matte*: a rough dielectric interface over a diffuse base, coupled as in \[Kelemen and Szirmay-Kalos 2001\]. The
//!   diffuse lobe is (1 - E(o)) (1 - E(i)) / (pi (1 - E_avg)), with the albedo E of the interface. Both sides of the
//!   surface look like its front;
//! - *glass*: a rough dielectric interface between two media \[Walter 2007\], or a thin wall between equal media, whose
//!   transmitted lobe is the mirror image of the reflected one.
//!
//! A separable lobe compensates the energy that single scattering between facets loses \[Kulla and Conty 2017\]. For
//! glass it has a reflected and a transmitted part, in the ratio that makes it reciprocal. It has the lobe class of the
//! facets.

use super::LobeSet;
use super::cover::Angles;
use super::interface::{Interface, RoughGlass, multiple_scattering};
use super::profile::Position;
use crate::math::{Rgb, Vec3};
use std::f32::consts::{FRAC_1_PI, PI};

/// Smallest absolute cosine of a direction that scatters light, because products of smaller cosines underflow.
pub(super) const MIN_COSINE: f32 = 1e-6;

/// Mean of the three channels. Lobes are sampled in proportion to it.
#[inline]
pub(super) fn mean(c: Rgb) -> f32 {
    c.element_sum() * (1.0 / 3.0)
}

/// The layered BSDF: a mixture of metal, matte surface and glass, below a cover of coat and sheen.
#[derive(Clone, Copy, Debug)]
pub struct Layered<'a> {
    pub(super) interface: &'a Interface<'a>,
    /// Classes (delta, sharp, broad) of the lobes that scatter light.
    pub(super) lobes: LobeSet,
    pub(super) has_facets: bool,
    pub(super) base: Rgb,
    /// Weight of the metal in the mixture of three surfaces, 0 to 1.
    pub(super) metal: f32,
    /// Weight of the matte surface (a dielectric over a diffuse base) in the mixture, 0 to 1.
    pub(super) matte: f32,
    /// Weight of the glass in the mixture, 0 to 1; zero if its indices are matched.
    pub(super) glass: f32,
    /// Weight of the delta lobe straight through glass of matched indices.
    pub(super) straight: Rgb,
    /// Factor of the diffuse lobe `diffuse * through(o) * through(i)`.
    pub(super) diffuse: Rgb,
    /// Factor of the albedo `diffuse_albedo * through(o)` of the diffuse lobe of a Lambertian base.
    pub(super) diffuse_albedo: Rgb,
    /// For a rough base, the factor of the diffuse light that is scattered several times: `diffuse_multiple * through(o)
    /// * through(i)`, times the profile of [`super::rough_diffuse::RoughDiffuse`] for both directions.
    pub(super) diffuse_multiple: Rgb,
    /// Factor of the diffusely transmitted lobe `diffuse_transmitted * through(o) * through(i)`.
    pub(super) diffuse_transmitted: Rgb,
    /// Factor of the albedo `diffuse_transmitted_albedo * through(o)` of diffuse transmission.
    pub(super) diffuse_transmitted_albedo: Rgb,
    /// Factor of the energy-compensating reflected lobe `reflected_compensation * loss(o) * loss(i)` of metal, matte
    /// and thin walls. Its albedo is `pi * average of loss * reflected_compensation * loss(o)`.
    pub(super) reflected_compensation: Rgb,
    /// Factor of the energy-compensating transmitted lobe of thin walls; its formula is that of
    /// `reflected_compensation`.
    pub(super) transmitted_compensation: Rgb,
    /// Average reflectance of the facets; used only if there is a cover.
    pub(super) facet_average: Rgb,
    /// Normal of a clear coat over a normal map, which [`super::coat::Coat`] evaluates; otherwise `None`.
    pub(super) coat_normal: Option<&'a Vec3>,
}

/// One weight per lobe, for one `wo`: estimated albedos, or, normalized to sum to 1, sampling probabilities.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LobeWeights {
    /// Weight of the facets' single scattering. Fresnel's equations then choose reflection or transmission.
    pub facets: f32,
    /// Weight of the reflected lobe that compensates the energy lost by single scattering.
    pub reflected_compensation: f32,
    /// Weight of the transmitted lobe that compensates the energy lost by single scattering.
    pub transmitted_compensation: f32,
    /// Weight of diffuse reflection.
    pub diffuse: f32,
    /// Weight of the delta lobe straight through glass of matched indices.
    pub straight: f32,
    /// Weight of the lobe that compensates the energy that facets lose below a cover.
    pub covered_loss: f32,
    /// Weight of the clear coat.
    pub coat: f32,
    /// Weight of sheen.
    pub sheen: f32,
    /// Weight of diffuse transmission.
    pub diffuse_transmitted: f32,
}

impl LobeWeights {
    /// Scales the weights to sum to 1; `None` if they are all zero.
    #[inline]
    fn normalized(mut self) -> Option<LobeWeights> {
        let own =
            self.facets + self.reflected_compensation + self.transmitted_compensation + self.diffuse + self.straight;
        let sum = own + self.covered_loss + self.coat + self.sheen + self.diffuse_transmitted;
        // This form returns `None` for NaN.
        let positive = sum > 0.0;
        if !positive {
            return None;
        }
        let scale = 1.0 / sum;
        self.facets *= scale;
        self.reflected_compensation *= scale;
        self.transmitted_compensation *= scale;
        self.diffuse *= scale;
        self.straight *= scale;
        self.covered_loss *= scale;
        self.coat *= scale;
        self.sheen *= scale;
        self.diffuse_transmitted *= scale;
        Some(self)
    }
}

/// The terms of a BSDF that depend only on the viewing direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct ViewTerms {
    /// Unit viewing direction in the shading frame, mirrored to z >= 0 if it is below the surface.
    pub o: Vec3,
    /// Side of the viewing direction: 0 above, 1 below.
    pub side: usize,
    /// Table position of the cosine of the viewing direction.
    pub at: Position,
    /// [`super::microfacet::Ggx::root`] of `o`.
    pub root: f32,
    /// Value of the interface's `loss` at `o`: the energy share that single scattering loses.
    pub loss: f32,
    /// Value of the interface's `through` at `o`: the transmittance to the diffuse base.
    pub through: f32,
    /// Estimated albedo of each lobe, as a mean over the channels.
    means: LobeWeights,
    /// Estimated albedos of five sets of lobes: facets with their compensation, diffuse reflection and transmission,
    /// straight, coat, sheen.
    pub(super) albedos: [Rgb; 5],
}

impl ViewTerms {
    /// The terms of a BSDF that depends on nothing but the viewing direction itself, such as a Lambertian one.
    #[inline]
    pub(super) fn plain(wo: Vec3) -> ViewTerms {
        ViewTerms {
            o: Vec3::new(wo.x, wo.y, wo.z.abs()),
            side: usize::from(wo.z < 0.0),
            at: Position::default(),
            root: 0.0,
            loss: 0.0,
            through: 1.0,
            means: LobeWeights::default(),
            albedos: [Rgb::ZERO; 5],
        }
    }

    /// The viewing direction in the shading frame, with its original sign of z.
    #[inline]
    pub(super) fn wo(&self) -> Vec3 {
        if self.side == 1 { Vec3::new(self.o.x, self.o.y, -self.o.z) } else { self.o }
    }
}

impl<'a> Layered<'a> {
    /// The BSDF of a surface with this base colour, metalness (0 to 1), transmission (0 to 1) and interface.
    #[inline(always)]
    pub(super) fn new(base: Rgb, metallic: f32, transmission: f32, interface: &'a Interface<'a>) -> Layered<'a> {
        let Interface { matched, class, thin, average, .. } = *interface;
        let metal = metallic;
        let glass = (1.0 - metal) * transmission;
        let matte = (1.0 - metal) * (1.0 - transmission);
        let has_facets = metal > 0.0 || (!matched && (glass > 0.0 || (matte > 0.0 && interface.dielectric.f90 > 0.0)));
        let straight = if matched { base * glass } else { Rgb::ZERO };
        let glass = if matched { 0.0 } else { glass };
        let (mut reflected_compensation, mut transmitted_compensation) = (Rgb::ZERO, Rgb::ZERO);
        let metal_average = interface.metal_average(base);
        if class != LobeSet::DELTA && !interface.single_scattering {
            let lost = interface.loss.average;
            let scale = FRAC_1_PI / lost.max(1e-9);
            reflected_compensation = interface.multiple_scattering * (matte * scale);
            if metal > 0.0 {
                reflected_compensation += multiple_scattering(metal_average, 1.0 - lost) * (metal * scale);
            }
            if thin {
                reflected_compensation += average * (glass * scale);
                let transmitted = match interface.dielectric.film {
                    None => Rgb::splat(1.0 - average.max_element()),
                    Some(_) => Rgb::ONE - average,
                };
                transmitted_compensation = base * (transmitted * glass * scale);
            }
        }
        let (behind, color_behind) = interface.diffuse_transmission;
        let diffuse_albedo = base * (matte * (1.0 - behind));
        let diffuse_transmitted_albedo = color_behind * (matte * behind);
        let scale = FRAC_1_PI / interface.through.average.max(1e-9);
        let (diffuse, diffuse_transmitted) = (diffuse_albedo * scale, diffuse_transmitted_albedo * scale);
        let diffuse_multiple = match &interface.rough_diffuse {
            None => Rgb::ZERO,
            Some(rough) => rough.multiple_scattering(base) * (matte * (1.0 - behind) * scale),
        };
        let mut lobes = LobeSet::empty();
        if has_facets {
            lobes |= class;
        }
        if diffuse.max_element() > 0.0 || diffuse_transmitted_albedo.max_element() > 0.0 {
            lobes |= LobeSet::BROAD;
        }
        if straight.max_element() > 0.0 {
            lobes |= LobeSet::DELTA;
        }
        let mut facet_average = Rgb::ZERO;
        if let Some(covered) = &interface.cover {
            lobes |= covered.cover.lobes();
            facet_average = metal_average * metal + average * (1.0 - metal);
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
            diffuse_multiple,
            diffuse_transmitted,
            diffuse_transmitted_albedo,
            reflected_compensation,
            transmitted_compensation,
            facet_average,
            coat_normal: None,
        }
    }

    /// Cosine of `w` with the normal of the coat, and the table positions of its cosines with the normals of coat and
    /// base. `side` is the side of the viewer, `base` the position of the cosine with the normal of the base.
    #[inline]
    pub(super) fn angles(&self, side: usize, w: Vec3, base: Position) -> (f32, Angles) {
        let Some(n) = self.coat_normal else { return (w.z.abs(), base.into()) };
        let up = if side == 1 { -w.z } else { w.z };
        let cos = Vec3::new(w.x, w.y, up).dot(*n).abs();
        (cos, Angles { coat: Position::new(cos), base })
    }

    /// Probability of sampling the coat, among the lobes of `set`, for a coat over a normal map.
    #[inline]
    pub(super) fn coat_probability(&self, view: &ViewTerms, set: LobeSet) -> f32 {
        self.lobe_weights(view, set).normalized().map_or(0.0, |probabilities| probabilities.coat)
    }

    /// Whether part of the diffuse light leaves on the other side.
    #[inline]
    pub(super) fn transmits_diffusely(&self) -> bool {
        self.diffuse_transmitted_albedo.max_element() > 0.0
    }

    /// Energy compensation of solid rough glass; `None` if the surface is not such glass.
    #[inline]
    pub(super) fn rough_glass(&self) -> Option<&'a RoughGlass<'a>> {
        if self.glass > 0.0 { self.interface.glass.as_ref() } else { None }
    }

    /// Reflectance at a facet of the opaque parts of the mixture: metal, and the interface of the matte surface.
    #[inline]
    fn opaque(&self, cos: f32) -> Rgb {
        let mut reflected =
            if self.metal > 0.0 { self.interface.metal(self.base, cos) * self.metal } else { Rgb::ZERO };
        if self.matte > 0.0 {
            reflected += self.interface.dielectric.fresnel(cos, 0).0 * self.matte;
        }
        reflected
    }

    /// Reflectance and transmittance of a facet where light arrives at cosine `cos` on `side`, and the cosine of the
    /// refracted ray.
    #[inline]
    pub(super) fn fresnel(&self, cos: f32, side: usize) -> (Rgb, Rgb, f32) {
        let opaque = self.opaque(cos);
        if self.glass == 0.0 {
            return (opaque, Rgb::ZERO, 0.0);
        }
        let (f, t, cos_t) = self.interface.dielectric.fresnel(cos, side);
        (opaque + f * self.glass, self.base * (t * self.glass), cos_t)
    }

    /// The terms of the BSDF that depend only on the viewing direction `wo`.
    #[inline(always)]
    pub(super) fn view_terms(&self, wo: Vec3) -> ViewTerms {
        let n = self.interface;
        let side = usize::from(wo.z < 0.0);
        let o = Vec3::new(wo.x, wo.y, wo.z.abs());
        let at = Position::new(o.z);
        let through = n.through.at(at);
        let diffuse = match &n.rough_diffuse {
            None => self.diffuse_albedo,
            Some(rough) => rough.albedo(self.base, at) * (self.matte * (1.0 - n.diffuse_transmission.0)),
        };
        let mut view = ViewTerms {
            o,
            side,
            at,
            root: n.ggx.root(o),
            loss: n.loss_along(at, o),
            through,
            means: LobeWeights::default(),
            albedos: [Rgb::ZERO, diffuse * through, self.straight, Rgb::ZERO, Rgb::ZERO],
        };
        view.means.diffuse = mean(view.albedos[1]);
        if self.transmits_diffusely() {
            let transmitted = self.diffuse_transmitted_albedo * through;
            view.means.diffuse_transmitted = mean(transmitted);
            view.albedos[1] += transmitted;
        }
        view.means.straight = mean(self.straight);
        if self.has_facets {
            let [single, reflected_compensation, transmitted_compensation] = self.facet_albedos(&view);
            view.albedos[0] = single + reflected_compensation + transmitted_compensation;
            view.means.facets = mean(single);
            view.means.reflected_compensation = mean(reflected_compensation);
            view.means.transmitted_compensation = mean(transmitted_compensation);
        }
        self.cover_albedos(&mut view);
        // The estimate may be zero where the lobe is not, for example for black metal at normal incidence.
        if self.has_facets && n.class != LobeSet::DELTA {
            view.means.facets += 0.01;
        }
        view
    }

    /// Estimated albedos of three lobes: the facets, their reflected compensation, and their transmitted compensation.
    #[inline(always)]
    fn facet_albedos(&self, view: &ViewTerms) -> [Rgb; 3] {
        let n = self.interface;
        let cos = n.effective_cosine(view.o.z);
        let own = PI * n.loss.average * view.loss;
        let (reflected_compensation, transmitted_compensation) =
            (self.reflected_compensation * own, self.transmitted_compensation * own);
        match self.rough_glass() {
            Some(glass) => {
                let (side, at) = (view.side, view.at);
                let loss = glass.loss_along(side, at, view.o);
                let reflected = glass.reflected_along(side, at, view.o);
                let transmitted = (1.0 - loss - reflected).max(0.0);
                let smooth = n.dielectric.fresnel(cos, side).0;
                let tint = smooth * (n.dielectric.color.max_element() / smooth.max_element().max(f32::MIN_POSITIVE));
                let single =
                    self.opaque(cos) * (1.0 - view.loss) + (tint * reflected + self.base * transmitted) * self.glass;
                let same = self.glass * glass.reflected_compensation[side] * loss * glass.loss[side].average * PI;
                let other = glass.loss[1 - side].average * n.index2(1 - side);
                let across = self.base * (self.glass * glass.transmitted_compensation * loss * other * PI);
                [single, reflected_compensation + n.dielectric.color * same, transmitted_compensation + across]
            }
            None => {
                let (r, t, _) = self.fresnel(cos, view.side);
                [(r + t) * (1.0 - view.loss), reflected_compensation, transmitted_compensation]
            }
        }
    }

    /// Estimated share of transmitted light in what the facets scatter, by channel.
    pub(super) fn transmitted_share(&self, view: &ViewTerms) -> Rgb {
        if !self.has_facets || self.glass == 0.0 {
            return Rgb::ZERO;
        }
        let [single, reflected, across] = self.facet_albedos(view);
        let transmitted = match self.rough_glass() {
            Some(glass) => {
                let loss = glass.loss_along(view.side, view.at, view.o);
                let kept = 1.0 - loss - glass.reflected_along(view.side, view.at, view.o);
                self.base * (kept.max(0.0) * self.glass)
            }
            None => {
                let (_, transmitted, _) = self.fresnel(self.interface.effective_cosine(view.o.z), view.side);
                transmitted * (1.0 - view.loss)
            }
        };
        let all = single + reflected + across;
        Rgb::select(all.cmpgt(Rgb::ZERO), ((transmitted + across) / all).min(Rgb::ONE), Rgb::ZERO)
    }

    /// Attenuates the estimated albedos in `view` by the cover, and adds those of the coat and the sheen.
    #[inline]
    fn cover_albedos(&self, view: &mut ViewTerms) {
        let Some(c) = &self.interface.cover else { return };
        let (coat_cos, angles) = self.angles(view.side, view.o, view.at);
        let transmittance = c.cover.transmittance(angles);
        let absorption = c.cover.mean_absorption(coat_cos);
        for albedo in &mut view.albedos {
            *albedo *= transmittance;
        }
        for share in [
            &mut view.means.facets,
            &mut view.means.reflected_compensation,
            &mut view.means.transmitted_compensation,
            &mut view.means.diffuse,
            &mut view.means.diffuse_transmitted,
            &mut view.means.straight,
        ] {
            *share *= transmittance;
        }
        if self.has_facets {
            let mut lost = Rgb::ZERO;
            for (scale, profile) in c.loss_scale.iter().zip(&c.loss_profiles) {
                lost += self.facet_average * (PI * scale * profile.average * profile.at(view.at));
            }
            view.albedos[0] += lost;
            view.means.covered_loss = mean(lost);
        }
        let [coat, mut sheen] = c.cover.albedos(coat_cos, angles);
        if let Some(absorption) = absorption {
            for albedo in &mut view.albedos {
                *albedo *= absorption;
            }
            sheen *= absorption;
        }
        (view.albedos[3], view.albedos[4]) = (coat, sheen);
        (view.means.coat, view.means.sheen) = (mean(coat), mean(sheen));
    }

    /// For each of the five sets of lobes in `ViewTerms::albedos`, whether it is in the set of lobe classes.
    #[inline]
    fn groups(&self, set: LobeSet) -> [bool; 5] {
        let coat = self.interface.cover.as_ref().is_some_and(|c| set.intersects(c.cover.coat_class));
        let broad = set.intersects(LobeSet::BROAD);
        [set.intersects(self.interface.class), broad, set.intersects(LobeSet::DELTA), coat, broad]
    }

    /// Estimated albedo of the lobes whose class is in `set`.
    #[inline]
    pub(super) fn albedo(&self, view: &ViewTerms, set: LobeSet) -> Rgb {
        let mut sum = Rgb::ZERO;
        for (albedo, counts) in view.albedos.iter().zip(self.groups(set)) {
            if counts {
                sum += *albedo;
            }
        }
        sum.min(Rgb::ONE)
    }

    /// Sampling probabilities of the lobes whose class is in `set`, except a coat over a normal map; `None` if these
    /// lobes scatter nothing.
    #[inline]
    pub(super) fn lobe_probabilities(&self, view: &ViewTerms, set: LobeSet) -> Option<LobeWeights> {
        let all = self.lobe_weights(view, set);
        let coat = if self.coat_normal.is_some() { 0.0 } else { all.coat };
        LobeWeights { coat, ..all }.normalized()
    }

    /// Estimated albedos of the lobes whose class is in `set`; zero for other lobes.
    #[inline]
    fn lobe_weights(&self, view: &ViewTerms, set: LobeSet) -> LobeWeights {
        let [facets, diffuse, straight, coat, sheen] = self.groups(set).map(|counts| f32::from(u8::from(counts)));
        let means = &view.means;
        LobeWeights {
            facets: means.facets * facets,
            reflected_compensation: means.reflected_compensation * facets,
            transmitted_compensation: means.transmitted_compensation * facets,
            covered_loss: means.covered_loss * facets,
            diffuse: means.diffuse * diffuse,
            diffuse_transmitted: means.diffuse_transmitted * diffuse,
            straight: means.straight * straight,
            coat: means.coat * coat,
            sheen: means.sheen * sheen,
        }
    }
}
