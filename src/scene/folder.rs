//! The folder of a scene file. Files that the scene names must be in this folder, unless the user allows others.
//!
//! Scene files come from untrusted sources, and the files that they name end up in pictures or messages. A scene that
//! names `../../.ssh/id_rsa` must not have it opened, nor learn whether it exists.

use crate::error::{Error, ErrorKind, Result};
use std::path::{Component, Path, PathBuf};

/// The folder of a scene file, from which the scene may name files.
#[derive(Clone, Copy, Debug)]
pub struct Folder<'a> {
    path: &'a Path,
    allow_outside: bool,
}

impl<'a> Folder<'a> {
    /// The folder of the scene file `scene`; `allow_outside` allows files anywhere.
    pub fn of(scene: &'a Path, allow_outside: bool) -> Folder<'a> {
        Folder { path: scene.parent().unwrap_or(Path::new("")), allow_outside }
    }

    /// The path of the file that the scene calls `name`.
    ///
    /// # Errors
    /// The file is outside the folder, by its name or because a symbolic link leads there.
    pub fn file(&self, name: &Path) -> Result<PathBuf> {
        let file = self.path.join(name);
        let inside = || !is_windows_path(name) && resolve(&file).starts_with(resolve(self.path));
        if self.allow_outside || inside() {
            return Ok(file);
        }
        let cause = format!("the file {} is outside the scene's folder", name.display());
        Err(Error::new(ErrorKind::Scene, "", cause)
            .hint("put it beside the scene file and name it so, or allow such files with --allow-outside"))
    }
}

/// Whether Windows takes a name for a path with a drive, on a share, or to a parent folder. On other systems such a
/// name would be a plain file name.
fn is_windows_path(name: &Path) -> bool {
    let bytes = name.as_os_str().as_encoded_bytes();
    let drive = matches!(bytes, [letter, b':', b'\\' | b'/', ..] if letter.is_ascii_alphabetic());
    drive
        || bytes.starts_with(b"\\")
        || bytes.split(|byte| matches!(byte, b'\\' | b'/')).any(|part| part == b".." && bytes.contains(&b'\\'))
}

/// The path with symbolic links resolved. Of a path that does not exist, the part that exists is resolved, and the rest
/// is normalised as text, so that the result does not reveal whether a file outside the folder exists.
fn resolve(path: &Path) -> PathBuf {
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    path.canonicalize().unwrap_or_else(|_| {
        let partly_resolved = resolve_existing(path);
        let mut out = PathBuf::new();
        for part in partly_resolved.components() {
            match part {
                Component::ParentDir => drop(out.pop()),
                Component::CurDir => {}
                part => out.push(part),
            }
        }
        out
    })
}

/// The absolute path, with symbolic links resolved in its longest existing ancestor.
fn resolve_existing(path: &Path) -> PathBuf {
    let Ok(path) = std::path::absolute(path) else { return path.to_owned() };
    for start in path.ancestors() {
        if let (Ok(real), Ok(rest)) = (start.canonicalize(), path.strip_prefix(start)) {
            return real.join(rest);
        }
    }
    path
}
