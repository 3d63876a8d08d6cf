//! Nested bandwidth levels.

use crate::transport::MAX_LEVELS;
use serde::{Deserialize, Serialize};

/// Bandwidth levels: pictures of one render with different kernel bandwidths. The bandwidth of each is 1/sqrt(2) times
/// that of the next larger one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Levels {
    /// Number of levels, 1 to [`MAX_LEVELS`].
    pub count: usize,
    /// Trace a second camera path for all levels but the first, so that level 1 is independent of the others
    /// \[post-reconstruction 2021, 3\], which equation (6) needs. With one path for all levels an iteration costs a
    /// little more than half as much.
    pub two_paths: bool,
}

impl Levels {
    /// Makes `count` levels that share one camera path per pixel.
    pub fn new(count: usize) -> Levels {
        Levels { count: count.clamp(1, MAX_LEVELS), two_paths: false }
    }

    /// Makes `count` levels; if there are several, level 1 has a camera path of its own.
    pub fn decorrelated(count: usize) -> Levels {
        Levels { two_paths: count > 1, ..Levels::new(count) }
    }

    /// Index (from 0) of the level that is the method's own picture: the second largest. It has the usual bandwidth
    /// (k = 10 neighbours if the largest level has k = 20).
    pub fn picture_level(&self) -> usize {
        self.count.saturating_sub(2)
    }
}
