//! The program from outside: what it prints, word for word, where, how it exits, and what it leaves in its files.

mod support;

use caustique::film::LayerSet;
use caustique::image::exr;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// A folder of its own for each test, with a small scene in it; the program runs there.
struct Workplace {
    folder: tempfile::TempDir,
}

/// What a run of the program left behind.
struct Outcome {
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

impl Workplace {
    fn new() -> Workplace {
        let folder = tempfile::tempdir().expect("a folder can be made");
        support::glb::write(&folder.path().join("scene.glb"), true);
        Workplace { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_caustique"));
        command.current_dir(&self.folder).args(arguments.split_whitespace());
        // The folder is elsewhere: let the program find ONNX Runtime where it was installed for this one.
        command.env_remove("CAUSTIQUE_EMBREE");
        command
    }

    fn run(&self, arguments: &str) -> Outcome {
        Outcome::of(self.command(arguments))
    }

    /// A small quick render with more options; it must succeed.
    fn render(&self, options: &str) -> Outcome {
        let outcome = self.run(&format!("render scene.glb --width 64 --height 48 --photons 2000 {options}"));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        assert_eq!(outcome.stdout, "");
        outcome
    }

    fn read(&self, name: &str) -> (LayerSet, Value) {
        let (set, attributes) = exr::read(&self.path(name)).expect("the file can be read");
        (set, attributes.object().expect("the header has our object"))
    }

    /// The folder's files, but for the scene.
    fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.folder).expect("the folder can be read");
        let names = entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned());
        let mut names: Vec<String> = names.filter(|name| name != "scene.glb").collect();
        names.sort();
        names
    }
}

impl Outcome {
    fn of(mut command: Command) -> Outcome {
        let output = command.output().expect("the program starts");
        Outcome {
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).expect("stdout is UTF-8"),
            stderr: String::from_utf8(output.stderr).expect("stderr is UTF-8"),
        }
    }

    fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).expect("stdout is one JSON object")
    }
}

/// A layer's values at all pixels, interleaved.
fn values(set: &LayerSet, layer: &str) -> Vec<[f32; 3]> {
    set.get(layer).unwrap_or_else(|| panic!("no layer {layer}")).triples()
}

// ---------------------------------------------------------------------------------------------------- the command line

