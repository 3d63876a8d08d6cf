//! Statistics of a render: iterations, light paths, photons, time, and the history of the error.

use super::error_estimate::{ErrorEstimate, ErrorReport};
use super::history::HistoryEntry;
use super::photon_record::PhotonRecord;
use super::pixel_state::PixelState;
use crate::render::clock::{Phases, TimeSpent};
use crate::render::pass::Work;
use serde::{Deserialize, Serialize};

/// Counts, times and error history of a render or of one shard.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RenderStats {
    /// Number of iterations done.
    pub iterations: u64,
    /// Number of light paths emitted in all iterations.
    pub light_paths: u64,
    /// Number of photons in the map of the last iteration.
    pub photons: u64,
    /// Number of photons and light paths that were rejected because they were not finite.
    pub light_rejected: u64,
    /// Numbers of photons stored and gathered, and the light that they are expected to bring.
    pub photon_record: PhotonRecord,
    /// Time spent on the pilot (the short run before the first iteration), the iterations, and what the caller adds.
    pub time: TimeSpent,
    /// Core-seconds per phase: pilot, light paths, photon maps and camera paths.
    pub phases: Phases,
    /// Estimated error at moments of the render, in the order of time.
    pub history: Vec<HistoryEntry>,
}

impl RenderStats {
    /// Statistics before the first iteration; `time` has been spent on choosing settings and on the pilot.
    pub(in crate::render) fn new(photon_record: PhotonRecord, time: TimeSpent) -> RenderStats {
        RenderStats {
            iterations: 0,
            light_paths: 0,
            photons: 0,
            light_rejected: 0,
            photon_record,
            time,
            phases: Phases { pilot: time.cpu_seconds, ..Phases::default() },
            history: Vec::new(),
        }
    }

    /// Adds the counts of one iteration.
    pub(in crate::render) fn add_iteration(&mut self, work: &Work) {
        self.iterations += 1;
        self.light_paths += work.light_paths;
        self.photons = work.photons as u64;
        self.light_rejected += work.rejected;
        self.photon_record.counts.add(&work.counts);
    }

    /// Estimates the error of the pixels of this render.
    pub(in crate::render) fn estimate_error(&self, state: &PixelState<'_>) -> ErrorReport {
        ErrorReport::new(state, &self.photon_record, self.light_paths)
    }

    /// Appends a moment with the current counts and times and this error to the history.
    pub(in crate::render) fn record_error(&mut self, estimate: Option<ErrorEstimate>) {
        let RenderStats { iterations, light_paths, time: TimeSpent { seconds, cpu_seconds }, .. } = *self;
        let entry = HistoryEntry { seconds, cpu_seconds, iterations, light_paths, estimate, finished: None };
        self.history.push(entry);
    }

    /// Whether the last moment of the error history is that of the last iteration.
    pub(in crate::render) fn is_recorded(&self) -> bool {
        self.history.last().is_some_and(|entry| entry.iterations == self.iterations)
    }
}
