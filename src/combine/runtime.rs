//! Finding and loading ONNX Runtime, once per process.
//!
//! Candidates in order: the file that the environment variable `CAUSTIQUE_ONNXRUNTIME` names, and then no other; the
//! system's loader under the library's usual names; any `libonnxruntime.so*` below `.deps/onnxruntime/`, where
//! `scripts/setup.sh` puts it (see [`installed`]).

use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use caustique_library::{file_name, find_below};
use ort::environment::Environment;

use crate::error::{Error, ErrorKind, Result};
use crate::installed;

/// Environment variable that names the library's file.
pub const VARIABLE: &str = "CAUSTIQUE_ONNXRUNTIME";

/// What every name of the library begins with.
const NAME: &str = "libonnxruntime.so";

/// Minor versions whose sonames the system's loader is asked for (Debian 13 installs libonnxruntime.so.1.21). The first
/// is the oldest that `ort` takes here.
const MINOR_VERSIONS: std::ops::RangeInclusive<u32> = 17..=49;

/// Where `scripts/setup.sh` installs, in the project's folder.
const FOLDER: &str = ".deps/onnxruntime";

const HINT: &str = "on Debian 13: apt-get install libonnxruntime1.21; on Debian 12: run scripts/setup.sh; \
                    or set CAUSTIQUE_ONNXRUNTIME to the path of libonnxruntime.so (1.17 or later)";

/// The loaded library.
#[derive(Clone, Debug)]
pub struct Runtime {
    environment: Environment,
    path: PathBuf,
}

/// `ort` allows one environment per process and no second after it is dropped, so it lives here for good.
static LOADED: Mutex<Option<Runtime>> = Mutex::new(None);

impl Runtime {
    /// The library: loaded by the first call, the same for all later ones.
    ///
    /// # Errors
    /// [`ErrorKind::Library`] when no candidate can be loaded; the hint says what to install.
    pub fn find() -> Result<Self> {
        let mut loaded = LOADED.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(runtime) = &*loaded {
            return Ok(runtime.clone());
        }
        let runtime = load(&candidates(installed::path_from_env(VARIABLE))?)?;
        Ok(loaded.insert(runtime).clone())
    }

    /// File that the library was loaded from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where it comes from.
    pub fn origin(&self) -> &'static str {
        installed::origin(VARIABLE, FOLDER, &self.path)
    }

    /// Version as the file's name tells it, such as `1.21.1`; `None` when it does not (it is 1.17 or later).
    pub fn version(&self) -> Option<&str> {
        let name = self.path.file_name()?.to_str()?;
        name.split_once(".so.").map(|(_, version)| version).filter(|version| version.contains('.'))
    }

    pub(super) fn environment(&self) -> &Environment {
        &self.environment
    }
}

/// What to try, in order. A name without a folder is the system loader's to find.
fn candidates(named: Option<PathBuf>) -> Result<Vec<PathBuf>> {
    if let Some(path) = named {
        // Absolute, because `ort` would look beside the executable first.
        let absolute = std::path::absolute(&path).map_err(|cause| Error::io(&path, &cause))?;
        if !absolute.is_file() {
            let place = format!("{VARIABLE}={}", path.display());
            return Err(Error::new(ErrorKind::Library, place, "no such file").hint(HINT));
        }
        return Ok(vec![absolute]);
    }
    let versioned = MINOR_VERSIONS.rev().map(|minor| format!("{NAME}.1.{minor}"));
    let mut all: Vec<PathBuf> =
        [NAME.into(), format!("{NAME}.1")].into_iter().chain(versioned).map(PathBuf::from).collect();
    all.extend(find_below(&installed::candidates(FOLDER), NAME));
    Ok(all)
}

/// Loads the first candidate that is an ONNX Runtime new enough.
fn load(candidates: &[PathBuf]) -> Result<Runtime> {
    let mut refusals = Vec::new();
    for candidate in candidates {
        // `init_from` reports failures; the route through ORT_DYLIB_PATH panics.
        match ort::init_from(candidate) {
            Ok(builder) => {
                let path = located(candidate);
                let environment = builder.with_name("caustique").with_telemetry(false).build();
                let environment = environment.map_err(|cause| Error::new(ErrorKind::Library, path.display(), cause))?;
                return Ok(Runtime { environment, path });
            }
            // A name unknown to the loader is no news; a file that refuses, or a library too old, is.
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

/// While it lives, what is written to stderr is lost. Debian 13's ONNX Runtime is linked to a libonnx that has
/// registered all operators already, and complains of each of them, past its own logger, some 500 lines with the first
/// session. Errors come back as values all the same.
pub(super) struct Quiet(Option<OwnedFd>);

impl Quiet {
    pub fn new() -> Quiet {
        let nowhere = std::fs::OpenOptions::new().write(true).open("/dev/null");
        let saved = rustix::io::fcntl_dupfd_cloexec(rustix::stdio::stderr(), 3);
        let (Ok(nowhere), Ok(saved)) = (nowhere, saved) else { return Quiet(None) };
        Quiet(rustix::stdio::dup2_stderr(nowhere).is_ok().then_some(saved))
    }
}

impl Drop for Quiet {
    fn drop(&mut self) {
        if let Some(saved) = self.0.take() {
            // Nothing is left to tell a failure to.
            let _ = rustix::stdio::dup2_stderr(saved);
        }
    }
}

/// The real file behind a candidate; for a bare name, the file that this process has mapped.
fn located(candidate: &Path) -> PathBuf {
    if candidate.is_absolute() {
        return candidate.canonicalize().unwrap_or_else(|_| candidate.to_path_buf());
    }
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap_or_default();
    let mapped =
        maps.lines().filter_map(|line| line.split_once('/')).map(|(_, path)| PathBuf::from(format!("/{path}")));
    let found = mapped.into_iter().find(|path| file_name(path).starts_with(NAME));
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
