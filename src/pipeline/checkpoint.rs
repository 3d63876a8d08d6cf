//! Checkpoints: the state of a render and the identity of the render, in a file that is replaced atomically.
//!
//! The file holds a line that names its kind, then [`records`]: the [`Head`] as JSON, the state without its pixels, and
//! the pixels in blocks, both in the format of postcard.

use super::records::{self, Record};
use crate::error::{Error, ErrorKind, Result};
use crate::estimator::PixelAccumulator;
use crate::files;
use crate::git_lfs;
use crate::image::atomic;
use crate::render::{Candidate, State};
use crate::system;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::io::{BufReader, Read, Write};
use std::path::Path;

/// The first bytes of every checkpoint of this version of the format.
pub const MAGIC: &[u8; 23] = b"caustique checkpoint 7\n";
/// The first bytes of checkpoints in all versions of the format.
const KIND: &[u8] = b"caustique checkpoint ";
/// Number of pixels in a record, a separately compressed part of the file.
pub(super) const PIXELS_PER_RECORD: usize = 2048;
/// Options that may differ from those of the checkpoint when a render continues: its limits, and how its files are
/// written.
const FREE_OPTIONS: [&str; 8] =
    ["iterations", "time", "target-error", "layers", "exr-naming", "compression", "scene", "path"];

/// The identity of the render that a checkpoint or a shard belongs to, and the decisions made for it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Head {
    /// Version of the program that has written the file.
    pub version: String,
    /// Hash of the scene's files, hexadecimal.
    pub scene: String,
    /// Options of the render as the user gave them, a JSON object.
    pub arguments: Value,
    /// The candidate (method and settings) that `auto` has chosen; `None` if it has compared none.
    pub candidate: Option<Candidate>,
    /// The plan of the render (effects and warnings) for the header of its EXR.
    pub plan: Value,
    /// Whether the render was done when the checkpoint was saved, and its picture was about to be written.
    #[serde(default)]
    pub finished: bool,
}

/// Writes a checkpoint of the render `head` with the state of its iterations. Replaces the file atomically.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, head: &Head, state: State<&[PixelAccumulator]>) -> Result<()> {
    let head = serde_json::to_vec(head).map_err(|cause| Error::new(ErrorKind::Io, path.display(), cause))?;
    let (state, pixels) = state.replace_pixels(());
    let state = postcard::to_allocvec(&state).map_err(|cause| Error::new(ErrorKind::Io, path.display(), cause))?;
    atomic::write(path, |file| {
        let written = file
            .write_all(MAGIC)
            .and_then(|()| Record::new(&head).write(file))
            .and_then(|()| Record::new(&state).write(file))
            .and_then(|()| records::write_blocks(file, pixels, PIXELS_PER_RECORD))
            .and_then(|()| records::write_end(file));
        written.map_err(|cause| atomic::failure(path, &cause))
    })
}

/// Whether the file at `path` is there and a new render must not replace it by its own checkpoint, because it is the
/// checkpoint of a render that was not finished, or none.
pub fn is_unfinished(path: &Path) -> bool {
    path.is_file() && check_replaceable(path, false, "").is_err()
}

/// Checks that a new render may replace the file at `path` by its own checkpoint. `remedy`: how to continue the render of
/// the existing checkpoint, or to overwrite it.
///
/// # Errors
/// The file is no checkpoint, a pipe, or, unless `overwrite` is set, the checkpoint of a render that was not finished.
pub fn check_replaceable(path: &Path, overwrite: bool, remedy: &str) -> Result<()> {
    if std::fs::metadata(path).is_ok_and(|data| system::is_pipe(&data)) {
        let error = Error::new(ErrorKind::Usage, path.display(), "is a pipe, from which no render can continue");
        return Err(error.hint("name a file with --checkpoint"));
    }
    // A device, such as /dev/null, loses nothing.
    if !path.is_file() {
        return Ok(());
    }
    let mut file = BufReader::new(files::open(path).map_err(|cause| Error::io(path, &cause))?);
    let mut magic = [0; MAGIC.len()];
    let length = file.by_ref().take(MAGIC.len() as u64).read(&mut magic).map_err(|cause| Error::io(path, &cause))?;
    if length > 0 && !magic.starts_with(KIND) {
        let error = Error::new(ErrorKind::Usage, path.display(), "is no checkpoint, so it is not replaced by one");
        return Err(error.hint("name another file with --checkpoint, or move this one"));
    }
    let head = Record::read(&mut file).ok().flatten().and_then(|record| record.unpack().ok());
    let head = head.and_then(|head| serde_json::from_slice::<Head>(&head).ok());
    if length == 0 || overwrite || head.is_some_and(|head| head.finished) {
        return Ok(());
    }
    let error = Error::new(ErrorKind::Usage, path.display(), "is the checkpoint of a render that was not finished");
    Err(error.hint(remedy))
}

