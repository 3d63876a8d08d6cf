//! The race: one iteration of the run that has used the least so far, and so on, so that a noisy machine hurts all
//! alike.
//!
//! Clocks decide the order and the end, never a picture: after so many iterations it is the one that `caustique render`
//! makes.

use super::entry::{Entry, Moments};
use super::reference::Reference;
use super::spool::Spool;
use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::finish::{Finish, reads_for_picture};
use crate::image::{Errors, errors};
use crate::render::{Control, Phases, Rendered, Session, Settings, Spent, Stage, StopReason};
use crate::scene::Scene;
use std::path::Path;

/// When runs stop and where they are measured.
#[derive(Clone, Debug)]
pub struct Rules {
    /// Seconds of each run.
    pub time: Option<f64>,
    /// Iterations of each run.
    pub iterations: Option<u64>,
    /// Ratio of the series of moments, above 1.
    pub ratio: f64,
    /// More moments: of a run (from 0) after so many iterations.
    pub more: Vec<(usize, u64)>,
    /// Seeds, a race each.
    pub seeds: Vec<u64>,
}

/// A run measured at a moment.
#[derive(Clone, Debug)]
pub struct Point {
    /// Which entry, from 0.
    pub run: usize,
    /// Its seed.
    pub seed: u64,
    /// Iterations done.
    pub iterations: u64,
    /// Light paths emitted.
    pub light_paths: u64,
    /// Wall-clock seconds, the finish's included, were it to stop here.
    pub seconds: f64,
    /// Processor seconds, likewise.
    pub cpu_seconds: f64,
    /// Wall-clock seconds of the finish and its layers, of runs that have one: the median of all its uses with this
    /// seed, which do the same work.
    pub finish_seconds: Option<f64>,
    /// Its error as measured against the reference, the reference's own included.
    pub errors: Errors,
    /// The squared relative error that it estimates itself, of runs without finish.
    pub estimate: Option<f64>,
    /// Number of the picture among those that are kept.
    pub picture: Option<u64>,
}

/// Where a run's time went.
#[derive(Clone, Debug)]
pub struct Ending {
    /// Which entry, from 0.
    pub run: usize,
    /// Its seed.
    pub seed: u64,
    /// Iterations done.
    pub iterations: u64,
    /// Time of pilot and iterations.
    pub spent: Spent,
    /// Core-seconds by phase.
    pub phases: Phases,
    /// Time of the finish: the median of its uses.
    pub finish: Option<Spent>,
}

/// What is told after every step.
pub struct Step<'a> {
    /// The entry that made it.
    pub run: usize,
    /// Iterations it has done.
    pub iterations: u64,
    /// Its seconds.
    pub seconds: f64,
    /// Share of the whole race that is done, 0 to 1.
    pub fraction: f64,
    /// The measurement, if this was a moment.
    pub point: Option<&'a Point>,
}

/// A race's result.
pub struct Outcome {
    /// By seed, then in the order they were measured.
    pub points: Vec<Point>,
    /// Of every run and seed.
    pub endings: Vec<Ending>,
    /// Runs of the first seed as renders leave them, without their pixels.
    pub renders: Vec<Rendered>,
    /// Whether it was stopped.
    pub interrupted: bool,
    /// What went wrong on the way; the run in question ended there.
    pub failures: Vec<Error>,
    pictures: Spool,
}

impl Outcome {
    /// The picture of a point.
    ///
    /// # Errors
    /// The file system.
    pub fn picture(&mut self, point: &Point) -> Result<Option<Vec<[f32; 3]>>> {
        point.picture.map(|number| self.pictures.get(number)).transpose()
    }
}

/// A run under way.
struct Lane<'a> {
    session: Session<'a>,
    moments: Moments,
    /// Times of the finish.
    finishings: Vec<Spent>,
    measured: u64,
    open: bool,
}

impl Lane<'_> {
    fn done(&self, rules: &Rules) -> bool {
        rules.iterations.is_some_and(|n| self.session.iterations() >= n)
            || rules.time.is_some_and(|time| self.session.spent().seconds >= time)
    }

    /// Share of its time or iterations, whichever ends it first.
    fn fraction(&self, rules: &Rules) -> f64 {
        let by_count = rules.iterations.map_or(0.0, |n| self.session.iterations() as f64 / n as f64);
        let by_time = rules.time.map_or(0.0, |time| self.session.spent().seconds / time);
        if self.open { by_count.max(by_time).min(1.0) } else { 1.0 }
    }

    /// What decides whose turn it is.
    fn used(&self, rules: &Rules) -> f64 {
        if rules.time.is_some() { self.session.spent().cpu_seconds } else { self.session.iterations() as f64 }
    }

    /// The picture as it is, finished if that is the run's way.
    fn picture(&mut self, finish: Option<&mut Finish>) -> Result<Vec<[f32; 3]>> {
        let Some(finish) = finish else { return Ok(self.session.picture()) };
        let mut spent = Spent::default();
        let session = &mut self.session;
        let picture = spent.during(|| {
            // Quarters and parts are for those who look closer.
            let mut set = session.layers(|name| name.is_empty() || reads_for_picture(name))?;
            finish.apply(&mut set, |_| false)?;
            set.beauty()
        })?;
        self.finishings.push(spent);
        Ok(picture)
    }
}

