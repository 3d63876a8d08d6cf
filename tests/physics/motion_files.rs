//! Motion blur of glTF files: everything that a file may animate, against the mean of still pictures. Error rate of each
//! test: 1e-4.

#[path = "../files/gltf/glb.rs"]
mod glb;

use crate::motion::{rendered, settings};
use crate::support::channels::{self, SIZE, agree, disagreeing};
use crate::support::scenes::square;
use caustique::camera::Camera;
use caustique::error::Result;
use caustique::render::{Method, Motion, RenderInput, Rendered, Settings};
use caustique::scene::gltf::{FileMoments, FrameTime, MovingFile, ReadOptions, read_bytes};
use caustique::scene::{MomentBuilder, Scene};
use glam::DQuat;
use glb::Glb;
use serde_json::{Value, json};
use std::path::Path;

/// Times at which the shutter opens and closes, in frames relative to frame 1.
const SHUTTER: [f64; 2] = [-0.5, 0.5];
/// Number of stills of a seed. Their moments are equally far apart; those of all seeds together are, too.
const STILLS: u64 = 16;
const SEEDS: u64 = 12;

/// Choices about reading the scene at `seconds`, with a frame of one second.
fn options(seconds: f64, shutter: [f64; 2]) -> ReadOptions {
    let frame = Some(FrameTime { number: 1, rate: Some(1.0 / seconds), of_sequence: false });
    ReadOptions { frame, shutter: Some(shutter), ..ReadOptions::default() }
}

fn name() -> &'static Path {
    Path::new("moving.glb")
}

/// The moments of a file.
struct FileMotion<'a>(FileMoments<'a>, MomentBuilder<'a>);

impl Motion for FileMotion<'_> {
    fn at(&self, time: f64) -> Result<(Scene, Camera)> {
        let FileMotion(moments, builder) = self;
        let scene =
            builder.build(moments.describe(SHUTTER[0] + (SHUTTER[1] - SHUTTER[0]) * time, builder.meshes())?)?;
        let camera = scene.camera(&square(SIZE))?;
        Ok((scene, camera))
    }
}

fn blurred(file: &Glb, settings: &Settings) -> Rendered {
    let (description, file) =
        MovingFile::from_bytes(file.bytes().into(), name(), &options(1.0, SHUTTER)).expect("a scene");
    let scene = Scene::build(description, 1).expect("Embree");
    let file = file.expect("it moves");
    let motion = FileMotion(file.moments().expect("moments"), MomentBuilder::new(&scene));
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    rendered(&RenderInput::new(&scene, &camera, settings).with_motion(Some(&motion)))
}

fn still(file: &Glb, seconds: f64, settings: &Settings) -> Rendered {
    let description = read_bytes(&file.bytes(), name(), &options(seconds, [0.0; 2])).expect("a scene");
    let scene = Scene::build(description, 1).expect("Embree");
    let camera = scene.camera(&square(SIZE)).expect("a camera");
    rendered(&RenderInput::new(&scene, &camera, settings))
}

/// Checks that the blurred picture of a file is the mean of stills. The still picture at which the shutter opens must be
/// rejected.
fn is_mean_of_stills(what: &str, file: &Glb, method: Method, iterations: u64, bias: f64) {
    is_mean_of_stills_with(what, file, |iterations, seed| settings(method, iterations, seed), iterations, bias);
}

/// Does the work of [`is_mean_of_stills`] with other settings, as a function of the number of iterations and the seed.
fn is_mean_of_stills_with(what: &str, file: &Glb, settings: impl Fn(u64, u64) -> Settings, iterations: u64, bias: f64) {
    let method = settings(1, 0).method;
    let mean_of_stills = |seed: u64| {
        let mut sums = vec![0.0; 3 * channels::TILES];
        for k in 0..STILLS {
            let moment = (k as f64 + (seed as f64 + 0.5) / SEEDS as f64) / STILLS as f64;
            let seconds = 1.0 + SHUTTER[0] + (SHUTTER[1] - SHUTTER[0]) * moment;
            let still = channels::tiles(&still(file, seconds, &settings(2, 1000 * (seed + 1) + k)));
            sums.iter_mut().zip(still).for_each(|(sum, value)| *sum += value / STILLS as f64);
        }
        sums
    };
    let reference: Vec<Vec<f64>> = (0..SEEDS).map(mean_of_stills).collect();
    let blurs = channels::seeds(method, SEEDS, |seed| blurred(file, &settings(iterations, seed)));
    agree(what, &blurs, &reference, bias, 0.3);
    let stills = channels::seeds(method, SEEDS, |seed| still(file, 1.0 + SHUTTER[0], &settings(iterations, seed)));
    assert!(!disagreeing(&stills, &reference, bias).is_empty(), "{what}: a still picture passes the test");
}

