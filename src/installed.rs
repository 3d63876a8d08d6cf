//! What `scripts/setup.sh` has installed for the program: libraries below `.deps`, Pythons in `.venv-*`.
//!
//! Both lie in the folder that [`HOME_VARIABLE`] names, else in a folder above the program or, in Python, above the package.
//! The current folder is never searched, because what is found there would run, and it may hold anybody's files.

use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

pub use caustique_library::path_from_env;

/// Environment variable that names the folder in which `scripts/setup.sh` lies in `scripts`, and then no other.
pub const HOME_VARIABLE: &str = "CAUSTIQUE_HOME";

/// Folders where everybody may create files, such as `/tmp`, have this bit in their mode.
const STICKY: u32 = 0o1000;

/// The places where something installed may lie, the nearest first. `relative` is its path in the project's folder.
pub fn candidates(relative: &str) -> Vec<PathBuf> {
    project_folders().iter().map(|home| home.join(relative)).collect()
}

/// The nearest of [`candidates`] where there is a file or a folder.
pub fn find(relative: &str) -> Option<PathBuf> {
    candidates(relative).into_iter().find(|path| path.exists())
}

/// Where the library or Python at `path` comes from: the environment variable that names it, `scripts/setup.sh`, which
/// installs it below `relative` in the project's folder, or the system.
pub fn origin(variable: &'static str, relative: &str, path: &Path) -> &'static str {
    let below = |place: &PathBuf| path.starts_with(place) || place.canonicalize().is_ok_and(|it| path.starts_with(it));
    if path_from_env(variable).is_some() {
        variable
    } else if candidates(relative).iter().any(below) {
        "scripts/setup.sh"
    } else {
        "system"
    }
}

/// The folders that may be the project's, the nearest first.
fn project_folders() -> Vec<PathBuf> {
    match path_from_env(HOME_VARIABLE) {
        Some(home) => std::path::absolute(home).into_iter().collect(),
        None => own_file().map(|own| above(&own)).unwrap_or_default(),
    }
}

/// The folders above a file, but for those where everybody may put files.
fn above(file: &Path) -> Vec<PathBuf> {
    let shared = |folder: &&Path| folder.metadata().is_ok_and(|known| known.mode() & STICKY != 0);
    file.ancestors().skip(1).filter(|folder| !shared(folder)).map(Path::to_path_buf).collect()
}

/// The file that holds this code: the program, or the Python module.
fn own_file() -> Option<PathBuf> {
    let here = own_file as fn() -> Option<PathBuf> as usize;
    let holds_here = |line: &str| {
        let (from, to) = line.split_whitespace().next()?.split_once('-')?;
        let [from, to] = [from, to].map(|digits| usize::from_str_radix(digits, 16).unwrap_or(0));
        (from..to).contains(&here).then(|| line.find('/').map(|at| PathBuf::from(&line[at..])))?
    };
    let mapped = std::fs::read_to_string("/proc/self/maps").unwrap_or_default();
    mapped.lines().find_map(holds_here).or_else(|| std::env::current_exe().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_code_is_in_the_test_program() {
        assert_eq!(own_file(), std::env::current_exe().ok());
    }

    #[test]
    fn folders_above_a_file_are_searched_but_not_those_of_everybody() {
        let shared = tempfile::tempdir().unwrap();
        let own = shared.path().join("own");
        std::fs::create_dir(&own).unwrap();
        std::fs::set_permissions(shared.path(), std::os::unix::fs::PermissionsExt::from_mode(0o1777)).unwrap();
        let found = above(&own.join("program"));
        assert_eq!(found.first(), Some(&own));
        assert!(found.contains(&PathBuf::from("/")) && !found.contains(&shared.path().to_path_buf()), "{found:?}");
    }

    #[test]
    fn an_origin_is_a_variable_the_folder_or_the_system() {
        let library = candidates(".deps/oidn").remove(0).join("lib/libOpenImageDenoise.so");
        assert_eq!(origin("CAUSTIQUE_UNSET", ".deps/oidn", &library), "scripts/setup.sh");
        assert_eq!(origin("CAUSTIQUE_UNSET", ".deps/oidn", Path::new("/usr/lib/libfoo.so")), "system");
        assert_eq!(origin("PATH", ".deps/oidn", &library), "PATH");
    }
}
