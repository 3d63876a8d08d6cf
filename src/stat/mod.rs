//! Running statistics, and fits.

mod power_law;
mod welford;

pub use power_law::PowerLaw;
pub use welford::Welford;
