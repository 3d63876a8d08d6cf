//! Learning where light of the environment arrives, before the pilot and the first iteration.

use crate::camera::Camera;
use crate::light::{LearntSky, SkySamples};
use crate::math::luminance;
use crate::random::{Domain, Stream};
use crate::render::settings::Settings;
use crate::scene::View;
use crate::transport::{CameraPathStart, InitialMedia};
use bumpalo::Bump;
use rayon::prelude::*;
use std::sync::Arc;

/// Number of pixels per path that learns, and bounds of the number of paths. It does not depend on the number of
/// iterations, so that shards and resumed renders learn the same.
const PIXELS_PER_PATH: u64 = 4;
const MIN_PATHS: u64 = 1 << 10;
const MAX_PATHS: u64 = 1 << 15;
/// Paths per parallel task.
const CHUNK: u64 = 256;

/// Learns where light of the environment arrives in the picture of a view; `None` if that would not reduce the noise.
pub fn learn_sky(View { scene, camera }: View<'_>, settings: &Settings) -> Option<Arc<LearntSky>> {
    let environment = scene.lights.sky().environment.as_ref()?;
    if luminance(environment.mean()) <= 0.0 {
        return None;
    }
    // A crop window shows a part of the whole picture, to the bit.
    let camera: &Camera = &camera.uncropped();
    let camera_paths = settings.camera_paths(scene, camera, &InitialMedia::of(scene, camera));
    let (width, height) = camera.size();
    let pixels = u64::from(width) * u64::from(height);
    let paths = (pixels / PIXELS_PER_PATH).clamp(MIN_PATHS, MAX_PATHS);
    let trace = |first: u64| {
        let (mut samples, mut arena) = (SkySamples::default(), Bump::new());
        for index in (first..paths.min(first + CHUNK)).take_while(|_| !camera_paths.is_stopped()) {
            arena.reset();
            let stream = Stream::new(settings.seed, 0, Domain::SkyCamera, index);
            let pixel = index * pixels / paths;
            let at = ((pixel % u64::from(width)) as u32, (pixel / u64::from(width)) as u32);
            let start = CameraPathStart { ray: camera_paths.start(at, stream), stream };
            camera_paths.sample_sky(environment, &arena, &start, (index % 2) as usize, &mut samples);
        }
        samples
    };
    let chunks: Vec<u64> = (0..paths).step_by(CHUNK as usize).collect();
    let (mut parts, mut samples) = (Vec::new(), SkySamples::default());
    chunks.into_par_iter().map(trace).collect_into_vec(&mut parts);
    parts.into_iter().for_each(|part| samples.append(part));
    if camera_paths.is_stopped() {
        // Some paths are missing. The render is aborted, too.
        return None;
    }
    LearntSky::learn(environment, &samples).map(Arc::new)
}
