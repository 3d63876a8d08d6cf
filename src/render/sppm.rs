//! Stochastic progressive photon mapping with bandwidth levels \[post-reconstruction 2021, sections 3 and 4.1\].
//!
//! An iteration traces light paths, builds a photon map, and then two eye paths per pixel that share nothing but
//! the photons: one measures level 1, the other levels 2 and up, each set of levels with one query per vertex.

use super::control::{Clock, Control, History, Progress, StopReason, cpu_seconds};
use super::result::{Phases, Rendered, relative_error};
use super::settings::Settings;
use crate::camera::{Camera, par_pixels};
use crate::estimator::bandwidth::initial_bandwidths;
use crate::estimator::rule::memoryless::radius2_factor;
use crate::estimator::{InitialBandwidth, Pixel};
use crate::photon::{Photon, PhotonMap};
use crate::random::{Domain, Streams};
use crate::scene::Scene;
use crate::transport::{Eye, EyeMeasure, LevelRadii, LightPass, Scratch, Surroundings, light_path};
use bumpalo::Bump;
use rayon::prelude::*;

/// Light paths per unit of work. Constant, so that the photons' order does not depend on threads.
const CHUNK: u32 = 1024;

/// Traces all light paths of a pass; the photons are ordered by path and vertex.
pub fn trace_photons(scene: &Scene, surroundings: &Surroundings, pass: &LightPass) -> Vec<Photon> {
    let chunks = pass.paths().div_ceil(CHUNK);
    let parts: Vec<Vec<Photon>> = (0..chunks)
        .into_par_iter()
        .map_init(Bump::new, |arena, chunk| {
            let mut photons = Vec::with_capacity(CHUNK as usize * 2);
            for index in chunk * CHUNK..((chunk + 1) * CHUNK).min(pass.paths()) {
                light_path(scene, arena, surroundings, pass, index, &mut photons);
                arena.reset();
            }
            photons
        })
        .collect();
    parts.concat()
}

/// One eye pass: adds iteration `i` (from 1) to all pixels.
fn eye_pass(eye: &Eye<'_>, settings: &Settings, i: u64, photons: &PhotonMap, pixels: &mut [Pixel]) {
    let (width, _) = eye.camera.size();
    let levels = settings.levels;
    let factor = radius2_factor(i, settings.alpha) as f32;
    let [independent, correlated] =
        [Domain::EyeIndependent, Domain::EyeCorrelated].map(|domain| Streams::new(settings.seed, i, domain));
    par_pixels(pixels, width, Scratch::default, |scratch, pixels, places| {
        let waiting = places.iter().flatten().map(|place| pixels[place.at].touch()).sum::<f64>();
        std::hint::black_box(waiting);
        let independent = eye.starts(places, independent);
        let correlated = levels.two_paths.then(|| eye.starts(places, correlated));
        for (k, place) in places.iter().enumerate() {
            let (Some(place), Some(start)) = (place, &independent[k]) else { continue };
            let pixel = &mut pixels[place.at];
            let largest2 = pixel.bandwidth * pixel.bandwidth * factor;
            // Radius squared of level k (from 0) of m: each halves that of the next larger.
            let radius2 = |k: usize| largest2 * 0.5f32.powi((levels.count - 1 - k) as i32);
            let all = LevelRadii::new((0..levels.count).map(radius2));
            match correlated.as_ref().and_then(|starts| starts[k].as_ref()) {
                Some(correlated) => {
                    let independent = eye.measure(scratch, start, photons, &all.part(0..1));
                    let others = if levels.count > 1 { all.part(1..levels.count) } else { all };
                    let correlated = eye.measure(scratch, correlated, photons, &others);
                    keep_first_hit(eye, pixel, &independent);
                    pixel.add(&independent, Some(&correlated), levels.count, levels.own());
                }
                None => {
                    let all = eye.measure(scratch, start, photons, &all);
                    keep_first_hit(eye, pixel, &all);
                    pixel.add(&all, None, levels.count, levels.own());
                }
            }
        }
    });
}

fn keep_first_hit(eye: &Eye<'_>, pixel: &mut Pixel, measure: &EyeMeasure) {
    if let (0, Some(first)) = (pixel.iterations, measure.first) {
        pixel.z = eye.camera.depth(first.p);
        pixel.p = (first.p.as_dvec3() + eye.scene.origin).as_vec3();
    }
}

