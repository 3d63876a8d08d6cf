//! Files with several scenes, animations and material variants: the user chooses one.

use super::glb::Glb;
use super::message;
use caustique::scene::Description;
use caustique::scene::description::AnimationContents;
use caustique::scene::gltf::{FrameTime, Pose, ReadOptions, read_bytes};
use serde_json::json;
use std::path::Path;

/// Two scenes with a cube each; in the first, two animations move the cube, which has two variants.
fn file() -> Glb {
    let mut file = Glb::new();
    let [plain, red, blue] = ["plain", "red", "blue"].map(|name| file.push("materials", json!({"name": name})));
    let mesh = file.cube("cube", Some(plain));
    file.json["extensions"] =
        json!({"KHR_materials_variants": {"variants": [{"name": "red"}, {"name": "blue"}, {"name": "none"}]}});
    file.json["meshes"][mesh]["primitives"][0]["extensions"] = json!({"KHR_materials_variants": {"mappings": [
        {"material": red, "variants": [0]}, {"material": blue, "variants": [1]}]}});
    let node = file.node(json!({"name": "first", "mesh": mesh}));
    let other = file.push("nodes", json!({"name": "second", "mesh": mesh}));
    file.json["scenes"][0]["name"] = json!("one");
    file.push("scenes", json!({"nodes": [other]}));
    let times = file.floats(&[[0.5], [1.5]]);
    (file.json["accessors"][times]["min"], file.json["accessors"][times]["max"]) = (json!([0.5]), json!([1.5]));
    for (name, x) in [("walk", 1.0), ("jump", 2.0)] {
        let output = file.floats(&[[x, 0.0, 0.0], [x, 0.0, 0.0]]);
        file.push(
            "animations",
            json!({"name": name, "samplers": [{"input": times, "output": output}],
            "channels": [{"sampler": 0, "target": {"node": node, "path": "translation"}}]}),
        );
    }
    file
}

fn read(file: &Glb, options: &ReadOptions) -> Description {
    read_bytes(&file.bytes(), Path::new("a.glb"), options).unwrap_or_else(|e| panic!("{e}"))
}

fn some(name: &str) -> Option<String> {
    Some(name.into())
}

#[test]
fn a_scene_is_chosen_by_its_name_or_its_number() {
    for (scene, object) in [(None, "first"), (some("one"), "first"), (some("1"), "second")] {
        let read = read(&file(), &ReadOptions { scene: scene.clone(), ..ReadOptions::default() });
        assert_eq!(read.objects, [object], "{scene:?}");
    }
}

#[test]
fn an_animation_is_chosen_and_the_rest_pose_has_none() {
    let rest = ReadOptions { pose: Pose::Rest, ..ReadOptions::default() };
    let only = |name| ReadOptions { animation: some(name), ..ReadOptions::default() };
    for (options, x) in [(ReadOptions::default(), 1.0), (only("walk"), 1.0), (only("jump"), 2.0), (rest, 0.0)] {
        let read = read(&file(), &options);
        assert_eq!(read.instances[0].to_world.translation.x, x, "{options:?}");
        let clash = read.warnings.iter().any(|warning| warning.contains("--animation"));
        assert_eq!(clash, options == ReadOptions::default(), "{:?}", read.warnings);
    }
}

#[test]
fn a_variant_replaces_materials() {
    for (variant, material) in [(None, "plain"), (some("red"), "red"), (some("blue"), "blue"), (some("none"), "plain")]
    {
        let read = read(&file(), &ReadOptions { variant: variant.clone(), ..ReadOptions::default() });
        let names: Vec<&str> = read.materials.iter().map(|material| material.name.as_str()).collect();
        assert_eq!(names, [material], "{variant:?}");
    }
}

#[test]
fn unknown_names_are_errors_that_list_the_known_ones() {
    let default = ReadOptions::default;
    for (options, text) in [
        (
            ReadOptions { scene: some("x"), ..default() },
            "a.glb: there is no scene \"x\"\nhint: the file has \"one\", \"1\"",
        ),
        (
            ReadOptions { animation: some("x"), ..default() },
            "a.glb: there is no animation \"x\"\nhint: the file has \"walk\", \"jump\"",
        ),
        (
            ReadOptions { variant: some("x"), ..default() },
            "a.glb: there is no variant \"x\"\nhint: the file has \"red\", \"blue\", \"none\"",
        ),
    ] {
        let error = message(&read_bytes(&file().bytes(), Path::new("a.glb"), &options).unwrap_err());
        assert_eq!(error, text);
    }
}

#[test]
fn the_contents_of_a_file_are_listed() {
    let mut file = file();
    file.json["extensionsUsed"] = json!(["EXT_unknown"]);
    let contents = read(&file, &ReadOptions { scene: some("1"), ..ReadOptions::default() }).contents;
    assert_eq!((contents.scenes, contents.scene), (vec!["one".into(), "1".into()], Some(1)));
    let animation = |name: &str| AnimationContents { name: name.into(), seconds: Some([0.5, 1.5]) };
    assert_eq!(contents.animations, ["walk", "jump"].map(animation));
    assert_eq!(contents.variants, ["red", "blue", "none"]);
    let extensions: Vec<_> = contents.extensions.iter().map(|e| (e.name.as_str(), e.is_read)).collect();
    assert_eq!(extensions, [("EXT_unknown", false), ("KHR_materials_variants", true)]);
}

/// Animations that make a scene invalid are left out of a still picture, with a warning; a frame is an error.
#[test]
fn a_fault_in_an_animation_never_refuses_a_still_picture() {
    let mut file = file();
    let (times, huge) = (file.floats(&[[0.0]]), file.floats(&[[f32::MAX, 0.0, 0.0]]));
    file.json["animations"] = json!([{"samplers": [{"input": times, "output": huge}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}]);
    let still = read(&file, &ReadOptions::default());
    assert_eq!(still.instances[0].to_world.translation.x, 0.0);
    let start = "its animations are ignored, because with them it cannot be read: ";
    assert!(still.warnings[0].starts_with(start), "{:?}", still.warnings);
    let frame = Some(FrameTime { number: 1, rate: Some(24.0), of_sequence: false });
    let options = ReadOptions { frame, ..ReadOptions::default() };
    read_bytes(&file.bytes(), Path::new("a.glb"), &options).expect_err("the frame is invalid");
}
