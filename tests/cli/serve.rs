//! `caustique serve`: its pictures are those of `caustique render`, edits are those of edited files, and nothing that it
//! is sent ends it.

use crate::glb::Glb;
use crate::{Folder, values};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Stdio};
use std::time::Duration;

/// Options of quick pictures without a finish.
const PLAIN: [&str; 5] = ["--method", "path", "--no-finish", "--iterations", "3"];
/// How often, and at which intervals, the tests look whether the program has ended.
const POLLS: u32 = 4000;
const BETWEEN_POLLS: Duration = Duration::from_millis(5);

/// A running server.
struct Server {
    process: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

/// An answer, and the pixels behind it.
struct Answer {
    about: Value,
    pixels: Vec<f32>,
}

impl Server {
    fn start(folder: &Folder) -> Server {
        let mut command = folder.command("serve --threads 2");
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut process = command.spawn().expect("the program starts");
        let (input, output) = (process.stdin.take(), process.stdout.take().expect("a pipe"));
        let mut server = Server { process, input, output: BufReader::new(output) };
        let ready = server.answer().about;
        assert_eq!((&ready["event"], &ready["protocol"], &ready["threads"]), (&"ready".into(), &1.into(), &2.into()));
        server
    }

    fn write(&mut self, bytes: &[u8]) {
        self.input.as_mut().expect("it is open").write_all(bytes).expect("the server reads");
    }

    fn send(&mut self, command: &Value) {
        self.write(format!("{command}\n").as_bytes());
    }

    fn answer(&mut self) -> Answer {
        let mut line = String::new();
        assert_ne!(self.output.read_line(&mut line).expect("the answer is text"), 0, "the server has ended");
        let about: Value = serde_json::from_str(&line).expect("an answer is JSON");
        let mut bytes = vec![0; about["bytes"].as_u64().unwrap_or(0) as usize];
        self.output.read_exact(&mut bytes).expect("the pixels follow");
        let pixels = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        Answer { about, pixels }
    }

    /// Sends a command, and returns its last answer: not a picture.
    fn ask(&mut self, command: &Value) -> Value {
        self.send(command);
        loop {
            let Answer { about, .. } = self.answer();
            if about["event"] != "picture" {
                return about;
            }
        }
    }

    fn load(&mut self, scene: &str, arguments: &[&str]) {
        self.send(&json!({"command": "load", "id": "l", "scene": scene, "arguments": arguments}));
        loop {
            // Earlier commands may still be answered.
            let Answer { about, .. } = self.answer();
            if about["id"] == "l" {
                assert_eq!(about["event"], "loaded", "{about}");
                return;
            }
        }
    }

    /// The last picture of a view of 48 x 32 pixels that is rendered to its end.
    fn view(&mut self, arguments: &[&str], camera: &Value) -> Vec<f32> {
        let mut view = json!({"command": "view", "id": "v", "arguments": arguments, "width": 48, "height": 32});
        if !camera.is_null() {
            view["camera"] = camera.clone();
        }
        self.send(&view);
        let mut last = Vec::new();
        loop {
            let Answer { about, pixels } = self.answer();
            match about["event"].as_str() {
                Some("picture") if about["id"] == "v" => last = pixels,
                Some("done") if about["id"] == "v" => return last,
                Some("stopped" | "picture") => assert_ne!(about["id"], "v"),
                _ => panic!("{about}"),
            }
        }
    }

