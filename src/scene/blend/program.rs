//! Finding a Blender, or a Python that has `bpy`.

use crate::error::{Error, ErrorKind, Result};
use crate::installed;
use crate::system;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Environment variable with the path of a Blender, or of a Python that has `bpy`.
pub const VARIABLE: &str = "CAUSTIQUE_BLENDER";

/// The virtual environment with `bpy` that `scripts/setup.sh bpy` installs, in the project's folder.
const ENVIRONMENT: &str = ".venv-bpy";

/// Python code that prints the version of `bpy`. Blender as a module may hang while it shuts down.
const PROBE: &str = "import os, bpy; print('Blender', bpy.app.version_string, flush=True); os._exit(0)";

/// Hint that ends errors about a missing Blender.
pub(super) const HINT: &str = "install Blender 4.2 or newer, so that 'blender' is on the PATH, or run 'scripts/setup.sh \
                               bpy', which installs Blender as a Python module; or set CAUSTIQUE_BLENDER to a Blender, \
                               or to a Python in which 'pip install bpy' has been run";

/// A Blender, or a Python that has `bpy`.
#[derive(Clone, Debug)]
pub struct Blender {
    path: PathBuf,
}

impl Blender {
    /// Finds the program: `CAUSTIQUE_BLENDER` if it is set; otherwise `blender` on the PATH; otherwise the Python in
    /// `.venv-bpy` if `scripts/setup.sh bpy` has installed it (see [`installed`]).
    ///
    /// # Errors
    /// [`ErrorKind::Library`]: there is none, or the variable is set, but not to a file.
    pub fn find() -> Result<Blender> {
        if let Some(path) = installed::path_from_env(VARIABLE) {
            // The converter starts in another folder.
            return match std::path::absolute(&path) {
                Ok(path) if path.is_file() => Ok(Blender { path }),
                _ => {
                    Err(Error::new(ErrorKind::Library, format!("{VARIABLE}={}", path.display()), "no such file")
                        .hint(HINT))
                }
            };
        }
        let own = || installed::find(&format!("{ENVIRONMENT}/{}", system::PYTHON_OF_ENVIRONMENT));
        let path = on_search_path("blender").or_else(own);
        path.map(|path| Blender { path }).ok_or_else(|| {
            Error::new(ErrorKind::Library, "", "reading a .blend needs Blender, and none is installed").hint(HINT)
        })
    }

    /// The path of the program.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How the program was found, in words.
    pub fn origin(&self) -> &'static str {
        installed::origin(VARIABLE, ENVIRONMENT, &self.path)
    }

    /// The version of Blender.
    ///
    /// # Errors
    /// [`ErrorKind::Library`]: the program does not run, or is a Python without `bpy`.
    pub fn version(&self) -> Result<String> {
        let error = |cause: String| Error::new(ErrorKind::Library, self.path.display(), cause).hint(HINT);
        let mut command = Command::new(&self.path);
        match self.is_python() {
            true => command.args(["-I", "-c", PROBE]),
            false => command.arg("--version"),
        };
        let output = command.stdin(Stdio::null()).output().map_err(|cause| error(cause.to_string()))?;
        let stdout = String::from_utf8_lossy(&output.stdout);
        let version = stdout.lines().find_map(|line| line.strip_prefix("Blender "));
        version.map(|version| version.trim().to_owned()).ok_or_else(|| {
            let stderr = String::from_utf8_lossy(&output.stderr);
            error(stderr.lines().last().unwrap_or("it prints no version").trim().to_owned())
        })
    }

    fn is_python(&self) -> bool {
        self.path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("python"))
    }

    /// A command that runs `script` without the user's settings. Blender runs no Python in the files that it opens.
    pub(super) fn command(&self, script: &Path) -> Command {
        let mut command = Command::new(&self.path);
        if self.is_python() {
            // Isolated, because modules in the current folder may come from an untrusted source.
            command.args(["-I", "-B"]).arg(script);
        } else {
            command.args(["-b", "--factory-startup", "--disable-autoexec", "-noaudio", "--python-exit-code", "1"]);
            command.arg("--python").arg(script);
        }
        command.arg("--");
        command
    }
}

/// The first program of this name in the absolute folders of the PATH: the current folder may hold files of other users.
fn on_search_path(name: &str) -> Option<PathBuf> {
    let folders = std::env::var_os("PATH")?;
    let file = Path::new(name).with_extension(std::env::consts::EXE_EXTENSION);
    let mut paths = std::env::split_paths(&folders).filter(|folder| folder.is_absolute()).map(|it| it.join(&file));
    paths.find(|path| path.is_file())
}
