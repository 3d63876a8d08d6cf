//! A loaded library.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use caustique_library::Version;

use crate::api::Functions;

/// Environment variable with the path of the Open Image Denoise library to use. If it is set and not empty, no other
/// library is tried.
pub const LIBRARY_VARIABLE: &str = "CAUSTIQUE_OIDN";

/// A loaded Open Image Denoise library that has created a device in a test. Clones share it.
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
    /// The Open Image Denoise library with these functions that was loaded from `path`.
    pub(crate) fn new(path: PathBuf, version: Version, functions: Functions) -> Library {
        Library { inner: Arc::new(Inner { path, version, functions }) }
    }

    /// The file that was loaded, with symbolic links resolved, if the system reports it, else the name that was
    /// requested.
    pub fn path(&self) -> &Path {
        &self.inner.path
    }

    /// The version of Open Image Denoise that a device of the library reports.
    pub fn version(&self) -> Version {
        self.inner.version
    }

    /// Whether the library supports [`crate::Quality::Fast`]: from version 2.3 on.
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
