//! The cover of the base: sheen, and a clear coat on top of it.
//!
//! A layer of albedo E attenuates microfacet lobes below it by `1 - max(E(o), E(i))`, which is exact for mirrors, and
//! separable lobes by `(1 - E(o)) (1 - E(i))`, normalized so that their albedo is attenuated by `1 - E(o)`. Both
//! factors are reciprocal. Both sides of a surface are covered. A coloured coat absorbs along the refracted paths of
//! both directions \[OpenPBR, coat_color\].

use super::energy::EnergyTables;
use super::fresnel::{dielectric, reflect};
use super::microfacet::{Ggx, g1, g2_reflection, lobe_class};
use super::profile::{Position, Profile};
use super::{DELTA_ALPHA, LobeSet, Parameters, SheenModel, sheen};
use crate::math::{Rgb, Vec2, Vec3, sqr};

/// Smallest colour of a coat, whose logarithm is finite.
const MIN_COLOR: f32 = 1e-9;

/// Reflectance of a smooth clear coat of relative index `eta` at this cosine with the normal, 0 to 1.
#[inline]
pub fn coat_reflectance(cos: f32, eta: f32) -> f32 {
    dielectric(cos, eta).0
}

/// Mean of 1 / cos over the refracted paths of diffuse light in a coat of relative index `eta`.
pub fn mean_path(eta: f32) -> f32 {
    2.0 * sqr(eta) * (1.0 - (1.0 - 1.0 / sqr(eta)).max(0.0).sqrt())
}

/// Table positions of the cosines of a direction with two normals, which differ under a normal map.
#[derive(Clone, Copy, Debug)]
pub struct Angles {
    /// Cosine with the normal of the coat.
    pub coat: Position,
    /// Cosine with the normal of the sheen and the base.
    pub base: Position,
}

impl From<Position> for Angles {
    /// The positions if the coat and the base have one normal.
    #[inline]
    fn from(mu: Position) -> Angles {
        Angles { coat: mu, base: mu }
    }
}

/// The cover of a surface's base: a layer of sheen, and a clear coat on top of it.
#[derive(Clone, Copy, Debug)]
pub struct Cover {
    coat: f32,
    coat_ggx: Ggx,
    /// Lobe class (delta, sharp or broad) of the coat.
    pub coat_class: LobeSet,
    coat_eta: f32,
    /// Logarithm of the coat's colour over 2: of the light that passes it once along its normal. `None` if it is white.
    coat_log: Option<Rgb>,
    coat_albedo: Profile,
    sheen: Rgb,
    sheen_alpha: f32,
    sheen_model: SheenModel,
    sheen_albedo: Profile,
}

impl Cover {
    /// The cover that the BSDF's parameters describe; `None` without coat and sheen.
    #[inline]
    pub fn new(p: &Parameters, tables: &EnergyTables) -> Option<Cover> {
        if !p.is_covered() {
            return None;
        }
        let coat_class = lobe_class(p.clearcoat_alpha, p.clearcoat_alpha);
        let alpha = if coat_class == LobeSet::DELTA { 0.0 } else { p.clearcoat_alpha };
        // Tables of layers that are absent are not computed.
        let absent = Profile::constant(0.0);
        let coat_albedo =
            if p.clearcoat > 0.0 { tables.coat_albedo(Position::new(alpha), p.clearcoat_eta) } else { absent };
        let has_sheen = p.sheen_color.max_element() > 0.0;
        let sheen_albedo =
            if has_sheen { tables.sheen_albedo(p.sheen_model, Position::new(p.sheen_alpha)) } else { absent };
        Some(Cover {
            coat: p.clearcoat,
            coat_ggx: Ggx { alpha_x: alpha.max(DELTA_ALPHA), alpha_y: alpha.max(DELTA_ALPHA) },
            coat_class,
            coat_eta: p.clearcoat_eta,
            coat_log: (p.clearcoat > 0.0 && p.clearcoat_color != Rgb::ONE)
                .then(|| p.clearcoat_color.max(Rgb::splat(MIN_COLOR)).map(f32::ln) * 0.5),
            coat_albedo,
            sheen: p.sheen_color,
            sheen_alpha: p.sheen_alpha,
            sheen_model: p.sheen_model,
            sheen_albedo,
        })
    }

    /// Lobe classes of the layers, coat and sheen, that the cover has.
    #[inline]
    pub fn lobes(&self) -> LobeSet {
        let mut set = LobeSet::empty();
        if self.coat > 0.0 {
            set |= self.coat_class;
        }
        if self.has_sheen() {
            set |= LobeSet::BROAD;
        }
        set
    }

    /// Whether the cover has a clear coat.
    #[inline]
    pub fn has_coat(&self) -> bool {
        self.coat > 0.0
    }

    /// Whether the cover has sheen.
    #[inline]
    pub fn has_sheen(&self) -> bool {
        self.sheen.max_element() > 0.0
    }

    /// Factors of the albedos of coat and sheen by which the layers attenuate the base.
    #[inline]
    pub fn strengths(&self) -> [f32; 2] {
        [self.coat, self.sheen.max_element()]
    }

