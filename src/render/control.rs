//! Progress, stop conditions and history. The only clocks of a render are here and decide nothing but when to stop.

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
    /// Estimated relative error of the method's own image (root of relMSE, bias included), when two iterations are done.
    pub error: Option<f64>,
}

/// One moment of a render's history.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct History {
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Processor seconds of the whole process.
    pub cpu_seconds: f64,
    /// Iterations done.
    pub iterations: u64,
    /// Light paths emitted.
    pub light_paths: u64,
    /// Estimated relative error.
    pub error: Option<f64>,
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

/// Processor time of the process in seconds, from `/proc`; 0 where there is none.
pub fn cpu_seconds() -> f64 {
    // Fields 14 and 15 (user and system time) count in ticks of 1/100 s on every Linux platform; the name in field 2
    // may hold spaces, so count from its closing parenthesis.
    let read = || -> Option<f64> {
        let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
        let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
        let user: f64 = fields.next()?.parse().ok()?;
        let system: f64 = fields.next()?.parse().ok()?;
        Some((user + system) / 100.0)
    };
    read().unwrap_or(0.0)
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
