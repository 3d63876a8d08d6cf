//! Counts of rejected samples of a pixel, by cause.

use crate::transport::Cause;
use serde::{Deserialize, Serialize};

/// Counts of rejected samples of one pixel, in the order of [`Cause::ALL`]. Most pixels have none and use no memory for
/// them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rejected(Option<Box<[u32; Cause::ALL.len()]>>);

impl Rejected {
    /// Counts one sample that was rejected because of `cause`.
    #[cold]
    pub fn count(&mut self, cause: Cause) {
        self.0.get_or_insert_default()[cause as usize] += 1;
    }

    /// Adds the counts of other iterations of the pixel.
    pub fn join(&mut self, other: &Rejected) {
        let Some(others) = &other.0 else { return };
        self.0.get_or_insert_default().iter_mut().zip(others.iter()).for_each(|(own, other)| *own += other);
    }

    /// Number of rejected samples, by cause.
    pub fn by_cause(&self) -> [u32; Cause::ALL.len()] {
        self.0.as_deref().copied().unwrap_or_default()
    }

    /// Number of all rejected samples.
    pub fn total(&self) -> u32 {
        self.by_cause().iter().sum()
    }
}
