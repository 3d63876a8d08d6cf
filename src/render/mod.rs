//! Rendering: the pass loop, when it stops, and what it reports.

mod control;
mod result;
mod settings;
mod sppm;

pub use control::{Control, History, Progress, StopReason};
pub use result::Rendered;
pub use settings::{Levels, Settings, Shard};
pub use sppm::sppm;
