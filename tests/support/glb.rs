//! A small scene as a .glb file: a floor, an upright mirror on it, a point light, two cameras.

use serde_json::{Value, json};
use std::path::Path;

/// Writes the scene, with or without the lamp.
pub fn write(path: &Path, lamp: bool) {
    let extras = json!({"light_units": "radiometric"});
    std::fs::write(path, bytes(lamp.then_some(LAMP), &extras)).expect("the scene can be written");
}

/// Writes the scene with the lamp after a change of its document.
pub fn write_edited(path: &Path, edit: impl FnOnce(&mut Value)) {
    let (mut document, binary) = parts(Some(LAMP), &json!({"light_units": "radiometric"}));
    edit(&mut document);
    std::fs::write(path, chunks(&document, &binary)).expect("the scene can be written");
}

/// Writes the scene with a lamp just above the floor, so strong that its light there overflows f32.
pub fn write_blinding(path: &Path) {
    let extras = json!({"light_units": "radiometric"});
    std::fs::write(path, bytes(Some((1e37, 0.02)), &extras)).expect("the scene can be written");
}

/// Writes the scene with the lamp and fog.
pub fn write_foggy(path: &Path) {
    let medium = json!({"sigma_a": [0.02, 0.02, 0.02], "sigma_s": [0.1, 0.1, 0.1], "g": 0.3});
    let extras = json!({"light_units": "radiometric", "medium": medium});
    std::fs::write(path, bytes(Some(LAMP), &extras)).expect("the scene can be written");
}

/// Writes the scene without the lamp, under a sky from a file.
pub fn write_under(path: &Path, sky: &str) {
    std::fs::write(path, bytes(None, &json!({"environment": {"file": sky}}))).expect("the scene can be written");
}

/// Writes the scene with three lamps in three light groups.
pub fn write_grouped(path: &Path, groups: [&str; 3]) {
    let extras = json!({"light_units": "radiometric"});
    let (mut document, binary) = parts(Some(LAMP), &extras);
    for (i, group) in groups.into_iter().enumerate() {
        let mut lamp = document["nodes"][2].clone();
        lamp["translation"][0] = json!(i);
        lamp["extras"] = json!({"caustique": {"light_group": group}});
        document["nodes"].as_array_mut().expect("a list").push(lamp);
    }
    document["scenes"][0]["nodes"] = json!([0, 1, 3, 4, 5, 6, 7]);
    std::fs::write(path, chunks(&document, &binary)).expect("the scene can be written");
}

/// Writes `nodes` nodes, each of which places one triangle 2^16 times (EXT_mesh_gpu_instancing) with shared transforms.
pub fn write_copies(path: &Path, nodes: usize) {
    const COPIES: usize = 1 << 16;
    let mut binary: Vec<u8> =
        [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    binary.extend((0..3 * COPIES).flat_map(|i| (i as f32).to_le_bytes()));
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 1}}});
    let accessor =
        |view: u32, count: usize| json!({"bufferView": view, "componentType": 5126, "count": count, "type": "VEC3"});
    let document = json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["EXT_mesh_gpu_instancing"],
        "scene": 0,
        "scenes": [{"nodes": (0..nodes).collect::<Vec<usize>>()}],
        "nodes": vec![json!({"mesh": 0, "extensions": extension}); nodes],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "buffers": [{"byteLength": binary.len()}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12 * COPIES}],
        "accessors": [accessor(0, 3), accessor(1, COPIES)],
    });
    std::fs::write(path, chunks(&document, &binary)).expect("the scene can be written");
}

/// Intensity and height of the lamp.
const LAMP: (f64, f64) = (20.0, 3.0);

/// The bytes of the file.
fn bytes(lamp: Option<(f64, f64)>, extras: &Value) -> Vec<u8> {
    let (document, binary) = parts(lamp, extras);
    chunks(&document, &binary)
}

/// The document and its binary chunk. The floor is a quad that faces up, the mirror one that faces +Z.
fn parts(lamp: Option<(f64, f64)>, extras: &Value) -> (Value, Vec<u8>) {
    let (intensity, height) = lamp.unwrap_or(LAMP);
    let floor: [[f32; 3]; 4] = [[-5.0, 0.0, -5.0], [-5.0, 0.0, 5.0], [5.0, 0.0, 5.0], [5.0, 0.0, -5.0]];
    let mirror: [[f32; 3]; 4] = [[-1.0, 0.1, -1.5], [1.0, 0.1, -1.5], [1.0, 2.0, -1.5], [-1.0, 2.0, -1.5]];
    let mut binary = Vec::new();
    for quad in [floor, mirror] {
        binary.extend(quad.iter().flatten().flat_map(|x| x.to_le_bytes()));
    }
    binary.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    let positions = |view: u32, low: [f32; 3], high: [f32; 3]| json!({"bufferView": view, "componentType": 5126, "count": 4, "type": "VEC3", "min": low, "max": high});
    let mesh = |name: &str, positions: u32, material: u32| json!({"name": name, "primitives": [{"attributes": {"POSITION": positions}, "indices": 2, "material": material}]});
    // Cameras look along their local -Z. This rotation about X points them at the floor.
    let camera = |name: &str, x: f64| json!({"name": name, "camera": 0, "translation": [x, 3.5, 5.5], "rotation": [-0.27, 0.0, 0.0, 0.962_859_283_7]});
    let light = json!({"name": "Lamp", "type": "point", "intensity": intensity});
    let document = json!({
        "asset": {"version": "2.0", "generator": "the tests of caustique"},
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [light]}},
        "scene": 0,
        "scenes": [{"extras": {"caustique": extras}, "nodes": if lamp.is_some() { vec![0, 1, 2, 3, 4] } else { vec![0, 1, 3, 4] }}],
        "nodes": [
            {"name": "Floor", "mesh": 0},
            {"name": "Mirror", "mesh": 1},
            {"name": "Lamp", "translation": [0.5, height, 1.0], "extensions": {"KHR_lights_punctual": {"light": 0}}},
            camera("Camera", 0.0),
            camera("Side", 1.0),
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.9, "aspectRatio": 4.0 / 3.0, "znear": 0.1}}],
        "meshes": [mesh("floor", 0, 0), mesh("mirror", 1, 1)],
        "materials": [
            {"name": "stone", "pbrMetallicRoughness":
                {"baseColorFactor": [0.7, 0.6, 0.5, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0}},
            {"name": "silver", "pbrMetallicRoughness": {"metallicFactor": 1.0, "roughnessFactor": 0.0}},
        ],
        "accessors": [
            positions(0, [-5.0, 0.0, -5.0], [5.0, 0.0, 5.0]),
            positions(1, [-1.0, 0.1, -1.5], [1.0, 2.0, -1.5]),
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 48},
            {"buffer": 0, "byteOffset": 96, "byteLength": 12},
        ],
        "buffers": [{"byteLength": 108}],
    });
    (document, binary)
}

/// A .glb file of a document and its binary chunk.
fn chunks(document: &Value, binary: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut file = Vec::new();
    let total = 12 + 8 + json.len() + 8 + binary.len();
    for word in [0x4654_6c67, 2, total as u32, json.len() as u32, 0x4e4f_534a] {
        file.extend(u32::to_le_bytes(word));
    }
    file.extend(json);
    for word in [binary.len() as u32, 0x004e_4942] {
        file.extend(u32::to_le_bytes(word));
    }
    file.extend(binary);
    file
}
