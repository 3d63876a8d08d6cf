//! Finding a Python that has `usd-core`.

use crate::error::{Error, ErrorKind, Result};
use crate::installed;
use crate::system;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Environment variable with the path of the Python interpreter.
pub const VARIABLE: &str = "CAUSTIQUE_USD_PYTHON";

/// The virtual environment that `scripts/setup.sh usd` installs, in the project's folder.
const ENVIRONMENT: &str = ".venv-usd";

/// Hint that ends errors about a missing Python or module.
pub(super) const HINT: &str = "run 'scripts/setup.sh usd', or install what scripts/requirements-usd.txt lists (pip \
                               install usd-core numpy OpenEXR pillow mapbox-earcut) and set CAUSTIQUE_USD_PYTHON to \
                               that Python";

/// Python code that imports the converter's dependencies, and prints the version of USD.
const PROBE: &str = "import mapbox_earcut, numpy, OpenEXR, PIL\nfrom pxr import Usd, UsdLux, UsdShade\n\
                     print('.'.join(map(str, Usd.GetVersion()[1:])))";

/// The Python interpreter that runs the converter.
#[derive(Clone, Debug)]
pub struct Interpreter {
    path: PathBuf,
}

impl Interpreter {
    /// Finds the interpreter: `CAUSTIQUE_USD_PYTHON` if it is set; otherwise the Python in `.venv-usd` if
    /// `scripts/setup.sh usd` has installed it (see [`installed`]); otherwise `python3`.
    ///
    /// # Errors
    /// [`ErrorKind::Library`]: the variable is set, but not to a file.
    pub fn find() -> Result<Interpreter> {
        if let Some(path) = installed::path_from_env(VARIABLE) {
            return if path.is_file() {
                Ok(Interpreter { path })
            } else {
                Err(Error::new(ErrorKind::Library, format!("{VARIABLE}={}", path.display()), "no such file").hint(HINT))
            };
        }
        let own = installed::find(&format!("{ENVIRONMENT}/{}", system::PYTHON_OF_ENVIRONMENT));
        Ok(Interpreter { path: own.unwrap_or_else(|| system::PYTHON.into()) })
    }

    /// The path of the interpreter, or the name that the system searches for.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How the interpreter was found, in words.
    pub fn origin(&self) -> &'static str {
        installed::origin(VARIABLE, ENVIRONMENT, &self.path)
    }

    /// A command that runs the interpreter in isolated mode (`-I`), so that it does not import untrusted modules from
    /// the current folder.
    pub(super) fn command(&self) -> Command {
        let mut command = Command::new(&self.path);
        command.arg("-I");
        command
    }

    /// The version of USD, if all dependencies of the converter are installed.
    ///
    /// # Errors
    /// [`ErrorKind::Library`]: the interpreter does not run, or lacks a module.
    pub fn version(&self) -> Result<String> {
        let error = |cause: String| Error::new(ErrorKind::Library, self.path.display(), cause).hint(HINT);
        let output = self.command().args(["-c", PROBE]).output().map_err(|cause| error(cause.to_string()))?;
        if output.status.success() {
            return Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned());
        }
        let stderr = String::from_utf8_lossy(&output.stderr);
        Err(error(stderr.lines().last().unwrap_or("it does not run").trim().to_owned()))
    }
}
