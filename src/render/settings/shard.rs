//! Division of a render's iterations among machines.

use serde::{Deserialize, Serialize};
use std::str::FromStr;

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

impl FromStr for Shard {
    type Err = String;
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((index, count)) if (Shard { index, count }).is_sound() => Ok(Shard { index, count }),
            Some((_, 0)) => Err("there is no shard of 0".into()),
            Some((_, count)) if count <= MAX_SHARDS => Err(format!("shards of {count} are 0 to {}", count - 1)),
            Some(_) => Err(format!("there are at most {MAX_SHARDS} shards")),
            None => Err("it must be I/N, such as 0/4".into()),
        }
    }
}
