//! Files that are either whole or not there.

use std::fs::{self, File, Permissions};
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, Kind, Result};

/// Writes a file through `fill` so that nobody ever sees half of it: to a temporary file beside it, flushed to disk,
/// then renamed. If anything fails the temporary file is removed and an older file at `path` stays as it was.
///
/// A symbolic link is followed; a device such as `/dev/null` receives the bytes without a rename.
///
/// Errors: what `fill` returns, and those of the file system with the path and a remedy.
pub fn write(path: &Path, fill: impl FnOnce(&mut BufWriter<&mut File>) -> Result<()>) -> Result<()> {
    let target = resolve(path)?;
    let mut temporary = beside(&target).map_err(|cause| failure(path, &cause))?;
    let mut buffered = BufWriter::with_capacity(1 << 18, temporary.as_file_mut());
    fill(&mut buffered)?;
    buffered.flush().map_err(|cause| failure(path, &cause))?;
    drop(buffered);
    finish(&target, temporary).map_err(|cause| failure(path, &cause))
}

/// Writes a file as a whole, see [`write()`].
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write(path, |file| file.write_all(bytes).map_err(|cause| failure(path, &cause)))
}

/// Finds out before a long render whether [`write()`] can succeed: the folder exists and takes new files, and `path` is
/// no folder.
///
/// Errors: the reason, with a remedy.
pub fn check_writable(path: &Path) -> Result<()> {
    let target = resolve(path)?;
    beside(&target).map(drop).map_err(|cause| failure(path, &cause))
}

/// An error of the file system while writing `path`, with a remedy where there is one.
pub(crate) fn failure(path: &Path, cause: &io::Error) -> Error {
    let error = Error::io(path, cause);
    match cause.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => {
            error.hint("make room there, or write to another disk")
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            error.hint("choose a folder that you may write to")
        }
        _ => error,
    }
}

/// Where the bytes go: links followed, so that a link stays a link.
fn resolve(path: &Path) -> Result<PathBuf> {
    let error = |cause: &str| Error::new(Kind::Io, path.display(), cause);
    if path.file_name().is_none() || path.is_dir() {
        return Err(error("is a folder").hint("name a file in it"));
    }
    let folder = folder(path);
    if !folder.is_dir() {
        return Err(error("its folder does not exist").hint(format!("mkdir -p {}", folder.display())));
    }
    Ok(fs::canonicalize(path).unwrap_or_else(|_| path.to_owned()))
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn is_device(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|data| !data.is_file())
}

fn beside(target: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".caustique-").suffix(".part");
    // Temporary files are private by default; ours becomes the user's file, under the user's umask.
    #[cfg(unix)]
    builder.permissions(<Permissions as std::os::unix::fs::PermissionsExt>::from_mode(0o666));
    if is_device(target) { builder.tempfile() } else { builder.tempfile_in(folder(target)) }
}

fn finish(target: &Path, mut temporary: NamedTempFile) -> io::Result<()> {
    if is_device(target) {
        temporary.as_file_mut().rewind()?;
        return io::copy(temporary.as_file_mut(), &mut File::options().write(true).open(target)?).map(drop);
    }
    temporary.as_file().sync_all()?;
    // An older file keeps its permissions.
    if let Ok(older) = fs::metadata(target) {
        temporary.as_file().set_permissions(older.permissions())?;
    }
    temporary.persist(target).map_err(|error| error.error)?;
    // The rename itself reaches the disk with its folder; some file systems cannot do this, and then do not need it.
    if let Ok(folder) = File::open(folder(target)) {
        let _ = folder.sync_all();
    }
    Ok(())
}
