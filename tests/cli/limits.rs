//! Limits of memory, disk and time: they give warnings or errors, and finished work is kept.

use crate::{Folder, Outcome, values};
use caustique::image::exr;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read};
use std::process::{Command, Stdio};

/// Runs the program under limits of the shell.
fn limited(folder: &Folder, limits: &str, arguments: &str) -> Outcome {
    let mut command = Command::new("sh");
    let line = format!("ulimit -c 0; {limits}; exec {} {arguments}", env!("CARGO_BIN_EXE_caustique"));
    command.current_dir(folder.path("")).args(["-c", &line]).env("TMPDIR", folder.path(""));
    Outcome::of(command)
}

/// With any limit of memory, a render succeeds or ends with an error and a remedy.
#[test]
fn no_limit_of_memory_aborts_the_program() {
    let folder = Folder::new();
    let render = "render scene.glb -o out.exr --width 320 --iterations 2 --method sppm --threads 2 --progress none";
    let mut codes = Vec::new();
    for mib in [200, 300, 400, 440, 500, 600, 700, 800, 1000, 1500] {
        let outcome = limited(&folder, &format!("ulimit -v {}", mib * 1024), render);
        assert!(matches!(outcome.code, Some(0 | 1)), "{mib} MiB: {:?} {}", outcome.code, outcome.stderr);
        if outcome.code == Some(1) {
            assert!(outcome.stderr.contains("\nhint: "), "{mib} MiB: {}", outcome.stderr);
        }
        codes.push(outcome.code);
    }
    assert!(codes[0] == Some(1) && codes[codes.len() - 1] == Some(0), "{codes:?}");
}

/// A render succeeds if its announced memory is available. It takes at most this memory, and at least two thirds of it,
/// so that the check does not reject renders that would fit.
#[test]
fn renders_whose_announced_memory_fits_succeed() {
    const GIB: f64 = (1 << 30) as f64;
    /// Addresses that threads reserve and do not use, and the rounding of both numbers in the message.
    const UNUSED: f64 = 0.1 * GIB;
    /// Enough memory for the scene, but not for the picture.
    const SCENE_ONLY: f64 = 550e6;
    let folder = Folder::new();
    for (size, method, denoiser) in
        [((1280, 720), "path", "auto"), ((1280, 720), "sppm --photons 2000", "none"), ((1920, 1080), "path", "none")]
    {
        let size = format!("--width {} --height {}", size.0, size.1);
        let render = format!(
            "render scene.glb -o out.exr {size} --method {method} --iterations 1 --denoise {denoiser} --layers beauty \
             --compression none --threads 2 --progress none"
        );
        let within = |bytes: f64| limited(&folder, &format!("ulimit -v {}", (bytes / 1024.0) as u64), &render);
        let refused = within(SCENE_ONLY).stderr;
        let number = |before: &str, after: &str| -> f64 {
            let (_, rest) = refused.split_once(before).expect(&refused);
            GIB * rest.split_once(after).expect(&refused).0.parse::<f64>().expect("a number")
        };
        let announced = number("need about ", " GiB of memory, ");
        let taken = SCENE_ONLY - number(" GiB of memory, ", " GiB are left by 'ulimit -v'");
        let outcome = within(taken + announced + UNUSED);
        assert_eq!(outcome.code, Some(0), "{method} {size}: {}", outcome.stderr);
        let (_, header) = folder.read("out.exr");
        assert!(header["combined"]["denoiser"].is_string(), "{method} {size}");
        let used = header["peak_memory"].as_f64().expect("a number");
        let bound = announced / 1.5..=announced + taken;
        assert!(bound.contains(&used), "{method} {size}: {used} of {announced}");
    }
}

