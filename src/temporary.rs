//! Temporary folders.

use crate::error::{Error, Result};
use crate::system;
use tempfile::TempDir;

/// Creates a temporary folder whose name begins with `prefix`. Dropping the result deletes it. Only the user has
/// access, independent of the umask, because it may hold files of a private scene and programs to run.
///
/// # Errors
/// The folder cannot be created.
pub fn create_folder(prefix: &str) -> Result<TempDir> {
    let mut builder = tempfile::Builder::new();
    if let Some(permissions) = system::private_permissions() {
        builder.permissions(permissions);
    }
    builder.prefix(prefix).tempdir().map_err(|cause| Error::io(&std::env::temp_dir(), &cause))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn only_the_user_has_access_to_a_temporary_folder() {
        let folder = create_folder("caustique-test-").expect("a folder");
        let mode = std::fs::metadata(folder.path()).expect("metadata").permissions().mode();
        assert_eq!(mode & 0o777, 0o700);
    }
}
