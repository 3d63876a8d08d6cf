//! Atomic file writes: a file is either complete or absent.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, ErrorKind, Result};
use crate::files::{self, folder};
use crate::system;

/// Writes a file through `fill` to a temporary file beside it, flushes that to disk and renames it, so that no reader
/// sees a partial file. On failure the temporary file is removed and an older file at `path` stays unchanged.
///
/// Follows symbolic links. A device such as `/dev/null` receives the bytes without a rename.
///
/// # Errors
/// Errors of `fill`, and of the file system with the path and a remedy.
pub fn write(path: &Path, fill: impl FnOnce(&mut BufWriter<&mut File>) -> Result<()>) -> Result<()> {
    let target = resolve(path)?;
    let temporary = filled(path, &target, fill)?;
    publish(&target, temporary).map_err(|cause| failure(path, &cause))
}

/// A file with an unfinished version of another one, beside that one, under a random name. It outlives a program that is
/// killed; [`remove_leftovers`] removes it then.
pub struct Draft {
    /// The lock on the file marks it as one whose writer is alive.
    _file: File,
    path: PathBuf,
}

impl Draft {
    /// Writes an unfinished version of the file `path` through `fill`.
    ///
    /// # Errors
    /// Errors of `fill` and of the file system.
    pub fn write(path: &Path, fill: impl FnOnce(&mut BufWriter<&mut File>) -> Result<()>) -> Result<Draft> {
        let written = filled(path, &resolve(path)?, fill)?;
        // No reader sees a partial draft.
        let name = written.path().with_extension(DRAFT.trim_start_matches('.'));
        let kept = written.as_file().sync_all().and_then(|()| Ok(written.persist_noclobber(&name)?));
        kept.map(|file| Draft { _file: file, path: name }).map_err(|cause| failure(path, &cause))
    }

    /// Removes the file.
    pub fn remove(self) {
        let _ = fs::remove_file(&self.path);
    }
}

/// Writes a temporary file for the file `target` through `fill`. `path`: the name of the file in messages.
fn filled(
    path: &Path,
    target: &Path,
    fill: impl FnOnce(&mut BufWriter<&mut File>) -> Result<()>,
) -> Result<NamedTempFile> {
    // Files of a killed program would otherwise stay for ever.
    if !is_device(target) {
        remove_stale(folder(target), &prefix(target), PART);
    }
    let mut temporary = temporary_beside(target).map_err(|cause| failure(path, &cause))?;
    let mut buffered = BufWriter::with_capacity(1 << 18, temporary.as_file_mut());
    fill(&mut buffered)?;
    buffered.flush().map_err(|cause| failure(path, &cause))?;
    drop(buffered);
    Ok(temporary)
}

/// Removes the temporary files and drafts of the file `path` that a killed process has left.
pub fn remove_leftovers(path: &Path) {
    let Ok(target) = resolve(path) else { return };
    [PART, DRAFT].iter().for_each(|suffix| remove_stale(folder(&target), &prefix(&target), suffix));
}

/// Whether a file has the name of a temporary file or a draft of the file `path`.
pub fn is_temporary(file: &Path, path: &Path) -> bool {
    // Most names differ in their first letters.
    let is_hidden = file.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(PREFIX.as_bytes()));
    let Some(target) = resolve(path).ok().filter(|_| is_hidden) else { return false };
    let named = |suffix: &&str| file.file_name().is_some_and(|name| is_ours(name, &prefix(&target), suffix));
    [PART, DRAFT].iter().any(named) && files::is_same_folder(folder(file), folder(&target))
}

/// Writes `bytes` as a file, atomically, see [`write()`].
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write(path, |file| file.write_all(bytes).map_err(|cause| failure(path, &cause)))
}

