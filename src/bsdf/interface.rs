//! The part of a surface's BSDF that does not depend on its base colour. It is computed once per material, or per path
//! vertex if textures affect it.

use super::anisotropic::{AnisotropicProfile, Profiles};
use super::cover::Cover;
use super::dielectric::Dielectric;
use super::energy::{COAT_ETA, CoverLayer, EnergyTables, SideTables};
use super::film;
use super::fresnel::{is_matched, schlick};
use super::microfacet::{Ggx, lobe_class, refraction_width};
use super::profile::{Position, Profile};
use super::rough_diffuse::RoughDiffuse;
use super::{DELTA_ALPHA, LobeSet, Parameters};
use crate::math::{Rgb, Vec2, Vec3, sqr};
use bumpalo::Bump;
use std::f32::consts::FRAC_1_PI;

/// Albedo of multiple scattering between facets of average reflectance `f`, relative to a perfect reflector. `kept` is
/// the average single-scattering albedo of the perfect reflector \[Kulla and Conty 2017\].
#[inline]
pub(super) fn multiple_scattering(f: Rgb, kept: f32) -> Rgb {
    f * f * kept / (Rgb::ONE - f * (1.0 - kept))
}

/// A rough or smooth interface of a surface, with its cover (coat and sheen).
#[derive(Debug)]
pub struct Interface<'a> {
    pub(super) ggx: Ggx,
    /// Lobe class (delta, sharp or broad) of the interface's facets.
    pub(super) class: LobeSet,
    /// [`Interface::effective_cosine`] of 0, which grows with roughness.
    lift: f32,
    pub(super) thin: bool,
    /// Index of refraction below the surface over the index above.
    pub(super) eta: f32,
    /// Whether the indices are matched, so that the interface has no effect.
    pub(super) matched: bool,
    /// Rough diffuse reflection of the base; `None` if it is Lambertian.
    pub(super) rough_diffuse: Option<RoughDiffuse>,
    /// Share of the diffuse light that leaves on the other side, 0 to 1, and its colour.
    pub(super) diffuse_transmission: (f32, Rgb),
    /// Whether the interface is invisible over a base that only reflects diffusely: it does not reflect and has no cover.
    pub(super) invisible: bool,
    /// The smooth dielectric interface of the facets.
    pub(super) dielectric: Dielectric,
    /// Average reflectance of the dielectric from above, over the hemisphere.
    pub(super) average: Rgb,
    /// Albedo of multiple scattering between the facets, relative to a perfect reflector.
    pub(super) multiple_scattering: Rgb,
    /// Whether light that facets scatter more than once is lost, except in solid glass.
    pub(super) single_scattering: bool,
    /// Energy share that single scattering loses at a perfect reflector, as a function of the cosine; for anisotropic
    /// roughness a mean over azimuths.
    pub(super) loss: Profile,
    /// For anisotropic roughness: the loss as a function of the direction.
    pub(super) anisotropic_loss: Option<Profiles<'a>>,
    /// Transmittance of the interface to the diffuse base, as a function of the cosine.
    pub(super) through: Profile,
    pub(super) glass: Option<RoughGlass<'a>>,
    pub(super) cover: Option<CoverEffect>,
}

/// Energy compensation of solid rough glass. Arrays are by side: 0 above, 1 below.
#[derive(Debug)]
pub(super) struct RoughGlass<'a> {
    /// Energy share that single scattering loses on each side, as a mean over azimuths.
    pub loss: [Profile; 2],
    /// For anisotropic roughness: the loss and the albedo of reflection on each side, as functions of the direction.
    anisotropic: Option<[Profiles<'a>; 2]>,
    /// Albedo of reflection on each side for isotropic roughness, as a function of the cosine.
    reflected: [Profile; 2],
    /// Factor of the compensating reflected lobe `reflected_compensation[side] * loss(o) * loss(i)`.
    pub reflected_compensation: [f32; 2],
    /// Factor of the compensating transmitted lobe, over the squared index of the side transmitted to (1 above). Equal
    /// from both sides.
    pub transmitted_compensation: f32,
}

