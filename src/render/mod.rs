//! Rendering: the pass loop, when it stops, and what it reports.

mod accuracy;
pub mod auto;
mod bidirectional;
mod choice;
mod chunks;
mod clock;
mod control;
mod cost;
mod counting;
mod drive;
mod error_estimate;
mod forecast;
mod groups;
mod guiding;
mod iterate;
mod joined;
mod measures;
mod method;
mod metropolis;
pub mod output;
mod path;
mod pm;
mod region;
mod rejections;
mod result;
mod session;
mod settings;
mod sppm;
mod state;
mod strategy;
mod techniques;
mod tiles;
mod told;
mod unseen;
mod volume;

pub use accuracy::{Accuracy, CONFIDENCE};
pub use clock::{Clock, Spent, cpu_seconds, peak_memory};
pub use control::{Control, History, Progress, StopReason};
pub use drive::{LEAST, drive, render};
pub use error_estimate::ErrorEstimate;
pub use forecast::photons_per_path;
pub use joined::Part;
pub use measures::bytes_of_measures;
pub use method::{BandwidthRule, DEFAULT_KNN, DEFAULT_MAP_KNN, DEFAULT_MAP_PHOTONS, DEFAULT_PHOTONS, Method};
pub use pm::PHOTON_BYTES;
pub use rejections::Rejections;
pub use result::{Phases, Rendered};
pub use session::{Session, Stage};
pub use settings::{
    DEFAULT_ITERATIONS, DEFAULT_MAP_MEMORY, KernelChoice, Levels, MAX_SHARDS, RadiusRule, Settings, Shard,
};
pub use state::State;
pub use strategy::Strategy;
pub use techniques::{MAX_TECHNIQUES, TechniquePicture};
pub use told::Told;
pub use unseen::{PhotonCounts, PhotonRecord, Unseen};
