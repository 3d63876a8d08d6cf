//! Results of a comparison, collected while it runs.

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

/// The renderers that are compared: entries, the methods of caustique with their settings, and other renderers.
pub struct Participants<'a> {
    /// Entries of the comparison, which caustique renders.
    pub entries: &'a [Entry],
    /// The finish of each entry; `None` if its finished pictures are not measured.
    pub finishes: &'a mut [Option<Finish>],
    /// Other renderers; `None` if only entries are compared.
    pub peers: Option<PeerRenders>,
}

/// Results of a comparison of entries and other renderers: the measured errors and times.
pub struct Outcome {
    /// The curves, to which the measurements belong.
    pub lines: Vec<Line>,
    /// Facts about each other renderer and its renders.
    pub peers: Vec<PeerSummary>,
    /// Measurements of pictures, by seed and then in order of time.
    pub points: Vec<Point>,
    /// Times of the run of every entry with every seed.
    pub endings: Vec<RunEnd>,
    /// Renders of all entries with the first seed, without their pixels.
    pub renders: Vec<Rendered>,
    /// Whether the user has stopped the comparison.
    pub interrupted: bool,
    /// Errors that have ended a run early.
    pub failures: Vec<Error>,
    pictures: PictureStore,
}

/// The part of a comparison that renders with one seed.
pub(super) struct Round<'a> {
    /// Seed of the renders.
    pub(super) seed: u64,
    /// Whether the pictures of the measurements are stored.
    pub(super) keep_pictures: bool,
    /// The reference picture that errors are measured against.
    pub(super) reference: &'a Reference,
}

impl Outcome {
    pub(super) fn new(participants: &Participants<'_>, pictures: PictureStore) -> Outcome {
        let peers = participants.peers.as_ref().map_or(&[][..], |peers| &peers.peers);
        let denoised = participants.peers.as_ref().is_some_and(|peers| peers.denoiser.is_some());
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

    /// The stored picture of a measurement; `None` if it is not stored.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn picture(&mut self, point: &Point) -> Result<Option<Picture>> {
        point.picture.map(|number| self.pictures.get(number)).transpose()
    }

    /// Iterations and seconds of the last measurement if it is new, else zeros.
    pub(super) fn last_point(&self, is_new: bool) -> (u64, f64) {
        self.points.last().filter(|_| is_new).map_or((0, 0.0), |point| (point.iterations, point.seconds))
    }

    /// Renders one iteration of the entry with index `entry`, and measures its picture if the moment has come; returns
    /// whether it was measured.
    pub(super) fn step(
        &mut self,
        entry: usize,
        run: &mut EntryRun<'_>,
        participants: &mut Participants<'_>,
        rules: &Rules,
        round: &Round<'_>,
    ) -> bool {
        run.session.step();
        let iterations = run.session.iterations();
        let done = run.is_done(rules);
        let moment = run.moments.reached(iterations) || rules.extra_moments.contains(&(entry, iterations)) || done;
        let measured = moment && self.measure(entry, run, &mut participants.finishes[entry], round);
        run.open &= !done;
        measured
    }

    /// Renders and measures a picture of another renderer; returns whether it was measured, or `None` if the user has
    /// stopped it.
    pub(super) fn render_peer(
        &mut self,
        turn: PeerTurn,
        participants: &mut Participants<'_>,
        round: &Round<'_>,
    ) -> Option<bool> {
        let Some(peers) = participants.peers.as_mut().filter(|_| self.peers[turn.peer].left_out.is_none()) else {
            return Some(false);
        };
        match peers.render(turn, round.seed, round.reference, &mut self.peers[turn.peer]) {
            PeerResult::Stopped => None,
            PeerResult::Nothing => Some(false),
            PeerResult::Points(points) => {
                let sources = [PictureSource::Peer(turn.peer), PictureSource::Denoised(turn.peer)];
                for ((point, picture), source) in points.into_iter().zip(sources) {
                    let added = self.add_point(point, source, &picture, round);
                    self.failures.extend(added.err());
                }
                Some(true)
            }
        }
    }