/// The announced memory, which `--memory` is compared with, is what a render takes in its step that takes most. A render
/// of few pixels takes the program and its libraries, which are not announced.
#[test]
fn renders_take_the_announced_memory() {
    const ANNOUNCED_OVER_TAKEN: std::ops::RangeInclusive<f64> = 0.92..=1.15;
    let folder = Folder::new();
    for (method, finish) in [
        ("path", "--no-finish"),
        ("path", "--denoise none"),
        ("path", "--denoise none --layers all"),
        ("mlt", "--no-finish"),
        ("bpm", "--denoise none"),
        ("vcm --light-paths 0.0625", "--denoise none --iterations 8"),
        ("sppm --photons 1000", "--denoise none"),
    ] {
        let iterations = if finish.contains("--iterations") { "" } else { "--iterations 1" };
        let layers = if finish.contains("--layers") { "" } else { "--layers beauty" };
        let render = |size: &str| {
            folder.run(&format!(
                "render scene.glb -o out.exr {size} --method {method} {finish} {iterations} {layers} --compression none \
                 --threads 2 --progress none"
            ))
        };
        let peak = |size: &str| {
            let outcome = render(size);
            assert_eq!(outcome.code, Some(0), "{method} {size}: {}", outcome.stderr);
            folder.read("out.exr").1["peak_memory"].as_f64().expect("a number")
        };
        let large = "--width 480 --height 270";
        let refused = render(&format!("{large} --memory 1")).stderr;
        let (_, rest) = refused.split_once(" need ").expect(&refused);
        let mib = rest.split_once(" MiB at least").expect(&refused).0.parse::<f64>().expect("a number");
        let (announced, taken) = (mib * f64::from(1 << 20), peak(large) - peak("--width 16 --height 9"));
        let ratio = announced / taken;
        println!("{method} {finish}: announced {announced}, taken {taken}, ratio {ratio:.2}");
        assert!(ANNOUNCED_OVER_TAKEN.contains(&ratio), "{method} {finish}: {taken} of {announced}");
    }
}

/// Writes a closed white box with a lamp and a camera inside, whose paths have thousands of segments.
fn write_white_room(folder: &Folder) {
    let corners = (0..8).flat_map(|corner| (0..3).map(move |axis| if corner >> axis & 1 == 1 { 1.0f32 } else { -1.0 }));
    let triangles: [u16; 36] =
        [0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5];
    let mut bytes: Vec<u8> = corners.flat_map(f32::to_le_bytes).collect();
    bytes.extend(triangles.into_iter().flat_map(u16::to_le_bytes));
    std::fs::write(folder.path("room.bin"), bytes).expect("it can be written");
    let room = json!({
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0, 1, 2]}],
        "nodes": [{"mesh": 0}, {"camera": 0, "translation": [0, 0, 0.9]},
            {"translation": [0, 0.5, 0], "extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.01}}],
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_specular"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 10}]}},
        "buffers": [{"uri": "room.bin", "byteLength": 168}],
        "bufferViews": [{"buffer": 0, "byteLength": 96}, {"buffer": 0, "byteOffset": 96, "byteLength": 72}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"doubleSided": true, "pbrMetallicRoughness": {"metallicFactor": 0},
            "extensions": {"KHR_materials_specular": {"specularFactor": 0}}}],
    });
    std::fs::write(folder.path("room.gltf"), room.to_string()).expect("it can be written");
}

