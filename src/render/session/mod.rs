//! A render that goes on one iteration at a time, so that several can take turns.

mod control;
mod drive;
mod state;

pub use control::{Control, Progress};
pub use drive::{LEAST, drive, render};
pub use state::State;

use crate::camera::Camera;
use crate::error::Result;
use crate::estimator::bandwidth::initial_volume_bandwidths;
use crate::estimator::{BandwidthState, PixelAccumulator};
use crate::film::{self, LayerSet, Picture};
use crate::finish::FinishedError;
use crate::light::Guide;
use crate::photon::PhotonMap;
use crate::render::account::ErrorEstimate;
use crate::render::account::output;
use crate::render::account::{History, StopReason};
use crate::render::account::{PhotonRecord, Unseen};
use crate::render::account::{Rendered, error_estimate};
use crate::render::clock::{Phases, Spent};
use crate::render::pass::Integrator;
use crate::render::pass::integrator;
use crate::render::settings::{Levels, Settings};
use crate::scene::Scene;
use crate::stat::sum::MAX_TERMS;
use crate::transport::InitialMedia;
use state::Rest;

/// What a render reads: scene, camera, settings, and what these say together.
pub struct Stage<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    settings: Settings,
    initial_media: InitialMedia,
}

impl<'a> Stage<'a> {
    /// Methods without bandwidth levels get one.
    pub fn new(scene: &'a Scene, camera: &'a Camera, settings: &Settings) -> Stage<'a> {
        let mut settings = settings.clone();
        if !settings.method.has_levels() {
            settings.levels = Levels::new(1);
        }
        Stage { scene, camera, settings, initial_media: InitialMedia::of(scene, camera) }
    }

    /// The settings of the render.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The largest that bandwidths in media may be, by pixel: what they are without photons.
    pub fn widest_in_media(&self) -> Vec<f32> {
        let Settings { initial, widest, seed, .. } = self.settings;
        let camera_paths = self.settings.camera_paths(self.scene, self.camera, &self.initial_media);
        initial_volume_bandwidths(&camera_paths, initial, widest[1], seed, &PhotonMap::build(Vec::new()))
    }

    /// Width and height of the picture (pixels).
    pub fn size(&self) -> (u32, u32) {
        self.camera.size()
    }
}

/// A render under way.
pub struct Session<'a> {
    stage: &'a Stage<'a>,
    integrator: Box<dyn Integrator + 'a>,
    pixels: Vec<PixelAccumulator>,
    phases: Phases,
    spent: Spent,
    pilot_seconds: f64,
    /// The next iteration, from 0.
    next: u64,
    done: u64,
    light_paths: u64,
    photons: usize,
    rejected: u64,
    photon_record: PhotonRecord,
    history: Vec<History>,
    next_record: u64,
    /// The error after the last iteration, where it was wanted.
    last: Option<ErrorEstimate>,
}