    /// Closes the input, and waits for the program's end.
    fn end(mut self) {
        self.input = None;
        for _ in 0..POLLS {
            if let Some(status) = self.process.try_wait().expect("its state is known") {
                assert!(status.success(), "{status}");
                return;
            }
            std::thread::sleep(BETWEEN_POLLS);
        }
        panic!("it does not end");
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        drop(self.process.kill());
        drop(self.process.wait());
    }
}

/// A floor, a textured box, a block of glass and a lamp.
fn scene() -> Glb {
    let mut glb = Glb::new();
    let stone = glb.push("materials", json!({"name": "stone", "pbrMetallicRoughness": {"metallicFactor": 0}}));
    let tiles = glb.png(2, &[[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 255, 255]]);
    let textured = json!({"metallicFactor": 0.2, "roughnessFactor": 0.3, "baseColorTexture": {"index": tiles}});
    let paint = glb.push("materials", json!({"name": "paint", "pbrMetallicRoughness": textured}));
    let transmission = json!({"KHR_materials_transmission": {"transmissionFactor": 1}});
    let clear = json!({"metallicFactor": 0, "roughnessFactor": 0});
    let glass = json!({"name": "glass", "pbrMetallicRoughness": clear, "extensions": transmission});
    let glass = glb.push("materials", glass);
    let floor: [[f32; 3]; 4] = [[-5.0, -1.0, -5.0], [-5.0, -1.0, 5.0], [5.0, -1.0, 5.0], [5.0, -1.0, -5.0]];
    let floor = glb.mesh("floor", &floor, &[0, 1, 2, 0, 2, 3], Some(stone));
    let [solid, block] = [("box", paint), ("block", glass)].map(|(name, material)| glb.cube(name, Some(material)));
    let coordinates: Vec<[f32; 2]> = (0..8u8).map(|i| [f32::from(i & 1), f32::from(i >> 1)]).collect();
    let coordinates = glb.floats(&coordinates);
    glb.json["meshes"][solid]["primitives"][0]["attributes"]["TEXCOORD_0"] = coordinates.into();
    let light = json!({"type": "point", "intensity": 400, "extras": {"caustique": {"radius": 0.2}}});
    glb.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
    glb.json["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_materials_transmission"]);
    glb.json["scenes"][0]["extras"] = json!({"caustique": {"light_units": "radiometric"}});
    glb.node(json!({"name": "Floor", "mesh": floor}));
    glb.node(json!({"name": "Box", "mesh": solid, "matrix": at(-1.2, 0.0, 0.0)}));
    glb.node(json!({"name": "Block", "mesh": block, "matrix": at(1.5, 0.1, 0.5)}));
    let lamp = json!({"KHR_lights_punctual": {"light": 0}});
    glb.node(json!({"name": "Lamp", "extensions": lamp, "matrix": at(0.5, 4.0, 2.0)}));
    let camera = glb.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}));
    glb.node(json!({"name": "Camera", "camera": camera, "matrix": at(0.0, 0.5, 7.0)}));
    glb
}

/// A transform that only moves, and turns a little about the vertical.
fn at(x: f64, y: f64, z: f64) -> Value {
    json!([0.96, 0, -0.28, 0, 0, 1, 0, 0, 0.28, 0, 0.96, 0, x, y, z, 1])
}

fn write(folder: &Folder, name: &str, glb: &Glb) {
    std::fs::write(folder.path(name), glb.bytes()).expect("the scene can be written");
}

/// The pixels of a render by the command line with the same options, as red, green, blue and alpha.
fn rendered(folder: &Folder, scene: &str, arguments: &[&str]) -> Vec<f32> {
    let options = arguments.join(" ");
    let outcome = folder.run(&format!("render {scene} -o out.exr --width 48 --height 32 {options}"));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let (set, _) = folder.read("out.exr");
    let alpha = &set.get("").and_then(|beauty| beauty.plane("A")).expect("alpha").values;
    values(&set, "").into_iter().zip(alpha).flat_map(|([r, g, b], a)| [r, g, b, *a]).collect()
}

/// Whatever was under way before, a view has the bytes of a render with its camera.
#[test]
fn views_are_the_pictures_of_renders() {
    let folder = Folder::new();
    let mut glb = scene();
    write(&folder, "a.glb", &glb);
    let mut server = Server::start(&folder);
    server.load("a.glb", &[]);
    let photons = ["--method", "sppm", "--no-finish", "--iterations", "2", "--photons", "3000", "--seed", "4"];
    for arguments in [&PLAIN[..], &photons] {
        assert_eq!(server.view(arguments, &Value::Null), rendered(&folder, "a.glb", arguments), "{arguments:?}");
    }
    let plain = server.view(&PLAIN, &Value::Null);
    let matrix = at(2.0, 1.0, 6.0);
    glb.json["nodes"][4]["matrix"] = matrix.clone();
    write(&folder, "b.glb", &glb);
    // A long picture, with a coarse one before it, which the next view ends.
    let long = json!({"command": "view", "id": 1, "arguments": ["--method", "path"], "width": 640, "height": 400, "coarse": 4});
    server.send(&long);
    assert_eq!(server.answer().about["coarse"], true);
    let moved = server.view(&PLAIN, &json!({"matrix": matrix, "yfov": 0.7}));
    assert_eq!(moved, rendered(&folder, "b.glb", &PLAIN));
    assert_ne!(moved, plain, "the camera has no effect");
    let parallel =
        json!({"type": "orthographic", "orthographic": {"xmag": 2.0, "ymag": 2.0, "znear": 0.1, "zfar": 100}});
    glb.json["cameras"][0] = parallel;
    write(&folder, "c.glb", &glb);
    assert_eq!(server.view(&PLAIN, &json!({"matrix": matrix, "ymag": 2.0})), rendered(&folder, "c.glb", &PLAIN));
    server.end();
}

