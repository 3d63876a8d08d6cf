//! References to files outside of the scene's folder.

use super::glb::Glb;
use super::message;
use caustique::scene::gltf::{self, ReadOptions, read_bytes};
use serde_json::json;
use std::path::Path;

/// Reads a scene in `folder/scene` whose mesh, texture or sky is the file `name`.
fn reading(folder: &Path, part: &str, name: &str, allow_outside: bool) -> Result<(), String> {
    let mut file = Glb::new();
    let mesh = file.mesh("water", &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[0, 1, 2], None);
    file.node(json!({"mesh": mesh}));
    match part {
        "buffer" => file.json["buffers"][0]["uri"] = name.into(),
        "image" => {
            file.json["images"] = json!([{"uri": name}]);
            file.json["textures"] = json!([{"source": 0}]);
            file.json["materials"] = json!([{"emissiveTexture": {"index": 0}}]);
            file.json["meshes"][0]["primitives"][0]["material"] = 0.into();
        }
        _ => file.json["scenes"][0]["extras"] = json!({"caustique": {"environment": {"file": name}}}),
    }
    let options = ReadOptions { allow_outside, ..ReadOptions::default() };
    let read = read_bytes(&file.bytes(), &folder.join("scene/a.glb"), &options);
    read.map(drop).map_err(|error| message(&error).replace(&folder.display().to_string(), "DIR"))
}

/// References by a relative path upwards, an absolute path, a URI or a link are refused with the same message whether
/// or not the file exists, unless they are allowed.
#[test]
fn files_outside_the_folder_are_not_opened() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let inside = folder.join("scene/parts");
    std::fs::create_dir_all(&inside).expect("a folder");
    for (name, bytes) in [("a.bin", vec![0u8; 72]), ("a.png", png()), ("a.hdr", hdr())] {
        std::fs::write(inside.join(name), &bytes).expect("it can be written");
        std::fs::write(folder.join(name), &bytes).expect("it can be written");
    }
    std::os::unix::fs::symlink(folder, folder.join("scene/up")).expect("a link");
    // A folder whose name begins with that of the scene's folder.
    std::os::unix::fs::symlink(folder, folder.join("scene-2")).expect("a link");
    let root = folder.display().to_string();
    let places = [
        ("buffer", "a.bin", "buffer 0"),
        ("image", "a.png", "material 0, emissiveTexture: image 0"),
        ("environment", "a.hdr", "scene \"Scene\": environment"),
    ];
    for (part, file, place) in places {
        for name in [format!("parts/{file}"), format!("parts/../parts/{file}"), format!("{root}/scene/parts/{file}")] {
            assert_eq!(reading(folder, part, &name, false), Ok(()), "{part} {name}");
        }
        let absent = format!("../no-{file}");
        let mut names = vec![format!("../{file}"), format!("{root}/{file}"), format!("up/{file}"), absent.clone()];
        names.extend([format!("up/no-{file}"), format!("../scene-2/{file}"), format!("nowhere/../../{file}")]);
        names.extend([format!("C:\\{file}"), format!("c:/{file}"), format!("\\\\host\\{file}"), format!("..\\{file}")]);
        if part != "environment" {
            names.extend([format!("file://{root}/{file}"), format!("%2e%2e/{file}"), format!("%2E%2E%2F{file}")]);
            names.extend([format!("..%2f{file}"), format!("C:%5C{file}"), format!("up/%2e/{file}")]);
        }
        for name in names {
            let shown = [("%2e", "."), ("%2E", "."), ("%2f", "/"), ("%2F", "/"), ("%5C", "\\"), (&root, "DIR")]
                .iter()
                .fold(name.trim_start_matches("file://").to_owned(), |name, (code, letter)| name.replace(code, letter));
            let expected = format!(
                "DIR/scene/a.glb: {place}: the file {shown} is outside the scene's folder\n\
                 hint: put it beside the scene file and name it so, or allow such files with --allow-outside"
            );
            let error = reading(folder, part, &name, false).expect_err(&name);
            assert_eq!(error, expected, "{part} {name}");
            let of_windows = ["\\", "%5C", "c:"].iter().any(|part| name.contains(part));
            if name != absent && !name.contains("no-") && !name.starts_with("nowhere") && !of_windows {
                assert_eq!(reading(folder, part, &name, true), Ok(()), "{part} {name}");
            }
        }
    }
}

/// Names that are URLs, or that would be paths upwards if they were decoded twice, are refused.
#[test]
fn addresses_are_not_opened() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::create_dir(folder.join("scene")).expect("a folder");
    let root = folder.display();
    for (part, place) in [
        ("buffer", "buffer 0"),
        ("image", "material 0, emissiveTexture: image 0"),
        ("environment", "scene \"Scene\": environment"),
    ] {
        for (scheme, name) in [
            ("http", "http://example.org/a".to_owned()),
            ("https", "https://example.org/../a".to_owned()),
            ("ftp", "ftp://example.org/a".to_owned()),
            ("FILE", format!("FILE://{root}/a")),
        ] {
            let expected = format!(
                "DIR/scene/a.glb: {place}: a URI of scheme \"{scheme}\" cannot be read\n\
                 hint: save what it names beside the scene file"
            );
            assert_eq!(reading(folder, part, &name, true), Err(expected.clone()), "{part} {name}");
            assert_eq!(reading(folder, part, &name, false), Err(expected), "{part} {name}");
        }
        let error = reading(folder, part, "%252e%252e/a", false).expect_err("it is not there");
        assert!(error.contains("2e/a") && error.contains("No such file") && error.contains("hint: "), "{error}");
    }
}

/// The hash by which a checkpoint identifies its scene resolves names like the reader: decoded, and not outside of the
/// folder.
#[test]
fn hashes_are_of_the_files_in_the_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::create_dir(folder.join("scene")).expect("a folder");
    let scene = folder.join("scene/a.gltf");
    let document = json!({"buffers": [{"uri": "a%20b.bin"}, {"uri": "../c.bin"}]});
    std::fs::write(&scene, document.to_string()).expect("it can be written");
    let hash = |place: &str, bytes: &str, allow_outside: bool| {
        std::fs::write(folder.join(place), bytes).expect("it can be written");
        gltf::hash(&scene, allow_outside).expect("it can be read")
    };
    let first = hash("scene/a b.bin", "1", false);
    assert_ne!(hash("scene/a b.bin", "2", false), first);
    assert_eq!(hash("scene/a b.bin", "1", false), first);
    assert_eq!(hash("c.bin", "1", false), first);
    assert_ne!(hash("c.bin", "2", true), hash("c.bin", "1", true));
}

fn png() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(1, 1).write_to(&mut bytes, image::ImageFormat::Png).expect("a picture");
    bytes.into_inner()
}

fn hdr() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::Rgb32FImage::new(1, 1).write_to(&mut bytes, image::ImageFormat::Hdr).expect("a picture");
    bytes.into_inner()
}
