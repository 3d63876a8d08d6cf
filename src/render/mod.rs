//! Rendering: settings, the passes of each method, the loop over iterations, and the account of a render.

mod account;
mod clock;
mod pass;
mod session;
mod settings;

pub use account::output;
pub use account::{
    Accuracy, CONFIDENCE, ErrorCoverage, ErrorEstimate, History, Part, PhotonRecord, Rejections, Rendered, StopReason,
    Unseen,
};
pub use clock::{Clock, Phases, Spent, cpu_seconds, peak_memory};
pub(crate) use pass::Cost;
pub use pass::{
    MAX_TECHNIQUES, PHOTON_BYTES, PhotonCounts, TechniquePicture, WHOLE_TILE, bytes_per_whole_tile, photons_per_path,
    sample_bytes,
};
pub use session::{Control, LEAST, Progress, Session, Stage, State, drive, render};
pub use settings::{
    BandwidthRule, Candidate, DEFAULT_ITERATIONS, DEFAULT_KNN, DEFAULT_MAP_KNN, DEFAULT_MAP_MEMORY,
    DEFAULT_MAP_PHOTONS, DEFAULT_PHOTONS, KernelChoice, Levels, MAX_SHARDS, Method, RadiusRule, Settings, Shard,
};