/// Reads a checkpoint: the identity of its render, and the state of its iterations.
///
/// # Errors
/// The file is missing, is no checkpoint, was written by another version of the program, or is damaged.
pub fn read(path: &Path) -> Result<(Head, State)> {
    let error = |cause: &str| Error::new(ErrorKind::Io, path.display(), cause);
    let missing =
        |cause| Error::io(path, &cause).hint("name a file that --checkpoint wrote, or start anew without --resume");
    git_lfs::check_file(path)?;
    let mut file = BufReader::new(files::open(path).map_err(missing)?);
    let mut magic = [0; MAGIC.len()];
    if file.read_exact(&mut magic).is_err() || magic != *MAGIC {
        return Err(
            error("is no checkpoint of this version of caustique").hint("name the file that --checkpoint wrote")
        );
    }
    let damaged = || error("the checkpoint is damaged").hint("start anew without --resume");
    let mut record = || Record::read(&mut file).ok().flatten().and_then(|record| record.unpack().ok());
    let head: Head = serde_json::from_slice(&record().ok_or_else(damaged)?).map_err(|_| damaged())?;
    if head.version != env!("CARGO_PKG_VERSION") {
        let cause = format!("is of version {} of caustique; this is {}", head.version, env!("CARGO_PKG_VERSION"));
        return Err(error(&cause).hint("go on with that version, or start anew without --resume"));
    }
    let state: State<()> = postcard::from_bytes(&record().ok_or_else(damaged)?).map_err(|_| damaged())?;
    let mut pixels: Vec<PixelAccumulator> = Vec::new();
    let read = records::read_blocks(&mut file, |block| {
        pixels.extend(block);
        Ok(())
    });
    read.map_err(|_| damaged())?;
    Ok((head, state.replace_pixels(pixels).0))
}

/// Checks that a checkpoint belongs to a render. `scene`: hash of the render's scene files.
///
/// # Errors
/// The scene or an option differs.
pub fn check(path: &Path, head: &Head, scene: Option<&str>, arguments: &Value) -> Result<()> {
    let error = |cause: String| Error::new(ErrorKind::Usage, path.display(), cause);
    if Some(head.scene.as_str()) != scene {
        let cause = "is of another scene, or the scene's files have changed since";
        return Err(error(cause.into()).hint("give the same scene, or start anew without --resume"));
    }
    if let Some((key, there, here)) = first_difference(&head.arguments, arguments, &FREE_OPTIONS) {
        let cause = format!("was rendered with another --{key}: {there} there, {here} here");
        return Err(error(cause).hint("give the same options, or start anew without --resume"));
    }
    Ok(())
}

/// The first option by name whose values differ between two JSON objects, with both values; `None` if none differs.
/// Options in `free` may differ.
pub(super) fn first_difference(there: &Value, here: &Value, free: &[&str]) -> Option<(String, Value, Value)> {
    let none = Map::new();
    let (there, here) = (there.as_object().unwrap_or(&none), here.as_object().unwrap_or(&none));
    let mut keys: Vec<&String> = there.keys().chain(here.keys()).collect();
    keys.sort();
    keys.into_iter().filter(|key| !free.contains(&key.as_str())).find_map(|key| {
        let [there, here] = [there, here].map(|arguments| arguments.get(key).cloned().unwrap_or_default());
        (there != here).then(|| (key.clone(), there, here))
    })
}
