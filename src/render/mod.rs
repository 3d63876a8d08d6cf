//! Rendering: the pass loop, when it stops, and what it reports.

pub mod auto;
mod bidirectional;
mod choice;
mod control;
mod cost;
mod counting;
mod drive;
mod forecast;
mod guiding;
mod method;
pub mod output;
mod pm;
mod region;
mod result;
mod session;
mod settings;
mod sppm;
mod techniques;
mod tiles;
mod told;
mod volume;

pub use control::{Clock, Control, History, Progress, StopReason, cpu_seconds, peak_memory};
pub use drive::render;
pub use forecast::photons_per_path;
pub use method::Method;
pub use pm::PHOTON_BYTES;
pub use result::{ErrorEstimate, Phases, Rendered};
pub use session::{Session, Spent, Stage};
pub use settings::{
    DEFAULT_ITERATIONS, DEFAULT_KNN, DEFAULT_MAP_KNN, DEFAULT_MAP_MEMORY, DEFAULT_MAP_PHOTONS, DEFAULT_PHOTONS,
    KernelChoice, Levels, RadiusRule, Settings, Shard,
};
pub use techniques::{MAX_TECHNIQUES, TechniquePicture};
pub use told::Told;
