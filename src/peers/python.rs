//! Finding the Pythons that have the renderers.

use super::Renderer;
use crate::error::{Error, Kind, Result};
use std::path::{Path, PathBuf};
use std::process::Command;

/// What to do where there is none.
const HINT: &str = "run 'scripts/compare/setup.sh peers'";

/// Fails unless all modules that it is given can be found; imports none, which takes seconds.
const PROBE: &str = "import importlib.util, sys\n\
                     missing = [name for name in sys.argv[1:] if importlib.util.find_spec(name) is None]\n\
                     sys.exit('no module ' + ', '.join(missing) if missing else 0)";

/// A Python with a renderer.
#[derive(Clone, Debug)]
pub(super) struct Interpreter {
    path: PathBuf,
    /// Where more modules lie.
    packages: Option<PathBuf>,
}

impl Interpreter {
    /// The Python that a renderer's variable names, and then no other; else that of the environment which
    /// `scripts/compare/setup.sh peers` makes, in the current directory or a folder above the executable.
    ///
    /// # Errors
    /// [`Kind::Library`]: there is none, it does not run, or it lacks the renderer.
    pub(super) fn find(renderer: Renderer) -> Result<Interpreter> {
        let (variable, environment, module) = match renderer {
            Renderer::Mitsuba => ("CAUSTIQUE_PEERS_PYTHON", ".venv-peers", "mitsuba"),
            Renderer::Luxcore => ("CAUSTIQUE_PEERS_PYTHON", ".venv-peers", "pyluxcore"),
            Renderer::Cycles => ("CAUSTIQUE_PEERS_BPY_PYTHON", ".venv-bpy", "bpy"),
        };
        let packages = above(Path::new(".venv-peers/bpy")).filter(|_| renderer == Renderer::Cycles);
        let path = match std::env::var_os(variable).filter(|path| !path.is_empty()).map(PathBuf::from) {
            Some(path) if path.is_file() => path,
            Some(path) => {
                let error = Error::new(Kind::Library, format!("{variable}={}", path.display()), "no such file");
                return Err(error.hint(format!("name a Python that has {module}, or unset it and {HINT}")));
            }
            None => above(&Path::new(environment).join("bin/python")).ok_or_else(|| {
                Error::new(Kind::Library, format!("--with: {environment}"), "there is no such environment")
                    .hint(format!("{HINT}, or set {variable} to a Python that has {module}"))
            })?,
        };
        let found = Interpreter { path, packages };
        found.check(module)?;
        Ok(found)
    }

    /// A command that runs this Python.
    pub(super) fn command(&self) -> Command {
        let mut command = Command::new(&self.path);
        command.arg("-B");
        if let Some(packages) = &self.packages {
            command.env("PYTHONPATH", packages);
        }
        command
    }

    fn check(&self, module: &str) -> Result<()> {
        let error = |cause: String| Error::new(Kind::Library, self.path.display(), cause).hint(HINT);
        let probe = self.command().args(["-c", PROBE, module, "numpy", "OpenEXR"]).output();
        let output = probe.map_err(|cause| error(cause.to_string()))?;
        if output.status.success() {
            return Ok(());
        }
        let told = String::from_utf8_lossy(&output.stderr);
        Err(error(told.lines().last().unwrap_or("it does not run").trim().to_owned()))
    }
}

/// A file or folder below the current directory or a folder above the executable.
fn above(relative: &Path) -> Option<PathBuf> {
    let executable = std::env::current_exe().ok();
    let above = executable.iter().flat_map(|path| path.ancestors().skip(1)).map(Path::to_path_buf);
    let mut folders = std::env::current_dir().ok().into_iter().chain(above);
    folders.find_map(|folder| Some(folder.join(relative)).filter(|path| path.exists()))
}