/// A cover (coat and sheen) and its effect on the lobes below. `loss_scale` and `loss_profiles` are for coat and sheen.
#[derive(Clone, Copy, Debug)]
pub(super) struct CoverEffect {
    pub cover: Cover,
    /// Normalization factor of the diffuse lobe below the cover: the average of the profile `through` over the average
    /// of the profile times the transmittance.
    pub through: f32,
    /// Normalization factor of the energy compensation below the cover, with the profile `loss`.
    pub loss: f32,
    /// Normalization factors of the energy compensation of glass below the cover, by side.
    pub glass_loss: [f32; 2],
    /// Factors of the energy that facets of average reflectance r lose below each layer. The lobe that returns it is
    /// `r * loss_scale * profile(o) * profile(i)`; its albedo is `pi * average * r * loss_scale * profile(o)`.
    pub loss_scale: [f32; 2],
    pub loss_profiles: [Profile; 2],
}

impl<'a> Interface<'a> {
    /// The interface that the parameters of a BSDF describe. Their base colour does not matter.
    pub fn new(p: &Parameters, tables: &EnergyTables) -> Interface<'a> {
        Interface::with(p, tables, |profiles| Profiles::Owned(profiles.into()))
    }

    /// The interface that the parameters of a BSDF describe, allocated in `arena`, which runs no destructors.
    #[inline]
    pub fn new_in(p: &Parameters, tables: &EnergyTables, arena: &'a Bump) -> &'a Interface<'a> {
        arena.alloc_with(|| Interface::with(p, tables, |profiles| Profiles::InArena(arena.alloc_slice_copy(profiles))))
    }

    #[inline]
    fn with(
        p: &Parameters,
        tables: &EnergyTables,
        keep: impl Fn(&[AnisotropicProfile]) -> Profiles<'a>,
    ) -> Interface<'a> {
        let bends = p.transmission * (1.0 - p.metallic) > 0.0 && !p.thin;
        let mut class = lobe_class(p.alpha_x, p.alpha_y);
        // With nearly matched indices, transmitted lobes are narrow even at rough surfaces.
        if bends && class == LobeSet::BROAD {
            let width = refraction_width(p.eta);
            class = lobe_class((p.alpha_x * width).max(DELTA_ALPHA), (p.alpha_y * width).max(DELTA_ALPHA));
        }
        // A lobe that is below the limit along one axis only is widened there and sampled as a lobe.
        let ggx = Ggx { alpha_x: p.alpha_x.max(DELTA_ALPHA), alpha_y: p.alpha_y.max(DELTA_ALPHA) };
        let rough = class != LobeSet::DELTA;
        // The transmittance to the base is from isotropic tables, at the roughness with the same mean square slope.
        let mean_square = 0.5 * (sqr(ggx.alpha_x) + sqr(ggx.alpha_y));
        let alpha = Position::new(if rough { mean_square.sqrt() } else { 0.0 });
        let dielectric = Dielectric::new(p);
        let Dielectric { f0, f90, .. } = dielectric;
        let filmed = dielectric.film.is_some();
        // A film reflects between matched indices, too.
        let table_eta = if filmed && is_matched(p.eta) { COAT_ETA } else { p.eta };
        let sides = tables.sides(table_eta);
        let average = sides.map_or(Rgb::ZERO, |[above, _]| {
            let of = |f0: f32| above.average_reflectance(f0, f90);
            if filmed { dielectric.average() } else { Rgb::new(of(f0.x), of(f0.y), of(f0.z)) * dielectric.color }
        });
        let all_glass = bends && p.metallic == 0.0 && p.transmission == 1.0;
        let stretched = (rough && ggx.alpha_x != ggx.alpha_y && !all_glass)
            .then(|| tables.anisotropic_white_loss([ggx.alpha_x, ggx.alpha_y].map(Position::new)))
            .flatten();
        let loss = match &stretched {
            Some(loss) => loss.mean(),
            None if rough => tables.white_loss(alpha),
            None => Profile::constant(0.0),
        };
        let multiple_scattering = match rough && !p.single_scattering {
            true => multiple_scattering(average, 1.0 - loss.average),
            false => Rgb::ZERO,
        };
        let f0_max = if filmed { dielectric.upper_f0(table_eta) } else { f0.max_element() };
        let through = match sides {
            Some([above, _]) => above.base_transmittance(alpha, f0_max, f90, multiple_scattering.max_element()),
            None => Profile::constant(1.0),
        };
        let matched = is_matched(p.eta) && !filmed;
        let glass = match sides {
            Some(sides) if bends && rough => {
                let mean = average.element_sum() / 3.0;
                let f0 = if filmed { sides[0].f0_of_average(mean, f90) } else { f0_max };
                Some(RoughGlass::new(&ggx, alpha, sides, p.eta, f0, f90, &keep))
            }
            _ => None,
        };
        let mut interface = Interface {
            ggx,
            class,
            lift: if rough { 0.6 * (ggx.alpha_x * ggx.alpha_y).sqrt().min(1.0) } else { 0.0 },
            thin: p.thin,
            eta: p.eta,
            matched,
            rough_diffuse: None,
            diffuse_transmission: (p.diffuse_transmission, p.diffuse_transmission_color),
            invisible: (p.specular == 0.0 || matched)
                && !p.is_covered()
                && p.diffuse_transmission == 0.0
                && p.diffuse_roughness == 0.0,
            dielectric,
            average,
            multiple_scattering,
            single_scattering: p.single_scattering,
            loss,
            anisotropic_loss: stretched.map(|loss| keep(&[loss])),
            through,
            glass,
            cover: None,
        };
        interface.cover = Cover::new(p, tables).map(|cover| CoverEffect::new(cover, p, alpha, &interface, tables));
        if p.diffuse_roughness > 0.0 {
            let cover = |mu: Position| interface.cover.as_ref().map_or(1.0, |c| c.cover.transmittance(mu.into()));
            let through = std::array::from_fn(|i| interface.through.nodes()[i] * cover(Position::of_node(i)));
            interface.rough_diffuse = Some(RoughDiffuse::new(p.diffuse_roughness, &Profile::from_nodes(through)));
        }
        interface
    }

    /// Squared index of refraction of a side of the interface (0 above, 1 below), relative to the index above.
    #[inline]
    pub(super) fn index2(&self, side: usize) -> f32 {
        if side == 0 { 1.0 } else { sqr(self.eta) }
    }

    /// The cosine at which the smooth interface reflects about as much as the rough one does at `mu`.
    #[inline]
    pub(super) fn effective_cosine(&self, mu: f32) -> f32 {
        mu + (1.0 - mu) * self.lift
    }

    /// Energy share that single scattering loses at a perfect reflector along `w`; `at` is the table position of its
    /// cosine.
    #[inline]
    pub(super) fn loss_along(&self, at: Position, w: Vec3) -> f32 {
        match &self.anisotropic_loss {
            None => self.loss.at(at),
            Some(loss) => loss[0].at(at, w),
        }
    }

    /// [`Interface::loss_along`], and the density per solid angle with which [`Interface::sample_loss`] draws `w`.
    #[inline]
    pub(super) fn loss_with_pdf_w(&self, at: Position, w: Vec3) -> (f32, f32) {
        match &self.anisotropic_loss {
            None => self.loss.at_with_pdf_w(at, w.z.abs()),
            Some(loss) => (loss[0].at(at, w), loss[0].pdf_w(at, w)),
        }
    }

    /// Samples a direction of the upper hemisphere in proportion to the energy that single scattering loses at a perfect
    /// reflector; `None` if it loses none.
    #[inline]
    pub(super) fn sample_loss(&self, u: Vec2) -> Option<Vec3> {
        match &self.anisotropic_loss {
            None => self.loss.sample(u),
            Some(loss) => loss[0].sample(u),
        }
    }

    /// Reflectance of a facet of metal of colour `f0`.
    #[inline]
    pub(super) fn metal(&self, f0: Rgb, cos: f32) -> Rgb {
        match &self.dielectric.film {
            None => schlick(f0, cos),
            Some((film, _)) => film.over_metal(f0, cos),
        }
    }

    /// Average reflectance of smooth metal of colour `f0` over the hemisphere.
    #[inline]
    pub(super) fn metal_average(&self, f0: Rgb) -> Rgb {
        match &self.dielectric.film {
            None => f0 + (Rgb::ONE - f0) * (1.0 / 21.0),
            Some((film, _)) => film::average(|cos| film.over_metal(f0, cos)),
        }
    }
}

