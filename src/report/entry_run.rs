//! The render of one entry with one seed, while it is in progress.

use super::entry::MeasurementSeries;
use crate::error::Result;
use crate::film::Picture;
use crate::finish::{Finish, reads_for_picture};
use crate::render::{Session, TimeSpent};

/// Limits and seeds of the runs of a comparison, and when their pictures are measured.
#[derive(Clone, Debug)]
pub struct Rules {
    /// Wall-clock seconds of each run; `None` without a limit.
    pub time: Option<f64>,
    /// Iterations of each run; `None` without a limit.
    pub iterations: Option<u64>,
    /// Ratio of the geometric series of measured iteration counts, above 1.
    pub ratio: f64,
    /// Additional measurements: index of the entry, and iterations after which it is measured.
    pub extra_moments: Vec<(usize, u64)>,
    /// Seeds; every entry is rendered with each of them.
    pub seeds: Vec<u64>,
}

/// The render of one entry, a method with its settings, with one seed.
pub(super) struct EntryRun<'a> {
    pub(super) session: Session<'a>,
    pub(super) moments: MeasurementSeries,
    /// Time that every finish of the run's pictures has taken so far.
    pub(super) finish_times: Vec<TimeSpent>,
    /// Iterations at the last measurement of the run.
    pub(super) measured: u64,
    /// Whether the run continues.
    pub(super) open: bool,
}

impl<'a> EntryRun<'a> {
    /// A run before its first iteration.
    pub(super) fn new(session: Session<'a>, rules: &Rules) -> EntryRun<'a> {
        EntryRun {
            session,
            moments: MeasurementSeries::new(rules.ratio),
            finish_times: Vec::new(),
            measured: 0,
            open: true,
        }
    }

    /// Median time of the run's finishes, by wall clock; `None` before the first. The first use of a network takes
    /// longer, and so does a finish that other load on the machine disturbs.
    pub(super) fn finish_time(&self) -> Option<TimeSpent> {
        let mut times = self.finish_times.clone();
        times.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
        times.get(times.len() / 2).copied()
    }

    /// Whether the run has reached its limit of iterations or its limit of time.
    pub(super) fn is_done(&self, rules: &Rules) -> bool {
        rules.iterations.is_some_and(|n| self.session.iterations() >= n)
            || rules.time.is_some_and(|time| self.session.spent().seconds >= time)
    }

    /// Completed share of the run, 0 to 1, by iterations or time, the larger of the two; 1 for an ended run.
    pub(super) fn fraction(&self, rules: &Rules) -> f64 {
        let by_count = rules.iterations.map_or(0.0, |n| self.session.iterations() as f64 / n as f64);
        let by_time = rules.time.map_or(0.0, |time| self.session.spent().seconds / time);
        if self.open { by_count.max(by_time).min(1.0) } else { 1.0 }
    }

    /// Core-seconds that the run has used, or iterations if the runs have no time limit: the run that has used the
    /// least is next.
    pub(super) fn used(&self, rules: &Rules) -> f64 {
        if rules.time.is_some() { self.session.spent().cpu_seconds } else { self.session.iterations() as f64 }
    }

    /// The finished picture of the run so far; records the time that the finish takes.
    pub(super) fn finished(&mut self, finish: &mut Finish) -> Result<Picture> {
        let mut spent = TimeSpent::default();
        let session = &mut self.session;
        let picture = spent.measure(|| {
            // Without quarters, because curves do not show the error of each picture.
            let mut set = session.layers(|name| name.is_empty() || reads_for_picture(name))?;
            finish.apply(&mut set, |_| false)?;
            set.beauty()
        })?;
        self.finish_times.push(spent);
        Ok(picture)
    }
}
