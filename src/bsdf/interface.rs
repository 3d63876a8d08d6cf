//! What of a surface's scattering does not depend on its colours: made once for a material without textures on it, else
//! per vertex.

use super::cover::Cover;
use super::energy::{Covering, EnergyTables, SideTables};
use super::fresnel::{Smooth, is_matched, normal_incidence};
use super::microfacet::{Ggx, class_of, refraction_width};
use super::profile::{Position, Profile};
use super::stretched::{Sides, Stretched};
use super::{DELTA_ALPHA, LobeSet, Parameters};
use crate::math::{Rgb, Vec2, Vec3, sqr};
use bumpalo::Bump;
use std::f32::consts::FRAC_1_PI;

/// Reflection of light that facets of reflectance `f` scatter more than once, as a share of what a perfect reflector's
/// lose; `kept` is the share that those reflect at once \[Kulla and Conty 2017\].
#[inline]
pub(super) fn again(f: Rgb, kept: f32) -> Rgb {
    f * f * kept / (Rgb::ONE - f * (1.0 - kept))
}

/// A rough or smooth interface with whatever lies on it.
#[derive(Debug)]
pub struct Interface<'a> {
    pub(super) ggx: Ggx,
    pub(super) class: LobeSet,
    /// One over the widest change that roughness makes to the cosine at a facet: see [`Interface::effective_cosine`].
    lift: f32,
    pub(super) thin: bool,
    /// Index of refraction below over above.
    pub(super) eta: f32,
    /// It bends and reflects nothing.
    pub(super) matched: bool,
    /// Over a diffuse base it adds nothing.
    pub(super) bare: bool,
    /// The dielectric from above and from below.
    pub(super) smooth: [Smooth; 2],
    /// Reflectance of the dielectric at normal and grazing incidence.
    pub(super) f0: Rgb,
    pub(super) f90: f32,
    /// Average reflectance of the dielectric from above, and of light that facets then scatter more than once.
    pub(super) average: Rgb,
    pub(super) again: Rgb,
    /// What single scattering between facets of a perfect reflector loses.
    pub(super) loss: Profile,
    /// What the interface lets in to the diffuse base.
    pub(super) through: Profile,
    pub(super) glass: Option<RoughGlass<'a>>,
    pub(super) cover: Option<Covered>,
}

/// Compensation for solid glass, by side: 0 above, 1 below.
#[derive(Debug)]
pub(super) struct RoughGlass<'a> {
    /// What is lost: the mean over azimuths.
    pub loss: [Profile; 2],
    /// Where facets are wider one way: what is lost, and the albedo of the reflecting facets.
    stretched: Option<[Sides<'a>; 2]>,
    /// Albedo of the reflecting facets, if they are not.
    reflected: [Profile; 2],
    /// Reflected compensation: `returned[side] * loss(o) * loss(i)`.
    pub returned: [f32; 2],
    /// Transmitted compensation over the squared index of the side transmitted to (with 1 above): the same from both
    /// sides.
    pub passed: f32,
}

/// A covering, and what it does to the lobes below.
#[derive(Clone, Copy, Debug)]
pub(super) struct Covered {
    pub cover: Cover,
    /// Normalisation of separable lobes below: average profile over average of the profile times what passes, for the
    /// profiles `through`, `loss` and those of glass.
    pub through: f32,
    pub loss: f32,
    pub glass_loss: [f32; 2],
    /// What facets of average reflectance r lose below coat and sheen: `r * below[k] * profile(o) * profile(i)`, with
    /// albedo `pi * average * r * below * profile(o)`.
    pub below: [f32; 2],
    pub profiles: [Profile; 2],
}

