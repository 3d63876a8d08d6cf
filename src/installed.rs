//! Finds the libraries (in `.deps`) and Pythons (in `.venv-*`) that `scripts/setup.sh` has installed.
//!
//! They are in the folder named by the environment variable [`HOME_VARIABLE`], or else in a folder above the program or
//! the Python package. The current folder is never searched: it may hold files of other users, and what is found is
//! run.

use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

pub use caustique_library::path_from_env;

/// Environment variable that names the project's folder, the parent of `scripts`. If set, no other folder is searched.
pub const HOME_VARIABLE: &str = "CAUSTIQUE_HOME";

/// Mode bit of folders where everybody may create files, such as `/tmp`.
const STICKY_BIT: u32 = 0o1000;

/// The paths to try for something installed at `relative` in the project's folder, nearest folder first.
pub fn candidates(relative: &str) -> Vec<PathBuf> {
    project_folders().iter().map(|home| home.join(relative)).collect()
}

/// The first of the [`candidates`] that exists; `None` if none does.
pub fn find(relative: &str) -> Option<PathBuf> {
    candidates(relative).into_iter().find(|path| path.exists())
}

/// The origin of the library or Python at `path`, for messages: the name of the environment `variable` if it is set,
/// `scripts/setup.sh` if the path is below `relative` in a project folder, or `system`.
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

/// The folders that may be the project's, nearest first.
fn project_folders() -> Vec<PathBuf> {
    match path_from_env(HOME_VARIABLE) {
        Some(home) => std::path::absolute(home).into_iter().collect(),
        None => own_file().map(|own| folders_above(&own)).unwrap_or_default(),
    }
}

/// The folders above `file`, nearest first, except folders where everybody may create files.
fn folders_above(file: &Path) -> Vec<PathBuf> {
    let shared = |folder: &&Path| folder.metadata().is_ok_and(|data| data.mode() & STICKY_BIT != 0);
    file.ancestors().skip(1).filter(|folder| !shared(folder)).map(Path::to_path_buf).collect()
}

/// The file that contains this code: the program or the Python module.
fn own_file() -> Option<PathBuf> {
    let address = own_file as fn() -> Option<PathBuf> as usize;
    let path_if_mapped = |line: &str| {
        let (from, to) = line.split_whitespace().next()?.split_once('-')?;
        let [from, to] = [from, to].map(|digits| usize::from_str_radix(digits, 16).unwrap_or(0));
        (from..to).contains(&address).then(|| line.find('/').map(|at| PathBuf::from(&line[at..])))?
    };
    let mapped = std::fs::read_to_string("/proc/self/maps").unwrap_or_default();
    mapped.lines().find_map(path_if_mapped).or_else(|| std::env::current_exe().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_of_this_code_is_the_test_program() {
        assert_eq!(own_file(), std::env::current_exe().ok());
    }

    #[test]
    fn folders_that_everybody_can_write_are_not_searched() {
        let shared = tempfile::tempdir().unwrap();
        let own = shared.path().join("own");
        std::fs::create_dir(&own).unwrap();
        std::fs::set_permissions(shared.path(), std::os::unix::fs::PermissionsExt::from_mode(0o1777)).unwrap();
        let found = folders_above(&own.join("program"));
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
