//! A render that advances by one iteration at a time, so that several renders can take turns.

mod control;
mod run;
mod state;

pub use control::{Control, ExpectedError, Progress};
pub use run::{MIN_ITERATIONS_FOR_ERROR, render, run_session};
pub use state::State;

use crate::error::{Error, Result};
use crate::estimator::{BandwidthState, PixelAccumulator};
use crate::film::{self, LayerSet, Picture};
use crate::finish::FinishedError;
use crate::light::Guide;
use crate::render::account::{
    ErrorReport, HistoryEntry, PhotonRecord, PixelState, RenderStats, Rendered, StopReason, output,
};
use crate::render::clock::{Phases, TimeSpent};
use crate::render::input::RenderInput;
use crate::render::pass::{Integrator, integrator};
use crate::render::settings::Settings;
use crate::stat::sum::MAX_TERMS;
use state::Counters;

/// A render between two of its iterations.
pub struct Session<'a> {
    input: &'a RenderInput<'a>,
    integrator: Box<dyn Integrator + 'a>,
    pixels: Vec<PixelAccumulator>,
    counters: Counters,
    /// Error of the picture after the last iteration; `None` if it has not been estimated.
    error: Option<ErrorReport>,
    /// Why the scene could not be built at the moment of an iteration, which ends the render; otherwise `None`.
    failure: Option<Error>,
}