    /// Measures the last iterations of interrupted runs and records the times of all runs.
    pub(super) fn end_round(
        &mut self,
        runs: Vec<EntryRun<'_>>,
        participants: &mut Participants<'_>,
        round: &Round<'_>,
    ) {
        for (entry, mut run) in runs.into_iter().enumerate() {
            let iterations = run.session.iterations();
            if run.open && iterations > run.measured {
                self.measure(entry, &mut run, &mut participants.finishes[entry], round);
            }
            let (spent, phases, finish) = (run.session.spent(), run.session.phases(), run.finish_time());
            if let Some(finish) = finish {
                self.add_finish_time(entry, round.seed, finish);
            }
            self.endings.push(RunEnd { run: entry, seed: round.seed, iterations, spent, phases, finish });
            if round.keep_pictures {
                let stop = if self.interrupted { StopReason::Interrupted } else { StopReason::Iterations };
                let mut rendered = run.session.finish(stop);
                rendered.pixels = Vec::new();
                self.renders.push(rendered);
            }
        }
    }

    /// Index of the curve whose pictures come from `source`.
    fn line(&self, source: PictureSource) -> usize {
        self.lines.iter().position(|line| line.source == source).unwrap_or_default()
    }

    /// Adds the time of one finish to every measurement of the entry's finished pictures with this seed.
    fn add_finish_time(&mut self, entry: usize, seed: u64, finish: TimeSpent) {
        let line = self.line(PictureSource::Finished(entry));
        for point in self.points.iter_mut().filter(|point| point.line == line && point.seed == seed) {
            point.seconds += finish.seconds;
            point.cpu_seconds += finish.cpu_seconds;
            point.finish_seconds = Some(finish.seconds);
        }
    }

    /// Measures the error of an entry's estimate and, if there is a finish, of its finished picture; an error ends the
    /// run. Returns whether a measurement was added.
    fn measure(
        &mut self,
        entry: usize,
        run: &mut EntryRun<'_>,
        finish: &mut Option<Finish>,
        round: &Round<'_>,
    ) -> bool {
        run.measured = run.session.iterations();
        let before = self.points.len();
        let mut measure = |run: &mut EntryRun<'_>| -> Result<()> {
            let picture = run.session.picture();
            self.measure_picture(PictureSource::Estimate(entry), &picture, run, round)?;
            let Some(finish) = finish else { return Ok(()) };
            let picture = run.finished(finish)?;
            self.measure_picture(PictureSource::Finished(entry), &picture, run, round)
        };
        if let Err(error) = measure(run) {
            self.failures.push(error);
            run.open = false;
        }
        self.points.len() > before
    }

    /// Adds the measurement of a picture's error, unless the picture has no finite pixel.
    fn measure_picture(
        &mut self,
        source: PictureSource,
        picture: &Picture,
        run: &EntryRun<'_>,
        round: &Round<'_>,
    ) -> Result<()> {
        let Some(errors) = errors(picture, &round.reference.picture) else { return Ok(()) };
        let spent = run.session.spent();
        let estimate = run.session.estimate_error().estimate.filter(|_| source.is_raw());
        let point = Point {
            line: 0,
            seed: round.seed,
            iterations: run.session.iterations(),
            light_paths: run.session.light_paths(),
            seconds: spent.seconds,
            cpu_seconds: spent.cpu_seconds,
            finish_seconds: None,
            errors,
            estimate: estimate.map(|e| e.root().powi(2)),
            picture: None,
        };
        self.add_point(point, source, picture, round)
    }

    /// Adds a measurement to the curve of its source, and stores its picture if the round stores pictures.
    fn add_point(&mut self, point: Point, source: PictureSource, picture: &Picture, round: &Round<'_>) -> Result<()> {
        let number = if round.keep_pictures { Some(self.pictures.push(picture)?) } else { None };
        self.points.push(Point { line: self.line(source), picture: number, ..point });
        Ok(())
    }
}
