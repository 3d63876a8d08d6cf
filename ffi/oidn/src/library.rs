//! The opened library: its functions, and what it says of itself.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use caustique_library::Version;

use crate::api::Functions;

/// Name of the environment variable that, when set and not empty, holds the path of the library to use. Nothing else
/// is tried then.
pub const LIBRARY_VARIABLE: &str = "CAUSTIQUE_OIDN";

/// An opened Open Image Denoise that has made a device. Clones share it.
#[derive(Clone)]
pub struct Library {
    inner: Arc<Inner>,
}

struct Inner {
    path: PathBuf,
    version: Version,
    functions: Functions,
}

impl Library {
    /// A library with these functions, which was opened from `path`.
    pub(crate) fn new(path: PathBuf, version: Version, functions: Functions) -> Library {
        Library { inner: Arc::new(Inner { path, version, functions }) }
    }

    /// The real file that was opened, links followed, where the system tells; else the name it was found by.
    pub fn path(&self) -> &Path {
        &self.inner.path
    }

    /// The version, as a device of the library reports it.
    pub fn version(&self) -> Version {
        self.inner.version
    }

    /// Whether [`crate::Quality::Fast`] is known: from version 2.3 on.
    pub fn has_fast(&self) -> bool {
        self.version() >= Version { major: 2, minor: 3, patch: 0 }
    }

    pub(crate) fn functions(&self) -> &Functions {
        &self.inner.functions
    }
}

impl fmt::Debug for Library {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Open Image Denoise {} at {}", self.version(), self.path().display())
    }
}
