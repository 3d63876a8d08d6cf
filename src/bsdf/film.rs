//! Thin films, whose interference tints reflections \[Belcour and Barla 2017, "A Practical Extension to Microfacet Theory
//! for the Modeling of Varying Iridescence"\].
//!
//! A film with amplitude reflectances a at its top and b at its bottom transmits, at the phase phi of a round trip \[Airy's
//! formula\],
//!
//! `(1 - a^2) (1 - b^2) / |1 + a b e^(i phi)|^2 = (1 - a^2) (1 - b^2) / (1 - a^2 b^2) (1 + 2 sum_m (-a b)^m cos(m phi))`,
//!
//! and reflects the rest. The mean of each cosine over the wavelengths of a colour channel is a function of the path
//! difference alone ([`observer::interference`]), so films of any thickness need no table of their own. A film without
//! losses reflects equally from both sides, at angles that refraction joins.

use super::Parameters;
use super::fresnel::{normal_incidence, schlick};
use crate::math::{Rgb, sqr};
use crate::spectrum::observer;

/// Number of terms of the series, for errors below 0.02 at grazing angles and far less at others.
const TERMS: usize = 5;
/// Largest reflectance at normal incidence of the base, which keeps its index of refraction finite.
const MAX_BASE: f32 = 0.9999;
/// Number of cosines over which reflectances are averaged.
const COSINES: usize = 16;

/// A thin film on an interface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Film {
    /// Share of the surface that the film covers, 0 to 1.
    pub strength: f32,
    /// Index of refraction of the film over the index of the medium above.
    eta: f32,
    /// Optical path (nm) through the film and back at normal incidence.
    path: f32,
}

/// Amplitude reflectances of an interface of relative index `eta` for the two polarisations \[Fresnel's equations\], from
/// the cosines of the incident and the refracted ray.
#[inline]
fn amplitudes(cos_o: f32, cos_t: f32, eta: f32) -> [f32; 2] {
    [(cos_o - eta * cos_t) / (cos_o + eta * cos_t), (eta * cos_o - cos_t) / (eta * cos_o + cos_t)]
}

/// Index of refraction of a dielectric with this reflectance at normal incidence.
#[inline]
fn index(f0: f32) -> f32 {
    let root = f0.clamp(0.0, MAX_BASE).sqrt();
    (1.0 + root) / (1.0 - root)
}

/// Index of refraction per channel, relative to the medium above, of a dielectric of relative index `eta` whose
/// reflectance at normal incidence is multiplied by `color`.
pub(super) fn dielectric_index(eta: f32, color: Rgb) -> Rgb {
    let indices = (color * normal_incidence(eta)).map(index);
    if eta < 1.0 { indices.recip() } else { indices }
}

impl Film {
    /// The film that the parameters of a BSDF describe; `None` without one.
    pub fn new(p: &Parameters) -> Option<Film> {
        // Refraction at a rough interface of matched indices is not defined, and the interface is skipped.
        let hidden = super::fresnel::is_matched(p.eta) && p.transmission * (1.0 - p.metallic) > 0.0 && !p.thin;
        let exists = p.film > 0.0 && p.film_path > 0.0 && p.film_eta > 0.0 && p.film_eta.is_finite() && !hidden;
        exists.then_some(Film { strength: p.film, eta: p.film_eta, path: p.film_path })
    }

    /// Reflectance of a film over a base of these indices of refraction, relative to the medium above the film, where
    /// light in that medium arrives at cosine `cos`.
    #[inline(never)]
    pub fn reflectance(&self, cos: f32, base: Rgb) -> Rgb {
        let sin2 = (1.0 - sqr(cos)).max(0.0);
        let sin2_film = sin2 / sqr(self.eta);
        if sin2_film >= 1.0 {
            return Rgb::ONE;
        }
        let cos_film = (1.0 - sin2_film).sqrt();
        let path = self.path * cos_film;
        let means: [Rgb; TERMS] = std::array::from_fn(|m| observer::interference((m + 1) as f32 * path));
        let top = amplitudes(cos, cos_film, self.eta);
        let of_channel = |c: usize| {
            let sin2_base = sin2 / sqr(base[c]);
            if sin2_base >= 1.0 {
                return 1.0;
            }
            let bottom = amplitudes(cos_film, (1.0 - sin2_base).sqrt(), base[c] / self.eta);
            let transmitted: f32 = (0..2)
                .map(|polarisation| {
                    let (a, b) = (top[polarisation], bottom[polarisation]);
                    let round = -a * b;
                    let series = means.iter().rev().fold(0.0, |sum, mean| round * (mean[c] + sum));
                    (1.0 - a * a) * (1.0 - b * b) * (1.0 + 2.0 * series) / (1.0 - round * round).max(1e-9)
                })
                .sum();
            (1.0 - 0.5 * transmitted).clamp(0.0, 1.0)
        };
        Rgb::new(of_channel(0), of_channel(1), of_channel(2))
    }

