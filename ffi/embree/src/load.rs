//! Finds and loads the library, version 4 or 3.

use std::path::{Path, PathBuf};

use caustique_library::{Folders, Refusal, file_containing, load_first_of, open, path_from_env};

use crate::api::{Common, Trace, Trace3, Trace4};
use crate::error::Error;
use crate::library::{LIBRARY_VARIABLE, Library};
use crate::probe;

/// File names of Embree's library to try, best first. Names with a version number belong to runtime packages, the
/// others to development packages.
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

/// Common start of all file names of Embree.
const STEM: &str = if cfg!(windows) { "embree" } else { "libembree" };

impl Library {
    /// Loads the library that [`LIBRARY_VARIABLE`] names. If it names none, loads the first usable of `libembree*` below
    /// the first `folders`, the libraries that the system's loader finds under Embree's names, version 4 before 3, and
    /// `libembree*` below the last folders.
    ///
    /// Loading runs the file's initialisers, so the folders must be trusted.
    ///
    /// # Errors
    ///
    /// [`Error::NotFound`] with the names that were tried; [`Error::Unusable`] as for [`Library::load_from`].
    pub fn load(folders: &Folders) -> Result<Library, Error> {
        match path_from_env(LIBRARY_VARIABLE) {
            Some(path) => Library::load_from(path),
            None => load_first(&folders.candidates(STEM, NAMES)),
        }
    }

    /// Loads a library file. The system's loader looks up a bare file name in its own folders.
    ///
    /// Loading runs the file's initialisers, so the file must be trusted.
    ///
    /// # Errors
    ///
    /// [`Error::Unusable`] if the file cannot be opened, is not Embree 3 or 4, or fails the test scene.
    pub fn load_from(path: impl AsRef<Path>) -> Result<Library, Error> {
        load(path.as_ref()).map_err(|Refusal { path, reason }| Error::Unusable { path, reason })
    }
}

fn load_first(candidates: &[PathBuf]) -> Result<Library, Error> {
    load_first_of(candidates, load).map_err(|tried| Error::NotFound { tried })
}

fn load(path: &Path) -> Result<Library, Refusal> {
    // SAFETY: initialisers run here. The documentation requires a trusted file.
    let library = unsafe { open(path) }?;
    // SAFETY: the symbols have Embree's names, and the library is never unloaded (see below).
    let common = unsafe { Common::load(&library) }.map_err(|error| {
        let missing = Refusal::by_loader(path, &error).reason;
        Refusal::new(path, format!("not Embree 3 or 4 ({missing})"))
    })?;
    let path = file_containing(common.new_device as usize).unwrap_or_else(|| path.to_owned());

    let version = probe::version(&common).map_err(|reason| Refusal::new(&path, reason))?;
    let trace = match version.major {
        // SAFETY: as for `common`. The version determines the signatures.
        3 => unsafe { Trace3::load(&library) }.map(Trace::V3),
        // SAFETY: as above.
        4 => unsafe { Trace4::load(&library) }.map(Trace::V4),
        _ => return Err(Refusal::new(&path, format!("Embree {version} is neither version 3 nor 4"))),
    }
    .map_err(|error| Refusal::by_loader(&path, &error))?;
    // Embree's worker threads may still be running when the last device is released, so the code must stay mapped.
    std::mem::forget(library);

    let untested = Library::new(&path, version, 0, common, trace);
    let extent = probe::try_out(&untested).map_err(|reason| Refusal::new(&path, reason))?;
    Ok(Library::new(&path, version, extent, common, trace))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_found_lists_what_was_tried_and_names_packages() {
        let error = load_first(&["libno-such-embree.so.4".into(), "libno-such-embree.so.3".into()]).unwrap_err();
        let text = error.to_string();
        assert!(text.starts_with("Embree was not found; tried libno-such-embree.so.4: "), "{text}");
        assert!(text.contains("; libno-such-embree.so.3: "), "{text}");
        let hint = error.hint().unwrap();
        assert!(hint.contains("Debian 12, Ubuntu 22.04: apt install libembree3-3"), "{hint}");
        assert!(hint.contains("Debian 13, Ubuntu 24.04: apt install libembree4-4"), "{hint}");
        assert!(hint.contains(LIBRARY_VARIABLE), "{hint}");
    }
}
