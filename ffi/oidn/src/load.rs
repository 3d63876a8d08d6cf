//! Finds and loads the library, once per process.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use caustique_library::{Folders, Refusal, file_containing, load_first_of, open, path_from_env};

use crate::api::Functions;
use crate::device;
use crate::error::Error;
use crate::library::{LIBRARY_VARIABLE, Library};

/// File names of Open Image Denoise for the system's loader, best first: of runtime packages, then of development
/// packages.
#[cfg(not(any(target_os = "macos", windows)))]
const NAMES: &[&str] = &["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"];
#[cfg(target_os = "macos")]
const NAMES: &[&str] = &[
    "libOpenImageDenoise.2.dylib",
    "libOpenImageDenoise.dylib",
    "/opt/homebrew/lib/libOpenImageDenoise.dylib",
    "/usr/local/lib/libOpenImageDenoise.dylib",
];
#[cfg(windows)]
const NAMES: &[&str] = &["OpenImageDenoise.dll"];

/// Common start of all file names of Open Image Denoise. Names of its modules start differently.
const STEM: &str = if cfg!(windows) {
    "OpenImageDenoise.dll"
} else if cfg!(target_os = "macos") {
    "libOpenImageDenoise."
} else {
    "libOpenImageDenoise.so"
};

/// The library that [`Library::load`] found; `None` before.
static LOADED: Mutex<Option<Library>> = Mutex::new(None);

impl Library {
    /// Finds and loads Open Image Denoise. After the first success, all later calls return the same library.
    ///
    /// If [`LIBRARY_VARIABLE`] is set, only the file that it names is tried. Otherwise the candidates are any
    /// `libOpenImageDenoise.so*` below the first `folders`, the library's usual names for the system's loader, and such
    /// files below the last folders.
    ///
    /// Loading runs the file's initialisers, so the folders must be trusted.
    ///
    /// # Errors
    ///
    /// [`Error::NotFound`] with the candidates; [`Error::NoSuchFile`] if the variable names a missing file;
    /// [`Error::Unusable`] as for [`Library::load_from`].
    pub fn load(folders: &Folders) -> Result<Library, Error> {
        let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(library) = &*loaded {
            return Ok(library.clone());
        }
        let library = match path_from_env(LIBRARY_VARIABLE) {
            Some(path) => load_named(&path),
            None => load_first(&folders.candidates(STEM, NAMES)),
        }?;
        Ok(loaded.insert(library).clone())
    }

    /// Loads a file of Open Image Denoise. The system's loader looks up a bare file name in its own folders. The
    /// library finds its modules in its own folder, as in the official packages and after `scripts/setup.sh`.
    ///
    /// Loading runs the file's initialisers, so the file must be trusted.
    ///
    /// # Errors
    ///
    /// [`Error::Unusable`] if the file cannot be opened, is not Open Image Denoise 2, or cannot create a device for
    /// this processor.
    pub fn load_from(path: impl AsRef<Path>) -> Result<Library, Error> {
        load(path.as_ref()).map_err(|Refusal { path, reason }| Error::Unusable { path, reason })
    }
}

/// Loads the library file that the environment variable names. The name is a path even without a folder, so the
/// system's loader does not search for it.
fn load_named(path: &Path) -> Result<Library, Error> {
    match std::path::absolute(path) {
        Ok(absolute) if absolute.is_file() => Library::load_from(absolute),
        _ => Err(Error::NoSuchFile(path.to_owned())),
    }
}

fn load_first(candidates: &[PathBuf]) -> Result<Library, Error> {
    load_first_of(candidates, load).map_err(|tried| Error::NotFound { tried })
}

fn load(path: &Path) -> Result<Library, Refusal> {
    // SAFETY: initialisers run here. The documentation requires a trusted file.
    let library = unsafe { open(path) }?;
    // SAFETY: the symbols have the library's names, and it is not unloaded after they are called (see below).
    let functions = unsafe { Functions::load(&library) }.map_err(|error| {
        let missing = Refusal::by_loader(path, &error).reason;
        Refusal::new(path, format!("not Open Image Denoise 2 ({missing})"))
    })?;
    let path = file_containing(functions.new_device as usize).unwrap_or_else(|| path.to_owned());
    let path = path.canonicalize().unwrap_or(path);
    // The library's worker threads may still be running when the last device is released, so its code must stay mapped.
    // Before this line only initialisers have run.
    std::mem::forget(library);

    let version = device::probe(&functions).map_err(|reason| Refusal::new(&path, reason))?;
    if version.major != 2 {
        return Err(Refusal::new(&path, format!("Open Image Denoise {version} is not version 2")));
    }
    Ok(Library::new(path, version, functions))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HINT: &str = "run scripts/setup.sh, or set CAUSTIQUE_OIDN to libOpenImageDenoise.so";

    #[test]
    fn a_named_file_that_is_missing_is_an_error_with_advice() {
        for name in ["no/such/libOpenImageDenoise.so", "libOpenImageDenoise.so.2", "/"] {
            let error = load_named(Path::new(name)).unwrap_err();
            assert_eq!(error.to_string(), format!("CAUSTIQUE_OIDN={name}: no such file"));
            assert_eq!(error.hint().as_deref(), Some(HINT));
        }
    }

    #[test]
    fn nothing_found_lists_what_was_tried() {
        let error = load_first(&["libno-such-denoiser.so.2".into(), "/no/denoiser.so".into()]).unwrap_err();
        let text = error.to_string();
        let start = "Open Image Denoise was not found; tried libno-such-denoiser.so.2: ";
        assert!(text.starts_with(start), "{text}");
        assert!(text.contains("; /no/denoiser.so: "), "{text}");
        assert_eq!(error.hint().as_deref(), Some(HINT));
        assert_eq!(load_first(&[]).unwrap_err().to_string(), "Open Image Denoise was not found");
    }
}
