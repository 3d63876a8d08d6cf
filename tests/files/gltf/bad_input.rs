//! Damaged files: the message for each fault.

use super::glb::{Glb, pack};
use super::{message, try_read};
use caustique::scene::gltf::{ReadOptions, read, read_bytes};
use serde_json::{Value, json};
use std::path::Path;

/// A quad named "water" on a node named "Pool".
fn pool() -> Glb {
    let mut file = Glb::new();
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let mesh = file.mesh("water", &corners, &[0, 1, 2, 0, 2, 3], None);
    file.node(json!({"name": "Pool", "mesh": mesh}));
    file
}

/// The message about the pool after one value of its JSON was changed.
fn with(pointer: &str, value: Value) -> String {
    let mut file = pool();
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    match file.json.pointer_mut(parent).unwrap() {
        Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
        parent => parent[key] = value,
    }
    match try_read(&file) {
        Err(error) => message(&error),
        Ok(scene) => panic!("{pointer}: it was read, with {:?}", scene.warnings),
    }
}

fn of_bytes(bytes: &[u8]) -> String {
    message(&read_bytes(bytes, Path::new("pool.glb"), &ReadOptions::default()).unwrap_err())
}

const EXPORT: &str = "hint: the file is damaged: export it again";
const COPY: &str = "hint: the file is damaged or incomplete: copy or export it again";

#[test]
fn the_pool_itself_is_fine() {
    assert!(try_read(&pool()).unwrap().warnings.is_empty());
}

#[test]
fn a_file_that_is_not_there() {
    let error = read(Path::new("/nowhere/pool.glb"), &ReadOptions::default()).unwrap_err();
    assert_eq!(
        message(&error),
        "/nowhere/pool.glb: No such file or directory (os error 2)\n\
         hint: check the path of the scene file and your right to read it"
    );
}

#[test]
fn truncated_and_foreign_files() {
    let whole = pool().bytes();
    assert_eq!(of_bytes(b""), "pool.glb: this is not a glTF file\nhint: give a .glb or .gltf file");
    assert_eq!(of_bytes(b"\x89PNG\r\n"), "pool.glb: this is not a glTF file\nhint: give a .glb or .gltf file");
    assert_eq!(of_bytes(&whole[..9]), format!("pool.glb: the file ends inside its header, after 9 bytes\n{COPY}"));
    let (n, half) = (whole.len(), whole.len() / 2);
    assert_eq!(
        of_bytes(&whole[..half]),
        format!("pool.glb: the file is cut off: its header says {n} bytes, it has {half}\n{COPY}")
    );
    let mut bytes = whole.clone();
    bytes[4] = 1;
    assert_eq!(
        of_bytes(&bytes),
        "pool.glb: binary glTF version 1 is not supported\nhint: export the scene as glTF 2.0"
    );
    let mut bytes = whole.clone();
    bytes[15] = 0x7f;
    assert_eq!(of_bytes(&bytes), format!("pool.glb: the chunk at byte 12 runs past the end of the file\n{COPY}"));
    let mut bytes = whole;
    bytes[16] = b'X';
    assert_eq!(of_bytes(&bytes), format!("pool.glb: the file holds no JSON chunk\n{COPY}"));
}

#[test]
fn corrupted_json() {
    let json = pool().json.to_string();
    let broken = json.replacen("\"meshes\"", "\"meshes", 1);
    let text = of_bytes(&pack(broken.as_bytes(), &[]));
    assert!(
        text.starts_with("pool.glb: JSON: ") && text.contains(" at line 1 column ") && text.ends_with(COPY),
        "{text}"
    );
    let text = of_bytes(&json.as_bytes()[..json.len() / 2]);
    assert!(text.starts_with("pool.glb: JSON: EOF while parsing"), "{text}");
    assert_eq!(
        with("/nodes/0", json!(7)),
        format!("pool.glb: nodes[0]: invalid type: integer `7`, expected struct Node\n{COPY}")
    );
    assert_eq!(with("/nodes", json!(7)), format!("pool.glb: nodes: it is not a list\n{EXPORT}"));
    assert_eq!(
        with("/nodes/0/mesh", json!(4294967296u64)),
        format!("pool.glb: nodes[0]: the number 4294967296 is too large\n{EXPORT}")
    );
    assert_eq!(
        with("/asset", json!({})),
        "pool.glb: asset: the glTF version is missing\nhint: export the scene as glTF 2.0"
    );
    assert_eq!(
        with("/asset/version", json!("1.0")),
        "pool.glb: asset: glTF version 1.0 is not supported\nhint: export the scene as glTF 2.0"
    );
    let deep = "[".repeat(100_000);
    assert!(of_bytes(format!("{{\"asset\": {deep}").as_bytes()).contains("recursion limit"));
}

