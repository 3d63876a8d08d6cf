//! Compressed meshes and textures give what their plain twins give.

use super::glb::Glb;
use super::{message, read, try_read};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use caustique::math::Vec3;
use caustique::scene::Description;
use caustique::texture::Texels;
use serde_json::{Value, json};
use std::io::Cursor;

/// The unit square of two triangles, compressed by Google's Draco 1.5.7 (DracoPy), by edgebreaker and sequentially.
pub const SQUARES: [&str; 2] = [
    "RFJBQ08CAgEBAAAABAIAAgAAAR//AREB/wAAAQAJAwAAAgABAQADAwEgASADACCEmJAAAAAAAP8AAAAAAAAAAAAAAAAAAAAAAIA/CA==",
    "RFJBQ08CAgEAAAACBAEAAQIAAgMBAQAJAwAAAgABAQADAwEwARADADSCiAQAAAAA/wAAAAAAAAAAAAAAAAAAAAAAgD8I",
];

/// A square whose data exist only in compressed form.
pub fn draco(bytes: &[u8]) -> Glb {
    let mut file = Glb::new();
    let view = file.view(bytes);
    let positions = file.push("accessors", json!({"componentType": 5126, "type": "VEC3", "count": 4}));
    let indices = file.push("accessors", json!({"componentType": 5123, "type": "SCALAR", "count": 6}));
    let compression = json!({"KHR_draco_mesh_compression": {"bufferView": view, "attributes": {"POSITION": 0}}});
    let mesh = file.push(
        "meshes",
        json!({"name": "square", "primitives": [{"attributes": {"POSITION": positions}, "indices": indices,
            "extensions": compression}]}),
    );
    file.node(json!({"mesh": mesh}));
    file.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    file
}

/// Area and bounding box of the first mesh.
fn extent(scene: &Description) -> (f32, Vec3, Vec3) {
    let mesh = &scene.meshes[0];
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        0.5 * (b - a).cross(c - a).z
    };
    let low = mesh.positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
    let high = mesh.positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
    (mesh.triangles.iter().map(area).sum(), low, high)
}

#[test]
fn draco_meshes_are_decoded() {
    for square in SQUARES {
        let bytes = STANDARD.decode(square).expect("it is base64");
        let scene = read(&draco(&bytes));
        let (area, low, high) = extent(&scene);
        assert_eq!(scene.meshes[0].triangles.len(), 2);
        assert!((area - 1.0).abs() < 1e-6, "{area}");
        assert_eq!((low, high), (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)));
    }
}

#[test]
fn damaged_draco_meshes_are_errors_that_name_a_remedy() {
    let bytes = STANDARD.decode(SQUARES[0]).expect("it is base64");
    for cut in [0, 5, 20, bytes.len() / 2] {
        let error = message(&try_read(&draco(&bytes[..cut])).expect_err("it is cut off"));
        assert!(error.starts_with("pool.glb: mesh \"square\", primitive 0, KHR_draco_mesh_compression: "), "{error}");
        assert!(error.contains("gltf-transform copy"), "{error}");
    }
    // Every byte in turn is damaged: a mesh or an error, but no panic.
    for at in 0..bytes.len() {
        for flip in [0x01, 0x80, 0xff] {
            let mut damaged = bytes.clone();
            damaged[at] ^= flip;
            drop(try_read(&draco(&damaged)));
        }
    }
}

/// Moves the data of all buffer views into one compressed by meshoptimizer. The views refer to a buffer without data.
fn with_meshopt(plain: &Glb, views: &[(usize, usize, &str)]) -> Glb {
    let mut file = plain.clone();
    let compressed: Vec<Vec<u8>> = views
        .iter()
        .map(|&(view, stride, mode)| {
            let raw = &plain.json["bufferViews"][view];
            let [start, length] = ["byteOffset", "byteLength"].map(|key| raw[key].as_u64().unwrap_or(0) as usize);
            let bytes = &plain.binary[start..start + length];
            match (mode, stride) {
                ("ATTRIBUTES", 12) => {
                    let vertices: Vec<[f32; 3]> = bytemuck::pod_collect_to_vec(bytes);
                    meshopt::encode_vertex_buffer(&vertices).expect("it can be encoded")
                }
                ("TRIANGLES", 4) => {
                    let indices: Vec<u32> = bytemuck::pod_collect_to_vec(bytes);
                    meshopt::encode_index_buffer(&indices, 8).expect("it can be encoded")
                }
                ("INDICES", 4) => {
                    let indices: Vec<u32> = bytemuck::pod_collect_to_vec(bytes);
                    meshopt::encode_index_sequence(&indices, 8).expect("it can be encoded")
                }
                other => panic!("{other:?}"),
            }
        })
        .collect();
    file.binary.clear();
    let place = file.push(
        "buffers",
        json!({"byteLength": plain.binary.len(),
        "extensions": {"EXT_meshopt_compression": {"fallback": true}}}),
    );
    for (&(view, stride, mode), bytes) in views.iter().zip(compressed) {
        let offset = file.binary.len();
        file.binary.extend(&bytes);
        let raw = &mut file.json["bufferViews"][view];
        raw["buffer"] = place.into();
        let count = raw["byteLength"].as_u64().expect("a length") as usize / stride;
        raw["extensions"] = json!({"EXT_meshopt_compression": {"buffer": 0, "byteOffset": offset,
            "byteLength": bytes.len(), "byteStride": stride, "count": count, "mode": mode}});
    }
    file.json["buffers"][0]["byteLength"] = file.binary.len().into();
    file.json["extensionsRequired"] = json!(["EXT_meshopt_compression"]);
    file
}

