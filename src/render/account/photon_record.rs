//! Light that only photons bring and of which hardly any has arrived: the scatter of the samples does not show how much
//! is missing.
//!
//! Photons reach the pixels of a picture as events of a Poisson process. With a flat prior over the rate, after `n`
//! photons of a kind the rate's mean squared distance from `n` is `n + 2`. The scatter of the samples accounts for `n`
//! of it; the light of two more photons is missing from the estimated error, which matters only where `n` is small.
//! Where no photon has arrived, the rate is below three with a probability of 95 % (the rule of three), and the samples
//! have no scatter at all.
//!
//! With `c` the light that one photon adds to the picture, relative to the picture's mean, the squared relative error is
//!
//! ```text
//! u^2 = 1 / (1 / (2 c^2) + 3)
//! ```
//!
//! because one kind of light is at most all light of the picture: a share drawn uniformly from 0 to 1 has the mean
//! square 1/3. With several kinds, `c^2` is the sum over kinds. `c` is the mean over the photons that have arrived, times
//! the number of pixels within one kernel, which all gather the same photon. Before the first photon arrives, `c`
//! follows from the flux of a light path, and from the bandwidths and the reflectance of the pixels: a bandwidth far
//! below the distance between photons makes it large.

use super::pixel_state::PixelState;
use crate::estimator::{FAR, PixelAccumulator};
use crate::math::Vec3;
use crate::path_class::{ClassSet, Part, classes_in};
use crate::photon::{ByKind, Kind};
use crate::plan::Owner;
use crate::render::pass::PhotonCounts;
use crate::render::settings::Settings;
use crate::scene::Scene;
use crate::stat::floor;
use crate::transport::{InitialMedia, emitted_flux};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Number of sampled pixels whose photon kernels are compared with the places of all pixels.
const KERNEL_SAMPLES: usize = 32;

/// Photons that a render is expected to store, and numbers of those stored and gathered so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PhotonRecord {
    /// For each kind of photons (caustic or indirect), whether the scene has such light and photons carry it.
    expected: ByKind<bool>,
    /// Flux of all lights, mean of RGB (W).
    flux: f64,
    /// Photons stored and gathered so far.
    pub counts: PhotonCounts,
}

/// Error by light that should come by photons of which hardly any have arrived. The scatter of the samples does not
/// show it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UnseenLight {
    /// Squared relative error of the picture by this light.
    pub squared: f64,
    /// The kind of photons that contributes most of this error; `None` while nothing is estimated.
    pub largest: Option<UnseenKind>,
}

/// Counts of one kind of photons, caustic or indirect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnseenKind {
    kind: Kind,
    stored: u64,
    gathered: u64,
}

impl PhotonRecord {
    /// Makes the record of a render before its first iteration.
    pub(in crate::render) fn new(scene: &Scene, settings: &Settings, initial_media: &InitialMedia) -> PhotonRecord {
        let search = settings.search();
        let owned = [Owner::Photons, Owner::Connections].map(|owner| search.owned_by(owner));
        let classes = owned.into_iter().fold(ClassSet::NONE, ClassSet::and) & settings.classes;
        let classes = classes & classes_in(&scene.survey);
        let by_photons = settings.method.has_bandwidths();
        let expected = [Part::Indirect, Part::Caustic].map(|part| by_photons && classes.has_part(part));
        let flux = if by_photons { emitted_flux(scene, initial_media).element_sum() / 3.0 } else { 0.0 };
        PhotonRecord { expected, flux, counts: PhotonCounts::default() }
    }

    /// Estimates the error by light that photons have hardly brought, after `light_paths` light paths.
    pub(in crate::render) fn unseen(&self, state: &PixelState<'_>, light_paths: u64) -> UnseenLight {
        let kinds: Vec<Kind> = Kind::ALL.into_iter().filter(|kind| self.expected[*kind as usize]).collect();
        if kinds.is_empty() || light_paths == 0 || state.values.iter().all(|value| *value == 0.0) {
            return UnseenLight::default();
        }
        // The floor ignores the brightest pixels: a visible light does not hide what is missing elsewhere.
        let mean = (state.floor / floor::ABSOLUTE).sqrt();
        let flux_per_path = self.flux / light_paths as f64;
        let kernels = Kernels::new(state.pixels);
        let squared_error = |kind: Kind| {
            let light = self.light_per_sample(state, kind, flux_per_path);
            2.0 * (kernels.mean_share(|index| state.bandwidth2(index, kind)) * light / mean).powi(2)
        };
        let errors: Vec<(Kind, f64)> = kinds.into_iter().map(|kind| (kind, squared_error(kind))).collect();
        let sum: f64 = errors.iter().map(|(_, squared)| squared).sum();
        let squared = if sum.is_finite() { sum / (1.0 + 3.0 * sum) } else { 1.0 / 3.0 };
        let largest = errors.iter().max_by(|a, b| a.1.total_cmp(&b.1)).map(|&(kind, _)| UnseenKind {
            kind,
            stored: self.counts.stored[kind as usize],
            gathered: self.counts.gathered[kind as usize],
        });
        UnseenLight { squared, largest }
    }