/// Every error is `place: cause`, then `hint: remedy`, and nothing else, before any work is done.
#[test]
fn errors_word_for_word() {
    let place = Workplace::new();
    let render = "render scene.glb -o out.exr --no-combine";
    let help = "'--help' explains every option";
    let cases: [(&str, i32, &str, &str); 21] = [
        ("", 2, "command line: a command is missing", "'caustique --help' lists the commands"),
        ("rendr", 2, "command line: unrecognized subcommand 'rendr'", "a similar subcommand exists: 'render'"),
        (
            "render scene.glb",
            2,
            "command line: the following required arguments were not provided: --output <OUT.exr>",
            help,
        ),
        (
            &format!("{render} --itertions 3"),
            2,
            "command line: unexpected argument '--itertions' found",
            "a similar argument exists: '--iterations'",
        ),
        (
            &format!("{render} --alpha 2"),
            2,
            "command line: invalid value '2' for '--alpha <A>': it must be in (0, 1]",
            help,
        ),
        (
            &format!("{render} --alpha nan"),
            2,
            "command line: invalid value 'nan' for '--alpha <A>': it is not a finite number",
            help,
        ),
        (
            &format!("{render} --knn 1025"),
            2,
            "command line: invalid value '1025' for '--knn <K>': 1025 is not in 1..=1024",
            help,
        ),
        (
            &format!("{render} --levels 9"),
            2,
            "command line: invalid value '9' for '--levels <M>': it must be a whole number from 1 to 5",
            help,
        ),
        (
            &format!("{render} --method vcm"),
            2,
            "command line: invalid value 'vcm' for '--method <METHOD>' [possible values: auto, sppm]",
            help,
        ),
        (
            &format!("{render} --shard 2/2"),
            2,
            "command line: invalid value '2/2' for '--shard <I/N>': shards of 2 are 0 to 1",
            help,
        ),
        (
            &format!("{render} --shard 5/8 --iterations 4"),
            2,
            "command line: shard 5 of 8 holds none of 4 iterations",
            "use fewer shards or more --iterations",
        ),
        (
            &format!("{render} --knn 5 --initial-bandwidth 0.1"),
            2,
            "command line: --knn has no effect with this --initial-bandwidth",
            "leave one of the two out",
        ),
        (
            &format!("{render} --env 1,2"),
            2,
            "command line: invalid value '1,2' for '--env <FILE|R,G,B>': a colour has three numbers R,G,B, not 2",
            help,
        ),
        (&format!("{render} --layers albeod"), 2, "--layers: no layer \"albeod\"", "did you mean \"albedo\"?"),
        (&format!("{render} --layers Level6"), 2, "--layers: no layer \"Level6\"", "did you mean \"Level1\"?"),
        (
            "render nope.glb -o out.exr --no-combine",
            1,
            "nope.glb: No such file or directory (os error 2)",
            "check the path of the scene file and your right to read it",
        ),
        ("render scene.glb -o no/out.exr", 1, "no/out.exr: its folder does not exist", "mkdir -p no"),
        (
            "render scene.glb -o out.png",
            2,
            "out.png: the name does not end in .exr",
            "the output is an EXR; --png writes a picture to look at beside it",
        ),
        ("render scene.glb -o out.exr --png no/out.png", 1, "no/out.png: its folder does not exist", "mkdir -p no"),
        (
            &format!("{render} --camera Camrea"),
            2,
            "scene.glb: there is no camera \"Camrea\"",
            "it has \"Camera\", \"Side\"",
        ),
        (
            &format!("{render} --env-strength 2"),
            2,
            "scene.glb: --env-strength: the scene has no environment",
            "give one with --env",
        ),
    ];
    for (arguments, code, error, hint) in cases {
        let outcome = place.run(arguments);
        assert_eq!(outcome.stderr, format!("{error}\nhint: {hint}\n"), "{arguments}");
        assert_eq!((outcome.code, outcome.stdout.as_str()), (Some(code), ""), "{arguments}");
    }
    assert_eq!(place.files(), [""; 0]);
}

/// The output is checked before the scene is even read, and an older file there is left alone.
#[test]
fn outputs_are_checked_first() {
    let place = Workplace::new();
    std::fs::write(place.path("broken.glb"), "no scene at all").expect("it can be written");
    std::fs::create_dir(place.path("folder.exr")).expect("it can be made");
    let outcome = place.run("render broken.glb -o folder.exr");
    assert_eq!(
        (outcome.code, outcome.stderr.as_str()),
        (Some(1), "folder.exr: is a folder\nhint: name a file in it\n")
    );
    std::fs::write(place.path("old.exr"), "old").expect("it can be written");
    let outcome = place.run("render nope.glb -o old.exr");
    assert_eq!(outcome.code, Some(1));
    assert_eq!(std::fs::read(place.path("old.exr")).expect("it is there"), b"old");
}

#[test]
fn help_and_version_are_data_and_offer_only_what_exists() {
    let place = Workplace::new();
    let help = place.run("render --help");
    assert_eq!((help.code, help.stderr.as_str()), (Some(0), ""));
    for option in ["--photons", "--exr-naming", "--target-error", "--strict", "--reproducible"] {
        assert!(help.stdout.contains(option), "{option}");
    }
    for absent in ["--cppm", "--effects", "--checkpoint", "--kernel", "bdpt"] {
        assert!(!help.stdout.contains(absent), "{absent}");
    }
    let commands = place.run("--help").stdout;
    for (command, listed) in [("combine", true), ("compare", true), ("doctor", true), ("plan", false), ("merge", false)]
    {
        assert_eq!(commands.contains(&format!("\n  {command} ")), listed, "{command}");
    }
    assert_eq!(place.run("--version").stdout, concat!("caustique ", env!("CARGO_PKG_VERSION"), "\n"));
}

