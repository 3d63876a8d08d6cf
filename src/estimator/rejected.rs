//! The samples of a pixel that were not finite, counted by what had spoilt them.

use crate::transport::Cause;
use serde::{Deserialize, Serialize};

/// Counts by cause, in the order of [`Cause::ALL`]; pixels without any, which is nearly all, have no memory for them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rejected(Option<Box<[u32; Cause::ALL.len()]>>);

impl Rejected {
    /// Counts a sample.
    #[cold]
    pub fn count(&mut self, cause: Cause) {
        self.0.get_or_insert_default()[cause as usize] += 1;
    }

    /// Adds those of other iterations.
    pub fn join(&mut self, other: &Rejected) {
        let Some(others) = &other.0 else { return };
        self.0.get_or_insert_default().iter_mut().zip(others.iter()).for_each(|(own, other)| *own += other);
    }

    /// Samples by cause.
    pub fn by_cause(&self) -> [u32; Cause::ALL.len()] {
        self.0.as_deref().copied().unwrap_or_default()
    }

    /// All samples.
    pub fn total(&self) -> u32 {
        self.by_cause().iter().sum()
    }
}
