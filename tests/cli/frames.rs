//! Frames of an animation: names, seeds, existing files and interruption.

use crate::{Folder, values};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read};
use std::process::{Command, Stdio};

/// Writes `moving.gltf`: an emissive wall that fills the view and jumps aside at frame 3, at 24 frames per second.
pub(super) fn write_animation(folder: &Folder) {
    let (mut bytes, mut views, mut accessors) = (Vec::<u8>::new(), Vec::new(), Vec::new());
    let mut push = |floats: &[f32], kind: &str, width: usize| {
        views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": 4 * floats.len()}));
        bytes.extend(floats.iter().flat_map(|x| x.to_le_bytes()));
        accessors.push(json!({"bufferView": views.len() - 1, "componentType": 5126, "type": kind,
            "count": floats.len() / width}));
        accessors.len() - 1
    };
    let corners = [-9.0, -9.0, 0.0, 9.0, -9.0, 0.0, 9.0, 9.0, 0.0, -9.0, -9.0, 0.0, 9.0, 9.0, 0.0, -9.0, 9.0, 0.0];
    let positions = push(&corners, "VEC3", 3);
    let times = push(&[1.0 / 24.0, 3.0 / 24.0], "SCALAR", 1);
    let places = push(&[0.0, 0.0, 0.0, 100.0, 0.0, 0.0], "VEC3", 3);
    let length = bytes.len();
    std::fs::write(folder.path("moving.bin"), &bytes).expect("it can be written");
    let document = json!({
        "asset": {"version": "2.0"}, "scene": 0, "buffers": [{"uri": "moving.bin", "byteLength": length}],
        "scenes": [{"nodes": [0, 1], "extras": {"caustique": {"frame_rate": 24}}}],
        "bufferViews": views, "accessors": accessors,
        "materials": [{"name": "white", "emissiveFactor": [1, 1, 1], "doubleSided": true}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": positions}, "material": 0}]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 1.0, "znear": 0.1}}],
        "nodes": [{"name": "wall", "mesh": 0}, {"name": "eye", "camera": 0, "translation": [0, 0, 5]}],
        "animations": [{"name": "jump", "samplers": [{"input": times, "output": places, "interpolation": "STEP"}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}],
    });
    std::fs::write(folder.path("moving.gltf"), document.to_string()).expect("it can be written");
}

fn folder() -> Folder {
    let folder = Folder::new();
    write_animation(&folder);
    folder
}

const SMALL: &str = "--width 8 --height 8 --iterations 2 --method path --no-combine --reproducible";

fn mean(folder: &Folder, name: &str) -> f32 {
    let pixels = values(&folder.read(name).0, "");
    pixels.iter().flatten().sum::<f32>() / (3 * pixels.len()) as f32
}

#[test]
fn each_frame_has_its_time_and_its_file_name() {
    let folder = folder();
    let names = "-o out.###.exr --png look.%02d.png";
    let outcome = folder.run(&format!("render moving.gltf --frames 1-5,2 {names} {SMALL}"));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let frames: Vec<&str> =
        outcome.stderr.lines().filter(|line| line.starts_with("frame ") && line.contains(" of 3)")).collect();
    assert_eq!(
        frames,
        ["frame 1 (1 of 3): out.001.exr", "frame 3 (2 of 3): out.003.exr", "frame 5 (3 of 3): out.005.exr"]
    );
    assert!(outcome.stderr.contains("frame 3, iteration 2 of 2, "), "{}", outcome.stderr);
    let pictures = ["look.01.png", "look.03.png", "look.05.png"];
    let outputs = ["out.001.exr", "out.003.exr", "out.005.exr"];
    assert_eq!(folder.files(), [&pictures[..], &["moving.bin", "moving.gltf"], &outputs[..]].concat());
    assert_eq!(outputs.map(|name| mean(&folder, name)), [1.0, 0.0, 0.0]);
    // A frame that is rendered alone has the same bytes. Without --frames, the first key is rendered.
    let alone = folder.run(&format!("render moving.gltf --frames 3 -o alone.exr {SMALL}"));
    assert_eq!(alone.code, Some(0), "{}", alone.stderr);
    let bytes = |name: &str| std::fs::read(folder.path(name)).expect("it is there");
    assert!(bytes("alone.exr") == bytes("out.003.exr"));
    let first = folder.run(&format!("render moving.gltf -o first.exr {SMALL}"));
    assert!(first.stderr.contains("its animations begin at 0.042 s, which is rendered"), "{}", first.stderr);
    assert_eq!(mean(&folder, "first.exr"), 1.0);
}

/// The seed of a frame is --seed plus the frame number, or --seed itself with --frame-seed same.
#[test]
fn frames_have_different_seeds_by_default() {
    let folder = folder();
    let run = |options: &str| {
        let outcome = folder.run(&format!("render scene.glb {SMALL} --method sppm --photons 500 {options}"));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        outcome.stderr
    };
    for frame in [7, 8] {
        let still = run(&format!("--frames {frame} --seed 10 -o vary.#.exr"));
        assert!(still.contains("nothing in the scene is animated: its frames are all the same"), "{still}");
        run(&format!("--frames {frame} --seed 10 --frame-seed same -o same.#.exr"));
    }
    run("--seed 17 -o seed17.exr");
    run("--seed 10 -o seed10.exr");
    let noisy = |name: &str| values(&folder.read(name).0, "Noisy");
    assert_eq!(noisy("vary.7.exr"), noisy("seed17.exr"));
    assert_ne!(noisy("vary.7.exr"), noisy("vary.8.exr"));
    assert_eq!(noisy("same.7.exr"), noisy("seed10.exr"));
    assert_eq!(noisy("same.7.exr"), noisy("same.8.exr"));
    assert_eq!(folder.read("vary.7.exr").1["seed"], 17);
}

/// A scene in which nothing moves has one picture: it has no animation, or its animation holds still.
#[test]
fn frames_of_a_scene_at_rest_are_rendered_once() {
    let folder = folder();
    let moving = std::fs::read_to_string(folder.path("moving.gltf")).expect("it is there");
    let mut resting: Value = serde_json::from_str(&moving).expect("it is JSON");
    // Both keys have the first value.
    resting["accessors"][2]["count"] = 1.into();
    resting["accessors"][1]["count"] = 1.into();
    std::fs::write(folder.path("resting.gltf"), resting.to_string()).expect("it can be written");
    for (scene, first) in [("scene.glb", "a.3.exr"), ("resting.gltf", "b.3.exr")] {
        let output = &first[..1];
        let line = format!("render {scene} --frames 3-9,2 -o {output}.#.exr {SMALL} --skip-existing --progress plain");
        let outcome = folder.run(&line);
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        let warning = format!("{scene}: nothing moves, so its frames are all the same: only frame 3 is rendered\n");
        assert!(outcome.stderr.starts_with(&format!("warning: {warning}")), "{}", outcome.stderr);
        assert!(folder.run(&line).stderr.contains(&format!("{first} is there\n")));
        let rendered = folder.files().into_iter().filter(|name| name.starts_with(output)).collect::<Vec<_>>();
        assert_eq!(rendered, [first]);
    }
}

/// A scene can be a sequence of files, one per frame, as our exporter for Blender writes them.
#[test]
fn a_scene_can_be_a_sequence_of_files() {
    let folder = folder();
    for frame in ["0004", "0005"] {
        std::fs::copy(folder.path("scene.glb"), folder.path(&format!("shot.{frame}.glb"))).expect("it can be copied");
    }
    let outcome = folder.run(&format!("render shot.####.glb --frames 4-5 -o out.#.exr {SMALL}"));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    assert!(!outcome.stderr.contains("animated"), "{}", outcome.stderr);
    let missing = folder.run(&format!("render shot.####.glb --frames 5-6 -o out.#.exr {SMALL}"));
    assert_eq!(missing.code, Some(1), "{}", missing.stderr);
    assert!(missing.stderr.contains("frame 6: shot.0006.glb: No such file"), "{}", missing.stderr);
    let plan = folder.run("plan shot.####.glb --frames 5 --method path");
    assert_eq!(plan.code, Some(0), "{}", plan.stderr);
    let several = folder.run("plan shot.####.glb --frames 5-6 --method path");
    let fault = "command line: --frames: this command looks at one frame\nhint: give one, such as --frames 5\n";
    assert_eq!((several.code, several.stderr.as_str()), (Some(2), fault));
}

#[test]
fn file_names_that_do_not_fit_the_frames_are_rejected() {
    let folder = folder();
    for (arguments, fault) in [
        (
            "scene.glb -o out.####.exr",
            "command line: --output out.####.exr: its name has a place for a frame's number\n\
             hint: give --frames, such as --frames 1-100, or another name\n",
        ),
        (
            "scene.glb -o out.exr --png out.%04d.png",
            "command line: --png out.%04d.png: its name has a place for a frame's number\n\
             hint: give --frames, such as --frames 1-100, or another name\n",
        ),
        (
            "shot.####.glb -o out.exr",
            "command line: the scene shot.####.glb: its name has a place for a frame's number\n\
             hint: give --frames, such as --frames 1-100, or another name\n",
        ),
        (
            "scene.glb --frames 1-2 -o out.exr",
            "command line: --output out.exr: all frames have the same name\n\
             hint: put '####' where the frame's number belongs, such as out.####.exr\n",
        ),
        (
            "scene.glb -o out",
            "out: the name does not end in .exr\n\
             hint: the output is an EXR; --png writes a picture to look at beside it\n",
        ),
    ] {
        let outcome = folder.run(&format!("render {arguments}"));
        assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(2), fault), "{arguments}");
    }
    assert_eq!(folder.files(), ["moving.bin", "moving.gltf"]);
}

