//! Expected number of photons, for memory checks before the first iteration.

use super::photon_tracer::trace_range;
use crate::camera::Camera;
use crate::photon::kind;
use crate::random::Domain;
use crate::render::settings::Settings;
use crate::scene::Scene;
use crate::spectrum::IterationWavelengths;
use crate::transport::{InitialMedia, LightPaths};
use rayon::prelude::*;

/// Number of light paths that are traced to estimate how many photons a render stores.
const SAMPLED_PATHS: u32 = 2048;
/// Number of light paths that are traced together.
const BATCH: u32 = 128;
/// Number of light paths that a thread traces as one unit of work.
const CHUNK: u32 = 16;
/// Number of photons after which no further batch is traced. Closed white rooms have thousands of photons per path.
const MAX_PHOTONS: usize = 1 << 18;

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
    let photons = |first: u32| {
        let photons = trace_range(scene, &initial_media, &pass, first..first + CHUNK);
        kind::count(&photons.surface) + photons.volume.len()
    };
    let (mut traced, mut found) = (0, 0);
    while traced < SAMPLED_PATHS && found < MAX_PHOTONS {
        let chunks = (traced..traced + BATCH).into_par_iter().step_by(CHUNK as usize);
        found += chunks.map(photons).collect::<Vec<usize>>().into_iter().sum::<usize>();
        traced += BATCH;
    }
    found as f64 / f64::from(traced)
}