/// A floor, a lamp above it, a camera that looks down on both, and an animation without channels.
fn stage() -> Glb {
    let mut file = Glb::new();
    let grey = json!({"name": "grey", "pbrMetallicRoughness": {"baseColorFactor": [0.7, 0.5, 0.3, 1.0], "metallicFactor": 0.0}});
    let grey = file.push("materials", grey);
    let glow = file.push("materials", json!({"name": "glow", "emissiveFactor": [1.0, 1.0, 1.0], "doubleSided": true}));
    let square = |y: f32, side: f32| [[-side, y, side], [side, y, side], [side, y, -side], [-side, y, -side]];
    let floor = file.mesh("floor", &square(0.0, 2.0), &[0, 1, 2, 0, 2, 3], Some(grey));
    let lamp = file.mesh("lamp", &square(3.0, 0.8), &[0, 1, 2, 0, 2, 3], Some(glow));
    file.node(json!({"name": "floor", "mesh": floor}));
    file.node(json!({"name": "lamp", "mesh": lamp}));
    let camera = json!({"type": "perspective", "perspective": {"yfov": 0.6, "aspectRatio": 1.0, "znear": 0.1}});
    let camera = file.push("cameras", camera);
    let down = DQuat::from_rotation_x(-0.75).as_quat().to_array();
    file.node(json!({"name": "camera", "camera": camera, "translation": [0.0, 3.2, 3.4], "rotation": down}));
    file.push("animations", json!({"channels": [], "samplers": []}));
    file
}

/// Animates a value from 0 s to 2 s, linearly between the values.
fn animate<const N: usize>(file: &mut Glb, target: Value, values: [[f32; N]; 2]) {
    let (input, output) = (file.floats(&[[0.0], [2.0]]), file.floats(&values));
    let animation = &mut file.json["animations"][0];
    let list = |animation: &mut Value, key: &str, item: Value| {
        let list = animation[key].as_array_mut().expect("a list");
        list.push(item);
        list.len() - 1
    };
    let sampler = list(animation, "samplers", json!({"input": input, "output": output, "interpolation": "LINEAR"}));
    list(animation, "channels", json!({"sampler": sampler, "target": target}));
}

fn pointer(to: &str) -> Value {
    json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": to}}})
}

fn turned(angle: f64) -> [f32; 4] {
    DQuat::from_rotation_y(angle).as_quat().to_array()
}

#[test]
fn a_rotating_child_of_a_scaled_parent_is_blurred() {
    let mut file = stage();
    let cube = file.cube("cube", Some(0));
    let child = file.push(
        "nodes",
        json!({"name": "child", "mesh": cube, "scale": [0.7, 0.2, 0.1], "translation": [0.4, 0.3, 0.0]}),
    );
    let parent = file.node(json!({"name": "parent", "children": [child], "scale": [1.0, 1.0, 0.6]}));
    animate(&mut file, json!({"node": parent, "path": "rotation"}), [turned(-1.5), turned(1.5)]);
    is_mean_of_stills("rotation", &file, Method::Path, 32, 0.005);
}

/// A scale that passes through zero thickness, where Embree cannot instance the mesh.
#[test]
fn a_scaled_object_is_blurred() {
    let mut file = stage();
    let cube = file.cube("cube", Some(0));
    let node = file.node(json!({"name": "thing", "mesh": cube, "translation": [0.0, 0.5, 0.0]}));
    animate(&mut file, json!({"node": node, "path": "scale"}), [[0.2, 0.3, 1e-6], [1.2, 0.3, 0.8]]);
    is_mean_of_stills("scale", &file, Method::Path, 32, 0.005);
}

