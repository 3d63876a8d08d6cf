//! Light that only photons bring and of which hardly any has come: the samples cannot tell how much is missing.
//!
//! Photons reach the pixels of a picture as events of a Poisson process. Where `n` of a class have come, and every rate
//! was as likely before, the rate's mean squared distance from `n` is `n + 2`; the scatter of the samples tells `n` of
//! that. The light of two more photons is the rest, which matters only where there are few. Where none has come, the
//! rate is below three with a probability of 95 % (the rule of three), and the scatter tells nothing at all.
//!
//! With `c` the light that one photon adds to the picture, relative to the picture's mean, the squared relative error is
//!
//! ```text
//! u^2 = 1 / (1 / (2 c^2) + 3)
//! ```
//!
//! because a class holds no more than all the light: a share between none and all of it has the mean square 1/3. Where
//! there are several classes, `c^2` is the sum of theirs. `c` is the mean of the photons that have come, each of which
//! all pixels within a kernel gather. Before the first it follows from the flux of a light path, and from the bandwidths
//! and the reflectance of the pixels: a bandwidth far below the distance between photons makes it large.

use crate::estimator::{BandwidthState, FAR, PixelAccumulator};
use crate::math::Vec3;
use crate::photon::{ByKind, Kind};
use crate::plan::{ClassSet, Owner, Part, classes_in};
use crate::render::pass::PhotonCounts;
use crate::render::settings::Settings;
use crate::scene::Scene;
use crate::stat::floor;
use crate::transport::{Indirect, InitialMedia, emitted_flux};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Pixels whose kernels are compared with the picture.
const SAMPLES: usize = 32;

/// What is known of the photons of a render.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PhotonRecord {
    /// Kinds of light that the scene calls for and that come by photons.
    expected: ByKind<bool>,
    /// Flux of all lights, mean of RGB (W).
    flux: f64,
    /// What has come so far.
    pub counts: PhotonCounts,
}

/// A part of the squared error of which the samples do not tell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Unseen {
    /// Squared relative error of the picture.
    pub squared: f64,
    /// The kind of light that most of it is of, and its counts: photons stored, samples that have gathered some.
    pub of: Option<(Kind, [u64; 2])>,
}

impl PhotonRecord {
    /// Nothing has come yet.
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

    /// The error by light of which hardly any has come, after so many light paths.
    pub(in crate::render) fn unseen(
        &self,
        (pixels, bandwidths): (&[PixelAccumulator], &BandwidthState),
        settings: &Settings,
        light_paths: u64,
    ) -> Unseen {
        let own = settings.levels.own();
        let values: Vec<f64> = pixels.iter().map(|pixel| pixel.mean(own).element_sum() / 3.0).collect();
        if light_paths == 0 || values.iter().all(|value| *value == 0.0) {
            return Unseen::default();
        }
        // Without the brightest pixels: a light in sight does not hide what is missing elsewhere.
        let (count, mean) = (pixels.len() as f64, (floor::relative_to_mean(values) / floor::ABSOLUTE).sqrt());
        let per_path = self.flux / light_paths as f64;
        let of_kind = |kind: Kind| {
            let radius2 = |i: usize| {
                let kind = if settings.indirect == Indirect::Paths { Kind::Caustic } else { kind };
                bandwidths.radius2(i, &pixels[i], kind, own)
            };
            let gathered = self.counts.gathered[kind as usize];
            let of_sample = if gathered > 0 {
                part_of(pixels, kind) / gathered as f64
            } else {
                let of_pixel = |i: usize| {
                    let albedo = pixels[i].albedo().element_sum() / 3.0;
                    let density = PI * f64::from(radius2(i));
                    if density > 0.0 { per_path * albedo / (PI * density) } else { 0.0 }
                };
                (0..pixels.len()).map(of_pixel).sum::<f64>() / count
            };
            2.0 * (share_of_kernel(pixels, &radius2) * of_sample / mean).powi(2)
        };
        let kinds = Kind::ALL.into_iter().filter(|kind| self.expected[*kind as usize]);
        let all: Vec<(Kind, f64)> = kinds.map(|kind| (kind, of_kind(kind))).collect();
        let largest = all.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let counts = |kind: Kind| [self.counts.stored, self.counts.gathered].map(|counts| counts[kind as usize]);
        let of_two: f64 = all.iter().map(|(_, squared)| squared).sum();
        let squared = if of_two.is_finite() { of_two / (1.0 + 3.0 * of_two) } else { 1.0 / 3.0 };
        Unseen { squared, of: largest.map(|&(kind, _)| (kind, counts(kind))) }
    }
}

impl Unseen {
    /// Whether it is most of a squared relative error.
    pub fn rules(&self, error: f64) -> bool {
        2.0 * self.squared > error * error
    }

    /// A sentence that says which light was not found and what helps, for the settings of the render.
    pub fn sentence(&self, settings: &Settings) -> Option<String> {
        let (kind, [stored, gathered]) = self.of?;
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

/// The light of a kind, summed over pixels.
fn part_of(pixels: &[PixelAccumulator], kind: Kind) -> f64 {
    let of_pixel = |pixel: &PixelAccumulator| {
        let parts = pixel.parts();
        let part = if kind == Kind::Caustic { parts.caustic } else { parts.indirect };
        part.element_sum() / 3.0 / f64::from(pixel.iterations.max(1))
    };
    pixels.iter().map(of_pixel).sum()
}

/// The share of the pixels that lie within the kernel of one of them, on average: these gather the same photons.
fn share_of_kernel(pixels: &[PixelAccumulator], radius2: &(impl Fn(usize) -> f32 + Sync)) -> f64 {
    let seen: Vec<(usize, Vec3)> = pixels
        .iter()
        .map(PixelAccumulator::first)
        .enumerate()
        .filter(|(_, (z, _))| *z < FAR)
        .map(|(i, (_, p))| (i, p))
        .collect();
    let chosen: Vec<&(usize, Vec3)> = seen.iter().step_by(seen.len().div_ceil(SAMPLES).max(1)).collect();
    let within = |&&(i, p): &&(usize, Vec3)| {
        seen.iter().filter(|(j, other)| i == *j || p.distance_squared(*other) < radius2(i)).count()
    };
    let pairs: Vec<usize> = chosen.par_iter().map(within).collect();
    pairs.iter().sum::<usize>() as f64 / (chosen.len().max(1) * pixels.len().max(1)) as f64
}
