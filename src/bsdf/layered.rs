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

use super::energy::{EnergyTables, Profile, Row, SideTables};
use super::fresnel::{grazing_weight, is_matched, normal_incidence, reflect, refract, schlick};
use super::microfacet::{Ggx, g1, g2_reflection, g2_transmission};
use super::{BsdfSample, DELTA_ALPHA, LobeSet, Parameters, SHARP_ALPHA, Transport};
use crate::math::{Rgb, Vec2, Vec3, sqr, warp};
use std::f32::consts::FRAC_1_PI;

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
}

/// See the module's documentation.
#[derive(Clone, Copy, Debug)]
pub struct Layered {
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
    through: Row,
    /// Compensation for reflecting facets: `returned * loss(o) * loss(i)`, and for thin walls `passed` likewise on the other side;
    /// times pi times the average of `loss` they are albedos.
    loss: Profile,
    returned: Rgb,
    passed: Rgb,
    /// Compensation for solid glass, by side: what is lost from above and from below.
    glass_loss: [Profile; 2],
    /// Reflected compensation: `glass_returned[side] * loss(o) * loss(i)`.
    glass_returned: [f32; 2],
    /// Transmitted compensation over the squared index of the side transmitted to (with 1 above): the same from both sides.
    glass_passed: Rgb,
}