/// Existing frames are skipped with --skip-existing, and rendered again otherwise.
#[test]
fn existing_frames_can_be_skipped() {
    let folder = folder();
    let one = folder.run(&format!("render moving.gltf --frames 1 --seed 7 -o out.1.exr {SMALL}"));
    assert_eq!(one.code, Some(0), "{}", one.stderr);
    let picture = std::fs::read(folder.path("out.1.exr")).expect("it is there");
    std::fs::write(folder.path("out.2.exr"), "").expect("it can be written");
    let run = |options: &str| folder.run(&format!("render moving.gltf --frames 1-2 -o out.#.exr {SMALL} {options}"));
    let outcome = run("--skip-existing");
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    assert!(outcome.stderr.starts_with("frame 1: out.1.exr is there\nframe 2 (2 of 2): "), "{}", outcome.stderr);
    assert!(std::fs::read(folder.path("out.1.exr")).expect("it is there") == picture);
    assert_eq!(mean(&folder, "out.2.exr"), 1.0);
    assert_eq!(run("").code, Some(0));
    assert_eq!(mean(&folder, "out.1.exr"), 1.0);
}

/// An interrupted sequence keeps its finished frames, and continues in the middle of a frame.
#[test]
fn an_interrupted_sequence_continues() {
    let folder = folder();
    let render =
        "render moving.gltf --width 32 --height 32 --method path --iterations 3000 --no-combine --reproducible";
    let line = format!("{render} --frames 1-2 -o out.#.exr --progress json");
    let mut child = folder.command(&line).stderr(Stdio::piped()).spawn().expect("the program starts");
    let mut lines = BufReader::new(child.stderr.take().expect("stderr is piped"));
    loop {
        let mut line = String::new();
        assert_ne!(lines.read_line(&mut line).expect("stderr can be read"), 0, "it has ended");
        let progress: Value = serde_json::from_str(&line).unwrap_or_default();
        if progress["frame"] == 2 && progress["event"] == "progress" {
            break;
        }
    }
    let kill = format!("kill -TERM {}", child.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().expect("sh runs").success());
    let mut rest = String::new();
    lines.read_to_string(&mut rest).expect("stderr can be read");
    assert_eq!(child.wait().expect("it ends").code(), Some(130), "{rest}");
    let error: Value = serde_json::from_str(rest.lines().last().unwrap_or_default()).expect("an event");
    assert!(error["message"].as_str().is_some_and(|message| message.ends_with("which are written")), "{rest}");
    assert_eq!(error["hint"], "the same command with --skip-existing goes on");
    assert_eq!(folder.read("out.2.exr").1["stopped"], "interrupted");
    let outcome = folder.run(&format!("{render} --frames 1-2 -o out.#.exr --skip-existing --progress plain"));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("frame 1: out.1.exr is there\n"), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("\ngoing on after "), "{}", outcome.stderr);
    assert_eq!(folder.run(&format!("{render} --frames 2 -o whole.exr")).code, Some(0));
    let bytes = |name: &str| std::fs::read(folder.path(name)).expect("it is there");
    assert!(bytes("out.2.exr") == bytes("whole.exr"));
    assert!(!folder.files().contains(&"out.2.exr.checkpoint".to_string()));
}

