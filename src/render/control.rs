//! Progress, stop conditions and history. The only clocks of a render are here and decide nothing but when to stop.

use super::result::ErrorEstimate;
use super::told::Told;
use rustix::time::{ClockId, clock_gettime};
use serde::Serialize;

/// What an observer wants after an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// Go on.
    Continue,
    /// Stop here; what is finished is kept.
    Stop,
}

/// Why a render stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// All iterations are done.
    Iterations,
    /// The time is up.
    Time,
    /// The estimated error is reached.
    Error,
    /// The observer stopped it.
    Interrupted,
}

/// State after an iteration.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Iterations done.
    pub iteration: u64,
    /// Iterations asked for, when that is what stops the render.
    pub iterations: Option<u64>,
    /// Wall-clock seconds since the render began.
    pub seconds: f64,
    /// Estimated seconds to go, when that can be told.
    pub remaining: Option<f64>,
    /// Light paths emitted so far.
    pub light_paths: u64,
    /// Photons of the last map.
    pub photons: usize,
    /// Estimated relative error of the method's own image (root of relMSE), when two iterations are done and light is
    /// seen.
    pub error: Option<f64>,
    /// What that knows of.
    pub told: Told,
}

/// One moment of a render's history.
#[derive(Clone, Copy, Debug)]
pub struct History {
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Processor seconds of the whole process.
    pub cpu_seconds: f64,
    /// Iterations done.
    pub iterations: u64,
    /// Light paths emitted.
    pub light_paths: u64,
    /// Estimated squared relative error, when two iterations are done.
    pub estimate: Option<ErrorEstimate>,
}

/// Wall clock since its making.
#[derive(Clone, Copy, Debug)]
pub struct Clock(std::time::Instant);

impl Clock {
    /// Starts now.
    #[allow(clippy::disallowed_methods, reason = "progress and stop conditions are what clocks are for")]
    pub fn start() -> Clock {
        Clock(std::time::Instant::now())
    }

    /// Seconds since the start.
    pub fn seconds(&self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}

/// Processor time of the process in seconds.
pub fn cpu_seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Peak resident memory of the process in bytes, from `/proc`; 0 where there is none.
pub fn peak_memory() -> u64 {
    let read = || -> Option<u64> {
        let status = std::fs::read_to_string("/proc/self/status").ok()?;
        let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
        let kib: u64 = line.split_whitespace().next()?.parse().ok()?;
        Some(kib * 1024)
    };
    read().unwrap_or(0)
}
