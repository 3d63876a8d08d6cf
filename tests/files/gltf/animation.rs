//! Animations, morph targets and skins at a given time, compared with closed forms.

use super::glb::Glb;
use super::message;
use caustique::error::Error;
use caustique::math::{DVec3, Vec3};
use caustique::scene::Description;
use caustique::scene::description::Projection;
use caustique::scene::gltf::{FrameTime, MovingFile, ReadOptions, read_bytes};
use glam::DQuat;
use serde_json::{Value, json};
use std::path::Path;

/// Reads the file at a time, as a frame at 10 frames per second, or at another rate if the frame would be fractional.
fn at(file: &Glb, seconds: f64) -> Result<Description, Error> {
    let frame = Some(FrameTime { number: 1, rate: Some(1.0 / seconds.max(1e-12)), of_sequence: false });
    read_bytes(&file.bytes(), Path::new("pool.glb"), &ReadOptions { frame, ..ReadOptions::default() })
}

/// A cube on a node named "thing", and an animation named "act" without channels.
fn thing() -> Glb {
    let mut file = Glb::new();
    let mesh = file.cube("cube", None);
    file.node(json!({"name": "thing", "mesh": mesh}));
    file.push("animations", json!({"name": "act", "channels": [], "samplers": []}));
    file
}

/// Adds a channel to the animation of that index.
fn channel<const N: usize>(
    file: &mut Glb,
    animation: usize,
    target: Value,
    kind: &str,
    times: &[f32],
    values: &[[f32; N]],
) {
    let times: Vec<[f32; 1]> = times.iter().map(|t| [*t]).collect();
    let (input, output) = (file.floats(&times), file.floats(values));
    let animation = &mut file.json["animations"][animation];
    let samplers = animation["samplers"].as_array_mut().unwrap();
    samplers.push(json!({"input": input, "output": output, "interpolation": kind}));
    let sampler = samplers.len() - 1;
    animation["channels"].as_array_mut().unwrap().push(json!({"sampler": sampler, "target": target}));
}

fn moves(kind: &str, times: &[f32], values: &[[f32; 3]]) -> Glb {
    let mut file = thing();
    channel(&mut file, 0, json!({"node": 0, "path": "translation"}), kind, times, values);
    file
}

/// Position of the thing.
fn place(file: &Glb, seconds: f64) -> DVec3 {
    at(file, seconds).unwrap_or_else(|e| panic!("{e}")).instances[0].to_world.translation
}

fn near(a: DVec3, b: DVec3) {
    assert!((a - b).length() < 1e-6, "{a} instead of {b}");
}

const KEYS: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [3.0, 8.0, 0.0], [3.0, 0.0, -4.0]];

#[test]
fn steps_and_lines() {
    let (steps, lines) = (moves("STEP", &[1.0, 2.0, 4.0], &KEYS), moves("LINEAR", &[1.0, 2.0, 4.0], &KEYS));
    for (seconds, step, line) in [
        (0.5, KEYS[0], KEYS[0]),
        (1.0, KEYS[0], KEYS[0]),
        (1.25, KEYS[0], [1.5, 2.0, 0.0]),
        (2.0, KEYS[1], KEYS[1]),
        (3.5, KEYS[1], [3.0, 2.0, -3.0]),
        (4.0, KEYS[2], KEYS[2]),
        (9.0, KEYS[2], KEYS[2]),
    ] {
        near(place(&steps, seconds), Vec3::from_array(step).as_dvec3());
        near(place(&lines, seconds), Vec3::from_array(line).as_dvec3());
    }
}

/// A frame shows a key even if the key's time in f32 is rounded to after the frame.
#[test]
fn frames_show_their_keys() {
    for number in 1..200u32 {
        let key = number as f32 / 24.0;
        let file = moves("STEP", &[key - 0.01, key], &KEYS[..2]);
        let frame = Some(FrameTime { number, rate: Some(24.0), of_sequence: false });
        let options = ReadOptions { frame, ..ReadOptions::default() };
        let scene = read_bytes(&file.bytes(), Path::new("pool.glb"), &options).unwrap();
        assert_eq!(scene.instances[0].to_world.translation.y, 8.0, "frame {number}");
    }
}