/// Races all entries, with each seed in turn. `finishes` are as many as entries. Pictures of the first seed are kept in
/// `folder` until the outcome is dropped. `observe` is called after every step and may stop the race.
///
/// # Errors
/// The file system, before anything is rendered.
pub fn race(
    (scene, camera): (&Scene, &Camera),
    entries: &[Entry],
    finishes: &mut [Option<Finish>],
    rules: &Rules,
    reference: &Reference,
    folder: &Path,
    mut observe: impl FnMut(&Step<'_>) -> Control,
) -> Result<Outcome> {
    let mut outcome = Outcome {
        points: Vec::new(),
        endings: Vec::new(),
        renders: Vec::new(),
        interrupted: false,
        failures: Vec::new(),
        pictures: Spool::new(folder, reference.picture.len())?,
    };
    for (round, &seed) in rules.seeds.iter().enumerate() {
        let of_entry = |entry: &Entry| {
            let settings =
                Settings { seed, iterations: None, time: None, target_error: None, ..entry.settings.clone() };
            Stage::new(scene, camera, &settings)
        };
        let stages: Vec<Stage<'_>> = entries.iter().map(of_entry).collect();
        let mut lanes: Vec<Lane<'_>> = Vec::new();
        for (stage, entry) in stages.iter().zip(entries) {
            let session = Session::after(stage, entry.decided);
            let moments = Moments::new(rules.ratio);
            lanes.push(Lane { session, moments, finishings: Vec::new(), measured: 0, open: true });
        }
        while let Some(run) = next(&lanes, rules) {
            lanes[run].session.step();
            let iterations = lanes[run].session.iterations();
            let done = lanes[run].done(rules);
            let moment = lanes[run].moments.reached(iterations) || rules.more.contains(&(run, iterations)) || done;
            let mut measured = false;
            if moment {
                measured = outcome.measure(run, seed, round == 0, &mut lanes[run], &mut finishes[run], reference);
            }
            lanes[run].open &= !done;
            let fraction = lanes.iter().map(|lane| lane.fraction(rules)).sum::<f64>() / lanes.len() as f64;
            let step = Step {
                run,
                iterations,
                seconds: lanes[run].session.spent().seconds,
                fraction: (round as f64 + fraction) / rules.seeds.len() as f64,
                point: outcome.points.last().filter(|_| measured),
            };
            if observe(&step) == Control::Stop {
                outcome.interrupted = true;
                break;
            }
        }
        for (run, mut lane) in lanes.into_iter().enumerate() {
            let iterations = lane.session.iterations();
            if lane.open && iterations > lane.measured {
                outcome.measure(run, seed, round == 0, &mut lane, &mut finishes[run], reference);
            }
            let (spent, phases, finish) = (lane.session.spent(), lane.session.phases(), median(&lane.finishings));
            if let Some(finish) = finish {
                outcome.charge(run, seed, finish);
            }
            outcome.endings.push(Ending { run, seed, iterations, spent, phases, finish });
            if round == 0 {
                let stop = if outcome.interrupted { StopReason::Interrupted } else { StopReason::Iterations };
                let mut rendered = lane.session.finish(stop);
                rendered.pixels = Vec::new();
                outcome.renders.push(rendered);
            }
        }
        if outcome.interrupted {
            break;
        }
    }
    Ok(outcome)
}

/// The run that has used the least; the first of equals.
fn next(lanes: &[Lane<'_>], rules: &Rules) -> Option<usize> {
    let open = (0..lanes.len()).filter(|&run| lanes[run].open);
    open.min_by(|&a, &b| lanes[a].used(rules).total_cmp(&lanes[b].used(rules)))
}

/// The median by wall clock. The first use of a network is slower than those after it, and so is one that the machine
/// disturbs.
fn median(times: &[Spent]) -> Option<Spent> {
    let mut times = times.to_vec();
    times.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    times.get(times.len() / 2).copied()
}

impl Outcome {
    /// Adds the finish's time to all points of a run.
    fn charge(&mut self, run: usize, seed: u64, finish: Spent) {
        for point in self.points.iter_mut().filter(|point| point.run == run && point.seed == seed) {
            point.seconds += finish.seconds;
            point.cpu_seconds += finish.cpu_seconds;
            point.finish_seconds = Some(finish.seconds);
        }
    }

    /// Adds a point; a run that cannot be measured ends.
    fn measure(
        &mut self,
        run: usize,
        seed: u64,
        keep: bool,
        lane: &mut Lane<'_>,
        finish: &mut Option<Finish>,
        reference: &Reference,
    ) -> bool {
        match self.point(run, seed, keep, lane, finish, reference) {
            Ok(Some(point)) => {
                self.points.push(point);
                true
            }
            Ok(None) => false,
            Err(error) => {
                self.failures.push(error);
                lane.open = false;
                false
            }
        }
    }

    /// A measurement; none where the picture has no finite pixel yet.
    fn point(
        &mut self,
        run: usize,
        seed: u64,
        keep: bool,
        lane: &mut Lane<'_>,
        finish: &mut Option<Finish>,
        reference: &Reference,
    ) -> Result<Option<Point>> {
        let picture = lane.picture(finish.as_mut())?;
        let iterations = lane.session.iterations();
        lane.measured = iterations;
        let Some(errors) = errors(&picture, &reference.picture) else { return Ok(None) };
        let spent = lane.session.spent();
        let estimate = lane.session.estimate().filter(|_| finish.is_none());
        Ok(Some(Point {
            run,
            seed,
            iterations,
            light_paths: lane.session.light_paths(),
            seconds: spent.seconds,
            cpu_seconds: spent.cpu_seconds,
            finish_seconds: None,
            errors,
            estimate: estimate.map(|e| e.root().powi(2)),
            picture: if keep { Some(self.pictures.push(&picture)?) } else { None },
        }))
    }
}