/// Machines that share a folder render each frame once, and skip frames that another machine has claimed.
#[test]
fn machines_share_the_frames_of_a_sequence() {
    let folder = folder();
    std::fs::write(folder.path("out.3.exr.claim"), "render7, process 12\nrender7\n12\n").expect("it can be written");
    let line = format!("render moving.gltf --frames 1-6 -o out.#.exr {SMALL} --skip-existing --progress plain");
    let start = || folder.command(&line).stderr(Stdio::piped()).spawn().expect("the program starts");
    let outputs: Vec<String> = [start(), start()]
        .map(|child| String::from_utf8(child.wait_with_output().expect("it ends").stderr).expect("it is text"))
        .into();
    for frame in [1, 2, 4, 5, 6] {
        let rendered = format!("frame {frame} ({frame} of 6): ");
        assert_eq!(outputs.iter().filter(|text| text.contains(&rendered)).count(), 1, "frame {frame}: {outputs:?}");
        assert!(folder.path(&format!("out.{frame}.exr")).exists());
    }
    assert!(
        outputs.iter().all(|text| text.contains("frame 3: out.3.exr is rendered by render7, process 12\n")),
        "{outputs:?}"
    );
    let claims: Vec<String> = folder.files().into_iter().filter(|name| name.ends_with(".claim")).collect();
    assert_eq!(claims, ["out.3.exr.claim"]);
}

