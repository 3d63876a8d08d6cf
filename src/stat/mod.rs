//! Order-independent sums and moments, medians, and fits.

pub mod floor;
mod median;
mod moments;
mod power_law;
pub mod sum;

/// Share of the pixels that trimmed errors leave out, those with the largest errors: a few bright samples (fireflies)
/// would dominate the mean.
pub const TRIMMED_SHARE: f64 = 0.005;

pub use median::median;
pub use moments::{Grids, Moments, variance_of_mean};
pub use power_law::PowerLaw;
pub use sum::{Rounding, Sum, Total};
