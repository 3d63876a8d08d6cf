//! glTF's metallic-roughness model: metal, and a dielectric over a diffuse or transmitting base, sharing one rough interface.
//!
//! Everything is a mixture of three surfaces, each reciprocal and free of loss for a white base:
//! - *metal*: GGX with Schlick's Fresnel term;
//! - *matte*: a rough dielectric interface over a diffuse base, coupled as in \[Kelemen and Szirmay-Kalos 2001\]: diffuse light
//!   is what the interface lets in, (1 - E(o)) (1 - E(i)) / (pi (1 - E_avg)). Both sides of the surface look like its front;
//! - *glass*: a rough dielectric interface between two media \[Walter 2007\], or two equal ones (a thin wall, whose transmitted lobe is the
//!   mirror image of the reflected one).
//!
//! What single scattering between facets loses is given back by a separable lobe, for glass on both sides in the ratio
//! that keeps it reciprocal \[Kulla and Conty 2017\]. The lobe belongs to the class of the lobe it completes.

use super::cover::Cover;
use super::energy::{Covering, EnergyTables, SideTables};
use super::fresnel::{grazing_weight, is_matched, normal_incidence, schlick};
use super::microfacet::Ggx;
use super::profile::{Position, Profile};
use super::{DELTA_ALPHA, LobeSet, Parameters, SHARP_ALPHA};
use crate::math::{Rgb, Vec3, sqr};
use std::f32::consts::{FRAC_1_PI, PI};

/// Directions nearer to the surface than this (cosine) are in it: nothing comes from there. Below it, products of cosines underflow.
pub(super) const LEAST_COSINE: f32 = 1e-6;

/// Mean of the channels: what lobes are chosen by.
#[inline]
pub(super) fn mean(c: Rgb) -> f32 {
    c.element_sum() * (1.0 / 3.0)
}

/// Class of a GGX lobe.
#[inline]
pub(super) fn class_of(alpha_x: f32, alpha_y: f32) -> LobeSet {
    let widest = alpha_x.max(alpha_y);
    if widest < DELTA_ALPHA {
        LobeSet::DELTA
    } else if (alpha_x * alpha_y).sqrt() < SHARP_ALPHA {
        LobeSet::SHARP
    } else {
        LobeSet::BROAD
    }
}

/// Shares of the lobes among the directions drawn for one `wo` and one set of classes; they sum to 1.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shares {
    /// Facets: reflected or transmitted, as Fresnel says at the facet drawn.
    pub(super) facets: f32,
    /// Compensation on the side of `wo`.
    pub(super) returned: f32,
    /// Compensation on the other side.
    pub(super) passed: f32,
    /// Diffuse reflection.
    pub(super) diffuse: f32,
    /// Straight through an index-matched boundary.
    pub(super) straight: f32,
    /// What facets lose below a covering, on the side of `wo`.
    pub(super) below: f32,
    /// Clear coat.
    pub(super) coat: f32,
    /// Sheen.
    pub(super) sheen: f32,
}