/// Two absorbing cubes of equal priority that overlap, one of which grows beyond the other while the shutter is open: the
/// smaller one fills the space at each moment.
#[test]
fn the_smaller_of_two_solids_fills_the_space_at_each_moment() {
    let mut file = stage();
    for (name, sigma, translation) in [("grows", 4.0, [0.0, 0.6, 0.0]), ("stays", 0.2, [0.1, 0.7, 0.05])] {
        let mut matter = glass();
        matter["name"] = json!(name);
        matter["extensions"]["KHR_materials_ior"]["ior"] = json!(1.0);
        matter["extras"] = json!({"caustique": {"medium": {"sigma_a": [sigma, sigma, sigma]}}});
        let matter = file.push("materials", matter);
        let cube = file.cube(name, Some(matter));
        file.node(json!({"name": name, "mesh": cube, "translation": translation, "scale": [0.5, 0.5, 0.5]}));
    }
    animate(&mut file, json!({"node": 3, "path": "scale"}), [[0.35; 3], [0.65; 3]]);
    is_mean_of_stills("overlap", &file, Method::Path, 32, 0.005);
}

/// A lamp of finite size that is dark until the frame, in a scene without another light.
#[test]
fn a_light_that_is_dark_at_the_frame_is_blurred() {
    let mut file = stage();
    file.json["materials"][1]["emissiveFactor"] = json!([0.0, 0.0, 0.0]);
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 0.0,
        "extras": {"caustique": {"radius": 0.15}}}]}});
    let lamp =
        json!({"name": "ball", "translation": [0.3, 0.6, 0.0], "extensions": {"KHR_lights_punctual": {"light": 0}}});
    file.node(lamp);
    // Each still would guess the unit from its own intensity.
    file.json["scenes"][0]["extras"] = json!({"caustique": {"light_units": "photometric"}});
    animate(&mut file, pointer("/extensions/KHR_lights_punctual/lights/0/intensity"), [[-9000.0], [9000.0]]);
    is_mean_of_stills("dark light", &file, Method::Path, 32, 0.005);
    is_mean_of_stills("dark light", &file, Method::Vcm, 32, 0.03);
}

#[test]
fn a_moving_camera_is_blurred() {
    let mut file = stage();
    let cube = file.cube("cube", Some(0));
    file.node(json!({"name": "thing", "mesh": cube, "scale": [0.4, 0.4, 0.4]}));
    animate(&mut file, json!({"node": 2, "path": "translation"}), [[-1.0, 3.2, 3.4], [1.0, 3.0, 3.4]]);
    animate(&mut file, pointer("/cameras/0/perspective/yfov"), [[0.5], [0.9]]);
    is_mean_of_stills("camera", &file, Method::Path, 32, 0.005);
}

