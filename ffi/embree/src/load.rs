//! Finds and opens the library, version 4 or 3, or says what to install.

use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::api::{Common, Trace, Trace3, Trace4};
use crate::error::Error;
use crate::probe;

/// Name of the environment variable that, when set and not empty, holds the path of the Embree library to
/// use. Nothing else is tried then.
pub const LIBRARY_VARIABLE: &str = "CAUSTIQUE_EMBREE";

/// Names to try, best first. Those with a version number are what distributions install for programs, the
/// others come with development packages.
#[cfg(not(any(target_os = "macos", windows)))]
const NAMES: &[&str] = &["libembree4.so.4", "libembree3.so.3", "libembree4.so", "libembree3.so"];
#[cfg(target_os = "macos")]
const NAMES: &[&str] = &[
    "libembree4.4.dylib",
    "libembree4.dylib",
    "/opt/homebrew/lib/libembree4.dylib",
    "/usr/local/lib/libembree4.dylib",
    "libembree3.3.dylib",
    "libembree3.dylib",
];
#[cfg(windows)]
const NAMES: &[&str] = &["embree4.dll", "embree3.dll"];

/// Embree's version number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version {
    /// 3 or 4.
    pub major: u32,
    /// As in 4.3.
    pub minor: u32,
    /// As in 4.3.3.
    pub patch: u32,
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}.{}", self.major, self.minor, self.patch)
    }
}

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
    /// Opens the library named by [`LIBRARY_VARIABLE`], or else the first usable one of the names
    /// Embree goes by, version 4 before 3, where the system looks for libraries.
    ///
    /// # Errors
    ///
    /// [`Error::NotFound`] with what was tried; [`Error::Unusable`] as for [`Library::load_from`].
    pub fn load() -> Result<Library, Error> {
        match std::env::var_os(LIBRARY_VARIABLE) {
            Some(path) if !path.is_empty() => Library::load_from(Path::new(&path)),
            _ => Library::first_of(NAMES),
        }
    }

    fn first_of(names: &[&str]) -> Result<Library, Error> {
        let mut tried = Vec::new();
        for name in names {
            match Library::load_from(Path::new(name)) {
                Ok(library) => return Ok(library),
                Err(Error::Unusable { path, reason }) => tried.push((path, reason)),
                Err(other) => tried.push((PathBuf::from(name), other.to_string())),
            }
        }
        Err(Error::NotFound { tried })
    }

    /// Opens one library file. A bare file name is looked for where the system looks for libraries.
    ///
    /// Loading runs the file's initialisers: give it nothing that is not trusted.
    ///
    /// # Errors
    ///
    /// [`Error::Unusable`] when the file cannot be opened, is not Embree, is neither version 3 nor 4, or does
    /// not find the triangle of the trial scene where it is.
    pub fn load_from(path: impl AsRef<Path>) -> Result<Library, Error> {
        let path = path.as_ref();
        let unusable = |path: &Path, reason: String| Error::Unusable { path: path.to_owned(), reason };
        // SAFETY: initialisers run here; that the file is to be trusted is in the documentation.
        let library = unsafe { libloading::Library::new(OsStr::new(path)) }
            .map_err(|error| unusable(path, shorten(path, &error)))?;
        // SAFETY: the symbols carry Embree's names; the library is never unloaded (see below).
        let common = unsafe { Common::load(&library) }
            .map_err(|error| unusable(path, format!("not Embree 3 or 4 ({})", shorten(path, &error))))?;
        let path = origin(common.new_device as *const _).unwrap_or_else(|| path.to_owned());

        let version = probe::version(&common).map_err(|reason| unusable(&path, reason))?;
        let trace = match version.major {
            // SAFETY: as for `common`; the version says which form the functions have.
            3 => unsafe { Trace3::load(&library) }.map(Trace::V3),
            // SAFETY: as above.
            4 => unsafe { Trace4::load(&library) }.map(Trace::V4),
            _ => {
                let reason = format!("Embree {version} is neither version 3 nor 4");
                return Err(unusable(&path, reason));
            }
        }
        .map_err(|error| unusable(&path, shorten(&path, &error)))?;
        // Embree's worker threads may still be on their way out when the last device is released, so its
        // code must stay mapped.
        std::mem::forget(library);

        let with_extent =
            |hit_extent| Library { inner: Arc::new(Inner { path: path.clone(), version, hit_extent, common, trace }) };
        let extent = probe::try_out(&with_extent(0)).map_err(|reason| unusable(&path, reason))?;
        Ok(with_extent(extent))
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

/// The loader's message without the path, which our own messages begin with.
fn shorten(path: &Path, error: &libloading::Error) -> String {
    let text = error.to_string();
    let prefix = format!("{}: ", path.display());
    text.strip_prefix(&prefix).map(str::to_owned).unwrap_or(text)
}

/// The file that an address was loaded from.
#[cfg(unix)]
fn origin(address: *const std::ffi::c_void) -> Option<PathBuf> {
    use std::ffi::{CStr, OsStr, c_char, c_int, c_void};
    use std::os::unix::ffi::OsStrExt;

    #[repr(C)]
    struct DlInfo {
        file_name: *const c_char,
        file_base: *mut c_void,
        symbol_name: *const c_char,
        symbol_address: *mut c_void,
    }
    unsafe extern "C" {
        fn dladdr(address: *const c_void, info: *mut DlInfo) -> c_int;
    }
    let null = std::ptr::null_mut();
    let mut info =
        DlInfo { file_name: null as *const _, file_base: null, symbol_name: null as *const _, symbol_address: null };
    // SAFETY: `dladdr` only looks the address up, and fills in `info` when it returns non-zero.
    if unsafe { dladdr(address, &mut info) } == 0 || info.file_name.is_null() {
        return None;
    }
    // SAFETY: a non-null name is a C string that lives as long as the library, which is never unloaded while
    // this function runs.
    let name = unsafe { CStr::from_ptr(info.file_name) };
    Some(PathBuf::from(OsStr::from_bytes(name.to_bytes())))
}

#[cfg(not(unix))]
fn origin(_address: *const std::ffi::c_void) -> Option<PathBuf> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_found_lists_what_was_tried_and_names_packages() {
        let error = Library::first_of(&["libno-such-embree.so.4", "libno-such-embree.so.3"]).unwrap_err();
        let text = error.to_string();
        assert!(text.starts_with("Embree was not found; tried libno-such-embree.so.4: "), "{text}");
        assert!(text.contains("; libno-such-embree.so.3: "), "{text}");
        let hint = error.hint().unwrap();
        assert!(hint.contains("Debian 12, Ubuntu 22.04: apt install libembree3-3"), "{hint}");
        assert!(hint.contains("Debian 13, Ubuntu 24.04: apt install libembree4-4"), "{hint}");
        assert!(hint.contains(LIBRARY_VARIABLE), "{hint}");
    }
}
