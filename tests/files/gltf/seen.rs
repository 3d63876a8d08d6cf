//! Keys of `extras.caustique` about visibility, lamps, lens shift, the picture, and losses of the export.

use super::glb::Glb;
use super::{message, read, try_read};
use caustique::light::SpotEdge;
use caustique::math::{Vec2, Vec3};
use caustique::scene::description::{Contrast, PictureDefaults, PunctualKind, ToneMap};
use caustique::scene::{CameraRequest, Crop};
use serde_json::{Value, json};

fn caustique(keys: Value) -> Value {
    json!({"caustique": keys})
}

#[test]
fn what_the_picture_was_made_for() {
    let mut file = Glb::new();
    file.json["scenes"][0]["extras"] = caustique(json!({
        "resolution": [640, 200], "exposure": -1.5, "tonemap": "filmic", "contrast": "very-high", "crop": [0, 0, 0.5, 1], "film_transparent": true,
        "frame": 12, "frame_rate": [24000, 1001],
        "losses": ["object \"Hair\": it is gone", "object \"Hair\": it is gone"],
        "environment": {"color": [1, 1, 1], "visible": {"camera": false}},
    }));
    let description = read(&file);
    let (exposure, tonemap, contrast) = (Some(-1.5), Some(ToneMap::Filmic), Some(Contrast::VeryHigh));
    let crop = Some([0.0, 0.0, 0.5, 1.0]);
    let resolution = Some([640, 200]);
    let (frame, frame_rate) = (Some(12), Some([24000, 1001]));
    let expected =
        PictureDefaults { resolution, exposure, tonemap, contrast, film_transparent: true, crop, frame, frame_rate };
    assert_eq!(description.picture, expected);
    assert!(description.environment_hidden_from_camera);
    let said = |what: &str| description.warnings.iter().filter(|warning| warning.contains(what)).count();
    assert_eq!((said("Hair"), said("ignored")), (1, 0));
    let scene = caustique::scene::Scene::build(description, 1).expect("a scene");
    let whole = Some(Crop::Shares([0.0, 0.0, 1.0, 1.0]));
    let size = |width, height| {
        let halved =
            scene.camera(&CameraRequest { width, height, ..CameraRequest::default() }).expect("a camera").size();
        let whole = scene
            .camera(&CameraRequest { width, height, crop: whole, ..CameraRequest::default() })
            .expect("a camera")
            .size();
        assert_eq!(halved, (whole.0 / 2, whole.1));
        whole
    };
    assert_eq!(size(None, None), (640, 200));
    assert_eq!(size(Some(320), None), (320, 100));
    assert_eq!(size(None, Some(50)), (160, 50));
    assert_eq!(size(Some(10), Some(10)), (10, 10));
}

#[test]
fn wrong_values_are_errors() {
    for (keys, what) in [
        (json!({"resolution": [0, 200]}), "two numbers above zero"),
        (json!({"resolution": [200]}), "invalid length 1"),
        (json!({"tonemap": "sepia"}), "unknown variant `sepia`"),
        (json!({"losses": "all"}), "expected a sequence"),
        (json!({"crop": [0.5, 0, 0.6, 1]}), "within 0 and 1"),
        (json!({"crop": [0, 0, 0, 1]}), "within 0 and 1"),
        (json!({"frame": 1.5}), "expected i32"),
        (json!({"frame_rate": 23.976}), "two for a fraction as in [24000, 1001]"),
        (json!({"frame_rate": [24, 0]}), "whole numbers above zero"),
        (json!({"frame_rate": 0}), "whole numbers above zero"),
        (json!({"frame_rate": 4294967295u32}), "below 2^31"),
    ] {
        let mut file = Glb::new();
        file.json["scenes"][0]["extras"] = caustique(keys);
        let error = message(&try_read(&file).expect_err("refused"));
        assert!(error.contains(what), "{error}");
    }
}

#[test]
fn lamps_as_blender_has_them() {
    let spot = json!({"KHR_lights_punctual": {"light": 0}});
    let file = |blend: Value| {
        let mut file = Glb::new();
        let cone = json!({"type": "spot", "spot": {"innerConeAngle": 0.7, "outerConeAngle": 0.8}});
        file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [cone]}});
        let keys = caustique(json!({"blend": blend, "radius": 0.25, "visible": {"camera": false}}));
        file.node(json!({"name": "spot", "extensions": spot, "extras": keys}));
        file
    };
    for (blend, share) in [(0.0, 1.0), (0.25, 0.75), (1.0, 0.0)] {
        let light = read(&file(json!(blend))).lights.remove(0);
        let PunctualKind::Spot { inner, outer, edge } = light.kind else { panic!("{:?}", light.kind) };
        assert_eq!((outer, edge, light.radius, light.hidden_from_camera), (0.8, SpotEdge::Smooth, 0.25, true));
        let expected = (1.0 - share * (1.0 - 0.8f32.cos())).acos();
        assert!((inner - expected).abs() < 1e-3, "{blend}: {inner}, {expected}");
    }
    assert!(message(&try_read(&file(json!(1.5))).expect_err("refused")).contains("blend must lie between 0 and 1"));
}

