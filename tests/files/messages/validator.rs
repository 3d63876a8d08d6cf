//! The issues of the glTF validator (list of version 2.0.0-dev.3.10), each planted in an otherwise valid file. Each
//! file is read, read with a warning, or refused with a message. A snapshot holds the messages, so that changes are
//! noticed.
//!
//! Without issues of unsupported extensions, hints about unused objects, and issues that only a validator can have
//! (`IO_ERROR`).

use super::Said;
use super::scene::{changed, messages_of, pool};
use crate::gltf::everything::everything;
use crate::gltf::glb::Glb;
use caustique::scene::gltf::ReadOptions;
use serde_json::{Value, json};

/// Schema issues: values that the format does not allow.
fn schema() -> Vec<(&'static str, Value)> {
    vec![
        ("ARRAY_LENGTH_NOT_IN_LIST", json!({"/accessors/0/min": [0, 0, 0, 0, 0]})),
        ("ARRAY_TYPE_MISMATCH", json!({"/scenes/0/nodes": ["x"]})),
        ("DUPLICATE_ELEMENTS", json!({"/scenes/0/nodes": [1, 1]})),
        ("EMPTY_ENTITY", json!({"/meshes/1/primitives": []})),
        ("INVALID_INDEX", json!({"/nodes/1/mesh": -1})),
        ("INVALID_URI", json!({"/images/0/uri": "http://[", "/images/0/bufferView": null})),
        ("ONE_OF_MISMATCH", json!({"/images/0/uri": "a.png"})),
        ("PATTERN_MISMATCH", json!({"/asset/version": "two"})),
        ("TYPE_MISMATCH", json!({"/nodes/1/scale": "large"})),
        ("UNDEFINED_PROPERTY", json!({"/accessors/0": {"bufferView": 1}})),
        ("UNEXPECTED_PROPERTY", json!({"/nodes/1/colour": "red"})),
        ("UNSATISFIED_DEPENDENCY", json!({"/accessors/0/bufferView": null, "/accessors/0/byteOffset": 4})),
        ("VALUE_MULTIPLE_OF", json!({"/bufferViews/1/byteStride": 13})),
        ("VALUE_NOT_IN_LIST", json!({"/samplers/0/wrapS": 7})),
        ("VALUE_NOT_IN_RANGE", json!({"/materials/0/pbrMetallicRoughness/roughnessFactor": -7})),
    ]
}

