//! Fresnel reflection and transmission at the facets of a dielectric interface, from both sides.

use super::Parameters;
use super::film::{self, Film};
use super::fresnel::{Smooth, is_matched, normal_incidence};
use crate::math::Rgb;

/// The smooth dielectric interface of facets, with a thin film if there is one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dielectric {
    /// Fresnel's equations from above and from below.
    pub smooth: [Smooth; 2],
    /// Reflectance at normal incidence, per channel, without the film.
    pub f0: Rgb,
    /// Reflectance at grazing incidence.
    pub f90: f32,
    /// Factor on the reflectance at all angles.
    pub color: Rgb,
    /// Thin film, and the index of refraction per channel of the dielectric below it; `None` without a film.
    pub film: Option<(Film, Rgb)>,
    thin: bool,
}

impl Dielectric {
    /// The interface that the parameters of a BSDF describe.
    pub fn new(p: &Parameters) -> Dielectric {
        let film = Film::new(p).map(|film| (film, film::dielectric_index(p.eta, p.specular_color)));
        let (f0, f90) = if is_matched(p.eta) && film.is_none() {
            (Rgb::ZERO, 0.0)
        } else {
            ((p.specular_color * normal_incidence(p.eta)).min(Rgb::ONE) * p.specular, p.specular)
        };
        let smooth = [Smooth::new(p.eta), Smooth::new(if p.thin { p.eta } else { 1.0 / p.eta })];
        Dielectric { smooth, f0, f90, color: p.reflection_color, film, thin: p.thin }
    }

    /// Reflectance and transmittance at a facet where light arrives at cosine `cos` on `side` (0 above, 1 below), and
    /// the cosine of the refracted ray.
    #[inline]
    pub fn fresnel(&self, cos: f32, side: usize) -> (Rgb, Rgb, f32) {
        let Some((grazing, cos_t)) = self.smooth[side].grazing_weight(cos) else { return (Rgb::ONE, Rgb::ZERO, 0.0) };
        let f = self.f0 + (Rgb::splat(self.f90) - self.f0) * grazing;
        let t = Rgb::splat((1.0 - f.max_element()).max(0.0));
        let Some((film, base)) = &self.film else { return (f * self.color, t, cos_t) };
        let above = if side == 1 && !self.thin { cos_t } else { cos };
        let covered = film.reflectance(above, *base) * self.f90;
        (f.lerp(covered, film.strength) * self.color, t.lerp(Rgb::ONE - covered, film.strength), cos_t)
    }

    /// Average reflectance from above of an interface with a film, over the hemisphere.
    pub fn average(&self) -> Rgb {
        film::average(|cos| self.fresnel(cos, 0).0)
    }

    /// A reflectance at normal incidence at which an interface without a film, whose relative index is `eta`, reflects
    /// at least as much as the strongest channel of this one does, at all angles.
    pub fn upper_f0(&self, eta: f32) -> f32 {
        let plain = Smooth::new(eta);
        let at = |cos: f32| match plain.grazing_weight(cos) {
            Some((grazing, _)) if grazing < 1.0 => {
                (self.fresnel(cos, 0).0.max_element() - self.f90 * grazing) / (1.0 - grazing)
            }
            _ => 0.0,
        };
        film::cosines().map(at).fold(0.0, f32::max).min(1.0)
    }
}
