//! The loop over iterations that all methods share: when it stops, and what it reports.

use super::bidirectional::Passes;
use super::control::{Clock, Control, History, Progress, StopReason, cpu_seconds};
use super::counting::Counting;
use super::method::Method;
use super::pm::Pm;
use super::result::{Phases, Rendered, relative_error};
use super::settings::{KernelChoice, Levels, RadiusRule, Settings};
use super::sppm::Sppm;
use super::techniques::TechniquePicture;
use crate::camera::Camera;
use crate::estimator::Pixel;
use crate::estimator::rule::adaptive::Adaptive;
use crate::estimator::rule::chi_squared::ChiSquared;
use crate::estimator::rule::local::LocalStatistics;
use crate::photon::kernel;
use crate::scene::Scene;
use crate::transport::Surroundings;

/// What an iteration has done.
pub(super) struct Work {
    /// Light paths walked.
    pub light_paths: u64,
    /// Photons of the map used.
    pub photons: usize,
}

/// The passes of a method.
pub(super) trait Iterate {
    /// The pixels before the first iteration.
    fn pixels(&mut self) -> Vec<Pixel>;
    /// Adds iteration `i` (from 1) to all pixels, and what it cost to `phases`.
    fn iterate(&mut self, i: u64, pixels: &mut [Pixel], phases: &mut Phases) -> Work;
    /// Bandwidths of every pixel and level after the last iteration, of methods where they do not follow from the iteration.
    fn radii(&mut self) -> Vec<f32> {
        Vec::new()
    }
    /// Pictures per technique after so many iterations, of methods that have them.
    fn techniques(&mut self, iterations: u64) -> Vec<TechniquePicture> {
        let _ = iterations;
        Vec::new()
    }
}

/// Renders. `observe` is called after every iteration and may stop the render; it also gets the pixels, to show or save them.
///
/// Methods without bandwidth levels write one. With [`Method::Path`] and the methods that merge or connect, `settings.photons` is not used:
/// there are as many light paths as eye paths, or none.
pub fn render(
    scene: &Scene,
    camera: &Camera,
    settings: &Settings,
    observe: impl FnMut(&Progress, &[Pixel]) -> Control,
) -> Rendered {
    let mut settings = settings.clone();
    if !settings.method.has_levels() {
        settings.levels = Levels::new(1);
    }
    let surroundings = Surroundings::new(scene, camera.position());
    match settings.method {
        Method::Ppm | Method::Sppm | Method::Appm | Method::Cppm => {
            gathering(Sppm::new(scene, camera, &settings, &surroundings), camera, &settings, observe)
        }
        Method::Pm => drive(Pm::new(scene, camera, &settings, &surroundings), camera, &settings, observe),
        _ => drive(Passes::new(scene, camera, &settings, &surroundings), camera, &settings, observe),
    }
}

/// Progressive photon mapping by the rule that the settings say.
fn gathering(
    sppm: Sppm<'_>,
    camera: &Camera,
    settings: &Settings,
    observe: impl FnMut(&Progress, &[Pixel]) -> Control,
) -> Rendered {
    macro_rules! counting {
        ($rule:expr, $kernel:expr) => {
            drive(Counting::new(sppm, settings, $rule, $kernel), camera, settings, observe)
        };
    }
    match (settings.method, settings.radius_rule, settings.kernel) {
        (Method::Cppm, ..) => counting!(ChiSquared::new(&settings.chi_squared), kernel::Box),
        (Method::Appm, _, KernelChoice::Box) => counting!(Adaptive::<kernel::Box>::default(), kernel::Box),
        (Method::Appm, _, KernelChoice::Epanechnikov) => {
            counting!(Adaptive::<kernel::Epanechnikov>::default(), kernel::Epanechnikov)
        }
        (Method::Appm, _, KernelChoice::Gaussian) => {
            counting!(Adaptive::<kernel::Gaussian>::default(), kernel::Gaussian)
        }
        (Method::Ppm, ..) | (_, RadiusRule::Local, _) => {
            counting!(LocalStatistics { alpha: settings.alpha }, kernel::Box)
        }
        (_, RadiusRule::Memoryless, _) => drive(sppm, camera, settings, observe),
    }
}

