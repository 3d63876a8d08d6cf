//! Checkpoints: the state of a render in a file that is whole or not there, and that says what render it belongs to.
//!
//! A line that names the kind of file, the length of a JSON object (eight bytes, little endian) and the object, the state
//! packed by postcard and LZ4 (levels that a method does not have are zeros), and the BLAKE3 hash of all before.

use crate::error::{Error, Kind, Result};
use crate::estimator::Pixel;
use crate::image::atomic;
use crate::render::{State, Strategy};
use lz4_flex::frame::{FrameDecoder, FrameEncoder};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// The first bytes of every checkpoint.
const MAGIC: &[u8] = b"caustique checkpoint 1\n";
/// Bytes of the hash at the end.
const HASH: usize = blake3::OUT_LEN;
/// Options that may be others when a render goes on: when it stops, and how its files are written.
const FREE: [&str; 6] = ["iterations", "time", "target-error", "layers", "exr-naming", "compression"];

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
#[derive(Debug, Serialize, Deserialize)]
pub struct Head {
    /// Of the program.
    pub version: String,
    /// Hash of the scene's files.
    pub scene: String,
    /// What was asked for.
    pub arguments: Value,
    /// What auto has chosen, if it was asked.
    pub way: Option<Strategy>,
    /// The plan, for the header.
    pub plan: Value,
}

/// Writes everything through to a file, and hashes it.
struct Hashing<W> {
    inner: W,
    hasher: blake3::Hasher,
    /// Why the file takes no more, which who packs does not tell.
    failure: Option<io::ErrorKind>,
}

impl<W: Write> Write for Hashing<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.inner.write(bytes).inspect_err(|error| self.failure = Some(error.kind()))?;
        self.hasher.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

/// Saves a state; the file is replaced at once, or stays as it was.
///
/// # Errors
/// The file system.
pub fn write(path: &Path, head: &Head, state: &State<&[Pixel]>) -> Result<()> {
    let head = serde_json::to_vec(head).map_err(|cause| Error::new(Kind::Io, path.display(), cause))?;
    atomic::write(path, |file| {
        let mut out = Hashing { inner: file, hasher: blake3::Hasher::new(), failure: None };
        let start = out
            .write_all(MAGIC)
            .and_then(|()| out.write_all(&(head.len() as u64).to_le_bytes()))
            .and_then(|()| out.write_all(&head));
        start.map_err(|cause| atomic::failure(path, &cause))?;
        let mut packed = FrameEncoder::new(&mut out);
        let whole = postcard::to_io(state, &mut packed).is_ok() && packed.finish().is_ok();
        if !whole {
            let cause = io::Error::from(out.failure.unwrap_or(io::ErrorKind::Other));
            return Err(atomic::failure(path, &cause));
        }
        let hash = out.hasher.finalize();
        out.inner.write_all(hash.as_bytes()).map_err(|cause| atomic::failure(path, &cause))
    })
}

/// Reads a checkpoint.
///
/// # Errors
/// There is no file, it is none of ours, of another version of the program, or damaged.
pub fn read(path: &Path) -> Result<(Head, State)> {
    let error = |cause: &str| Error::new(Kind::Io, path.display(), cause);
    let missing =
        |cause| Error::io(path, &cause).hint("name a file that --checkpoint wrote, or start anew without --resume");
    let bytes = std::fs::read(path).map_err(missing)?;
    let Some(rest) = bytes.strip_prefix(MAGIC) else {
        return Err(
            error("is no checkpoint of this version of caustique").hint("name the file that --checkpoint wrote")
        );
    };
    let damaged = || error("the checkpoint is damaged").hint("start anew without --resume");
    let (whole, hash) = bytes.split_at(bytes.len().saturating_sub(HASH));
    if whole.len() < MAGIC.len() + 8 || blake3::hash(whole).as_bytes() != hash {
        return Err(damaged());
    }
    let rest = &rest[..rest.len() - HASH];
    let (length, rest) = rest.split_at(8);
    let length = usize::try_from(u64::from_le_bytes(length.try_into().map_err(|_| damaged())?)).unwrap_or(usize::MAX);
    let (head, state) = rest.split_at_checked(length).ok_or_else(damaged)?;
    let head: Head = serde_json::from_slice(head).map_err(|_| damaged())?;
    if head.version != env!("CARGO_PKG_VERSION") {
        let cause = format!("is of version {} of caustique; this is {}", head.version, env!("CARGO_PKG_VERSION"));
        return Err(error(&cause).hint("go on with that version, or start anew without --resume"));
    }
    let mut unpacked = Vec::new();
    FrameDecoder::new(state).read_to_end(&mut unpacked).map_err(|_| damaged())?;
    Ok((head, postcard::from_bytes(&unpacked).map_err(|_| damaged())?))
}

