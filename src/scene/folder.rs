//! The folder of a scene file: what the file names is looked for there, and nowhere else unless the user says so.
//!
//! A scene comes from anywhere, and its bytes end in a picture or in a message: one that names `../../.ssh/id_rsa` must
//! not have it opened, not even to learn whether it is there.

use crate::error::{Error, ErrorKind, Result};
use std::path::{Component, Path, PathBuf};

/// The folder of a scene file.
#[derive(Clone, Copy, Debug)]
pub struct Folder<'a> {
    path: &'a Path,
    allow_outside: bool,
}

impl<'a> Folder<'a> {
    /// The folder of the scene file at `scene`; `allow_outside` lets it name files anywhere.
    pub fn of(scene: &'a Path, allow_outside: bool) -> Folder<'a> {
        Folder { path: scene.parent().unwrap_or(Path::new("")), allow_outside }
    }

    /// The file that the scene calls `name`.
    ///
    /// # Errors
    /// It lies outside the folder: by its name, or because a link on the way leads there.
    pub fn file(&self, name: &Path) -> Result<PathBuf> {
        let file = self.path.join(name);
        let inside = || !is_of_windows(name) && resolved(&file).starts_with(resolved(self.path));
        if self.allow_outside || inside() {
            return Ok(file);
        }
        let cause = format!("the file {} is outside the scene's folder", name.display());
        Err(Error::new(ErrorKind::Scene, "", cause)
            .hint("put it beside the scene file and name it so, or allow such files with --allow-outside"))
    }
}

/// Whether a name is a path that Windows takes for one from a drive, of a share, or upwards: here its letters would
/// name a file in the folder.
fn is_of_windows(name: &Path) -> bool {
    let bytes = name.as_os_str().as_encoded_bytes();
    let drive = matches!(bytes, [letter, b':', b'\\' | b'/', ..] if letter.is_ascii_alphabetic());
    drive
        || bytes.starts_with(b"\\")
        || bytes.split(|byte| matches!(byte, b'\\' | b'/')).any(|part| part == b".." && bytes.contains(&b'\\'))
}

/// Where a path leads, links followed. Of one that leads nowhere, what its letters say: whether a file outside exists
/// is not told.
fn resolved(path: &Path) -> PathBuf {
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    path.canonicalize().unwrap_or_else(|_| {
        let there = existing(path);
        let mut out = PathBuf::new();
        for part in there.components() {
            match part {
                Component::ParentDir => drop(out.pop()),
                Component::CurDir => {}
                part => out.push(part),
            }
        }
        out
    })
}

/// A path whose longest part that exists is without links.
fn existing(path: &Path) -> PathBuf {
    let Ok(path) = std::path::absolute(path) else { return path.to_owned() };
    for start in path.ancestors() {
        if let (Ok(real), Ok(rest)) = (start.canonicalize(), path.strip_prefix(start)) {
            return real.join(rest);
        }
    }
    path
}
