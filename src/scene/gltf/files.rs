//! Lists and hashes the files that a scene file names, used or not.

use super::container;
use super::uri;
use crate::error::{Error, Result};
use crate::scene::folder::Folder;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Hash of the scene file at `scene` and of the existing files that it names. Files outside the scene's folder are
/// skipped unless `allow_outside`.
///
/// # Errors
/// The scene file cannot be read.
pub fn hash(scene: &Path, allow_outside: bool) -> Result<String> {
    let bytes = std::fs::read(scene).map_err(|cause| Error::io(scene, &cause))?;
    let mut hasher = blake3::Hasher::new();
    hasher.update(&bytes);
    let named = files(&bytes, scene, allow_outside);
    for bytes in named.iter().filter(|path| path.is_file()).filter_map(|path| std::fs::read(path).ok()) {
        hasher.update(&bytes);
    }
    Ok(hasher.finalize().to_hex().to_string())
}

/// Paths of the files that a scene file with these bytes names, existing or not. Files outside the scene's folder are
/// skipped unless `allow_outside`. Empty if the bytes are not glTF.
pub fn files(bytes: &[u8], scene: &Path, allow_outside: bool) -> Vec<PathBuf> {
    let mut found = Vec::new();
    if let Ok((json, _)) = container::split(bytes) {
        collect(&json, Folder::of(scene, allow_outside), &mut found);
    }
    found
}

/// Adds the paths of the files that the JSON names to `found`: `uri` of buffers and images, `file` of an environment.
fn collect(json: &Value, folder: Folder, found: &mut Vec<PathBuf>) {
    match json {
        Value::Array(values) => values.iter().for_each(|value| collect(value, folder, found)),
        Value::Object(object) => {
            for (key, value) in object {
                match (key.as_str(), value.as_str().filter(|text| !text.starts_with("data:"))) {
                    ("uri", Some(name)) => found.extend(uri::path_of(name, folder).ok()),
                    ("file", Some(name)) => found.extend(folder.file(name.as_ref()).ok()),
                    _ => collect(value, folder, found),
                }
            }
        }
        _ => {}
    }
}
