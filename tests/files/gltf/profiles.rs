//! Photometric profiles of lights: the key `ies` and the extension EXT_lights_ies.

use super::glb::Glb;
use super::{message, read, try_read};
use caustique::light::{Pattern, Picture};
use caustique::math::Rgb;
use caustique::scene::description::PunctualKind;
use caustique::scene::gltf::{self, ReadOptions};
use serde_json::{Value, json};

/// A profile of at most 500 cd.
const PROFILE: &str =
    "IESNA:LM-63-2002\nTILT=NONE\n1 1000 2 3 3 1 2 0 0 0\n1 1 50\n0 45 90\n0 90 180\n250 100 0\n200 90 0\n150 80 0\n";

/// A spot with the `ies` of its extras.
fn spot(ies: &Value) -> Glb {
    let mut file = Glb::new();
    file.view(PROFILE.as_bytes());
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "spot", "intensity": 3, "spot": {"outerConeAngle": 0.5}, "name": "lamp"}]}});
    let extras = json!({"caustique": {"ies": ies, "radius": 0.1}});
    file.node(json!({"extensions": {"KHR_lights_punctual": {"light": 0}}, "extras": extras}));
    file
}

/// A node with a light of EXT_lights_ies.
fn extension(light: &Value, reference: &Value) -> Glb {
    let mut file = Glb::new();
    file.view(PROFILE.as_bytes());
    file.json["extensions"] = json!({"EXT_lights_ies": {"lights": [light]}});
    file.json["extensionsUsed"] = json!(["EXT_lights_ies"]);
    file.json["extensionsRequired"] = json!(["EXT_lights_ies"]);
    file.node(json!({"name": "lamp", "extensions": {"EXT_lights_ies": reference}}));
    file
}

/// The candela of a profile multiply the light's intensity, which is divided by 683 as that of any photometric light.
#[test]
fn the_key_ies_shapes_a_spot() {
    let light = read(&spot(&json!({"bufferView": 0}))).lights.remove(0);
    assert!(light.pattern.is_some() && matches!(light.kind, PunctualKind::Spot { .. }) && light.radius == 0.1);
    assert!((light.intensity.x - 3.0 * 500.0 / 683.0).abs() < 1e-4, "{}", light.intensity);
    let light = read(&spot(&json!({"bufferView": 0, "normalize": true}))).lights.remove(0);
    assert!((light.intensity.x - 3.0 / 683.0).abs() < 1e-6, "{}", light.intensity);
    let scene = read(&spot(&json!({"bufferView": 0, "rotate_deg": 1})));
    assert!(scene.warnings[0].contains("did you mean \"ies.rotation_deg\"?"), "{:?}", scene.warnings);
    for (ies, cause) in [
        (json!({}), "extras.caustique.ies must have one of file and bufferView"),
        (json!({"bufferView": 0, "file": "a.ies"}), "extras.caustique.ies must have one of file and bufferView"),
        (json!({"bufferView": 7}), "buffer view 7 does not exist"),
        (json!({"file": "../a.ies"}), "is outside the scene's folder"),
        (json!({"file": "nowhere.ies"}), "put the profile beside the scene file"),
    ] {
        let error = message(&try_read(&spot(&ies)).expect_err("a fault"));
        assert!(error.contains("light \"lamp\"") && error.contains(cause), "{error}");
    }
    let mut broken = spot(&json!({"bufferView": 0}));
    broken.binary[40] = b'x';
    let error = message(&try_read(&broken).expect_err("a fault"));
    assert!(error.starts_with("pool.glb: node 0: light \"lamp\": profile in buffer view 0: line 3: "), "{error}");
}

#[test]
fn a_profile_may_be_a_file_beside_the_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.glb");
    std::fs::write(folder.path().join("lamp.ies"), PROFILE).expect("it can be written");
    std::fs::write(&path, spot(&json!({"file": "lamp.ies"})).bytes()).expect("it can be written");
    let scene = gltf::read(&path, &ReadOptions::default()).expect("a scene");
    assert!(scene.lights[0].pattern.is_some());
    assert_eq!(gltf::files(&std::fs::read(&path).expect("bytes"), &path, false), [folder.path().join("lamp.ies")]);
}