/// Checks before a long render that [`write()`] can succeed: the folder exists and accepts new files, and `path` is not a
/// folder.
///
/// # Errors
/// The reason, with a remedy.
pub fn check_writable(path: &Path) -> Result<()> {
    let target = resolve(path)?;
    match fs::symlink_metadata(&target) {
        Err(cause) if cause.kind() != io::ErrorKind::NotFound => return Err(failure(path, &cause)),
        Ok(file) if system::is_protected(&file, folder(&target)) => {
            let error =
                Error::new(ErrorKind::Io, path.display(), "belongs to another user, whose files are kept there");
            return Err(error.hint("choose another name, or another folder"));
        }
        Ok(file) if file.is_file() && file.permissions().readonly() => {
            let error = Error::new(ErrorKind::Io, path.display(), "is protected against writing");
            return Err(error.hint("choose another name, or let it be written: chmod u+w"));
        }
        _ => {}
    }
    temporary_beside(&target).map(drop).map_err(|cause| failure(path, &cause))
}

/// An error of the file system while writing `path`, with a remedy if there is one.
pub fn failure(path: &Path, cause: &io::Error) -> Error {
    let error = Error::io(path, cause);
    match cause.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => {
            error.hint("make room there, or write to another disk")
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            error.hint("choose a folder that you may write to")
        }
        io::ErrorKind::InvalidFilename => error.hint("choose a shorter name"),
        _ => error,
    }
}

/// The file that `path` names. Links are followed, also to a file that does not exist yet, so that a link stays a link.
fn resolve(path: &Path) -> Result<PathBuf> {
    let error = |cause: &str| Error::new(ErrorKind::Io, path.display(), cause);
    if path.file_name().is_none() || path.is_dir() {
        return Err(error("is a folder").hint("name a file in it"));
    }
    // No temporary file can be made beside a pipe or a device.
    if is_device(path) {
        return Ok(path.to_owned());
    }
    let Some(target) = files::follow(path) else {
        return Err(error("is a link that leads back to itself").hint("name a file"));
    };
    let folder = folder(&target);
    if !folder.is_dir() {
        return Err(error("its folder does not exist").hint(format!("mkdir -p {}", folder.display())));
    }
    Ok(fs::canonicalize(&target).unwrap_or(target))
}

fn is_device(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|data| !data.is_file())
}

/// Creates a locked temporary file in the folder of the file `target`.
fn temporary_beside(target: &Path) -> io::Result<NamedTempFile> {
    let prefix = prefix(target);
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(PART);
    // Temporary files are private by default; ours becomes the user's file, under the user's umask.
    if let Some(permissions) = system::user_permissions() {
        builder.permissions(permissions);
    }
    if is_device(target) {
        return builder.tempfile();
    }
    loop {
        let file = builder.tempfile_in(folder(target))?;
        // The lock marks a file that is being written. Another process may have removed the file before it was locked.
        let locked = system::lock(file.as_file()).is_ok();
        if !locked || file.path().exists() {
            return Ok(file);
        }
    }
}

/// Prefix of the names of the temporary files for the file `target`.
fn prefix(target: &Path) -> OsString {
    let mut prefix = OsString::from(PREFIX);
    // File names are limited to 255 bytes.
    if let Some(name) = target.file_name().filter(|name| name.len() <= 200) {
        prefix.push(name);
        prefix.push("-");
    }
    prefix
}

/// Prefix of the names of all temporary files.
const PREFIX: &str = ".caustique-";
/// Suffix of the names of files that are being written.
const PART: &str = ".part";
/// Suffix of the names of unfinished pictures.
const DRAFT: &str = ".estimate.exr";
/// Number of random characters between prefix and suffix, the default of `tempfile`.
const RANDOM: usize = 6;

/// Whether a name has this prefix and suffix, with random characters between them.
fn is_ours(name: &OsStr, prefix: &OsStr, suffix: &str) -> bool {
    let (name, prefix, suffix) = (name.as_encoded_bytes(), prefix.as_encoded_bytes(), suffix.as_bytes());
    name.len() == prefix.len() + RANDOM + suffix.len() && name.starts_with(prefix) && name.ends_with(suffix)
}

