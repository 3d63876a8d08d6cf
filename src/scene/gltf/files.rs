//! Lists and hashes the files that a scene file names, used or not.

use super::container;
use super::uri;
use crate::error::{Error, Result};
use crate::scene::folder::Folder;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Hash of the scene file at `scene` and of the files that it names, each with its length, or as missing. Files outside
/// the scene's folder are skipped unless `allow_outside`.
///
/// # Errors
/// The scene file cannot be read.
pub fn hash(scene: &Path, allow_outside: bool) -> Result<String> {
    let bytes = std::fs::read(scene).map_err(|cause| Error::io(scene, &cause))?;
    let mut hasher = blake3::Hasher::new();
    let mut add = |bytes: Option<&[u8]>| {
        // Without the lengths, bytes that move from one file to the next would not change the hash.
        hasher.update(&bytes.map_or(u64::MAX, |bytes| bytes.len() as u64).to_le_bytes());
        hasher.update(bytes.unwrap_or_default());
    };
    add(Some(&bytes));
    for path in files(&bytes, scene, allow_outside) {
        let file = path.is_file().then(|| std::fs::read(path).ok()).flatten();
        add(file.as_deref());
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
pub(super) fn collect(json: &Value, folder: Folder, found: &mut Vec<PathBuf>) {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The hash changes when bytes move between two files, when a file is emptied, and when it is removed.
    #[test]
    fn the_hash_of_a_scene_tells_where_a_file_ends() {
        let temporary = tempfile::tempdir().expect("a folder");
        let at = |name: &str| temporary.path().join(name);
        let scene = r#"{"buffers": [{"uri": "a.bin"}, {"uri": "b.bin"}]}"#;
        std::fs::write(at("a.gltf"), scene).expect("it can be written");
        let cases = [("ab", Some("cd")), ("abc", Some("d")), ("abcd", Some("")), ("abcd", None), ("", Some("abcd"))];
        let hashes = cases.map(|(a, b)| {
            std::fs::write(at("a.bin"), a).expect("it can be written");
            match b {
                Some(b) => std::fs::write(at("b.bin"), b).expect("it can be written"),
                None => std::fs::remove_file(at("b.bin")).expect("it is there"),
            }
            hash(&at("a.gltf"), false).expect("it can be read")
        });
        let different: std::collections::BTreeSet<&String> = hashes.iter().collect();
        assert_eq!(different.len(), cases.len());
    }
}