/// Whether a checkpoint is of the render that is asked for.
///
/// # Errors
/// Its scene or an option is another.
pub fn check(path: &Path, head: &Head, scene: Option<&str>, arguments: &Value) -> Result<()> {
    let error = |cause: String| Error::new(Kind::Usage, path.display(), cause);
    if Some(head.scene.as_str()) != scene {
        let cause = "is of another scene, or the scene's files have changed since";
        return Err(error(cause.into()).hint("give the same scene, or start anew without --resume"));
    }
    let none = Map::new();
    let (there, here) = (head.arguments.as_object().unwrap_or(&none), arguments.as_object().unwrap_or(&none));
    let mut keys: Vec<&String> = there.keys().chain(here.keys()).collect();
    keys.sort();
    keys.dedup();
    let (null, free) = (Value::Null, |key: &str| FREE.contains(&key) || key == "scene" || key == "path");
    for key in keys.into_iter().filter(|key| !free(key)) {
        let [there, here] = [there, here].map(|arguments| arguments.get(key).unwrap_or(&null));
        if there != here {
            let cause = format!("was rendered with another --{key}: {there} there, {here} here");
            return Err(error(cause).hint("give the same options, or start anew without --resume"));
        }
    }
    Ok(())
}

/// A hash of a scene's files: the file itself, and those in its folder that it or the command line names. `None` of a
/// scene that comes through a pipe, and is gone.
///
/// # Errors
/// The scene cannot be read.
pub fn hash(scene: &Path, environment: Option<&Path>) -> Result<Option<String>> {
    if !scene.is_file() {
        return Ok(None);
    }
    let bytes = std::fs::read(scene).map_err(|cause| Error::io(scene, &cause))?;
    let mut hasher = blake3::Hasher::new();
    hasher.update(&bytes);
    let folder = scene.parent().unwrap_or(Path::new(""));
    let mut named: Vec<PathBuf> = environment.map(Path::to_owned).into_iter().collect();
    if let Some(json) = document(&bytes) {
        names(&json, &mut |name| named.push(folder.join(name)));
    }
    for bytes in named.iter().filter(|path| path.is_file()).filter_map(|path| std::fs::read(path).ok()) {
        hasher.update(&bytes);
    }
    Ok(Some(hasher.finalize().to_hex().to_string()))
}

/// The JSON of a glTF file, or the one in a GLB.
fn document(bytes: &[u8]) -> Option<Value> {
    let json = match bytes.strip_prefix(b"glTF") {
        Some(rest) => {
            let length = rest.get(8..12).and_then(|four| four.try_into().ok()).map(u32::from_le_bytes)?;
            rest.get(16..16 + length as usize)?
        }
        None => bytes,
    };
    serde_json::from_slice(json).ok()
}

/// Calls `found` with the value of every key `uri` and `file` that may name a file.
fn names(json: &Value, found: &mut impl FnMut(&str)) {
    match json {
        Value::Array(values) => values.iter().for_each(|value| names(value, found)),
        Value::Object(object) => {
            for (key, value) in object {
                match value.as_str().filter(|text| !text.starts_with("data:")) {
                    Some(text) if key == "uri" || key == "file" => found(text),
                    _ => names(value, found),
                }
            }
        }
        _ => {}
    }
}