/// `auto` takes a method whose iterations are short and fit into memory. A named method whose first iteration would take
/// minutes cuts its paths when the time is up and says so; one whose photons fit into no memory ends. Both name the
/// option that shortens paths.
#[test]
fn closed_white_rooms_are_rendered_or_name_max_depth() {
    let folder = Folder::new();
    write_white_room(&folder);
    let render = "render room.gltf -o out.exr --width 16 --height 9 --denoise none --progress none";
    let auto = folder.run(&format!("{render} --time 1"));
    assert_eq!(auto.code, Some(0), "{}", auto.stderr);
    let said = "paths were cut after 16 segments";
    for method in ["vcm", "sppm --photons 1000"] {
        let cut = folder.run(&format!("{render} --method {method} --time 1 --checkpoint out.checkpoint"));
        assert_eq!(cut.code, Some(0), "{method}: {}", cut.stderr);
        assert!(cut.stderr.contains(said) && cut.stderr.contains("--max-depth"), "{method}: {}", cut.stderr);
        let (set, header) = folder.read("out.exr");
        assert!(header["iterations"] == 1 && header["warnings"].to_string().contains(said), "{method}: {header}");
        assert!(values(&set, "").iter().any(|value| value[0] > 0.0), "{method}: the picture is black");
        assert!(!folder.path("out.checkpoint").exists(), "{method}: a render could continue without the light");
    }
    let shard = folder.run(&format!("{render} --method bdpt --time 1 --shard 0/2"));
    assert!(shard.code == Some(2) && shard.stderr.contains(said), "{}", shard.stderr);
    let few = limited(&folder, "ulimit -v 3000000", &format!("{render} --method vcm --width 640 --height 360"));
    assert_eq!(few.code, Some(1), "{}", few.stderr);
    assert!(few.stderr.contains("need about") && few.stderr.contains("--max-depth"), "{}", few.stderr);
    // Fewer light paths instead of an error.
    let sppm = "--method sppm --max-depth 1000 --iterations 1 --threads 2";
    let short = limited(&folder, "ulimit -v 1500000", &format!("{render} {sppm}"));
    assert_eq!(short.code, Some(0), "{}", short.stderr);
    assert!(short.stderr.contains("memory is short: ") && short.stderr.contains("--max-depth"), "{}", short.stderr);
}

/// The memory check counts a file once for each buffer that names it, and an image once for each texture.
#[test]
fn files_that_a_scene_names_repeatedly_are_counted_each_time() {
    let folder = Folder::new();
    std::fs::write(folder.path("big.bin"), vec![0; 1 << 20]).expect("it can be written");
    image::RgbaImage::new(1024, 1024).save(folder.path("big.png")).expect("it can be written");
    let asset = json!({"version": "2.0"});
    let buffers = json!({"asset": asset, "buffers": vec![json!({"uri": "big.bin", "byteLength": 1}); 4000]});
    let each = |part: &dyn Fn(usize) -> Value| (0..400).map(part).collect::<Vec<Value>>();
    let textures = json!({
        "asset": asset, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "images": each(&|_| json!({"uri": "big.png"})), "textures": each(&|i| json!({"source": i})),
        "materials": each(&|i| json!({"emissiveTexture": {"index": i}})),
        "meshes": [{"primitives": each(&|i| json!({"attributes": {"POSITION": 0}, "material": i}))}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],
    });
    for (scene, said, hint) in [
        (buffers, "files that the scene names need about ", "name each file once, or render with more memory"),
        (textures, " need about ", "save the image smaller, or render with more memory"),
    ] {
        std::fs::write(folder.path("many.gltf"), scene.to_string()).expect("it can be written");
        let outcome = limited(&folder, "ulimit -v 1500000", "plan many.gltf");
        assert_eq!(outcome.code, Some(1), "{}", outcome.stderr);
        assert!(outcome.stderr.contains(said), "{}", outcome.stderr);
        assert!(outcome.stderr.ends_with(&format!("\nhint: {hint}\n")), "{}", outcome.stderr);
    }
}

