//! Recognises pointers of Git LFS: small texts that stand for large files in a clone until `git lfs pull` fetches the files.
//! The specification is at <https://github.com/git-lfs/git-lfs/blob/main/docs/spec.md>.

use crate::error::{Error, ErrorKind, Result};
use std::fmt::Display;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// The text that each pointer starts with.
const START: &[u8] = b"version https://git-lfs.github.com/spec/";

/// Rejects a file that is a pointer. `start` is the start of the file or all of it, `place` names it.
///
/// # Errors
/// The file is a pointer.
pub fn check(start: &[u8], place: impl Display) -> Result<()> {
    if !start.starts_with(START) {
        return Ok(());
    }
    let cause = "the file is a pointer of Git LFS, not the file that it stands for";
    Err(Error::new(ErrorKind::Io, place, cause).hint("run 'git lfs pull' in its folder"))
}

/// Does the work of [`check`] for the file at `path`. A file that cannot be read passes: its reader has a better message.
///
/// # Errors
/// The file is a pointer.
pub fn check_file(path: &Path) -> Result<()> {
    let mut start = Vec::new();
    let file = path.is_file().then(|| File::open(path).ok()).flatten();
    match file.map(|file| file.take(START.len() as u64).read_to_end(&mut start)) {
        Some(Ok(_)) => check(&start, path.display()),
        _ => Ok(()),
    }
}
