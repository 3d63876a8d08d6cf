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
use super::fresnel::{grazing_weight, is_matched, normal_incidence, reflect, refract, schlick};
use super::microfacet::{Ggx, g1, g2_reflection, g2_transmission};
use super::profile::{Position, Profile};
use super::{BsdfSample, DELTA_ALPHA, LobeSet, Parameters, SHARP_ALPHA, Transport};
use crate::math::{Rgb, Vec2, Vec3, sqr, warp};
use std::f32::consts::{FRAC_1_PI, PI};

/// Mean of the channels: what lobes are chosen by.
#[inline]
fn mean(c: Rgb) -> f32 {
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
struct Shares {
    /// Facets: reflected or transmitted, as Fresnel says at the facet drawn.
    facets: f32,
    /// Compensation on the side of `wo`.
    returned: f32,
    /// Compensation on the other side.
    passed: f32,
    /// Diffuse reflection.
    diffuse: f32,
    /// Straight through an index-matched boundary.
    straight: f32,
    /// What facets lose below a covering, on the side of `wo`.
    below: f32,
    /// Clear coat.
    coat: f32,
    /// Sheen.
    sheen: f32,
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
        if !(sum > 0.0) {
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
    ggx: Ggx,
    class: LobeSet,
    thin: bool,
    has_facets: bool,
    base: Rgb,
    metal: f32,
    matte: f32,
    glass: f32,
    /// Index of refraction below over above.
    eta: f32,
    /// Reflectance of the dielectric at normal and grazing incidence.
    f0: Rgb,
    f90: f32,
    /// Weight of the straight lobe.
    straight: Rgb,
    /// Diffuse: `diffuse * through(o) * through(i)`; `diffuse_albedo * through(o)` is its albedo.
    diffuse: Rgb,
    diffuse_albedo: Rgb,
    through: Profile<'a>,
    /// Compensation for reflecting facets: `returned * loss(o) * loss(i)`, and for thin walls `passed` likewise on the other side;
    /// times pi times the average of `loss` they are albedos.
    loss: Profile<'a>,
    returned: Rgb,
    passed: Rgb,
    /// Compensation for solid glass, by side: what is lost from above and from below.
    glass_loss: [Profile<'a>; 2],
    /// Reflected compensation: `glass_returned[side] * loss(o) * loss(i)`.
    glass_returned: [f32; 2],
    /// Transmitted compensation over the squared index of the side transmitted to (with 1 above): the same from both sides.
    glass_passed: Rgb,
    cover: Option<Covered<'a>>,
}

/// A covering, and what it does to the lobes below.
#[derive(Clone, Copy, Debug)]
struct Covered<'a> {
    cover: Cover<'a>,
    /// Normalisation of separable lobes below: average profile over average of the profile times what passes, for the profiles `through`,
    /// `loss` and `glass_loss`.
    through: f32,
    loss: f32,
    glass_loss: [f32; 2],
    /// What facets lose below coat and sheen: `below[k] * profile(o) * profile(i)`, with albedo `pi * average * below * profile(o)`.
    below: [Rgb; 2],
    profiles: [Profile<'a>; 2],
}

impl<'a> Layered<'a> {
    #[inline]
    pub(super) fn new(p: &Parameters, tables: &'a EnergyTables) -> Layered<'a> {
        let class = class_of(p.alpha_x, p.alpha_y);
        // A lobe that is narrow along one axis only is still sampled as a lobe.
        let ggx = Ggx { alpha_x: p.alpha_x.max(DELTA_ALPHA), alpha_y: p.alpha_y.max(DELTA_ALPHA) };
        let rough = class != LobeSet::DELTA;
        let alpha = Position::new(if rough { (ggx.alpha_x * ggx.alpha_y).sqrt() } else { 0.0 });
        let metal = p.metallic;
        let glass = (1.0 - metal) * p.transmission;
        let matte = 1.0 - metal - glass;
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
    fn index2(&self, side: usize) -> f32 {
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
    fn is_rough_solid(&self) -> bool {
        self.glass > 0.0 && !self.thin && self.class != LobeSet::DELTA
    }

    /// Index behind the facets over the one before them, seen from `side`.
    #[inline]
    fn eta_from(&self, side: usize) -> f32 {
        if side == 0 || self.thin { self.eta } else { 1.0 / self.eta }
    }

    /// Reflectance and transmittance of a facet at the angle of cosine `cos`, and the cosine of the refracted ray.
    #[inline]
    fn fresnel(&self, cos: f32, side: usize) -> (Rgb, Rgb, f32) {
        let mut reflected = if self.metal > 0.0 { schlick(self.base, cos) * self.metal } else { Rgb::ZERO };
        let mut transmitted = Rgb::ZERO;
        let mut refracted = 0.0;
        let dielectric = |eta: f32| match grazing_weight(cos, eta) {
            None => (Rgb::ONE, 0.0, 0.0),
            Some((grazing, cos_t)) => {
                let f = self.f0 + (Rgb::splat(self.f90) - self.f0) * grazing;
                (f, 1.0 - f.max_element(), cos_t)
            }
        };
        if self.matte > 0.0 {
            reflected += dielectric(self.eta).0 * self.matte;
        }
        if self.glass > 0.0 {
            let (f, t, cos_t) = dielectric(self.eta_from(side));
            reflected += f * self.glass;
            transmitted = self.base * (self.glass * t.max(0.0));
            refracted = cos_t;
        }
        (reflected, transmitted, refracted)
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
            let (r, t, _) = self.fresnel(self.effective_cosine(mu), side);
            let loss = self.loss.at(at);
            let solid = self.is_rough_solid();
            let glass_loss = if solid { self.glass_loss[side].at(at) } else { loss };
            a[0] = r * (1.0 - loss) + t * (1.0 - glass_loss);
            if rough {
                let own = PI * self.loss.average * loss;
                a[1] = self.returned * own;
                a[2] = self.passed * own;
                if solid {
                    a[1] += Rgb::splat(self.glass_returned[side] * glass_loss * self.glass_loss[side].average * PI);
                    let other = self.glass_loss[1 - side].average * self.index2(1 - side);
                    a[2] += self.glass_passed * (glass_loss * other * PI);
                }
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
    fn shares(&self, mu: f32, at: Position, side: usize, set: LobeSet) -> Option<Shares> {
        let mut shares = Shares::new(self.albedos(mu, at, side, set));
        // The estimate may vanish where the lobe does not: black metal at normal incidence.
        if self.has_facets && set.has(self.class) && self.class != LobeSet::DELTA {
            shares.facets += 0.01;
        }
        shares.normalised()
    }

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
        if !(mu_o > 0.0 && mu_i > 0.0) || !(set & LobeSet::SMOOTH).has(self.lobes()) {
            return (Rgb::ZERO, 0.0);
        }
        // Delta lobes take their share of the directions drawn from the set.
        let at = Position::new(mu_o);
        let Some(shares) = self.shares(mu_o, at, side, set) else { return (Rgb::ZERO, 0.0) };
        self.evaluate_shares(wo, wi, at, side, transport, set, &shares)
    }

    /// The first part of [`Layered::evaluate`], where that is cheaper: no densities, so no shares.
    #[inline]
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3, transport: Transport, set: LobeSet) -> Rgb {
        let mu_o = wo.z.abs();
        // A covering asks its shares which of its lobes are in the set.
        if self.cover.is_some() || !(mu_o > 0.0 && wi.z.abs() > 0.0) {
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
        if !(o.z > 0.0) {
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
        if !(pdf_w > 0.0) {
            return None;
        }
        Some(BsdfSample { wi, weight: f * (wi.z.abs() / pdf_w), pdf_w, lobe, transmitted: i.z < 0.0 })
    }
}