/// A lamp of finite size that moves and changes its power, and a material that changes its colour and its glow.
#[test]
fn moving_lights_and_materials_are_blurred() {
    let mut file = stage();
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 1000.0,
        "extras": {"caustique": {"radius": 0.15}}}]}});
    let lamp = file.node(json!({"name": "ball", "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    animate(&mut file, json!({"node": lamp, "path": "translation"}), [[-1.5, 0.6, 0.0], [1.5, 0.6, 0.0]]);
    animate(&mut file, pointer("/extensions/KHR_lights_punctual/lights/0/intensity"), [[100.0], [3000.0]]);
    animate(&mut file, pointer("/materials/1/emissiveFactor"), [[0.2, 0.2, 0.2], [1.0, 0.0, 0.0]]);
    let color = "/materials/0/pbrMetallicRoughness/baseColorFactor";
    animate(&mut file, pointer(color), [[0.1, 0.9, 0.3, 1.0], [0.9, 0.1, 0.3, 1.0]]);
    is_mean_of_stills("lights and materials", &file, Method::Path, 32, 0.005);
    is_mean_of_stills("lights and materials", &file, Method::Vcm, 32, 0.03);
}

#[test]
fn morph_targets_and_skins_are_blurred() {
    let mut file = stage();
    let side = file.mesh(
        "side",
        &[[-0.3, 0.1, 0.6], [0.3, 0.1, 0.6], [0.3, 0.1, -0.6], [-0.3, 0.1, -0.6]],
        &[0, 1, 2, 0, 2, 3],
        Some(0),
    );
    let target = file.floats(&[[0.0; 3], [1.2, 0.5, 0.0], [0.9, 0.9, 0.0], [0.0; 3]]);
    file.json["meshes"][side]["primitives"][0]["targets"] = json!([{"POSITION": target}]);
    let morphed = file.node(json!({"name": "morphed", "mesh": side}));
    animate(&mut file, json!({"node": morphed, "path": "weights"}), [[0.0], [1.0]]);
    // A bar whose second half follows a joint.
    let points =
        [[-1.5, 0.3, 0.2], [-1.5, 0.3, -0.2], [-0.9, 0.3, 0.2], [-0.9, 0.3, -0.2], [-0.3, 0.3, 0.2], [-0.3, 0.3, -0.2]];
    let bar = file.mesh("bar", &points, &[0, 2, 3, 0, 3, 1, 2, 4, 5, 2, 5, 3], Some(0));
    let joints = file.view(&[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
    let joints =
        file.push("accessors", json!({"bufferView": joints, "componentType": 5121, "type": "VEC4", "count": 6}));
    let weights = file.floats(&[[1.0, 0.0, 0.0, 0.0]; 6]);
    let attributes = &mut file.json["meshes"][bar]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    let (root, tip) = (file.node(json!({"name": "root"})), file.node(json!({"name": "tip"})));
    file.push("skins", json!({"joints": [root, tip]}));
    file.node(json!({"name": "bar", "mesh": bar, "skin": 0}));
    animate(&mut file, json!({"node": tip, "path": "translation"}), [[-0.4, -0.2, -0.8], [0.2, 0.6, 0.8]]);
    is_mean_of_stills("morph targets and skins", &file, Method::Path, 32, 0.005);
}

fn glass() -> Value {
    json!({"name": "glass", "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.0},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0},
            "KHR_materials_volume": {"thicknessFactor": 1.0}, "KHR_materials_ior": {"ior": 1.5}}})
}

/// A glass block that slides over the floor it touches: the ray queries of touching surfaces follow it.
#[test]
fn a_glass_block_that_slides_on_the_floor_is_blurred() {
    let mut file = stage();
    let glass = file.push("materials", glass());
    let cube = file.cube("block", Some(glass));
    let node = file.node(json!({"name": "block", "mesh": cube, "scale": [0.4, 0.3, 0.4]}));
    animate(&mut file, json!({"node": node, "path": "translation"}), [[-1.4, 0.3, 0.2], [1.4, 0.3, 0.2]]);
    is_mean_of_stills("glass", &file, Method::Vcm, 32, 0.03);
    is_mean_of_stills("glass", &file, Method::Cppm, 32, 0.05);
}

#[test]
#[ignore = "long"]
fn guided_light_paths_follow_moving_glass_and_lights() {
    check_guided(Method::Vcm, 0.03);
}

#[test]
#[ignore = "long"]
fn guided_photons_follow_moving_glass_and_lights() {
    check_guided(Method::Cppm, 0.05);
}

/// Guided light paths follow targets that move, and lights that change their share of the power.
fn check_guided(method: Method, bias: f64) {
    let mut file = stage();
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 1000.0,
        "extras": {"caustique": {"radius": 0.1}}}]}});
    let lamp = file.node(json!({"name": "ball", "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    animate(&mut file, json!({"node": lamp, "path": "translation"}), [[-1.0, 2.0, 0.0], [1.0, 2.0, 0.0]]);
    animate(&mut file, pointer("/extensions/KHR_lights_punctual/lights/0/intensity"), [[100.0], [9000.0]]);
    let glass = file.push("materials", glass());
    let cube = file.cube("block", Some(glass));
    let node = file.node(json!({"name": "block", "mesh": cube, "scale": [0.3, 0.3, 0.3]}));
    animate(&mut file, json!({"node": node, "path": "translation"}), [[-1.2, 0.6, 0.2], [1.2, 0.6, 0.2]]);
    let guided = |iterations, seed| Settings { guided: true, ..settings(method, iterations, seed) };
    is_mean_of_stills_with("guided", &file, guided, 32, bias);
}
