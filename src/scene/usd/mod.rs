//! Reading USD stages (`.usd`, `.usda`, `.usdc`, `.usdz`). A converter in Python (`scripts/usd`, embedded in the
//! program) composes the stage with Pixar's library and writes a .glb, which [`gltf`] reads. So both formats give the
//! same scene.

pub mod answer;
mod python;

pub use python::Interpreter;

use super::description::Description;
use super::gltf::{self, FrameTime, Pose, ReadOptions};
use crate::error::{Error, ErrorKind, Result};
use crate::files;
use crate::memory;
use crate::stop::Stop;
use crate::system;
use crate::temporary;
use std::ffi::OsString;
use std::path::Path;
use std::process::{Child, Output, Stdio};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// File extensions of USD stages.
const EXTENSIONS: [&str; 4] = ["usd", "usda", "usdc", "usdz"];

/// Names and contents of the files of the USD converter (in Python), embedded in the program.
const SOURCES: [(&str, &str); 21] = [
    ("cameras.py", include_str!("../../../scripts/usd/cameras.py")),
    ("convert.py", include_str!("../../../scripts/usd/convert.py")),
    ("dependencies.py", include_str!("../../../scripts/usd/dependencies.py")),
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

/// Whether a path has the extension of a USD stage.
pub fn is_stage(path: &Path) -> bool {
    path.extension().is_some_and(|own| EXTENSIONS.iter().any(|known| own.eq_ignore_ascii_case(known)))
}

/// Reads the stage at `path`, `after_frame` frames after the frame in `options` (a time code), or at its first frame.
///
/// # Errors
/// There is no Python with `usd-core`, the stage is invalid (the error names the prim), [`gltf::read`] of the converted
/// file fails, or `stop` ends the conversion.
pub fn read(path: &Path, options: &ReadOptions, after_frame: f64, stop: &Stop) -> Result<Description> {
    check_choices(path, options)?;
    check_blur(path, options)?;
    let converter = Converter::new(path)?;
    let glb = converter.folder.path().join("stage.glb");
    let mut arguments: Vec<OsString> = vec!["-o".into(), glb.clone().into()];
    if let Some(frame) = options.frame {
        let time = f64::from(frame.number) + gltf::instant(options.shutter) + after_frame;
        arguments.extend(["--frame".into(), time.to_string().into()]);
    }
    let printed = converter.run(&arguments, options.allow_outside, stop)?.stdout;
    // The converter has applied the frame, and has copied the files that the stage names beside the .glb.
    let frame = options.frame.map(|frame| FrameTime { of_sequence: true, ..frame });
    let read = gltf::read(&glb, &ReadOptions { frame, allow_outside: false, ..options.clone() });
    let mut description = read.map_err(|mut error| {
        error.place = error.place.replace(&glb.display().to_string(), &path.display().to_string());
        error
    })?;
    description.source = path.to_owned();
    description.files = answer::files(&printed, path)?;
    // A stage may move wherever it has a frame.
    description.animated = options.frame.is_some();
    // The converted file contains the layers, textures and other files of the stage.
    description.converted = Some(gltf::hash(&glb, false)?);
    Ok(description)
}

/// Rejects options that choose among the parts of a glTF file.
fn check_choices(path: &Path, options: &ReadOptions) -> Result<()> {
    let ReadOptions { scene, animation, variant, pose, .. } = options;
    let given = [
        ("scene", scene.is_some()),
        ("animation", animation.is_some()),
        ("variant", variant.is_some()),
        ("pose rest", *pose == Pose::Rest),
    ];
    let Some((option, _)) = given.into_iter().find(|(_, given)| *given) else { return Ok(()) };
    let error = Error::new(ErrorKind::Usage, path.display(), format!("--{option} is for glTF files, not for stages"));
    Err(error.hint("choose what the stage shows in the stage itself; --frames chooses the time"))
}

/// Rejects motion blur without a frame.
fn check_blur(path: &Path, options: &ReadOptions) -> Result<()> {
    if options.frame.is_some() || options.shutter.is_none_or(|shutter| shutter == [0.0; 2]) {
        return Ok(());
    }
    let cause = "--shutter needs a frame: without one, a stage is read at no time, and nothing moves";
    Err(Error::new(ErrorKind::Usage, path.display(), cause).hint("give one by --frames, such as --frames 1"))
}

/// The stage's RenderSettings as options of `caustique render`.
///
/// # Errors
/// The converter fails, as in [`read`].
pub fn arguments(path: &Path, allow_outside: bool) -> Result<Vec<String>> {
    let output = Converter::new(path)?.run(&["--arguments".into()], allow_outside, &Stop::default())?;
    answer::options(&output.stdout, path)
}

/// Environment variable that limits the time of a conversion from USD, in seconds.
const SECONDS_VARIABLE: &str = "CAUSTIQUE_USD_SECONDS";
/// Default time limit of a conversion from USD, in seconds.
const DEFAULT_MAX_SECONDS: u32 = 3600;

/// Time between two checks during a conversion whether the user has asked to stop.
const STOP_INTERVAL: Duration = Duration::from_millis(50);

/// The time limit of a conversion from USD, in seconds.
fn max_seconds() -> Result<u32> {
    let Some(value) = std::env::var_os(SECONDS_VARIABLE) else { return Ok(DEFAULT_MAX_SECONDS) };
    // poll(2) takes milliseconds in 31 bits.
    let seconds =
        value.to_str().and_then(|value| value.parse().ok()).filter(|seconds| (1..=2_000_000).contains(seconds));
    seconds.ok_or_else(|| {
        let error =
            Error::new(ErrorKind::Usage, SECONDS_VARIABLE, format!("{} is no number of seconds", value.display()));
        error.hint("give a whole number from 1 to 2000000, or none")
    })
}

/// The USD converter's files in a temporary folder, which is removed on drop.
struct Converter<'p> {
    stage: &'p Path,
    interpreter: Interpreter,
    folder: tempfile::TempDir,
}

