//! The account of a render: pixels, layers, counts, and the error as it is estimated without a reference.

mod accuracy;
mod error_coverage;
mod error_estimate;
mod history;
mod joined;
pub mod output;
mod rejections;
mod result;
mod unseen;

pub use accuracy::{Accuracy, CONFIDENCE};
pub use error_coverage::ErrorCoverage;
pub use error_estimate::ErrorEstimate;
pub use history::{History, StopReason};
pub use joined::Part;
pub use rejections::Rejections;
pub use result::Rendered;
pub(super) use result::error_estimate;
pub use unseen::{PhotonRecord, Unseen};