/// Removes the temporary files in `folder` with these names that a killed process has left: files that no process has
/// locked. On file systems without locks nothing is removed.
fn remove_stale(folder: &Path, prefix: &OsStr, suffix: &str) {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    // Opening a pipe would wait for its writer.
    let is_file = |entry: &fs::DirEntry| entry.file_type().is_ok_and(|kind| kind.is_file());
    for entry in entries.filter(|entry| is_ours(&entry.file_name(), prefix, suffix) && is_file(entry)) {
        // Holding the lock keeps writers out until the file is removed.
        let free = File::open(entry.path()).ok().filter(|file| system::try_lock(file).is_ok());
        if free.is_some() {
            let _ = fs::remove_file(entry.path());
        }
    }
}

fn publish(target: &Path, mut temporary: NamedTempFile) -> io::Result<()> {
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
    // The rename reaches the disk with its folder. File systems that cannot sync folders do not need it.
    if let Ok(folder) = File::open(folder(target)) {
        let _ = folder.sync_all();
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The name of a pipe in `/proc` is a link that leads nowhere; it must not be followed.
    #[cfg(target_os = "linux")]
    #[test]
    fn pipes_keep_their_names() {
        use std::os::fd::AsRawFd;
        let (_reader, writer) = std::io::pipe().expect("a pipe");
        let path = PathBuf::from(format!("/proc/self/fd/{}", writer.as_raw_fd()));
        assert_eq!(resolve(&path).expect("it can be written to"), path);
    }

    /// A link stays a link; a link into a missing folder or to itself is an error.
    #[cfg(unix)]
    #[test]
    fn links_are_followed() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("disk")).expect("a folder");
        for (target, link) in [("disk/a.exr", "a.exr"), ("a.exr", "b.exr"), ("gone/c.exr", "c.exr"), ("d.exr", "d.exr")]
        {
            symlink(target, path(link)).expect("a link");
        }
        for name in ["a.exr", "b.exr"] {
            check_writable(&path(name)).expect("it can be written");
            write_bytes(&path(name), name.as_bytes()).expect("it can be written");
            assert!(path(name).is_symlink());
            assert_eq!(fs::read(path("disk/a.exr")).expect("it is there"), name.as_bytes());
        }
        let cause = |name: &str| check_writable(&path(name)).expect_err("it leads nowhere").cause;
        assert_eq!(cause("c.exr"), "its folder does not exist");
        assert_eq!(cause("d.exr"), "is a link that leads back to itself");
        let long = check_writable(&path(&"x".repeat(256))).expect_err("the name is too long");
        assert_eq!(long.hint.as_deref(), Some("choose a shorter name"), "{long}");
    }

    /// A pipe with the name of a stale file must not block the write.
    #[cfg(unix)]
    #[test]
    fn pipes_are_not_opened() {
        let folder = tempfile::tempdir().expect("a folder");
        let pipe = folder.path().join(".caustique-a.exr-aaaaaa.part");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo runs");
        assert!(made.success());
        write_bytes(&folder.path().join("a.exr"), b"whole").expect("it can be written");
        assert!(pipe.exists());
    }

    /// Stale temporary files of the same target are removed; locked ones and those of other targets stay.
    #[test]
    fn stale_files_are_removed() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        let others = [".caustique-b.exr-aaaaaa.part", ".caustique-a.exr-b.exr-aaaaaa.part", ".caustique-aaaaaa.part"];
        let (stale, busy) = (".caustique-a.exr-aaaaaa.part", ".caustique-a.exr-bbbbbb.part");
        for name in others.into_iter().chain([stale, busy]) {
            fs::write(path(name), "half").expect("it can be written");
        }
        let writer = File::open(path(busy)).expect("it is there");
        system::lock(&writer).expect("it can be locked");
        write_bytes(&path("a.exr"), b"whole").expect("it can be written");
        assert_eq!(fs::read(path("a.exr")).expect("it is there"), b"whole");
        assert!(!path(stale).exists() && path(busy).exists() && others.iter().all(|name| path(name).exists()));
        assert_eq!(fs::read_dir(folder.path()).expect("it can be read").count(), 5);
        // Two writers at once do not remove each other's files.
        let first = temporary_beside(&path("a.exr")).expect("it can be made");
        let second = temporary_beside(&path("a.exr")).expect("it can be made");
        assert!(first.path().exists() && second.path().exists() && path(busy).exists());
    }
}
