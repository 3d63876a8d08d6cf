//! Clocks and memory of the process. Only this module and [`crate::stop`] read clocks, which decide only when a render
//! stops.

pub use crate::system::{cpu_seconds, peak_memory};
use serde::{Deserialize, Serialize};

/// A stopwatch.
#[derive(Clone, Copy, Debug)]
pub struct Clock(std::time::Instant);

impl Clock {
    /// Starts a stopwatch.
    #[allow(clippy::disallowed_methods, reason = "progress and stop conditions are what clocks are for")]
    pub fn start() -> Clock {
        Clock(std::time::Instant::now())
    }

    /// Wall-clock seconds since the stopwatch was started.
    pub fn seconds(&self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}

/// Time spent on a render, without the time between its iterations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TimeSpent {
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Processor seconds of the whole process.
    pub cpu_seconds: f64,
}

impl TimeSpent {
    /// Runs `work`, adds the time that it takes, and returns its result.
    pub fn measure<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let (clock, cpu_start) = (Clock::start(), cpu_seconds());
        let done = work();
        self.seconds += clock.seconds();
        self.cpu_seconds += cpu_seconds() - cpu_start;
        done
    }

    /// Adds the seconds of `other`.
    pub fn add(&mut self, other: TimeSpent) {
        self.seconds += other.seconds;
        self.cpu_seconds += other.cpu_seconds;
    }
}

/// Core-seconds (processor time of the whole process) per phase of a render.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Phases {
    /// Choice of the method, pilots (short runs before the first iteration), and initial bandwidths.
    pub pilot: f64,
    /// Tracing of light paths.
    pub light: f64,
    /// Construction of photon maps.
    pub map: f64,
    /// Camera paths, and gathering of photons.
    pub eye: f64,
}
