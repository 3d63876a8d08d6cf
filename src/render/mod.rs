//! Rendering: the pass loop, when it stops, and what it reports.

mod bidirectional;
mod control;
pub mod output;
mod paths;
mod result;
mod settings;
mod sppm;

pub use bidirectional::Method;
pub use control::{Clock, Control, History, Progress, StopReason, cpu_seconds, peak_memory};
pub use paths::paths;
pub use result::{Phases, Rendered};
pub use settings::{DEFAULT_ITERATIONS, DEFAULT_KNN, DEFAULT_PHOTONS, Levels, Settings, Shard};
pub use sppm::sppm;