/// Libraries that are missing are found before rendering, named, and a way around is offered.
#[test]
fn missing_libraries() {
    let place = Workplace::new();
    let missing = |variable: &str, arguments: &str| {
        let mut command = place.command(arguments);
        command.env(variable, "/no/such/library.so");
        Outcome::of(command)
    };
    let render = "render scene.glb -o out.exr --width 32 --iterations 1 --photons 100";
    let outcome = missing("CAUSTIQUE_ONNXRUNTIME", render);
    assert_eq!(outcome.code, Some(1));
    let lines: Vec<&str> = outcome.stderr.lines().collect();
    assert_eq!(lines[0], "CAUSTIQUE_ONNXRUNTIME=/no/such/library.so: no such file");
    assert!(lines[1].starts_with("hint: on Debian 13: apt-get install libonnxruntime1.21;"), "{}", lines[1]);
    assert!(lines[1].ends_with("; or add --no-combine to do without the combiner"), "{}", lines[1]);
    assert_eq!((lines.len(), place.files().len()), (2, 0));
    assert_eq!(missing("CAUSTIQUE_ONNXRUNTIME", &format!("{render} --no-combine")).code, Some(0));

    let outcome = missing("CAUSTIQUE_EMBREE", render);
    assert_eq!(outcome.code, Some(1));
    assert!(outcome.stderr.contains("Embree") && outcome.stderr.contains("\nhint: "), "{}", outcome.stderr);

    for (variable, key, name) in
        [("CAUSTIQUE_EMBREE", "embree", "Embree"), ("CAUSTIQUE_ONNXRUNTIME", "onnxruntime", "ONNX Runtime")]
    {
        let outcome = missing(variable, "doctor --json");
        assert_eq!(outcome.code, Some(1));
        let other = if key == "embree" { "onnxruntime" } else { "embree" };
        let json = outcome.json();
        assert_eq!(json[key]["found"], false);
        assert!(json[key]["hint"].as_str().is_some_and(|hint| hint.contains("Debian")), "{json}");
        assert_eq!(json[other]["found"], true, "{json}");
        assert!(json[other]["version"].as_str().is_some_and(|version| version.contains('.')), "{json}");
        assert!(outcome.stderr.starts_with(&format!("doctor: cannot use {name}\nhint: ")), "{}", outcome.stderr);
    }
    let well = place.run("doctor");
    assert_eq!((well.code, well.stderr.as_str()), (Some(0), ""));
}

// ---------------------------------------------------------------------------------------------------- what a render leaves