fn drive(
    mut passes: impl Iterate,
    camera: &Camera,
    settings: &Settings,
    mut observe: impl FnMut(&Progress, &[Pixel]) -> Control,
) -> Rendered {
    let clock = Clock::start();
    let cpu_start = cpu_seconds();
    let (width, height) = camera.size();
    let mut pixels = passes.pixels();
    let mut phases = Phases { pilot: cpu_seconds() - cpu_start, ..Phases::default() };
    let pilot_seconds = clock.seconds();

    let mut history: Vec<History> = Vec::new();
    let mut next_record = 1u64;
    let (mut done, mut light_paths, mut photons, mut stop) = (0u64, 0u64, 0, StopReason::Iterations);
    let mut iteration = settings.shard.index;
    let total = settings.iterations.map(|n| n.saturating_sub(settings.shard.index).div_ceil(settings.shard.count));
    while settings.iterations.is_none_or(|n| iteration < n) {
        // Iterations count from 1; pass 0 is the pilot's.
        let work = passes.iterate(iteration + 1, &mut pixels, &mut phases);
        let seconds = clock.seconds();
        done += 1;
        light_paths += work.light_paths;
        photons = work.photons;
        iteration += settings.shard.count;

        // The error costs a look at every pixel: at powers of sqrt(2), and whenever it may stop the render.
        let record = done >= next_record || Some(done) == total;
        let wanted = record || settings.target_error.is_some();
        let error = if wanted { relative_error(&pixels, settings) } else { None };
        if record {
            next_record = (done as f64 * std::f64::consts::SQRT_2).ceil() as u64;
            let cpu_seconds = cpu_seconds() - cpu_start;
            history.push(History { seconds, cpu_seconds, iterations: done, light_paths, error });
        }
        let error = error.or_else(|| history.last().and_then(|h| h.error));
        let progress = Progress {
            iteration: done,
            iterations: total,
            seconds,
            remaining: settings.remaining(done, total, seconds, pilot_seconds),
            light_paths,
            photons,
            error,
        };
        if observe(&progress, &pixels) == Control::Stop {
            stop = StopReason::Interrupted;
            break;
        }
        if let Some(reason) = settings.stops(seconds, error) {
            stop = reason;
            break;
        }
    }
    let seconds = clock.seconds();
    if history.last().is_none_or(|h| h.iterations != done) && done > 0 {
        let error = relative_error(&pixels, settings);
        history.push(History { seconds, cpu_seconds: cpu_seconds() - cpu_start, iterations: done, light_paths, error });
    }
    Rendered {
        width,
        height,
        pixels,
        techniques: passes.techniques(done),
        radii: passes.radii(),
        settings: settings.clone(),
        iterations: done,
        light_paths,
        photons: photons as u64,
        seconds,
        phases,
        history,
        stop,
    }
}

impl Settings {
    /// Seconds to go, when that can be told: after `done` of `total` iterations and `seconds`, of which the pilot took `pilot`.
    fn remaining(&self, done: u64, total: Option<u64>, seconds: f64, pilot: f64) -> Option<f64> {
        let by_count = total.map(|n| (n - done) as f64 * (seconds - pilot) / done as f64);
        let by_time = self.time.map(|t| (t - seconds).max(0.0));
        match (by_count, by_time) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }

    /// Whether time or error end the render.
    fn stops(&self, seconds: f64, error: Option<f64>) -> Option<StopReason> {
        if self.time.is_some_and(|t| seconds >= t) {
            Some(StopReason::Time)
        } else if self.target_error.is_some_and(|e| error.is_some_and(|x| x <= e)) {
            Some(StopReason::Error)
        } else {
            None
        }
    }
}