    /// Reflectance of metal of colour `f0`, of which the film covers its share.
    #[inline]
    pub fn over_metal(&self, f0: Rgb, cos: f32) -> Rgb {
        schlick(f0, cos).lerp(self.reflectance(cos, f0.map(index)), self.strength)
    }
}

/// Cosines and their weights for averages over the hemisphere, weighted by the cosine.
pub(super) fn cosines() -> impl Iterator<Item = f32> {
    (0..COSINES).map(|k| ((k as f32 + 0.5) / COSINES as f32).sqrt())
}

/// Mean of a reflectance over the hemisphere, weighted by the cosine.
pub(super) fn average(reflectance: impl Fn(f32) -> Rgb) -> Rgb {
    cosines().map(reflectance).sum::<Rgb>() / COSINES as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::fresnel::dielectric;

    fn film(eta: f32, path: f32) -> Film {
        Film { strength: 1.0, eta, path }
    }

    /// Reflectance at one wavelength by the complex form of Airy's formula, without a series.
    fn airy(cos: f32, eta: f32, base: f32, turns: f32) -> f32 {
        let sin2 = 1.0 - cos * cos;
        let cos_film = (1.0 - sin2 / (eta * eta)).sqrt();
        let (top, bottom) =
            (amplitudes(cos, cos_film, eta), amplitudes(cos_film, (1.0 - sin2 / (base * base)).sqrt(), base / eta));
        let (sin, cos) = (std::f32::consts::TAU * turns * cos_film).sin_cos();
        let of = |k: usize| {
            let (a, b) = (top[k], bottom[k]);
            (sqr(a + b * cos) + sqr(b * sin)) / (sqr(1.0 + a * b * cos) + sqr(a * b * sin))
        };
        0.5 * (of(0) + of(1))
    }

    /// The mean of Airy's formula over the wavelengths of each channel, within 0.01 for bases from water to silver.
    #[test]
    fn reflectance_is_the_mean_over_wavelengths() {
        for (eta, base, path) in [(1.33, 1.5, 800.0f32), (2.0, 1.5, 1600.0), (1.8, 40.0, 700.0), (2.5, 5.0, 3000.0)] {
            for cos in [1.0f32, 0.7, 0.3, 0.05] {
                const SAMPLES: usize = 4000;
                let mean = (0..SAMPLES)
                    .map(|k| {
                        let (nm, weight) = observer::sample((k as f32 + 0.5) / SAMPLES as f32);
                        weight * airy(cos, eta, base, path / nm)
                    })
                    .sum::<Rgb>()
                    / SAMPLES as f32;
                let found = film(eta, path).reflectance(cos, Rgb::splat(base));
                assert!((found - mean).abs().max_element() < 0.01, "{eta} {base} {path} {cos}: {found} is not {mean}");
            }
        }
    }

    /// A film without thickness, of the index above or of the base, has no effect, and a thick one is not coloured.
    #[test]
    fn limits_of_thickness_and_index() {
        for cos in [1.0f32, 0.6, 0.2] {
            let plain = Rgb::splat(dielectric(cos, 1.5).0);
            for film in [film(1.8, 1e-3), film(1.5, 700.0), film(1.0, 700.0)] {
                let found = film.reflectance(cos, Rgb::splat(1.5));
                assert!((found - plain).abs().max_element() < 2e-3, "{film:?} {cos}: {found} is not {plain}");
            }
            let thick = film(1.8, 1e6).reflectance(cos, Rgb::splat(1.5));
            assert!(thick.max_element() - thick.min_element() < 1e-3 && thick.x > plain.x, "{cos}: {thick}");
        }
    }
}
