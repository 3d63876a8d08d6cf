//! Finding a Python that has `usd-core`.

use crate::error::{Error, ErrorKind, Result};
use crate::installed;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Environment variable that names the Python.
pub const VARIABLE: &str = "CAUSTIQUE_USD_PYTHON";

/// Where `scripts/setup.sh` installs, in the project's folder.
const ENVIRONMENT: &str = ".venv-usd/bin/python";

/// What to do where there is none.
pub(super) const HINT: &str = "run 'scripts/setup.sh usd', or install what scripts/requirements-usd.txt lists (pip \
                               install usd-core numpy OpenEXR pillow mapbox-earcut) and set CAUSTIQUE_USD_PYTHON to \
                               that Python";

/// Imports all that the converter needs, and prints USD's version.
const PROBE: &str = "import mapbox_earcut, numpy, OpenEXR, PIL\nfrom pxr import Usd, UsdLux, UsdShade\n\
                     print('.'.join(map(str, Usd.GetVersion()[1:])))";

/// A Python that runs the converter.
#[derive(Clone, Debug)]
pub struct Interpreter {
    path: PathBuf,
}

impl Interpreter {
    /// The Python that `CAUSTIQUE_USD_PYTHON` names, and then no other; that of `.venv-usd` where `scripts/setup.sh usd`
    /// has installed it (see [`installed`]); `python3`.
    ///
    /// # Errors
    /// [`ErrorKind::Library`] where the variable names no file.
    pub fn find() -> Result<Interpreter> {
        if let Some(path) = installed::path_from_env(VARIABLE) {
            return if path.is_file() {
                Ok(Interpreter { path })
            } else {
                Err(Error::new(ErrorKind::Library, format!("{VARIABLE}={}", path.display()), "no such file").hint(HINT))
            };
        }
        Ok(Interpreter { path: installed::find(ENVIRONMENT).unwrap_or_else(|| "python3".into()) })
    }

    /// The file, or the name that the system looks up.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where it comes from.
    pub fn origin(&self) -> &'static str {
        installed::origin(VARIABLE, ENVIRONMENT, &self.path)
    }

    /// A command that runs this Python, isolated (`-I`), because modules in the current folder may be anybody's.
    pub(super) fn command(&self) -> Command {
        let mut command = Command::new(&self.path);
        command.arg("-I");
        command
    }

    /// The version of USD, once all that the converter needs is there.
    ///
    /// # Errors
    /// [`ErrorKind::Library`]: it does not run, or lacks a module.
    pub fn version(&self) -> Result<String> {
        let error = |cause: String| Error::new(ErrorKind::Library, self.path.display(), cause).hint(HINT);
        let output = self.command().args(["-c", PROBE]).output().map_err(|cause| error(cause.to_string()))?;
        if output.status.success() {
            return Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned());
        }
        let told = String::from_utf8_lossy(&output.stderr);
        Err(error(told.lines().last().unwrap_or("it does not run").trim().to_owned()))
    }
}
