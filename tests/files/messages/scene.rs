//! Messages about scene files. A case changes a file with every supported feature, or a small one.

use super::{Said, message};
use crate::gltf::compressed::{SQUARES, draco};
use crate::gltf::everything::everything;
use crate::gltf::glb::{CUBE, Glb};
use crate::gltf::images::{jpegs, wearing};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use caustique::scene::gltf::{FrameTime, Pose, ReadOptions, read, read_bytes};
use caustique::stop::Stop;
use serde_json::{Map, Value, json};
use std::path::Path;

/// The messages about a file.
pub fn messages_of(bytes: &[u8], options: &ReadOptions) -> Vec<String> {
    match read_bytes(bytes, Path::new("a.glb"), options) {
        Ok(scene) => scene.warnings.iter().map(|warning| format!("warning: {warning}")).collect(),
        Err(error) => vec![message(&error)],
    }
}

/// Sets a value at a JSON pointer, and creates missing objects.
fn put(json: &mut Value, pointer: &str, value: Value) {
    let mut at = json;
    for word in pointer.split('/').skip(1) {
        at = match at {
            Value::Array(list) => {
                let index: usize = word.parse().expect("an index");
                if index == list.len() {
                    list.push(Value::Null);
                }
                &mut list[index]
            }
            other => {
                if !other.is_object() {
                    *other = Value::Object(Map::new());
                }
                &mut other[word]
            }
        };
    }
    *at = value;
}

/// Sets a number in the data of an accessor: `#A.I` is float I of accessor A, `#uA.I` is index I.
fn put_number(file: &mut Glb, place: &str, value: &Value) {
    let (accessor, number) = place.trim_start_matches(['#', 'u']).split_once('.').expect("#A.I");
    let view = &file.json["accessors"][accessor.parse::<usize>().expect("a number")]["bufferView"];
    let view = &file.json["bufferViews"][view.as_u64().expect("it has data") as usize];
    let at = view["byteOffset"].as_u64().expect("a number") as usize + 4 * number.parse::<usize>().expect("a number");
    let bytes = match value {
        Value::String(text) => text.parse::<f32>().expect("nan or inf").to_le_bytes(),
        value if place.starts_with("#u") => (value.as_u64().expect("an index") as u32).to_le_bytes(),
        value => (value.as_f64().expect("a number") as f32).to_le_bytes(),
    };
    file.binary[at..at + 4].copy_from_slice(&bytes);
}

/// The messages about a changed file that the original file does not have.
pub fn changed(base: &Glb, changes: &Value) -> Vec<String> {
    let (mut file, mut options) = (base.clone(), ReadOptions::default());
    for (place, value) in changes.as_object().expect("changes") {
        match &**place {
            "frame" => options.frame = Some(FrameTime { number: 12, rate: None, of_sequence: false }),
            "scene" => options.scene = value.as_str().map(str::to_owned),
            "variant" => options.variant = value.as_str().map(str::to_owned),
            place if place.starts_with('#') => put_number(&mut file, place, value),
            place => put(&mut file.json, place, value.clone()),
        }
    }
    let before = messages_of(&base.bytes(), &ReadOptions::default());
    messages_of(&file.bytes(), &options).into_iter().filter(|line| !before.contains(line)).collect()
}

/// A quad named "water" on a node named "Pool".
pub fn pool() -> Glb {
    let mut file = Glb::new();
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let mesh = file.mesh("water", &corners, &[0, 1, 2, 0, 2, 3], None);
    file.node(json!({"name": "Pool", "mesh": mesh}));
    file
}

