//! The EXR of a render: to its file, or to standard output, and if neither takes it among the temporary files; and the
//! layer of USD that tells of it.

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

/// Writes the EXR; where that fails, to the system's folder for temporary files, so that the render is not lost.
///
/// # Errors
/// The EXR could not be written where it was asked for; the hint says where it is instead.
pub fn write(args: &RenderArgs, set: &LayerSet, attributes: &Attributes, sums: Option<&ShardSums>) -> Result<()> {
    let options = args.picture.exr_options(args.run.exr_naming);
    let into = |path: &Path| {
        exr::write_followed(path, set, attributes, options, |file| sums.map_or(Ok(()), |sums| sums.write(file)))
    };
    if output::is_stdout(&args.output) {
        // The header of a file is written last.
        let kept = Kept::write("render.exr".as_ref(), into)?;
        let failed = |cause| Error::new(ErrorKind::Io, "standard output", cause);
        return print_file(&kept.path).map_err(|cause| kept.told(failed(cause)));
    }
    let Err(error) = into(&args.output) else { return Ok(()) };
    let name = args.output.file_name().unwrap_or("render.exr".as_ref());
    Err(match Kept::write(name, into) {
        Ok(kept) => kept.told(error),
        Err(_) => error,
    })
}

/// Share of a render's time that writing its estimate may take.
const MAX_ESTIMATE_SHARE: f64 = 0.05;
/// Bytes that a disk writes in a second, at least.
const BYTES_PER_SECOND: f64 = 2e8;

/// Writes the EXR before its picture is finished, for the case that the finish does not end, beside the output: whoever
/// finds a file of that name has a finished picture. Nothing where that would take much of the `seconds` of the render,
/// which can be rendered again then. What fails now fails again when the finished picture is written.
pub fn write_estimate(args: &RenderArgs, set: &LayerSet, attributes: &Attributes, seconds: f64) -> Option<PathBuf> {
    let is_file = std::fs::metadata(&args.output).map_or(true, |data| data.is_file());
    let bytes: usize = set.layers.iter().flat_map(|layer| &layer.planes).map(|p| size_of_val(&p.values[..])).sum();
    let is_quick = bytes as f64 <= MAX_ESTIMATE_SHARE * BYTES_PER_SECOND * seconds;
    if output::is_stdout(&args.output) || !is_file || !is_quick {
        return None;
    }
    let path = args.output.with_extension("estimate.exr");
    let options = exr::Options { compression: exr::Compression::None, naming: args.run.exr_naming };
    exr::write_followed(&path, set, attributes, options, |_| Ok(())).ok().map(|()| path)
}

/// Checks that no output would replace the scene, its environment, or a file that the scene names.
///
/// # Errors
/// One would.
pub fn check_inputs(args: &RenderArgs) -> Result<()> {
    // A checkpoint replaces nothing but a checkpoint.
    let written = args.files().filter(|(option, _)| !["--resume", "--checkpoint"].contains(option));
    let outputs = written.map(|(_, path)| path.as_path());
    let mut outputs =
        outputs.chain(args.preview.as_ref().and_then(Target::file)).filter(|path| path.is_file()).peekable();
    if outputs.peek().is_none() {
        return Ok(());
    }
    let scene = &args.job.scene;
    // A scene that cannot be read is an error of its own, and a pipe is read once.
    let bytes = scene.path.is_file().then(|| std::fs::read(&scene.path).ok()).flatten().unwrap_or_default();
    let mut inputs = gltf::files(&bytes, &scene.path, true);
    inputs.push(scene.path.clone());
    if let Some(EnvironmentChoice::File(sky)) = &scene.env {
        inputs.push(sky.clone());
    }
    outputs.try_for_each(|path| output::check_inputs(path, inputs.iter().map(PathBuf::as_path)))
}

/// Checks that the state can be saved where it was asked for, and that no other render's is lost.
///
/// # Errors
/// See [`atomic::check_writable`] and [`checkpoint::check_replaceable`].
pub fn check_checkpoint(args: &RenderArgs) -> Result<()> {
    args.run.checkpoint.as_deref().map_or(Ok(()), atomic::check_writable)?;
    let goes_on = |path: &Path| args.run.resume.as_ref().is_some_and(|resume| atomic::is_same_file(resume, path));
    let Some(path) = args.saving().map(|saving| saving.path).filter(|path| !goes_on(path)) else { return Ok(()) };
    let of_frames = args.job.scene.frames.is_some();
    let going_on = if of_frames { "--skip-existing".into() } else { format!("--resume {}", path.display()) };
    let remedy = format!("go on with {going_on}, or start anew with --overwrite");
    checkpoint::check_replaceable(&path, args.run.overwrite, &remedy)
}

/// Checks that the layer of USD can be written, and has a file to tell of.
///
/// # Errors
/// See [`output::check`]; the EXR goes to standard output.
pub fn check_usd_layer(args: &RenderArgs) -> Result<()> {
    let Some(path) = &args.usd_layer else { return Ok(()) };
    if output::is_stdout(&args.output) {
        let error = Error::usage("--usd-layer: the EXR is no file that it could point to");
        return Err(error.hint("give -o a file, or leave --usd-layer out"));
    }
    output::check(path, "usda")
}

/// Writes the layer of USD, if one is asked for.
///
/// # Errors
/// It could not be written.
pub fn write_usd_layer(args: &RenderArgs, set: &LayerSet) -> Result<()> {
    args.usd_layer.as_ref().map_or(Ok(()), |path| usd_layer::write(path, &args.output, set))
}

/// The EXR among the temporary files, in a folder of its own: a file of that name may be there.
struct Kept {
    folder: TempDir,
    path: PathBuf,
}

impl Kept {
    fn write(name: &OsStr, into: impl Fn(&Path) -> Result<()>) -> Result<Kept> {
        let folder = temporary::create_folder("caustique-")?;
        let path = folder.path().join(name);
        into(&path)?;
        Ok(Kept { folder, path })
    }

    /// The error with what has become of the render, which stays there.
    fn told(self, error: Error) -> Error {
        let _ = self.folder.keep();
        error.hint(format!("the render is in {}", self.path.display()))
    }
}