impl<'a> Session<'a> {
    /// Starts a render and runs its pilot, which finds the initial bandwidths, if the method has one. If the user stops
    /// the render meanwhile, it ends early, and there are no iterations.
    pub fn new(input: &'a RenderInput<'a>) -> Session<'a> {
        Session::with_time_spent(input, TimeSpent::default())
    }

    /// Starts a render on which `time` has been spent already, by choosing its settings. That time counts as part of the
    /// render.
    pub fn with_time_spent(input: &'a RenderInput<'a>, mut time: TimeSpent) -> Session<'a> {
        let RenderInput { scene, settings, initial_media, .. } = input;
        settings.stop.forget_cuts();
        settings.stop.start_first_iteration(settings.time.map(|limit| limit - time.seconds));
        let (integrator, measured) = time.measure(|| {
            let mut integrator = integrator(input);
            let measured = input.in_the_middle(|input| integrator.pixels(input));
            (integrator, measured)
        });
        let (pixels, failure) =
            measured.map_or_else(|failure| (input.empty_pixels(), Some(failure)), |pixels| (pixels, None));
        let stats = RenderStats::new(PhotonRecord::new(scene, settings, initial_media), time);
        let counters = Counters { stats, next: settings.shard.index, next_record: 1, pilot_seconds: time.seconds };
        Session { input, integrator, pixels, counters, error: None, failure }
    }

    /// Continues a render from a saved state; `None` if the state is of another picture or method.
    pub fn resume(input: &'a RenderInput<'a>, state: State) -> Option<Session<'a>> {
        let mut session = Session::new(input);
        let State { pixels, counters, passes } = state;
        let Settings { levels, lobes, .. } = &input.settings;
        let (groups, merges) = (input.settings.light_groups(input.scene), input.settings.merges_one_level());
        let fits = pixels.len() == input.pixels()
            && pixels.iter().all(|pixel| pixel.holds(levels.count, merges, groups, *lobes))
            && session.integrator.restore(&passes);
        fits.then(|| Session { pixels, counters, ..session })
    }

    /// The current state of the render, to be saved in a checkpoint.
    ///
    /// # Errors
    /// None: the state of the passes is packed in memory.
    pub fn state(&self) -> postcard::Result<State<&[PixelAccumulator]>> {
        Ok(State { pixels: &self.pixels, counters: self.counters.clone(), passes: self.integrator.state()? })
    }

    /// Whether the render has done all iterations of its settings, or the largest number that pixels can sum exactly.
    pub fn is_finished(&self) -> bool {
        self.counters.next >= self.settings().iterations.unwrap_or(u64::MAX).min(MAX_TERMS)
    }

    /// Renders one iteration, or none if the user stops it ([`Settings::stop`]), and returns the progress.
    pub fn step(&mut self) -> Progress {
        self.step_within(None);
        self.progress()
    }

    /// Renders one iteration; discards it and returns false if it takes more than `seconds` or the user stops it.
    pub fn step_within(&mut self, seconds: Option<f64>) -> bool {
        self.settings().stop.start_iteration(seconds);
        self.run_iteration()
    }

    /// Renders one iteration, whose long paths are cut after `seconds`; returns false if the user stops it.
    fn step_or_cut(&mut self, seconds: Option<f64>) -> bool {
        self.settings().stop.start_first_iteration(seconds);
        self.run_iteration()
    }

    fn run_iteration(&mut self) -> bool {
        if self.settings().stop.requested() {
            return false;
        }
        let mut time = self.counters.stats.time;
        let done = time.measure(|| self.iterate());
        self.counters.stats.time = time;
        if done && self.is_record_due() {
            self.record();
        }
        done
    }

    /// Renders an iteration and estimates the error if the history or a stop condition needs it: that reads every pixel.
    /// Returns false if the iteration was discarded.
    fn iterate(&mut self) -> bool {
        let Counters { next, stats, .. } = &mut self.counters;
        // Iterations are numbered from 1; the pilot has the number 0.
        let (i, integrator, pixels) = (*next + 1, &mut self.integrator, &mut self.pixels);
        let iterated = self.input.at_iteration(i, |input| integrator.iterate(input, i, pixels, &mut stats.phases));
        let work = match iterated {
            Ok(Some(work)) => work,
            Ok(None) => return false,
            Err(failure) => {
                self.failure = Some(failure);
                return false;
            }
        };
        stats.add_iteration(&work);
        *next += self.input.settings.shard.count;
        self.error = None;
        if self.is_record_due() || self.settings().target_error.is_some() {
            self.error = Some(self.estimate_error());
        }
        true
    }

    /// Whether the error history gets an entry after this iteration: at powers of sqrt(2), and after the last one.
    fn is_record_due(&self) -> bool {
        self.iterations() >= self.counters.next_record || Some(self.iterations()) == self.iterations_of_shard()
    }

    fn record(&mut self) {
        let error = self.estimate_error();
        self.counters.stats.record_error(error.estimate);
        self.counters.next_record = (self.iterations() as f64 * std::f64::consts::SQRT_2).ceil() as u64;
    }

    /// Takes the reason why the scene could not be built at the moment of an iteration; `None` if it could.
    pub fn take_failure(&mut self) -> Option<Error> {
        self.failure.take()
    }

    /// Progress of the render after its last iteration.
    pub fn progress(&self) -> Progress {
        let Counters { stats, pilot_seconds, .. } = &self.counters;
        let recorded = || stats.history.last().and_then(|entry| entry.estimate);
        let error = self.error.and_then(|error| error.estimate).or_else(recorded);
        let (done, total, seconds) = (stats.iterations, self.iterations_of_shard(), stats.time.seconds);
        Progress {
            iteration: done,
            iterations: total,
            seconds,
            remaining: self.settings().remaining(done, total, seconds, *pilot_seconds),
            light_paths: stats.light_paths,
            photons: stats.photons as usize,
            error: error.map(|error| error.root()),
            error_coverage: self.settings().error_coverage(),
            finished: None,
            expected: None,
        }
    }

    /// Whether the error history has an entry of the last iteration.
    pub fn is_recorded(&self) -> bool {
        self.counters.stats.is_recorded()
    }

    /// Estimated error at moments of the render, in the order of time.
    pub fn history(&self) -> &[HistoryEntry] {
        &self.counters.stats.history
    }

    /// Adds to the history the measured error of the picture that was finished from half of the iterations so far
    /// ([`HistoryEntry::finished`]).
    pub fn record_finished_error(&mut self, finished: Option<FinishedError>) {
        let error = self.estimate_error();
        self.error = Some(error);
        if !self.is_recorded() {
            self.counters.stats.record_error(error.estimate);
        }
        if let Some(entry) = self.counters.stats.history.last_mut() {
            entry.finished = finished.map(|finished| FinishedError { unseen: error.unseen.squared, ..finished });
        }
    }

    /// Seconds until `iterations` are done, at the mean speed so far.
    pub fn seconds_until(&self, iterations: f64) -> f64 {
        let done = self.iterations();
        let pace = (self.spent().seconds - self.counters.pilot_seconds) / done.max(1) as f64;
        (iterations - done as f64).max(0.0) * pace
    }

    /// Number of iterations of this shard; `None` if their number does not stop the render.
    fn iterations_of_shard(&self) -> Option<u64> {
        self.settings().iterations_of_shard()
    }

    /// The learnt distribution of starts of light paths; `None` if they are not guided.
    pub(crate) fn guide(&self) -> Option<&Guide> {
        self.integrator.guide()
    }

    /// Accumulated samples of each pixel, row by row from the top.
    pub fn pixels(&self) -> &[PixelAccumulator] {
        &self.pixels
    }

    /// Whether the limit of time has cut long paths, so that the picture lacks their light.
    pub fn has_cut_paths(&self) -> bool {
        self.settings().stop.has_cut_paths()
    }

    /// Whether the scene has no lights, so that the black picture is right.
    pub fn has_no_lights(&self) -> bool {
        self.input.scene.lights.is_empty()
    }

    /// Settings of the render.
    pub fn settings(&self) -> &'a Settings {
        &self.input.settings
    }

    /// Number of iterations done.
    pub fn iterations(&self) -> u64 {
        self.counters.stats.iterations
    }

    /// Number of light paths emitted.
    pub fn light_paths(&self) -> u64 {
        self.counters.stats.light_paths
    }

    /// Time spent so far by pilot and iterations, and added by [`Session::add_time`].
    pub fn spent(&self) -> TimeSpent {
        self.counters.stats.time
    }

    /// Core-seconds per phase so far.
    pub fn phases(&self) -> Phases {
        self.counters.stats.phases
    }

    /// Estimated error of the method's own picture after the last iteration.
    pub fn estimate_error(&self) -> ErrorReport {
        self.error.unwrap_or_else(|| {
            let bandwidths = self.bandwidths();
            self.counters.stats.estimate_error(&PixelState::new(&self.pixels, &bandwidths, self.settings()))
        })
    }

    /// The method's own picture after the last iteration.
    pub fn picture(&self) -> Picture {
        let (pixels, level) = (&self.pixels, self.settings().levels.picture_level());
        Picture::from_fn(self.input.size().into(), |i| pixels[i].mean(level).as_vec3().to_array())
    }

    /// Adds time that the caller spent on the render between iterations.
    pub fn add_time(&mut self, time: TimeSpent) {
        self.counters.stats.time.add(time);
    }

    /// The layers after the last iteration whose names are `wanted`, see [`Rendered::layers`].
    ///
    /// # Errors
    /// None: the number of pixels fits the size of the picture.
    pub fn layers(&self, wanted: impl Fn(&str) -> bool) -> Result<LayerSet> {
        let shape = output::layer_shape(self.settings(), self.input.scene);
        film::output::layers(self.input.size(), &self.pixels, &self.bandwidths(), &shape, wanted)
    }

    /// Kernel bandwidths of all pixels in the last iteration.
    fn bandwidths(&self) -> BandwidthState {
        let settings = self.settings();
        BandwidthState::new(settings.schedule(settings.last_iteration(self.iterations())), self.integrator.counted())
    }

    /// Ends the render for the reason `stop`, and returns its result.
    pub fn finish(mut self, stop: StopReason) -> Rendered {
        if self.pixels.is_empty() {
            self.pixels = self.input.empty_pixels();
        }
        let error = self.estimate_error();
        self.error = Some(error);
        if self.iterations() > 0 && !self.is_recorded() {
            self.record();
        }
        let (width, height) = self.input.size();
        Rendered {
            width,
            height,
            techniques: self.integrator.techniques(self.iterations()),
            bandwidths: self.bandwidths(),
            pixels: self.pixels,
            settings: self.input.settings.clone(),
            stats: self.counters.stats,
            error,
            stop,
        }
    }
}

