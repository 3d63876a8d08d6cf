//! Renders of disjoint iterations of one picture, joined.

use super::error_estimate::ErrorEstimate;
use super::history::{History, StopReason};
use super::result::{Rendered, error_estimate};
use super::unseen::PhotonRecord;
use crate::estimator::{BandwidthState, PixelAccumulator};
use crate::render::clock::Phases;
use crate::render::pass::PhotonCounts;
use crate::render::settings::{Settings, Shard};
use crate::scene::MAX_SIZE;
use crate::transport::MAX_LEVELS;
use serde::{Deserialize, Serialize};

/// What a render leaves besides its pixels, whose bandwidths follow from the iteration's number.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Part {
    /// The settings it was made with.
    pub settings: Settings,
    /// Width and height (pixels).
    pub size: (u32, u32),
    /// Iterations done.
    pub iterations: u64,
    /// The number of the last one, from 1.
    pub last: u64,
    /// Light paths emitted.
    pub light_paths: u64,
    /// Photons of the last map.
    pub photons: u64,
    /// Photons and light paths that were not finite.
    pub light_rejected: u64,
    /// Photons stored and gathered.
    pub photon_record: PhotonRecord,
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Core-seconds per phase.
    pub phases: Phases,
    /// Error against time.
    pub history: Vec<History>,
    /// Why it stopped.
    pub stop: StopReason,
}

impl Rendered {
    /// What it is besides its pixels.
    pub fn part(&self) -> Part {
        Part {
            settings: self.settings.clone(),
            size: (self.width, self.height),
            iterations: self.iterations,
            last: self.settings.last(self.iterations),
            light_paths: self.light_paths,
            photons: self.photons,
            light_rejected: self.light_rejected,
            photon_record: self.photon_record,
            seconds: self.seconds,
            phases: self.phases,
            history: self.history.clone(),
            stop: self.stop,
        }
    }

    /// Ends the history with what the pixels tell.
    pub fn close_history(&mut self) {
        let estimate = error_estimate(&self.pixels, &self.settings).map(|error| error.with(self.unseen()));
        let Rendered { seconds, iterations, light_paths, phases: Phases { pilot, light, map, eye }, .. } = *self;
        self.history.retain(|moment| moment.iterations < iterations);
        let cpu_seconds = pilot + light + map + eye;
        self.history.push(History { seconds, cpu_seconds, iterations, light_paths, estimate, finished: None });
    }
}

impl Part {
    /// Whether it can be of a render: a file can say anything.
    pub fn is_sound(&self) -> bool {
        let Settings { shard, levels, .. } = &self.settings;
        let (width, height) = self.size;
        shard.is_sound()
            && (1..=MAX_LEVELS).contains(&levels.count)
            && (1..=MAX_SIZE).contains(&width)
            && (1..=MAX_SIZE).contains(&height)
            && self.iterations.checked_mul(shard.count).is_some()
            && self.last == self.settings.last(self.iterations)
    }

    /// The render with these pixels.
    pub fn rendered(self, pixels: Vec<PixelAccumulator>) -> Rendered {
        Rendered {
            width: self.size.0,
            height: self.size.1,
            pixels,
            techniques: Vec::new(),
            bandwidths: BandwidthState::memoryless(self.settings.schedule(self.last)),
            settings: self.settings,
            iterations: self.iterations,
            light_paths: self.light_paths,
            photons: self.photons,
            light_rejected: self.light_rejected,
            photon_record: self.photon_record,
            seconds: self.seconds,
            phases: self.phases,
            history: self.history,
            stop: self.stop,
        }
    }

    /// All the shards of a render as one; `None` of none. Seconds are those of the slowest, as of machines that render
    /// at once.
    pub fn join(parts: &[Part]) -> Option<Part> {
        let last = parts.iter().max_by_key(|part| part.last)?;
        let sum = |of: fn(&Phases) -> f64| parts.iter().map(|part| of(&part.phases)).sum();
        // All shards trace the same map.
        let once = last.settings.method.has_one_map();
        let of_light =
            |counts: &mut dyn Iterator<Item = u64>| if once { counts.max().unwrap_or(0) } else { counts.sum() };
        let mut photon_record = last.photon_record;
        photon_record.counts = PhotonCounts::default();
        parts.iter().for_each(|part| photon_record.counts.join(&part.photon_record.counts));
        Some(Part {
            photon_record,
            settings: Settings { shard: Shard { index: 0, count: 1 }, ..last.settings.clone() },
            iterations: parts.iter().map(|part| part.iterations).sum(),
            light_paths: of_light(&mut parts.iter().map(|part| part.light_paths)),
            light_rejected: of_light(&mut parts.iter().map(|part| part.light_rejected)),
            seconds: parts.iter().map(|part| part.seconds).fold(0.0, f64::max),
            phases: Phases {
                pilot: sum(|phases| phases.pilot),
                light: sum(|phases| phases.light),
                map: sum(|phases| phases.map),
                eye: sum(|phases| phases.eye),
            },
            history: history(parts),
            stop: parts.iter().map(|part| part.stop).find(|stop| *stop != StopReason::Iterations).unwrap_or(last.stop),
            ..last.clone()
        })
    }
}

/// The moments at which all shards had done the same number of iterations. Shards are independent: the variance of
/// their mean is the mean of their variances over their number; their bias is the same.
fn history(parts: &[Part]) -> Vec<History> {
    let Some((first, others)) = parts.split_first() else { return Vec::new() };
    let at = |moment: &History| {
        let found = others.iter().map(|part| part.history.iter().find(|other| other.iterations == moment.iterations));
        let all: Vec<&History> = std::iter::once(Some(moment)).chain(found).collect::<Option<_>>()?;
        let count = all.len() as f64;
        let estimates: Option<Vec<ErrorEstimate>> = all.iter().map(|moment| moment.estimate).collect();
        let estimate = estimates.map(|estimates| {
            let mean = |of: fn(&ErrorEstimate) -> f64| estimates.iter().map(of).sum::<f64>() / count;
            ErrorEstimate {
                variance: mean(|estimate| estimate.variance) / count,
                squared_bias: mean(|estimate| estimate.squared_bias),
                unknown: mean(|estimate| estimate.unknown),
            }
        });
        Some(History {
            seconds: all.iter().map(|moment| moment.seconds).fold(0.0, f64::max),
            cpu_seconds: all.iter().map(|moment| moment.cpu_seconds).sum(),
            iterations: all.iter().map(|moment| moment.iterations).sum(),
            light_paths: all.iter().map(|moment| moment.light_paths).sum(),
            estimate,
            finished: None,
        })
    };
    first.history.iter().filter_map(at).collect()
}
