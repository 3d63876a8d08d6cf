//! Checkpoints: the state of a render in a file that is whole or not there, and that says what render it belongs to.
//!
//! A line that names the kind of file, and [`records`]: a JSON object, the state but for its pixels, and these in blocks,
//! both as postcard packs them.

use super::records::{self, Record};
use crate::error::{Error, ErrorKind, Result};
use crate::estimator::PixelAccumulator;
use crate::image::atomic;
use crate::render::{Candidate, State};
use crate::scene::gltf;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::fs::File;
use std::io::{BufReader, Read, Write};
use std::path::{Path, PathBuf};

/// The first bytes of every checkpoint.
pub const MAGIC: &[u8; 23] = b"caustique checkpoint 6\n";
/// What checkpoints of all versions begin with.
const KIND: &[u8] = b"caustique checkpoint ";
/// Pixels packed together.
pub(super) const BLOCK: usize = 2048;
/// Options that may be others when a render goes on: when it stops, and how its files are written.
const FREE: [&str; 8] = ["iterations", "time", "target-error", "layers", "exr-naming", "compression", "scene", "path"];

/// Where and how often a render is saved.
#[derive(Clone, Debug)]
pub struct Saving {
    /// The file.
    pub path: PathBuf,
    /// Seconds between two saves.
    pub every: f64,
    /// It stays when the render is done, with its last state, so that the render can be extended.
    pub keep: bool,
}

/// What render a checkpoint belongs to, and what has been decided about it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Head {
    /// Of the program.
    pub version: String,
    /// Hash of the scene's files.
    pub scene: String,
    /// What was asked for.
    pub arguments: Value,
    /// What auto has chosen, if it was asked.
    pub candidate: Option<Candidate>,
    /// The plan, for the header.
    pub plan: Value,
    /// The render was done when this was saved, and its picture was about to be written.
    #[serde(default)]
    pub finished: bool,
}

/// Saves a state; the file is replaced at once, or stays as it was.
///
/// # Errors
/// The file system.
pub fn write(path: &Path, head: &Head, state: State<&[PixelAccumulator]>) -> Result<()> {
    let head = serde_json::to_vec(head).map_err(|cause| Error::new(ErrorKind::Io, path.display(), cause))?;
    let (state, pixels) = state.replace_pixels(());
    let state = postcard::to_allocvec(&state).map_err(|cause| Error::new(ErrorKind::Io, path.display(), cause))?;
    atomic::write(path, |file| {
        let written = file
            .write_all(MAGIC)
            .and_then(|()| Record::new(&head).write(file))
            .and_then(|()| Record::new(&state).write(file))
            .and_then(|()| records::write_blocks(file, pixels, BLOCK))
            .and_then(|()| records::end(file));
        written.map_err(|cause| atomic::failure(path, &cause))
    })
}

/// Checks that a render that starts anew may save itself to `path`; `remedy` says how one goes on, or
/// overwrites.
///
/// # Errors
/// The file there is no checkpoint, or, unless `overwrite`, that of a render that was not finished.
pub fn check_replaceable(path: &Path, overwrite: bool, remedy: &str) -> Result<()> {
    // A device takes anything, and keeps nothing.
    if !path.is_file() {
        return Ok(());
    }
    let mut file = BufReader::new(File::open(path).map_err(|cause| Error::io(path, &cause))?);
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

/// Reads a checkpoint.
///
/// # Errors
/// There is no file, it is none of ours, of another version of the program, or damaged.
pub fn read(path: &Path) -> Result<(Head, State)> {
    let error = |cause: &str| Error::new(ErrorKind::Io, path.display(), cause);
    let missing =
        |cause| Error::io(path, &cause).hint("name a file that --checkpoint wrote, or start anew without --resume");
    let mut file = BufReader::new(File::open(path).map_err(missing)?);
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

/// Whether a checkpoint is of the render that is asked for.
///
/// # Errors
/// Its scene or an option is another.
pub fn check(path: &Path, head: &Head, scene: Option<&str>, arguments: &Value) -> Result<()> {
    let error = |cause: String| Error::new(ErrorKind::Usage, path.display(), cause);
    if Some(head.scene.as_str()) != scene {
        let cause = "is of another scene, or the scene's files have changed since";
        return Err(error(cause.into()).hint("give the same scene, or start anew without --resume"));
    }
    if let Some((key, there, here)) = difference(&head.arguments, arguments, &FREE) {
        let cause = format!("was rendered with another --{key}: {there} there, {here} here");
        return Err(error(cause).hint("give the same options, or start anew without --resume"));
    }
    Ok(())
}

/// The first option, in their order by name, that is not the same there and here, and what it is; some are free.
pub(super) fn difference(there: &Value, here: &Value, free: &[&str]) -> Option<(String, Value, Value)> {
    let none = Map::new();
    let (there, here) = (there.as_object().unwrap_or(&none), here.as_object().unwrap_or(&none));
    let mut keys: Vec<&String> = there.keys().chain(here.keys()).collect();
    keys.sort();
    keys.into_iter().filter(|key| !free.contains(&key.as_str())).find_map(|key| {
        let [there, here] = [there, here].map(|arguments| arguments.get(key).cloned().unwrap_or_default());
        (there != here).then(|| (key.clone(), there, here))
    })
}

/// A hash of all that was read of a scene: its files, or what a converter has made of them, and the environment that the
/// command line names. `None` of a scene that comes through a pipe, and is gone.
///
/// # Errors
/// The scene cannot be read.
pub fn hash(
    scene: &Path,
    converted: Option<&str>,
    environment: Option<&Path>,
    allow_outside: bool,
) -> Result<Option<String>> {
    if !scene.is_file() {
        return Ok(None);
    }
    let scene = converted.map_or_else(|| gltf::hash(scene, allow_outside), |hash| Ok(hash.to_owned()))?;
    let mut hasher = blake3::Hasher::new();
    hasher.update(scene.as_bytes());
    if let Some(bytes) = environment.filter(|path| path.is_file()).and_then(|path| std::fs::read(path).ok()) {
        hasher.update(&bytes);
    }
    Ok(Some(hasher.finalize().to_hex().to_string()))
}
