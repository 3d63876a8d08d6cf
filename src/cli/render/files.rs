//! Writes the EXR of a render to its file or to standard output, or to a temporary file if both fail; and the USD layer
//! that points to the EXR.

use super::options::RenderArgs;
use super::preview::Target;
use crate::cli::{claim, output, print_file};
use caustique::error::{Error, ErrorKind, Result};
use caustique::files;
use caustique::film::LayerSet;
use caustique::image::atomic::{self, Draft};
use caustique::image::exr::{self, Attributes};
use caustique::image::{Outputs, usd_layer};
use caustique::options::Frames;
use caustique::pipeline::checkpoint;
use caustique::pipeline::shard::ShardSums;
use caustique::scene::Scene;
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

/// Writes the unfinished EXR to a draft beside the output, in case the program is killed during the finish. The output
/// itself is only ever a finished picture. Writes nothing if that takes a large share of the `seconds` of the render.
/// Ignores errors, which occur again when the finished picture is written.
pub fn write_estimate(args: &RenderArgs, set: &LayerSet, attributes: &Attributes, seconds: f64) -> Option<Draft> {
    let is_file = std::fs::metadata(&args.output).map_or(true, |data| data.is_file());
    let bytes: usize = set.layers.iter().flat_map(|layer| &layer.planes).map(|p| size_of_val(&p.values[..])).sum();
    let is_quick = bytes as f64 <= MAX_ESTIMATE_SHARE * MIN_BYTES_PER_SECOND * seconds;
    if output::is_stdout(&args.output) || !is_file || !is_quick {
        return None;
    }
    let compression = exr::Compression::None;
    let options = exr::Options { compression, naming: args.run.exr_naming, ..exr::Options::default() };
    exr::write_draft(&args.output, set, attributes, options).ok()
}

/// The files that a render writes.
///
/// # Errors
/// Two of them are the same file.
pub fn outputs(args: &RenderArgs) -> Result<Outputs> {
    let preview = preview_file(args).into_iter().map(Path::to_owned);
    Outputs::new(frame_outputs(args).into_iter().chain(preview))
}

/// The files that a render of these frames writes.
///
/// # Errors
/// Two of them are the same file.
pub fn outputs_of_frames(args: &RenderArgs, frames: Frames) -> Result<Outputs> {
    let preview = preview_file(args).into_iter().map(Path::to_owned);
    Outputs::new(frames.iter().flat_map(|frame| frame_outputs(&args.at(frame))).chain(preview))
}

/// The file of the preview, unless it becomes the PNG.
fn preview_file(args: &RenderArgs) -> Option<&Path> {
    let becomes_png = |file: &&Path| args.picture.png.as_ref().is_some_and(|png| files::is_same(png, file));
    args.preview.as_ref().and_then(Target::file).filter(|file| !becomes_png(file))
}

/// The files that the render of one frame writes.
fn frame_outputs(args: &RenderArgs) -> Vec<PathBuf> {
    let output = Some(&args.output).filter(|output| !output::is_stdout(output));
    let claim = output.filter(|_| args.skip_existing).map(|output| claim::file(output));
    let checkpoint = args.saving().map(|saving| saving.path);
    let named = [output, args.picture.png.as_ref(), args.usd_layer.as_ref()].map(Option::<&PathBuf>::cloned);
    named.into_iter().chain([claim, checkpoint]).flatten().collect()
}

/// Checks that no output replaces a file that the render reads: one of the scene, its network, or the checkpoint that it
/// continues from, unless the checkpoint is saved there again.
///
/// # Errors
/// An output is such a file.
pub fn check_inputs(args: &RenderArgs, outputs: &Outputs, scene: &Scene) -> Result<()> {
    let saves = |path: &&PathBuf| args.saving().is_some_and(|saving| files::is_same(&saving.path, path));
    let resumed = args.run.resume.as_ref().filter(|path| !saves(path));
    let files = scene.files.iter().chain(resumed).map(PathBuf::as_path);
    outputs.check(files.chain(output::model_file(&args.options.finish)))?;
    // The names of the pictures depend on the techniques, so no picture in the folder may be an input or a link to one.
    let Some(folder) = &args.debug_techniques else { return Ok(()) };
    let is_picture = |path: &Path| path.extension().is_some_and(|kind| kind == "exr" || kind == "png");
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let pictures: Vec<PathBuf> = entries.filter(|path| is_picture(path)).collect();
    match scene.files.iter().find(|path| pictures.iter().any(|picture| files::is_same(picture, path))) {
        None => Ok(()),
        Some(input) => {
            let cause = format!("{} is an input in this folder, which might be overwritten", input.display());
            let error = Error::new(ErrorKind::Usage, folder.display(), cause);
            Err(error.hint("name another folder with --debug-techniques"))
        }
    }
}

/// Checks that files whose names the user has not given replace renders of this program alone: beside a scene lie pictures
/// of the program that made it.
///
/// # Errors
/// One of the files is another one.
pub fn check_defaults(args: &RenderArgs) -> Result<()> {
    if !args.names_are_default {
        return Ok(());
    }
    let is_own = || exr::read_header(&args.output).is_ok_and(|(_, attributes)| attributes.object().is_some());
    let png = args.picture.png.as_ref().filter(|png| **png == args.output.with_extension("png"));
    let other = match args.output.is_file() {
        true => Some(&args.output).filter(|_| !is_own()),
        false => png.filter(|png| png.is_file()),
    };
    other.map_or(Ok(()), |other| {
        let error = Error::new(ErrorKind::Usage, other.display(), "is there, and may be no render of this program");
        Err(error.hint("name the picture with --output, or move this one"))
    })
}

/// Removes the files that a killed process has left beside the finished files of a render.
pub fn remove_leftovers(args: &RenderArgs) {
    frame_outputs(args).iter().for_each(|path| atomic::remove_leftovers(path));
}

/// Checks that the checkpoint can be written and does not replace the checkpoint of another render.
///
/// # Errors
/// Errors of [`atomic::check_writable`] and [`checkpoint::check_replaceable`].
pub fn check_checkpoint(args: &RenderArgs) -> Result<()> {
    args.run.checkpoint.as_deref().map_or(Ok(()), atomic::check_writable)?;
    let goes_on = |path: &Path| args.run.resume.as_ref().is_some_and(|resume| files::is_same(resume, path));
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
