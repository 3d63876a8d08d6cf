//! A loaded library.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use caustique_library::Version;

use crate::api::{Common, Trace};

/// Environment variable with the path of the Embree library to use. If it is set and not empty, no other library is
/// tried.
pub const LIBRARY_VARIABLE: &str = "CAUSTIQUE_EMBREE";

/// A loaded and tested Embree library. Clones share it.
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
    /// The library with these functions that was loaded from `path` and writes `hit_extent` bytes of Embree's structure
    /// `RTCRayHit`.
    pub(crate) fn new(path: &Path, version: Version, hit_extent: usize, common: Common, trace: Trace) -> Library {
        Library { inner: Arc::new(Inner { path: path.to_owned(), version, hit_extent, common, trace }) }
    }

    /// The file that was loaded: its full path if the system reports it, else the name that was requested.
    pub fn path(&self) -> &Path {
        &self.inner.path
    }

    /// The version of Embree that a device of the library reports.
    pub fn version(&self) -> Version {
        self.inner.version
    }

    /// Number of bytes of `RTCRayHit` that the library wrote in a test: 80 up to Embree 4.2, 84 from 4.3 on. This crate
    /// reserves 96 bytes and refuses libraries that write more.
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
