//! What comes of a race while it goes on.

use super::entry::{Entry, Line, PictureSource, lines};
use super::entry_run::{EntryRun, Rules};
use super::peer_renders::{PeerRenders, PeerResult, PeerSummary, PeerTurn};
use super::picture_store::PictureStore;
use super::point::{Point, RunEnd};
use super::reference::Reference;
use crate::error::{Error, Result};
use crate::film::Picture;
use crate::finish::Finish;
use crate::image::errors;
use crate::render::{Rendered, StopReason, TimeSpent};

/// Who takes part.
pub struct Participants<'a> {
    /// Ours.
    pub entries: &'a [Entry],
    /// What finishes their pictures, as many.
    pub finishes: &'a mut [Option<Finish>],
    /// Other renderers.
    pub peers: Option<PeerRenders>,
}

/// A race's result.
pub struct Outcome {
    /// The curves.
    pub lines: Vec<Line>,
    /// What is known of the peers.
    pub peers: Vec<PeerSummary>,
    /// By seed, then in the order they were measured.
    pub points: Vec<Point>,
    /// PictureSource every run and seed.
    pub endings: Vec<RunEnd>,
    /// Runs of the first seed as renders leave them, without their pixels.
    pub renders: Vec<Rendered>,
    /// Whether it was stopped.
    pub interrupted: bool,
    /// What went wrong on the way; the run in question ended there.
    pub failures: Vec<Error>,
    pictures: PictureStore,
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
    pub(super) fn new(participants: &Participants<'_>, pictures: PictureStore) -> Outcome {
        let peers = participants.peers.as_ref().map_or(&[][..], |peers| &peers.peers);
        let denoised = participants.peers.as_ref().is_some_and(|peers| peers.denoising.is_some());
        Outcome {
            lines: lines(participants.entries, peers, denoised),
            peers: vec![PeerSummary::default(); peers.len()],
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
        entry_run: &mut EntryRun<'_>,
        participants: &mut Participants<'_>,
        rules: &Rules,
        look: &Look<'_>,
    ) -> bool {
        entry_run.session.step();
        let iterations = entry_run.session.iterations();
        let done = entry_run.done(rules);
        let moment = entry_run.moments.reached(iterations) || rules.more.contains(&(run, iterations)) || done;
        let measured = moment && self.measure(run, entry_run, &mut participants.finishes[run], look);
        entry_run.open &= !done;
        measured
    }

    /// A peer's render; whether it was measured, `None` if it was stopped.
    pub(super) fn host(
        &mut self,
        turn: PeerTurn,
        participants: &mut Participants<'_>,
        look: &Look<'_>,
    ) -> Option<bool> {
        let Some(peers) = participants.peers.as_mut().filter(|_| self.peers[turn.peer].out.is_none()) else {
            return Some(false);
        };
        match peers.take(turn, look.seed, look.reference, &mut self.peers[turn.peer]) {
            PeerResult::Stopped => None,
            PeerResult::Nothing => Some(false),
            PeerResult::Points(points) => {
                for ((point, picture), of) in
                    points.into_iter().zip([PictureSource::Peer(turn.peer), PictureSource::Denoised(turn.peer)])
                {
                    let kept = self.keep(point, of, &picture, look);
                    self.failures.extend(kept.err());
                }
                Some(true)
            }
        }
    }

    /// What is left to do when a race with a seed ends.
    pub(super) fn end(&mut self, entry_runs: Vec<EntryRun<'_>>, participants: &mut Participants<'_>, look: &Look<'_>) {
        for (run, mut entry_run) in entry_runs.into_iter().enumerate() {
            let iterations = entry_run.session.iterations();
            if entry_run.open && iterations > entry_run.measured {
                self.measure(run, &mut entry_run, &mut participants.finishes[run], look);
            }
            let (spent, phases, finish) =
                (entry_run.session.spent(), entry_run.session.phases(), entry_run.finishing());
            if let Some(finish) = finish {
                self.charge(PictureSource::Finished(run), look.seed, finish);
            }
            self.endings.push(RunEnd { run, seed: look.seed, iterations, spent, phases, finish });
            if look.keep {
                let stop = if self.interrupted { StopReason::Interrupted } else { StopReason::Iterations };
                let mut rendered = entry_run.session.finish(stop);
                rendered.pixels = Vec::new();
                self.renders.push(rendered);
            }
        }
    }

    /// The number of a curve.
    fn line(&self, of: PictureSource) -> usize {
        self.lines.iter().position(|line| line.source == of).unwrap_or_default()
    }

    /// Adds the finish's time to all points of finished pictures.
    fn charge(&mut self, of: PictureSource, seed: u64, finish: TimeSpent) {
        let line = self.line(of);
        for point in self.points.iter_mut().filter(|point| point.line == line && point.seed == seed) {
            point.seconds += finish.seconds;
            point.cpu_seconds += finish.cpu_seconds;
            point.finish_seconds = Some(finish.seconds);
        }
    }

    /// Adds points; a run that cannot be measured ends. Whether there is a new one.
    fn measure(
        &mut self,
        run: usize,
        entry_run: &mut EntryRun<'_>,
        finish: &mut Option<Finish>,
        look: &Look<'_>,
    ) -> bool {
        entry_run.measured = entry_run.session.iterations();
        let before = self.points.len();
        let mut add = |entry_run: &mut EntryRun<'_>| -> Result<()> {
            let picture = entry_run.session.picture();
            self.add(PictureSource::Estimate(run), &picture, entry_run, look)?;
            let Some(finish) = finish else { return Ok(()) };
            let picture = entry_run.finished(finish)?;
            self.add(PictureSource::Finished(run), &picture, entry_run, look)
        };
        if let Err(error) = add(entry_run) {
            self.failures.push(error);
            entry_run.open = false;
        }
        self.points.len() > before
    }

    /// Adds a measurement; none where the picture has no finite pixel yet.
    fn add(&mut self, of: PictureSource, picture: &Picture, entry_run: &EntryRun<'_>, look: &Look<'_>) -> Result<()> {
        let Some(errors) = errors(picture, &look.reference.picture) else { return Ok(()) };
        let spent = entry_run.session.spent();
        let estimate = entry_run.session.estimate_error().estimate.filter(|_| of.is_raw());
        let point = Point {
            line: 0,
            seed: look.seed,
            iterations: entry_run.session.iterations(),
            light_paths: entry_run.session.light_paths(),
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
    fn keep(&mut self, point: Point, of: PictureSource, picture: &Picture, look: &Look<'_>) -> Result<()> {
        let number = if look.keep { Some(self.pictures.push(picture)?) } else { None };
        self.points.push(Point { line: self.line(of), picture: number, ..point });
        Ok(())
    }
}
