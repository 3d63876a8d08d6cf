//! Rendering by whole paths: the loop over iterations, when it stops, and what it reports.

use super::bidirectional::{Method, Passes};
use super::control::{Clock, Control, History, Progress, StopReason, cpu_seconds};
use super::result::{Phases, Rendered, relative_error};
use super::settings::{Levels, Settings};
use crate::camera::Camera;
use crate::estimator::bandwidth::initial_bandwidths;
use crate::estimator::{InitialBandwidth, Pixel};
use crate::photon::PhotonMap;
use crate::scene::Scene;
use crate::transport::{Eye, Surroundings};

/// Renders with one path of each kind per pixel and iteration (two with bandwidth levels). `observe` is called after every iteration and
/// may stop the render; it also gets the pixels, to show or save them.
///
/// Methods without bandwidth levels write one. `settings.photons` is not used: there are as many light paths as pixels. Bandwidths
/// start from the pixel's footprint unless they are fixed.
pub fn paths(
    scene: &Scene,
    camera: &Camera,
    settings: &Settings,
    method: Method,
    mut observe: impl FnMut(&Progress, &[Pixel]) -> Control,
) -> Rendered {
    let clock = Clock::start();
    let cpu_start = cpu_seconds();
    let mut settings = settings.clone();
    if !method.has_levels() {
        settings.levels = Levels::new(1);
    }
    let settings = &settings;
    let (width, height) = camera.size();
    let surroundings = Surroundings::new(scene, camera.position());
    let mut pixels: Vec<Pixel> = if method.merges() {
        let eye = Eye { scene, camera, interior: surroundings.eye, max_depth: settings.max_depth };
        let initial = match settings.initial {
            InitialBandwidth::Fixed(radius) => InitialBandwidth::Fixed(radius),
            _ => InitialBandwidth::Footprint,
        };
        let none = PhotonMap::build(Vec::new());
        initial_bandwidths(&eye, initial, settings.seed, &none).into_iter().map(Pixel::new).collect()
    } else {
        vec![Pixel::new(0.0); width as usize * height as usize]
    };
    let mut passes = Passes::new(scene, camera, settings, &surroundings, method);
    let mut phases = Phases { pilot: cpu_seconds() - cpu_start, ..Phases::default() };
    let pilot_seconds = clock.seconds();

    let mut history = Vec::new();
    let mut next_record = 1u64;
    let (mut done, mut light_paths, mut stop) = (0u64, 0u64, StopReason::Iterations);
    let mut iteration = settings.shard.index;
    let total = settings.iterations.map(|n| n.saturating_sub(settings.shard.index).div_ceil(settings.shard.count));
    while settings.iterations.is_none_or(|n| iteration < n) {
        let (walked, photons) = passes.iterate(iteration + 1, &mut pixels);
        let seconds = clock.seconds();
        // Light and eye paths take turns within a pixel.
        phases.eye = cpu_seconds() - cpu_start - phases.pilot;
        done += 1;
        light_paths += walked;
        iteration += settings.shard.count;

        // The error costs a look at every pixel: at powers of sqrt(2), and whenever it may stop the render.
        let record = done >= next_record || Some(done) == total;
        let wanted = record || settings.target_error.is_some();
        let error = if wanted { relative_error(&pixels, settings.levels) } else { None };
        if record {
            next_record = (done as f64 * std::f64::consts::SQRT_2).ceil() as u64;
            let cpu_seconds = cpu_seconds() - cpu_start;
            history.push(History { seconds, cpu_seconds, iterations: done, light_paths, error });
        }
        let by_count = total.map(|n| (n - done) as f64 * (seconds - pilot_seconds) / done as f64);
        let by_time = settings.time.map(|t| (t - seconds).max(0.0));
        let remaining = match (by_count, by_time) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
        let error = error.or_else(|| history.last().and_then(|h: &History| h.error));
        let progress = Progress { iteration: done, iterations: total, seconds, remaining, light_paths, photons, error };
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
