//! Running statistics.

mod welford;

pub use welford::Welford;