impl<'p> Converter<'p> {
    fn new(stage: &'p Path) -> Result<Converter<'p>> {
        files::open(stage)
            .map_err(|e| Error::io(stage, &e).hint("check the path of the scene file and your right to read it"))?;
        let interpreter = Interpreter::find()?;
        let folder = temporary::create_folder("caustique-usd-")?;
        for (name, source) in SOURCES {
            let path = folder.path().join(name);
            std::fs::write(&path, source).map_err(|cause| Error::io(&path, &cause))?;
        }
        Ok(Converter { stage, interpreter, folder })
    }

    /// Runs the converter on the stage with these command-line arguments, and returns what it printed.
    fn run(&self, arguments: &[OsString], allow_outside: bool, stop: &Stop) -> Result<Output> {
        let mut command = self.interpreter.command();
        command.arg("-B").arg(self.folder.path().join("convert.py")).arg(self.stage).args(arguments);
        if allow_outside {
            command.arg("--allow-outside");
        }
        // Zero: the free memory is unknown.
        let bytes = memory::available().map_or(0, |available| available.bytes);
        command.arg("--guard").arg(max_seconds()?.to_string()).arg(bytes.to_string());
        // In its own process group, so that Ctrl-C reaches only this program. The converter ends when its stdin closes.
        system::shield_from_interrupts(&mut command)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let output = command.spawn().and_then(|child| wait_or_stop(child, stop)).map_err(|cause| {
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

/// Waits for the converter's output. When `stop` is requested, closes the converter's standard input, which ends it.
fn wait_or_stop(mut child: Child, stop: &Stop) -> std::io::Result<Output> {
    let stdin = child.stdin.take();
    let (over, ended) = channel::<()>();
    std::thread::scope(|scope| {
        std::thread::Builder::new().spawn_scoped(scope, move || {
            while !stop.requested() && ended.recv_timeout(STOP_INTERVAL) == Err(RecvTimeoutError::Timeout) {}
            drop(stdin);
        })?;
        let output = child.wait_with_output();
        drop(over);
        output
    })
}
