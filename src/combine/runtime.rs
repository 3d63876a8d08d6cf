//! Finds and loads ONNX Runtime, once per process.
//!
//! If the environment variable `CAUSTIQUE_ONNXRUNTIME` is set, only the file that it names is tried. Otherwise any
//! `libonnxruntime.so*` (on Linux) of the package that holds this code is tried, then the library's common names for the system's
//! loader, then any such file below `.deps/onnxruntime/`, where `scripts/setup.sh` installs it (see [`installed`]).

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use caustique_library::file_containing;
use ort::environment::Environment;

use crate::error::{Error, ErrorKind, Result};
use crate::installed;
use crate::system::{self, ONNXRUNTIME};

/// Environment variable that names the file of ONNX Runtime's library.
pub const VARIABLE: &str = "CAUSTIQUE_ONNXRUNTIME";

/// Minor versions of ONNX Runtime whose file names are tried. The first is the oldest that `ort` supports here.
const MINOR_VERSIONS: std::ops::RangeInclusive<u32> = 17..=49;

/// Folder within the project into which `scripts/setup.sh` installs ONNX Runtime.
const FOLDER: &str = ".deps/onnxruntime";

const HINT: &str = "on Debian 13: apt-get install libonnxruntime1.21; on Debian 12: run scripts/setup.sh; \
                    or set CAUSTIQUE_ONNXRUNTIME to the path of libonnxruntime.so (1.17 or later)";

/// The loaded library of ONNX Runtime.
#[derive(Clone, Debug)]
pub struct Runtime {
    environment: Environment,
    path: PathBuf,
}

/// The process's ONNX Runtime, `None` before it is loaded. `ort` allows no second environment, even after the first is
/// dropped.
static LOADED: Mutex<Option<Runtime>> = Mutex::new(None);

impl Runtime {
    /// Returns the process's ONNX Runtime; the first call loads it.
    ///
    /// # Errors
    /// [`ErrorKind::Library`]: no candidate can be loaded. The hint says what to install.
    pub fn find() -> Result<Self> {
        let mut loaded = LOADED.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(runtime) = &*loaded {
            return Ok(runtime.clone());
        }
        let runtime = load(&candidates(installed::path_from_env(VARIABLE))?)?;
        Ok(loaded.insert(runtime).clone())
    }

    /// Path of the loaded file of the library.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where the library was found, in words (see [`installed::origin`]).
    pub fn origin(&self) -> &'static str {
        installed::origin(VARIABLE, FOLDER, &self.path)
    }

    /// ONNX Runtime's version by the file name, such as `1.21.1`; `None` if the name has none (it is 1.17 or later).
    pub fn version(&self) -> Option<&str> {
        let name = self.path.file_name()?.to_str()?;
        name.split_once(".so.").map(|(_, version)| version).filter(|version| version.contains('.'))
    }

    pub(super) fn environment(&self) -> &Environment {
        &self.environment
    }
}

/// Paths of ONNX Runtime in the order in which they are tried; only `named`, if given. The system's loader searches for
/// names without a folder.
fn candidates(named: Option<PathBuf>) -> Result<Vec<PathBuf>> {
    if let Some(path) = named {
        // An absolute path, because `ort` searches for relative ones beside the executable first.
        let absolute = std::path::absolute(&path).map_err(|cause| Error::io(&path, &cause))?;
        if !absolute.is_file() {
            let place = format!("{VARIABLE}={}", path.display());
            return Err(Error::new(ErrorKind::Library, place, "no such file").hint(HINT));
        }
        return Ok(vec![absolute]);
    }
    let names = system::onnxruntime_names(MINOR_VERSIONS.rev());
    Ok(installed::folders(FOLDER).candidates(ONNXRUNTIME, names))
}

/// Loads the first of the candidate paths that is a supported version of ONNX Runtime.
fn load(candidates: &[PathBuf]) -> Result<Runtime> {
    let mut refusals = Vec::new();
    for candidate in candidates {
        system::preload(candidate);
        // `init_from` returns errors; loading through ORT_DYLIB_PATH panics.
        match ort::init_from(candidate) {
            Ok(builder) => {
                let path = loaded_file(candidate);
                let environment = builder.with_name("caustique").with_telemetry(false).build();
                let environment = environment.map_err(|cause| Error::new(ErrorKind::Library, path.display(), cause))?;
                return Ok(Runtime { environment, path });
            }
            // Names that the loader does not know are not reported; unloadable files and old versions are.
            Err(ort::LoadDynamicError::Dlopen { .. }) if !candidate.is_absolute() => {}
            Err(cause) => refusals.push(cause.to_string()),
        }
    }
    let cause = match refusals.first() {
        None => "the shared library was not found".to_string(),
        Some(first) => format!("the shared library cannot be used: {first}"),
    };
    Err(Error::new(ErrorKind::Library, "ONNX Runtime", cause).hint(HINT))
}

/// The path of the library that was loaded as `candidate`; for a name without a folder, the file that the system's
/// loader has found.
fn loaded_file(candidate: &Path) -> PathBuf {
    if candidate.is_absolute() {
        return candidate.canonicalize().unwrap_or_else(|_| candidate.to_path_buf());
    }
    // The functions of the library are in a table of its own.
    let found = file_containing(std::ptr::from_ref(ort::api()) as usize).and_then(|path| path.canonicalize().ok());
    found.unwrap_or_else(|| candidate.to_path_buf())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_named_file_that_is_missing_is_an_error_with_advice() {
        let error = candidates(Some("no/such/libonnxruntime.so".into())).unwrap_err();
        assert_eq!(error.to_string(), "CAUSTIQUE_ONNXRUNTIME=no/such/libonnxruntime.so: no such file");
        assert!(error.hint.unwrap().contains("libonnxruntime1.21"));
    }

    #[test]
    fn nothing_found_is_an_error_with_advice() {
        let error = load(&[]).unwrap_err();
        assert_eq!(error.to_string(), "ONNX Runtime: the shared library was not found");
        assert_eq!(error.kind, ErrorKind::Library);
        assert!(error.hint.unwrap().contains("scripts/setup.sh"));
    }
}