/// Semantic issues: values that contradict others of their object.
fn meaning() -> Vec<(&'static str, Value)> {
    let light = "/extensions/KHR_lights_punctual/lights/0";
    vec![
        ("ACCESSOR_MATRIX_ALIGNMENT", json!({"/accessors/10/byteOffset": 1})),
        ("ACCESSOR_NORMALIZED_INVALID", json!({"/accessors/0/normalized": true})),
        ("ACCESSOR_OFFSET_ALIGNMENT", json!({"/accessors/0/count": 7, "/accessors/0/byteOffset": 1})),
        ("ACCESSOR_SPARSE_COUNT_OUT_OF_RANGE", json!({"/accessors/5/sparse/count": 9})),
        ("ANIMATION_CHANNEL_TARGET_NODE_SKIN", json!({"/animations/0/channels/1/target/node": 3})),
        ("ASSET_MIN_VERSION_GREATER_THAN_VERSION", json!({"/asset/minVersion": "2.7"})),
        ("BUFFER_DATA_URI_MIME_TYPE_INVALID", json!({"/buffers/0/uri": "data:image/png;base64,AAAA"})),
        ("BUFFER_VIEW_TOO_BIG_BYTE_STRIDE", json!({"/bufferViews/1/byteStride": 252})),
        ("BUFFER_VIEW_INVALID_BYTE_STRIDE", json!({"/bufferViews/2/byteStride": 8})),
        ("CAMERA_XMAG_YMAG_NEGATIVE", orthographic(-1.0)),
        ("CAMERA_XMAG_YMAG_ZERO", orthographic(0.0)),
        ("CAMERA_YFOV_GEQUAL_PI", json!({"/cameras/0/perspective/yfov": 3.2})),
        ("CAMERA_ZFAR_LEQUAL_ZNEAR", json!({"/cameras/0/perspective/zfar": 0.01})),
        ("INVALID_EXTENSION_NAME_FORMAT", json!({"/extensionsUsed": ["odd"]})),
        ("INVALID_GL_VALUE", json!({"/meshes/0/primitives/0/mode": 77})),
        ("KHR_ANIMATION_POINTER_ANIMATION_CHANNEL_TARGET_NODE", json!({"/animations/0/channels/2/target/node": 1})),
        (
            "KHR_ANIMATION_POINTER_ANIMATION_CHANNEL_TARGET_PATH",
            json!({"/animations/0/channels/2/target/path": "scale"}),
        ),
        ("KHR_LIGHTS_PUNCTUAL_LIGHT_SPOT_ANGLES", json!({format!("{light}/spot/outerConeAngle"): 0.05})),
        ("KHR_MATERIALS_DISPERSION_NO_VOLUME", extension("dispersion", &json!({"dispersion": 1}))),
        (
            "KHR_MATERIALS_EMISSIVE_STRENGTH_ZERO_FACTOR",
            extension("emissive_strength", &json!({"emissiveStrength": 2})),
        ),
        ("KHR_MATERIALS_VOLUME_DOUBLE_SIDED", json!({"/materials/0/doubleSided": true})),
        ("KHR_MATERIALS_VOLUME_NO_TRANSMISSION", extension("transmission", &Value::Null)),
        ("MATERIAL_ALPHA_CUTOFF_INVALID_MODE", json!({"/materials/0/alphaMode": "OPAQUE"})),
        ("MESH_INVALID_WEIGHTS_COUNT", json!({"/meshes/2/weights": []})),
        (
            "MESH_PRIMITIVES_UNEQUAL_TARGETS_COUNT",
            json!({"/meshes/2/primitives/1": {"attributes": {"POSITION": 0, "JOINTS_0": 7, "WEIGHTS_0": 8}}}),
        ),
        ("MESH_PRIMITIVE_INDEXED_SEMANTIC_CONTINUITY", json!({"/meshes/0/primitives/0/attributes/TEXCOORD_3": 3})),
        ("MESH_PRIMITIVE_INVALID_ATTRIBUTE", json!({"/meshes/0/primitives/0/attributes/COLOUR": 3})),
        ("MESH_PRIMITIVE_JOINTS_WEIGHTS_MISMATCH", json!({"/meshes/2/primitives/0/attributes/WEIGHTS_0": null})),
        ("MESH_PRIMITIVE_NO_POSITION", json!({"/meshes/0/primitives/0/attributes": {"NORMAL": 2}})),
        ("MESH_PRIMITIVE_TANGENT_WITHOUT_NORMAL", json!({"/meshes/1/primitives/0/attributes/TANGENT": 4})),
        ("NODE_EMPTY", json!({"/nodes/4": {}, "/scenes/0/nodes/3": 4})),
        ("NODE_MATRIX_NON_TRS", matrix([1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])),
        ("NODE_MATRIX_DEFAULT", matrix([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])),
        ("NODE_MATRIX_TRS", json!({"/nodes/1/matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]})),
        ("NODE_SKINNED_MESH_LOCAL_TRANSFORMS", json!({"/nodes/3/translation": [1, 2, 3]})),
        ("NODE_SKINNED_MESH_NON_ROOT", json!({"/scenes/0/nodes": [1, 2], "/nodes/2/children": [3]})),
        ("NODE_SKIN_NO_SCENE", json!({"/nodes/4": {}, "/skins/0/joints": [4]})),
        ("NON_OBJECT_EXTRAS", json!({"/nodes/1/extras": 7})),
        ("NON_RELATIVE_URI", json!({"/buffers/0/uri": "/a.bin"})),
        ("NON_REQUIRED_EXTENSION", json!({"/extensionsUsed": ["KHR_mesh_quantization"]})),
        ("ROTATION_NON_UNIT", json!({"/nodes/1/rotation": [0, 0, 0, 2]})),
        ("SKIN_NO_COMMON_ROOT", json!({"/skins/0/joints": [0, 2], "/skins/0/inverseBindMatrices": null})),
        ("SKIN_SKELETON_INVALID", json!({"/skins/0/skeleton": 2})),
        ("UNKNOWN_ASSET_MAJOR_VERSION", json!({"/asset/version": "3.0"})),
        ("UNKNOWN_ASSET_MINOR_VERSION", json!({"/asset/version": "2.7"})),
        ("UNUSED_EXTENSION_REQUIRED", json!({"/extensionsRequired": ["KHR_texture_transform"]})),
    ]
}

fn orthographic(xmag: f64) -> Value {
    let camera = json!({"xmag": xmag, "ymag": 1, "znear": 0, "zfar": 1});
    json!({"/cameras/0": {"type": "orthographic", "orthographic": camera}})
}

/// An extension of the glass.
fn extension(name: &str, value: &Value) -> Value {
    let volume = json!({"KHR_materials_volume": {"thicknessFactor": 1}});
    let changes = json!({"/materials/0/extensions": volume});
    match value {
        Value::Null => changes,
        value => json!({format!("/materials/0/extensions/KHR_materials_{name}"): value}),
    }
}

fn matrix(numbers: [i32; 16]) -> Value {
    json!({"/nodes/0": {"mesh": 1, "matrix": numbers}, "/animations": []})
}

/// Link issues: objects that do not fit their references.
fn links() -> Vec<(&'static str, Value)> {
    vec![
        ("ACCESSOR_SMALL_BYTESTRIDE", json!({"/bufferViews/1/byteStride": 8})),
        ("ACCESSOR_TOO_LONG", json!({"/accessors/0/count": 9})),
        ("ACCESSOR_TOTAL_OFFSET_ALIGNMENT", json!({"/bufferViews/1/byteOffset": 75})),
        ("ACCESSOR_USAGE_OVERRIDE", json!({"/meshes/1/primitives/0/indices": 0})),
        (
            "ANIMATION_CHANNEL_TARGET_NODE_MATRIX",
            json!({"/nodes/0": {"matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}}),
        ),
        ("ANIMATION_CHANNEL_TARGET_NODE_WEIGHTS_NO_MORPHS", json!({"/animations/0/channels/0/target/node": 1})),
        (
            "ANIMATION_DUPLICATE_TARGETS",
            json!({"/animations/0/channels/1": {"sampler": 0, "target": {"node": 3, "path": "weights"}}}),
        ),
        ("ANIMATION_SAMPLER_ACCESSOR_WITH_BYTESTRIDE", json!({"/bufferViews/13/byteStride": 4})),
        ("ANIMATION_SAMPLER_INPUT_ACCESSOR_INVALID_FORMAT", json!({"/accessors/11/componentType": 5125})),
        (
            "ANIMATION_SAMPLER_INPUT_ACCESSOR_TOO_FEW_ELEMENTS",
            json!({"/animations/0/samplers/0/interpolation": "CUBICSPLINE"}),
        ),
        ("ANIMATION_SAMPLER_OUTPUT_ACCESSOR_INVALID_COUNT", json!({"/accessors/12/count": 1})),
        ("ANIMATION_SAMPLER_OUTPUT_ACCESSOR_INVALID_FORMAT", json!({"/animations/0/samplers/1/output": 11})),
        ("BUFFER_MISSING_GLB_DATA", json!({"/buffers/1": {"byteLength": 4}})),
        ("BUFFER_VIEW_TARGET_OVERRIDE", json!({"/bufferViews/1/target": 34963})),
        ("BUFFER_VIEW_TOO_LONG", json!({"/bufferViews/3/byteLength": 1_000_000})),
        ("IMAGE_BUFFER_VIEW_WITH_BYTESTRIDE", json!({"/bufferViews/0/byteStride": 4})),
        ("INVALID_IBM_ACCESSOR_COUNT", json!({"/skins/0/joints": [0, 1]})),
        ("MESH_PRIMITIVE_ACCESSOR_UNALIGNED", json!({"/accessors/2/byteOffset": 2, "/accessors/2/count": 7})),
        ("MESH_PRIMITIVE_ACCESSOR_WITHOUT_BYTESTRIDE", json!({"/meshes/0/primitives/0/attributes/NORMAL": 0})),
        ("MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT", json!({"/meshes/0/primitives/0/attributes/NORMAL": 3})),
        ("MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_UNSIGNED_INT", json!({"/meshes/0/primitives/0/attributes/NORMAL": 1})),
        ("MESH_PRIMITIVE_INCOMPATIBLE_MODE", json!({"/accessors/1/count": 34})),
        ("MESH_PRIMITIVE_INDICES_ACCESSOR_INVALID_FORMAT", json!({"/meshes/0/primitives/0/indices": 3})),
        ("MESH_PRIMITIVE_INDICES_ACCESSOR_WITH_BYTESTRIDE", json!({"/bufferViews/2/byteStride": 4})),
        (
            "MESH_PRIMITIVE_MORPH_TARGET_INVALID_ATTRIBUTE_COUNT",
            json!({"/meshes/2/primitives/0/targets/0/POSITION": 6, "#12.0": 1}),
        ),
        ("MESH_PRIMITIVE_MORPH_TARGET_NO_BASE_ACCESSOR", json!({"/meshes/2/primitives/0/targets/0/TANGENT": 9})),
        ("MESH_PRIMITIVE_NO_TANGENT_SPACE", json!({"/meshes/1/primitives/0/material": 0})),
        ("MESH_PRIMITIVE_TOO_FEW_TEXCOORDS", json!({"/materials/0/normalTexture/texCoord": 1})),
        ("MESH_PRIMITIVE_UNEQUAL_ACCESSOR_COUNT", json!({"/accessors/3/count": 7})),
        ("NODE_LOOP", json!({"/nodes/0/children": [1]})),
        ("NODE_PARENT_OVERRIDE", json!({"/nodes/2/children": [0]})),
        ("NODE_SKINNED_MESH_WITHOUT_SKIN", json!({"/nodes/3/skin": null})),
        ("NODE_SKIN_WITH_NON_SKINNED_MESH", json!({"/nodes/1/skin": 0})),
        ("NODE_WEIGHTS_INVALID", json!({"/nodes/3/weights": [1, 2, 3], "/animations": []})),
        ("SCENE_NON_ROOT_NODE", json!({"/scenes/0/nodes": [0]})),
        ("SKIN_IBM_ACCESSOR_WITH_BYTESTRIDE", json!({"/bufferViews/12/byteStride": 64})),
        ("SKIN_IBM_INVALID_FORMAT", json!({"/skins/0/inverseBindMatrices": 0})),
        ("TEXTURE_INVALID_IMAGE_MIME_TYPE", json!({"/images/0/mimeType": "image/gif"})),
        ("UNDECLARED_EXTENSION", json!({"/nodes/1/extensions": {"EXT_odd": {}}})),
        ("UNEXPECTED_EXTENSION_OBJECT", json!({"/nodes/1/extensions": {"KHR_materials_ior": {"ior": 2}}})),
        ("UNRESOLVED_REFERENCE", json!({"/materials/0/normalTexture/index": 9})),
        ("UNUSED_OBJECT", json!({"/meshes/3": {"primitives": [{"attributes": {"POSITION": 99}}]}})),
    ]
}

/// Data issues: invalid numbers.
fn data() -> Vec<(&'static str, Value)> {
    vec![
        ("ACCESSOR_ANIMATION_INPUT_NEGATIVE", json!({"#11.0": -1})),
        ("ACCESSOR_ANIMATION_INPUT_NON_INCREASING", json!({"#11.1": 0.5})),
        ("ACCESSOR_ANIMATION_SAMPLER_OUTPUT_NON_NORMALIZED_QUATERNION", json!({"#13.3": 7})),
        ("ACCESSOR_ELEMENT_OUT_OF_MAX_BOUND", json!({"/accessors/0/max": [0, 0, 0], "/accessors/0/min": [-1, -1, -1]})),
        ("ACCESSOR_ELEMENT_OUT_OF_MIN_BOUND", json!({"/accessors/0/max": [1, 1, 1], "/accessors/0/min": [0, 0, 0]})),
        ("ACCESSOR_INDEX_OOB", json!({"#u1.5": 8})),
        ("ACCESSOR_INDEX_PRIMITIVE_RESTART", json!({"#u1.5": u32::MAX})),
        ("ACCESSOR_INDEX_TRIANGLE_DEGENERATE", json!({"#u1.1": 0})),
        ("ACCESSOR_INVALID_FLOAT", json!({"#0.1": "inf"})),
        ("ACCESSOR_INVALID_IBM", json!({"#10.7": 3})),
        ("ACCESSOR_INVALID_SIGN", json!({"/meshes/0/primitives/0/attributes/TANGENT": 4, "#4.3": 0.25})),
        ("ACCESSOR_JOINTS_INDEX_DUPLICATE", json!({"#7.1": 0})),
        ("ACCESSOR_JOINTS_INDEX_OOB", json!({"#7.0": 1})),
        ("ACCESSOR_JOINTS_USED_ZERO_WEIGHT", json!({"#7.2": 3})),
        ("ACCESSOR_MAX_MISMATCH", json!({"/accessors/0/max": [9, 9, 9]})),
        ("ACCESSOR_MIN_MISMATCH", json!({"/accessors/0/min": [-9, -9, -9]})),
        ("ACCESSOR_NON_CLAMPED", json!({"#4.0": 7})),
        ("ACCESSOR_VECTOR3_NON_UNIT", json!({"#2.2": 7})),
        ("ACCESSOR_SPARSE_INDICES_NON_INCREASING", json!({"/bufferViews/6/byteOffset": 0})),
        ("ACCESSOR_SPARSE_INDEX_OOB", json!({"/accessors/5/count": 2})),
        ("ACCESSOR_WEIGHTS_NEGATIVE", json!({"#8.0": -1})),
        ("ACCESSOR_WEIGHTS_NON_NORMALIZED", json!({"#8.0": 3})),
        ("BUFFER_BYTE_LENGTH_MISMATCH", json!({"/buffers/0/byteLength": 1_000_000})),
        ("BUFFER_GLB_CHUNK_TOO_BIG", json!({"/buffers/0/byteLength": 1200})),
        ("IMAGE_DATA_INVALID", json!({"/bufferViews/0/byteOffset": 16})),
        ("IMAGE_MIME_TYPE_INVALID", json!({"/images/0/mimeType": "image/jpeg"})),
        ("IMAGE_UNEXPECTED_EOS", json!({"/bufferViews/0/byteLength": 30})),
        ("IMAGE_UNRECOGNIZED_FORMAT", json!({"/images/0/bufferView": 3})),
    ]
}

/// Container issues.
fn containers() -> Vec<(&'static str, Vec<u8>)> {
    let whole = pool().bytes();
    let with = |at: usize, bytes: &[u8]| {
        let mut out = whole.clone();
        out[at..at + bytes.len()].copy_from_slice(bytes);
        out
    };
    let json = u32::from_le_bytes([whole[12], whole[13], whole[14], whole[15]]) as usize;
    let length = |n: usize| (n as u32).to_le_bytes();
    let extended = |more: &[u8]| {
        let mut out = [&whole[..], more].concat();
        let all = length(out.len());
        out[8..12].copy_from_slice(&all);
        out
    };
    vec![
        ("GLB_CHUNK_LENGTH_UNALIGNED", with(12, &length(json - 1))),
        ("GLB_CHUNK_TOO_BIG", with(20 + json, &length(1 << 20))),
        ("GLB_DUPLICATE_CHUNK", extended(&[&length(4)[..], b"JSON", b"{}  "].concat())),
        ("GLB_EMPTY_BIN_CHUNK", [&with(20 + json, &length(0))[..]].concat()),
        ("GLB_EMPTY_CHUNK", extended(&[&length(0)[..], b"ODD\0"].concat())),
        ("GLB_EXTRA_DATA", [&whole[..], b"more"].concat()),
        ("GLB_INVALID_MAGIC", with(0, b"gltf")),
        ("GLB_INVALID_VERSION", with(4, &length(7))),
        ("GLB_LENGTH_MISMATCH", with(8, &length(whole.len() + 4))),
        ("GLB_LENGTH_TOO_SMALL", with(8, &length(4))),
        ("GLB_UNEXPECTED_BIN_CHUNK", with(16, b"BIN\0")),
        ("GLB_UNEXPECTED_END_OF_CHUNK_DATA", whole[..40].to_vec()),
        ("GLB_UNEXPECTED_END_OF_CHUNK_HEADER", whole[..15].to_vec()),
        ("GLB_UNEXPECTED_END_OF_HEADER", whole[..7].to_vec()),
        ("GLB_UNEXPECTED_FIRST_CHUNK", with(16, b"ODD\0")),
        ("GLB_UNKNOWN_CHUNK_TYPE", extended(&[&length(4)[..], b"ODD\0", b"what"].concat())),
        ("INVALID_JSON", b"{\"asset\": }".to_vec()),
    ]
}

#[test]
fn what_the_validator_knows_is_read_or_refused() {
    let mut said = Said::default();
    let everything: Glb = everything();
    let mut case = |what: &str, lines: Vec<String>| {
        let silent = || vec!["it is read".to_owned()];
        said.case(what, &if lines.is_empty() { silent() } else { lines });
    };
    for (code, changes) in [schema(), meaning(), links(), data()].concat() {
        case(&format!("{code}: {changes}"), changed(&everything, &changes));
    }
    for (code, bytes) in containers() {
        case(code, messages_of(&bytes, &ReadOptions::default()));
    }
    insta::assert_snapshot!("validator", said.0);
}
