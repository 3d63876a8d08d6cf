//! Motion vectors: closed forms, the layers that carry them, and equal bytes.

use crate::Folder;
use crate::glb::Glb;
use caustique::film::LayerSet;
use glam::{DQuat, DVec2};
use serde_json::{Value, json};
use std::f32::consts::{PI, TAU};

/// Width and height of the pictures (pixels).
const SIZE: usize = 64;
/// Pixels per metre of the orthographic camera, which sees 8 m.
const SCALE: f64 = 8.0;
/// Largest error of a vector (pixels).
const TOLERANCE: f64 = 2e-3;

/// A wall at z = -1 behind the middle of the view, an orthographic camera (node 1) at z = 5, and an animation without
/// channels, one frame per second.
fn stage() -> Glb {
    let mut file = Glb::new();
    file.json["scenes"][0]["extras"] = json!({"caustique": {"frame_rate": 1}});
    file.push("materials", json!({"name": "glow", "emissiveFactor": [1.0, 1.0, 1.0], "doubleSided": true}));
    square(&mut file, "wall", 3.0, -1.0, 0);
    let camera =
        json!({"type": "orthographic", "orthographic": {"xmag": 4.0, "ymag": 4.0, "znear": 0.1, "zfar": 99.0}});
    let camera = file.push("cameras", camera);
    file.node(json!({"name": "camera", "camera": camera, "translation": [0.0, 0.0, 5.0]}));
    file.push("animations", json!({"channels": [], "samplers": []}));
    file
}

/// Adds a square of half side `half` that faces the camera at depth `z`, and returns its node.
fn square(file: &mut Glb, name: &str, half: f32, z: f32, material: usize) -> usize {
    let corners = [[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]];
    let mesh = file.mesh(name, &corners, &[0, 1, 2, 0, 2, 3], Some(material));
    file.node(json!({"name": name, "mesh": mesh, "translation": [0.0, 0.0, z]}))
}

/// Animates a value with a key in each of the frames 1, 2 and 3.
fn animate<const N: usize>(file: &mut Glb, target: Value, interpolation: &str, values: [[f32; N]; 3]) {
    let (input, output) = (file.floats(&[[1.0], [2.0], [3.0]]), file.floats(&values));
    let animation = &mut file.json["animations"][0];
    let samplers = animation["samplers"].as_array_mut().expect("a list");
    samplers.push(json!({"input": input, "output": output, "interpolation": interpolation}));
    let sampler = samplers.len() - 1;
    let channels = animation["channels"].as_array_mut().expect("a list");
    channels.push(json!({"sampler": sampler, "target": target}));
}

/// A folder with the file.
fn folder(file: &Glb) -> Folder {
    let folder = Folder::new();
    std::fs::write(folder.path("moving.glb"), file.bytes()).expect("it can be written");
    folder
}

const COMMON: &str = "render moving.glb --width 64 --height 64 --method path --no-combine --progress none --overwrite";

fn run(folder: &Folder, arguments: &str) {
    let outcome = folder.run(&format!("{COMMON} {arguments}"));
    assert_eq!(outcome.code, Some(0), "{arguments}: {}", outcome.stderr);
}

/// The motion vectors of a picture, row by row from the top.
fn vectors(set: &LayerSet) -> Vec<[f64; 4]> {
    let planes = ["X", "Y", "Z", "W"]
        .map(|c| &set.get("Motion").expect("the layer Motion").plane(c).expect("four components").values);
    (0..planes[0].len()).map(|i| planes.map(|values| f64::from(values[i]))).collect()
}

/// The motion vectors of a frame of a file.
fn at_frame(file: &Glb, frame: u32, more: &str) -> Vec<[f64; 4]> {
    let folder = folder(file);
    run(&folder, &format!("--frames {frame} --iterations 1 --layers Motion -o out.exr {more}"));
    vectors(&folder.read("out.exr").0)
}

/// Centre of a pixel (m, y up) as the orthographic camera sees it.
fn place(pixel: usize) -> DVec2 {
    let (x, y) = (pixel % SIZE, pixel / SIZE);
    DVec2::new(x as f64 + 0.5 - 32.0, 31.5 - y as f64) / SCALE
}

