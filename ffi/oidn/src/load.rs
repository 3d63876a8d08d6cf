//! Finds and opens the library, once per process, or says what to install.

use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use crate::api::Functions;
use crate::device;
use crate::error::Error;

/// Name of the environment variable that, when set and not empty, holds the path of the library to use. Nothing else
/// is tried then.
pub const LIBRARY_VARIABLE: &str = "CAUSTIQUE_OIDN";

/// What the system's loader is asked for, best first: what comes with programs, and with development packages.
const NAMES: &[&str] = &["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"];

/// What all names of the library's file begin with. Those of its modules go on differently.
const STEM: &str = "libOpenImageDenoise.so";

/// Levels of folders that are looked into below a folder that [`Library::load`] is given.
const DEPTH: usize = 3;

/// Open Image Denoise's version number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version {
    /// Always 2.
    pub major: u32,
    /// As in 2.5.
    pub minor: u32,
    /// As in 2.5.1.
    pub patch: u32,
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}.{}", self.major, self.minor, self.patch)
    }
}

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

/// What [`Library::load`] found.
static LOADED: Mutex<Option<Library>> = Mutex::new(None);

impl Library {
    /// The library: found by the first call that finds it, the same for all later ones.
    ///
    /// Candidates in order: the file that [`LIBRARY_VARIABLE`] names, and then no other; the system's loader under
    /// the library's usual names; any `libOpenImageDenoise.so*` below one of `folders`.
    ///
    /// Loading runs the file's initialisers: give it no folder that is not trusted.
    ///
    /// # Errors
    ///
    /// [`Error::NotFound`] with what was tried; [`Error::NoSuchFile`] when the variable names none;
    /// [`Error::Unusable`], as for [`Library::load_from`], when it names one that does not serve.
    pub fn load(folders: &[PathBuf]) -> Result<Library, Error> {
        let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(library) = &*loaded {
            return Ok(library.clone());
        }
        let named = std::env::var_os(LIBRARY_VARIABLE).filter(|path| !path.is_empty()).map(PathBuf::from);
        let library = match named {
            Some(path) => Library::named(&path),
            None => Library::first_of(&candidates(folders)),
        }?;
        Ok(loaded.insert(library).clone())
    }

    /// The file that the variable names. It is a path, even without a folder: the system's loader is not asked.
    fn named(path: &Path) -> Result<Library, Error> {
        match std::path::absolute(path) {
            Ok(absolute) if absolute.is_file() => Library::load_from(absolute),
            _ => Err(Error::NoSuchFile(path.to_owned())),
        }
    }

    fn first_of(candidates: &[PathBuf]) -> Result<Library, Error> {
        let mut tried = Vec::new();
        for candidate in candidates {
            match Library::load_from(candidate) {
                Ok(library) => return Ok(library),
                Err(Error::Unusable { path, reason }) => tried.push((path, reason)),
                Err(other) => tried.push((candidate.clone(), other.to_string())),
            }
        }
        Err(Error::NotFound { tried })
    }

