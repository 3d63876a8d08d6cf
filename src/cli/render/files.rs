//! Writes the EXR of a render to its file or to standard output, or to a temporary file if both fail; and the USD layer
//! that points to the EXR.

use super::options::RenderArgs;
use super::preview::Target;
use crate::cli::{output, print_file};
use caustique::error::{Error, ErrorKind, Result};
use caustique::film::LayerSet;
use caustique::image::exr::{self, Attributes};
use caustique::image::{atomic, usd_layer};
use caustique::options::EnvironmentChoice;
use caustique::pipeline::checkpoint;
use caustique::pipeline::shard::ShardSums;
use caustique::scene::gltf;
use caustique::temporary;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Writes the EXR of a render. If that fails, writes it to the system's folder for temporary files, so that the render
/// is not lost.
///
/// # Errors
/// The EXR could not be written to its file or to standard output. The hint names the temporary file.
pub fn write(args: &RenderArgs, set: &LayerSet, attributes: &Attributes, sums: Option<&ShardSums>) -> Result<()> {
    let options = args.picture.exr_options(args.run.exr_naming);
    let into = |path: &Path| {
        exr::write_followed(path, set, attributes, options, |file| sums.map_or(Ok(()), |sums| sums.write(file)))
    };
    if output::is_stdout(&args.output) {
        // The writer seeks back to the header, which standard output does not support.
        let kept = TemporaryExr::write("render.exr".as_ref(), into)?;
        let failed = |cause| Error::new(ErrorKind::Io, "standard output", cause);
        return print_file(&kept.path).map_err(|cause| kept.keep(failed(cause)));
    }
    let Err(error) = into(&args.output) else { return Ok(()) };
    let name = args.output.file_name().unwrap_or("render.exr".as_ref());
    Err(match TemporaryExr::write(name, into) {
        Ok(kept) => kept.keep(error),
        Err(_) => error,
    })
}

/// Largest share of a render's time that writing its unfinished picture may take.
const MAX_ESTIMATE_SHARE: f64 = 0.05;
/// Bytes per second that a slow disk writes.
const MIN_BYTES_PER_SECOND: f64 = 2e8;

/// Writes the unfinished EXR beside the output, in case the program is killed during the finish, and returns its path.
/// The output itself is only ever a finished picture. Writes nothing if that takes a large share of the `seconds` of
/// the render. Ignores errors, which occur again when the finished picture is written.
pub fn write_estimate(args: &RenderArgs, set: &LayerSet, attributes: &Attributes, seconds: f64) -> Option<PathBuf> {
    let is_file = std::fs::metadata(&args.output).map_or(true, |data| data.is_file());
    let bytes: usize = set.layers.iter().flat_map(|layer| &layer.planes).map(|p| size_of_val(&p.values[..])).sum();
    let is_quick = bytes as f64 <= MAX_ESTIMATE_SHARE * MIN_BYTES_PER_SECOND * seconds;
    if output::is_stdout(&args.output) || !is_file || !is_quick {
        return None;
    }
    let path = args.output.with_extension("estimate.exr");
    let compression = exr::Compression::None;
    let options = exr::Options { compression, naming: args.run.exr_naming, ..exr::Options::default() };
    exr::write_followed(&path, set, attributes, options, |_| Ok(())).ok().map(|()| path)
}

/// Checks that no output replaces the scene, its environment, or a file that the scene names.
///
/// # Errors
/// An output is such a file.
pub fn check_inputs(args: &RenderArgs) -> Result<()> {
    // Checkpoints replace only checkpoints.
    let written = args.files().filter(|(option, _)| !["--resume", "--checkpoint"].contains(option));
    let outputs = written.map(|(_, path)| path.as_path());
    let mut outputs =
        outputs.chain(args.preview.as_ref().and_then(Target::file)).filter(|path| path.is_file()).peekable();
    if outputs.peek().is_none() {
        return Ok(());
    }
    let scene = &args.options.scene;
    // The render reports a scene that cannot be read. A pipe can be read only once.
    let bytes = scene.path.is_file().then(|| std::fs::read(&scene.path).ok()).flatten().unwrap_or_default();
    let mut inputs = gltf::files(&bytes, &scene.path, true);
    inputs.push(scene.path.clone());
    if let Some(EnvironmentChoice::File(sky)) = &scene.env {
        inputs.push(sky.clone());
    }
    outputs.try_for_each(|path| output::check_inputs(path, inputs.iter().map(PathBuf::as_path)))
}

/// Checks that the checkpoint can be written and does not replace the checkpoint of another render.
///
/// # Errors
/// Errors of [`atomic::check_writable`] and [`checkpoint::check_replaceable`].
pub fn check_checkpoint(args: &RenderArgs) -> Result<()> {
    args.run.checkpoint.as_deref().map_or(Ok(()), atomic::check_writable)?;
    let goes_on = |path: &Path| args.run.resume.as_ref().is_some_and(|resume| atomic::is_same_file(resume, path));
    let Some(path) = args.saving().map(|saving| saving.path).filter(|path| !goes_on(path)) else { return Ok(()) };
    let of_frames = args.options.scene.frames.is_some();
    let going_on = if of_frames { "--skip-existing".into() } else { format!("--resume {}", path.display()) };
    let remedy = format!("go on with {going_on}, or start anew with --overwrite");
    checkpoint::check_replaceable(&path, args.run.overwrite, &remedy)
}

/// Checks that the USD layer can be written, and that the EXR is a file that the layer can point to.
///
/// # Errors
/// Errors of [`output::check`]; the EXR goes to standard output.
pub fn check_usd_layer(args: &RenderArgs) -> Result<()> {
    let Some(path) = &args.usd_layer else { return Ok(()) };
    if output::is_stdout(&args.output) {
        let error = Error::usage("--usd-layer: the EXR is no file that it could point to");
        return Err(error.hint("give -o a file, or leave --usd-layer out"));
    }
    output::check(path, "usda")
}

/// Writes the USD layer that points to the EXR, if the user wants one.
///
/// # Errors
/// The layer could not be written.
pub fn write_usd_layer(args: &RenderArgs, set: &LayerSet) -> Result<()> {
    args.usd_layer.as_ref().map_or(Ok(()), |path| usd_layer::write(path, &args.output, set))
}

/// An EXR in a new folder for temporary files, to save a render whose output cannot be written.
struct TemporaryExr {
    folder: TempDir,
    path: PathBuf,
}

impl TemporaryExr {
    fn write(name: &OsStr, into: impl Fn(&Path) -> Result<()>) -> Result<TemporaryExr> {
        let folder = temporary::create_folder("caustique-")?;
        let path = folder.path().join(name);
        into(&path)?;
        Ok(TemporaryExr { folder, path })
    }

    /// Keeps the temporary EXR, and adds its path to an error.
    fn keep(self, error: Error) -> Error {
        let _ = self.folder.keep();
        error.hint(format!("the render is in {}", self.path.display()))
    }
}
