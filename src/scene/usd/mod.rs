//! Stages of USD (`.usd`, `.usda`, `.usdc`, `.usdz`), read by way of a .glb: a converter in Python (`scripts/usd`,
//! which is part of the program) lets Pixar's own library compose the stage, and [`gltf`] reads what it writes, so that a
//! scene means the same through either door.

pub mod answer;
mod python;

pub use python::Interpreter;

use super::description::Description;
use super::gltf::{self, FrameTime, ReadOptions};
use crate::error::{Error, ErrorKind, Result};
use crate::memory;
use crate::stop::Stop;
use crate::temporary;
use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Output, Stdio};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Extensions of stages.
const EXTENSIONS: [&str; 4] = ["usd", "usda", "usdc", "usdz"];

/// The converter's files.
const SOURCES: [(&str, &str); 20] = [
    ("cameras.py", include_str!("../../../scripts/usd/cameras.py")),
    ("convert.py", include_str!("../../../scripts/usd/convert.py")),
    ("document.py", include_str!("../../../scripts/usd/document.py")),
    ("dome.py", include_str!("../../../scripts/usd/dome.py")),
    ("faults.py", include_str!("../../../scripts/usd/faults.py")),
    ("guard.py", include_str!("../../../scripts/usd/guard.py")),
    ("layers.json", include_str!("../../../scripts/usd/layers.json")),
    ("lights.py", include_str!("../../../scripts/usd/lights.py")),
    ("materials.py", include_str!("../../../scripts/usd/materials.py")),
    ("materialx.py", include_str!("../../../scripts/usd/materialx.py")),
    ("meshes.py", include_str!("../../../scripts/usd/meshes.py")),
    ("network.py", include_str!("../../../scripts/usd/network.py")),
    ("options.json", include_str!("../../../scripts/usd/options.json")),
    ("preview.py", include_str!("../../../scripts/usd/preview.py")),
    ("render_settings.py", include_str!("../../../scripts/usd/render_settings.py")),
    ("scene.py", include_str!("../../../scripts/usd/scene.py")),
    ("shapes.py", include_str!("../../../scripts/usd/shapes.py")),
    ("stage.py", include_str!("../../../scripts/usd/stage.py")),
    ("surface.py", include_str!("../../../scripts/usd/surface.py")),
    ("textures.py", include_str!("../../../scripts/usd/textures.py")),
];

/// Whether a path is called as stages are.
pub fn is_stage(path: &Path) -> bool {
    path.extension().is_some_and(|own| EXTENSIONS.iter().any(|known| own.eq_ignore_ascii_case(known)))
}

/// Reads the stage at `path`, at the frame that `options` ask for (a time code), else at its first.
///
/// # Errors
/// No Python with `usd-core`; what the stage has wrong, by prim; [`gltf::read`] of what becomes of it; `stop` asks for
/// an end.
pub fn read(path: &Path, options: &ReadOptions, stop: &Stop) -> Result<Description> {
    let converter = Converter::new(path)?;
    let glb = converter.folder.path().join("stage.glb");
    let mut words: Vec<OsString> = vec!["-o".into(), glb.clone().into()];
    if let Some(frame) = options.frame {
        words.extend(["--frame".into(), frame.number.to_string().into()]);
    }
    converter.run(&words, options.allow_outside, stop)?;
    // The converter has looked at the frame, and put beside the .glb what it names.
    let frame = options.frame.map(|frame| FrameTime { of_sequence: true, ..frame });
    let read = gltf::read(&glb, &ReadOptions { frame, allow_outside: false, ..*options });
    let mut description = read.map_err(|mut error| {
        error.place = error.place.replace(&glb.display().to_string(), &path.display().to_string());
        error
    })?;
    description.source = path.to_owned();
    // Layers, textures and all else that the stage is composed of are in what became of it.
    description.converted = Some(gltf::hash(&glb, false)?);
    Ok(description)
}

/// Options of `caustique render` that the stage's RenderSettings stand for.
///
/// # Errors
/// Those of the converter, as for [`read`].
pub fn arguments(path: &Path, allow_outside: bool) -> Result<Vec<String>> {
    let output = Converter::new(path)?.run(&["--arguments".into()], allow_outside, &Stop::default())?;
    answer::options(&output.stdout, path)
}

/// Environment variable: how long a conversion may take.
const SECONDS_VARIABLE: &str = "CAUSTIQUE_USD_SECONDS";
/// Seconds that it may take otherwise: what takes longer is hardly meant to end.
const MAX_SECONDS: u32 = 3600;

/// Time between two looks at whether an end is asked for.
const LOOK: Duration = Duration::from_millis(50);

/// Seconds that a conversion may take.
fn seconds() -> Result<u32> {
    let Some(said) = std::env::var_os(SECONDS_VARIABLE) else { return Ok(MAX_SECONDS) };
    // poll(2) counts milliseconds in 31 bits.
    let seconds = said.to_str().and_then(|said| said.parse().ok()).filter(|seconds| (1..=2_000_000).contains(seconds));
    seconds.ok_or_else(|| {
        let error =
            Error::new(ErrorKind::Usage, SECONDS_VARIABLE, format!("{} is no number of seconds", said.display()));
        error.hint("give a whole number from 1 to 2000000, or none")
    })
}

/// The converter, laid out in a folder that ends with it.
struct Converter<'p> {
    stage: &'p Path,
    interpreter: Interpreter,
    folder: tempfile::TempDir,
}

impl<'p> Converter<'p> {
    fn new(stage: &'p Path) -> Result<Converter<'p>> {
        std::fs::File::open(stage)
            .map_err(|e| Error::io(stage, &e).hint("check the path of the scene file and your right to read it"))?;
        let interpreter = Interpreter::find()?;
        let folder = temporary::create_folder("caustique-usd-")?;
        for (name, source) in SOURCES {
            let path = folder.path().join(name);
            std::fs::write(&path, source).map_err(|cause| Error::io(&path, &cause))?;
        }
        Ok(Converter { stage, interpreter, folder })
    }

    /// Runs the converter on the stage.
    fn run(&self, words: &[OsString], allow_outside: bool, stop: &Stop) -> Result<Output> {
        let mut command = self.interpreter.command();
        command.arg("-B").arg(self.folder.path().join("convert.py")).arg(self.stage).args(words);
        if allow_outside {
            command.arg("--allow-outside");
        }
        // Zero: nobody tells what is left.
        let bytes = memory::available().map_or(0, |available| available.bytes);
        command.arg("--guard").arg(seconds()?.to_string()).arg(bytes.to_string());
        // A group of its own: Ctrl-C is for this program, and the pipe that closes then ends the converter.
        command.process_group(0).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let output = command.spawn().and_then(|child| output_unless(child, stop)).map_err(|cause| {
            Error::new(ErrorKind::Library, self.interpreter.path().display(), cause).hint(python::HINT)
        })?;
        if output.status.success() {
            return Ok(output);
        }
        if stop.requested() {
            return Err(Error::new(
                ErrorKind::Interrupted,
                self.stage.display(),
                "interrupted while the stage was read",
            ));
        }
        Err(answer::failure(&output.stderr, self.stage))
    }
}

/// The output of the converter, which ends when its standard input does: as soon as `stop` asks for that.
fn output_unless(mut child: Child, stop: &Stop) -> std::io::Result<Output> {
    let open = child.stdin.take();
    let (over, ended) = channel::<()>();
    std::thread::scope(|scope| {
        std::thread::Builder::new().spawn_scoped(scope, move || {
            while !stop.requested() && ended.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {}
            drop(open);
        })?;
        let output = child.wait_with_output();
        drop(over);
        output
    })
}