impl Settings {
    /// Estimated seconds to the end, after `done` of `total` iterations and `seconds`, of which `pilot` were spent before
    /// the first iteration.
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
    use crate::camera::Camera;
    use crate::math::DAffine3;
    use crate::render::Method;
    use crate::scene::description::{CameraDescription, Projection};
    use crate::scene::{CameraRequest, Description, Scene};
    use crate::stop::Stop;
    use std::sync::Arc;

    /// A scene with nothing but a camera of two pixels.
    fn empty_scene() -> (Scene, Camera) {
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
        (scene, camera)
    }

    /// The sums of a pixel are exact for 2^23 terms.
    #[test]
    fn a_render_ends_at_the_number_of_iterations_that_pixels_sum_exactly() {
        let (scene, camera) = empty_scene();
        for (iterations, last) in [(None, MAX_TERMS), (Some(1 << 40), MAX_TERMS), (Some(100), 100)] {
            let input = RenderInput::new(&scene, &camera, &Settings { iterations, ..Settings::default() });
            let mut session = Session::new(&input);
            session.counters.next = last - 1;
            assert!(!session.is_finished());
            session.step();
            assert!(session.is_finished() && session.iterations() == 1);
        }
    }

    /// A render that the user has stopped before it starts makes no pixels, and still has a picture.
    #[test]
    fn a_render_that_is_stopped_at_once_has_a_black_picture() {
        let (scene, camera) = empty_scene();
        for method in Method::ALL.iter().copied() {
            let stop = Stop::from_flag(Arc::new(true.into()));
            let input = RenderInput::new(&scene, &camera, &Settings { method, stop, ..Settings::default() });
            let mut session = Session::new(&input);
            assert!(session.pixels().is_empty() && !session.step_within(None), "{method:?}");
            let rendered = session.finish(StopReason::Interrupted);
            assert_eq!((rendered.pixels.len(), rendered.stats.iterations), (2, 0), "{method:?}");
        }
    }
}
