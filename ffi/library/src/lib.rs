//! Finds and loads shared libraries at run time: the common part of the bindings of Embree, Open Image Denoise and ONNX
//! Runtime.

use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};

pub use libloading::Library;

#[cfg(unix)]
#[path = "unix.rs"]
mod system;
#[cfg(windows)]
#[path = "windows.rs"]
mod system;

/// Number of levels of subfolders that [`find_below`] searches.
const MAX_DEPTH: usize = 3;

/// The version number of a library.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version {
    /// First of the three version numbers.
    pub major: u32,
    /// Second of the three version numbers.
    pub minor: u32,
    /// Third of the three version numbers.
    pub patch: u32,
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}.{}", self.major, self.minor, self.patch)
    }
}

/// A library file that cannot be used, and the reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// Path of the file, or the name that was passed to the system's loader.
    pub path: PathBuf,
    /// Reason why the library cannot be used, without the path.
    pub reason: String,
}

impl Refusal {
    /// A refusal of the library file at `path`, for `reason`.
    pub fn new(path: &Path, reason: impl Into<String>) -> Refusal {
        Refusal { path: path.to_owned(), reason: reason.into() }
    }

    /// A refusal of the library file at `path` because of the system's loader, whose message repeats the path.
    pub fn by_loader(path: &Path, error: &libloading::Error) -> Refusal {
        let text = error.to_string();
        let prefix = format!("{}: ", path.display());
        Refusal::new(path, text.strip_prefix(&prefix).unwrap_or(&text))
    }
}

/// The path in the environment variable `name`; `None` if it is not set or empty.
pub fn path_from_env(name: &str) -> Option<PathBuf> {
    std::env::var_os(name).filter(|path| !path.is_empty()).map(PathBuf::from)
}

/// Loads the library file at `path`. The system's loader looks up a bare file name in its own folders.
///
/// # Errors
/// The loader cannot load the file.
///
/// # Safety
/// Loading runs the file's initialisers, so the file must be trusted.
pub unsafe fn open(path: &Path) -> Result<Library, Refusal> {
    // SAFETY: the caller guarantees that the file is trusted.
    unsafe { system::open(path) }.map_err(|error| Refusal::by_loader(path, &error))
}

/// Loads a library file for the rest of the process, so that another loader of the same path takes it.
///
/// Loading runs the file's initialisers, so the file must be trusted.
///
/// # Errors
/// The system's loader cannot load the file.
pub fn preload(path: &Path) -> Result<(), Refusal> {
    // SAFETY: initialisers run here. The documentation requires a trusted file.
    unsafe { open(path) }.map(std::mem::forget)
}

/// Loads the first of the `candidates`, library files, that `load` accepts.
///
/// # Errors
/// `load` accepts none. The error lists all candidates with the reasons, in order.
pub fn load_first_of<T>(
    candidates: &[PathBuf],
    load: impl Fn(&Path) -> Result<T, Refusal>,
) -> Result<T, Vec<(PathBuf, String)>> {
    let mut tried = Vec::new();
    for candidate in candidates {
        match load(candidate) {
            Ok(library) => return Ok(library),
            Err(Refusal { path, reason }) => tried.push((path, reason)),
        }
    }
    Err(tried)
}

/// Folders to search for a library in addition to those of the system's loader.
#[derive(Clone, Debug, Default)]
pub struct Folders {
    /// Searched before the system's, such as the folder of a package that holds the program and its libraries.
    pub first: Vec<PathBuf>,
    /// Searched after the system's.
    pub last: Vec<PathBuf>,
}

impl Folders {
    /// The library files to try, in order: files below the first folders whose names begin with `stem`, the `names` for
    /// the system's loader, and such files below the last folders.
    pub fn candidates<N: AsRef<Path>>(&self, stem: &str, names: impl IntoIterator<Item = N>) -> Vec<PathBuf> {
        let mut all = find_below(&self.first, stem);
        all.extend(names.into_iter().map(|name| name.as_ref().to_owned()));
        all.extend(find_below(&self.last, stem));
        all
    }
}

