//! Learning where light arrives, before the pilot and the first iteration.

use crate::camera::Camera;
use crate::light::{LearntLight, LearntLights, LearntSky, LightSamples, SkySectors};
use crate::math::luminance;
use crate::random::{Domain, Stream};
use crate::render::settings::Settings;
use crate::scene::View;
use crate::transport::{CameraPathStart, InitialMedia, LightBinsOf};
use bumpalo::Bump;
use rayon::prelude::*;
use std::sync::Arc;

/// Number of pixels per path that learns, and bounds of the number of paths. It does not depend on the number of
/// iterations, so that shards and resumed renders learn the same.
const PIXELS_PER_PATH: u64 = 4;
const MIN_PATHS: u64 = 1 << 10;
const MAX_PATHS: u64 = 1 << 15;
/// Number of paths of a trial, which finds scenes where there is nothing to learn. With fewer, a few bright samples hide
/// what there is.
const TRIAL_PATHS: u64 = 1 << 13;
/// Paths per parallel task.
const CHUNK: u64 = 256;

/// Learns where light arrives in the picture of a view: first from which directions of the environment, then from which
/// lights.
pub fn learn_light(view: View<'_>, settings: &Settings) -> LearntLight {
    // A crop window shows a part of the whole picture, to the bit.
    let (scene, camera) = (view.scene, view.camera.uncropped());
    let sky = learn_sky(View::new(scene, &camera), settings).map(Arc::new);
    let learnt = LearntLight { sky, lights: None };
    let under_sky = scene.with_learnt(&learnt);
    let lights = learn_lights(View::new(under_sky.as_ref().unwrap_or(scene), &camera), settings);
    LearntLight { lights: lights.map(Arc::new), ..learnt }
}

fn learn_sky(view: View<'_>, settings: &Settings) -> Option<LearntSky> {
    let environment = view.scene.lights.sky().environment.as_ref()?;
    if luminance(environment.mean()) <= 0.0 {
        return None;
    }
    let sectors = SkySectors::new(environment);
    let samples = samples(view, settings, LightBinsOf::Sky(&sectors))?;
    LearntSky::learn(sectors, &samples)
}

fn learn_lights(view: View<'_>, settings: &Settings) -> Option<LearntLights> {
    let bins = view.scene.lights.bins()?;
    let samples = samples(view, settings, LightBinsOf::Lights(&bins))?;
    LearntLights::learn(bins, &samples)
}

/// Light samples along camera paths; `None` if those of a trial promise nothing, or if the render is stopped.
fn samples(view: View<'_>, settings: &Settings, bins: LightBinsOf<'_>) -> Option<LightSamples> {
    let paths = (pixels(view.camera) / PIXELS_PER_PATH).clamp(MIN_PATHS, MAX_PATHS);
    if 2 * TRIAL_PATHS < paths && !bins.promise(&sample(view, settings, bins, TRIAL_PATHS)?) {
        return None;
    }
    sample(view, settings, bins, paths)
}

/// Light samples along a number of camera paths; `None` if the render is stopped, and some are missing.
fn sample(
    View { scene, camera }: View<'_>,
    settings: &Settings,
    bins: LightBinsOf<'_>,
    paths: u64,
) -> Option<LightSamples> {
    let camera_paths = settings.camera_paths(scene, camera, &InitialMedia::of(scene, camera));
    let (pixels, (width, _)) = (pixels(camera), camera.size());
    let trace = |first: u64| {
        let (mut samples, mut arena) = (LightSamples::default(), Bump::new());
        for index in (first..paths.min(first + CHUNK)).take_while(|_| !camera_paths.is_stopped()) {
            arena.reset();
            let stream = Stream::new(settings.seed, 0, Domain::LearningCamera, index);
            let pixel = index * pixels / paths;
            let at = ((pixel % u64::from(width)) as u32, (pixel / u64::from(width)) as u32);
            let start = CameraPathStart { ray: camera_paths.start(at, stream), stream };
            camera_paths.sample_light(bins, &arena, &start, (index % 2) as usize, &mut samples);
        }
        samples
    };
    let chunks: Vec<u64> = (0..paths).step_by(CHUNK as usize).collect();
    let (mut parts, mut samples) = (Vec::new(), LightSamples::default());
    chunks.into_par_iter().map(trace).collect_into_vec(&mut parts);
    parts.into_iter().for_each(|part| samples.append(part));
    (!camera_paths.is_stopped()).then_some(samples)
}

fn pixels(camera: &Camera) -> u64 {
    let (width, height) = camera.size();
    u64::from(width) * u64::from(height)
}