impl<'a> Session<'a> {
    /// Runs the pilot, if the method has one.
    pub fn new(stage: &'a Stage<'a>) -> Session<'a> {
        Session::after(stage, Spent::default())
    }

    /// The same of a render on which some time has been spent already, by choosing its settings, which counts as its
    /// own.
    pub fn after(stage: &'a Stage<'a>, mut spent: Spent) -> Session<'a> {
        let Stage { scene, camera, settings, initial_media } = stage;
        let (integrator, pixels) = spent.during(|| {
            let mut integrator = integrator(scene, camera, settings, initial_media);
            let pixels = integrator.pixels();
            (integrator, pixels)
        });
        Session {
            stage,
            integrator,
            pixels,
            phases: Phases { pilot: spent.cpu_seconds, ..Phases::default() },
            spent,
            pilot_seconds: spent.seconds,
            next: settings.shard.index,
            done: 0,
            light_paths: 0,
            photons: 0,
            rejected: 0,
            photon_record: PhotonRecord::new(scene, settings, initial_media),
            history: Vec::new(),
            next_record: 1,
            last: None,
        }
    }

    /// Goes on from a saved state; `None` where it is of another picture or method.
    pub fn resume(stage: &'a Stage<'a>, state: State) -> Option<Session<'a>> {
        let mut session = Session::new(stage);
        let State { pixels, rest } = state;
        let Rest { next, done, light_paths, photons, rejected, next_record, history, .. } = rest;
        let Rest { phases, spent, pilot_seconds, passes, photon_record, .. } = rest;
        let (levels, groups) = (stage.settings.levels.count, stage.settings.light_groups(stage.scene));
        let fits = pixels.len() == session.pixels.len()
            && pixels.iter().all(|pixel| pixel.holds(levels, groups))
            && session.integrator.restore(&passes);
        fits.then(|| Session {
            pixels,
            phases,
            spent,
            pilot_seconds,
            next,
            done,
            light_paths,
            photons: photons as usize,
            rejected,
            photon_record,
            history,
            next_record,
            ..session
        })
    }

    /// The state as it is, to be saved.
    ///
    /// # Errors
    /// None: it is written to memory.
    pub fn state(&self) -> postcard::Result<State<&[PixelAccumulator]>> {
        let rest = Rest {
            next: self.next,
            done: self.done,
            light_paths: self.light_paths,
            photons: self.photons as u64,
            rejected: self.rejected,
            photon_record: self.photon_record,
            next_record: self.next_record,
            history: self.history.clone(),
            phases: self.phases,
            spent: self.spent,
            pilot_seconds: self.pilot_seconds,
            passes: self.integrator.state()?,
        };
        Ok(State { pixels: &self.pixels, rest })
    }

    /// Whether all iterations that were asked for are done, or as many as can be summed.
    pub fn finished(&self) -> bool {
        self.next >= self.stage.settings.iterations.unwrap_or(u64::MAX).min(MAX_TERMS)
    }

    /// Adds one iteration; none where an end was asked for in its midst ([`Settings::stop`]).
    pub fn step(&mut self) -> Progress {
        self.step_within(None);
        self.progress()
    }

    /// The same, which is given up after so many seconds, too; false where it was.
    pub fn step_within(&mut self, seconds: Option<f64>) -> bool {
        let mut spent = self.spent;
        self.stage.settings.stop.start_iteration(seconds);
        let done = spent.during(|| self.iterate());
        self.spent = spent;
        if let Some((true, error)) = done {
            self.record(error);
        }
        self.last = done.and_then(|(_, error)| error);
        done.is_some()
    }

    /// What there is to say after an iteration.
    pub fn progress(&self) -> Progress {
        let error = self.last;
        let error = error.or_else(|| self.history.last().and_then(|moment| moment.estimate));
        let settings = &self.stage.settings;
        let total = self.total();
        Progress {
            iteration: self.done,
            iterations: total,
            seconds: self.spent.seconds,
            remaining: settings.remaining(self.done, total, self.spent.seconds, self.pilot_seconds),
            light_paths: self.light_paths,
            photons: self.photons,
            error: error.map(|error| error.root()),
            told: settings.error_coverage(),
            finished: None,
            expected: None,
        }
    }

    /// Whether the last iteration is one of those that the history tells of.
    pub fn records(&self) -> bool {
        self.history.last().is_some_and(|moment| moment.iterations == self.done)
    }

    /// The error so far against time.
    pub fn history(&self) -> &[History] {
        &self.history
    }

    /// Keeps what was told of the picture finished from half of the iterations so far ([`History::finished`]).
    pub fn judged(&mut self, verdict: Option<FinishedError>) {
        let unseen = self.unseen().squared;
        if !self.records() {
            self.push(self.estimate());
        }
        if let Some(moment) = self.history.last_mut() {
            moment.finished = verdict.map(|verdict| FinishedError { unseen, ..verdict });
        }
    }

    /// Seconds until so many iterations are done, at the pace so far.
    pub fn seconds_to(&self, iterations: f64) -> f64 {
        let pace = (self.spent.seconds - self.pilot_seconds) / self.done.max(1) as f64;
        (iterations - self.done as f64).max(0.0) * pace
    }

    /// An iteration, and the error where it is wanted: for the history, or to stop the render. `None` where it was given
    /// up.
    fn iterate(&mut self) -> Option<(bool, Option<ErrorEstimate>)> {
        let settings = &self.stage.settings;
        // Iterations count from 1; pass 0 is the pilot's.
        let work = self.integrator.iterate(self.next + 1, &mut self.pixels, &mut self.phases)?;
        self.next += settings.shard.count;
        self.done += 1;
        self.light_paths += work.light_paths;
        self.photons = work.photons;
        self.rejected += work.rejected;
        self.photon_record.counts.join(&work.counts);
        // The error costs a look at every pixel: at powers of sqrt(2), and whenever it may stop the render.
        let record = self.done >= self.next_record || Some(self.done) == self.total();
        let wanted = record || settings.target_error.is_some();
        Some((record, if wanted { self.estimate() } else { None }))
    }

    fn record(&mut self, estimate: Option<ErrorEstimate>) {
        self.push(estimate);
        self.next_record = (self.done as f64 * std::f64::consts::SQRT_2).ceil() as u64;
    }

    fn push(&mut self, estimate: Option<ErrorEstimate>) {
        let (iterations, light_paths) = (self.done, self.light_paths);
        let Spent { seconds, cpu_seconds } = self.spent;
        self.history.push(History { seconds, cpu_seconds, iterations, light_paths, estimate, finished: None });
    }

    /// Iterations of this shard, when their number is what stops the render.
    fn total(&self) -> Option<u64> {
        self.stage.settings.iterations_of_shard()
    }

    /// Where its light paths start, if they are guided.
    pub(crate) fn guide(&self) -> Option<&Guide> {
        self.integrator.guide()
    }

    /// The pixels as they are.
    pub fn pixels(&self) -> &[PixelAccumulator] {
        &self.pixels
    }

    /// Whether no light shines, so that the black picture is right.
    pub fn is_dark(&self) -> bool {
        self.stage.scene.lights.is_empty()
    }

    /// The settings it was made with.
    pub fn settings(&self) -> &'a Settings {
        &self.stage.settings
    }

    /// Iterations done.
    pub fn iterations(&self) -> u64 {
        self.done
    }

    /// Light paths emitted.
    pub fn light_paths(&self) -> u64 {
        self.light_paths
    }

    /// Time taken so far by pilot and iterations.
    pub fn spent(&self) -> Spent {
        self.spent
    }

    /// Core-seconds per phase so far.
    pub fn phases(&self) -> Phases {
        self.phases
    }

    /// Estimated error of the method's own image, see [`Rendered::relative_error`].
    pub fn estimate(&self) -> Option<ErrorEstimate> {
        error_estimate(&self.pixels, &self.stage.settings).map(|error| error.with(self.unseen()))
    }

    /// Light of which hardly any photon has come.
    fn unseen(&self) -> Unseen {
        let settings = &self.stage.settings;
        self.photon_record.unseen((&self.pixels, &self.bandwidths()), settings, self.light_paths)
    }

    /// The method's own image as it is, row by row from the top.
    pub fn picture(&self) -> Picture {
        let own = self.stage.settings.levels.own();
        let pixels = &self.pixels;
        Picture::from_fn(self.stage.camera.size().into(), |i| pixels[i].mean(own).as_vec3().to_array())
    }

    /// Counts time that was spent on the render between its iterations as its own.
    pub fn charge(&mut self, spent: Spent) {
        self.spent.seconds += spent.seconds;
        self.spent.cpu_seconds += spent.cpu_seconds;
    }

    /// The layers as they are, see [`Rendered::layers`].
    ///
    /// # Errors
    /// None: its pixels are as many as its size says.
    pub fn layers(&self, wanted: impl Fn(&str) -> bool) -> Result<LayerSet> {
        let shape = output::shape(&self.stage.settings, self.stage.scene);
        film::output::layers(self.stage.camera.size(), &self.pixels, &self.bandwidths(), &shape, wanted)
    }

    /// Bandwidths of the last iteration.
    fn bandwidths(&self) -> BandwidthState {
        let settings = &self.stage.settings;
        BandwidthState::new(settings.schedule(settings.last(self.done)), self.integrator.counted())
    }

    /// Ends it.
    pub fn finish(mut self, stop: StopReason) -> Rendered {
        if self.done > 0 && self.history.last().is_none_or(|moment| moment.iterations != self.done) {
            self.record(self.estimate());
        }
        let (width, height) = self.stage.camera.size();
        Rendered {
            width,
            height,
            techniques: self.integrator.techniques(self.done),
            bandwidths: self.bandwidths(),
            pixels: self.pixels,
            settings: self.stage.settings.clone(),
            iterations: self.done,
            light_paths: self.light_paths,
            photons: self.photons as u64,
            light_rejected: self.rejected,
            photon_record: self.photon_record,
            seconds: self.spent.seconds,
            phases: self.phases,
            history: self.history,
            stop,
        }
    }
}

