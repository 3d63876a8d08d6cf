//! Lights, cameras, the environment, and the scene's extras.

use super::glb::Glb;
use super::{message, read, try_read};
use caustique::light::SpotEdge;
use caustique::math::{DVec3, Rgb};
use caustique::scene::Description;
use caustique::scene::description::{EnvironmentSource, Projection, PunctualKind};
use caustique::scene::gltf::{LightUnits, ReadOptions, read_bytes};
use caustique::scene::{environment_file, light_preset};
use serde_json::{Value, json};
use std::path::Path;

fn lamps(lights: Value, nodes: &[Value]) -> Glb {
    let mut file = Glb::new();
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
    file.json["extensionsRequired"] = json!(["KHR_lights_punctual"]);
    for node in nodes {
        file.node(node.clone());
    }
    file
}

fn on(light: usize) -> Value {
    json!({"KHR_lights_punctual": {"light": light}})
}

#[test]
fn kinds_of_lights() {
    let file = lamps(
        json!([
            {"type": "point", "intensity": 683, "color": [1, 0.5, 0], "extras": {"own": 1}},
            {"type": "spot", "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.2}, "range": 5},
            {"type": "directional", "intensity": 1366, "name": "sun"},
            {"type": "spot", "intensity": -1, "spot": {"innerConeAngle": 0.5, "outerConeAngle": 0.25}, "name": "dark"},
        ]),
        &[
            json!({"name": "bulb", "extensions": on(0), "translation": [1, 2, 3], "extras": {"caustique": {"radius": 0.5}}}),
            json!({"name": "beam", "extensions": on(1)}),
            json!({"extensions": on(2), "extras": {"caustique": {"angle_deg": 0.53}}}),
            json!({"name": "dark", "extensions": on(3), "extras": {"caustique": {"angle": 1}}}),
        ],
    );
    let scene = read(&file);
    let [bulb, beam, sun, dark] = &scene.lights[..] else { panic!() };
    assert_eq!((bulb.name.as_str(), bulb.kind, bulb.radius), ("bulb", PunctualKind::Point, 0.5));
    assert!((bulb.intensity - Rgb::new(1.0, 0.5, 0.0)).length() < 1e-6);
    assert_eq!(bulb.to_world.translation, DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(beam.kind, PunctualKind::Spot { inner: 0.1, outer: 0.2, edge: SpotEdge::Squared });
    assert!((beam.intensity.x - 1.0 / 683.0).abs() < 1e-9);
    assert_eq!((sun.name.as_str(), sun.kind), ("sun", PunctualKind::Sun { angle: 0.53f32.to_radians() }));
    assert!((sun.intensity.x - 2.0).abs() < 1e-6);
    assert_eq!(
        (dark.intensity, dark.kind),
        (Rgb::ZERO, PunctualKind::Spot { inner: 0.25, outer: 0.25, edge: SpotEdge::Squared })
    );
    assert_eq!(
        scene.warnings,
        [
            "light \"beam\": its range is ignored: light has no maximum distance",
            "node \"dark\": extras.caustique has no key \"angle\" (did you mean \"angle_deg\"?)",
            "light \"dark\": its intensity is negative; it is taken as zero",
            "light \"dark\": its cone from 0.5 to 0.25 radians is taken as 0.25 to 0.25",
        ]
    );
}

/// The unit of lights depends on the program that wrote the file: lumens for Blender, unless an option sets it.
#[test]
fn units_of_lights() {
    let mut file = lamps(json!([{"type": "point", "intensity": 683}]), &[json!({"extensions": on(0)})]);
    let with = |file: &Glb, light_units| -> Description {
        let options = ReadOptions { light_units, ..ReadOptions::default() };
        read_bytes(&file.bytes(), Path::new("x.glb"), &options).unwrap()
    };
    let intensity = |file: &Glb, units| with(file, units).lights[0].intensity.x;
    assert_eq!(intensity(&file, LightUnits::Auto), 1.0);
    let guess = |file: &Glb, units| with(file, units).guessed_units.map(|guess| (guess.photometric, guess.from));
    let blender = "generator \"Khronos glTF Blender I/O v4.5.51\"";
    assert_eq!(guess(&file, LightUnits::Auto), Some((true, blender.to_string())));
    assert_eq!(guess(&file, LightUnits::Photometric), None);
    assert_eq!(intensity(&file, LightUnits::Radiometric), 683.0);
    file.json["asset"]["generator"] = json!("THREE.GLTFExporter");
    let scene = with(&file, LightUnits::Auto);
    assert_eq!(scene.lights[0].intensity.x, 683.0);
    assert_eq!(guess(&file, LightUnits::Auto), Some((false, "generator \"THREE.GLTFExporter\"".to_string())));
    assert_eq!(
        scene.warnings,
        ["generator \"THREE.GLTFExporter\" does not state the unit of lamps: they are taken in W/sr and W/m2 \
          (--light-units decides)"]
    );
    assert_eq!(intensity(&file, LightUnits::Photometric), 1.0);
    file.json["scenes"][0]["extras"] = json!({"caustique": {"light_units": "photometric"}});
    let scene = with(&file, LightUnits::Auto);
    assert_eq!((scene.lights[0].intensity.x, scene.warnings.len()), (1.0, 0));
    assert_eq!(scene.guessed_units, None);
    assert_eq!(intensity(&file, LightUnits::Radiometric), 683.0);
}

/// Exporters before 3.6 wrote watts. The lamps of a Blender file give the same light with every exporter version.
#[test]
fn lamps_of_old_and_new_exporters_are_alike() {
    let file = |version: &str, sun: f64, lamp: f64| {
        let lights = json!([{"type": "directional", "intensity": sun}, {"type": "point", "intensity": lamp},
            {"type": "spot", "intensity": lamp}]);
        let mut file = lamps(lights, &[0, 1, 2].map(|i| json!({"extensions": on(i)})));
        file.json["asset"]["generator"] = json!(format!("Khronos glTF Blender I/O {version}"));
        read(&file)
    };
    let (sun, watts) = (3.0, 1000.0);
    for version in ["v1.8.19", "v3.3.27", "v3.5.30", "v3.6.5", "v4.3.47", "v5.0.1"] {
        let old = version < "v3.6";
        let candela = 683.0 * watts / (4.0 * std::f64::consts::PI);
        let scene = if old { file(version, sun, watts) } else { file(version, 683.0 * sun, candela) };
        let given: Vec<f64> = scene.lights.iter().map(|light| f64::from(light.intensity.x)).collect();
        for (given, expected) in given.iter().zip([sun, candela / 683.0, candela / 683.0]) {
            assert!((given / expected - 1.0).abs() < 1e-6, "{version}: {given} for {expected}");
        }
        let expected = format!(
            "generator \"Khronos glTF Blender I/O {version}\" writes lamps in Blender's watts, without 683 lumens for each \
             (--light-units decides)"
        );
        assert_eq!(scene.warnings, if old { vec![expected] } else { vec![] });
        assert_eq!(scene.guessed_units.map(|guess| guess.photometric), Some(!old));
    }
}

/// Blender's lighting mode "Unitless" omits the conversion factor, and files do not record the mode. If lamps are the
/// only lights and too dark for lumens, they count as watts.
#[test]
fn lamps_too_dark_for_lumens_are_watts() {
    // The median distance of the cube's corners from the lamp is about 5 m.
    let read = |light: Value, glows: bool| {
        let mut file = lamps(json!([light]), &[json!({"extensions": on(0), "translation": [0, 5, 0]})]);
        let material = json!({"emissiveFactor": if glows { [1, 1, 1] } else { [0, 0, 0] }});
        let material = file.push("materials", material);
        let mesh = file.cube("cube", Some(material));
        file.node(json!({"mesh": mesh}));
        read(&file)
    };
    let lamp = |kind: &str, intensity: f64| json!({"type": kind, "intensity": intensity});
    for (kind, watts) in [("point", 1000.0 / (4.0 * std::f64::consts::PI)), ("directional", 3.0)] {
        let (unitless, standard) = (read(lamp(kind, watts), false), read(lamp(kind, 683.0 * watts), false));
        let intensity = |scene: &Description| f64::from(scene.lights[0].intensity.x);
        assert!((intensity(&unitless) / intensity(&standard) - 1.0).abs() < 1e-6);
        assert_eq!(standard.warnings, [""; 0]);
        let [warning] = &unitless.warnings[..] else { panic!("{:?}", unitless.warnings) };
        assert!(warning.starts_with("its lamps would give ") && warning.contains("'Unitless'"), "{warning}");
        assert_eq!(unitless.guessed_units.map(|guess| guess.photometric), Some(false));
        // Emissive surfaces show the intended brightness of the scene.
        let glowing = read(lamp(kind, watts), true);
        assert!((intensity(&glowing) * 683.0 / watts - 1.0).abs() < 1e-6);
    }
    assert_eq!(read(lamp("point", 0.0), false).warnings, [""; 0]);
}

/// Clip planes are ignored, with a warning if they would change the picture.
#[test]
fn clip_planes() {
    let warnings = |camera: Value, at: [f64; 3]| {
        let mut file = Glb::new();
        file.push("cameras", camera);
        file.node(json!({"name": "Front", "camera": 0, "translation": at}));
        let mesh = file.cube("cube", None);
        file.node(json!({"mesh": mesh}));
        read(&file).warnings
    };
    let perspective = |znear: f64, zfar: f64| json!({"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 1, "znear": znear, "zfar": zfar}});
    let orthographic = json!({"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0.5, "zfar": 3}});
    // The near face of the cube is at a depth of 4, the far one at 6.
    let ahead = [0.0, 0.0, 5.0];
    let near = "camera \"Front\": objects nearer than its znear of 4.5 m are visible: clip planes are ignored (hide or \
                remove them)";
    let far = |zfar: &str| {
        format!(
            "camera \"Front\": objects farther than its zfar of {zfar} m are visible: clip planes are ignored (hide or \
             remove them)"
        )
    };
    assert_eq!(warnings(perspective(0.1, 100.0), ahead), [""; 0]);
    assert_eq!(warnings(perspective(4.5, 100.0), ahead), [near]);
    assert_eq!(warnings(perspective(0.1, 5.5), ahead), [far("5.5")]);
    assert_eq!(warnings(perspective(4.5, 5.5), ahead), [near.to_string(), far("5.5")]);
    // Outside of the picture, and behind the camera.
    assert_eq!(warnings(perspective(4.5, 5.5), [9.0, 0.0, 5.0]), [""; 0]);
    assert_eq!(warnings(perspective(4.5, 5.5), [0.0, 0.0, -5.0]), [""; 0]);
    assert_eq!(warnings(orthographic.clone(), ahead), [far("3")]);
    assert_eq!(warnings(orthographic, [2.5, 0.0, 5.0]), [""; 0]);
    // A cube around the camera.
    assert_eq!(warnings(perspective(0.5, 1.5), [0.0; 3]), [""; 0]);
}

#[test]
fn cameras_in_the_order_of_the_scene() {
    let mut file = Glb::new();
    let lens = json!({"caustique": {"aperture_radius": 0.01, "focus_distance": 2.5}});
    file.push(
        "cameras",
        json!({"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 1.5, "znear": 0.1},
        "extras": lens}),
    );
    file.push(
        "cameras",
        json!({"type": "orthographic", "name": "plan",
        "orthographic": {"xmag": 2, "ymag": -1, "znear": 0.1, "zfar": 10}}),
    );
    let inner = file.push("nodes", json!({"name": "eye", "camera": 0, "translation": [0, 0, 3]}));
    file.node(json!({"children": [inner], "translation": [0, 1, 0]}));
    file.node(json!({"camera": 1, "extras": {"caustique": {"aperture_radius": 0.5}}}));
    let scene = read(&file);
    let [eye, plan] = &scene.cameras[..] else { panic!() };
    assert_eq!((eye.name.as_str(), eye.aperture_radius, eye.focus_distance), ("eye", 0.01, 2.5));
    assert_eq!(eye.projection, Projection::Perspective { yfov: 0.5, aspect: Some(1.5) });
    assert_eq!(eye.to_world.translation, DVec3::new(0.0, 1.0, 3.0));
    assert_eq!((plan.name.as_str(), plan.aperture_radius), ("plan", 0.5));
    assert_eq!(plan.projection, Projection::Orthographic { xmag: 2.0, ymag: 1.0 });
    assert_eq!(scene.warnings, ["camera \"plan\": it has an aperture but no focus_distance; 1 m is used"]);
    let bad = |pointer: &str, value: Value| {
        let mut file = file.clone();
        *file.json.pointer_mut(pointer).unwrap() = value;
        message(&try_read(&file).unwrap_err())
    };
    assert_eq!(
        bad("/cameras/0/perspective/yfov", json!(4)),
        "pool.glb: node \"eye\": camera \"eye\": its yfov is 4; it must lie between 0 and pi"
    );
    assert_eq!(
        bad("/cameras/1/orthographic/xmag", json!(0)),
        "pool.glb: node 2: camera \"plan\": xmag and ymag must be finite and not zero"
    );
}

#[test]
fn environment_and_medium_of_the_scene() {
    let mut file = Glb::new();
    file.json["scenes"][0]["extras"] = json!({"caustique": {
        "environment": {"color": [0.1, 0.2, 0.3], "strength": 2, "rotation": 3},
        "medium": {"sigma_s": [0.1, 0.1, 0.1], "g": -0.5}}});
    let scene = read(&file);
    let environment = scene.environment.unwrap();
    assert!(matches!(environment.source, EnvironmentSource::Color(c) if c == Rgb::new(0.1, 0.2, 0.3)));
    assert_eq!((environment.strength, environment.rotation_deg), (2.0, 0.0));
    assert_eq!(scene.medium.map(|m| (m.sigma_a, m.g)), Some((Rgb::ZERO, -0.5)));
    assert_eq!(
        scene.warnings,
        [
            "scene \"Scene\": extras.caustique has no key \"environment.rotation\" (did you mean \"environment.rotation_deg\"?)"
        ]
    );
    file.json["scenes"][0]["extras"] = json!({"caustique": {"environment": {"file": "no sky.exr"}}});
    assert_eq!(
        message(&try_read(&file).unwrap_err()),
        "pool.glb: scene \"Scene\": no sky.exr: No such file or directory (os error 2)\n\
         hint: check the path of the environment image"
    );
}

/// Blender's exporter omits the world. This project's exporter also writes a black world.
#[test]
fn a_world_that_is_left_out() {
    let mut file = Glb::new();
    let environment = |file: &Glb| (read(file).environment_unknown, read(file).environment.is_some());
    assert_eq!(environment(&file), (true, false));
    file.json["scenes"][0]["extras"] = json!({"caustique": {"environment": {"color": [0, 0, 0]}}});
    assert_eq!(environment(&file), (false, false));
    file.json["scenes"][0]["extras"] = json!({"caustique": {"environment": {"color": [0, 0.1, 0]}}});
    assert_eq!(environment(&file), (false, true));
    let mut file = Glb::new();
    file.json["asset"]["generator"] = "by hand".into();
    assert_eq!(environment(&file), (false, false));
}

/// Nothing is added to a file with a light of any kind at any time, shown or hidden.
#[test]
fn no_light_is_added_to_a_file_with_its_own() {
    let fire = folder_with_fire();
    let gets_studio = |file: &Glb| {
        let mut scene = read_bytes(&file.bytes(), &fire.path().join("a.glb"), &ReadOptions::default()).unwrap();
        light_preset::apply(&mut scene, None);
        scene.environment.is_some()
    };
    let model = |camera: bool| {
        let mut file = Glb::new();
        let material = file.push("materials", json!({"emissiveFactor": [0, 0, 0]}));
        let mesh = file.cube("cube", Some(material));
        file.node(json!({"name": "cube", "mesh": mesh}));
        if camera {
            file.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}));
            file.node(json!({"name": "eye", "camera": 0, "translation": [0, 1, 5]}));
        }
        file
    };
    let hide = |file: &mut Glb, node: usize| {
        file.json["nodes"][node]["extensions"]["KHR_node_visibility"] = json!({"visible": false});
    };
    let lamp = |file: &mut Glb, intensity: f64| {
        file.json["extensions"] =
            json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": intensity}]}});
        file.node(json!({"name": "lamp", "extensions": on(0)}))
    };
    let animate = |file: &mut Glb, to: &str, values: &[[f32; 3]; 2]| {
        let (input, output) = (file.floats(&[[0.0], [1.0]]), file.floats(values));
        let target = json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": to}}});
        file.push(
            "animations",
            json!({"samplers": [{"input": input, "output": output}], "channels": [{"sampler": 0, "target": target}]}),
        );
    };
    for camera in [false, true] {
        assert!(gets_studio(&model(camera)), "no light");
        let mut file = model(camera);
        animate(&mut file, "/materials/0/pbrMetallicRoughness/baseColorFactor", &[[0.0; 3], [1.0; 3]]);
        assert!(gets_studio(&file), "another animation");

        let mut file = model(camera);
        lamp(&mut file, 0.0);
        assert!(!gets_studio(&file), "a dark lamp");
        let mut file = model(camera);
        let node = lamp(&mut file, 100.0);
        hide(&mut file, node);
        assert!(!gets_studio(&file), "a hidden lamp");

        let mut file = model(camera);
        file.json["materials"][0] = json!({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}},
            "extras": {"caustique": {"medium": {"density": {"file": "fire.vol"}, "emission": {"file": "fire.vol"}}}}});
        assert!(!gets_studio(&file), "a fire");
        hide(&mut file, 0);
        assert!(!gets_studio(&file), "a hidden fire");

        // In a file without a camera, surfaces that glow are no lights.
        let mut file = model(camera);
        file.json["materials"][0]["emissiveFactor"] = json!([1, 0, 0]);
        assert_eq!(gets_studio(&file), !camera, "a surface");
        hide(&mut file, 0);
        assert_eq!(gets_studio(&file), !camera, "a hidden surface");
        let mut file = model(camera);
        animate(&mut file, "/materials/0/emissiveFactor", &[[0.0; 3], [1.0; 3]]);
        assert_eq!(gets_studio(&file), !camera, "a surface that will glow");

        let mut file = model(camera);
        file.json["scenes"][0]["extras"] = json!({"caustique": {"environment": {"color": [0, 0, 0]}}});
        assert!(!gets_studio(&file), "a black environment");
    }
}

/// A folder with a grid of fire: a `.vol` file of 2 x 2 x 2 floats, of one channel, in the box from -1 to 1.
fn folder_with_fire() -> tempfile::TempDir {
    let header = [1u32, 2, 2, 2, 1].into_iter().flat_map(u32::to_le_bytes);
    let values = [[-1.0f32; 3].as_slice(), &[1.0; 3], &[1.0; 8]].concat().into_iter().flat_map(f32::to_le_bytes);
    let folder = tempfile::tempdir().unwrap();
    let bytes: Vec<u8> = b"VOL\x03".iter().copied().chain(header).chain(values).collect();
    std::fs::write(folder.path().join("fire.vol"), bytes).unwrap();
    folder
}

/// OpenEXR and Radiance images, the first beside the scene file. Values that are negative or not finite are clamped and
/// counted.
#[test]
fn environment_images() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sky.exr");
    let texel = |x: usize, y: usize| match (x, y) {
        (0, 0) => (f32::NAN, 1.0, 1.0),
        (1, 0) => (-1.0, f32::INFINITY, 2.0),
        _ => (x as f32, y as f32, 70_000.0),
    };
    exr::prelude::write_rgb_file(&path, 4, 2, texel).unwrap();
    let mut file = Glb::new();
    file.json["scenes"][0]["extras"] =
        json!({"caustique": {"environment": {"file": "sky.exr", "rotation_deg": 90, "strength": 0.5}}});
    let scene = read_bytes(&file.bytes(), &folder.path().join("a.glb"), &ReadOptions::default()).unwrap();
    let environment = scene.environment.unwrap();
    assert_eq!((environment.rotation_deg, environment.strength), (90.0, 0.5));
    let EnvironmentSource::Image { width, height, texels } = environment.source else { panic!() };
    assert_eq!((width, height), (4, 2));
    assert_eq!(texels[..2], [[0.0, 1.0, 1.0], [0.0, 65_504.0, 2.0]]);
    assert_eq!(texels[7], [3.0, 1.0, 70_000.0]);
    assert_eq!(scene.warnings, [format!("{}: 2 texels are negative or not finite and are clamped", path.display())]);

    let path = folder.path().join("sky.hdr");
    let image = image::Rgb32FImage::from_fn(3, 2, |x, y| image::Rgb([x as f32, y as f32, 0.5]));
    image.save(&path).unwrap();
    let mut warnings = Vec::new();
    let Ok(EnvironmentSource::Image { width, height, texels }) = environment_file::read(&path, &mut warnings) else {
        panic!()
    };
    assert_eq!((width, height, warnings.len()), (3, 2, 0));
    assert!((texels[5][0] - 2.0).abs() < 0.02 && (texels[5][1] - 1.0).abs() < 0.02, "{texels:?}");

    // Damaged files give an error.
    for name in ["sky.exr", "sky.hdr"] {
        let whole = std::fs::read(folder.path().join(name)).unwrap();
        let path = folder.path().join("damaged");
        for cut in [0, 5, whole.len() / 2, whole.len() - 1] {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let error = environment_file::read(&path, &mut warnings).unwrap_err();
            assert!(message(&error).contains("damaged: it "), "{name} {cut}: {error}");
        }
    }
    assert!(message(&environment_file::read(folder.path(), &mut warnings).unwrap_err()).contains("not a regular file"));
}