impl<'a> RoughGlass<'a> {
    /// Builds the energy compensation of glass. `alpha` is the isotropic equivalent of `ggx`. `keep` stores the
    /// anisotropic functions of both sides.
    fn new(
        ggx: &Ggx,
        alpha: Position,
        sides: [&SideTables; 2],
        eta: f32,
        f0: f32,
        f90: f32,
        keep: &impl Fn(&[AnisotropicProfile]) -> Profiles<'a>,
    ) -> RoughGlass<'a> {
        let alphas = [ggx.alpha_x, ggx.alpha_y].map(Position::new);
        let anisotropic = (ggx.alpha_x != ggx.alpha_y).then(|| {
            let loss = keep(&sides.map(|s| s.anisotropic_glass_loss(alphas, f0, f90)));
            [loss, keep(&sides.map(|s| s.anisotropic_reflection(alphas, f0, f90)))]
        });
        let loss = match &anisotropic {
            Some([loss, _]) => [loss[0].mean(), loss[1].mean()],
            None => sides.map(|s| s.glass_loss(alpha, f0, f90)),
        };
        // A share x_s of the loss on side s is transmitted. Reciprocity requires x_s = k n^2 a, with the index n and
        // the average loss a of the other side. The factor k is the largest one that keeps both shares at most equal to
        // the average transmittance of the smooth interface, which is itself proportional to n^2.
        let transmitted = sides.map(|s| 1.0 - s.average_reflectance(f0, f90));
        let averages = loss.each_ref().map(|l| l.average);
        let k = (transmitted[0] / sqr(eta)).min(transmitted[1]) / averages[0].max(averages[1]).max(1e-9);
        let index2 = [1.0, sqr(eta)];
        let reflected_compensation = [0, 1].map(|side: usize| {
            let transmitted = k * index2[1 - side] * averages[1 - side];
            (1.0 - transmitted) * FRAC_1_PI / averages[side].max(1e-9)
        });
        let reflected = sides.map(|s| s.reflection(alpha, f0, f90));
        RoughGlass { loss, anisotropic, reflected, reflected_compensation, transmitted_compensation: k * FRAC_1_PI }
    }

    /// Energy share lost by single scattering at the direction `w` on a side; `at` is the table position of its cosine.
    #[inline]
    pub fn loss_along(&self, side: usize, at: Position, w: Vec3) -> f32 {
        match &self.anisotropic {
            None => self.loss[side].at(at),
            Some([loss, _]) => loss[side].at(at, w),
        }
    }

    /// Albedo of reflection at the direction `w` on a side; `at` is the table position of its cosine.
    #[inline]
    pub fn reflected_along(&self, side: usize, at: Position, w: Vec3) -> f32 {
        match &self.anisotropic {
            None => self.reflected[side].at(at),
            Some([_, reflected]) => reflected[side].at(at, w),
        }
    }

    /// Energy share lost by single scattering at the direction `w`, and the density per solid angle with which
    /// [`RoughGlass::sample`] draws it.
    #[inline]
    pub fn loss_with_pdf_w(&self, side: usize, at: Position, w: Vec3) -> (f32, f32) {
        match &self.anisotropic {
            None => self.loss[side].at_with_pdf_w(at, w.z.abs()),
            Some([loss, _]) => (loss[side].at(at, w), loss[side].pdf_w(at, w)),
        }
    }

    /// Samples a direction of the upper hemisphere in proportion to the energy that single scattering loses on a side;
    /// `None` if it loses none.
    #[inline]
    pub fn sample(&self, side: usize, u: Vec2) -> Option<Vec3> {
        match &self.anisotropic {
            None => self.loss[side].sample(u),
            Some([loss, _]) => loss[side].sample(u),
        }
    }
}