#[test]
fn rendered_files_are_those_of_the_command_line() {
    let folder = Folder::new();
    write(&folder, "a.glb", &scene());
    let options = "--method sppm --photons 3000 --iterations 8 --width 48 --height 32 --denoise own --reproducible";
    assert_eq!(folder.run(&format!("render a.glb -o out.exr {options}")).code, Some(0));
    let mut server = Server::start(&folder);
    server.load("a.glb", &[]);
    let words: Vec<&str> = ["-o", "served.exr"].into_iter().chain(options.split_whitespace()).collect();
    let done = server.ask(&json!({"command": "render", "arguments": words}));
    assert_eq!((&done["event"], &done["interrupted"]), (&"done".into(), &false.into()), "{done}");
    let [expected, found] = ["out.exr", "served.exr"].map(|name| std::fs::read(folder.path(name)).expect("a file"));
    assert!(expected == found, "the files differ");
    assert!(std::process::Command::new("mkfifo").arg(folder.path("pipe")).status().expect("mkfifo runs").success());
    for (words, said) in [
        (json!([]), "needs the name of its file"),
        (json!(["-o", "-"]), "needs the name of its file"),
        (json!(["-o", "/dev/stdout"]), "is not a regular file"),
        (json!(["-o", "pipe"]), "is not a regular file"),
        (json!(["-o", "x.exr", "--png", "pipe"]), "is not a regular file"),
        (json!(["-o", "x.exr", "--env", "1,1,1"]), "an option about reading the scene differs"),
        (json!(["-o", "x.exr", "--threads", "1"]), "has its threads already"),
        (json!(["-o", "x.exr", "--help"]), "ask for help"),
        (json!(["-o", "x.exr", "--itertions", "1"]), "unexpected argument"),
    ] {
        let refused = server.ask(&json!({"command": "render", "id": 5, "arguments": words}));
        assert_eq!((&refused["event"], &refused["id"]), (&"error".into(), &5.into()), "{refused}");
        assert!(refused["message"].as_str().is_some_and(|text| text.contains(said)), "{refused}");
        assert!(refused["hint"].is_string(), "{refused}");
    }
    assert_eq!(folder.files().iter().filter(|name| *name == "x.exr").count(), 0);
    server.end();
}

