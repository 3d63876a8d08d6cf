//! Valid files with unusual notation, and still pictures of files with invalid animations.

use super::everything::everything;
use super::glb::Glb;
use super::{message, read, try_read};
use caustique::scene::gltf::{FrameTime, ReadOptions, read_bytes};
use serde_json::{Value, json};
use std::path::Path;

fn triangle() -> Glb {
    let mut file = Glb::new();
    let mesh = file.mesh("", &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[0, 1, 2], None);
    file.node(json!({"mesh": mesh}));
    file
}

/// Writes every integer with a fraction of zero.
fn with_fractions(value: &mut Value) {
    match value {
        Value::Array(list) => list.iter_mut().for_each(with_fractions),
        Value::Object(object) => object.values_mut().for_each(with_fractions),
        Value::Number(number) => *value = number.as_f64().into(),
        _ => {}
    }
}

/// Section 2.7 of the specification: 4, 4.0 and 4e0 are the same number.
#[test]
fn integers_may_have_a_fraction_of_zero() {
    let file = everything();
    let mut fractions = file.clone();
    with_fractions(&mut fractions.json);
    assert!(fractions.json.to_string().contains("\"count\":8.0"));
    let mut plain = Vec::new();
    for frame in [None, Some(FrameTime { number: 12, rate: None, of_sequence: false })] {
        let options = ReadOptions { frame, ..ReadOptions::default() };
        let described =
            |file: &Glb| format!("{:?}", read_bytes(&file.bytes(), Path::new("pool.glb"), &options).unwrap());
        plain.push(described(&file));
        assert!(described(&file) == described(&fractions));
    }
    assert!(plain[0] != plain[1]);
    fractions.json["accessors"][0]["count"] = json!(7.5);
    let error = message(&try_read(&fractions).unwrap_err());
    assert!(error.starts_with("pool.glb: accessors[0]: invalid type: floating point `7.5`"), "{error}");
}

/// Numbers other than indices may be larger than an index.
#[test]
fn lengths_may_be_large_integers() {
    let mut file = triangle();
    file.json["cameras"] =
        json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 1, "zfar": 10_000_000_000u64}}]);
    file.node(json!({"camera": 0, "translation": [0, 0, 5_000_000_000u64]}));
    assert_eq!(read(&file).cameras[0].to_world.translation.z, 5e9);
}

/// An invalid animation is ignored for a still picture, and an error for a frame.
#[test]
fn faults_of_animations_do_not_refuse_still_pictures() {
    let faults = [
        ("/animations/0", json!(7), "animation 0: invalid type: integer `7`"),
        ("/animations/0/channels/0/sampler", json!(9), "animation \"act\", channel 0: sampler 9 does not exist"),
        ("/animations/0/channels/1/target/node", json!(99), "animation \"act\", channel 1: node 99 does not exist"),
        ("/animations/0/samplers/0/input", json!(99), "animation \"act\", channel 0: sampler 0: input: accessor 99"),
        ("/animations/0/channels/1/sampler", json!(0), "animation \"act\", channel 1: sampler 0: its values have 1"),
        (
            "/animations/0/channels/2/target/extensions/KHR_animation_pointer/pointer",
            json!("/materials/9/alphaCutoff"),
            "animation \"act\", channel 2: it moves /materials/9/alphaCutoff, which does not exist",
        ),
    ];
    for (pointer, value, fault) in faults {
        let mut file = everything();
        *file.json.pointer_mut(pointer).unwrap() = value;
        let warnings = read(&file).warnings;
        let names_fault = |warning: &String| warning.starts_with(fault) && warning.contains("; it is ignored (");
        assert!(warnings.iter().any(names_fault), "{fault}: {warnings:?}");
        let frame = Some(FrameTime { number: 12, rate: None, of_sequence: false });
        let options = ReadOptions { frame, ..ReadOptions::default() };
        let error = read_bytes(&file.bytes(), Path::new("pool.glb"), &options).unwrap_err();
        assert!(message(&error).starts_with(&format!("pool.glb: {fault}")), "{error}");
    }
}

/// An extension for compressed data may be ignored only if uncompressed data exists, too.
#[test]
fn compressed_data_without_a_substitute_is_refused() {
    let mut file = triangle();
    let draco = json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}});
    file.json["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
    file.json["meshes"][0]["primitives"][0]["extensions"] = draco;
    assert_eq!(read(&file).instances.len(), 1);
    file.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    let error = message(&try_read(&file).unwrap_err());
    let place = "pool.glb: mesh 0, primitive 0, KHR_draco_mesh_compression: its data cannot be decoded: ";
    assert!(error.starts_with(place), "{error}");
    file.json["meshes"][0]["primitives"][0]["extensions"] = json!({"EXT_new_compression": {}});
    let error = message(&try_read(&file).unwrap_err());
    let cause = "all its data is compressed by extension \"EXT_new_compression\", which is not supported";
    assert!(error.starts_with(&format!("pool.glb: mesh 0, primitive 0: {cause}")), "{error}");
    let mut file = triangle();
    file.push("buffers", json!({"byteLength": 64, "extensions": {"EXT_meshopt_compression": {"fallback": true}}}));
    // The place of decoded data has no data of its own.
    assert_eq!(read(&file).instances.len(), 1);
}