/// Finds the files below `folders` whose names begin with `stem`. In each folder, longer names come first: they contain
/// the more complete version number.
pub fn find_below(folders: &[PathBuf], stem: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for folder in folders {
        add_files_below(folder, stem, MAX_DEPTH, &mut found);
    }
    found
}

fn add_files_below(folder: &Path, stem: &str, depth: usize, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort_by(|a, b| b.cmp(a));
    for path in paths {
        if path.is_dir() {
            if depth > 0 {
                add_files_below(&path, stem, depth - 1, found);
            }
        } else if file_name(&path).starts_with(stem) && !found.contains(&path) {
            found.push(path);
        }
    }
}

/// The file name at the end of a path; empty if it is not UTF-8.
pub fn file_name(path: &Path) -> &str {
    path.file_name().and_then(OsStr::to_str).unwrap_or_default()
}

/// The file that contains the code or data at `address`, under the name by which it was loaded; `None` if there is
/// none.
pub fn file_containing(address: usize) -> Option<PathBuf> {
    system::file_containing(address)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_below_a_folder_are_found_fullest_version_first_and_without_modules() {
        let folder = tempfile::tempdir().unwrap();
        let lib = folder.path().join("oidn-2.5.1/lib");
        std::fs::create_dir_all(&lib).unwrap();
        for suffix in [".so", ".so.2", ".so.2.5.1", "_core.so.2.5.1", "_device_cpu.so.2.5.1"] {
            std::fs::write(lib.join(format!("libOpenImageDenoise{suffix}")), "").unwrap();
        }
        std::fs::write(lib.join("libonnxruntime.so"), "").unwrap();
        let found = find_below(&[folder.path().to_owned(), lib.clone()], "libOpenImageDenoise.so");
        let names: Vec<_> = found.iter().map(|path| file_name(path)).collect();
        assert_eq!(names, ["libOpenImageDenoise.so.2.5.1", "libOpenImageDenoise.so.2", "libOpenImageDenoise.so"]);
    }

    #[test]
    fn a_package_is_searched_before_the_system_and_other_folders_after_it() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name).join("libfoo.so.1");
        for name in ["package", "other"] {
            std::fs::create_dir(folder.path().join(name)).unwrap();
            std::fs::write(file(name), "").unwrap();
        }
        let folders = Folders { first: vec![folder.path().join("package")], last: vec![folder.path().join("other")] };
        let names = ["libfoo.so.1", "libfoo.so"];
        let expected = [file("package"), names[0].into(), names[1].into(), file("other")];
        assert_eq!(folders.candidates("libfoo.so", names), expected);
        assert_eq!(Folders::default().candidates("libfoo.so", names), names.map(PathBuf::from));
    }

    #[test]
    fn the_first_usable_candidate_is_taken_and_all_refusals_are_kept() {
        let candidates = ["a", "b", "c"].map(PathBuf::from);
        let load = |usable: &'static str| {
            move |path: &Path| match path {
                path if path == Path::new(usable) => Ok(usable),
                path => Err(Refusal::new(path, "broken")),
            }
        };
        assert_eq!(load_first_of(&candidates, load("b")), Ok("b"));
        let tried = load_first_of(&candidates, load("d")).unwrap_err();
        assert_eq!(tried, ["a", "b", "c"].map(|name| (PathBuf::from(name), "broken".to_owned())));
    }

    #[test]
    fn a_loader_message_does_not_repeat_the_path() {
        // SAFETY: there is no such file, so nothing is loaded.
        let refusal = unsafe { open(Path::new("/no/such/libfoo.so")) }.unwrap_err();
        assert_eq!(refusal.path, Path::new("/no/such/libfoo.so"));
        assert!(refusal.reason.starts_with("cannot open shared object file"), "{}", refusal.reason);
    }

    #[test]
    fn the_file_of_this_function_is_the_test_program() {
        let address = file_containing as fn(usize) -> Option<PathBuf>;
        let found = file_containing(address as usize).and_then(|path| path.canonicalize().ok());
        assert_eq!(found, std::env::current_exe().ok());
    }
}