impl CoverEffect {
    fn new(cover: Cover, p: &Parameters, alpha: Position, below: &Interface<'_>, tables: &EnergyTables) -> CoverEffect {
        let norm = |profile: &Profile| match profile.average {
            average if average > 1e-9 => average / profile.average_with(|mu| cover.transmittance(mu.into())).max(1e-9),
            _ => 1.0,
        };
        let strengths = cover.strengths();
        let loss_profiles = [
            (CoverLayer::Coat(p.clearcoat_eta), p.clearcoat_alpha, 0),
            (CoverLayer::Sheen(p.sheen_model), p.sheen_alpha, 1),
        ]
        .map(|(layer, cover_alpha, k): (_, _, usize)| match strengths[k] {
            0.0 => Profile::constant(0.0),
            _ => tables.covered_loss(layer, alpha, cover_alpha),
        });
        let scale = |k: usize| strengths[k] * FRAC_1_PI / loss_profiles[k].average.max(1e-9);
        let rough = below.class != LobeSet::DELTA;
        CoverEffect {
            through: norm(&below.through),
            loss: norm(&below.loss),
            glass_loss: below.glass.as_ref().map_or([1.0; 2], |g| [norm(&g.loss[0]), norm(&g.loss[1])]),
            loss_scale: if rough { [scale(0), scale(1)] } else { [0.0; 2] },
            loss_profiles,
            cover,
        }
    }
}