/// With --memory, warnings report the smaller number of light paths or the smaller photon map. A limit that cannot be
/// met is an error.
#[test]
fn a_memory_limit_reduces_light_paths_with_a_warning() {
    let folder = Folder::new();
    let pool = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/pool.glb");
    std::fs::copy(pool, folder.path("pool.glb")).expect("it can be copied");
    let render = |options: &str| {
        let small = "--width 64 --height 48 --iterations 2 --no-combine --reproducible --progress none";
        folder.run(&format!("render pool.glb -o out.exr {small} {options}"))
    };
    let outcome = render("--method sppm --photons 200000 --memory 6");
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let (_, said) = outcome.stderr.split_once("--memory 6: ").expect("it says what is cut");
    let (photons, rest) = said.split_once(" light paths an iteration instead of 200000\n").expect("it says how much");
    assert_eq!(rest, "");
    let photons: u64 = photons.parse().expect("a number");
    let (set, header) = folder.read("out.exr");
    assert_eq!(header["light_paths"], 2 * photons);
    assert!(header["plan"]["warnings"].to_string().contains("light paths an iteration instead of 200000"));
    // The picture equals a render with this number of light paths.
    assert_eq!(render(&format!("--method sppm --photons {photons}")).code, Some(0));
    assert!(values(&folder.read("out.exr").0, "") == values(&set, ""));
    let outcome = render("--method pm --photons 200000 --memory 6");
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("--memory 6: the photon map has room for "), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("the photon map was full at "), "{}", outcome.stderr);
    let outcome = render("--method vcm --memory 2");
    assert_eq!(outcome.code, Some(2), "{}", outcome.stderr);
    let start = "command line: 64 x 48 pixels with --method vcm need ";
    assert!(outcome.stderr.starts_with(start), "{}", outcome.stderr);
    assert!(
        outcome.stderr.contains(" MiB at least, and --memory allows 2\nhint: use a smaller "),
        "{}",
        outcome.stderr
    );
}

/// The estimate is on disk during the finish. Afterwards it is there only if the program was killed, or ended at once
/// by a second signal.
#[test]
fn the_estimate_outlives_a_killed_finish() {
    let folder = Folder::new();
    let render =
        "render scene.glb -o out.exr --width 224 --height 126 --time 2 --method path --threads 1 --progress none";
    // Waits in the shell for an estimate besides those of killed renders, because a new process may start too late. Equal
    // signals that come at once count as one.
    let wait = "until set -- .caustique-out.exr-*.estimate.exr && [ -e $1 ] && [ $# -gt $left ]; do sleep 0.001; done";
    let ends = [("kill -KILL $render", None), ("kill -INT $render && sleep 0.005 && kill -INT $render", Some(130))];
    for (left, (signals, code)) in ends.into_iter().enumerate() {
        let mut child = folder.command(render).stderr(Stdio::null()).spawn().expect("the program starts");
        let script = format!("render={} left={left}; {wait}; {signals}", child.id());
        let mut shell = Command::new("timeout");
        shell.args(["60", "sh", "-c", &script]).current_dir(folder.path(""));
        assert!(shell.status().expect("sh runs").success(), "there was no estimate");
        assert_eq!(child.wait().expect("it ends").code(), code);
        assert!(!folder.path("out.exr").exists());
        for estimate in folder.files().into_iter().filter(|name| name.ends_with(".estimate.exr")) {
            let (set, header) = folder.read(&estimate);
            assert!(set.get("Noisy").is_some() && header["combined"].is_null());
            assert_eq!(folder.run(&format!("combine {estimate} -o combined.exr")).code, Some(0));
        }
    }
    // The render that ends removes what the killed ones have left.
    assert_eq!(folder.run(render).code, Some(0));
    assert_eq!(folder.files(), ["combined.exr", "out.exr"]);
    assert!(folder.read("out.exr").1["combined"].is_object());
}

/// If the output exceeds the limit on file size, the older file stays, and no other file is left.
#[test]
fn a_limit_on_file_size_keeps_the_older_file() {
    let folder = Folder::new();
    std::fs::write(folder.path("out.exr"), "older").expect("it can be written");
    let render =
        "render scene.glb -o out.exr --width 64 --height 48 --photons 500 --method sppm --iterations 2 --progress none";
    let outcome = limited(&folder, "ulimit -f 40", render);
    assert_eq!(outcome.code, Some(1), "{}", outcome.stderr);
    let error = "out.exr: File too large (os error 27)\nhint: make room there, or write to another disk\n";
    assert_eq!(outcome.stderr, error);
    assert_eq!(std::fs::read(folder.path("out.exr")).expect("it is there"), b"older");
    assert_eq!(folder.files(), ["out.exr"]);
}

