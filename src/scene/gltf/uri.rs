//! Loads buffers and images from data URIs (RFC 2397) and files (RFC 3986).

use super::fault;
use crate::error::{Error, ErrorKind, Result};
use crate::git_lfs;
use crate::scene::folder::Folder;
use std::path::PathBuf;

/// The bytes that `uri` names, in itself or in a file; relative paths start at `folder`. `reserve` is called with the
/// size of a file (bytes) before it is read.
pub(super) fn load(uri: &str, folder: Folder, reserve: impl FnOnce(u64) -> Result<()>) -> Result<Vec<u8>> {
    if let Some(data) = uri.strip_prefix("data:") {
        let Some((head, body)) = data.split_once(',') else {
            return Err(fault("", "its data URI has no comma").hint("export the scene again"));
        };
        return if head.ends_with(";base64") {
            base64(body).ok_or_else(|| fault("", "its data URI is not valid base64").hint("export the scene again"))
        } else {
            Ok(percent_decode(body))
        };
    }
    let path = path_of(uri, folder)?;
    let cause = |e: std::io::Error| {
        let (path, cause) = (path.display(), e);
        Error::new(ErrorKind::Io, "", format!("the file {path} cannot be read: {cause}"))
            .hint("put the file there, or export as .glb, which holds buffers and textures itself")
    };
    // Reading a device or a pipe may never end.
    let meta = std::fs::metadata(&path).map_err(cause)?;
    if !meta.is_file() {
        return Err(cause(std::io::Error::other("it is not a regular file")));
    }
    reserve(meta.len())?;
    let bytes = std::fs::read(&path).map_err(cause)?;
    git_lfs::check(&bytes, path.display())?;
    Ok(bytes)
}

/// The path of the file that a URI names.
pub(super) fn path_of(uri: &str, folder: Folder) -> Result<PathBuf> {
    let path = match uri.strip_prefix("file://") {
        Some(path) => path,
        None => require_no_scheme(uri)?,
    };
    let path = String::from_utf8(percent_decode(path)).map_err(|_| fault("", "its URI is not valid UTF-8"))?;
    folder.file(path.as_ref())
}

/// Rejects a name with a URI scheme.
///
/// # Errors
/// The name has a scheme.
fn require_no_scheme(name: &str) -> Result<&str> {
    match name.split_once(':') {
        // A single letter is a drive.
        Some((s, _)) if s.len() > 1 && s.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c)) => {
            let error = fault("", format!("a URI of scheme \"{s}\" cannot be read"));
            Err(error.hint("save what it names beside the scene file"))
        }
        _ => Ok(name),
    }
}

/// Rejects a path that is a URI. Colons alone are valid in paths.
///
/// # Errors
/// The path is a URI.
pub(super) fn require_path(path: &str) -> Result<&str> {
    if path.contains("://") { require_no_scheme(path) } else { Ok(path) }
}

/// Decodes `%41` to `A`; a percent sign without two hexadecimal digits stays.
fn percent_decode(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let digit = |i: usize| bytes.get(i).and_then(|b| char::from(*b).to_digit(16));
    let (mut out, mut i) = (Vec::with_capacity(bytes.len()), 0);
    while i < bytes.len() {
        match (bytes[i], digit(i + 1), digit(i + 2)) {
            (b'%', Some(high), Some(low)) => {
                out.push((high * 16 + low) as u8);
                i += 3;
            }
            (byte, ..) => {
                out.push(byte);
                i += 1;
            }
        }
    }
    out
}

/// Decodes base64 with the standard alphabet of RFC 4648, with or without padding; `None` if the text is not base64.
fn base64(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0u32, 0);
    for byte in text.trim_end_matches('=').bytes() {
        let value = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        held += 6;
        if held >= 8 {
            held -= 8;
            out.push((bits >> held) as u8);
        }
    }
    // Six remaining bits are an incomplete byte.
    (held < 6).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn base64_decodes_the_examples_of_the_rfc() {
        for (text, bytes) in [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9vYmE", "fooba"), ("Zm9vYmFy", "foobar")] {
            assert_eq!(base64(text).as_deref(), Some(bytes.as_bytes()));
        }
        assert_eq!(base64("Zm9v*mFy"), None);
        assert_eq!(base64("Zm9vY"), None);
        assert_eq!(base64("+/+/"), Some(vec![0xfb, 0xff, 0xbf]));
    }

    #[test]
    fn paths_are_percent_decoded() {
        let folder = Folder::of(Path::new("/scenes/a.gltf"), true);
        let at = |uri: &str| path_of(uri, folder).map(|p| p.display().to_string());
        assert_eq!(at("a%20b/c.bin").unwrap(), "/scenes/a b/c.bin");
        assert_eq!(at("100%.bin").unwrap(), "/scenes/100%.bin");
        assert_eq!(at("file:///x/y.bin").unwrap(), "/x/y.bin");
        assert!(at("https://example.org/a.bin").unwrap_err().cause.contains("scheme \"https\""));
        assert!(at("%ff%fe").is_err());
    }
}