#[test]
fn pass_through_surfaces_and_hidden_objects() {
    let mut file = Glb::new();
    let mesh = file.cube("lamp", Some(0));
    file.node(json!({"mesh": mesh, "extras": caustique(json!({"visible": {"camera": false}}))}));
    file.json["materials"] = json!([{"name": "lamp", "emissiveFactor": [1, 1, 1],
        "extras": {"caustique": {"null_bsdf": true, "spread_deg": 90}}}]);
    let description = read(&file);
    assert!(description.instances[0].hidden_from_camera);
    let lamp = &description.materials[description.instances[0].material as usize];
    assert!(lamp.null_bsdf && (lamp.spread - std::f32::consts::FRAC_PI_4).abs() < 1e-6);
    file.json["materials"][0]["extensions"] = json!({"KHR_materials_transmission": {"transmissionFactor": 1}});
    let description = read(&file);
    assert!(!description.materials[description.instances[0].material as usize].null_bsdf);
    let warning = "material \"lamp\": its null_bsdf is ignored: it transmits light by itself";
    assert!(description.warnings.iter().any(|other| other == warning), "{:?}", description.warnings);
    file.json["materials"][0]["extras"]["caustique"]["spread_deg"] = json!(181);
    assert!(message(&try_read(&file).expect_err("refused")).contains("spread_deg must lie between 0 and 180"));
}

/// A shift of half the width moves the point straight ahead to the edge of the picture.
#[test]
fn lens_shift() {
    let mut file = Glb::new();
    file.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1, "aspectRatio": 2, "znear": 0.1}}]);
    file.node(json!({"camera": 0, "extras": {"caustique": {"shift": [0.5, -0.25]}}}));
    let scene = caustique::scene::Scene::build(read(&file), 1).expect("a scene");
    let camera = scene
        .camera(&CameraRequest { width: Some(200), height: Some(100), ..CameraRequest::default() })
        .expect("a camera");
    let ray = camera.ray([0.0, 25.0].into(), [0.5; 2].into());
    assert!((ray.direction - camera.forward()).length() < 1e-5, "{:?}", ray.direction);
}

/// Crop windows given as shares and in pixels, and invalid ones.
#[test]
fn windows() {
    let window = |crop: Crop| crop.window((200, 100));
    assert_eq!(window(Crop::Shares([0.25, 0.0, 0.5, 1.0])), Some([50, 0, 100, 100]));
    assert_eq!(window(Crop::Shares([0.999, 0.999, 0.0001, 0.0001])), Some([199, 99, 1, 1]));
    assert_eq!(window(Crop::Pixels([199, 99, 1, 1])), Some([199, 99, 1, 1]));
    for wrong in [[199, 99, 2, 1], [0, 0, 0, 5], [0, 100, 1, 1], [u32::MAX, 0, u32::MAX, 1]] {
        assert_eq!(window(Crop::Pixels(wrong)), None, "{wrong:?}");
    }
}

#[test]
fn groups_of_lights() {
    let mut file = Glb::new();
    file.json["scenes"][0]["extras"] = caustique(json!({"environment": {"color": [1, 1, 1], "light_group": "sky"}}));
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}, {"type": "directional"}]}});
    let light = |light: usize, keys: Value| json!({"extensions": {"KHR_lights_punctual": {"light": light}}, "extras": caustique(keys)});
    file.node(light(0, json!({"light_group": "key light"})));
    file.node(light(1, json!({"light_groop": "sky"})));
    let description = read(&file);
    let groups: Vec<_> = description.lights.iter().map(|light| light.light_group.as_deref()).collect();
    assert_eq!((groups, description.environment_light_group.as_deref()), (vec![Some("key light"), None], Some("sky")));
    assert!(
        description
            .warnings
            .iter()
            .any(|warning| warning.contains("no key \"light_groop\" (did you mean \"light_group\"?)"))
    );
    let scene = caustique::scene::Scene::build(description, 1).expect("a scene");
    assert_eq!(scene.lights.groups().names, ["key_light", "sky"]);
}

/// A view of the whole scene shows all vertices, for any shape of the picture, and leaves no more than a tenth of it
/// empty at the nearest edges.
#[test]
fn a_view_of_the_whole_scene_frames_it() {
    let mut file = Glb::new();
    let mesh = file.cube("cube", None);
    file.node(json!({"mesh": mesh, "translation": [5, -3, 2], "scale": [3, 1, 0.2]}));
    let scene = caustique::scene::Scene::build(read(&file), 1).expect("a scene");
    let (width, height) = (200, 100);
    for orbit in ["30,20", "0,0", "90,0", "-135,-40", "200,90", "30,-90"] {
        for (width, height) in [(width, height), (height, width)] {
            let orbit = Some(orbit.parse().expect("it is a view"));
            let size = (Some(width), Some(height));
            let request = CameraRequest { orbit, width: size.0, height: size.1, ..CameraRequest::default() };
            let camera = scene.camera(&request).expect("a camera");
            let film = scene.shapes.points().map(|p| camera.sample(p, Vec2::splat(0.5)).expect("it is seen").film);
            let half = Vec2::new(width as f32, height as f32) / 2.0;
            let extent = film.map(|p| ((p - half) / half).abs().max_element()).fold(0.0, f32::max);
            assert!((0.89..0.91).contains(&extent), "{orbit:?}, {width} x {height}: {extent}");
        }
    }
    let distance = |orbit: &str| {
        let orbit = Some(orbit.parse().expect("it is a view"));
        let camera = scene.camera(&CameraRequest { orbit, ..CameraRequest::default() }).expect("a camera");
        camera.position().distance(Vec3::new(5.0, -3.0, 2.0))
    };
    assert!((distance("30,20,7.5") - 7.5).abs() < 1e-5);
    assert!((distance("30,20,200%") - 2.0 * distance("30,20")).abs() < 1e-4);
}
