//! The opened library: its functions, and what it says of itself.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use caustique_library::Version;

use crate::api::{Common, Trace};

/// Name of the environment variable that, when set and not empty, holds the path of the Embree library to
/// use. Nothing else is tried then.
pub const LIBRARY_VARIABLE: &str = "CAUSTIQUE_EMBREE";

/// An opened and tried Embree library. Clones share it.
#[derive(Clone)]
pub struct Library {
    inner: Arc<Inner>,
}

struct Inner {
    path: PathBuf,
    version: Version,
    hit_extent: usize,
    common: Common,
    trace: Trace,
}

impl Library {
    /// A library with these functions, which was opened from `path` and writes `hit_extent` bytes of `RTCRayHit`.
    pub(crate) fn new(path: &Path, version: Version, hit_extent: usize, common: Common, trace: Trace) -> Library {
        Library { inner: Arc::new(Inner { path: path.to_owned(), version, hit_extent, common, trace }) }
    }

    /// The file that was opened: its full path where the system tells, else the name it was found by.
    pub fn path(&self) -> &Path {
        &self.inner.path
    }

    /// The version, as a device of the library reports it.
    pub fn version(&self) -> Version {
        self.inner.version
    }

    /// How many bytes of `RTCRayHit` the library was seen to use when it was tried: 80 up to Embree 4.2,
    /// 84 from 4.3 on. Room is kept for 96; a library that uses more is refused.
    pub fn hit_extent(&self) -> usize {
        self.inner.hit_extent
    }

    pub(crate) fn common(&self) -> &Common {
        &self.inner.common
    }

    pub(crate) fn trace(&self) -> Trace {
        self.inner.trace
    }
}

impl fmt::Debug for Library {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Embree {} at {}", self.version(), self.path().display())
    }
}