impl Settings {
    /// Seconds to go, when that can be told: after `done` of `total` iterations and `seconds`, of which the pilot took
    /// `pilot`.
    fn remaining(&self, done: u64, total: Option<u64>, seconds: f64, pilot: f64) -> Option<f64> {
        let by_count = total.map(|n| (n - done) as f64 * (seconds - pilot) / done as f64);
        let by_time = self.time.map(|t| (t - seconds).max(0.0));
        match (by_count, by_time) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DAffine3;
    use crate::scene::description::{CameraDescription, Projection};
    use crate::scene::{CameraRequest, Description};

    /// Pixels count iterations in 32 bits, and their sums are exact for 2^23: no render goes on beyond, however many
    /// are asked for, nor does the last of many shards.
    #[test]
    fn no_more_iterations_than_can_be_summed() {
        let mut description = Description::default();
        let projection = Projection::Perspective { yfov: 1.0, aspect: Some(1.0) };
        description.cameras.push(CameraDescription {
            name: String::new(),
            to_world: DAffine3::IDENTITY,
            projection,
            aperture_radius: 0.0,
            focus_distance: 1.0,
            shift: [0.0; 2],
        });
        let scene = Scene::build(description, 1).unwrap();
        let camera =
            scene.camera(&CameraRequest { width: Some(2), height: Some(1), ..CameraRequest::default() }).unwrap();
        for (iterations, last) in [(None, MAX_TERMS), (Some(1 << 40), MAX_TERMS), (Some(100), 100)] {
            let stage = Stage::new(&scene, &camera, &Settings { iterations, ..Settings::default() });
            let mut session = Session::new(&stage);
            session.next = last - 1;
            assert!(!session.finished());
            session.step();
            assert!(session.finished() && session.done == 1);
        }
    }
}