#[test]
fn meshopt_views_are_decoded() {
    let mut plain = Glb::new();
    let mesh = plain.cube("cube", None);
    plain.node(json!({"mesh": mesh}));
    let expected = read(&plain);
    for mode in ["TRIANGLES", "INDICES"] {
        let scene = read(&with_meshopt(&plain, &[(0, 12, "ATTRIBUTES"), (1, 4, mode)]));
        assert_eq!(scene.meshes[0].positions, expected.meshes[0].positions, "{mode}");
        // The codec of triangles may rotate each.
        let first = |t: &[u32; 3]| {
            let at = (0..3).min_by_key(|&i| t[i]).expect("three");
            [t[at], t[(at + 1) % 3], t[(at + 2) % 3]]
        };
        let triangles = |scene: &Description| scene.meshes[0].triangles.iter().map(first).collect::<Vec<_>>();
        assert_eq!(triangles(&scene), triangles(&expected), "{mode}");
    }
    let mut cut = with_meshopt(&plain, &[(0, 12, "ATTRIBUTES"), (1, 4, "TRIANGLES")]);
    cut.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["byteLength"] = json!(9);
    let error = message(&try_read(&cut).expect_err("it is cut off"));
    assert!(
        error.starts_with("pool.glb: buffer view 0, EXT_meshopt_compression: its data cannot be decoded"),
        "{error}"
    );
}

/// A square with a texture that an extension names.
fn textured(image: &[u8], mime: &str, extension: &str) -> Glb {
    let mut file = Glb::new();
    let view = file.view(image);
    let source = file.push("images", json!({"bufferView": view, "mimeType": mime}));
    let mut extensions = json!({});
    extensions[extension] = json!({"source": source});
    let texture = file.push("textures", json!({"extensions": extensions}));
    let material = file.push("materials", json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}}));
    let mesh = file.cube("cube", Some(material));
    file.node(json!({"mesh": mesh}));
    file.json["extensionsRequired"] = json!([extension]);
    file
}

/// The texels of the only texture, as RGBA.
fn texels(scene: &Description) -> Vec<u8> {
    let Texels::Integers { data, channels, .. } = &scene.textures[0].texels else { panic!("they are no integers") };
    let caustique::texture::Integers::Bytes(bytes) = &**data else { panic!("they are no bytes") };
    assert_eq!(*channels, 4);
    bytes.clone()
}

#[test]
fn webp_textures_are_decoded() {
    let expected: Vec<u8> = (0..4 * 6).map(|i| (10 * i as u8) | 1).collect();
    let picture = image::RgbaImage::from_raw(3, 2, expected.clone()).expect("six texels");
    let mut webp = Cursor::new(Vec::new());
    picture.write_to(&mut webp, image::ImageFormat::WebP).expect("it can be written");
    assert_eq!(texels(&read(&textured(&webp.into_inner(), "image/webp", "EXT_texture_webp"))), expected);
}

/// A KTX2 file of 8 x 4 texels in UASTC: two blocks of mode 8, which have one color each.
fn ktx2(colors: [[u8; 4]; 2]) -> Vec<u8> {
    let mut file = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    let mut words = |words: &[u32]| file.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    let (head, description, block) = (80 + 24_u32, 44, 16);
    let data = (head + description).next_multiple_of(16);
    // No format, bytes of a type, width, height, depth, layers, faces, levels, no supercompression.
    words(&[0, 1, 8, 4, 0, 0, 1, 1, 0]);
    words(&[head, description, 0, 0, 0, 0, 0, 0]);
    words(&[data, 0, 2 * block, 0, 2 * block, 0]);
    // The data format: UASTC in BT.709 and sRGB, blocks of 4 x 4 texels and 16 bytes, one sample of RGBA.
    words(&[description, 0, 2 | 40 << 16, 166 | 1 << 8 | 2 << 16, 3 | 3 << 8, 16, 0]);
    words(&[127 << 16 | 3 << 24, 0, 0, u32::MAX]);
    file.resize(data as usize, 0);
    for color in colors {
        // The code of mode 8, 0x17 in five bits, and four bytes.
        let bits = 0x17 | u128::from(u32::from_le_bytes(color)) << 5;
        file.extend(bits.to_le_bytes());
    }
    file
}

#[test]
fn ktx2_textures_are_decoded() {
    let colors = [[200, 100, 50, 255], [10, 20, 30, 40]];
    let decoded = texels(&read(&textured(&ktx2(colors), "image/ktx2", "KHR_texture_basisu")));
    let row = [colors[0]; 4].into_iter().chain([colors[1]; 4]).flatten().collect::<Vec<u8>>();
    assert_eq!(decoded, row.repeat(4));
    let broken = textured(&ktx2(colors)[..150], "image/ktx2", "KHR_texture_basisu");
    let error = message(&try_read(&broken).expect_err("it is cut off"));
    assert!(error.contains("it cannot be decoded") && error.contains("gltf-transform ktxdecompress"), "{error}");
}

/// A texture with a PNG besides keeps it.
#[test]
fn a_plain_image_is_preferred() {
    let mut file = textured(b"no image", "image/webp", "EXT_texture_webp");
    let plain = file.png(1, &[[1, 2, 3, 4]]);
    let source: Value = file.json["textures"][plain]["source"].clone();
    file.json["textures"][0]["source"] = source;
    assert_eq!(texels(&read(&file)), [1, 2, 3, 4]);
}