/// A cubic spline reproduces a cubic polynomial. Tangents are per second, for any distance between keys.
#[test]
fn cubic_splines_are_hermite() {
    let cubic = |t: f64| DVec3::new(t * t * t - t, 2.0 - t * t, 0.5 * t);
    let slope = |t: f64| DVec3::new(3.0 * t * t - 1.0, -2.0 * t, 0.5);
    let times = [0.5f32, 1.5, 4.5];
    let three = |p: DVec3| p.as_vec3().to_array();
    let keys: Vec<[f32; 3]> = times
        .iter()
        .flat_map(|t| [slope(f64::from(*t)), cubic(f64::from(*t)), slope(f64::from(*t))].map(three))
        .collect();
    let file = moves("CUBICSPLINE", &times, &keys);
    for seconds in [0.5, 0.7, 1.5, 2.0, 3.3, 4.5] {
        let found = place(&file, seconds);
        assert!((found - cubic(seconds)).length() < 1e-4, "{found} at {seconds}");
    }
    near(place(&file, 7.0), cubic(4.5).as_vec3().as_dvec3());
}

/// Rotations follow the shorter arc at constant speed, for any signs of the quaternions.
#[test]
fn rotations_are_slerped() {
    let (start, end) = (DQuat::from_rotation_y(0.3), DQuat::from_rotation_y(0.3 + 2.4));
    for sign in [1.0, -1.0] {
        let mut file = thing();
        let keys = [start.as_quat().to_array(), (end * sign).as_quat().to_array()];
        channel(&mut file, 0, json!({"node": 0, "path": "rotation"}), "LINEAR", &[0.0, 1.0], &keys);
        for seconds in [0.25, 0.5, 0.9] {
            let turned = at(&file, seconds).unwrap().instances[0].to_world.transform_vector3(DVec3::X);
            near(turned, DQuat::from_rotation_y(0.3 + 2.4 * seconds) * DVec3::X);
        }
    }
    // A spline of quaternions is normalized.
    let mut file = thing();
    let still = [0.0; 4];
    let keys = [still, start.as_quat().to_array(), still, still, end.as_quat().to_array(), still];
    channel(&mut file, 0, json!({"node": 0, "path": "rotation"}), "CUBICSPLINE", &[0.0, 1.0], &keys);
    let matrix = at(&file, 0.5).unwrap().instances[0].to_world.matrix3;
    assert!((matrix.determinant() - 1.0).abs() < 1e-6);
    near(matrix * DVec3::X, DQuat::from_rotation_y(1.5) * DVec3::X);
}