#[test]
fn missing_buffers() {
    assert_eq!(
        with("/buffers/0/uri", json!("pool%20data.bin")),
        "pool.glb: buffer 0: the file pool data.bin cannot be read: No such file or directory (os error 2)\n\
         hint: put the file there, or export as .glb, which holds buffers and textures itself"
    );
    assert_eq!(
        with("/buffers/0/uri", json!("https://example.org/pool.bin")),
        "pool.glb: buffer 0: a URI of scheme \"https\" cannot be read\nhint: save what it names beside the scene file"
    );
    assert_eq!(
        with("/buffers/0/uri", json!("data:;base64,!!")),
        "pool.glb: buffer 0: its data URI is not valid base64\nhint: export the scene again"
    );
    for device in ["/dev/zero", "/"] {
        let mut file = pool();
        file.json["buffers"][0]["uri"] = device.into();
        let options = ReadOptions { allow_outside: true, ..ReadOptions::default() };
        assert_eq!(
            message(&read_bytes(&file.bytes(), Path::new("pool.glb"), &options).unwrap_err()),
            format!(
                "pool.glb: buffer 0: the file {device} cannot be read: it is not a regular file\n\
                 hint: put the file there, or export as .glb, which holds buffers and textures itself"
            )
        );
    }
    assert!(with("/buffers/0/uri", json!("a\0b")).starts_with("pool.glb: buffer 0: the file a\0b cannot be read"));
    assert_eq!(
        with("/buffers/0/byteLength", json!(9999)),
        format!("pool.glb: buffer 0: 9999 bytes are promised, 72 are there\n{COPY}")
    );
    assert_eq!(
        with("/bufferViews/0/buffer", json!(3)),
        format!(
            "pool.glb: mesh \"water\", primitive 0, POSITION: accessor 0: buffer view 0: buffer 3 does not exist: the last one \
             is 0\n{EXPORT}"
        )
    );
    assert_eq!(
        with("/bufferViews/0/byteLength", json!(u64::MAX)),
        format!(
            "pool.glb: mesh \"water\", primitive 0, POSITION: accessor 0: buffer view 0: 18446744073709551615 bytes from byte 0 \
             run past the 72 of buffer 0\n{EXPORT}"
        )
    );
}

