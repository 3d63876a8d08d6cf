//! A run under way.

use super::entry::Moments;
use crate::error::Result;
use crate::film::Picture;
use crate::finish::{Finish, reads_for_picture};
use crate::render::{Session, TimeSpent};

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

/// A run under way.
pub(super) struct EntryRun<'a> {
    pub(super) session: Session<'a>,
    pub(super) moments: Moments,
    /// Times of the finish.
    pub(super) finishings: Vec<TimeSpent>,
    /// Iterations that were measured.
    pub(super) measured: u64,
    /// Whether it goes on.
    pub(super) open: bool,
}

impl<'a> EntryRun<'a> {
    /// At its beginning.
    pub(super) fn new(session: Session<'a>, rules: &Rules) -> EntryRun<'a> {
        EntryRun { session, moments: Moments::new(rules.ratio), finishings: Vec::new(), measured: 0, open: true }
    }

    /// The median of the times of the finish, by wall clock. The first use of a network is slower than those after it,
    /// and so is one that the machine disturbs.
    pub(super) fn finishing(&self) -> Option<TimeSpent> {
        let mut times = self.finishings.clone();
        times.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
        times.get(times.len() / 2).copied()
    }

    /// Whether it is at its end.
    pub(super) fn done(&self, rules: &Rules) -> bool {
        rules.iterations.is_some_and(|n| self.session.iterations() >= n)
            || rules.time.is_some_and(|time| self.session.spent().seconds >= time)
    }

    /// Share of its time or iterations, whichever ends it first.
    pub(super) fn fraction(&self, rules: &Rules) -> f64 {
        let by_count = rules.iterations.map_or(0.0, |n| self.session.iterations() as f64 / n as f64);
        let by_time = rules.time.map_or(0.0, |time| self.session.spent().seconds / time);
        if self.open { by_count.max(by_time).min(1.0) } else { 1.0 }
    }

    /// What decides whose turn it is.
    pub(super) fn used(&self, rules: &Rules) -> f64 {
        if rules.time.is_some() { self.session.spent().cpu_seconds } else { self.session.iterations() as f64 }
    }

    /// The picture, finished.
    pub(super) fn finished(&mut self, finish: &mut Finish) -> Result<Picture> {
        let mut spent = TimeSpent::default();
        let session = &mut self.session;
        let picture = spent.measure(|| {
            // Quarters and parts are for those who look closer.
            let mut set = session.layers(|name| name.is_empty() || reads_for_picture(name))?;
            finish.apply(&mut set, |_| false)?;
            set.beauty()
        })?;
        self.finishings.push(spent);
        Ok(picture)
    }
}
