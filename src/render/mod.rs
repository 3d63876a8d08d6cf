//! Rendering: settings, the passes of each method, the loop over iterations, and the account of a render.

mod account;
mod clock;
mod initial_bandwidth;
mod input;
mod pass;
mod session;
mod settings;

pub use account::output;
pub use account::{
    Accuracy, CONFIDENCE, ErrorCoverage, ErrorEstimate, ErrorReport, HistoryEntry, PhotonRecord, Rejections,
    RenderStats, Rendered, ShardResult, StopReason, UnseenLight,
};
pub use clock::{Clock, Phases, TimeSpent, cpu_seconds, peak_memory};
pub use initial_bandwidth::{FOOTPRINT_PIXELS, InitialBandwidth, MIN_USER_BANDWIDTH_RATIO, SCREEN_CAP};
pub use input::{Motion, RenderInput};
pub(crate) use pass::Cost;
pub use pass::{
    MAX_TECHNIQUES, PHOTON_BYTES, PhotonCounts, Proxy, SecondMoments, TechniquePicture, WHOLE_TILE,
    bytes_per_whole_tile, learn_light, photons_per_path, sample_bytes,
};
pub use session::{Control, ExpectedError, MIN_ITERATIONS_FOR_ERROR, Progress, Session, State, render, run_session};
pub use settings::{
    BandwidthChoice, BandwidthRule, Candidate, Counts, DEFAULT_ITERATIONS, DEFAULT_KNN, DEFAULT_MAP_KNN,
    DEFAULT_MAP_MEMORY, DEFAULT_MAP_PHOTONS, DEFAULT_PHOTONS, GridChoice, LIGHT_PATH_STEPS, Levels, MAX_CONNECTIONS,
    MAX_LIGHT_PATHS_PER_PIXEL, MAX_SHARDS, Method, MethodChoice, OnOff, RadiusRule, Settings, SettingsRequest, Shard,
};