/// Renders. `observe` is called after every iteration and may stop the render; it also gets the pixels, to show or save them.
pub fn sppm(
    scene: &Scene,
    camera: &Camera,
    settings: &Settings,
    mut observe: impl FnMut(&Progress, &[Pixel]) -> Control,
) -> Rendered {
    let clock = Clock::start();
    let cpu_start = cpu_seconds();
    let (width, height) = camera.size();
    let mut phases = Phases::default();
    let surroundings = Surroundings::new(scene, camera.position());
    let eye = Eye { scene, camera, interior: surroundings.eye, max_depth: settings.max_depth };
    let pilot = if matches!(settings.initial, InitialBandwidth::Nearest(_)) {
        let pass = LightPass::new(settings.seed, 0, Domain::PilotLight, settings.photons, settings.max_depth);
        PhotonMap::build(trace_photons(scene, &surroundings, &pass))
    } else {
        PhotonMap::build(Vec::new())
    };
    let bandwidths = initial_bandwidths(&eye, settings.initial, settings.seed, &pilot);
    drop(pilot);
    let mut pixels: Vec<Pixel> = bandwidths.into_iter().map(Pixel::new).collect();
    phases.pilot = cpu_seconds() - cpu_start;
    let pilot_seconds = clock.seconds();

    let mut history = Vec::new();
    let mut next_record = 1u64;
    let (mut done, mut light_paths, mut stop) = (0u64, 0u64, StopReason::Iterations);
    let mut iteration = settings.shard.index;
    while settings.iterations.is_none_or(|n| iteration < n) {
        let t0 = cpu_seconds();
        // Iterations count from 1; pass 0 is the pilot's.
        let i = iteration + 1;
        let pass = LightPass::new(settings.seed, i, Domain::Light, settings.photons, settings.max_depth);
        let photons = trace_photons(scene, &surroundings, &pass);
        let t1 = cpu_seconds();
        let map = PhotonMap::build(photons);
        let t2 = cpu_seconds();
        eye_pass(&eye, settings, i, &map, &mut pixels);
        let seconds = clock.seconds();
        phases.light += t1 - t0;
        phases.map += t2 - t1;
        phases.eye += cpu_seconds() - t2;
        done += 1;
        light_paths += u64::from(settings.photons);
        iteration += settings.shard.count;

        let total = settings.iterations.map(|n| n.saturating_sub(settings.shard.index).div_ceil(settings.shard.count));
        // The error costs a look at every pixel: at powers of sqrt(2), and whenever it may stop the render.
        let record = done >= next_record || Some(done) == total;
        let error =
            if record || settings.target_error.is_some() { relative_error(&pixels, settings.levels) } else { None };
        if record {
            next_record = (done as f64 * std::f64::consts::SQRT_2).ceil() as u64;
            let cpu_seconds = cpu_seconds() - cpu_start;
            history.push(History { seconds, cpu_seconds, iterations: done, light_paths, error });
        }
        let per_iteration = (seconds - pilot_seconds) / done as f64;
        let by_count = total.map(|n| (n - done) as f64 * per_iteration);
        let by_time = settings.time.map(|t| (t - seconds).max(0.0));
        let remaining = match (by_count, by_time) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
        let error = error.or_else(|| history.last().and_then(|h| h.error));
        let progress = Progress {
            iteration: done,
            iterations: total,
            seconds,
            remaining,
            light_paths,
            photons: map.photons().len(),
            error,
        };
        if observe(&progress, &pixels) == Control::Stop {
            stop = StopReason::Interrupted;
            break;
        }
        if settings.time.is_some_and(|t| seconds >= t) {
            stop = StopReason::Time;
            break;
        }
        if settings.target_error.is_some_and(|e| error.is_some_and(|x| x <= e)) {
            stop = StopReason::Error;
            break;
        }
    }
    let seconds = clock.seconds();
    if history.last().is_none_or(|h| h.iterations != done) && done > 0 {
        let error = relative_error(&pixels, settings.levels);
        history.push(History { seconds, cpu_seconds: cpu_seconds() - cpu_start, iterations: done, light_paths, error });
    }
    Rendered {
        width,
        height,
        pixels,
        settings: settings.clone(),
        iterations: done,
        light_paths,
        seconds,
        phases,
        history,
        stop,
    }
}