    /// Opens one library file. A bare file name is looked for where the system looks for libraries. The library finds
    /// its own modules: in its folder, as it is laid out by its makers and by `scripts/setup.sh`.
    ///
    /// Loading runs the file's initialisers: give it nothing that is not trusted.
    ///
    /// # Errors
    ///
    /// [`Error::Unusable`] when the file cannot be opened, is not Open Image Denoise 2, or makes no device for this
    /// processor.
    pub fn load_from(path: impl AsRef<Path>) -> Result<Library, Error> {
        let path = path.as_ref();
        let unusable = |path: &Path, reason: String| Error::Unusable { path: path.to_owned(), reason };
        // SAFETY: initialisers run here; that the file is to be trusted is in the documentation.
        let library = unsafe { libloading::Library::new(OsStr::new(path)) }
            .map_err(|error| unusable(path, shorten(path, &error)))?;
        // SAFETY: the symbols carry the library's names; it is never unloaded once they are called (see below).
        let functions = unsafe { Functions::load(&library) }
            .map_err(|error| unusable(path, format!("not Open Image Denoise 2 ({})", shorten(path, &error))))?;
        let path = origin(functions.new_device as *const _).unwrap_or_else(|| path.to_owned());
        // Its worker threads may still be on their way out when the last device is released, so its code must stay
        // mapped. Nothing of it has run before this line but initialisers.
        std::mem::forget(library);

        let version = device::probe(&functions).map_err(|reason| unusable(&path, reason))?;
        if version.major != 2 {
            return Err(unusable(&path, format!("Open Image Denoise {version} is not version 2")));
        }
        Ok(Library { inner: Arc::new(Inner { path, version, functions }) })
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

/// What to try when no file is named, in order. A name without a folder is the system loader's to find.
fn candidates(folders: &[PathBuf]) -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> = NAMES.iter().map(PathBuf::from).collect();
    for folder in folders {
        libraries(folder, DEPTH, &mut all);
    }
    all
}

/// Adds the libraries in `folder` and, `depth` levels deep, below it; longest (fullest version) first.
fn libraries(folder: &Path, depth: usize, all: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort_by(|a, b| b.cmp(a));
    for path in paths {
        let name = path.file_name().and_then(OsStr::to_str).unwrap_or_default();
        if path.is_dir() {
            if depth > 0 {
                libraries(&path, depth - 1, all);
            }
        } else if name.starts_with(STEM) && !all.contains(&path) {
            all.push(path);
        }
    }
}

/// The loader's message without the path, which our own messages begin with.
fn shorten(path: &Path, error: &libloading::Error) -> String {
    let text = error.to_string();
    let prefix = format!("{}: ", path.display());
    text.strip_prefix(&prefix).map(str::to_owned).unwrap_or(text)
}

/// The real file that an address was loaded from.
#[cfg(unix)]
fn origin(address: *const std::ffi::c_void) -> Option<PathBuf> {
    use std::ffi::{CStr, c_char, c_int, c_void};
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
    // SAFETY: a non-null name is a C string that lives as long as the library, which is not unloaded while this
    // function runs.
    let name = unsafe { CStr::from_ptr(info.file_name) };
    let path = PathBuf::from(OsStr::from_bytes(name.to_bytes()));
    Some(path.canonicalize().unwrap_or(path))
}

#[cfg(not(unix))]
fn origin(_address: *const std::ffi::c_void) -> Option<PathBuf> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    const HINT: &str = "run scripts/setup.sh, or set CAUSTIQUE_OIDN to libOpenImageDenoise.so";

    #[test]
    fn a_named_file_that_is_missing_is_an_error_with_advice() {
        for name in ["no/such/libOpenImageDenoise.so", "libOpenImageDenoise.so.2", "/"] {
            let error = Library::named(Path::new(name)).unwrap_err();
            assert_eq!(error.to_string(), format!("CAUSTIQUE_OIDN={name}: no such file"));
            assert_eq!(error.hint().as_deref(), Some(HINT));
        }
    }

    #[test]
    fn nothing_found_lists_what_was_tried() {
        let error = Library::first_of(&["libno-such-denoiser.so.2".into(), "/no/denoiser.so".into()]).unwrap_err();
        let text = error.to_string();
        let start = "Open Image Denoise was not found; tried libno-such-denoiser.so.2: ";
        assert!(text.starts_with(start), "{text}");
        assert!(text.contains("; /no/denoiser.so: "), "{text}");
        assert_eq!(error.hint().as_deref(), Some(HINT));
        assert_eq!(Library::first_of(&[]).unwrap_err().to_string(), "Open Image Denoise was not found");
    }

    #[test]
    fn libraries_below_the_folder_are_found_fullest_version_first_and_without_modules() {
        let folder = tempfile::tempdir().unwrap();
        let lib = folder.path().join("oidn-2.5.1/lib");
        std::fs::create_dir_all(&lib).unwrap();
        for suffix in [".so", ".so.2", ".so.2.5.1", "_core.so.2.5.1", "_device_cpu.so.2.5.1"] {
            std::fs::write(lib.join(format!("libOpenImageDenoise{suffix}")), "").unwrap();
        }
        let mut found = Vec::new();
        libraries(folder.path(), DEPTH, &mut found);
        let names: Vec<_> = found.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["libOpenImageDenoise.so.2.5.1", "libOpenImageDenoise.so.2", "libOpenImageDenoise.so"]);
    }
}
