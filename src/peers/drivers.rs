//! Runs the Python drivers of other renderers.

use super::process::{self, End, Stop};
use super::python::Interpreter;
use super::{Peer, Renderer};
use crate::error::{Error, ErrorKind, Result};
use crate::film::{Picture, Size};
use crate::image::exr;
use crate::temporary;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Text of `__main__.py` in the folder of the drivers, the Python scripts that run other renderers. Running the folder
/// puts it on the search path, which an isolated Python leaves out; the first argument is the driver's module.
const MAIN: &str = "import runpy, sys
runpy.run_module(sys.argv.pop(1), run_name='__main__')
";
/// Names and contents of the drivers' files: the Python scripts in `scripts/compare/peers`, and `__main__.py`.
const SOURCES: [(&str, &str); 12] = [
    ("__main__.py", MAIN),
    ("cycles_driver.py", include_str!("../../scripts/compare/peers/cycles_driver.py")),
    ("driver.py", include_str!("../../scripts/compare/peers/driver.py")),
    ("gltf.py", include_str!("../../scripts/compare/peers/gltf.py")),
    ("luxcore_driver.py", include_str!("../../scripts/compare/peers/luxcore_driver.py")),
    ("mitsuba_driver.py", include_str!("../../scripts/compare/peers/mitsuba_driver.py")),
    ("mitsuba_lobes.py", include_str!("../../scripts/compare/peers/mitsuba_lobes.py")),
    ("mitsuba_materials.py", include_str!("../../scripts/compare/peers/mitsuba_materials.py")),
    ("mitsuba_world.py", include_str!("../../scripts/compare/peers/mitsuba_world.py")),
    ("pictures.py", include_str!("../../scripts/compare/peers/pictures.py")),
    ("plain_scene.py", include_str!("../../scripts/compare/peers/plain_scene.py")),
    ("variant.py", include_str!("../../scripts/compare/peers/variant.py")),
];

/// Seconds, besides [`MAX_BUDGETS`], after which a driver, the script that runs another renderer, is killed: startup
/// and conversion of a large scene take half a minute.
const MAX_OVERHEAD_SECONDS: f64 = 300.0;
/// Number of time budgets of a render, besides [`MAX_OVERHEAD_SECONDS`], after which its driver is killed: photon maps
/// can exceed the budget.
const MAX_BUDGETS: f64 = 5.0;

/// A render to be made by a driver, the script that runs another renderer.
#[derive(Clone, Copy, Debug)]
pub struct Task {
    /// Time budget for rendering in seconds.
    pub budget: f64,
    /// Seed of the render.
    pub seed: u64,
}

/// The result of a render by another renderer.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// The rendered picture.
    pub picture: Picture,
    /// Wall-clock seconds of rendering, without startup.
    pub seconds: f64,
    /// Core-seconds of rendering, without startup.
    pub core_seconds: f64,
    /// Wall-clock seconds of startup, and of reading and converting the scene.
    pub startup_seconds: f64,
    /// Samples per pixel of the picture; below 1 if some pixels have none.
    pub passes: f64,
    /// Version of the renderer.
    pub version: String,
    /// Features of the scene that the renderer approximates, in words.
    pub approximations: Vec<String>,
}

/// Reply of a driver, the script that runs another renderer.
#[derive(Clone, Debug)]
pub enum Reply {
    /// The renderer has made a picture.
    Rendered(Box<Rendering>),
    /// The renderer cannot render the scene; holds the reasons, in words.
    Unsupported(Vec<String>),
    /// The user has stopped the render.
    Stopped,
}

/// The JSON line that a driver prints as its reply.
#[derive(Deserialize)]
#[serde(untagged)]
enum ReplyLine {
    Cannot {
        cannot: Vec<String>,
    },
    Rendered {
        seconds: f64,
        core_seconds: f64,
        startup_seconds: f64,
        passes: f64,
        version: String,
        approximations: Vec<String>,
    },
}

/// Driver scripts of some renderers for a scene, in a temporary folder.
pub struct Drivers {
    scene: PathBuf,
    camera: Option<String>,
    size: (u32, u32),
    threads: usize,
    interpreters: Vec<(Renderer, Interpreter)>,
    folder: tempfile::TempDir,
}

