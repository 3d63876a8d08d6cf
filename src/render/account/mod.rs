//! The result of a render: pixels, layers, statistics, and the error estimated without a reference.

mod accuracy;
mod error_coverage;
mod error_estimate;
mod history;
pub mod output;
mod photon_record;
mod pixel_state;
mod rejections;
mod rendered;
mod shard_result;
mod stats;

pub use accuracy::{Accuracy, CONFIDENCE};
pub use error_coverage::ErrorCoverage;
pub use error_estimate::{ErrorEstimate, ErrorReport};
pub use history::{HistoryEntry, StopReason};
pub use photon_record::{PhotonRecord, UnseenLight};
pub(super) use pixel_state::PixelState;
pub use rejections::Rejections;
pub use rendered::Rendered;
pub use shard_result::ShardResult;
pub use stats::RenderStats;
