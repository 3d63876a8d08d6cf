//! Every reader of files recognises pointers of Git LFS, which stand for files that were not fetched.

use crate::gltf::glb::Glb;
use caustique::combine::Model;
use caustique::error::{Error, Result};
use caustique::image::exr;
use caustique::pipeline::checkpoint;
use caustique::scene::gltf::{ReadOptions, read};
use caustique::scene::{environment_file, grid_file};
use serde_json::json;
use std::fs;
use std::path::Path;

const POINTER: &str = "version https://git-lfs.github.com/spec/v1\n\
    oid sha256:4d7a214614ab2935c943f9e0ff69d22eadbb8f32b1258daaa5e2ca24d17e2393\nsize 5555\n";

fn refused<T>(what: &str, outcome: Result<T>) -> (&str, Error) {
    (what, outcome.err().unwrap_or_else(|| panic!("{what}: it is refused")))
}

/// A scene in `folder` that a change makes name the pointer `file`.
fn scene(folder: &Path, file: &str, change: impl FnOnce(&mut Glb)) -> Result<caustique::scene::Description> {
    fs::write(folder.join(file), POINTER).expect("it can be written");
    let mut glb = Glb::new();
    let uv = glb.floats(&[[0.0f32, 0.0]; 8]);
    let mesh = glb.cube("cube", None);
    glb.json["meshes"][mesh]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uv);
    glb.node(json!({"mesh": mesh}));
    change(&mut glb);
    let path = folder.join("scene.glb");
    fs::write(&path, glb.bytes()).expect("it can be written");
    read(&path, &ReadOptions::default())
}

#[test]
fn pointers_of_git_lfs_are_recognised() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let pointer = folder.join("pointer");
    fs::write(&pointer, POINTER).expect("it can be written");
    let lamp = |glb: &mut Glb, extras| {
        glb.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
        glb.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point", "extras": extras}]}});
        glb.node(json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
    };
    let worn = |glb: &mut Glb, material: serde_json::Value| {
        let material = glb.push("materials", material);
        glb.json["meshes"][0]["primitives"][0]["material"] = json!(material);
    };
    let buffer = scene(folder, "a.bin", |glb| {
        let buffer = glb.push("buffers", json!({"uri": "a.bin", "byteLength": 96}));
        for view in glb.json["bufferViews"].as_array_mut().expect("views") {
            view["buffer"] = json!(buffer);
        }
    });
    let texture = scene(folder, "a.png", |glb| {
        glb.push("images", json!({"uri": "a.png"}));
        glb.push("textures", json!({"source": 0}));
        worn(glb, json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    });
    let profile = scene(folder, "a.ies", |glb| lamp(glb, json!({"caustique": {"ies": {"file": "a.ies"}}})));
    let cases = [
        refused("a scene", read(&pointer, &ReadOptions::default())),
        refused("a buffer", buffer),
        refused("a texture", texture),
        refused("a profile", profile),
        refused("an environment", environment_file::read(&pointer, &mut Vec::new())),
        refused("a grid", grid_file::read(&pointer, &mut Vec::new())),
        refused("a picture", exr::read(&pointer)),
        refused("a network", Model::from_file(&pointer)),
        refused("a checkpoint", checkpoint::read(&pointer)),
    ];
    for (what, error) in cases {
        assert!(error.cause.contains("a pointer of Git LFS"), "{what}: {error}");
        assert!(error.hint.as_ref().is_some_and(|hint| hint.contains("git lfs pull")), "{what}: {error}");
        assert!(error.place.contains(&folder.display().to_string()), "{what}: {error}");
    }
}
