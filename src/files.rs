//! Files that users or scenes name: read without waiting for pipes and devices, and recognised under all their names.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use crate::system::{self, FileId};

/// Maximum length of a chain of symbolic links, as on Linux.
const MAX_LINKS: usize = 40;

/// Opens a regular file for reading. Pipes and devices are refused, because reading one may wait forever or never end.
///
/// # Errors
/// The file cannot be opened, or is not a regular file.
pub fn open(path: &Path) -> io::Result<File> {
    let refused = || io::Error::other("it is not a regular file");
    // Opening a device may have effects, so it is asked for its type first.
    if !fs::metadata(path)?.is_file() {
        return Err(refused());
    }
    let file = system::open_without_waiting(path)?;
    if file.metadata()?.is_file() { Ok(file) } else { Err(refused()) }
}

/// The bytes of a regular file, see [`open`].
///
/// # Errors
/// Errors of [`open`]; the file cannot be read.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut file = open(path)?;
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(file.metadata()?.len() as usize)?;
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The bytes of a regular file or of a pipe, at most `limit`. Waits for the writer of a pipe. Devices are refused.
///
/// # Errors
/// The file cannot be read, is longer, or is neither a file nor a pipe.
pub fn receive(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let (mut file, expected) = match fs::metadata(path)? {
        data if system::is_pipe(&data) => (File::open(path)?, 0),
        data => (open(path)?, data.len()),
    };
    let too_long = || io::Error::new(io::ErrorKind::OutOfMemory, "it is larger than the memory that is left");
    if expected > limit {
        return Err(too_long());
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(expected as usize)?;
    file.by_ref().take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit { Err(too_long()) } else { Ok(bytes) }
}

/// Whether two paths name the same file, which need not exist yet: by links, hard links, or another way to its folder.
pub fn is_same(one: &Path, other: &Path) -> bool {
    let other = identities(other);
    one == other.path || identities(one).keys.iter().any(|key| other.keys.contains(key))
}

/// Whether two paths name the same existing folder.
pub fn is_same_folder(one: &Path, other: &Path) -> bool {
    system::file_id(one).is_ok_and(|one| system::file_id(other).is_ok_and(|other| one == other))
}

/// A property that only one file has.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Key {
    /// The file itself, which hard links share.
    File(FileId),
    /// Its folder, and its name there. A file that is replaced keeps it.
    Place(FileId, OsString),
}

/// A path with the keys of its file.
pub struct Identities<'a> {
    /// The path as it was given.
    pub path: &'a Path,
    /// Two files are the same if they have a key in common.
    pub keys: Vec<Key>,
}

/// The keys of the file that a path names, existing or not. Devices and folders have none: they are not replaced.
pub fn identities(path: &Path) -> Identities<'_> {
    let mut keys = Vec::new();
    if !fs::metadata(path).is_ok_and(|data| !data.is_file()) {
        keys.extend(system::file_id(path).ok().map(Key::File));
        let target = follow(path).unwrap_or_else(|| path.to_owned());
        let place = system::file_id(folder(&target));
        keys.extend(place.ok().zip(target.file_name()).map(|(folder, name)| Key::Place(folder, name.to_owned())));
    }
    Identities { path, keys }
}

/// The path at the end of a chain of symbolic links, also if there is no file; `None` if the chain is a circle.
pub fn follow(path: &Path) -> Option<PathBuf> {
    let mut target = path.to_owned();
    for _ in 0..=MAX_LINKS {
        match fs::read_link(&target) {
            Ok(next) => target = folder(&target).join(next),
            Err(_) => return Some(target),
        }
    }
    None
}

/// The folder of a file.
pub fn folder(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn files_are_the_same_under_all_their_names() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("sub")).expect("a folder");
        fs::write(path("a"), "a").expect("it can be written");
        fs::write(path("b"), "a").expect("it can be written");
        fs::hard_link(path("a"), path("hard")).expect("a link");
        for (target, link) in
            [("a", "soft"), ("soft", "softer"), ("new", "dangling"), ("round", "round"), ("sub", "to")]
        {
            symlink(target, path(link)).expect("a link");
        }
        for (one, other) in [
            ("a", "a"),
            ("a", "soft"),
            ("a", "softer"),
            ("a", "hard"),
            ("a", "sub/../a"),
            ("new", "new"),
            ("new", "dangling"),
            ("sub/new", "to/new"),
            ("round", "round"),
            ("none/new", "none/new"),
        ] {
            assert!(is_same(&path(one), &path(other)), "{one} {other}");
        }
        for (one, other) in [("a", "b"), ("a", "new"), ("new", "newer"), ("sub/new", "new"), ("none/new", "none/newer")]
        {
            assert!(!is_same(&path(one), &path(other)), "{one} {other}");
        }
        // A device can be read and written.
        assert!(identities(Path::new("/dev/null")).keys.is_empty());
    }

    #[test]
    fn pipes_devices_and_folders_are_not_opened() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        let made = std::process::Command::new("mkfifo").arg(path("pipe")).status().expect("mkfifo runs");
        assert!(made.success());
        symlink("pipe", path("link")).expect("a link");
        for refused in [path("pipe"), path("link"), folder.path().to_owned(), "/dev/zero".into()] {
            let cause = open(&refused).expect_err("it is no regular file");
            assert_eq!(cause.to_string(), "it is not a regular file", "{}", refused.display());
        }
        assert!(receive("/dev/zero".as_ref(), u64::MAX).is_err());
        std::thread::scope(|scope| {
            scope.spawn(|| fs::write(path("pipe"), "through a pipe"));
            assert_eq!(receive(&path("pipe"), 100).expect("it can be read"), b"through a pipe");
        });
        assert_eq!(open(&path("none")).expect_err("there is none").kind(), io::ErrorKind::NotFound);
        fs::write(path("a"), "a").expect("it can be written");
        assert_eq!(read(&path("a")).expect("it can be read"), b"a");
        assert_eq!(receive(&path("a"), 1).expect("it can be read"), b"a");
        assert!(receive(&path("a"), 0).is_err());
    }
}
