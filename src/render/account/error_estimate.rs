//! The estimated error of a picture, by what it is made of.

use super::unseen::Unseen;
use serde::{Deserialize, Serialize};

/// The square of [`Rendered::relative_error`](crate::render::Rendered::relative_error), and of what it is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorEstimate {
    /// Mean relative variance.
    pub variance: f64,
    /// Mean relative squared bias, not below zero.
    pub squared_bias: f64,
    /// Share of pixels of which nothing is known, and mean relative square of light that photons have not brought.
    pub unknown: f64,
}

impl ErrorEstimate {
    /// With light of which hardly any photon has come.
    #[must_use]
    pub fn with(self, unseen: Unseen) -> ErrorEstimate {
        ErrorEstimate { unknown: self.unknown + unseen.squared, ..self }
    }

    /// The relative error: the root of all parts together.
    pub fn root(&self) -> f64 {
        (self.variance + self.squared_bias + self.unknown).sqrt()
    }
}