/// Checks the vectors of all pixels except those on edges, for which `expected` gives `None`.
fn check(what: &str, found: &[[f64; 4]], expected: impl Fn(DVec2) -> Option<[f64; 4]>) {
    assert_eq!(found.len(), SIZE * SIZE);
    let mut checked = 0;
    for (pixel, vector) in found.iter().enumerate() {
        let Some(expected) = expected(place(pixel)) else { continue };
        checked += 1;
        let error = vector.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < TOLERANCE, "{what}, pixel {pixel}: {vector:?}, not {expected:?}");
    }
    assert!(checked > SIZE * SIZE / 2, "{what}: {checked} pixels were checked");
}

/// Whether a point (m) is inside of a square of half side `half`; `None` on its edge.
fn inside(at: DVec2, half: f64) -> Option<bool> {
    let far = at.abs().max_element();
    ((far - half).abs() > 0.01).then_some(far < half)
}

/// A square in front of a still wall. Numbers of Blender 4.5's pass Vector for the same motion: X = -1 and Y = -2 for
/// +1 and +2 pixels since the previous frame (y up), Z = -2 and W = -3 for +2 and +3 pixels until the next.
#[test]
fn a_moving_square_has_blenders_vectors() {
    let mut file = stage();
    let node = square(&mut file, "square", 1.0, 0.0, 0);
    let places = [[0.0, 0.0, 0.0], [0.125, 0.25, 0.0], [0.375, 0.625, 0.0]];
    animate(&mut file, json!({"node": node, "path": "translation"}), "LINEAR", places);
    // Before its first and after its last key, the square rests.
    let expected = [[0.0, 0.0, -1.0, -2.0], [-1.0, -2.0, -2.0, -3.0], [-2.0, -3.0, 0.0, 0.0]];
    for ((frame, expected), [x, y, _]) in (1..).zip(expected).zip(places) {
        let found = at_frame(&file, frame, "");
        let centre = DVec2::new(f64::from(x), f64::from(y));
        check("square", &found, |at| inside(at - centre, 1.0).map(|inside| if inside { expected } else { [0.0; 4] }));
        let still = found.iter().filter(|vector| **vector == [0.0; 4]).count();
        assert!(still > SIZE * SIZE / 2, "the wall and the background do not move at all");
    }
    let (whole, window) = (at_frame(&file, 2, ""), at_frame(&file, 2, "--crop 8,16,40,30"));
    let mut pixels = (16..46).flat_map(|y| (8..48).map(move |x| y * SIZE + x));
    assert!(pixels.all(|pixel| window[pixel] == whole[pixel]), "a window has the vectors of the whole picture");
}

/// A still wall moves against the camera, which shifts and zooms.
#[test]
fn a_moving_camera_moves_still_objects() {
    let mut file = stage();
    file.json["cameras"][0] =
        json!({"type": "perspective", "perspective": {"yfov": 1.0, "aspectRatio": 1.0, "znear": 0.1}});
    animate(
        &mut file,
        json!({"node": 1, "path": "translation"}),
        "LINEAR",
        [[-0.25, 0.0, 5.0], [0.0, 0.1, 5.0], [0.5, 0.0, 4.0]],
    );
    // Pixels per metre of the wall at the distances 6 m, 6 m and 5 m.
    let scale = |distance: f64| 32.0 / (0.5f64.tan() * distance);
    let scales = [scale(6.0), scale(6.0), scale(5.0)];
    let eyes = [DVec2::new(-0.25, 0.0), DVec2::new(0.0, 0.1), DVec2::new(0.5, 0.0)];
    check("camera", &at_frame(&file, 2, ""), |at| {
        let on_wall = at * SCALE / scales[1] + eyes[1];
        if !inside(on_wall, 3.0)? {
            return Some([0.0; 4]);
        }
        let [before, now, after] = [0, 1, 2].map(|k| (on_wall - eyes[k]) * scales[k]);
        let (since, until) = (before - now, now - after);
        Some([since.x, since.y, until.x, until.y])
    });
}

#[test]
fn a_rotating_square_moves_on_circles() {
    let mut file = stage();
    let node = square(&mut file, "square", 2.0, 0.0, 0);
    let angles = [-0.2, 0.0, 0.5];
    let turned = angles.map(|angle| DQuat::from_rotation_z(angle).as_quat().to_array());
    animate(&mut file, json!({"node": node, "path": "rotation"}), "LINEAR", turned);
    check("rotation", &at_frame(&file, 2, ""), |at| {
        if !inside(at, 2.0)? {
            return Some([0.0; 4]);
        }
        let [before, after] = [angles[0], angles[2]].map(|angle| DVec2::from_angle(angle).rotate(at));
        let (since, until) = ((before - at) * SCALE, (at - after) * SCALE);
        Some([since.x, since.y, until.x, until.y])
    });
}