impl<'a> Interface<'a> {
    /// The interface that `parameters` speak of, whatever their colours.
    pub fn new(p: &Parameters, tables: &EnergyTables) -> Interface<'a> {
        Interface::with(p, tables, |sides| Sides::Own(Box::new(sides)))
    }

    /// The same for one vertex; what is large is kept in `arena`, which runs no destructors.
    #[inline]
    pub fn new_in(p: &Parameters, tables: &EnergyTables, arena: &'a Bump) -> &'a Interface<'a> {
        arena.alloc_with(|| Interface::with(p, tables, |sides| Sides::Lent(arena.alloc(sides))))
    }

    #[inline]
    fn with(p: &Parameters, tables: &EnergyTables, keep: impl Fn([Stretched; 2]) -> Sides<'a>) -> Interface<'a> {
        let bends = p.transmission * (1.0 - p.metallic) > 0.0 && !p.thin;
        let mut class = class_of(p.alpha_x, p.alpha_y);
        // What is let through of nearly matching indices is narrow, however rough the surface.
        if bends && class == LobeSet::BROAD {
            let width = refraction_width(p.eta);
            class = class_of((p.alpha_x * width).max(DELTA_ALPHA), (p.alpha_y * width).max(DELTA_ALPHA));
        }
        // A lobe that is narrow along one axis only is still sampled as a lobe.
        let ggx = Ggx { alpha_x: p.alpha_x.max(DELTA_ALPHA), alpha_y: p.alpha_y.max(DELTA_ALPHA) };
        let rough = class != LobeSet::DELTA;
        // All tables but those of glass are isotropic: a stretched lobe takes what one of the same mean square slope
        // loses. At normal incidence that is right within 3 %; at grazing angles a metal stretched fourfold is off by up
        // to -18 % across and +6 % along.
        let mean_square = 0.5 * (sqr(ggx.alpha_x) + sqr(ggx.alpha_y));
        let alpha = Position::new(if rough { mean_square.sqrt() } else { 0.0 });
        let sides = tables.sides(p.eta);
        let (f0, f90) = match sides {
            Some(_) => ((p.specular_color * normal_incidence(p.eta)).min(Rgb::ONE) * p.specular, p.specular),
            None => (Rgb::ZERO, 0.0),
        };
        let average = sides.map_or(Rgb::ZERO, |[above, _]| {
            let of = |f0: f32| above.average_reflectance(f0, f90);
            Rgb::new(of(f0.x), of(f0.y), of(f0.z))
        });
        let loss = if rough { tables.white_loss(alpha) } else { Profile::constant(0.0) };
        let again = if rough { again(average, 1.0 - loss.average) } else { Rgb::ZERO };
        let f0_max = f0.max_element();
        let through = match sides {
            Some([above, _]) => above.let_through(alpha, f0_max, f90, again.max_element()),
            None => Profile::constant(1.0),
        };
        let matched = is_matched(p.eta);
        let glass = match sides {
            Some(sides) if bends && rough => Some(RoughGlass::new(&ggx, alpha, sides, (p.eta, f0_max, f90), keep)),
            _ => None,
        };
        let mut interface = Interface {
            ggx,
            class,
            lift: if rough { 0.6 * (ggx.alpha_x * ggx.alpha_y).sqrt().min(1.0) } else { 0.0 },
            thin: p.thin,
            eta: p.eta,
            matched,
            bare: (p.specular == 0.0 || matched) && !p.is_covered(),
            smooth: [Smooth::new(p.eta), Smooth::new(if p.thin { p.eta } else { 1.0 / p.eta })],
            f0,
            f90,
            average,
            again,
            loss,
            through,
            glass,
            cover: None,
        };
        interface.cover = Cover::new(p, tables).map(|cover| Covered::new(cover, p, alpha, &interface, tables));
        interface
    }

    /// Squared index of refraction of a side: 0 above (index 1), 1 below.
    #[inline]
    pub(super) fn index2(&self, side: usize) -> f32 {
        if side == 0 { 1.0 } else { sqr(self.eta) }
    }

    /// A cosine at which the smooth interface reflects about as much as the rough one does at `mu`.
    #[inline]
    pub(super) fn effective_cosine(&self, mu: f32) -> f32 {
        mu + (1.0 - mu) * self.lift
    }

    /// Reflectance of the dielectric at a facet, what it lets through, and the cosine of the refracted ray.
    #[inline]
    pub(super) fn dielectric(&self, cos: f32, side: usize) -> (Rgb, f32, f32) {
        match self.smooth[side].grazing_weight(cos) {
            None => (Rgb::ONE, 0.0, 0.0),
            Some((grazing, cos_t)) => {
                let f = self.f0 + (Rgb::splat(self.f90) - self.f0) * grazing;
                (f, (1.0 - f.max_element()).max(0.0), cos_t)
            }
        }
    }
}

