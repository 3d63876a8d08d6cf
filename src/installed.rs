//! Finds the libraries of a package, and the libraries (in `.deps`) and Pythons (in `.venv-*`) that `scripts/setup.sh`
//! has installed.
//!
//! A package holds its libraries in `lib/caustique`, beside the program's folder or in the Python package. What
//! `scripts/setup.sh` installs is in the folder named by the environment variable [`HOME_VARIABLE`], or else in a folder above the program or
//! the Python package. The current folder is never searched: it may hold files of other users, and what is found is
//! run.

use std::path::{Path, PathBuf};

use caustique_library::Folders;
pub use caustique_library::path_from_env;

use crate::system;

/// Environment variable that names the project's folder, the parent of `scripts`. If set, no other folder is searched.
pub const HOME_VARIABLE: &str = "CAUSTIQUE_HOME";

/// Folder of a package's libraries, relative to the folder of the program or of the Python module, or to the folder
/// above it.
const PACKAGE: &str = "lib/caustique";

/// Name of the program, on Windows without `.exe`.
const PROGRAM: &str = "caustique";

/// The paths to try for something installed at `relative` in the project's folder, nearest folder first.
pub fn candidates(relative: &str) -> Vec<PathBuf> {
    project_folders().iter().map(|home| home.join(relative)).collect()
}

/// The first of the [`candidates`] that exists; `None` if none does.
pub fn find(relative: &str) -> Option<PathBuf> {
    candidates(relative).into_iter().find(|path| path.exists())
}

/// The folders to search for a library besides the system's: the package that holds this code first, and `relative` in
/// the project's folder last.
pub fn folders(relative: &str) -> Folders {
    Folders { first: package_folders(), last: candidates(relative) }
}

/// The origin of the library or Python at `path`, for messages: the name of the environment `variable` if it is set,
/// `package` if the path is in the package that holds this code, `scripts/setup.sh` if it is below `relative` in a
/// project folder, or `system`.
pub fn origin(variable: &'static str, relative: &str, path: &Path) -> &'static str {
    let below = |place: &PathBuf| path.starts_with(place) || place.canonicalize().is_ok_and(|it| path.starts_with(it));
    if path_from_env(variable).is_some() {
        variable
    } else if package_folders().iter().any(below) {
        "package"
    } else if candidates(relative).iter().any(below) {
        "scripts/setup.sh"
    } else {
        "system"
    }
}

/// The folders that hold the libraries if this code is in a package.
fn package_folders() -> Vec<PathBuf> {
    own_file().map(|own| packages_of(&own)).unwrap_or_default()
}

/// Where the libraries are if `file` is the program or the module of a package.
fn packages_of(file: &Path) -> Vec<PathBuf> {
    file.ancestors()
        .skip(1)
        .take(2)
        .filter(|folder| !system::is_shared(folder))
        .map(|folder| folder.join(PACKAGE))
        .collect()
}

/// The program of the command line: the file with this code, or the program in the Python package that holds the module
/// with this code; `None` if a program of another name uses the library.
pub fn program() -> Option<PathBuf> {
    own_file().and_then(|own| program_of(&own))
}

fn program_of(file: &Path) -> Option<PathBuf> {
    if file.file_stem()? == PROGRAM {
        return Some(file.to_owned());
    }
    let packaged = file.with_file_name("bin").join(PROGRAM).with_extension(std::env::consts::EXE_EXTENSION);
    packaged.is_file().then_some(packaged)
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
    file.ancestors().skip(1).filter(|folder| !system::is_shared(folder)).map(Path::to_path_buf).collect()
}

/// The file that contains this code: the program or the Python module.
fn own_file() -> Option<PathBuf> {
    let address = own_file as fn() -> Option<PathBuf> as usize;
    system::file_with_code(address).or_else(|| std::env::current_exe().ok())
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
        assert_eq!(packages_of(&own.join("program")), [own.join(PACKAGE)]);
    }

    #[test]
    fn a_package_holds_its_libraries_beside_the_folder_of_the_program_or_with_the_module() {
        let expected = ["/opt/caustique/bin/lib/caustique", "/opt/caustique/lib/caustique"].map(PathBuf::from);
        assert_eq!(packages_of(Path::new("/opt/caustique/bin/caustique")), expected);
        let module = packages_of(Path::new("/site-packages/caustique/_native.abi3.so"));
        assert_eq!(module[0], Path::new("/site-packages/caustique/lib/caustique"));
    }

    #[test]
    fn the_program_is_the_command_line_or_beside_the_module() {
        let folder = tempfile::tempdir().unwrap();
        let [module, program] = ["_native.abi3.so", "bin/caustique"].map(|name| folder.path().join(name));
        assert_eq!(program_of(&program), Some(program.clone()));
        assert_eq!(program_of(&module), None);
        std::fs::create_dir(folder.path().join("bin")).unwrap();
        std::fs::write(&program, "").unwrap();
        assert_eq!(program_of(&module), Some(program));
    }

    #[test]
    fn an_origin_is_a_variable_the_folder_or_the_system() {
        let library = candidates(".deps/oidn").remove(0).join("lib/libOpenImageDenoise.so");
        assert_eq!(origin("CAUSTIQUE_UNSET", ".deps/oidn", &library), "scripts/setup.sh");
        let packaged = package_folders().remove(0).join("libOpenImageDenoise.so.2.5.1");
        assert_eq!(origin("CAUSTIQUE_UNSET", ".deps/oidn", &packaged), "package");
        assert_eq!(origin("CAUSTIQUE_UNSET", ".deps/oidn", Path::new("/usr/lib/libfoo.so")), "system");
        assert_eq!(origin("PATH", ".deps/oidn", &library), "PATH");
    }
}
