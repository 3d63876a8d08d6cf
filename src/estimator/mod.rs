//! Estimates from samples: accumulators of pixels, errors, and the rules of bandwidths.

mod coverage;
mod error;
mod pixel_accumulator;
mod quarters;
mod rejected;
pub mod rule;
mod state;

pub use coverage::Coverage;
pub use error::SquaredError;
pub use pixel_accumulator::{FAR, Parts, PixelAccumulator, QUARTERS};
pub use quarters::variance_ratio;
pub use rejected::Rejected;
pub use state::{BandwidthState, Schedule, level_factor2};
