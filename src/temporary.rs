//! Temporary folders.

use crate::error::{Error, Result};
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use tempfile::TempDir;

/// A folder of its own among the temporary files, gone when it is dropped, whose name begins with `prefix`. Nobody else
/// can look into it, whatever the umask is: files of other people's scenes lie there, and programs that are run.
///
/// # Errors
/// The file system.
pub fn create_folder(prefix: &str) -> Result<TempDir> {
    let folder = tempfile::Builder::new().prefix(prefix).permissions(Permissions::from_mode(0o700)).tempdir();
    folder.map_err(|cause| Error::io(&std::env::temp_dir(), &cause))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_else_looks_into_a_temporary_folder() {
        let folder = create_folder("caustique-test-").expect("a folder");
        let mode = std::fs::metadata(folder.path()).expect("it is there").permissions().mode();
        assert_eq!(mode & 0o777, 0o700);
    }
}
