//! Rendering: the pass loop, when it stops, and what it reports.

mod bidirectional;
mod control;
mod paths;
mod result;
mod settings;
mod sppm;

pub use bidirectional::Method;
pub use control::{Control, History, Progress, StopReason};
pub use paths::paths;
pub use result::Rendered;
pub use settings::{Levels, Settings, Shard};
pub use sppm::sppm;