    /// Radiance that one photon adds to the mean of a pixel that gathers it: the average over the samples that have
    /// gathered photons, or, before the first one, a prediction from the flux of a light path.
    fn light_per_sample(&self, state: &PixelState<'_>, kind: Kind, flux_per_path: f64) -> f64 {
        let gathered = self.counts.gathered[kind as usize];
        if gathered > 0 {
            return light_sum(state.pixels, kind) / gathered as f64;
        }
        let predict = |index: usize| {
            let albedo = state.pixels[index].albedo().element_sum() / 3.0;
            let area = PI * f64::from(state.bandwidth2(index, kind));
            if area > 0.0 { flux_per_path * albedo / (PI * area) } else { 0.0 }
        };
        (0..state.pixels.len()).map(predict).sum::<f64>() / state.pixels.len() as f64
    }
}

impl UnseenLight {
    /// Whether the squared error by unseen light is more than half of the square of the relative error `error`.
    pub fn dominates(&self, error: f64) -> bool {
        2.0 * self.squared > error * error
    }

    /// A sentence for users that names the missing light and the options that help; `None` if nothing is estimated.
    pub fn sentence(&self, settings: &Settings) -> Option<String> {
        let UnseenKind { kind, stored, gathered } = self.largest?;
        let light = match kind {
            Kind::Indirect => "indirect light",
            Kind::Caustic => "caustics",
        };
        let found = match gathered {
            0 => format!("no photon of {light} has reached the picture ({stored} are elsewhere)"),
            1 => format!("one sample alone has met photons of {light} ({stored} are there)"),
            _ => format!("{gathered} samples alone have met photons of {light} ({stored} are there)"),
        };
        let photons = if settings.method.gathers() { " or --photons" } else { "" };
        Some(format!(
            "{found}: the estimated error cannot tell how much of this light is missing; raise --iterations{photons} or --initial-bandwidth, or try another --method"
        ))
    }
}

/// Sum over pixels of the mean radiance that photons of a kind have brought.
fn light_sum(pixels: &[PixelAccumulator], kind: Kind) -> f64 {
    let of_pixel = |pixel: &PixelAccumulator| {
        let parts = pixel.parts();
        let part = if kind == Kind::Caustic { parts.caustic } else { parts.indirect };
        part.element_sum() / 3.0 / f64::from(pixel.iterations.max(1))
    };
    pixels.iter().map(of_pixel).sum()
}

/// First hits of the pixels that see a surface, to compare kernels with.
struct Kernels {
    /// Number of pixels of the picture.
    count: usize,
    /// For each sampled pixel that sees a surface, its index and the point where its first camera path hit the surface.
    hits: Vec<(usize, Vec3)>,
}

impl Kernels {
    fn new(pixels: &[PixelAccumulator]) -> Kernels {
        let first = pixels.iter().map(PixelAccumulator::first).enumerate();
        let hits = first.filter(|(_, (z, _))| *z < FAR).map(|(index, (_, p))| (index, p)).collect();
        Kernels { count: pixels.len(), hits }
    }

    /// Share of the picture's pixels that lie within the kernel of one pixel and so gather the same photons: the mean
    /// over [`KERNEL_SAMPLES`] pixels. `bandwidth2` is the squared kernel bandwidth of a pixel.
    fn mean_share(&self, bandwidth2: impl Fn(usize) -> f32 + Sync) -> f64 {
        let step = self.hits.len().div_ceil(KERNEL_SAMPLES).max(1);
        let sampled: Vec<(Vec3, f32)> = self.hits.iter().step_by(step).map(|&(i, p)| (p, bandwidth2(i))).collect();
        // A pixel is in its own kernel, also where that has no size.
        let within = |&(p, bandwidth2): &(Vec3, f32)| {
            let inside = self.hits.iter().filter(|(_, other)| p.distance_squared(*other) < bandwidth2);
            inside.count().max(1)
        };
        let pairs: Vec<usize> = sampled.par_iter().map(within).collect();
        pairs.iter().sum::<usize>() as f64 / (sampled.len().max(1) * self.count.max(1)) as f64
    }
}