/// The right side of a square moves by a morph target, beside a skinned copy whose only joint moves.
#[test]
fn meshes_that_deform_move_by_their_vertices() {
    let mut file = stage();
    let node = square(&mut file, "square", 2.0, 0.0, 0);
    let target = file.floats(&[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0; 3]]);
    file.json["meshes"][1]["primitives"][0]["targets"] = json!([{"POSITION": target}]);
    animate(&mut file, json!({"node": node, "path": "weights"}), "LINEAR", [[0.0], [0.5], [0.75]]);
    check("morph", &at_frame(&file, 2, ""), |at| {
        // A point at x, without the target, moves by weight times (x + 2) / 4.
        let x = (at.x - 0.25) / 1.125;
        if !inside(DVec2::new(x, at.y), 2.0)? {
            return Some([0.0; 4]);
        }
        let along = (x + 2.0) / 4.0 * SCALE;
        Some([-0.5 * along, 0.0, -0.25 * along, 0.0])
    });
    let mut file = stage();
    let node = square(&mut file, "skinned", 2.0, 0.0, 0);
    let joints = file.view(&[0; 16]);
    let joints =
        file.push("accessors", json!({"bufferView": joints, "componentType": 5121, "type": "VEC4", "count": 4}));
    let weights = file.floats(&[[1.0, 0.0, 0.0, 0.0]; 4]);
    let attributes = &mut file.json["meshes"][1]["primitives"][0]["attributes"];
    (attributes["JOINTS_0"], attributes["WEIGHTS_0"]) = (json!(joints), json!(weights));
    let joint = file.node(json!({"name": "joint"}));
    file.push("skins", json!({"joints": [joint]}));
    file.json["nodes"][node]["skin"] = json!(0);
    animate(
        &mut file,
        json!({"node": joint, "path": "translation"}),
        "LINEAR",
        [[-0.5, 0.0, 0.0], [0.0; 3], [0.0, 0.25, 0.0]],
    );
    check("skin", &at_frame(&file, 2, ""), |at| {
        inside(at, 2.0).map(|inside| if inside { [-4.0, 0.0, 0.0, -2.0] } else { [0.0; 4] })
    });
}