#[test]
fn a_render_leaves_all_layers_and_its_account() {
    let place = Workplace::new();
    let outcome = place.render("-o out.exr --png out.png --iterations 6 --seed 7");
    assert_eq!(place.files(), ["out.exr", "out.png"]);
    for part in [
        "method: sppm, chosen by auto\n",
        "\niteration 6 of 6, ",
        "\npeak memory ",
        "\nout.exr: 64 x 48, 93 channels\n",
    ] {
        assert!(outcome.stderr.contains(part), "{part:?} in {}", outcome.stderr);
    }
    let (set, header) = place.read("out.exr");
    assert_eq!((set.width, set.height), (64, 48));
    let mut expected: Vec<String> =
        ["", "Noisy", "Direct", "Indirect", "Caustic", "Emission", "Error"].map(String::from).into();
    for k in 1..=5 {
        expected.extend(["Level", "Variance", "Radius"].map(|stem| format!("{stem}{k}")));
    }
    expected.extend(["albedo", "normal", "depth", "Z", "P", "Rejected"].map(String::from));
    for k in 0..3 {
        expected.extend(["CryptoObject", "CryptoMaterial"].map(|stem| format!("{stem}0{k}")));
    }
    let mut found: Vec<String> = set.layers.iter().map(|layer| layer.name.clone()).collect();
    expected.sort();
    found.sort();
    assert_eq!(found, expected);
    assert!(set.layers.iter().flat_map(|l| &l.planes).all(|plane| plane.values.iter().all(|v| v.is_finite())));

    // The parts are the image; it is the second largest level; something is combined, something is a caustic.
    let (noisy, level) = (values(&set, "Noisy"), values(&set, "Level4"));
    let parts = ["Direct", "Indirect", "Caustic", "Emission"].map(|name| values(&set, name));
    for i in 0..noisy.len() {
        for c in 0..3 {
            let sum: f32 = parts.iter().map(|part| part[i][c]).sum();
            assert!(
                (sum - noisy[i][c]).abs() <= 1e-5 * noisy[i][c].abs().max(1e-3),
                "pixel {i}: {sum} {}",
                noisy[i][c]
            );
        }
        assert_eq!(noisy[i], level[i]);
    }
    let caustic: f32 = parts[2].iter().map(|p| p[0]).sum();
    assert!(caustic > 0.0 && values(&set, "") != noisy);
    // Each level's radius is 1/sqrt(2) of the next larger.
    for k in 1..5 {
        let (small, large) = (values(&set, &format!("Radius{k}")), values(&set, &format!("Radius{}", k + 1)));
        assert!(small.iter().zip(&large).all(|(s, l)| (s[0] / l[0] * 2f32.sqrt() - 1.0).abs() < 1e-5));
    }

    assert_eq!(header["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!((&header["seed"], &header["iterations"], &header["light_paths"]), (&7.into(), &6.into(), &12000.into()));
    assert_eq!((&header["method"], &header["stopped"]), (&"sppm".into(), &"iterations".into()));
    assert_eq!(header["arguments"]["scene"], "scene.glb");
    assert_eq!(header["arguments"]["photons"], 2000);
    assert_eq!(header["combined"]["model"], "compact");
    for key in ["seconds", "phases", "threads", "peak_memory", "error", "rejected", "warnings"] {
        assert!(!header[key].is_null(), "{key} in {header}");
    }
    for moment in header["history"].as_array().expect("a history") {
        for key in ["seconds", "cpu_seconds", "iterations", "light_paths", "error"] {
            assert!(moment.get(key).is_some(), "{key} in {moment}");
        }
    }
    let json = place.run("info out.exr --json").json();
    assert_eq!((&json["width"], &json["height"], &json["seed"]), (&64.into(), &48.into(), &7.into()));
    assert_eq!(json["layers"].as_array().map(Vec::len), Some(expected.len()));
    assert_eq!(json["history"], header["history"]);
    let text = place.run("info out.exr").stdout;
    assert!(text.contains("\n          +-----") && text.contains("6 iterations, 12000 light paths"), "{text}");
}

#[test]
fn the_same_bytes_with_any_number_of_threads() {
    let place = Workplace::new();
    for combine in ["", "--no-combine"] {
        let files: Vec<Vec<u8>> = (1..=3)
            .map(|threads| {
                let name = format!("t{threads}.exr");
                place.render(&format!("-o {name} --iterations 3 --threads {threads} --reproducible {combine}"));
                std::fs::read(place.path(&name)).expect("the file is there")
            })
            .collect();
        assert!(files[0] == files[1] && files[0] == files[2], "{combine}");
    }
    place.render("-o seed.exr --iterations 3 --seed 1 --reproducible --no-combine");
    let ((a, _), (b, _)) = (place.read("t1.exr"), place.read("seed.exr"));
    assert!(values(&a, "Noisy") != values(&b, "Noisy"));
    let (_, header) = place.read("t1.exr");
    for key in ["seconds", "phases", "threads", "peak_memory"] {
        assert!(header.get(key).is_none(), "{key}");
    }
    assert!(header["history"][0].get("seconds").is_none());
}

/// Shards render disjoint iterations of the same render: their means weigh up to the whole.
#[test]
fn shards_share_the_iterations_out() {
    let place = Workplace::new();
    place.render("-o whole.exr --iterations 5 --no-combine");
    place.render("-o a.exr --iterations 5 --shard 0/2 --no-combine");
    place.render("-o b.exr --iterations 5 --shard 1/2 --no-combine");
    let ((whole, _), (a, first), (b, second)) = (place.read("whole.exr"), place.read("a.exr"), place.read("b.exr"));
    assert_eq!((&first["iterations"], &second["iterations"]), (&3.into(), &2.into()));
    assert_eq!((&first["shard"]["index"], &first["shard"]["count"]), (&0.into(), &2.into()));
    for layer in ["Noisy", "Level1", "Level5", "Caustic"] {
        let (whole, a, b) = (values(&whole, layer), values(&a, layer), values(&b, layer));
        assert!(a != b, "{layer}");
        for i in 0..whole.len() {
            for c in 0..3 {
                let merged = (3.0 * a[i][c] + 2.0 * b[i][c]) / 5.0;
                assert!((merged - whole[i][c]).abs() <= 1e-5 * whole[i][c].abs().max(1e-3), "{layer}, pixel {i}");
            }
        }
    }
}

#[test]
fn levels_layers_names_and_bandwidths_as_asked() {
    let place = Workplace::new();
    place.render("-o one.exr --iterations 2 --levels 1 --layers beauty,Radius1 --initial-bandwidth 0.25 --alpha 1");
    let (set, header) = place.read("one.exr");
    let names: Vec<&str> = set.layers.iter().map(|layer| layer.name.as_str()).collect();
    assert_eq!((names, &header["combined"]), (vec!["", "Radius1"], &Value::Null));
    assert!(values(&set, "Radius1").iter().all(|r| r[0] == 0.25));
    place.render("-o three.exr --iterations 2 --levels 3 --no-combine --exr-naming blender --compression piz");
    let (set, _) = place.read("three.exr");
    assert!(set.get("ViewLayer.Combined").is_some() && set.get("ViewLayer.Level3").is_some());
    assert!(set.get("ViewLayer.Level4").is_none());
    let refused = place.run("render scene.glb -o no.exr --levels 3");
    let error = "command line: the network compact combines 5 levels, not 3\nhint: add --no-combine, or render with --levels 5\n";
    assert_eq!((refused.code, refused.stderr.as_str()), (Some(2), error));
}

/// One iteration cannot tell a variance: the header says so, and nothing in the file is infinite.
#[test]
fn one_iteration_says_that_its_variance_is_unknown() {
    let place = Workplace::new();
    place.render("-o out.exr --iterations 1 --no-combine");
    let (set, header) = place.read("out.exr");
    assert_eq!((&header["variance_known"], &header["error"]), (&false.into(), &Value::Null));
    assert!(set.layers.iter().flat_map(|l| &l.planes).all(|plane| plane.values.iter().all(|v| v.is_finite())));
    assert!(values(&set, "Error") == values(&set, "Noisy"));
}

// ---------------------------------------------------------------------------------------------------- progress and signals

#[test]
fn progress_for_programs() {
    let place = Workplace::new();
    let outcome = place.render("-o out.exr --iterations 3 --no-combine --progress json");
    let lines: Vec<Value> = outcome.stderr.lines().map(|l| serde_json::from_str(l).expect("a JSON line")).collect();
    assert_eq!(lines.len(), 3);
    for (i, line) in lines.iter().enumerate() {
        let keys: Vec<&String> = line.as_object().expect("an object").keys().collect();
        assert_eq!(keys, ["error", "iteration", "iterations", "light_paths", "remaining", "seconds"]);
        assert_eq!((&line["iteration"], &line["iterations"]), (&(i + 1).into(), &3.into()));
        assert_eq!(line["light_paths"], 2000 * (i + 1));
    }
    assert!(lines[0]["error"].is_null() && lines[2]["error"].as_f64().is_some_and(|e| e > 0.0));

    let outcome = place.render("-o out.exr --iterations 2 --no-combine --progress openjd");
    assert!(outcome.stderr.contains("openjd_progress: 50.0\nopenjd_status: iteration 1 of 2, "), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("openjd_progress: 100.0\n"), "{}", outcome.stderr);
    assert_eq!(place.render("-o out.exr --iterations 2 --no-combine --progress none").stderr, "");
}

#[test]
fn stop_conditions() {
    let place = Workplace::new();
    place.render("-o time.exr --time 0.2 --no-combine");
    let (_, header) = place.read("time.exr");
    assert_eq!(header["stopped"], "time");
    place.render("-o error.exr --target-error 0.9 --no-combine");
    let (_, header) = place.read("error.exr");
    assert_eq!(header["stopped"], "error");
    assert!(header["error"].as_f64().is_some_and(|e| e <= 0.9), "{header}");
}

/// Reads stderr until a line that begins with `start`.
fn wait_for_line(child: &mut Child, start: &str) -> BufReader<impl Read + use<>> {
    let mut lines = BufReader::new(child.stderr.take().expect("stderr is piped"));
    loop {
        let mut line = String::new();
        assert_ne!(lines.read_line(&mut line).expect("stderr can be read"), 0, "the program ended before {start:?}");
        if line.starts_with(start) {
            return lines;
        }
    }
}

fn signal(child: &Child, name: &str) {
    let status = Command::new("kill").args([name, &child.id().to_string()]).status().expect("kill runs");
    assert!(status.success());
}

#[test]
fn a_signal_writes_what_is_finished() {
    for name in ["-INT", "-TERM"] {
        let place = Workplace::new();
        let arguments =
            "render scene.glb -o out.exr --width 64 --photons 2000 --time 600 --no-combine --progress plain";
        let mut command = place.command(arguments);
        let mut child = command.stderr(Stdio::piped()).spawn().expect("the program starts");
        let mut rest = wait_for_line(&mut child, "iteration 1,");
        signal(&child, name);
        let status = child.wait().expect("the program ends");
        let mut text = String::new();
        rest.read_to_string(&mut text).expect("stderr can be read");
        assert_eq!(status.code(), Some(130), "{text}");
        let (set, header) = place.read("out.exr");
        let iterations = header["iterations"].as_u64().expect("a number");
        assert!(iterations >= 1 && set.get("Level1").is_some());
        assert_eq!(header["stopped"], "interrupted");
        let last = format!("out.exr: interrupted after {iterations} iterations, which are written\n");
        assert!(text.ends_with(&last), "{text}");
    }
}

#[test]
fn a_second_signal_ends_at_once() {
    let place = Workplace::new();
    // One iteration of this takes minutes.
    let arguments = "render scene.glb -o out.exr --width 64 --photons 200000000 --no-combine --progress plain";
    let mut child = place.command(arguments).stderr(Stdio::piped()).spawn().expect("the program starts");
    let _rest = wait_for_line(&mut child, "method: ");
    signal(&child, "-INT");
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(child.try_wait().expect("its state is known"), None, "one signal must not end it at once");
    signal(&child, "-INT");
    let mut waited = 0;
    let status = loop {
        if let Some(status) = child.try_wait().expect("its state is known") {
            break status;
        }
        waited += 1;
        assert!(waited < 100, "the second signal did not end it");
        std::thread::sleep(Duration::from_millis(100));
    };
    assert_eq!(status.code(), Some(130));
    assert_eq!(place.files(), [""; 0]);
}

// ---------------------------------------------------------------------------------------------------- the other commands

#[test]
fn combining_later_is_combining_at_once() {
    let place = Workplace::new();
    place.render("-o at_once.exr --iterations 3");
    place.render("-o levels.exr --iterations 3 --no-combine");
    let outcome = place.run("combine levels.exr -o later.exr --png later.png");
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let ((at_once, _), (levels, _), (later, header)) =
        (place.read("at_once.exr"), place.read("levels.exr"), place.read("later.exr"));
    assert!(values(&at_once, "") == values(&later, ""));
    assert!(values(&levels, "") != values(&later, ""));
    assert_eq!(levels.layers.len(), later.layers.len());
    assert_eq!((&header["combined"]["model"], &header["iterations"]), (&"compact".into(), &3.into()));
    place.render("-o blender.exr --iterations 3 --no-combine --exr-naming blender");
    assert_eq!(place.run("combine blender.exr -o combined.exr").code, Some(0));
    assert!(values(&place.read("combined.exr").0, "ViewLayer.Combined") == values(&later, ""));
    place.render("-o beauty.exr --iterations 2 --layers beauty");
    let outcome = place.run("combine beauty.exr -o no.exr");
    let error = "beauty.exr: the file has no bandwidth levels (Level1, Level2, ...)\nhint: render with --layers all\n";
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(1), error));
}

