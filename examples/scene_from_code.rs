//! Makes a scene in memory, as the bytes of a glTF file: a floor under a small lamp.

use base64::Engine;
use caustique::Render;
use serde_json::json;

/// Corners of a square of side 2 around the origin, in the plane z = 0.
const SQUARE: [[f32; 3]; 4] = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
const TRIANGLES: [u16; 6] = [0, 1, 2, 0, 2, 3];

/// Renders the square from the front, lit by a lamp of 100 W/sr at a distance of 2 m.
pub fn main() -> caustique::Result<()> {
    let mut bytes: Vec<u8> = SQUARE.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    let positions = bytes.len();
    bytes.extend(TRIANGLES.iter().flat_map(|i| i.to_le_bytes()));
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let file = json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_lights_punctual"],
        "scene": 0,
        "scenes": [{"nodes": [0, 1, 2], "extras": {"caustique": {"light_units": "radiometric"}}}],
        "nodes": [
            {"name": "floor", "mesh": 0},
            {"name": "lamp", "translation": [0, 0, 2], "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"name": "camera", "translation": [0, 0, 4], "camera": 0},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"name": "floor", "pbrMetallicRoughness": {"metallicFactor": 0.0}}],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "point", "intensity": 100.0},
        ]}},
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 1.0, "znear": 0.1}}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, -1, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": positions},
            {"buffer": 0, "byteOffset": positions, "byteLength": bytes.len() - positions},
        ],
        "buffers": [{"byteLength": bytes.len(), "uri": format!("data:application/octet-stream;base64,{data}")}],
    });
    let image = Render::from_bytes(file.to_string().as_bytes())?.width(64).iterations(4).run()?;
    image.warnings().iter().for_each(|warning| println!("warning: {warning}"));
    image.save("floor.exr")
}