impl Shares {
    #[inline]
    fn new(albedos: [Rgb; 8]) -> Shares {
        let [facets, returned, passed, diffuse, straight, below, coat, sheen] = albedos.map(mean);
        Shares { facets, returned, passed, diffuse, straight, below, coat, sheen }
    }

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

/// See the module's documentation.
#[derive(Clone, Copy, Debug)]
pub struct Layered<'a> {
    pub(super) ggx: Ggx,
    pub(super) class: LobeSet,
    pub(super) thin: bool,
    pub(super) has_facets: bool,
    pub(super) base: Rgb,
    pub(super) metal: f32,
    pub(super) matte: f32,
    pub(super) glass: f32,
    /// Index of refraction below over above.
    pub(super) eta: f32,
    /// Reflectance of the dielectric at normal and grazing incidence.
    pub(super) f0: Rgb,
    pub(super) f90: f32,
    /// Weight of the straight lobe.
    pub(super) straight: Rgb,
    /// Diffuse: `diffuse * through(o) * through(i)`; `diffuse_albedo * through(o)` is its albedo.
    pub(super) diffuse: Rgb,
    pub(super) diffuse_albedo: Rgb,
    pub(super) through: Profile<'a>,
    /// Compensation for reflecting facets: `returned * loss(o) * loss(i)`, and for thin walls `passed` likewise on the other side;
    /// times pi times the average of `loss` they are albedos.
    pub(super) loss: Profile<'a>,
    pub(super) returned: Rgb,
    pub(super) passed: Rgb,
    /// Compensation for solid glass, by side: what is lost from above and from below.
    pub(super) glass_loss: [Profile<'a>; 2],
    /// Albedo of its reflecting facets, by side.
    pub(super) glass_reflected: [Profile<'a>; 2],
    /// Reflected compensation: `glass_returned[side] * loss(o) * loss(i)`.
    pub(super) glass_returned: [f32; 2],
    /// Transmitted compensation over the squared index of the side transmitted to (with 1 above): the same from both sides.
    pub(super) glass_passed: Rgb,
    pub(super) cover: Option<Covered<'a>>,
}

/// A covering, and what it does to the lobes below.
#[derive(Clone, Copy, Debug)]
pub(super) struct Covered<'a> {
    pub(super) cover: Cover<'a>,
    /// Normalisation of separable lobes below: average profile over average of the profile times what passes, for the profiles `through`,
    /// `loss` and `glass_loss`.
    pub(super) through: f32,
    pub(super) loss: f32,
    pub(super) glass_loss: [f32; 2],
    /// What facets lose below coat and sheen: `below[k] * profile(o) * profile(i)`, with albedo `pi * average * below * profile(o)`.
    pub(super) below: [Rgb; 2],
    pub(super) profiles: [Profile<'a>; 2],
}

impl<'a> Layered<'a> {
    #[inline]
    pub(super) fn new(p: &Parameters, tables: &'a EnergyTables) -> Layered<'a> {
        let class = class_of(p.alpha_x, p.alpha_y);
        // A lobe that is narrow along one axis only is still sampled as a lobe.
        let ggx = Ggx { alpha_x: p.alpha_x.max(DELTA_ALPHA), alpha_y: p.alpha_y.max(DELTA_ALPHA) };
        let rough = class != LobeSet::DELTA;
        // The tables are isotropic: a stretched lobe takes what one of the same mean square slope loses. At normal incidence that
        // is right within 3 %; at grazing angles a metal stretched fourfold is off by up to -18 % across and +6 % along.
        let mean_square = 0.5 * (sqr(ggx.alpha_x) + sqr(ggx.alpha_y));
        let alpha = Position::new(if rough { mean_square.sqrt() } else { 0.0 });
        let metal = p.metallic;
        let glass = (1.0 - metal) * p.transmission;
        let matte = (1.0 - metal) * (1.0 - p.transmission);
        let base = p.base_color;
        let sides = tables.sides(p.eta);
        let (f0, f90) = match sides {
            Some(_) => ((p.specular_color * normal_incidence(p.eta)).min(Rgb::ONE) * p.specular, p.specular),
            None => (Rgb::ZERO, 0.0),
        };
        let matched = is_matched(p.eta);
        let nothing = Profile::constant(0.0);
        let mut b = Layered {
            ggx,
            class,
            thin: p.thin,
            has_facets: metal > 0.0 || (!matched && (glass > 0.0 || (matte > 0.0 && p.specular > 0.0))),
            base,
            metal,
            matte,
            glass: if matched { 0.0 } else { glass },
            eta: p.eta,
            f0,
            f90,
            straight: if matched { base * glass } else { Rgb::ZERO },
            diffuse: Rgb::ZERO,
            diffuse_albedo: Rgb::ZERO,
            through: nothing,
            loss: if rough { tables.white_loss(alpha) } else { nothing },
            returned: Rgb::ZERO,
            passed: Rgb::ZERO,
            glass_loss: [nothing; 2],
            glass_reflected: [nothing; 2],
            glass_returned: [0.0; 2],
            glass_passed: Rgb::ZERO,
            cover: None,
        };
        // Average reflectances of the dielectric from above.
        let average = sides.map_or(Rgb::ZERO, |[above, _]| {
            let of = |f0: f32| above.average_reflectance(f0, f90);
            Rgb::new(of(f0.x), of(f0.y), of(f0.z))
        });
        // Reflection of light that facets scatter more than once [Kulla and Conty 2017], as a share of what is lost.
        let kept = 1.0 - b.loss.average;
        let again = |f: Rgb| f * f * kept / (Rgb::ONE - f * (1.0 - kept));
        let metal_average = base + (Rgb::ONE - base) * (1.0 / 21.0);
        if rough {
            let scale = FRAC_1_PI / b.loss.average.max(1e-9);
            b.returned = (again(metal_average) * metal + again(average) * matte) * scale;
            if p.thin {
                b.returned += average * (b.glass * scale);
                b.passed = base * ((1.0 - average.max_element()) * b.glass * scale);
            }
        }
        let f0_max = f0.max_element();
        if matte > 0.0 && base.max_element() > 0.0 {
            let multiple = if rough { again(average).max_element() } else { 0.0 };
            b.through =
                sides.map_or(Profile::constant(1.0), |[above, _]| above.let_through(alpha, f0_max, f90, multiple));
            b.diffuse_albedo = base * matte;
            b.diffuse = b.diffuse_albedo * (FRAC_1_PI / b.through.average.max(1e-9));
        }
        if let (true, true, false, Some(sides)) = (b.glass > 0.0, rough, p.thin, sides) {
            b.compensate_glass(alpha, sides);
        }
        if let Some(cover) = Cover::new(p, tables) {
            let reflected = metal_average * metal + average * (1.0 - metal);
            b.cover_with(cover, p, alpha, if rough { reflected } else { Rgb::ZERO }, tables);
        }
        b
    }

    fn compensate_glass(&mut self, alpha: Position, sides: [&'a SideTables; 2]) {
        let (f0, f90) = (self.f0.max_element(), self.f90);
        self.glass_loss = sides.map(|s| s.glass_loss(alpha, f0, f90));
        self.glass_reflected = sides.map(|s| s.reflection(alpha, f0, f90));
        // Of what is lost from side s the share x_s passes. Reciprocity asks for x_s = k n^2 average, n and average those of the other side;
        // k makes no share larger than the average transmittance of the smooth interface, which is in proportion to n^2 already.
        let transmitted = sides.map(|s| 1.0 - s.average_reflectance(f0, f90));
        let averages = self.glass_loss.map(|l| l.average);
        let k = (transmitted[0] / sqr(self.eta)).min(transmitted[1]) / averages[0].max(averages[1]).max(1e-9);
        for side in 0..2 {
            let passes = k * self.index2(1 - side) * averages[1 - side];
            self.glass_returned[side] = self.glass * (1.0 - passes) * FRAC_1_PI / averages[side].max(1e-9);
        }
        self.glass_passed = self.base * (self.glass * k * FRAC_1_PI);
    }

    /// Puts `cover` on top; `reflected` is the average reflectance of the facets.
    fn cover_with(
        &mut self,
        cover: Cover<'a>,
        p: &Parameters,
        alpha: Position,
        reflected: Rgb,
        tables: &'a EnergyTables,
    ) {
        let norm = |profile: &Profile| match profile.average {
            average if average > 1e-9 => average / profile.average_with(|mu| cover.passes(mu)).max(1e-9),
            _ => 1.0,
        };
        let profiles = [(Covering::Coat, p.clearcoat_alpha), (Covering::Sheen, p.sheen_alpha)]
            .map(|(covering, cover_alpha)| tables.covered_loss(covering, alpha, cover_alpha));
        let strengths = cover.strengths();
        let below = [0, 1].map(|k| reflected * (strengths[k] * FRAC_1_PI / profiles[k].average.max(1e-9)));
        self.cover = Some(Covered {
            cover,
            through: norm(&self.through),
            loss: norm(&self.loss),
            glass_loss: [norm(&self.glass_loss[0]), norm(&self.glass_loss[1])],
            below,
            profiles,
        });
    }

    /// Squared index of refraction of a side: 0 above (index 1), 1 below.
    #[inline]
    pub(super) fn index2(&self, side: usize) -> f32 {
        if side == 0 { 1.0 } else { sqr(self.eta) }
    }

    /// Classes of lobes that are there.
    #[inline]
    pub(super) fn lobes(&self) -> LobeSet {
        let mut set = LobeSet::NONE;
        if self.has_facets {
            set = set | self.class;
        }
        if self.diffuse.max_element() > 0.0 {
            set = set | LobeSet::BROAD;
        }
        if self.straight.max_element() > 0.0 {
            set = set | LobeSet::DELTA;
        }
        self.cover.map_or(set, |c| set | c.cover.lobes())
    }

    /// Its glass is compensated by tables of its own.
    #[inline]
    pub(super) fn is_rough_solid(&self) -> bool {
        self.glass > 0.0 && !self.thin && self.class != LobeSet::DELTA
    }

    /// Index behind the facets over the one before them, seen from `side`.
    #[inline]
    pub(super) fn eta_from(&self, side: usize) -> f32 {
        if side == 0 || self.thin { self.eta } else { 1.0 / self.eta }
    }

    /// Reflectance of the dielectric at a facet, what it lets through, and the cosine of the refracted ray.
    #[inline]
    fn dielectric(&self, cos: f32, eta: f32) -> (Rgb, f32, f32) {
        match grazing_weight(cos, eta) {
            None => (Rgb::ONE, 0.0, 0.0),
            Some((grazing, cos_t)) => {
                let f = self.f0 + (Rgb::splat(self.f90) - self.f0) * grazing;
                (f, (1.0 - f.max_element()).max(0.0), cos_t)
            }
        }
    }

    /// Reflectance of metal and of the matte's interface at a facet.
    #[inline]
    fn opaque(&self, cos: f32) -> Rgb {
        let mut reflected = if self.metal > 0.0 { schlick(self.base, cos) * self.metal } else { Rgb::ZERO };
        if self.matte > 0.0 {
            reflected += self.dielectric(cos, self.eta).0 * self.matte;
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
        let (f, t, cos_t) = self.dielectric(cos, self.eta_from(side));
        (opaque + f * self.glass, self.base * (self.glass * t), cos_t)
    }

    /// A cosine at which the smooth interface reflects about as much as the rough one does at `mu`.
    #[inline]
    fn effective_cosine(&self, mu: f32) -> f32 {
        if self.class == LobeSet::DELTA {
            mu
        } else {
            let alpha = (self.ggx.alpha_x * self.ggx.alpha_y).sqrt();
            mu + (1.0 - mu) * 0.6 * alpha.min(1.0)
        }
    }

    /// Estimates of the lobes' albedos at cosine `mu` from `side`, in the order of [`Shares`].
    #[inline]
    fn albedos(&self, mu: f32, at: Position, side: usize, set: LobeSet) -> [Rgb; 8] {
        let mut a = [Rgb::ZERO; 8];
        let rough = self.class != LobeSet::DELTA;
        let facets = self.has_facets && set.has(self.class);
        if facets {
            let cos = self.effective_cosine(mu);
            let loss = self.loss.at(at);
            let own = PI * self.loss.average * loss;
            a[1] = self.returned * own;
            a[2] = self.passed * own;
            if self.is_rough_solid() {
                let glass_loss = self.glass_loss[side].at(at);
                let reflected = self.glass_reflected[side].at(at);
                let transmitted = (1.0 - glass_loss - reflected).max(0.0);
                let smooth = self.dielectric(cos, self.eta_from(side)).0;
                let tint = smooth / smooth.max_element().max(f32::MIN_POSITIVE);
                a[0] = self.opaque(cos) * (1.0 - loss) + (tint * reflected + self.base * transmitted) * self.glass;
                a[1] += Rgb::splat(self.glass_returned[side] * glass_loss * self.glass_loss[side].average * PI);
                let other = self.glass_loss[1 - side].average * self.index2(1 - side);
                a[2] += self.glass_passed * (glass_loss * other * PI);
            } else {
                let (r, t, _) = self.fresnel(cos, side);
                a[0] = (r + t) * (1.0 - loss);
            }
        }
        if set.has(LobeSet::BROAD) && self.diffuse.max_element() > 0.0 {
            a[3] = self.diffuse_albedo * self.through.at(at);
        }
        if set.has(LobeSet::DELTA) {
            a[4] = self.straight;
        }
        if let Some(c) = &self.cover {
            let passes = c.cover.passes(at);
            for albedo in &mut a {
                *albedo *= passes;
            }
            if facets && rough {
                for (below, profile) in c.below.iter().zip(&c.profiles) {
                    a[5] += *below * (PI * profile.average * profile.at(at));
                }
            }
            [a[6], a[7]] = c.cover.albedos(mu, at, set);
        }
        a
    }

    /// Albedo of the lobes of `set`.
    #[inline]
    pub(super) fn albedo(&self, wo: Vec3, set: LobeSet) -> Rgb {
        let mu = wo.z.abs();
        self.albedos(mu, Position::new(mu), usize::from(wo.z < 0.0), set).into_iter().sum::<Rgb>().min(Rgb::ONE)
    }

    #[inline]
    pub(super) fn shares(&self, mu: f32, at: Position, side: usize, set: LobeSet) -> Option<Shares> {
        let mut shares = Shares::new(self.albedos(mu, at, side, set));
        // The estimate may vanish where the lobe does not: black metal at normal incidence.
        if self.has_facets && set.has(self.class) && self.class != LobeSet::DELTA {
            shares.facets += 0.01;
        }
        shares.normalised()
    }
}
