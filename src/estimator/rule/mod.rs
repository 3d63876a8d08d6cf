//! Bandwidth rules, one a file: pure functions from a pass to the next bandwidth.

pub mod chi_squared;
pub mod memoryless;
pub mod volume;
