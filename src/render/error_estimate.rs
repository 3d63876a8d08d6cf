//! The estimated error of a picture, by what it is made of.

use serde::{Deserialize, Serialize};

/// The square of [`Rendered::relative_error`](super::Rendered::relative_error), and of what it is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorEstimate {
    /// Mean relative variance.
    pub variance: f64,
    /// Mean relative squared bias, not below zero.
    pub squared_bias: f64,
    /// Share of pixels of which nothing is known.
    pub unknown: f64,
}

impl ErrorEstimate {
    /// The relative error: the root of all parts together.
    pub fn root(&self) -> f64 {
        (self.variance + self.squared_bias + self.unknown).sqrt()
    }
}
