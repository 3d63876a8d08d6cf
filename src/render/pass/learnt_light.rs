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
/// Share of the paths that a trial takes, which finds scenes where there is nothing to learn. Small pictures have none.
const TRIAL_SHARE: u64 = 8;
const MIN_PATHS: u64 = 1 << 10;
const MAX_PATHS: u64 = 1 << 15;
/// Paths per parallel task.
const CHUNK: u64 = 256;

/// Learns where light arrives in the picture of a view: first from which directions of the environment, then from which
/// lights.
pub fn learn_light(view: View<'_>, settings: &Settings) -> LearntLight {
    let sky = learn_sky(view, settings).map(Arc::new);
    let learnt = LearntLight { sky, lights: None };
    let scene = (!learnt.is_empty()).then(|| view.scene.with_learnt(&learnt));
    let lights = learn_lights(View::new(scene.as_ref().unwrap_or(view.scene), view.camera), settings);
    LearntLight { lights: lights.map(Arc::new), ..learnt }
}

fn learn_sky(view: View<'_>, settings: &Settings) -> Option<LearntSky> {
    let environment = view.scene.lights.sky().environment.as_ref()?;
    if luminance(environment.mean()) <= 0.0 {
        return None;
    }
    let sectors = SkySectors::new(environment);
    let samples = samples(view, settings, LightBinsOf::Sky(&sectors), |trial| sectors.promise(trial))?;
    LearntSky::learn(sectors, &samples)
}

fn learn_lights(view: View<'_>, settings: &Settings) -> Option<LearntLights> {
    let bins = view.scene.lights.bins()?;
    let samples = samples(view, settings, LightBinsOf::Lights(&bins), |trial| bins.promise(trial))?;
    LearntLights::learn(bins, &samples)
}

/// Light samples along camera paths; `None` if those of a trial do not `promise` less noise, or if the render is stopped.
fn samples(
    view: View<'_>,
    settings: &Settings,
    bins: LightBinsOf<'_>,
    promise: impl Fn(&LightSamples) -> bool,
) -> Option<LightSamples> {
    let (width, height) = view.camera.uncropped().size();
    let paths = (u64::from(width) * u64::from(height) / PIXELS_PER_PATH).clamp(MIN_PATHS, MAX_PATHS);
    let trial = (paths / TRIAL_SHARE).max(MIN_PATHS);
    if 2 * trial < paths && !promise(&sample(view, settings, bins, trial)?) {
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
    // A crop window shows a part of the whole picture, to the bit.
    let camera: &Camera = &camera.uncropped();
    let camera_paths = settings.camera_paths(scene, camera, &InitialMedia::of(scene, camera));
    let (width, height) = camera.size();
    let pixels = u64::from(width) * u64::from(height);
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
