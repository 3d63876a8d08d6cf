//! Finds the Python interpreters that have the renderers installed.

use super::Renderer;
use crate::error::{Error, ErrorKind, Result};
use crate::installed;
use crate::system;
use std::path::PathBuf;
use std::process::Command;

/// Remedy for a missing Python interpreter of another renderer.
const HINT: &str = "run 'scripts/compare/setup.sh peers'";

/// Environment variable with an additional folder of Python modules for the renderers' driver scripts.
const PACKAGES: &str = "CAUSTIQUE_PEERS_PACKAGES";

/// Python code that fails unless all modules in its arguments are found. Importing them would take seconds.
const PROBE: &str = "import importlib.util, os, sys\n\
                     sys.path += filter(None, [os.environ.get('CAUSTIQUE_PEERS_PACKAGES')])\n\
                     missing = [name for name in sys.argv[1:] if importlib.util.find_spec(name) is None]\n\
                     sys.exit('no module ' + ', '.join(missing) if missing else 0)";

/// A Python interpreter that has the modules of another renderer.
#[derive(Clone, Debug)]
pub(super) struct Interpreter {
    path: PathBuf,
    /// Additional folder of Python modules.
    packages: Option<PathBuf>,
}

impl Interpreter {
    /// Finds the Python interpreter of a renderer: the one that its environment variable names, if set, else the one in
    /// the virtual environment that `scripts/compare/setup.sh peers` makes (see [`installed`]).
    ///
    /// # Errors
    /// [`ErrorKind::Library`]: there is no interpreter, it does not run, or it lacks the renderer.
    pub(super) fn find(renderer: Renderer) -> Result<Interpreter> {
        let (variable, environment, module) = match renderer {
            Renderer::Mitsuba => ("CAUSTIQUE_PEERS_PYTHON", ".venv-peers", "mitsuba"),
            Renderer::Luxcore => ("CAUSTIQUE_PEERS_PYTHON", ".venv-peers", "pyluxcore"),
            Renderer::Cycles => ("CAUSTIQUE_PEERS_BPY_PYTHON", ".venv-bpy", "bpy"),
        };
        let packages = installed::find(".venv-peers/bpy").filter(|_| renderer == Renderer::Cycles);
        let path = match installed::path_from_env(variable) {
            Some(path) if path.is_file() => path,
            Some(path) => {
                let error = Error::new(ErrorKind::Library, format!("{variable}={}", path.display()), "no such file");
                return Err(error.hint(format!("name a Python that has {module}, or unset it and {HINT}")));
            }
            None => installed::find(&format!("{environment}/{}", system::PYTHON_OF_ENVIRONMENT)).ok_or_else(|| {
                Error::new(ErrorKind::Library, format!("--with: {environment}"), "there is no such environment")
                    .hint(format!("{HINT}, or set {variable} to a Python that has {module}"))
            })?,
        };
        let found = Interpreter { path, packages };
        found.check(module)?;
        Ok(found)
    }

    /// A command that runs the interpreter isolated (`-I`), without modules from the current folder.
    pub(super) fn command(&self) -> Command {
        let mut command = Command::new(&self.path);
        command.args(["-I", "-B"]);
        if let Some(packages) = &self.packages {
            command.env(PACKAGES, packages);
        }
        command
    }

    fn check(&self, module: &str) -> Result<()> {
        let error = |cause: String| Error::new(ErrorKind::Library, self.path.display(), cause).hint(HINT);
        let probe = self.command().args(["-c", PROBE, module, "numpy", "OpenEXR"]).output();
        let output = probe.map_err(|cause| error(cause.to_string()))?;
        if output.status.success() {
            return Ok(());
        }
        let message = String::from_utf8_lossy(&output.stderr);
        Err(error(message.lines().last().unwrap_or("it does not run").trim().to_owned()))
    }
}