#[test]
fn comparisons() {
    let place = Workplace::new();
    place.render("-o a.exr --iterations 2 --no-combine");
    place.render("-o b.exr --iterations 2 --no-combine --seed 1");
    let json = place.run("compare a.exr a.exr --json").json();
    assert_eq!((json["relmse"].as_f64(), json["mean_ratio"].as_f64()), (Some(0.0), Some(1.0)));
    let outcome = place.run("compare a.exr b.exr --json --png heat.png");
    let json = outcome.json();
    for key in ["relmse", "relmse_trimmed", "mse", "mean_ratio", "flip"] {
        assert!(json[key].as_f64().is_some_and(|x| x > 0.0), "{key} in {json}");
    }
    assert_eq!(json["pixels_not_finite"], 0);
    assert!(place.path("heat.png").exists());
    assert!(place.run("compare a.exr b.exr --layer Level1").stdout.starts_with("relMSE "));
    let outcome = place.run("compare a.exr nope.exr");
    assert_eq!(outcome.code, Some(1));
    assert!(outcome.stderr.starts_with("nope.exr: "), "{}", outcome.stderr);
}

#[test]
fn what_a_scene_holds() {
    let place = Workplace::new();
    let json = place.run("info scene.glb --json").json();
    assert_eq!((&json["meshes"], &json["triangles"]), (&2.into(), &4.into()));
    assert_eq!(json["cameras"], serde_json::json!(["Camera", "Side"]));
    assert_eq!(json["materials"], serde_json::json!(["stone", "silver"]));
    assert_eq!((&json["lights"]["point"], &json["warnings"]), (&1.into(), &serde_json::json!([])));
    let text = place.run("info scene.glb").stdout;
    assert!(text.contains("  cameras    2: Camera, Side\n"), "{text}");
    let outcome = place.run("info nope");
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(1), "nope: No such file or directory (os error 2)\n"));
}

