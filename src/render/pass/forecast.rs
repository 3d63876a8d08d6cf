//! What light paths will leave, told by a few of them before there is any memory for all.

use super::photon_tracer::trace_photons;
use crate::camera::Camera;
use crate::photon::kind;
use crate::random::Domain;
use crate::render::settings::Settings;
use crate::scene::Scene;
use crate::spectrum::IterationWavelengths;
use crate::transport::{InitialMedia, LightPaths};

/// Light paths looked at.
const SAMPLES: u32 = 2048;

/// Photons that a light path leaves on average, on surfaces and in media: a fraction of one where most of the light
/// misses the scene, many in a closed white room. Where light paths are merged every vertex is one.
pub fn photons_per_path(scene: &Scene, camera: &Camera, settings: &Settings) -> f64 {
    let initial_media = InitialMedia::new(scene, camera.position());
    let pass = LightPaths::new(settings.seed, 0, Domain::PilotLight, SAMPLES, settings.max_depth)
        .with(IterationWavelengths::new(settings.seed, 0));
    let pass = match settings.method.takes_photon_count() {
        true => pass.wanting(settings.photon_classes(&scene.survey), settings.indirect),
        false => pass,
    };
    let photons = trace_photons(scene, &initial_media, &pass);
    (kind::count(&photons.surface) + photons.volume.len()) as f64 / f64::from(SAMPLES)
}