/// Moved, replaced and removed objects give the picture of a file with these changes, to the last bit.
#[test]
fn edits_are_those_of_edited_files() {
    let folder = Folder::new();
    let mut glb = scene();
    write(&folder, "a.glb", &glb);
    let mut server = Server::start(&folder);
    server.load("a.glb", &[]);
    let mut before = server.view(&PLAIN, &Value::Null);
    let mut check = |server: &mut Server, glb: &Glb, edit: Value| {
        let answer = server.ask(&edit);
        assert_eq!(answer["event"], "edited", "{answer}");
        write(&folder, "edited.glb", glb);
        let after = server.view(&PLAIN, &Value::Null);
        assert_ne!(after, before, "{edit} has no effect");
        assert!(after == rendered(&folder, "edited.glb", &PLAIN), "{edit}");
        before = after;
    };
    let (moved, lamp) = (at(-0.5, 0.3, 1.0), at(-1.0, 3.0, 3.0));
    (glb.json["nodes"][1]["matrix"], glb.json["nodes"][3]["matrix"]) = (moved.clone(), lamp.clone());
    let places = json!([{"name": "Box", "matrix": moved}, {"name": "Lamp", "matrix": lamp}]);
    check(&mut server, &glb, json!({"command": "edit", "place": places}));

    // The material of the box, by a file that holds only the box.
    glb.json["materials"][1]["pbrMetallicRoughness"]["roughnessFactor"] = 0.9.into();
    let mut part = glb.clone();
    part.json["scenes"][0]["nodes"] = json!([1]);
    write(&folder, "part.glb", &part);
    check(&mut server, &glb, json!({"command": "edit", "files": ["part.glb"]}));

    // A new box and a new object of glass, with meshes of their own.
    let meshes = ["second", "third"].map(|name| glb.cube(name, Some(2)));
    glb.json["nodes"][1] = json!({"name": "Box", "mesh": meshes[0], "matrix": at(-1.0, 0.4, -2.0)});
    glb.node(json!({"name": "New", "mesh": meshes[1], "matrix": at(-1.0, 0.4, 2.0)}));
    let mut part = glb.clone();
    part.json["scenes"][0]["nodes"] = json!([1, 5]);
    write(&folder, "part.glb", &part);
    check(&mut server, &glb, json!({"command": "edit", "files": ["part.glb"]}));

    glb.json["scenes"][0]["nodes"] = json!([0, 2, 3, 4, 5]);
    check(&mut server, &glb, json!({"command": "edit", "remove": ["Box"]}));

    for (edit, said) in [
        (json!({"remove": ["Nobody"]}), "object \"Nobody\": the scene has no object or light of this name"),
        (json!({"place": [{"name": "New", "matrix": at(1e12, 0.0, 0.0)}]}), "its matrix is no transform"),
        (json!({"files": ["missing.glb"]}), "missing.glb"),
        (json!({"remove": ["Block"], "files": ["missing.glb"]}), "missing.glb"),
    ] {
        let mut command = json!({"command": "edit"});
        command.as_object_mut().expect("an object").extend(edit.as_object().expect("an object").clone());
        let refused = server.ask(&command);
        assert_eq!(refused["event"], "error", "{refused}");
        assert!(refused["message"].as_str().is_some_and(|text| text.contains(said)), "{refused}");
        assert!(server.view(&PLAIN, &Value::Null) == before, "a refused edit has changed the scene");
    }
    let refused = server.ask(&json!({"command": "render", "arguments": ["-o", "x.exr", "--resume", "y"]}));
    assert!(refused["message"].as_str().is_some_and(|text| text.contains("no checkpoints")), "{refused}");
    server.end();
}

#[test]
fn a_command_or_the_end_of_the_input_ends_a_long_picture() {
    let folder = Folder::new();
    write(&folder, "a.glb", &scene());
    // They have many more iterations than there is time for.
    let long = |id: u32| {
        let arguments = ["--method", "bdpt", "--no-finish", "--iterations", "1000000"];
        json!({"command": "view", "id": id, "arguments": arguments, "width": 800, "height": 600})
    };
    let mut server = Server::start(&folder);
    let refused = server.ask(&long(0));
    assert!(refused["message"].as_str().is_some_and(|text| text.contains("there is no scene")), "{refused}");
    server.load("a.glb", &[]);
    for id in 1..4 {
        server.send(&long(id));
    }
    std::thread::sleep(Duration::from_millis(200));
    server.send(&json!({"command": "stop"}));
    let mut stopped = Vec::new();
    while stopped.len() < 3 {
        let Answer { about, .. } = server.answer();
        if about["event"] != "picture" {
            assert_eq!(about["event"], "stopped", "{about}");
            stopped.push(about["id"].as_u64());
        }
    }
    stopped.sort_unstable();
    assert_eq!(stopped, [Some(1), Some(2), Some(3)]);
    // A render keeps to its end unless it is stopped, and its picture has the iterations so far.
    let words = ["-o", "x.exr", "--method", "path", "--iterations", "1000000", "--no-finish", "--width", "32"];
    server.send(&json!({"command": "render", "id": 7, "arguments": words}));
    std::thread::sleep(Duration::from_millis(300));
    server.send(&json!({"command": "stop"}));
    let done = server.answer().about;
    assert_eq!((&done["event"], &done["interrupted"]), (&"done".into(), &true.into()), "{done}");
    assert!(folder.read("x.exr").1["iterations"].as_u64().is_some_and(|n| n > 0));
    // Stopped before its first iteration, it does not claim the picture that is there.
    let words = ["-o", "x.exr", "--overwrite", "--method", "vcm", "--no-finish", "--width", "2500", "--height", "2500"];
    server.send(&json!({"command": "render", "id": 8, "arguments": words}));
    std::thread::sleep(Duration::from_millis(300));
    server.send(&json!({"command": "stop"}));
    let stopped = server.answer().about;
    assert_eq!((&stopped["event"], &stopped["iterations"]), (&"stopped".into(), &0.into()), "{stopped}");
    server.send(&long(9));
    std::thread::sleep(Duration::from_millis(100));
    server.end();
}