impl Drivers {
    /// Finds the Python interpreters of the renderers and writes the drivers to a temporary folder. `size` is the width and
    /// height in pixels.
    ///
    /// # Errors
    /// A renderer is not installed, or the folder cannot be written.
    pub fn new(
        renderers: &[Renderer],
        scene: &Path,
        camera: Option<&str>,
        size: (u32, u32),
        threads: usize,
    ) -> Result<Drivers> {
        let interpreters = renderers
            .iter()
            .map(|&renderer| Ok((renderer, Interpreter::find(renderer)?)))
            .collect::<Result<Vec<_>>>()?;
        let folder = temporary::create_folder("caustique-peers-")?;
        for (name, source) in SOURCES {
            let path = folder.path().join(name);
            std::fs::write(&path, source).map_err(|cause| Error::io(&path, &cause))?;
        }
        Ok(Drivers { scene: scene.into(), camera: camera.map(Into::into), size, threads, interpreters, folder })
    }

    /// Renders the scene with a peer, a renderer in one of its modes.
    ///
    /// # Errors
    /// The driver fails, exceeds its time limit, or prints no reply.
    pub fn render(&self, peer: &Peer, task: Task, stop: Stop<'_>) -> Result<Reply> {
        let failed = |cause: &dyn std::fmt::Display| {
            Error::new(ErrorKind::Library, peer.name, cause)
                .hint(format!("its driver is scripts/compare/peers/{}", peer.renderer.driver()))
        };
        let Some((_, python)) = self.interpreters.iter().find(|(renderer, _)| *renderer == peer.renderer) else {
            return Err(failed(&"its Python was not looked for"));
        };
        let file = self.folder.path().join("picture.exr");
        // A picture of an earlier render must not be taken for the result.
        let _ = std::fs::remove_file(&file);
        let (width, height) = self.size;
        let mut command = python.command();
        let module = peer.renderer.driver().trim_end_matches(".py");
        command.arg(self.folder.path()).arg(module).arg(&self.scene).arg(&file);
        for (name, value) in [
            ("mode", peer.mode.to_string()),
            ("width", width.to_string()),
            ("height", height.to_string()),
            ("budget", task.budget.to_string()),
            ("threads", self.threads.to_string()),
            // Some renderers take seeds of at most 31 bits.
            ("seed", (task.seed % (1 << 16)).to_string()),
        ] {
            command.arg(format!("--{name}={value}"));
        }
        command.args(self.camera.iter().map(|name| format!("--camera={name}")));
        let limit = MAX_OVERHEAD_SECONDS + MAX_BUDGETS * task.budget;
        let (status, [out, err]) = match process::run(command, limit, stop).map_err(|cause| failed(&cause))? {
            End::Exit(status, output) => (status, output),
            End::Stopped => return Ok(Reply::Stopped),
            End::TooLong => return Err(failed(&format!("it was ended after {limit:.0} s of {:.1} s", task.budget))),
        };
        // The exit status is ignored if there is a reply, because some renderers crash at shutdown.
        let reply =
            out.lines().rev().find_map(|line| serde_json::from_str::<ReplyLine>(line.strip_prefix("PEER ")?).ok());
        match reply {
            Some(ReplyLine::Cannot { cannot }) => Ok(Reply::Unsupported(cannot)),
            Some(ReplyLine::Rendered { seconds, core_seconds, startup_seconds, passes, version, approximations })
                if file.exists() =>
            {
                let picture = self.picture(&file).map_err(|error| failed(&error))?;
                Ok(Reply::Rendered(Box::new(Rendering {
                    picture,
                    seconds,
                    core_seconds,
                    startup_seconds,
                    passes,
                    version,
                    approximations,
                })))
            }
            _ => {
                let last = err.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("it says nothing").trim();
                Err(failed(&format!("it ended ({status}) without a picture: {last}")))
            }
        }
    }

    fn picture(&self, file: &Path) -> Result<Picture> {
        let (set, _) = exr::read(file)?;
        let Size { width, height } = self.size.into();
        if (set.width, set.height) != (width, height) {
            let cause = format!("a picture of {} x {} pixels, not {width} x {height}", set.width, set.height);
            return Err(Error::new(ErrorKind::Image, "", cause));
        }
        set.beauty()
    }
}
