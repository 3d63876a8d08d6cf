//! Errors for libraries that are missing or are not Embree.

use std::path::Path;

use caustique_embree::{Error, Library};

fn unusable(path: impl AsRef<Path>) -> (String, String) {
    let path = path.as_ref();
    let error = Library::load_from(path).unwrap_err();
    assert!(matches!(&error, Error::Unusable { .. }), "{error:?}");
    let text = error.to_string();
    let hint = error.hint().unwrap();
    assert!(hint.contains("Debian 12, Ubuntu 22.04: apt install libembree3-3"), "{hint}");
    assert!(hint.contains("Debian 13, Ubuntu 24.04: apt install libembree4-4"), "{hint}");
    (text, hint)
}

#[test]
fn file_that_is_not_there() {
    let (text, hint) = unusable("/nowhere/libembree4.so.4");
    assert!(text.starts_with("/nowhere/libembree4.so.4: "), "{text}");
    assert_eq!(text.matches("/nowhere").count(), 1, "{text}");
    assert!(hint.contains("CAUSTIQUE_EMBREE"), "{hint}");
}

#[test]
fn file_that_is_no_library() {
    let (text, _) = unusable(Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml"));
    assert!(text.contains("Cargo.toml: "), "{text}");
}

#[cfg(target_os = "linux")]
#[test]
fn library_that_is_not_embree() {
    let (text, _) = unusable("libm.so.6");
    assert!(text.starts_with("libm.so.6: not Embree 3 or 4 ("), "{text}");
    assert!(text.contains("rtc"), "{text}");
}
