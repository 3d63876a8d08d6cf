//! A file with every feature that the glTF reader supports.

use super::glb::Glb;
use serde_json::json;

/// A file with every supported feature.
pub fn everything() -> Glb {
    let mut file = Glb::new();
    let texture = file.png(2, &[[10, 20, 30, 255], [40, 50, 60, 70], [1, 2, 3, 4], [250, 251, 252, 253]]);
    let t = json!({"index": texture, "texCoord": 0, "extensions": {"KHR_texture_transform": {"offset": [0.1, 0.2], "rotation": 1}}});
    let glass = file.push("materials", json!({"name": "glass", "alphaMode": "MASK", "alphaCutoff": 0.5,
        "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1], "baseColorTexture": t, "metallicFactor": 0},
        "normalTexture": {"index": texture, "scale": 0.5},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1, "transmissionTexture": t},
            "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 0.5, "attenuationColor": [0.5, 0.25, 1]},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatTexture": t},
            "KHR_materials_anisotropy": {"anisotropyStrength": 0.5}},
        "extras": {"caustique": {"medium": {"sigma_a": [1, 2, 3], "sigma_s": [4, 5, 6], "g": 0.5}, "priority": 2}}}));
    file.push("samplers", json!({"wrapS": 33071, "wrapT": 33648, "magFilter": 9729, "minFilter": 9987}));
    file.json["textures"][0]["sampler"] = json!(0);
    let mesh = file.cube("cube", Some(glass));
    let n = file.floats(&[[0.0, 0.0, 1.0]; 8]);
    let uv = file.floats(&[[0.25, 0.5]; 8]);
    let c = file.floats(&[[0.25, 0.5, 0.75, 1.0]; 8]);
    let attributes = &mut file.json["meshes"][mesh]["primitives"][0]["attributes"];
    attributes["NORMAL"] = json!(n);
    attributes["TEXCOORD_0"] = json!(uv);
    attributes["COLOR_0"] = json!(c);
    let keys = file.view(&[1, 0, 2, 0]);
    let values: Vec<u8> = [1.0f32, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let values = file.view(&values);
    let sparse =
        json!({"count": 2, "indices": {"bufferView": keys, "componentType": 5123}, "values": {"bufferView": values}});
    let p = file.push("accessors", json!({"componentType": 5126, "type": "VEC3", "count": 6, "sparse": sparse}));
    let strip =
        file.push("meshes", json!({"name": "strip", "primitives": [{"attributes": {"POSITION": p}, "mode": 5}]}));
    file.push(
        "cameras",
        json!({"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 1.5, "znear": 0.1},
        "extras": {"caustique": {"aperture_radius": 0.01, "focus_distance": 2.5}}}),
    );
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "spot", "intensity": 683, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.2}}]}});
    let moves = file.floats(&[[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
    let child = file.push(
        "nodes",
        json!({"mesh": strip, "translation": [1, 2, 3],
        "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": moves}}}}),
    );
    file.node(json!({"name": "Cube", "mesh": mesh, "children": [child], "rotation": [0, 0, 0, 1], "scale": [1, 2, 3]}));
    file.node(json!({"name": "Lamp", "extensions": {"KHR_lights_punctual": {"light": 0}}, "camera": 0,
        "extras": {"caustique": {"radius": 0.1}}}));
    file.json["scenes"][0]["extras"] = json!({"caustique": {"environment": {"color": [0.1, 0.2, 0.3], "strength": 2},
        "frame_rate": [24000, 1001]}});
    moving(&mut file, mesh, child);
    file
}

/// Adds a skinned and morphed copy of a mesh, and animates its joint, its weights and a light.
fn moving(file: &mut Glb, mesh: usize, joint: usize) {
    let (joints, weights) = (file.floats(&[[0.0; 4]; 8]), file.floats(&[[0.5, 0.5, 0.0, 0.0]; 8]));
    let mut primitive = file.json["meshes"][mesh]["primitives"][0].clone();
    primitive["attributes"]["JOINTS_0"] = json!(joints);
    primitive["attributes"]["WEIGHTS_0"] = json!(weights);
    let bent = file.floats(&[[0.1, 0.2, 0.3]; 8]);
    primitive["targets"] = json!([{"POSITION": bent, "NORMAL": bent}]);
    let twin = file.push("meshes", json!({"name": "twin", "primitives": [primitive], "weights": [0.5]}));
    let binds = file.floats(&[[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]);
    file.json["accessors"][binds]["type"] = json!("MAT4");
    file.json["accessors"][binds]["count"] = json!(1);
    file.push("skins", json!({"joints": [joint], "inverseBindMatrices": binds}));
    let node = file.node(json!({"name": "Twin", "mesh": twin, "skin": 0}));
    let times = file.floats(&[[0.5], [1.0]]);
    let samplers = [file.floats(&[[0.0], [1.0]]), file.floats(&[[0.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0]])];
    let samplers = samplers.map(|output| json!({"input": times, "output": output, "interpolation": "LINEAR"}));
    let pointer = json!({"pointer": "/extensions/KHR_lights_punctual/lights/0/intensity"});
    file.push(
        "animations",
        json!({"name": "act", "samplers": samplers, "channels": [
        {"sampler": 0, "target": {"node": node, "path": "weights"}},
        {"sampler": 1, "target": {"node": joint, "path": "rotation"}},
        {"sampler": 0, "target": {"path": "pointer", "extensions": {"KHR_animation_pointer": pointer}}}]}),
    );
}