/// A still pane and a still mirror show the motion of what is seen in them.
#[test]
fn glass_and_mirrors_show_the_motion_behind_them() {
    let metal = json!({"name": "mirror", "pbrMetallicRoughness": {"metallicFactor": 1.0, "roughnessFactor": 0.0}});
    let glass = json!({"name": "pane", "doubleSided": true, "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.0},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}}});
    for (what, material, z) in [("mirror", metal, 8.0), ("pane", glass, -0.5)] {
        let mut file = stage();
        let material = file.push("materials", material);
        square(&mut file, what, 2.0, 0.0, material);
        let node = square(&mut file, "moving", 9.0, z, 0);
        animate(
            &mut file,
            json!({"node": node, "path": "translation"}),
            "LINEAR",
            [[0.0, 0.0, z], [0.125, 0.25, z], [0.375, 0.625, z]],
        );
        let outside = if what == "pane" { [-1.0, -2.0, -2.0, -3.0] } else { [0.0; 4] };
        check(what, &at_frame(&file, 2, ""), |at| {
            // Near the edge, the image leaves the mirror until the other frame.
            let far = at.abs().max_element();
            ((far - 2.0).abs() > 0.7).then_some(if far < 2.0 { [-1.0, -2.0, -2.0, -3.0] } else { outside })
        });
    }
}

/// A still mirror shows the motion of the image: a camera passes a mirror, and an object moves towards it. A glass ball,
/// which turns its image around, moves it against the object.
#[test]
fn images_move_as_they_are_seen() {
    let perspective = json!({"type": "perspective", "perspective": {"yfov": 1.0, "aspectRatio": 1.0, "znear": 0.1}});
    let metal = json!({"name": "mirror", "pbrMetallicRoughness": {"metallicFactor": 1.0, "roughnessFactor": 0.0}});
    let scale = |distance: f64| 32.0 / (0.5f64.tan() * distance);
    let mut file = stage();
    file.json["cameras"][0] = perspective.clone();
    let material = file.push("materials", metal);
    square(&mut file, "mirror", 2.9, 0.0, material);
    let node = square(&mut file, "moving", 40.0, 8.0, 0);
    let eyes = [[-0.25, 0.0, 5.0], [0.0, 0.1, 5.0], [0.5, 0.0, 5.0]];
    animate(&mut file, json!({"node": 1, "path": "translation"}), "LINEAR", eyes);
    animate(
        &mut file,
        json!({"node": node, "path": "translation"}),
        "LINEAR",
        [[0.0, 0.0, 8.5], [0.0, 0.0, 8.0], [1.0, 0.0, 7.0]],
    );
    let found = at_frame(&file, 2, "");
    let mut checked = 0;
    for (pixel, vector) in found.iter().enumerate() {
        let at = place(pixel) * SCALE;
        // The image of the square lies at z = -8, 13 m behind the camera of this frame, and moves as the square.
        let now = at / scale(13.0) + DVec2::new(0.0, 0.1);
        if (at / scale(5.0) + DVec2::new(0.0, 0.1)).abs().max_element() > 2.0 {
            continue;
        }
        let before = (now - DVec2::new(-0.25, 0.0)) * scale(13.5);
        let after = (now + DVec2::new(1.0, 0.0) - DVec2::new(0.5, 0.0)) * scale(12.0);
        let expected = [before.x - at.x, before.y - at.y, at.x - after.x, at.y - after.y];
        let error = vector.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < 0.02, "pixel {pixel}: {vector:?}, not {expected:?}");
        checked += 1;
    }
    assert!(checked > SIZE * SIZE / 3, "{checked} pixels were checked");

    let mut file = stage();
    let glass = json!({"name": "glass", "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.0},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0},
            "KHR_materials_volume": {"thicknessFactor": 1.0}, "KHR_materials_ior": {"ior": 1.5}}});
    let material = file.push("materials", glass);
    ball(&mut file, 0.5, 3.0, material);
    let node = square(&mut file, "moving", 9.0, 0.0, 0);
    animate(
        &mut file,
        json!({"node": node, "path": "translation"}),
        "LINEAR",
        [[-0.05, -0.1, 0.0], [0.0, 0.0, 0.0], [0.05, -0.1, 0.0]],
    );
    // The focal length of a ball is n r / (2 (n - 1)) from its centre: at four times that, images are a third as large. A
    // ray at a quarter of the radius from the axis is refracted some per cent more.
    let vector = at_frame(&file, 2, "")[31 * SIZE + 31];
    let expected = [0.05, 0.1, 0.05, -0.1].map(|moved| moved * SCALE / 3.0);
    assert!(vector.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < 0.15), "{vector:?}, not {expected:?}");
}

/// Adds a ball at depth `z` on the camera's axis.
fn ball(file: &mut Glb, radius: f32, z: f32, material: usize) {
    const AROUND: u32 = 96;
    let point = |ring: u32, k: u32| {
        let (polar, azimuth) = (ring as f32 * PI / AROUND as f32, k as f32 * TAU / AROUND as f32);
        [polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()]
    };
    let rings = || (0..=AROUND).flat_map(|ring| (0..AROUND).map(move |k| (ring, k)));
    let normals: Vec<[f32; 3]> = rings().map(|(ring, k)| point(ring, k)).collect();
    let corners: Vec<[f32; 3]> = normals.iter().map(|n| n.map(|x| radius * x)).collect();
    let at = |ring: u32, k: u32| ring * AROUND + k % AROUND;
    let quads = rings().filter(|(ring, _)| *ring < AROUND);
    let triangles: Vec<u32> = quads
        .flat_map(|(ring, k)| {
            let [a, b, c, d] = [at(ring, k), at(ring + 1, k), at(ring + 1, k + 1), at(ring, k + 1)];
            [a, b, c, a, c, d]
        })
        .collect();
    let mesh = file.mesh("ball", &corners, &triangles, Some(material));
    let normals = file.floats(&normals);
    file.json["meshes"][mesh]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    file.node(json!({"name": "ball", "mesh": mesh, "translation": [0.0, 0.0, z]}));
}

/// An object that is missing in the other frame moves with the camera alone, and is no error.
#[test]
fn objects_may_appear_and_vanish() {
    let mut file = stage();
    let node = square(&mut file, "square", 1.0, 0.0, 0);
    file.json["nodes"][node]["extensions"] = json!({"KHR_node_visibility": {"visible": true}});
    animate(
        &mut file,
        json!({"node": 1, "path": "translation"}),
        "LINEAR",
        [[0.0, 0.0, 5.0], [0.125, 0.0, 5.0], [0.375, 0.0, 5.0]],
    );
    let pointer = format!("/nodes/{node}/extensions/KHR_node_visibility/visible");
    let target = json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}});
    animate(&mut file, target, "STEP", [[0.0], [1.0], [0.0]]);
    for (frame, expected) in [(1, [0.0, 0.0, 1.0, 0.0]), (2, [1.0, 0.0, 2.0, 0.0]), (3, [2.0, 0.0, 0.0, 0.0])] {
        let found = at_frame(&file, frame, "");
        assert!(
            (0..4).all(|c| (found[32 * SIZE + 32][c] - expected[c]).abs() < TOLERANCE),
            "{frame}: {:?}",
            found[32 * SIZE + 32]
        );
    }
}

