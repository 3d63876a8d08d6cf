//! Reading USD stages (`.usd`, `.usda`, `.usdc`, `.usdz`). A converter in Python (`scripts/usd`, embedded in the
//! program) composes the stage with Pixar's library and writes a .glb, which [`gltf`] reads. So both formats give the
//! same scene.

mod python;

pub use python::Interpreter;

use super::converter::{self, Converter, answer};
use super::description::Description;
use super::gltf::{self, ReadOptions};
use crate::error::{Error, ErrorKind, Result};
use crate::stop::Stop;
use std::ffi::OsString;
use std::path::Path;

/// File extensions of USD stages.
const EXTENSIONS: [&str; 4] = ["usd", "usda", "usdc", "usdz"];

/// Names and contents of the files of the USD converter (in Python), embedded in the program.
const SOURCES: [(&str, &str); 22] = [
    ("cameras.py", include_str!("../../../scripts/usd/cameras.py")),
    ("convert.py", include_str!("../../../scripts/usd/convert.py")),
    ("dependencies.py", include_str!("../../../scripts/usd/dependencies.py")),
    ("document.py", include_str!("../../../scripts/usd/document.py")),
    ("dome.py", include_str!("../../../scripts/usd/dome.py")),
    ("faults.py", include_str!("../../../scripts/usd/faults.py")),
    ("guard.py", include_str!("../../../scripts/usd/guard.py")),
    ("layers.json", include_str!("../../../scripts/usd/layers.json")),
    ("lights.py", include_str!("../../../scripts/usd/lights.py")),
    ("links.py", include_str!("../../../scripts/usd/links.py")),
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
    let remedy = "choose what the stage shows in the stage itself; --frames chooses the time";
    converter::check_choices(path, options, "stages", remedy)?;
    check_blur(path, options)?;
    let converter = new_converter(path)?;
    let glb = converter.path("stage.glb");
    let mut arguments: Vec<OsString> = vec!["-o".into(), glb.clone().into()];
    if let Some(frame) = options.frame {
        let time = f64::from(frame.number) + gltf::instant(options.shutter) + after_frame;
        arguments.extend(["--frame".into(), time.to_string().into()]);
    }
    let printed = run(&converter, path, &arguments, options.allow_outside, stop)?;
    let (mut description, _) = converter.read(&glb, &printed, options)?;
    // A stage may move wherever it has a frame.
    description.animated = options.frame.is_some();
    Ok(description)
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
    let printed = run(&new_converter(path)?, path, &["--arguments".into()], allow_outside, &Stop::default())?;
    answer::options(&printed, path)
}

/// Environment variable that limits the time of a conversion from USD, in seconds.
const SECONDS_VARIABLE: &str = "CAUSTIQUE_USD_SECONDS";

fn new_converter(stage: &Path) -> Result<Converter<'_>> {
    // The converter itself removes a folder of this name if this program is killed.
    Converter::new(stage, "caustique-usd-", "scripts/usd", &SOURCES)
}

/// Runs the converter on the stage with these command-line arguments, and returns what it printed.
fn run(
    converter: &Converter<'_>,
    stage: &Path,
    arguments: &[OsString],
    allow_outside: bool,
    stop: &Stop,
) -> Result<Vec<u8>> {
    let mut command = Interpreter::find()?.command();
    command.arg("-B").arg(converter.path("convert.py")).arg(stage).args(arguments);
    if allow_outside {
        command.arg("--allow-outside");
    }
    let seconds = converter::max_seconds(SECONDS_VARIABLE)?;
    command.arg("--guard").arg(seconds.to_string()).arg(converter::memory_limit().to_string());
    converter.run(command, python::HINT, stop)
}