pub fn said() -> String {
    let mut said = Said::default();
    let everything = everything();
    said.case("everything as it is", &messages_of(&everything.bytes(), &ReadOptions::default()));
    let lists =
        [numbers(), parts(), meshes(), shapes(&everything), materials(), textures(), lamps(), patterns(), nodes()];
    for (what, changes) in lists.into_iter().flatten() {
        said.case(&format!("{what}: {changes}"), &changed(&everything, &changes));
    }
    for (what, changes) in little() {
        said.case(&format!("{what}: {changes}"), &changed(&pool(), &changes));
    }
    let [whole, small] = jpegs();
    for (what, image) in [("half a JPEG", &whole[..whole.len() / 2]), ("a JPEG of too few bits", &small)] {
        said.case(what, &messages_of(&wearing(image, "image/jpeg").bytes(), &ReadOptions::default()));
    }
    let solid = |positions: &[[f32; 3]], indices: &[u32]| {
        let mut file = Glb::new();
        let glass = file.push(
            "materials",
            json!({"name": "glass", "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1},
                "KHR_materials_volume": {"thicknessFactor": 1}}}),
        );
        let mesh = file.mesh("cube", positions, indices, Some(glass));
        file.node(json!({"mesh": mesh}));
        messages_of(&file.bytes(), &ReadOptions::default())
    };
    let cube = |middle: f32, half: f32| {
        let corner = move |i: u32| [0, 1, 2].map(|k| middle + if i >> k & 1 == 1 { half } else { -half });
        [0, 1, 2, 3, 4, 5, 6, 7].map(corner)
    };
    for (what, indices) in windings() {
        said.case(what, &solid(&cube(0.0, 1.0), &indices));
    }
    for (what, inner) in [("a cube in a cube", &[0.0][..]), ("two cubes in a cube", &[-0.5, 0.5])] {
        let shells: Vec<_> = std::iter::once(cube(0.0, 1.0)).chain(inner.iter().map(|&at| cube(at, 0.2))).collect();
        let shell = |k: u32| CUBE.into_iter().map(move |index| index + 8 * k);
        let indices: Vec<u32> = (0..shells.len() as u32).flat_map(shell).collect();
        said.case(what, &solid(&shells.concat(), &indices));
    }
    let mut square = draco(&STANDARD.decode(SQUARES[0]).expect("it is base64"));
    square.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"]["POSITION"] =
        json!(7);
    said.case("a Draco attribute that is not there", &messages_of(&square.bytes(), &ReadOptions::default()));
    let ktx2 = |numbers: &[u8]| [b"\xabKTX 20\xbb\r\n\x1a\n", numbers].concat();
    for (what, image) in [
        ("a KTX2 file of its first bytes", ktx2(&[])),
        ("a KTX2 file without texels", ktx2(&[0; 40])),
        ("a KTX2 file without data", ktx2(&[[0; 8], [8, 0, 0, 0, 8, 0, 0, 0], [0; 8], [0; 8], [0; 8]].concat())),
    ] {
        said.case(what, &messages_of(&wearing(&image, "image/ktx2").bytes(), &ReadOptions::default()));
    }
    for (what, bytes) in containers() {
        said.case(what, &messages_of(&bytes, &ReadOptions::default()));
    }
    let stages = [
        ("the rest pose of a stage", ReadOptions { pose: Pose::Rest, ..ReadOptions::default() }),
        ("a blurred stage without a frame", ReadOptions { shutter: Some([0.0, 0.5]), ..ReadOptions::default() }),
    ];
    for (what, options) in stages {
        let stage = caustique::scene::usd::read(Path::new("a.usda"), &options, 0.0, &Stop::default());
        said.case(what, &[message(&stage.expect_err("it is refused"))]);
    }
    let missing = read(Path::new("/nowhere/a.glb"), &ReadOptions::default()).expect_err("it is not there");
    said.case("no such file", &[message(&missing)]);
    said.0
}

