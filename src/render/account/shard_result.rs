//! Results of shards, and their merge into the result of one render.

use super::error_estimate::{ErrorEstimate, ErrorReport};
use super::history::{HistoryEntry, StopReason};
use super::rendered::Rendered;
use super::stats::RenderStats;
use crate::estimator::{BandwidthState, PixelAccumulator};
use crate::render::clock::{Phases, TimeSpent};
use crate::render::pass::PhotonCounts;
use crate::render::settings::{Settings, Shard};
use crate::scene::MAX_SIZE;
use crate::transport::MAX_LEVELS;
use serde::{Deserialize, Serialize};

/// The result of a shard (a part of a render's iterations, for one machine) without its pixels. Its bandwidths follow
/// from the number of the last iteration.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ShardResult {
    /// Settings of the shard's render.
    pub settings: Settings,
    /// Width and height of the picture (pixels).
    pub size: (u32, u32),
    /// Number of the shard's last iteration among those of the whole render, from 1.
    pub last_iteration: u64,
    /// Counts, times and error history of the shard.
    pub stats: RenderStats,
    /// Why the shard's render stopped.
    pub stop: StopReason,
}

impl Rendered {
    /// The result of this shard without its pixels.
    pub fn shard_result(&self) -> ShardResult {
        ShardResult {
            settings: self.settings.clone(),
            size: (self.width, self.height),
            last_iteration: self.settings.last_iteration(self.stats.iterations),
            stats: self.stats.clone(),
            stop: self.stop,
        }
    }
}

impl ShardResult {
    /// Whether the values are ones that a render can have; a result that was read from a file can hold any values.
    pub fn is_sound(&self) -> bool {
        let Settings { shard, levels, .. } = &self.settings;
        let (width, height) = self.size;
        shard.is_sound()
            && (1..=MAX_LEVELS).contains(&levels.count)
            && (1..=MAX_SIZE).contains(&width)
            && (1..=MAX_SIZE).contains(&height)
            && self.stats.iterations.checked_mul(shard.count).is_some()
            && self.last_iteration == self.settings.last_iteration(self.stats.iterations)
    }

    /// Joins the result with its pixels, estimates their error and appends it to the error history.
    pub fn with_pixels(self, pixels: Vec<PixelAccumulator>) -> Rendered {
        let mut rendered = Rendered {
            width: self.size.0,
            height: self.size.1,
            pixels,
            techniques: Vec::new(),
            bandwidths: BandwidthState::memoryless(self.settings.schedule(self.last_iteration)),
            settings: self.settings,
            stats: self.stats,
            error: ErrorReport::default(),
            stop: self.stop,
        };
        rendered.error = rendered.estimate_error();
        let RenderStats { history, iterations, .. } = &mut rendered.stats;
        history.retain(|entry| entry.iterations < *iterations);
        rendered.stats.record_error(rendered.error.estimate);
        rendered
    }

    /// Merges the results of the shards of one render; `None` if the list is empty.
    pub fn merge(shards: &[ShardResult]) -> Option<ShardResult> {
        let last = shards.iter().max_by_key(|shard| shard.last_iteration)?;
        let stops = shards.iter().map(|shard| shard.stop);
        Some(ShardResult {
            settings: Settings { shard: Shard { index: 0, count: 1 }, ..last.settings.clone() },
            size: last.size,
            last_iteration: last.last_iteration,
            stats: merge_stats(shards, last),
            stop: stops.into_iter().find(|stop| *stop != StopReason::Iterations).unwrap_or(last.stop),
        })
    }
}

/// Merges the statistics of shards: sums of counts, and the wall-clock time of the slowest shard, as if machines had
/// rendered the shards in parallel.
fn merge_stats(shards: &[ShardResult], last: &ShardResult) -> RenderStats {
    let stats = || shards.iter().map(|shard| &shard.stats);
    let phase = |get: fn(&Phases) -> f64| stats().map(|stats| get(&stats.phases)).sum();
    // With one map, every shard traces the same light paths.
    let once = last.settings.method.has_one_map();
    let light = |get: fn(&RenderStats) -> u64| {
        let counts = stats().map(get);
        if once { counts.max().unwrap_or(0) } else { counts.sum() }
    };
    let mut photon_record = last.stats.photon_record;
    photon_record.counts = PhotonCounts::default();
    stats().for_each(|stats| photon_record.counts.add(&stats.photon_record.counts));
    RenderStats {
        iterations: stats().map(|stats| stats.iterations).sum(),
        light_paths: light(|stats| stats.light_paths),
        photons: last.stats.photons,
        light_rejected: light(|stats| stats.light_rejected),
        photon_record,
        time: TimeSpent {
            seconds: stats().map(|stats| stats.time.seconds).fold(0.0, f64::max),
            cpu_seconds: stats().map(|stats| stats.time.cpu_seconds).sum(),
        },
        phases: Phases {
            pilot: phase(|phases| phases.pilot),
            light: phase(|phases| phases.light),
            map: phase(|phases| phases.map),
            eye: phase(|phases| phases.eye),
        },
        history: merge_histories(shards),
    }
}

/// Merges the error histories of shards, at the moments at which all had done the same number of iterations. Shards are
/// independent: the variance of their mean is the mean of their variances divided by their number; all shards have the
/// same bias.
fn merge_histories(shards: &[ShardResult]) -> Vec<HistoryEntry> {
    let Some((first, others)) = shards.split_first() else { return Vec::new() };
    let merge = |entry: &HistoryEntry| {
        let same = |other: &&HistoryEntry| other.iterations == entry.iterations;
        let found = others.iter().map(|shard| shard.stats.history.iter().find(same));
        let entries: Vec<&HistoryEntry> = std::iter::once(Some(entry)).chain(found).collect::<Option<_>>()?;
        Some(HistoryEntry {
            seconds: entries.iter().map(|entry| entry.seconds).fold(0.0, f64::max),
            cpu_seconds: entries.iter().map(|entry| entry.cpu_seconds).sum(),
            iterations: entries.iter().map(|entry| entry.iterations).sum(),
            light_paths: entries.iter().map(|entry| entry.light_paths).sum(),
            estimate: merge_estimates(&entries),
            finished: None,
        })
    };
    first.stats.history.iter().filter_map(merge).collect()
}

/// Estimated error of the mean of all shards at one moment; `None` if a shard has no estimate.
fn merge_estimates(entries: &[&HistoryEntry]) -> Option<ErrorEstimate> {
    let estimates: Vec<ErrorEstimate> = entries.iter().map(|entry| entry.estimate).collect::<Option<_>>()?;
    let count = estimates.len() as f64;
    let mean = |get: fn(&ErrorEstimate) -> f64| estimates.iter().map(get).sum::<f64>() / count;
    Some(ErrorEstimate {
        variance: mean(|estimate| estimate.variance) / count,
        squared_bias: mean(|estimate| estimate.squared_bias),
        unknown: mean(|estimate| estimate.unknown),
    })
}
