//! Expected number of photons, for memory checks before the first iteration.

use super::photon_tracer::trace_photons;
use crate::camera::Camera;
use crate::photon::kind;
use crate::random::Domain;
use crate::render::settings::Settings;
use crate::scene::Scene;
use crate::spectrum::IterationWavelengths;
use crate::transport::{InitialMedia, LightPaths};

/// Number of light paths that are traced to estimate how many photons a render stores.
const SAMPLED_PATHS: u32 = 2048;

/// Mean number of photons that a light path stores on surfaces and in media: below 1 if most of the light misses the
/// scene, many in a closed white room. For methods that merge light paths, every vertex counts as a photon.
pub fn photons_per_path(scene: &Scene, camera: &Camera, settings: &Settings) -> f64 {
    let initial_media = InitialMedia::new(scene, camera.position());
    let pass = LightPaths::new(settings.seed, 0, Domain::PilotLight, SAMPLED_PATHS, settings.max_depth)
        .with(IterationWavelengths::new(settings.seed, 0));
    let pass = match settings.method.takes_photon_count() {
        true => pass.wanting(settings.photon_classes(&scene.survey), settings.indirect),
        false => pass,
    };
    let photons = trace_photons(scene, &initial_media, &pass);
    (kind::count(&photons.surface) + photons.volume.len()) as f64 / f64::from(SAMPLED_PATHS)
}