type Cases = Vec<(&'static str, Value)>;

fn numbers() -> Cases {
    vec![
        ("a stride too small", json!({"/bufferViews/1/byteStride": 4})),
        ("a count beyond all", json!({"/accessors/0/count": u64::MAX})),
        ("a view too short", json!({"/accessors/0/byteOffset": 20})),
        ("no such type", json!({"/accessors/4/type": "VEC9"})),
        ("targets of another mesh", json!({"/accessors/9/count": 4, "#12.0": 1})),
        ("no such component type", json!({"/accessors/0/componentType": 1})),
        ("integers for positions", json!({"/accessors/0/componentType": 5125})),
        ("positions of two numbers", json!({"/accessors/0/type": "VEC2"})),
        (
            "elements without data",
            json!({"/accessors/0": {"componentType": 5126, "type": "VEC3", "count": 1u64 << 40}}),
        ),
        ("sparse indices of no type", json!({"/accessors/5/sparse/indices/componentType": 1})),
        ("a sparse index too large", json!({"/accessors/5/count": 1})),
    ]
}

fn parts() -> Cases {
    vec![
        ("the scene is no index", json!({"/scene": "x"})),
        ("a view past its buffer", json!({"/bufferViews/1/byteLength": 100_000_000})),
        ("one past the last", json!({"/nodes/1/mesh": 7})),
        ("no list", json!({"/nodes": 7})),
        ("no node", json!({"/nodes/0": 7})),
        ("an index of more than 32 bits", json!({"/nodes/1/mesh": 1u64 << 32})),
        ("a buffer too short", json!({"/buffers/0/byteLength": 100_000_000})),
        ("no comma", json!({"/buffers/0/uri": "data:x"})),
        ("no base64", json!({"/buffers/0/uri": "data:;base64,!!"})),
        ("no such file beside it", json!({"/buffers/0/uri": "a.bin"})),
        ("no file at all", json!({"/buffers/0/uri": "src"})),
        ("a scheme", json!({"/buffers/0/uri": "https://example.org/a.bin"})),
        ("no UTF-8", json!({"/buffers/0/uri": "%ff"})),
        ("outside", json!({"/buffers/0/uri": "../a.bin"})),
        ("no version", json!({"/asset": {}})),
        ("version 1", json!({"/asset/version": "1.0"})),
        ("extensions required", json!({"/extensionsRequired": ["EXT_one", "EXT_other"]})),
        (
            "Draco alone",
            json!({"/accessors/0": {"componentType": 5126, "type": "VEC3", "count": 8},
                "/meshes/0/primitives/0/extensions": {"KHR_draco_mesh_compression":
                    {"bufferView": 0, "attributes": {"POSITION": 0}}}}),
        ),
        ("a compression to come", json!({"/extensionsRequired": ["EXT_new_compression"]})),
        (
            "a compression to come, alone",
            json!({"/accessors/0": {"componentType": 5126, "type": "VEC3", "count": 8},
                "/meshes/0/primitives/0/extensions": {"EXT_new_compression": {}}}),
        ),
        (
            "meshopt without data",
            json!({"/bufferViews/1/extensions/EXT_meshopt_compression":
                {"buffer": 0, "byteLength": 40, "byteStride": 4, "count": 8, "mode": "ATTRIBUTES"}}),
        ),
        (
            "meshopt of odd elements",
            json!({"/bufferViews/1/extensions/EXT_meshopt_compression":
                {"buffer": 0, "byteLength": 40, "byteStride": 5, "count": 8, "mode": "ATTRIBUTES"}}),
        ),
        (
            "meshopt of too many elements",
            json!({"/bufferViews/1/extensions/EXT_meshopt_compression":
                {"buffer": 0, "byteLength": 40, "byteStride": 256, "count": 1_000_000, "mode": "ATTRIBUTES"}}),
        ),
        ("extensions used", json!({"/extensionsUsed": ["EXT_one"]})),
        ("no such scene", json!({"scene": "other"})),
        ("no variant", json!({"variant": "red"})),
        (
            "a variant of no material",
            json!({"variant": "red", "/extensions/KHR_materials_variants/variants": [{"name": "red"}],
                "/meshes/0/primitives/0/extensions/KHR_materials_variants/mappings": [{"variants": [0]}]}),
        ),
    ]
}

fn meshes() -> Cases {
    vec![
        ("points", json!({"/meshes/1/primitives/0/mode": 0})),
        ("lines", json!({"/meshes/1/primitives/0/mode": 1})),
        ("no such mode", json!({"/meshes/1/primitives/0/mode": 9})),
        ("no positions", json!({"/meshes/1/primitives/0/attributes": {}})),
        ("an index too large", json!({"#u1.0": 812})),
        ("indices left over", json!({"/accessors/1/count": 35})),
        ("a position that is no number", json!({"#0.4": "nan"})),
        ("a position far away", json!({"#0.4": 1e30})),
        ("too few normals", json!({"/accessors/2/count": 4})),
        ("a normal that is no number", json!({"#2.0": "nan"})),
        ("normals that are no numbers", json!({"#2.0": "nan", "#2.3": "inf"})),
        ("a normal without direction", json!({"#2.2": 0})),
        ("tangents without direction", json!({"/meshes/0/primitives/0/attributes/TANGENT": 7})),
        ("colours of no type", json!({"/meshes/0/primitives/0/attributes/COLOR_0": 3})),
        ("a triangle without area", json!({"#u1.0": 2})),
        ("no triangle", json!({"/accessors/1/count": 0})),
    ]
}

fn shapes(everything: &Glb) -> Cases {
    let pointer = "/animations/0/channels/2/target/extensions/KHR_animation_pointer/pointer";
    let act = &everything.json["animations"][0];
    let identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
    vec![
        ("no frame rate", json!({"/scenes/0/extras": {}, "frame": 12})),
        ("one frame", json!({"/scenes/0/extras/caustique/time": 0.5, "frame": 12})),
        ("what moves is not there", json!({pointer: "/materials/9/alphaCutoff"})),
        ("what moves is not read", json!({pointer: "/images/0/uri"})),
        ("nothing moves", json!({"/animations/0/channels/0/target/path": "odd"})),
        ("twice in an animation", json!({"/animations/0/channels/1/target": act["channels"][0]["target"]})),
        ("twice in two", json!({"/animations/1": act, "/animations/1/name": "again"})),
        ("no animation", json!({"/animations/0": 7})),
        ("rotations of one number", json!({"/animations/0/channels/1/sampler": 0})),
        ("a matrix that moves", json!({"/nodes/0": {"mesh": 1, "matrix": identity}})),
        ("a matrix that moves, in a frame", json!({"/nodes/0": {"mesh": 1, "matrix": identity}, "frame": 12})),
        ("no key", json!({"/accessors/11/count": 0})),
        ("no key, in a frame", json!({"/accessors/11/count": 0, "frame": 12})),
        ("a key before the start", json!({"#11.0": -1})),
        ("keys that fall", json!({"#11.0": 2})),
        ("values left over", json!({"/accessors/12/count": 1})),
        ("a key that is no number", json!({"#12.1": "inf"})),
        ("a weight beyond all", json!({"#12.0": 1e38})),
        ("weights of others", json!({"/meshes/2/weights": [1, 2], "/animations": []})),
        ("colours that move", json!({"/meshes/2/primitives/0/targets/0/COLOR_0": 9, "#12.0": 1})),
        ("normals that stay", json!({"/meshes/2/primitives/0/targets/0": {"POSITION": 9}, "#12.0": 1})),
        ("joints without matrices", json!({"/skins/0/joints": [0, 0]})),
        ("a bind that is not affine", json!({"#10.3": 1})),
        ("a joint nowhere", json!({"#10.0": "inf"})),
        ("joints for others", json!({"/accessors/7/count": 4})),
        ("no joints", json!({"/meshes/2/primitives/0/attributes": {"POSITION": 0}})),
        ("no such joint", json!({"#7.0": 5})),
        ("a loose vertex", json!({"#8.0": 0, "#8.1": 0})),
        ("loose vertices", json!({"/accessors/8/bufferView": 9})),
        (
            "joints in a circle",
            json!({"/nodes/4": {"children": [5]}, "/nodes/5": {"children": [4]}, "/skins/0/joints": [4]}),
        ),
    ]
}

fn materials() -> Cases {
    let at = |extension: &str| format!("/materials/0/extensions/KHR_materials_{extension}");
    let said = "/materials/0/extras/caustique";
    vec![
        ("an alpha mode", json!({"/materials/0/alphaMode": "ODD"})),
        ("a cut-off that is no number", json!({"/materials/0/alphaCutoff": 1e300})),
        ("more than a metal", json!({"/materials/0/pbrMetallicRoughness/metallicFactor": 2})),
        (
            "specular and glossiness",
            json!({at("pbrSpecularGlossiness"): {"glossinessFactor": 0.5, "specularGlossinessTexture": {"index": 0}}}),
        ),
        (
            "emission beyond numbers",
            json!({"/materials/0/emissiveFactor": [1e30, 0, 0], at("emissive_strength"): {"emissiveStrength": 1e30}}),
        ),
        ("less than a vacuum", json!({at("ior"): {"ior": 0.5}})),
        ("a film below a vacuum", json!({at("iridescence"): {"iridescenceIor": 0.5}})),
        ("a coat below a vacuum", json!({format!("{said}/coat_ior"): 0.5})),
        ("wax of one direction", json!({at("volume_scatter"): {"scatterAnisotropy": 1}})),
        ("wax with a picture", json!({at("volume_scatter"): {"multiscatterColorTexture": {"index": 0}}})),
        ("fire without smoke", json!({format!("{said}/medium/emission"): {"file": "fire.vol"}})),
        ("smoke everywhere", json!({"/scenes/0/extras/caustique/medium": {"density": {"file": "smoke.vol"}}})),
        ("glass without a BSDF", json!({format!("{said}/null_bsdf"): true})),
        ("a spread too wide", json!({format!("{said}/spread_deg"): 200})),
        ("a medium behind a wall", json!({at("transmission"): {}})),
        ("absorption over no distance", json!({at("volume") + "/attenuationDistance": -1})),
        ("black absorption", json!({at("volume") + "/attenuationColor": [0, 1, 1]})),
        ("absorption beyond numbers", json!({at("volume") + "/attenuationDistance": 1e-40})),
        ("a medium that gains", json!({format!("{said}/medium/sigma_a"): [-1, 0, 0]})),
        ("a phase function of one direction", json!({format!("{said}/medium/g"): 1})),
        ("a key of the wrong type", json!({format!("{said}/priority"): "high"})),
        ("a key misspelt", json!({format!("{said}/priorty"): 1})),
        ("a key that is far from all", json!({format!("{said}/temperature"): 1})),
        ("an open solid", json!({"/meshes/1/primitives/0/material": 0})),
        (
            "glass of no thickness",
            json!({"/materials/0/extras": {}, "/meshes/1/primitives/0": {"attributes": {"POSITION": 0}, "material": 0, "mode": 5},
                "/materials/0/extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}}),
        ),
        ("occlusion", json!({"/materials/0/occlusionTexture": {"index": 0}})),
        (
            "occlusion twice",
            json!({"/materials/0/occlusionTexture": {"index": 0}, "/meshes/1/primitives/0/material": 1,
                "/materials/1": {"occlusionTexture": {"index": 0}}}),
        ),
    ]
}

fn textures() -> Cases {
    let used = "/materials/0/pbrMetallicRoughness/baseColorTexture";
    vec![
        ("a transform beyond numbers", json!({format!("{used}/extensions/KHR_texture_transform/offset"): [1e300, 0]})),
        ("many coordinates", json!({format!("{used}/texCoord"): 5})),
        ("an image of others", json!({"/textures/0": {"extensions": {"EXT_texture_new": {"source": 0}}}})),
        ("a texture without an image", json!({"/textures/0": {}})),
        ("an image from nowhere", json!({"/images/0": {}})),
        ("no image", json!({"/images/0/bufferView": 1})),
        ("half an image", json!({"/bufferViews/0/byteLength": 50})),
    ]
}

fn lamps() -> Cases {
    let lamp = "/extensions/KHR_lights_punctual/lights/0";
    let said = "/nodes/2/extras/caustique";
    vec![
        ("no generator", json!({"/asset": {"version": "2.0"}})),
        ("a generator", json!({"/asset/generator": "chisel"})),
        ("an old exporter", json!({"/asset/generator": "Khronos glTF Blender I/O v3.3.27"})),
        ("too dark for lumens", json!({format!("{lamp}/intensity"): 10, "/animations": [], "/scenes/0/extras": {}})),
        (
            "light beyond numbers",
            json!({format!("{lamp}/color"): [1e30, 0, 0], "/animations": [], format!("{lamp}/intensity"): 1e30}),
        ),
        ("darkness", json!({format!("{lamp}/color"): [-1, 0, 0], "/animations": []})),
        ("a range", json!({format!("{lamp}/range"): 5})),
        ("a radius below zero", json!({format!("{said}/radius"): -1})),
        ("a sun all around", json!({format!("{lamp}/type"): "directional", format!("{said}/angle_deg"): 200})),
        ("no such light", json!({format!("{lamp}/type"): "odd"})),
        ("a sun with a radius", json!({format!("{lamp}/type"): "directional"})),
        ("a point with an edge", json!({format!("{lamp}/type"): "point", format!("{said}/blend"): 0.5})),
        ("a cone beyond numbers", json!({format!("{lamp}/spot/innerConeAngle"): 1e300})),
        ("a cone inside out", json!({format!("{lamp}/spot/innerConeAngle"): 0.5})),
        ("an edge too wide", json!({format!("{said}/blend"): 2})),
        ("a view all around", json!({"/cameras/0/perspective/yfov": 4})),
        ("a view of no aspect", json!({"/cameras/0/perspective/aspectRatio": -1})),
        (
            "a view of no width",
            json!({"/cameras/0": {"type": "orthographic", "orthographic": {"xmag": 0, "ymag": 1, "znear": 0, "zfar": 1}}}),
        ),
        ("no such camera", json!({"/cameras/0/type": "odd"})),
        ("an aperture below zero", json!({"/cameras/0/extras/caustique/aperture_radius": -1})),
        ("a focus behind", json!({"/cameras/0/extras/caustique/focus_distance": -1})),
        ("an aperture without a focus", json!({"/cameras/0/extras/caustique": {"aperture_radius": 1}})),
        ("a near plane", json!({"/cameras/0/perspective/znear": 5})),
        ("a far plane", json!({"/cameras/0/perspective/zfar": 0.5})),
        (
            "a panorama from right to left",
            json!({"/cameras/0/extras/caustique/panorama": {"longitude_deg": [90, -90]}}),
        ),
        (
            "a fisheye of no angle",
            json!({"/cameras/0/extras/caustique/panorama": {"fisheye": "equisolid", "fov_deg": 0}}),
        ),
        (
            "a fisheye of no size",
            json!({"/cameras/0/extras/caustique/panorama": {"fisheye": "equidistant", "half_size": [0, 1]}}),
        ),
        ("a shift beyond numbers", json!({"/cameras/0/extras/caustique/shift": [1e300, 0]})),
    ]
}

/// A photometric profile as a URI, with these vertical angles.
fn profile(angles: &str) -> String {
    format!("data:,TILT=NONE 1 -1 1 3 1 1 2 0 0 0 1 1 0 {angles} 0 3 2 1").replace("NONE ", "NONE%0a")
}

fn patterns() -> Cases {
    let lamp = "/extensions/KHR_lights_punctual/lights/0";
    let ies = "/nodes/2/extras/caustique/ies";
    let gobo = "/nodes/2/extras/caustique/gobo";
    let (listed, on_node) = ("/extensions/EXT_lights_ies/lights", "/nodes/2/extensions/EXT_lights_ies");
    let black = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGNgAAAAAgABSK+kcQAAAABJRU5ErkJggg==";
    let read = |keys: Value| json!({listed: [{"uri": profile("0 45 90"), "mimeType": "text/plain"}], on_node: keys});
    vec![
        ("no profile", json!({ies: {}})),
        ("a profile that is none", json!({ies: {"bufferView": 0}})),
        ("a profile from nowhere", json!({ies: {"file": "nowhere.ies"}})),
        ("a folder as a profile", json!({ies: {"file": "."}})),
        ("a rotation beyond numbers", json!({ies: {"bufferView": 0, "rotation_deg": 1e300}})),
        ("divided by an area", json!({ies: {"bufferView": 0, "normalize": "area"}})),
        ("a bulb of a ball", json!({format!("{lamp}/type"): "point", "/nodes/2/extras/caustique/bulb": true})),
        ("a bulb of the sun", json!({format!("{lamp}/type"): "directional", "/nodes/2/extras/caustique/bulb": true})),
        ("a sun with a profile", json!({format!("{lamp}/type"): "directional", ies: {"bufferView": 0}})),
        ("no such profile", json!({listed: [], on_node: {"light": 0}})),
        ("a profile of nothing", json!({listed: [{}], on_node: {"light": 0}})),
        ("a profile in words", json!({listed: [{"uri": "data:,light"}], on_node: {"light": 0}})),
        ("angles nearer than numbers", json!({listed: [{"uri": profile("0 1e-44 90")}], on_node: {"light": 0}})),
        ("a profile as text", read(json!({"light": 0}))),
        ("a multiplier beyond numbers", read(json!({"light": 0, "multiplier": 1e300}))),
        ("a multiplier below zero", read(json!({"light": 0, "multiplier": -1}))),
        ("a point with a picture", json!({format!("{lamp}/type"): "point", gobo: {"texture": 0}})),
        ("a picture all around", json!({gobo: {"texture": 0, "view_deg": 180}})),
        ("a black picture", json!({gobo: {"texture": 0}, "/images/0": {"uri": black}})),
        ("a profile and a picture", json!({gobo: {"texture": 0}, ies: {"file": "tests/corpus/ies/seed-bilateral"}})),
    ]
}

fn nodes() -> Cases {
    let said = "/scenes/0/extras/caustique";
    let copies = "/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes";
    vec![
        ("no pixels", json!({format!("{said}/resolution"): [0, 1]})),
        ("an exposure beyond numbers", json!({format!("{said}/exposure"): 1e300})),
        ("a window outside", json!({format!("{said}/crop"): [0.5, 0.5, 1, 1]})),
        ("no frames", json!({format!("{said}/frame_rate"): 0})),
        ("a shutter that closes first", json!({format!("{said}/shutter"): [0.5, 0]})),
        ("a rate of another type", json!({format!("{said}/frame_rate"): "x"})),
        ("an environment that takes light", json!({format!("{said}/environment/strength"): -1})),
        ("a colour below zero", json!({format!("{said}/environment/color"): [-1, 0, 0]})),
        ("an environment of nothing", json!({format!("{said}/environment"): {}})),
        ("an environment outside", json!({format!("{said}/environment"): {"file": "/etc/sky.hdr"}})),
        ("an environment elsewhere", json!({format!("{said}/environment"): {"file": "http://example.org/a.hdr"}})),
        ("its own child", json!({"/nodes/1/children": [1]})),
        ("a place beyond numbers", json!({"/nodes/1/scale": [1e308, 1e308, 1e308]})),
        ("a line", json!({"/nodes/1/scale": [0, 0, 1]})),
        ("far away", json!({"/nodes/1/translation": [1e12, 0, 0]})),
        ("a rotation of nothing", json!({"/nodes/1/rotation": [0, 0, 0, 0]})),
        ("a matrix that is not affine", json!({"/nodes/1": {"mesh": 0, "matrix": vec![1; 16]}})),
        ("copies of two numbers", json!({format!("{copies}/SCALE"): 0})),
        ("a copy beyond numbers", json!({"#6.0": "inf"})),
    ]
}

fn little() -> Cases {
    vec![("none to choose from", json!({"/nodes/0/camera": 3})), ("nothing moves", json!({"frame": 12}))]
}

fn windings() -> [(&'static str, Vec<u32>); 3] {
    let turned = |i: usize, t: &[u32]| if i == 0 { [t[0], t[2], t[1]] } else { [t[0], t[1], t[2]] };
    [
        ("a face turned over", CUBE.chunks(3).enumerate().flat_map(|(i, t)| turned(i, t)).collect()),
        ("all faces turned over", CUBE.chunks(3).flat_map(|t| turned(0, t)).collect()),
        ("faces twice", [CUBE, CUBE].concat()),
    ]
}

fn containers() -> [(&'static str, Vec<u8>); 9] {
    let whole = pool().bytes();
    let with = |at: usize, byte: u8| {
        let mut bytes = whole.clone();
        bytes[at] = byte;
        bytes
    };
    [
        ("no bytes", Vec::new()),
        ("another kind of file", b"\x89PNG\r\n".to_vec()),
        ("a picture", b"\x76\x2f\x31\x01\x02".to_vec()),
        ("the head alone", whole[..9].to_vec()),
        ("half a file", whole[..whole.len() / 2].to_vec()),
        ("version 1", with(4, 1)),
        ("a chunk too long", with(15, 0x7f)),
        ("no JSON", with(16, b'X')),
        ("half of the JSON", b"{\"asset\": {".to_vec()),
    ]
}

#[test]
fn about_scene_files() {
    let said = said();
    assert_eq!(super::silent(&said), [] as [&str; 0], "cases of which nothing is said");
    insta::assert_snapshot!("scene", said);
}