/// A full device is an error, and the render is saved elsewhere.
#[test]
fn a_full_disk_loses_no_render() {
    let folder = Folder::new();
    let small = "--width 16 --height 12 --iterations 1 --method path --no-combine --progress none";
    let outcome = limited(&folder, "true", &format!("render scene.glb -o /dev/full {small}"));
    assert_eq!(outcome.code, Some(1), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("\n/dev/full: No space left on device"), "{}", outcome.stderr);
    let (_, rescued) = outcome.stderr.trim_end().rsplit_once("hint: the render is in ").expect("the hint names a file");
    assert!(exr::read(rescued.as_ref()).is_ok_and(|(set, _)| set.get("").is_some()));
}

/// With `-o -`, only the EXR is written to standard output. If writing fails, the render is saved elsewhere.
#[test]
fn standard_output_gets_the_exr_alone() {
    let folder = Folder::new();
    let small = "--width 16 --height 12 --iterations 1 --method path --no-combine --reproducible";
    assert_eq!(folder.run(&format!("render scene.glb -o file.exr {small}")).code, Some(0));
    let line = format!("render scene.glb -o - {small} > piped.exr");
    let outcome = limited(&folder, "true", &line);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    assert!(outcome.stderr.ends_with("\nstandard output: 16 x 12, 64 channels\n"), "{}", outcome.stderr);
    let bytes = |name: &str| std::fs::read(folder.path(name)).expect("it is there");
    assert!(bytes("piped.exr") == bytes("file.exr"));
    assert_eq!(folder.files(), ["file.exr", "piped.exr"]);
    let outcome = limited(&folder, "true", &format!("render scene.glb -o - --progress none {small} > /dev/full"));
    assert_eq!(outcome.code, Some(1), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("\nstandard output: No space left on device"), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("\nhint: the render is in "), "{}", outcome.stderr);
    let outcome = folder.run(&format!("render scene.glb --frames 1-2 -o - {small}"));
    let error = "command line: --output -: all frames have the same name\n";
    assert!(outcome.code == Some(2) && outcome.stderr.starts_with(error), "{}", outcome.stderr);
}

/// A signal while the scene is read, or during the finish, leaves either the complete new file or the older one.
#[test]
fn a_signal_at_any_time_leaves_a_complete_file() {
    let folder = Folder::new();
    assert!(Command::new("mkfifo").arg(folder.path("pipe.glb")).status().expect("mkfifo runs").success());
    std::fs::write(folder.path("out.exr"), "older").expect("it can be written");
    let kill = |id: u32| {
        let status = Command::new("sh").args(["-c", &format!("kill -TERM {id}")]).status().expect("sh runs");
        assert!(status.success());
    };
    let mut command = folder.command("render pipe.glb -o out.exr --width 16 --progress plain");
    let mut child = command.stderr(Stdio::piped()).spawn().expect("the program starts");
    let mut lines = BufReader::new(child.stderr.take().expect("stderr is piped"));
    let mut line = String::new();
    lines.read_line(&mut line).expect("stderr can be read");
    assert_eq!(line, "reading pipe.glb\n");
    kill(child.id());
    assert_eq!(child.wait().expect("it ends").code(), None);
    assert_eq!(std::fs::read(folder.path("out.exr")).expect("it is there"), b"older");

    // The last iteration is reported before the finish begins.
    let arguments = "render scene.glb -o out.exr --width 320 --iterations 1 --method path --progress json";
    let mut child = folder.command(arguments).stderr(Stdio::piped()).spawn().expect("the program starts");
    let mut lines = BufReader::new(child.stderr.take().expect("stderr is piped"));
    while !line.contains("\"iteration\":1,") {
        line.clear();
        assert_ne!(lines.read_line(&mut line).expect("stderr can be read"), 0, "the program has ended");
    }
    kill(child.id());
    let mut rest = String::new();
    lines.read_to_string(&mut rest).expect("stderr can be read");
    let code = child.wait().expect("it ends").code();
    // The signal may come before or after the last check for signals; the picture is complete in both cases.
    assert!(matches!(code, Some(0 | 130)), "{code:?} {rest}");
    assert_eq!(folder.read("out.exr").1["iterations"], 1);
}
