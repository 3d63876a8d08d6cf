//! Mutants of good files: every one is read or refused with a message, none panics, hangs or takes the machine's
//! memory.

use super::glb::{Glb, pack};
use caustique::scene::description::EnvironmentSource;
use caustique::scene::environment_file;
use caustique::scene::gltf::{ReadOptions, read_bytes};
use serde_json::{Value, json};
use std::panic::catch_unwind;
use std::path::Path;

/// A file with something of everything.
fn everything() -> Glb {
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

/// Adds a skinned and morphed twin of a mesh, whose joint, weights and light move.
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

/// A file as Blender exports it.
fn exported() -> Glb {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/gems.glb");
    let bytes = std::fs::read(path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    Glb { json, binary: bytes[28 + length..].to_vec() }
}

/// A small generator of our own (SplitMix64), so that a failure names its mutant.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

/// One damaged version of a file.
fn mutant(file: &Glb, random: &mut Random) -> Vec<u8> {
    let mut json = file.json.to_string().into_bytes();
    let mut binary = file.binary.clone();
    match random.below(6) {
        // Digits become others, or more of them.
        0 | 1 => {
            let digits: Vec<usize> = (0..json.len()).filter(|i| json[*i].is_ascii_digit()).collect();
            for _ in 0..=random.below(3) {
                json[digits[random.below(digits.len())]] = b'0' + random.below(10) as u8;
            }
            if random.below(4) == 0 {
                let at = digits[random.below(digits.len())];
                json.splice(at..at, std::iter::repeat_n(b'9', random.below(25)));
            }
        }
        // A number becomes something else.
        2 => {
            let digits: Vec<usize> = (0..json.len()).filter(|i| json[*i].is_ascii_digit()).collect();
            let at = digits[random.below(digits.len())];
            let others: [&[u8]; 8] = [b"-1", b"null", b"1e30", b"-0", b"[]", b"\"x\"", b"4294967295", b"1e999"];
            json.splice(at..at + 1, others[random.below(8)].iter().copied());
        }
        // A letter of a key or a value changes.
        3 => {
            let at = random.below(json.len());
            json[at] = b"abcXYZ_019{}[],:\"\\ "[random.below(19)];
        }
        // Bits flip in either chunk.
        4 => {
            for _ in 0..=random.below(4) {
                let at = random.below(json.len() + binary.len());
                let bit = 1 << random.below(8);
                match at.checked_sub(json.len()) {
                    None => json[at] ^= bit,
                    Some(at) => binary[at] ^= bit,
                }
            }
        }
        // The file ends early, with a header that knows or one that does not.
        _ => {
            if random.below(2) == 0 {
                binary.truncate(random.below(binary.len()));
            } else {
                let mut file = pack(&json, &binary);
                file.truncate(random.below(file.len()));
                if file.len() >= 12 && random.below(2) == 0 {
                    let length = (file.len() as u32).to_le_bytes();
                    file[8..12].copy_from_slice(&length);
                }
                return file;
            }
        }
    }
    let mut file = pack(&json, &binary);
    // Now and then the container's own words are hit.
    if random.below(20) == 0 {
        file[random.below(20)] ^= 1 << random.below(8);
    }
    file
}

#[test]
fn mutants_are_read_or_refused() {
    let path = Path::new("mutant.glb");
    let options = ReadOptions::default();
    for (name, base, count) in [("everything", everything(), 6000), ("exported", exported(), 600)] {
        let whole = read_bytes(&base.bytes(), path, &options).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(whole.instances.len() > 2 && !whole.lights.is_empty() && !whole.textures.is_empty());
        let (mut good, mut refused) = (0, 0);
        for seed in 0..count {
            let bytes = mutant(&base, &mut Random(seed));
            match catch_unwind(|| read_bytes(&bytes, path, &options)) {
                Ok(Ok(scene)) => {
                    good += 1;
                    check(&scene, name, seed);
                }
                Ok(Err(error)) => {
                    refused += 1;
                    assert!(
                        !error.cause.is_empty() && error.place.starts_with("mutant.glb"),
                        "{name} {seed}: {error:?}"
                    );
                }
                Err(_) => panic!("{name}, mutant {seed} brought the reader down"),
            }
        }
        println!("{name}: {good} read, {refused} refused");
        // Both ways are taken often, or the mutations are not what they should be.
        assert!(good > count / 10 && refused > count / 10, "{name}: {good} read, {refused} refused");
    }
}

/// Environment images with flipped bits are read, finite, or refused.
#[test]
fn damaged_environment_images() {
    let folder = tempfile::tempdir().unwrap();
    let sky = |x: usize, y: usize| (x as f32, y as f32, 0.5);
    exr::prelude::write_rgb_file(folder.path().join("sky.exr"), 16, 8, sky).unwrap();
    let radiance = image::Rgb32FImage::from_fn(16, 8, |x, y| image::Rgb([x as f32, y as f32, 0.5]));
    radiance.save(folder.path().join("sky.hdr")).unwrap();
    let path = folder.path().join("damaged");
    for name in ["sky.exr", "sky.hdr"] {
        let whole = std::fs::read(folder.path().join(name)).unwrap();
        for seed in 0..300 {
            let mut random = Random(seed);
            let mut bytes = whole.clone();
            for _ in 0..=random.below(4) {
                let at = random.below(bytes.len());
                bytes[at] ^= 1 << random.below(8);
            }
            std::fs::write(&path, &bytes).unwrap();
            if let Ok(EnvironmentSource::Image { width, height, texels }) =
                environment_file::read(&path, &mut Vec::new())
            {
                assert_eq!(texels.len(), (width * height) as usize, "{name} {seed}");
                assert!(texels.iter().flatten().all(|x| x.is_finite() && *x >= 0.0), "{name} {seed}");
            }
        }
    }
}

/// What a description promises: indices are valid, numbers finite, transforms can be inverted.
fn check(scene: &caustique::scene::Description, name: &str, seed: u64) {
    let what = || format!("{name}, mutant {seed}");
    for instance in &scene.instances {
        assert!((instance.mesh as usize) < scene.meshes.len(), "{}", what());
        assert!((instance.material as usize) < scene.materials.len(), "{}", what());
        assert!((instance.object as usize) < scene.objects.len(), "{}", what());
        assert!(instance.to_world.inverse().is_finite(), "{}", what());
    }
    for mesh in &scene.meshes {
        let n = mesh.positions.len();
        assert!(mesh.triangles.iter().flatten().all(|i| (*i as usize) < n), "{}", what());
        assert!(
            mesh.positions.iter().all(|p| p.is_finite()) && mesh.normals.iter().all(|p| p.is_finite()),
            "{}",
            what()
        );
        assert!(mesh.tangents.iter().all(|t| t.is_finite()) && mesh.colors.iter().all(|c| c.is_finite()), "{}", what());
        for len in [mesh.normals.len(), mesh.tangents.len(), mesh.uvs[0].len(), mesh.uvs[1].len(), mesh.colors.len()] {
            assert!(len == 0 || len == n, "{}", what());
        }
    }
    for material in &scene.materials {
        let numbers =
            material.base_color.iter().chain([&material.metallic, &material.roughness, &material.transmission]);
        assert!(numbers.into_iter().all(|x| (0.0..=1.0).contains(x)), "{}", what());
        assert!(material.emission.is_finite() && material.ior >= 1.0, "{}", what());
        assert!(material.base_color_texture.is_none_or(|t| (t.texture as usize) < scene.textures.len()), "{}", what());
    }
    for light in &scene.lights {
        assert!(light.intensity.is_finite() && light.radius >= 0.0, "{}", what());
    }
}
