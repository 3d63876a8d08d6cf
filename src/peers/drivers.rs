//! The drivers, and what is asked of them.

use super::process::{self, End, Stop};
use super::python::Interpreter;
use super::{Peer, Renderer};
use crate::error::{Error, ErrorKind, Result};
use crate::film::{Picture, Size};
use crate::image::exr;
use crate::temporary;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Runs a driver's module with its folder on the search path, which an isolated Python leaves out of it.
const MAIN: &str = "import runpy, sys
runpy.run_module(sys.argv.pop(1), run_name='__main__')
";
/// The drivers' files, as they lie in `scripts/compare/peers`, and what starts them.
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

/// What a render may take beyond its budget: seconds, and so many times the budget. Starting up and converting a large
/// scene takes half a minute, a photon map its time.
const LIMIT: (f64, f64) = (300.0, 5.0);

/// A render that is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Task {
    /// Seconds of rendering.
    pub budget: f64,
    /// Seed.
    pub seed: u64,
}

/// A render that was made.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// The picture.
    pub picture: Picture,
    /// Wall-clock seconds of rendering.
    pub seconds: f64,
    /// Core-seconds of rendering.
    pub core_seconds: f64,
    /// Wall-clock seconds before it: starting up, reading and converting the scene.
    pub startup_seconds: f64,
    /// Samples per pixel.
    pub passes: f64,
    /// Version of the renderer.
    pub version: String,
    /// What of the scene means something else there, in words.
    pub approximations: Vec<String>,
}

/// What a driver answers.
#[derive(Clone, Debug)]
pub enum Answer {
    /// A render.
    Rendered(Box<Rendering>),
    /// The renderer cannot say the scene, in words.
    Cannot(Vec<String>),
    /// It was stopped.
    Stopped,
}

/// The line of a driver.
#[derive(Deserialize)]
#[serde(untagged)]
enum Said {
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

/// The drivers of some renderers on a scene, laid out in a folder that ends with them.
pub struct Drivers {
    scene: PathBuf,
    camera: Option<String>,
    size: (u32, u32),
    threads: usize,
    interpreters: Vec<(Renderer, Interpreter)>,
    folder: tempfile::TempDir,
}

impl Drivers {
    /// Finds the Pythons of some renderers. `size`: width and height in pixels.
    ///
    /// # Errors
    /// A renderer is not installed; the file system.
    pub fn new(
        renderers: &[Renderer],
        scene: &Path,
        camera: Option<&str>,
        size: (u32, u32),
        threads: usize,
    ) -> Result<Drivers> {
        let interpreters = renderers.iter().map(|&of| Ok((of, Interpreter::find(of)?))).collect::<Result<Vec<_>>>()?;
        let folder = temporary::create_folder("caustique-peers-")?;
        for (name, source) in SOURCES {
            let path = folder.path().join(name);
            std::fs::write(&path, source).map_err(|cause| Error::io(&path, &cause))?;
        }
        Ok(Drivers { scene: scene.into(), camera: camera.map(Into::into), size, threads, interpreters, folder })
    }

    /// Lets a peer render.
    ///
    /// # Errors
    /// The driver fails, takes far too long, or does not answer.
    pub fn render(&self, peer: &Peer, task: Task, stop: Stop<'_>) -> Result<Answer> {
        let failed = |cause: &dyn std::fmt::Display| {
            Error::new(ErrorKind::Library, peer.name, cause)
                .hint(format!("its driver is scripts/compare/peers/{}", peer.renderer.driver()))
        };
        let Some((_, python)) = self.interpreters.iter().find(|(of, _)| *of == peer.renderer) else {
            return Err(failed(&"its Python was not looked for"));
        };
        let file = self.folder.path().join("picture.exr");
        // What an earlier render has left is no answer.
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
            // Some take no more than 31 bits.
            ("seed", (task.seed % (1 << 16)).to_string()),
        ] {
            command.arg(format!("--{name}={value}"));
        }
        command.args(self.camera.iter().map(|name| format!("--camera={name}")));
        let limit = LIMIT.0 + LIMIT.1 * task.budget;
        let (status, [out, err]) = match process::run(command, limit, stop).map_err(|cause| failed(&cause))? {
            End::Exit(status, said) => (status, said),
            End::Stopped => return Ok(Answer::Stopped),
            End::TooLong => return Err(failed(&format!("it was ended after {limit:.0} s of {:.1} s", task.budget))),
        };
        // Some crash when all is done, while they shut down.
        let said = out.lines().rev().find_map(|line| serde_json::from_str::<Said>(line.strip_prefix("PEER ")?).ok());
        match said {
            Some(Said::Cannot { cannot }) => Ok(Answer::Cannot(cannot)),
            Some(Said::Rendered { seconds, core_seconds, startup_seconds, passes, version, approximations })
                if file.exists() =>
            {
                let picture = self.picture(&file).map_err(|error| failed(&error))?;
                Ok(Answer::Rendered(Box::new(Rendering {
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
