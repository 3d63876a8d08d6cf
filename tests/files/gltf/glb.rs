//! Builds small glTF files in memory.
#![allow(dead_code)]

use serde_json::{Value, json};

/// A document with its binary chunk. Features without a method are set in `json`.
#[derive(Clone)]
pub struct Glb {
    pub json: Value,
    pub binary: Vec<u8>,
}

impl Glb {
    /// An empty document with one scene.
    pub fn new() -> Glb {
        let json = json!({
            "asset": {"version": "2.0", "generator": "Khronos glTF Blender I/O v4.5.51"},
            "scene": 0, "scenes": [{"name": "Scene", "nodes": []}], "buffers": [{"byteLength": 0}],
        });
        Glb { json, binary: Vec::new() }
    }

    /// Appends an item to a list of the document, and returns its index.
    pub fn push(&mut self, list: &str, item: Value) -> usize {
        if self.json[list].is_null() {
            self.json[list] = json!([]);
        }
        let list = self.json[list].as_array_mut().unwrap();
        list.push(item);
        list.len() - 1
    }

    /// Appends a node to the scene.
    pub fn node(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(index.into());
        index
    }

    /// Appends bytes, and returns the index of their buffer view.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let offset = self.binary.len();
        self.binary.extend(bytes);
        self.json["buffers"][0]["byteLength"] = self.binary.len().into();
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    /// Appends vectors of floats, and returns the index of their accessor.
    pub fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let view = self.view(&bytes);
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        self.push("accessors", json!({"bufferView": view, "componentType": 5126, "type": kind, "count": values.len()}))
    }

    /// Appends 32-bit indices, and returns the index of their accessor.
    pub fn indices(&mut self, values: &[u32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        let view = self.view(&bytes);
        self.push(
            "accessors",
            json!({"bufferView": view, "componentType": 5125, "type": "SCALAR", "count": values.len()}),
        )
    }

    /// Appends a mesh with one indexed primitive, and returns its index.
    pub fn mesh(&mut self, name: &str, positions: &[[f32; 3]], indices: &[u32], material: Option<usize>) -> usize {
        let positions = self.floats(positions);
        let indices = self.indices(indices);
        let mut primitive = json!({"attributes": {"POSITION": positions}, "indices": indices});
        if let Some(material) = material {
            primitive["material"] = material.into();
        }
        self.push("meshes", json!({"name": name, "primitives": [primitive]}))
    }

    /// Appends a closed cube of edge 2 about the origin, without normals.
    pub fn cube(&mut self, name: &str, material: Option<usize>) -> usize {
        let corner = |i: u32| [0, 1, 2].map(|k| if i >> k & 1 == 1 { 1.0 } else { -1.0 });
        let corners: Vec<[f32; 3]> = (0..8).map(corner).collect();
        self.mesh(name, &corners, &CUBE, material)
    }

    /// Appends a PNG image of RGBA texels as a buffer view, and a texture of it. Returns the index of the texture.
    pub fn png(&mut self, width: u32, texels: &[[u8; 4]]) -> usize {
        let view = self.view(&png(width, texels));
        let image = self.push("images", json!({"name": "tiles", "bufferView": view, "mimeType": "image/png"}));
        self.push("textures", json!({"source": image}))
    }

    /// The bytes of the .glb file.
    pub fn bytes(&self) -> Vec<u8> {
        pack(self.json.to_string().as_bytes(), &self.binary)
    }
}

/// Triangles of the cube. The signs of corner i are the bits of i.
pub const CUBE: [u32; 36] =
    [0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5];

/// A `.glb` of a JSON and a binary chunk.
pub fn pack(json: &[u8], binary: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    let sizes = [json.len(), binary.len()].map(|n| n.next_multiple_of(4));
    let total = 12 + 8 + sizes[0] + 8 + sizes[1];
    file.extend(b"glTF");
    file.extend(2u32.to_le_bytes());
    file.extend((total as u32).to_le_bytes());
    for (chunk, kind, size, pad) in [(json, b"JSON", sizes[0], b' '), (binary, b"BIN\0", sizes[1], 0)] {
        file.extend((size as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
        file.resize(file.len() + size - chunk.len(), pad);
    }
    file
}

/// A PNG file.
pub fn png(width: u32, texels: &[[u8; 4]]) -> Vec<u8> {
    let data: Vec<u8> = texels.iter().flatten().copied().collect();
    let image = image::RgbaImage::from_raw(width, texels.len() as u32 / width, data).unwrap();
    let mut file = std::io::Cursor::new(Vec::new());
    image.write_to(&mut file, image::ImageFormat::Png).unwrap();
    file.into_inner()
}