/// Cameras, lamps and materials are animated, by node and by pointer, and children follow their parents.
#[test]
fn cameras_lamps_and_materials_move() {
    let mut file = thing();
    let material = file.push("materials", json!({"name": "red"}));
    file.json["meshes"][0]["primitives"][0]["material"] = json!(material);
    file.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}));
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 683}]}});
    let camera = file.push("nodes", json!({"name": "eye", "camera": 0, "translation": [0, 1, 0]}));
    let lamp = file.push("nodes", json!({"name": "lamp", "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    file.json["nodes"][0]["children"] = json!([camera, lamp]);
    channel(&mut file, 0, json!({"node": 0, "path": "translation"}), "LINEAR", &[0.0, 1.0], &KEYS[..2]);
    // As exporters write them, one animation per action.
    file.push("animations", json!({"name": "light", "channels": [], "samplers": []}));
    let pointer = |to: &str| json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": to}}});
    let lamp = "/extensions/KHR_lights_punctual/lights/0/intensity";
    channel(&mut file, 1, pointer(lamp), "LINEAR", &[0.0, 1.0], &[[683.0], [1366.0]]);
    channel(&mut file, 1, pointer("/cameras/0/perspective/yfov"), "LINEAR", &[0.0, 1.0], &[[0.5], [0.9]]);
    let color = "/materials/0/pbrMetallicRoughness/baseColorFactor";
    channel(&mut file, 1, pointer(color), "STEP", &[0.0, 0.5], &[[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]]);
    channel(&mut file, 1, pointer("/materials/0/extensions/EXT_odd/factor"), "STEP", &[0.0], &[[1.0]]);
    let scene = at(&file, 0.5).unwrap();
    near(scene.cameras[0].to_world.translation, DVec3::new(2.0, 5.0, 0.0));
    near(scene.lights[0].to_world.translation, DVec3::new(2.0, 4.0, 0.0));
    assert_eq!(scene.lights[0].intensity, Vec3::splat(1.5).to_array().into());
    let Projection::Perspective { yfov, .. } = scene.cameras[0].projection else { panic!("not perspective") };
    assert!((yfov - 0.7).abs() < 1e-6);
    assert_eq!(scene.materials[0].base_color, [0.0, 1.0, 0.0, 1.0]);
    let lost = "animation \"light\", channel 3: it moves /materials/0/extensions/EXT_odd/factor, which cannot be \
                animated: it is ignored";
    assert_eq!(scene.warnings, [lost]);
}

/// If two animations move the same property, only the first is played.
#[test]
fn the_first_of_two_actions_is_played() {
    let mut file = moves("LINEAR", &[0.0, 1.0], &KEYS[..2]);
    file.push("animations", json!({"name": "other", "channels": [], "samplers": []}));
    channel(&mut file, 1, json!({"node": 0, "path": "translation"}), "STEP", &[0.0], &[[9.0; 3]]);
    let scene = at(&file, 1.0).unwrap();
    near(scene.instances[0].to_world.translation, DVec3::new(3.0, 8.0, 0.0));
    let both = "animation \"act\" and animation \"other\" move the same value: animation \"act\" is used (--animation \
                chooses one)";
    assert_eq!(scene.warnings, [both]);
}

/// A shutter that opens and closes at once, of the user or of the file, shows that moment without blur.
#[test]
fn a_shutter_of_no_length() {
    let mut file = moves("LINEAR", &[0.0, 2.0], &[[0.0; 3], [8.0, 0.0, 0.0]]);
    let read = |file: &Glb, shutter: Option<f64>| {
        let frame = Some(FrameTime { number: 1, rate: Some(2.0), of_sequence: false });
        let shutter = shutter.map(|time| [time; 2]);
        let options = ReadOptions { frame, shutter, motion_vectors: true, ..ReadOptions::default() };
        let (scene, moving) = MovingFile::from_bytes(file.bytes().into(), Path::new("pool.glb"), &options).unwrap();
        assert_eq!(scene.shutter, None);
        let before = moving.expect("it moves").moments().unwrap().describe_pose(-1.0).unwrap();
        [scene, before].map(|of| of.instances[0].to_world.translation.x)
    };
    for (time, places) in [(0.0, [2.0, 0.0]), (0.75, [3.5, 1.5]), (-0.5, [1.0, 0.0])] {
        assert_eq!(read(&file, Some(time)), places, "{time}");
        file.json["scenes"][0]["extras"] = json!({"caustique": {"shutter": [time, time]}});
        assert_eq!(read(&file, None), places, "{time}, of the file");
    }
}

/// A file of one frame says its time in the animations, whatever frame is asked for.
#[test]
fn the_time_of_the_only_frame() {
    let mut file = moves("LINEAR", &[0.0, 2.0], &[[0.0; 3], [8.0, 0.0, 0.0]]);
    file.json["scenes"][0]["extras"] = json!({"caustique": {"frame": 90, "frame_rate": 4, "time": 0.5}});
    let read = |frame: Option<(u32, bool)>, after_frame| {
        let frame = frame.map(|(number, of_sequence)| FrameTime { number, rate: Some(24.0), of_sequence });
        let options = ReadOptions { frame, shutter: Some([-1.0, 3.0]), ..ReadOptions::default() };
        let (scene, moving) = MovingFile::from_bytes(file.bytes().into(), Path::new("pool.glb"), &options).unwrap();
        let moments = moving.as_ref().expect("it moves").moments().unwrap();
        let moment = moments.describe(after_frame, &scene.meshes).unwrap();
        (moment.instances[0].to_world.translation.x, scene.warnings)
    };
    for frame in [None, Some((90, true)), Some((7, true))] {
        for (after_frame, x) in [(0.0, 2.0), (-1.0, 1.0), (3.0, 5.0)] {
            assert_eq!(read(frame, after_frame), (x, vec![]), "{frame:?}");
        }
    }
    let same = "its animations are the motion of one frame: its frames are all the same";
    assert_eq!(read(Some((91, false)), 0.0), (2.0, vec![same.into()]));
}

/// The frame rate of the scene, else of the option, else 24. Without a frame, the first key is used.
#[test]
fn frame_rates() {
    let mut file = moves("LINEAR", &[0.5, 100.5], &[[0.5, 0.0, 0.0], [100.5, 0.0, 0.0]]);
    let seconds = |file: &Glb, number: Option<u32>, rate| {
        let frame = number.map(|number| FrameTime { number, rate, of_sequence: false });
        let options = ReadOptions { frame, ..ReadOptions::default() };
        let scene = read_bytes(&file.bytes(), Path::new("pool.glb"), &options).map_err(|e| message(&e))?;
        Ok::<_, String>((scene.instances[0].to_world.translation.x, scene.warnings))
    };
    let near = |found: Result<(f64, Vec<String>), String>, expected: f64, warnings: &[&str]| {
        let (x, said) = found.unwrap();
        assert!((x - expected).abs() < 1e-5 && said == warnings, "{x} {said:?}");
    };
    let guess = "the file has no frame rate: 24 frames per second are assumed (--frame-rate sets them)";
    near(seconds(&file, Some(60), None), 2.5, &[guess]);
    near(seconds(&file, Some(60), Some(30.0)), 2.0, &[]);
    let first = "its animations begin at 0.500 s, which is rendered (--frames chooses)";
    near(seconds(&file, None, None), 0.5, &[first]);
    for (rate, x) in [(json!(50), 1.2), (json!([24000, 1001]), 60.0 * 1001.0 / 24000.0)] {
        file.json["scenes"][0]["extras"] = json!({"caustique": {"frame_rate": rate}});
        near(seconds(&file, Some(60), Some(30.0)), x, &[]);
    }
    let above_zero = "extras.caustique.frame_rate must be one or two whole numbers above zero";
    for (wrong, expected) in
        [(json!(0), above_zero), (json!([24, 0]), above_zero), (json!(-1), "a whole number, or two")]
    {
        file.json["scenes"][0]["extras"] = json!({"caustique": {"frame_rate": wrong}});
        let error = seconds(&file, Some(60), None).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
    let mut still = thing();
    still.json["animations"] = json!([]);
    near(seconds(&still, Some(3), None), 0.0, &["nothing in the scene is animated: its frames are all the same"]);
    near(seconds(&still, None, None), 0.0, &[]);
}

/// A shape between targets: positions and normals, with the weights of the mesh, of the node, or animated ones.
#[test]
fn morph_targets() {
    let mut file = Glb::new();
    let positions = file.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let normals = file.floats(&[[0.0, 0.0, 1.0]; 3]);
    let up = file.floats(&[[0.0, 0.0, 1.0], [0.0; 3], [0.0; 3]]);
    let turned = file.floats(&[[1.0, 0.0, -1.0]; 3]);
    let wide = file.floats(&[[0.0; 3], [2.0, 0.0, 0.0], [0.0; 3]]);
    // Targets without displacements, which the file may leave out.
    let none = file.push("accessors", json!({"componentType": 5126, "type": "VEC3", "count": 3}));
    let primitive = json!({"attributes": {"POSITION": positions, "NORMAL": normals},
        "targets": [{"POSITION": up, "NORMAL": turned}, {"POSITION": wide, "NORMAL": none}]});
    let mesh = file.push("meshes", json!({"name": "m", "primitives": [primitive], "weights": [0.0, 0.5]}));
    file.node(json!({"mesh": mesh}));
    let node = file.node(json!({"mesh": mesh, "weights": [0.25, 0.0]}));
    file.node(json!({"mesh": mesh}));
    file.push("animations", json!({"channels": [], "samplers": []}));
    channel(
        &mut file,
        0,
        json!({"node": node, "path": "weights"}),
        "LINEAR",
        &[0.0, 1.0],
        &[[0.0], [0.5], [1.0], [1.5]],
    );
    let scene = at(&file, 0.5).unwrap();
    assert_eq!(scene.instances.iter().map(|i| i.mesh).collect::<Vec<_>>(), [0, 1, 0]);
    let [own, moving] = &scene.meshes[..] else { panic!("{} meshes", scene.meshes.len()) };
    assert_eq!(own.positions, [Vec3::ZERO, Vec3::X * 2.0, Vec3::Y]);
    assert_eq!(own.normals, [Vec3::Z; 3]);
    assert_eq!(moving.positions, [Vec3::Z * 0.5, Vec3::X * 3.0, Vec3::Y]);
    let half = Vec3::new(1.0, 0.0, 1.0).normalize();
    assert!(moving.normals.iter().all(|n| (*n - half).length() < 1e-6), "{:?}", moving.normals);
    assert_eq!(scene.warnings, [""; 0]);

    file.json["meshes"][mesh]["primitives"][0]["targets"][0]["NORMAL"].take();
    let said = at(&file, 0.5).unwrap().warnings;
    assert_eq!(said, ["mesh \"m\", primitive 0: its morph targets move no normals: shading is that of the base shape"]);
    file.json["accessors"][wide]["count"] = json!(2);
    let error = message(&at(&file, 0.5).unwrap_err());
    let fault = "pool.glb: mesh \"m\", primitive 0, target 1: accessor 4: 2 displacements are for 3 vertices\n";
    assert!(error.starts_with(fault), "{error}");
}

/// A bar whose upper half is bent by a joint. The position of the bar's own node does not matter.
#[test]
fn skins() {
    let mut file = Glb::new();
    let mesh = file.mesh("bar", &[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]], &[0, 1, 2], None);
    file.json["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"] =
        json!(file.floats(&[[0.1, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]]));
    let normals = json!(file.floats(&[[1.0, 0.0, 0.0]; 3]));
    let joints = file.view(&[0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0]);
    let joints =
        file.push("accessors", json!({"bufferView": joints, "componentType": 5121, "type": "VEC4", "count": 3}));
    let weights = file.floats(&[[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0], [2.0, 0.0, 0.0, 0.0]]);
    let attributes = &mut file.json["meshes"][mesh]["primitives"][0]["attributes"];
    attributes["NORMAL"] = normals;
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    // The upper joint is bound at (0, 1, 0), the lower one at the origin.
    let mut binds = [[0.0f32; 4]; 8];
    for (i, column) in binds.iter_mut().enumerate() {
        column[i % 4] = 1.0;
    }
    binds[7][1] = -1.0;
    let binds = file.floats(&binds);
    file.json["accessors"][binds]["type"] = json!("MAT4");
    file.json["accessors"][binds]["count"] = json!(2);
    let upper = file.push("nodes", json!({"name": "upper", "translation": [0, 1, 0]}));
    let lower = file.node(json!({"name": "lower", "translation": [5, 0, 0], "children": [upper]}));
    file.push("skins", json!({"name": "rig", "joints": [lower, upper], "inverseBindMatrices": binds}));
    file.node(json!({"name": "bar", "mesh": mesh, "skin": 0, "translation": [70, 70, 70]}));
    file.push("animations", json!({"channels": [], "samplers": []}));
    let turn = |angle: f64| DQuat::from_rotation_z(angle).as_quat().to_array();
    let target = json!({"node": upper, "path": "rotation"});
    channel(&mut file, 0, target, "LINEAR", &[0.0, 1.0], &[turn(0.0), turn(std::f64::consts::PI)]);
    let scene = at(&file, 0.5).unwrap();
    let (placed, mesh) = (&scene.instances[0], &scene.meshes[0]);
    let vertex = |i: usize| placed.to_world.transform_point3(mesh.positions[i].as_dvec3());
    near(vertex(0), DVec3::new(5.1, 0.0, 0.0));
    near(vertex(1), DVec3::new(5.0, 1.0, 0.0));
    // A rotation by 90 degrees about (0, 1, 0) moves (0, 2, 0) to (-1, 1, 0).
    near(vertex(2), DVec3::new(4.0, 1.0, 0.0));
    let half = Vec3::new(1.0, 1.0, 0.0).normalize();
    for (found, expected) in mesh.normals.iter().zip([Vec3::X, half, Vec3::Y]) {
        assert!((*found - expected).length() < 1e-6, "{found}");
    }
    assert_eq!(scene.warnings, [""; 0]);

    let mut odd = file.clone();
    odd.json["skins"][0]["joints"] = json!([lower]);
    let error = message(&at(&odd, 0.5).unwrap_err());
    let fault = "pool.glb: mesh \"bar\", primitive 0: joint 1 with weight 0.5 is none of the 1 of its skin\n";
    assert!(error.starts_with(fault), "{error}");
    odd = file.clone();
    odd.json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("WEIGHTS_0");
    let error = message(&at(&odd, 0.5).unwrap_err());
    assert!(error.contains("its node has a skin, but it has no joints and weights"), "{error}");
    odd = file.clone();
    odd.json["nodes"][2]["skin"] = json!(7);
    let error = message(&at(&odd, 0.5).unwrap_err());
    assert!(error.starts_with("pool.glb: node \"bar\": skin 7 does not exist"), "{error}");
}

#[test]
fn invalid_animations_are_errors() {
    let said = |file: &Glb| message(&at(file, 1.0).unwrap_err());
    let sampler = "pool.glb: animation \"act\", channel 0: sampler 0: ";
    for (times, cause) in [
        (&[1.0f32, 1.0, 2.0][..], "input: keys 0 and 1 are at 1 s and 1 s: times must grow"),
        (&[0.0, 2.0, 1.0], "input: keys 1 and 2 are at 2 s and 1 s: times must grow"),
        (&[0.0, f32::NAN, 1.0], "input: the time of key 1 is NaN s"),
        (&[-1.0, 0.0, 1.0], "input: the time of key 0 is -1 s"),
        (&[0.0, 1.0], "output: 9 numbers cannot be shared out among 2 values"),
        (&[0.0], "its values have 9 numbers instead of 3"),
    ] {
        let error = said(&moves("LINEAR", times, &KEYS));
        assert!(error.starts_with(&format!("{sampler}{cause}\nhint: ")), "{error}");
    }
    let error = said(&moves("LINEAR", &[0.0, 1.0], &[[0.0; 3], [0.0, f32::INFINITY, 0.0]]));
    assert!(error.starts_with(&format!("{sampler}output: key 1 has a value that is not finite\n")), "{error}");
    let error = said(&moves("CUBIC", &[0.0], &KEYS[..1]));
    assert!(error.starts_with("pool.glb: animation 0: unknown variant `CUBIC`"), "{error}");
    let mut file = moves("STEP", &[0.0], &KEYS[..1]);
    file.json["nodes"][0]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    let error = said(&file);
    assert!(error.contains("node \"thing\": its translation moves, but it has a matrix\n"), "{error}");
    file = moves("STEP", &[0.0], &KEYS[..1]);
    file.json["animations"][0]["channels"][0]["target"]["node"] = json!(5);
    assert!(said(&file).starts_with("pool.glb: animation \"act\", channel 0: node 5 does not exist"));
    file = moves("STEP", &[0.0], &KEYS[..1]);
    channel(&mut file, 0, json!({"node": 0, "path": "translation"}), "STEP", &[0.0], &KEYS[..1]);
    assert!(said(&file).contains("channel 1: it moves /nodes/0/translation, as another of its channels does"));
}