/// Lines of random bytes, and random changes of commands, are answered by errors at worst.
#[test]
fn malformed_commands_end_nothing() {
    let folder = Folder::new();
    write(&folder, "a.glb", &scene());
    let mut server = Server::start(&folder);
    // Reading a device would not end, and a pipe would have to be waited for.
    assert!(std::process::Command::new("mkfifo").arg(folder.path("pipe.glb")).status().expect("mkfifo runs").success());
    for name in ["/dev/zero", "pipe.glb"] {
        let answer = server.ask(&json!({"command": "load", "id": 1, "scene": name}));
        assert_eq!(answer["message"], format!("{name}: it is not a regular file"), "{answer}");
    }
    server.load("a.glb", &[]);
    let answer = server.ask(&json!({"command": "edit", "id": 1, "files": ["pipe.glb"]}));
    assert_eq!(answer["message"], "pipe.glb: it is not a regular file", "{answer}");
    let commands: Vec<Vec<u8>> = [
        json!({"command": "load", "scene": "missing.glb", "arguments": ["--method", "path"]}),
        json!({"command": "edit", "remove": ["x"], "place": [{"name": "Box", "matrix": at(0.0, 0.0, 0.0)}], "files": ["x"]}),
        json!({"command": "view", "arguments": ["--iterations", "1"], "camera": {"matrix": at(0.0, 0.0, 0.0), "yfov": 1},
            "width": 1, "height": 1, "coarse": 1}),
        json!({"command": "render", "arguments": ["-o", "x"]}),
        json!({"command": "stop"}),
    ]
    .map(|command| command.to_string().into_bytes())
    .into();
    let mut state = 12345u64;
    let mut random = |n: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % n
    };
    const BYTES: &[u8] = b"{}[]\",:0123456789-+.eE\\u \tabcnulltruefalse\xff\x00";
    // The text of a command never becomes this one, which would end the program.
    let is_safe = |line: &[u8]| !line.windows(4).any(|word| word == b"quit");
    let mut lines = vec![b"[".repeat(100_000), b"x".repeat(3 << 20), b"{\"id\":1e999}".to_vec(), b"\xff\xfe".to_vec()];
    for _ in 0..400 {
        let mut line = commands[random(commands.len())].clone();
        for _ in 0..=random(4) {
            let (at, byte) = (random(line.len()), BYTES[random(BYTES.len())]);
            match random(3) {
                0 => line[at] = byte,
                1 => line.insert(at, byte),
                _ => line.truncate(at.max(1)),
            }
        }
        lines.extend(is_safe(&line).then_some(line));
    }
    let send = |server: &mut Server, line: &[u8]| {
        server.write(line);
        server.write(b"\n");
    };
    for line in &lines {
        send(&mut server, line);
        // One at a time, so that the answers do not fill the pipe.
        send(&mut server, br#"{"command": "mark", "id": "mark"}"#);
        loop {
            let Answer { about, .. } = server.answer();
            if about["id"] == "mark" {
                break;
            }
            if about["event"] == "error" {
                assert!(
                    about["message"].is_string() && !about["message"].as_str().is_some_and(str::is_empty),
                    "{about}"
                );
            }
        }
    }
    server.load("a.glb", &[]);
    assert_eq!(server.view(&PLAIN, &Value::Null).len(), 48 * 32 * 4);
    assert!(Path::new(&folder.path("a.glb")).is_file());
    server.end();
}
