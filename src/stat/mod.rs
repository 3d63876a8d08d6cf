//! Running statistics, and fits.

pub mod floor;
mod power_law;
mod welford;

pub use power_law::PowerLaw;
pub use welford::Welford;