impl<'a> RoughGlass<'a> {
    /// `alpha` is the mean one of `ggx`.
    fn new(
        ggx: &Ggx,
        alpha: Position,
        sides: [&SideTables; 2],
        (eta, f0, f90): (f32, f32, f32),
        keep: impl Fn([Stretched; 2]) -> Sides<'a>,
    ) -> RoughGlass<'a> {
        let alphas = [ggx.alpha_x, ggx.alpha_y].map(Position::new);
        let stretched = (ggx.alpha_x != ggx.alpha_y).then(|| {
            let loss = keep(sides.map(|s| s.stretched_glass_loss(alphas, f0, f90)));
            [loss, keep(sides.map(|s| s.stretched_reflection(alphas, f0, f90)))]
        });
        let loss = match &stretched {
            Some([loss, _]) => [loss[0].mean(), loss[1].mean()],
            None => sides.map(|s| s.glass_loss(alpha, f0, f90)),
        };
        // Of what is lost from side s the share x_s passes. Reciprocity asks for x_s = k n^2 average, n and average
        // those of the other side; k makes no share larger than the average transmittance of the smooth interface,
        // which is in proportion to n^2 already.
        let transmitted = sides.map(|s| 1.0 - s.average_reflectance(f0, f90));
        let averages = loss.each_ref().map(|l| l.average);
        let k = (transmitted[0] / sqr(eta)).min(transmitted[1]) / averages[0].max(averages[1]).max(1e-9);
        let index2 = [1.0, sqr(eta)];
        let returned = [0, 1].map(|side: usize| {
            let passes = k * index2[1 - side] * averages[1 - side];
            (1.0 - passes) * FRAC_1_PI / averages[side].max(1e-9)
        });
        let reflected = sides.map(|s| s.reflection(alpha, f0, f90));
        RoughGlass { loss, stretched, reflected, returned, passed: k * FRAC_1_PI }
    }

    /// What is lost of light along `w` on a side; `at` is the position of its cosine.
    #[inline]
    pub fn loss_along(&self, side: usize, at: Position, w: Vec3) -> f32 {
        match &self.stretched {
            None => self.loss[side].at(at),
            Some([loss, _]) => loss[side].at(at, w),
        }
    }

    /// Albedo of the reflecting facets along `w`.
    #[inline]
    pub fn reflected_along(&self, side: usize, at: Position, w: Vec3) -> f32 {
        match &self.stretched {
            None => self.reflected[side].at(at),
            Some([_, reflected]) => reflected[side].at(at, w),
        }
    }

    /// What is lost along `w`, and the density per solid angle with which [`RoughGlass::sample`] draws `w`.
    #[inline]
    pub fn loss_with_pdf_w(&self, side: usize, at: Position, w: Vec3) -> (f32, f32) {
        match &self.stretched {
            None => self.loss[side].at_with_pdf_w(at, w.z.abs()),
            Some([loss, _]) => (loss[side].at(at, w), loss[side].pdf_w(at, w)),
        }
    }

    /// A direction of the upper hemisphere in which light is lost on a side.
    #[inline]
    pub fn sample(&self, side: usize, u: Vec2) -> Option<Vec3> {
        match &self.stretched {
            None => self.loss[side].sample(u),
            Some([loss, _]) => loss[side].sample(u),
        }
    }
}

impl Covered {
    fn new(cover: Cover, p: &Parameters, alpha: Position, below: &Interface<'_>, tables: &EnergyTables) -> Covered {
        let norm = |profile: &Profile| match profile.average {
            average if average > 1e-9 => average / profile.average_with(|mu| cover.passes(mu.into())).max(1e-9),
            _ => 1.0,
        };
        let strengths = cover.strengths();
        let profiles = [(Covering::Coat, p.clearcoat_alpha, 0), (Covering::Sheen, p.sheen_alpha, 1)].map(
            |(covering, cover_alpha, k): (_, _, usize)| match strengths[k] {
                0.0 => Profile::constant(0.0),
                _ => tables.covered_loss(covering, alpha, cover_alpha),
            },
        );
        let scale = |k: usize| strengths[k] * FRAC_1_PI / profiles[k].average.max(1e-9);
        let rough = below.class != LobeSet::DELTA;
        Covered {
            through: norm(&below.through),
            loss: norm(&below.loss),
            glass_loss: below.glass.as_ref().map_or([1.0; 2], |g| [norm(&g.loss[0]), norm(&g.loss[1])]),
            below: if rough { [scale(0), scale(1)] } else { [0.0; 2] },
            profiles,
            cover,
        }
    }
}