#[test]
fn textures_that_cannot_be_read() {
    let textured = |image: Value, texture: Value| {
        let mut file = pool();
        file.json["materials"] = json!([{"name": "tiles", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
        file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
        file.json["images"] = json!([image]);
        file.json["textures"] = json!([texture]);
        message(&try_read(&file).unwrap_err())
    };
    let place = "pool.glb: material \"tiles\", baseColorTexture";
    assert_eq!(
        textured(json!({"name": "blue", "uri": "blue.png"}), json!({"source": 0})),
        format!(
            "{place}: image \"blue\": the file blue.png cannot be read: No such file or directory (os error 2)\n\
             hint: put the file there, or export as .glb, which holds buffers and textures itself"
        )
    );
    assert_eq!(
        textured(json!({"bufferView": 0}), json!({"source": 0})),
        format!("{place}: image 0: it is neither PNG, JPEG, WebP nor KTX2\nhint: save the image again as PNG or JPEG")
    );
    assert!(
        textured(json!({"uri": "data:image/png;base64,iVBORw0KGgo="}), json!({"source": 0}))
            .starts_with(&format!("{place}: image 0: it cannot be decoded: "))
    );
    assert_eq!(
        textured(json!({}), json!({"source": 0})),
        format!("{place}: image 0: it has neither a URI nor a buffer view\nhint: export the scene again")
    );
    assert_eq!(
        textured(json!({}), json!({"extensions": {"EXT_texture_new": {"source": 0}}})),
        format!(
            "{place}: texture 0 has only an image of EXT_texture_new, which cannot be decoded\n\
             hint: export the textures as PNG or JPEG"
        )
    );
    assert_eq!(
        textured(json!({}), json!({"source": 5})),
        format!("{place}: image 5 does not exist: the last one is 0\n{EXPORT}")
    );
    // A decompression bomb: 60000 x 60000 texels in a few bytes.
    let mut header = vec![0u8, 0, 0, 13];
    header.extend(b"IHDR\0\0\xea\x60\0\0\xea\x60\x08\x06\0\0\0");
    let mut bomb = b"\x89PNG\r\n\x1a\n".to_vec();
    bomb.extend(&header);
    bomb.extend(crc(&header[4..]).to_be_bytes());
    bomb.extend(b"\0\0\0\0IDAT\x35\xaf\x06\x1e");
    let mut file = pool();
    let view = file.view(&bomb);
    file.json["images"] = json!([{"bufferView": view}]);
    file.json["textures"] = json!([{"source": 0}]);
    file.json["materials"] = json!([{"emissiveTexture": {"index": 0}}]);
    file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    let text = message(&try_read(&file).unwrap_err());
    assert!(text.contains("emissiveTexture: image 0: it cannot be decoded: ") && text.contains("limit"), "{text}");
}

/// CRC-32 of PNG.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, b| {
        (0..8).fold(crc ^ u32::from(*b), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}

#[test]
fn positions_that_are_not_finite() {
    for (x, said) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf")] {
        let mut file = pool();
        file.binary[24..28].copy_from_slice(&x.to_le_bytes());
        assert_eq!(
            message(&try_read(&file).unwrap_err()),
            format!(
                "pool.glb: mesh \"water\", primitive 0: the position of vertex 2 is not finite: ({said}, 1, 0)\n\
                 hint: look at the mesh in the program that made it, and export it again"
            )
        );
    }
    let mut file = pool();
    file.binary[24..28].copy_from_slice(&1e30f32.to_le_bytes());
    assert!(message(&try_read(&file).unwrap_err()).contains("vertex 2 is too far from the origin"));
}

#[test]
fn indices_and_accessors_out_of_range() {
    let mut file = pool();
    let at = file.binary.len() - 4;
    file.binary[at..].copy_from_slice(&812u32.to_le_bytes());
    assert_eq!(
        message(&try_read(&file).unwrap_err()),
        "pool.glb: mesh \"water\", primitive 0: index 812 is past the 4 vertices\n\
         hint: re-export the mesh with 'Apply Modifiers'"
    );
    let place = "pool.glb: mesh \"water\", primitive 0";
    assert_eq!(
        with("/meshes/0/primitives/0/attributes/POSITION", json!(9)),
        format!("{place}, POSITION: accessor 9 does not exist: the last one is 1\n{EXPORT}")
    );
    assert_eq!(
        with("/meshes/0/primitives/0/indices", json!(0)),
        format!("{place}, indices: accessor 0: components of type F32 cannot serve here\n{EXPORT}")
    );
    assert_eq!(
        with("/accessors/0/type", json!("VEC2")),
        format!("{place}, POSITION: accessor 0: its elements have 2 components instead of 3\n{EXPORT}")
    );
    assert_eq!(
        with("/accessors/0/componentType", json!(1)),
        format!("{place}, POSITION: accessor 0: its component type is unknown\n{EXPORT}")
    );
    assert_eq!(
        with("/accessors/0/byteOffset", json!(20)),
        format!("{place}, POSITION: accessor 0: 4 elements take 68 bytes, its buffer view has 48\n{EXPORT}")
    );
    assert_eq!(
        with("/bufferViews/0/byteStride", json!(4)),
        format!("{place}, POSITION: accessor 0: a stride of 4 bytes is too small for elements of 12\n{EXPORT}")
    );
    assert_eq!(with("/meshes/0/primitives/0/mode", json!(9)), format!("{place}: its mode is unknown\n{EXPORT}"));
    assert_eq!(
        with("/meshes/0/primitives/0/attributes/NORMAL", json!(1)),
        format!("{place}, NORMAL: accessor 1: components of type U32 cannot serve here\n{EXPORT}")
    );
    assert_eq!(
        with("/meshes/0/primitives/0/material", json!(2)),
        format!("{place}: material 2 does not exist: the file has none\n{EXPORT}")
    );
    assert_eq!(
        with("/nodes/0/mesh", json!(1)),
        format!("pool.glb: node \"Pool\": mesh 1 does not exist: the last one is 0\n{EXPORT}")
    );
    assert_eq!(with("/scene", json!(1)), format!("pool.glb: scene 1 does not exist: the last one is 0\n{EXPORT}"));
    assert_eq!(
        with("/scenes/0/nodes/0", json!(3)),
        format!("pool.glb: node 3 does not exist: the last one is 0\n{EXPORT}")
    );
    assert_eq!(
        with("/nodes/0/children", json!([8])),
        format!("pool.glb: node \"Pool\": node 8 does not exist: the last one is 0\n{EXPORT}")
    );
}

/// Counts too large for any file allocate no memory.
#[test]
fn absurd_counts() {
    let place = "pool.glb: mesh \"water\", primitive 0, POSITION: accessor 0";
    assert_eq!(
        with("/accessors/0/count", json!(1_000_000_000_000u64)),
        format!("{place}: 1000000000000 elements take 12000000000000 bytes, its buffer view has 48\n{EXPORT}")
    );
    assert_eq!(
        with("/accessors/0/count", json!(u64::MAX)),
        format!("{place}: 18446744073709551615 elements take more bytes than can be, its buffer view has 48\n{EXPORT}")
    );
    assert_eq!(
        with("/accessors/0", json!({"componentType": 5126, "type": "VEC3", "count": 1_000_000_000_000u64})),
        format!("{place}: 1000000000000 elements are promised without any data\n{EXPORT}")
    );
}

/// Many small counts are refused like one large count.
#[test]
fn absurd_counts_in_parts() {
    let mut file = pool();
    for i in 0..3 {
        let zeros = file.push("accessors", json!({"componentType": 5126, "type": "VEC3", "count": 400_000}));
        let mesh =
            file.push("meshes", json!({"name": i.to_string(), "primitives": [{"attributes": {"POSITION": zeros}}]}));
        file.node(json!({"mesh": mesh}));
    }
    let last = file.json["accessors"].as_array().unwrap().len() - 1;
    assert_eq!(
        message(&try_read(&file).unwrap_err()),
        format!(
            "pool.glb: mesh \"2\", primitive 0, POSITION: accessor {last}: 400000 elements are promised \
             without any data\n{EXPORT}"
        )
    );
}

#[test]
fn nodes_that_are_not_a_tree() {
    let text = "it is its own ancestor, or the child of two nodes";
    assert_eq!(with("/nodes/0/children", json!([0])), format!("pool.glb: node \"Pool\": {text}\n{EXPORT}"));
    assert_eq!(with("/scenes/0/nodes", json!([0, 0])), format!("pool.glb: node \"Pool\": {text}\n{EXPORT}"));
    let mut file = pool();
    for i in 1..100_000 {
        file.push("nodes", json!({"children": [i + 1]}));
    }
    file.push("nodes", json!({}));
    file.json["nodes"][0]["children"] = json!([1]);
    assert_eq!(try_read(&file).unwrap().instances.len(), 1);
    for (key, value, cause) in [
        ("rotation", json!([0, 0, 0, 0]), "its rotation is not a quaternion"),
        ("scale", json!([1, 2]), "its scale is not 3 numbers"),
        ("matrix", json!(vec![1.0; 16]), "the last row of its matrix is not 0, 0, 0, 1"),
    ] {
        let text = with(&format!("/nodes/0/{key}"), value);
        assert!(text.contains(cause) || text.contains("nodes[0]: invalid length"), "{text}");
    }
    let text = with("/nodes/0/translation", json!([1e300, 0, 0]));
    assert_eq!(
        text,
        "pool.glb: node \"Pool\": it reaches too far from the origin\nhint: look at its scale and position"
    );
}

/// Joints at the end of a long chain take time proportional to the length of the chain, not to the length times their
/// number.
#[test]
fn deep_skeletons() {
    let mut file = pool();
    let (which, weights) = (file.floats(&[[0.0; 4]; 4]), file.floats(&[[1.0, 0.0, 0.0, 0.0]; 4]));
    file.json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = json!(which);
    file.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(weights);
    file.json["nodes"][0]["skin"] = json!(0);
    let depth = 30_000;
    for i in 1..=depth {
        let below = if i < depth { json!([i + 1]) } else { json!(null) };
        file.push("nodes", json!({"translation": [0, 1, 0], "children": below}));
    }
    file.push("skins", json!({"joints": vec![depth; 30_000]}));
    let clock = caustique::render::Clock::start();
    let scene = try_read(&file).unwrap();
    assert_eq!(scene.instances[0].to_world.translation.y, f64::from(depth));
    assert!(clock.seconds() < 20.0, "{} s", clock.seconds());
}

#[test]
fn extensions_that_are_not_known() {
    assert_eq!(
        with("/extensionsRequired", json!(["EXT_of_tomorrow", "KHR_materials_volume", "KHR_another"])),
        "pool.glb: extensionsRequired: extensions \"EXT_of_tomorrow\", \"KHR_another\" are required but not supported\n\
         hint: export the scene without this extension"
    );
    assert_eq!(
        with("/extensionsRequired", json!(["EXT_new_compression"])),
        "pool.glb: extensionsRequired: extension \"EXT_new_compression\" is required but not supported\n\
         hint: decompress the file: gltf-transform copy IN.glb OUT.glb"
    );
    let mut file = pool();
    file.json["extensionsUsed"] = json!(["EXT_of_tomorrow"]);
    file.json["nodes"][0]["extensions"] = json!({"EXT_not_listed": {}});
    assert_eq!(
        try_read(&file).unwrap().warnings,
        [
            "extension \"EXT_not_listed\" is not supported and is ignored",
            "extension \"EXT_of_tomorrow\" is not supported and is ignored",
        ]
    );
}

#[test]
fn nothing_to_render() {
    let mut file = pool();
    file.json["accessors"][0]["count"] = json!(0);
    file.json["accessors"][1]["count"] = json!(0);
    let scene = try_read(&file).unwrap();
    assert!(scene.instances.is_empty() && scene.meshes.is_empty());
    assert_eq!(scene.warnings, ["mesh \"water\", primitive 0: it has no triangle to render"]);
    file.json["meshes"][0]["primitives"][0]["attributes"] = json!({});
    let scene = try_read(&file).unwrap();
    assert_eq!(scene.warnings, ["mesh \"water\", primitive 0: it has no positions, so there is nothing to render"]);
    let scene = try_read(&Glb::new()).unwrap();
    assert!(scene.instances.is_empty() && scene.cameras.is_empty() && scene.warnings.is_empty());
    assert_eq!(
        message(
            &super::try_read(&{
                let mut file = pool();
                file.json["materials"] = json!([{"name": "m", "emissiveFactor": [1e300, 0, 0]}]);
                file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
                file
            })
            .unwrap_err()
        ),
        "pool.glb: material \"m\": emissiveFactor is not finite"
    );
}
