//! The loop over iterations that all methods share: when it stops, and what it reports.

use super::control::{Control, Progress, StopReason};
use super::result::{Phases, Rendered};
use super::session::{Session, Stage};
use super::settings::Settings;
use super::techniques::TechniquePicture;
use crate::camera::Camera;
use crate::estimator::{Pixel, QUARTERS};

use crate::light::Guide;
use crate::photon::ByKind;
use crate::scene::Scene;

/// Iterations before which the estimated error ends no render: two in every quarter, by whose scatter the variance is
/// told.
pub const LEAST: u64 = 2 * QUARTERS as u64;

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
    /// Bandwidths by kind of photons of every pixel and level after the last iteration, of methods where they do not follow from the iteration.
    fn radii(&mut self) -> ByKind<Vec<f32>> {
        ByKind::default()
    }
    /// Where its light paths start, if they are guided.
    fn guide(&self) -> Option<&Guide> {
        None
    }
    /// Pictures per technique after so many iterations, of methods that have them.
    fn techniques(&mut self, iterations: u64) -> Vec<TechniquePicture> {
        let _ = iterations;
        Vec::new()
    }
}

/// Renders. `observe` is called after every iteration and may stop the render; it also gets the pixels, to show or save them.
///
/// Methods without bandwidth levels write one. With [`Method::Path`](super::Method::Path) and the methods that merge or connect,
/// `settings.photons` is not used: there are as many light paths as eye paths, or none.
pub fn render(
    scene: &Scene,
    camera: &Camera,
    settings: &Settings,
    mut observe: impl FnMut(&Progress, &[Pixel]) -> Control,
) -> Rendered {
    let stage = Stage::new(scene, camera, settings);
    let mut session = Session::new(&stage);
    let stop = loop {
        if session.finished() {
            break StopReason::Iterations;
        }
        let progress = session.step();
        if observe(&progress, session.pixels()) == Control::Stop {
            break StopReason::Interrupted;
        }
        // Without a light the black picture is right.
        let error = progress.error.or(scene.lights.is_empty().then_some(0.0));
        if let Some(reason) = settings.stops(progress.seconds, error.filter(|_| progress.iteration >= LEAST)) {
            break reason;
        }
    };
    session.finish(stop)
}

impl Settings {
    /// Seconds to go, when that can be told: after `done` of `total` iterations and `seconds`, of which the pilot took `pilot`.
    pub(super) fn remaining(&self, done: u64, total: Option<u64>, seconds: f64, pilot: f64) -> Option<f64> {
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