/// With --skip-existing, frames whose checkpoints the user keeps are left alone once they are done.
#[test]
fn kept_checkpoints_of_done_frames_are_no_reason_to_render_again() {
    let folder = folder();
    let line = format!("render moving.gltf --frames 1-2 -o o.#.exr --checkpoint c.# {SMALL} --skip-existing");
    folder.run(&line);
    let written = || {
        ["o.1.exr", "o.2.exr", "c.1", "c.2"]
            .map(|name| std::fs::metadata(folder.path(name)).and_then(|data| data.modified()).expect("a file"))
    };
    let before = written();
    folder.run(&line);
    assert_eq!(written(), before);
}

/// With --skip-existing, frames that are cut off or zeros are rendered again, and what a killed process has left beside a
/// finished frame is removed.
#[test]
fn damaged_frames_are_rendered_again() {
    let folder = folder();
    let line = format!("render moving.gltf --frames 1-4 -o out.#.exr {SMALL} --skip-existing --progress plain");
    assert_eq!(folder.run(&line).code, Some(0));
    let path = |frame: u32| folder.path(&format!("out.{frame}.exr"));
    let whole: Vec<Vec<u8>> = (1..=4).map(|frame| std::fs::read(path(frame)).expect("it is there")).collect();
    let length = whole[0].len();
    std::fs::write(path(1), &whole[0][..length - length / 4]).expect("it can be written");
    std::fs::write(path(2), vec![0; length]).expect("it can be written");
    let mut holed = whole[2].clone();
    holed[length / 2..].fill(0);
    std::fs::write(path(3), holed).expect("it can be written");
    let left = [".caustique-out.4.exr-abcdef.part", ".caustique-out.4.exr-abcdef.estimate.exr"];
    left.iter().for_each(|name| std::fs::write(folder.path(name), "left").expect("it can be written"));
    let outcome = folder.run(&line);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    for frame in 1..=3 {
        let said = format!("frame {frame} ({frame} of 4): out.{frame}.exr, which is damaged and is rendered again\n");
        assert!(outcome.stderr.contains(&said), "{}", outcome.stderr);
    }
    assert!(outcome.stderr.contains("frame 4: out.4.exr is there\n"), "{}", outcome.stderr);
    for frame in 1..=4 {
        assert!(caustique::image::exr::check_whole(&path(frame)).is_ok(), "frame {frame}");
    }
    assert!(left.iter().all(|name| !folder.path(name).exists()), "{:?}", folder.files());
}
