//! Division of a render's iterations among machines.

use serde::{Deserialize, Serialize};

/// Largest number of shards of a render.
pub const MAX_SHARDS: u64 = 1_000_000;

/// A shard, the part of a render for one machine: the iterations `i` (from 0) with `i mod count = index`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    /// Index of this shard, below `count`.
    pub index: u64,
    /// Number of shards into which the render is divided.
    pub count: u64,
}

impl Shard {
    /// Whether `count` is in range and `index` is below it.
    pub fn is_sound(self) -> bool {
        self.index < self.count && self.count <= MAX_SHARDS
    }
}
