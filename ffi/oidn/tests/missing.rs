//! Errors for libraries that are missing or are not Open Image Denoise.

use std::path::Path;

use caustique_oidn::{Error, Library};

fn unusable(path: impl AsRef<Path>) -> String {
    let path = path.as_ref();
    let error = Library::load_from(path).unwrap_err();
    assert!(matches!(&error, Error::Unusable { .. }), "{error:?}");
    let hint = "run scripts/setup.sh, or set CAUSTIQUE_OIDN to libOpenImageDenoise.so";
    assert_eq!(error.hint().as_deref(), Some(hint));
    error.to_string()
}

#[test]
fn file_that_is_not_there() {
    let text = unusable("/nowhere/libOpenImageDenoise.so.2");
    assert!(text.starts_with("/nowhere/libOpenImageDenoise.so.2: "), "{text}");
    assert_eq!(text.matches("/nowhere").count(), 1, "{text}");
}

#[test]
fn file_that_is_no_library() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
    let text = unusable(&path);
    assert!(text.starts_with(&format!("{}: ", path.display())), "{text}");
}

#[cfg(target_os = "linux")]
#[test]
fn library_that_is_another() {
    let text = unusable("libm.so.6");
    assert!(text.starts_with("libm.so.6: not Open Image Denoise 2 ("), "{text}");
    assert!(text.contains("oidn"), "{text}");
}