    /// Albedo of white sheen at a cosine, at most 1. The lobe of narrow sheen exceeds 1 at grazing angles, see
    /// [`Cover::sheen`].
    #[inline]
    fn sheen_albedo(&self, mu: Position) -> f32 {
        self.sheen_albedo.at(mu).min(1.0)
    }

    /// Transmittance of coat and sheen in one direction (0 to 1), for separable lobes of the base, such as the diffuse
    /// one.
    #[inline]
    pub fn transmittance(&self, w: Angles) -> f32 {
        let [coat, sheen] = self.strengths();
        (1.0 - coat * self.coat_albedo.at(w.coat)) * (1.0 - sheen * self.sheen_albedo(w.base))
    }

    /// Factor (0 to 1) by which coat and sheen attenuate a microfacet lobe of the base, for a pair of directions.
    #[inline]
    pub fn facet_transmittance(&self, o: Angles, i: Angles) -> f32 {
        let [coat, sheen] = self.strengths();
        (1.0 - coat * self.coat_albedo.at(o.coat).max(self.coat_albedo.at(i.coat)))
            * (1.0 - sheen * self.sheen_albedo(o.base).max(self.sheen_albedo(i.base)))
    }

    /// Transmittance of the coat's colour for light that passes it along two directions, from their cosines with its
    /// normal. `None` if it is white.
    #[inline]
    pub fn absorption(&self, cos_o: f32, cos_i: f32) -> Option<Rgb> {
        let log = self.coat_log?;
        let path = |cos: f32| 1.0 / (1.0 - (1.0 - sqr(cos)).max(0.0) / sqr(self.coat_eta)).max(1e-9).sqrt();
        Some(self.absorption_along(log, path(cos_o) + path(cos_i)))
    }

    /// Mean of [`Cover::absorption`] over diffuse light, approximately.
    pub fn mean_absorption(&self, cos_o: f32) -> Option<Rgb> {
        let path = 1.0 / (1.0 - (1.0 - sqr(cos_o)).max(0.0) / sqr(self.coat_eta)).max(1e-9).sqrt();
        self.coat_log.map(|log| self.absorption_along(log, path + mean_path(self.coat_eta)))
    }

    /// Transmittance along a path in the coat, relative to its thickness.
    #[inline]
    fn absorption_along(&self, log: Rgb, path: f32) -> Rgb {
        Rgb::splat(1.0 - self.coat) + (log * path).map(f32::exp) * self.coat
    }

    /// Albedos of coat and sheen in a direction. `cos` is its cosine with the normal of the coat.
    #[inline]
    pub fn albedos(&self, cos: f32, w: Angles) -> [Rgb; 2] {
        let mut albedos = [Rgb::ZERO; 2];
        if self.coat > 0.0 {
            let exact = self.coat_class == LobeSet::DELTA;
            albedos[0] =
                Rgb::splat(if exact { self.coat_reflectance(cos) } else { self.coat * self.coat_albedo.at(w.coat) });
        }
        if self.has_sheen() {
            albedos[1] = self.sheen * (self.sheen_albedo(w.base) * (1.0 - self.coat * self.coat_albedo.at(w.coat)));
        }
        albedos
    }

    /// Reflectance of the coat as a smooth interface, at this cosine with its normal.
    #[inline]
    pub fn coat_reflectance(&self, cos: f32) -> f32 {
        self.coat * coat_reflectance(cos, self.coat_eta)
    }

    /// Value of the coat's lobe, without cosine, and the density of sampling it. Not for delta coats. Both directions
    /// are above the surface.
    #[inline]
    pub fn coat(&self, o: Vec3, i: Vec3) -> (f32, f32) {
        let Some(h) = (o + i).try_normalize() else { return (0.0, 0.0) };
        let (lambda_o, lambda_i) = (self.coat_ggx.lambda(o), self.coat_ggx.lambda(i));
        let d = self.coat_ggx.d(h) / (4.0 * o.z);
        let f = self.coat_reflectance(o.dot(h).clamp(0.0, 1.0));
        (f * d * g2_reflection(lambda_o, lambda_i) / i.z, d * g1(lambda_o))
    }

    /// Samples a direction to which the coat reflects light, seen along `o`. It may be below the surface.
    #[inline]
    pub fn sample_coat(&self, o: Vec3, u: Vec2) -> Vec3 {
        let smooth = self.coat_class == LobeSet::DELTA;
        reflect(o, if smooth { Vec3::Z } else { self.coat_ggx.sample_visible(o, u) })
    }

    /// Value of the sheen lobe, without cosine, scaled down where its albedo would exceed 1. Both directions are above
    /// the surface.
    #[inline]
    pub fn sheen(&self, o: Vec3, i: Vec3, at_o: Angles, at_i: Angles) -> Rgb {
        let coat = if self.coat > 0.0 {
            1.0 - self.coat * self.coat_albedo.at(at_o.coat).max(self.coat_albedo.at(at_i.coat))
        } else {
            1.0
        };
        let excess = self.sheen_albedo.at(at_o.base).max(self.sheen_albedo.at(at_i.base)).max(1.0);
        self.sheen * (sheen::eval_model(self.sheen_model, o, i, self.sheen_alpha) * coat / excess)
    }
}