/// Warnings are lines of their own; `--strict` makes an error of them before rendering.
#[test]
fn warnings_and_strict() {
    let place = Workplace::new();
    support::glb::write(&place.path("dark.glb"), false);
    let render = "render dark.glb -o out.exr --width 32 --iterations 1 --photons 100 --no-combine --progress none";
    let warning = "warning: dark.glb: the scene has no light: the picture will be black (add --env, a lamp or an emissive material)\n";
    let outcome = place.run(render);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), warning));
    assert_eq!(place.read("out.exr").1["warnings"].as_array().map(Vec::len), Some(1));
    std::fs::remove_file(place.path("out.exr")).expect("it was there");
    let outcome = place.run(&format!("{render} --strict"));
    let error = "dark.glb: 1 thing is ignored or approximated, and --strict forbids it\n\
                 hint: mend what the warnings above name, or leave --strict out\n";
    assert_eq!((outcome.code, outcome.stderr), (Some(1), format!("{warning}{error}")));
    assert!(!place.path("out.exr").exists());
    // An environment is light, and a background that can be seen.
    assert_eq!(place.run(&format!("{render} --env 1,1,1 --strict")).code, Some(0));
    let (set, _) = place.read("out.exr");
    let alpha = &set.get("").and_then(|beauty| beauty.plane("A")).expect("alpha").values;
    assert!(alpha.iter().all(|a| *a == 1.0));
}