impl Layered {
    pub(super) fn new(p: &Parameters, tables: &EnergyTables) -> Layered {
        let class = class_of(p.alpha_x, p.alpha_y);
        // A lobe that is narrow along one axis only is still sampled as a lobe.
        let ggx = Ggx { alpha_x: p.alpha_x.max(DELTA_ALPHA), alpha_y: p.alpha_y.max(DELTA_ALPHA) };
        let alpha = if class == LobeSet::DELTA { 0.0 } else { (ggx.alpha_x * ggx.alpha_y).sqrt() };
        let metal = p.metallic;
        let glass = (1.0 - metal) * p.transmission;
        let matte = 1.0 - metal - glass;
        let base = p.base_color;
        let f0 = (p.specular_color * normal_incidence(p.eta)).min(Rgb::ONE) * p.specular;
        let sides = tables.sides(p.eta);
        let f90 = if sides.is_some() { p.specular } else { 0.0 };
        let matched = is_matched(p.eta);
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
            through: Row::ZERO,
            loss: Profile::ZERO,
            returned: Rgb::ZERO,
            passed: Rgb::ZERO,
            glass_loss: [Profile::ZERO; 2],
            glass_returned: [0.0; 2],
            glass_passed: Rgb::ZERO,
        };
        let white = tables.white.row(alpha);
        let rough = class != LobeSet::DELTA;
        if rough {
            b.loss = Profile::new(Row::from_fn(|j| (1.0 - white.0[j]).max(0.0)));
        }
        let f0_max = f0.max_element();
        // Average reflectances of the dielectric from above.
        let average = sides.map_or(Rgb::ZERO, |[above, _]| {
            f0 * (1.0 - above.average_total - above.average_grazing)
                + Rgb::splat(f90 * above.average_grazing + above.average_total)
        });
        // Reflection of light that facets scatter more than once [Kulla and Conty 2017], as a share of what is lost.
        let kept = 1.0 - b.loss.average;
        let again = |f: Rgb| f * f * kept / (Rgb::ONE - f * (1.0 - kept));
        let metal_average = base + (Rgb::ONE - base) * (1.0 / 21.0);
        let scale = FRAC_1_PI / b.loss.average.max(1e-9);
        if rough {
            b.returned = (again(metal_average) * metal + again(average) * matte) * scale;
            if p.thin {
                b.returned += average * (b.glass * scale);
                b.passed = base * ((1.0 - average.max_element()) * b.glass * scale);
            }
        }
        if matte > 0.0 && base.max_element() > 0.0 {
            b.through = match sides {
                None => Row::ONE,
                Some([above, _]) => {
                    let (r, g) = (above.reflected.row(alpha), above.reflected_grazing.row(alpha));
                    let multiple = if rough { again(average).max_element() } else { 0.0 };
                    Row::from_fn(|j| {
                        let single = f0_max * (r.0[j] - g.0[j]) + f90 * g.0[j] + (white.0[j] - r.0[j]).max(0.0);
                        (1.0 - single - multiple * b.loss.nodes()[j]).clamp(0.0, 1.0)
                    })
                }
            };
            b.diffuse_albedo = base * matte;
            b.diffuse = b.diffuse_albedo * (FRAC_1_PI / b.through.average().max(1e-9));
        }
        if let (true, true, false, Some(sides)) = (b.glass > 0.0, rough, p.thin, sides) {
            b.compensate_glass(alpha, &white, sides);
        }
        b
    }

    fn compensate_glass(&mut self, alpha: f32, white: &Row, sides: [&SideTables; 2]) {
        let (f0, f90) = (self.f0.max_element(), self.f90);
        for (side, tables) in sides.into_iter().enumerate() {
            let (r, rg) = (tables.reflected.row(alpha), tables.reflected_grazing.row(alpha));
            let (t, tg) = (tables.transmitted.row(alpha), tables.transmitted_grazing.row(alpha));
            self.glass_loss[side] = Profile::new(Row::from_fn(|j| {
                let reflected = f0 * (r.0[j] - rg.0[j]) + f90 * rg.0[j] + (white.0[j] - r.0[j]).max(0.0);
                let transmitted = t.0[j] - f0 * (t.0[j] - tg.0[j]) - f90 * tg.0[j];
                (1.0 - reflected - transmitted).max(0.0)
            }));
        }
        // Of what is lost from side s the share x_s passes. Reciprocity asks for x_s = k n^2 average, n and average those of the other side;
        // k makes no share larger than the average transmittance of the smooth interface, which is in proportion to n^2 already.
        let average = |s: usize| {
            let total = sides[s].average_total;
            f0 * (1.0 - total - sides[s].average_grazing) + f90 * sides[s].average_grazing + total
        };
        let largest = self.glass_loss[0].average.max(self.glass_loss[1].average).max(1e-9);
        let k = ((1.0 - average(0)) / sqr(self.eta)).min(1.0 - average(1)) / largest;
        for side in 0..2 {
            let passes = k * self.index2(1 - side) * self.glass_loss[1 - side].average;
            self.glass_returned[side] =
                self.glass * (1.0 - passes) * FRAC_1_PI / self.glass_loss[side].average.max(1e-9);
        }
        self.glass_passed = self.base * (self.glass * k * FRAC_1_PI);
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
        set
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

    /// Estimates of the lobes' albedos at cosine `mu` from `side`: facets, returned, passed, diffuse, straight.
    #[inline]
    fn albedos(&self, mu: f32, side: usize, set: LobeSet) -> [Rgb; 5] {
        let mut a = [Rgb::ZERO; 5];
        if self.has_facets && set.has(self.class) {
            let (r, t, _) = self.fresnel(self.effective_cosine(mu), side);
            let loss = self.loss.at(mu);
            let solid = self.is_rough_solid();
            let glass_loss = if solid { self.glass_loss[side].at(mu) } else { loss };
            a[0] = r * (1.0 - loss) + t * (1.0 - glass_loss);
            if self.class != LobeSet::DELTA {
                let own = std::f32::consts::PI * self.loss.average * loss;
                a[1] = self.returned * own;
                a[2] = self.passed * own;
                if solid {
                    let pi = std::f32::consts::PI;
                    a[1] += Rgb::splat(self.glass_returned[side] * glass_loss * self.glass_loss[side].average * pi);
                    let other = self.glass_loss[1 - side].average * self.index2(1 - side);
                    a[2] += self.glass_passed * (glass_loss * other * pi);
                }
            }
        }
        if set.has(LobeSet::BROAD) && self.diffuse.max_element() > 0.0 {
            a[3] = self.diffuse_albedo * self.through.at(mu);
        }
        if set.has(LobeSet::DELTA) {
            a[4] = self.straight;
        }
        a
    }

    /// Albedo of the lobes of `set`.
    #[inline]
    pub(super) fn albedo(&self, wo: Vec3, set: LobeSet) -> Rgb {
        let [a, b, c, d, e] = self.albedos(wo.z.abs(), usize::from(wo.z < 0.0), set);
        (a + b + c + d + e).min(Rgb::ONE)
    }

    #[inline]
    fn shares(&self, mu: f32, side: usize, set: LobeSet) -> Option<Shares> {
        let [facets, returned, passed, diffuse, straight] = self.albedos(mu, side, set).map(mean);
        let mut s = Shares { facets, returned, passed, diffuse, straight };
        // The estimate may vanish where the lobe does not: black metal at normal incidence.
        if self.has_facets && set.has(self.class) && self.class != LobeSet::DELTA {
            s.facets += 0.01;
        }
        let sum = s.facets + s.returned + s.passed + s.diffuse + s.straight;
        if !(sum > 0.0) {
            return None;
        }
        let scale = 1.0 / sum;
        s.facets *= scale;
        s.returned *= scale;
        s.passed *= scale;
        s.diffuse *= scale;
        s.straight *= scale;
        Some(s)
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
        let Some(shares) = self.shares(mu_o, side, set) else { return (Rgb::ZERO, 0.0) };
        self.evaluate_shares(wo, wi, side, transport, set, &shares)
    }

    fn evaluate_shares(
        &self,
        wo: Vec3,
        wi: Vec3,
        side: usize,
        transport: Transport,
        set: LobeSet,
        shares: &Shares,
    ) -> (Rgb, f32) {
        let (mu_o, mu_i) = (wo.z.abs(), wi.z.abs());
        let same_side = wo.z * wi.z > 0.0;
        let facets = self.has_facets && self.class != LobeSet::DELTA && set.has(self.class);
        let mut f = Rgb::ZERO;
        let mut pdf = 0.0;
        let up = |w: Vec3| Vec3::new(w.x, w.y, w.z.abs());
        if same_side {
            if facets {
                let (o, i) = (up(wo), up(wi));
                if let Some(h) = (o + i).try_normalize() {
                    let (r, t, _) = self.fresnel(o.dot(h).clamp(0.0, 1.0), side);
                    let (value, density) = self.reflecting_facets(o, i, h);
                    f += r * value;
                    pdf += shares.facets * Self::reflect_probability(r, t) * density;
                }
                let (loss_i, density) = self.loss.at_with_pdf_w(mu_i);
                f += self.returned * (self.loss.at(mu_o) * loss_i);
                if self.is_rough_solid() {
                    let profile = &self.glass_loss[side];
                    let (loss_i, density) = profile.at_with_pdf_w(mu_i);
                    f += Rgb::splat(self.glass_returned[side] * profile.at(mu_o) * loss_i);
                    pdf += shares.returned * density;
                } else {
                    pdf += shares.returned * density;
                }
            }
            if set.has(LobeSet::BROAD) && shares.diffuse > 0.0 {
                f += self.diffuse * (self.through.at(mu_o) * self.through.at(mu_i));
                pdf += shares.diffuse * mu_i * FRAC_1_PI;
            }
        } else if facets && self.glass > 0.0 {
            let scale = self.radiance_scale(side, transport);
            if self.thin {
                let (o, i) = (up(wo), up(wi));
                if let Some(h) = (o + i).try_normalize() {
                    let (r, t, _) = self.fresnel(o.dot(h).clamp(0.0, 1.0), side);
                    let (value, density) = self.reflecting_facets(o, i, h);
                    f += t * value;
                    pdf += shares.facets * (1.0 - Self::reflect_probability(r, t)) * density;
                }
                let (loss_i, density) = self.loss.at_with_pdf_w(mu_i);
                f += self.passed * (self.loss.at(mu_o) * loss_i);
                pdf += shares.passed * density;
            } else {
                let flip = if side == 0 { 1.0 } else { -1.0 };
                let (o, i) = (Vec3::new(wo.x, wo.y, mu_o), Vec3::new(wi.x, wi.y, flip * wi.z));
                let (value, density) = self.transmitting_facets(o, i, side);
                f += value * scale;
                pdf += shares.facets * density;
                let (loss_i, density) = self.glass_loss[1 - side].at_with_pdf_w(mu_i);
                let losses = self.glass_loss[side].at(mu_o) * loss_i;
                f += self.glass_passed * (losses * self.index2(1 - side) * scale);
                pdf += shares.passed * density;
            }
        }
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
        let shares = self.shares(o.z, side, set)?;
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
        let mut u_lobe = u_lobe;
        let (i, lobe) = if u_lobe < shares.facets {
            u_lobe /= shares.facets;
            let smooth = self.class == LobeSet::DELTA;
            let h = if smooth { Vec3::Z } else { self.ggx.sample_visible(o, u) };
            let (r, t, cos_t) = self.fresnel(o.dot(h).clamp(0.0, 1.0), side);
            let p = Self::reflect_probability(r, t);
            let mirrored = reflect(o, h);
            if u_lobe < p {
                if smooth {
                    return delta(mirrored, r, shares.facets * p);
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
                    return delta(i, t * self.radiance_scale(side, transport), shares.facets * (1.0 - p));
                }
                (i.z < 0.0).then_some((i, self.class))?
            }
        } else {
            u_lobe -= shares.facets;
            if u_lobe < shares.diffuse {
                (warp::hemisphere_cosine(u), LobeSet::BROAD)
            } else if u_lobe < shares.diffuse + shares.returned {
                let profile = if self.is_rough_solid() { &self.glass_loss[side] } else { &self.loss };
                (profile.sample(u), self.class)
            } else if u_lobe < shares.diffuse + shares.returned + shares.passed {
                let profile = if self.is_rough_solid() { &self.glass_loss[1 - side] } else { &self.loss };
                (-profile.sample(u), self.class)
            } else {
                // Rounding can lead here without a straight lobe: `delta` refuses it.
                return delta(-o, self.straight, shares.straight);
            }
        };
        let wi = back(i.normalize());
        let (f, pdf_w) = self.evaluate_shares(wo, wi, side, transport, set, &shares);
        if !(pdf_w > 0.0) {
            return None;
        }
        Some(BsdfSample { wi, weight: f * (wi.z.abs() / pdf_w), pdf_w, lobe, transmitted: i.z < 0.0 })
    }
}
