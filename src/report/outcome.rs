//! What comes of a race while it goes on.

use super::entry::{Entry, Line, Of, lines};
use super::guests::{Account, Guests, Made, Turn};
use super::lane::{Lane, Rules};
use super::point::{Ending, Point};
use super::reference::Reference;
use super::spool::Spool;
use crate::error::{Error, Result};
use crate::film::Picture;
use crate::finish::Finish;
use crate::image::errors;
use crate::render::{Rendered, StopReason, TimeSpent};

/// Who takes part.
pub struct Field<'a> {
    /// Ours.
    pub entries: &'a [Entry],
    /// What finishes their pictures, as many.
    pub finishes: &'a mut [Option<Finish>],
    /// Other renderers.
    pub guests: Option<Guests>,
}

/// A race's result.
pub struct Outcome {
    /// The curves.
    pub lines: Vec<Line>,
    /// What is known of the guests.
    pub guests: Vec<Account>,
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
    pub fn picture(&mut self, point: &Point) -> Result<Option<Picture>> {
        point.picture.map(|number| self.pictures.get(number)).transpose()
    }
}

/// How a race with a seed is looked at.
pub(super) struct Look<'a> {
    /// The seed.
    pub(super) seed: u64,
    /// Whether pictures are kept.
    pub(super) keep: bool,
    /// What it is measured against.
    pub(super) reference: &'a Reference,
}

impl Outcome {
    pub(super) fn new(field: &Field<'_>, pictures: Spool) -> Outcome {
        let peers = field.guests.as_ref().map_or(&[][..], |guests| &guests.peers);
        let denoised = field.guests.as_ref().is_some_and(|guests| guests.denoising.is_some());
        Outcome {
            lines: lines(field.entries, peers, denoised),
            guests: vec![Account::default(); peers.len()],
            points: Vec::new(),
            endings: Vec::new(),
            renders: Vec::new(),
            interrupted: false,
            failures: Vec::new(),
            pictures,
        }
    }

    /// Iterations and seconds of the last point, if there is a new one.
    pub(super) fn last_of(&self, measured: bool) -> (u64, f64) {
        self.points.last().filter(|_| measured).map_or((0, 0.0), |point| (point.iterations, point.seconds))
    }

    /// One iteration of ours, measured if this is a moment; whether it was.
    pub(super) fn step(
        &mut self,
        run: usize,
        lane: &mut Lane<'_>,
        field: &mut Field<'_>,
        rules: &Rules,
        look: &Look<'_>,
    ) -> bool {
        lane.session.step();
        let iterations = lane.session.iterations();
        let done = lane.done(rules);
        let moment = lane.moments.reached(iterations) || rules.more.contains(&(run, iterations)) || done;
        let measured = moment && self.measure(run, lane, &mut field.finishes[run], look);
        lane.open &= !done;
        measured
    }

    /// A guest's render; whether it was measured, `None` if it was stopped.
    pub(super) fn host(&mut self, turn: Turn, field: &mut Field<'_>, look: &Look<'_>) -> Option<bool> {
        let Some(guests) = field.guests.as_mut().filter(|_| self.guests[turn.guest].out.is_none()) else {
            return Some(false);
        };
        match guests.take(turn, look.seed, look.reference, &mut self.guests[turn.guest]) {
            Made::Stopped => None,
            Made::Nothing => Some(false),
            Made::Points(points) => {
                for ((point, picture), of) in points.into_iter().zip([Of::Guest(turn.guest), Of::Denoised(turn.guest)])
                {
                    let kept = self.keep(point, of, &picture, look);
                    self.failures.extend(kept.err());
                }
                Some(true)
            }
        }
    }

    /// What is left to do when a race with a seed ends.
    pub(super) fn end(&mut self, lanes: Vec<Lane<'_>>, field: &mut Field<'_>, look: &Look<'_>) {
        for (run, mut lane) in lanes.into_iter().enumerate() {
            let iterations = lane.session.iterations();
            if lane.open && iterations > lane.measured {
                self.measure(run, &mut lane, &mut field.finishes[run], look);
            }
            let (spent, phases, finish) = (lane.session.spent(), lane.session.phases(), lane.finishing());
            if let Some(finish) = finish {
                self.charge(Of::Finished(run), look.seed, finish);
            }
            self.endings.push(Ending { run, seed: look.seed, iterations, spent, phases, finish });
            if look.keep {
                let stop = if self.interrupted { StopReason::Interrupted } else { StopReason::Iterations };
                let mut rendered = lane.session.finish(stop);
                rendered.pixels = Vec::new();
                self.renders.push(rendered);
            }
        }
    }

    /// The number of a curve.
    fn line(&self, of: Of) -> usize {
        self.lines.iter().position(|line| line.of == of).unwrap_or_default()
    }

    /// Adds the finish's time to all points of finished pictures.
    fn charge(&mut self, of: Of, seed: u64, finish: TimeSpent) {
        let line = self.line(of);
        for point in self.points.iter_mut().filter(|point| point.line == line && point.seed == seed) {
            point.seconds += finish.seconds;
            point.cpu_seconds += finish.cpu_seconds;
            point.finish_seconds = Some(finish.seconds);
        }
    }

    /// Adds points; a run that cannot be measured ends. Whether there is a new one.
    fn measure(&mut self, run: usize, lane: &mut Lane<'_>, finish: &mut Option<Finish>, look: &Look<'_>) -> bool {
        lane.measured = lane.session.iterations();
        let before = self.points.len();
        let mut add = |lane: &mut Lane<'_>| -> Result<()> {
            let picture = lane.session.picture();
            self.add(Of::Estimate(run), &picture, lane, look)?;
            let Some(finish) = finish else { return Ok(()) };
            let picture = lane.finished(finish)?;
            self.add(Of::Finished(run), &picture, lane, look)
        };
        if let Err(error) = add(lane) {
            self.failures.push(error);
            lane.open = false;
        }
        self.points.len() > before
    }

    /// Adds a measurement; none where the picture has no finite pixel yet.
    fn add(&mut self, of: Of, picture: &Picture, lane: &Lane<'_>, look: &Look<'_>) -> Result<()> {
        let Some(errors) = errors(picture, &look.reference.picture) else { return Ok(()) };
        let spent = lane.session.spent();
        let estimate = lane.session.estimate_error().estimate.filter(|_| of.is_raw());
        let point = Point {
            line: 0,
            seed: look.seed,
            iterations: lane.session.iterations(),
            light_paths: lane.session.light_paths(),
            seconds: spent.seconds,
            cpu_seconds: spent.cpu_seconds,
            finish_seconds: None,
            errors,
            estimate: estimate.map(|e| e.root().powi(2)),
            picture: None,
        };
        self.keep(point, of, picture, look)
    }

    /// Adds a point to its curve, with its picture if it is of the first seed.
    fn keep(&mut self, point: Point, of: Of, picture: &Picture, look: &Look<'_>) -> Result<()> {
        let number = if look.keep { Some(self.pictures.push(picture)?) } else { None };
        self.points.push(Point { line: self.line(of), picture: number, ..point });
        Ok(())
    }
}