/// Lights of EXT_lights_ies have the candela of their profile, times multiplier and colour.
#[test]
fn lights_of_the_extension_have_the_candela_of_their_profile() {
    let view = json!({"bufferView": 0, "mimeType": "application/x-ies-lm-63"});
    let scene = read(&extension(&view, &json!({"light": 0, "multiplier": 2, "color": [1, 0.5, 0]})));
    let light = &scene.lights[0];
    assert!((light.intensity - Rgb::new(1.0, 0.5, 0.0) * (1000.0 / 683.0)).length() < 1e-4, "{}", light.intensity);
    assert_eq!((light.name.as_str(), light.kind), ("lamp", PunctualKind::Point));
    assert_eq!(scene.warnings, [] as [&str; 0]);
    let encoded: String = PROFILE.bytes().map(|byte| format!("%{byte:02x}")).collect();
    let uri = json!({"uri": format!("data:application/x-ies-lm-63,{encoded}")});
    let other = read(&extension(&uri, &json!({"light": 0}))).lights.remove(0);
    assert_eq!(other.pattern, light.pattern);
    assert!((other.intensity.x - 500.0 / 683.0).abs() < 1e-4);
    let error = try_read(&extension(&json!({"name": "none"}), &json!({"light": 0}))).expect_err("a fault");
    assert!(message(&error).contains("it has neither uri nor bufferView"), "{error}");
    assert!(try_read(&extension(&view, &json!({"light": 3}))).is_err());
}

/// A spot throws the picture of a texture, as wide as its cone unless the file says otherwise; one beside a spot is
/// ignored with a warning.
#[test]
fn the_key_gobo_names_the_picture_of_a_spot() {
    let with = |kind: &str, gobo: Value, texels: &[[u8; 4]]| {
        let mut file = Glb::new();
        file.png(2, texels);
        file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
            {"type": kind, "intensity": 683, "spot": {"outerConeAngle": 0.5}, "name": "lamp"}]}});
        let extras = json!({"caustique": {"gobo": gobo}});
        file.node(json!({"extensions": {"KHR_lights_punctual": {"light": 0}}, "extras": extras}));
        file
    };
    let texels = [[255, 0, 0, 255], [0, 255, 0, 128], [0, 0, 255, 255], [0, 0, 0, 255]];
    let light = read(&with("spot", json!({"texture": 0}), &texels)).lights.remove(0);
    let linear = |alpha: f32| [[1.0, 0.0, 0.0], [0.0, alpha, 0.0], [0.0, 0.0, 1.0], [0.0; 3]];
    let picture = |view: f32| Picture::new(2, 2, linear(128.0 / 255.0).to_vec(), view).map(Pattern::Picture);
    assert_eq!(light.pattern.as_deref(), picture(1.0).as_ref());
    assert!((light.intensity.x - 1.0).abs() < 1e-6);
    let light = read(&with("spot", json!({"texture": 0, "view_deg": 90}), &texels)).lights.remove(0);
    assert_eq!(light.pattern.as_deref(), picture(90f32.to_radians()).as_ref());
    let scene = read(&with("point", json!({"texture": 0}), &texels));
    assert!(scene.lights[0].pattern.is_none());
    assert_eq!(scene.warnings, ["light \"lamp\": extras.caustique.gobo has an effect on spots only"]);
    for (gobo, texels, cause) in [
        (json!({"texture": 4}), texels, "texture 4 does not exist"),
        (json!({"texture": 0, "view_deg": 171}), texels, "the view of its gobo is 171 degrees"),
        (json!({"texture": 0}), [[0, 0, 0, 255]; 4], "its gobo \"tiles\" is black"),
        (json!({}), texels, "missing field `texture`"),
    ] {
        let error = message(&try_read(&with("spot", gobo, &texels)).expect_err("a fault"));
        assert!(error.contains("light \"lamp\"") && error.contains(cause), "{error}");
    }
}

/// Rays pass through the sphere of a point light if its `null_bsdf` says so.
#[test]
fn the_key_null_bsdf_lets_rays_through_a_bulb() {
    for (keys, expected) in [(json!({"radius": 0.1}), false), (json!({"radius": 0.1, "null_bsdf": true}), true)] {
        let mut file = Glb::new();
        file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}});
        let extras = json!({"caustique": keys});
        file.node(json!({"extensions": {"KHR_lights_punctual": {"light": 0}}, "extras": extras}));
        let scene = read(&file);
        assert_eq!((scene.lights[0].pass_through, scene.warnings.len()), (expected, 0));
    }
}