/// The layer exists only on request. It depends neither on threads, seeds, shards, blur nor the method, and merging,
/// resuming and finishing keep it. The other layers do not change.
#[test]
fn the_layer_is_kept_and_changes_nothing_else() {
    let mut file = stage();
    let node = square(&mut file, "square", 1.0, 0.0, 0);
    animate(
        &mut file,
        json!({"node": node, "path": "translation"}),
        "LINEAR",
        [[0.0; 3], [0.125, 0.25, 0.0], [0.375, 0.625, 0.0]],
    );
    let folder = folder(&file);
    let layers = "--layers beauty,Noisy,normal,Motion";
    let set = |name: &str| folder.read(name).0;
    run(&folder, &format!("--frames 2 --iterations 6 --threads 1 {layers} -o whole.exr"));
    let whole = set("whole.exr");
    let motion = whole.get("Motion").expect("it was asked for").clone();
    assert!(vectors(&whole).iter().any(|vector| *vector != [0.0; 4]));
    run(&folder, "--frames 2 --iterations 6 -o plain.exr");
    assert!(set("plain.exr").get("Motion").is_none(), "only on request");
    for layer in ["", "Noisy", "normal"] {
        assert!(set("plain.exr").get(layer) == whole.get(layer), "{layer}");
    }
    let kept = |name: &str| assert!(set(name).get("Motion") == Some(&motion), "{name}");
    run(&folder, &format!("--frames 2 --iterations 6 --threads 2 {layers} -o threads.exr"));
    assert!(set("threads.exr").layers == whole.layers);
    for shard in 0..2 {
        run(&folder, &format!("--frames 2 --iterations 6 --shard {shard}/2 {layers} -o shard{shard}.exr"));
    }
    assert_eq!(folder.run("merge shard1.exr shard0.exr -o merged.exr").code, Some(0));
    assert!(set("merged.exr").layers == whole.layers);
    run(&folder, &format!("--frames 2 --iterations 3 {layers} -o part.exr --checkpoint state"));
    run(&folder, &format!("--frames 2 --iterations 6 {layers} -o part.exr --resume state --no-checkpoint"));
    assert!(set("part.exr").layers == whole.layers);
    run(&folder, &format!("--frames 2 --iterations 6 --seed 9 {layers} -o seed.exr"));
    run(&folder, &format!("--frames 2 --iterations 2 --shutter -0.5,0.5 --method sppm {layers} -o blurred.exr"));
    assert_eq!(folder.run("merge whole.exr seed.exr -o mean.exr --no-finish").code, Some(0));
    ["seed.exr", "blurred.exr", "mean.exr"].into_iter().for_each(kept);
    let read = "--layers beauty,Noisy,Level,Variance,albedo,normal,depth,Motion";
    run(&folder, &format!("--frames 2 --iterations 3 --method sppm --photons 2000 {read} -o raw.exr"));
    let finished = folder.run("finish raw.exr -o finished.exr --model compact --denoise none");
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    kept("finished.exr");
    run(&folder, "--frames 2 --iterations 1 --layers Motion --exr-naming blender -o blender.exr");
    assert!(set("blender.exr").get("ViewLayer.Vector").is_some_and(|layer| layer.planes == motion.planes));
}

/// Without animation, and in frames of a scene that rests, all vectors are zero.
#[test]
fn scenes_that_rest_have_no_motion() {
    let folder = Folder::new();
    for frames in ["", "--frames 3"] {
        let common = "render scene.glb --width 8 --height 8 --iterations 1 --no-combine --method path --overwrite";
        let outcome = folder.run(&format!("{common} --layers Motion {frames} -o still.exr"));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        assert!(vectors(&folder.read("still.exr").0).iter().all(|vector| *vector == [0.0; 4]), "{frames}");
    }
    run(&self::folder(&stage()), "--iterations 1 --layers Motion -o still.exr");
}
