//! Running statistics, and fits.

pub mod floor;
mod moments;
mod power_law;
pub mod sum;

pub use moments::{Grids, Moments, variance_of_mean};
pub use power_law::PowerLaw;
pub use sum::{Rounding, Sum, Total};
