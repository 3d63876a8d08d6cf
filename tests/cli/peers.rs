//! `caustique converge --with`: the protocol between the program and drivers of other renderers. A shell script
//! replaces the Python that runs the drivers; `test_peers.py` tests the drivers themselves.

use crate::{Folder, Outcome};
use serde_json::Value;
use std::process::{Command, Stdio};

/// Arguments of a comparison with other renderers, without the finish of our own pictures.
const SMALL: &str = "converge scene.glb --width 48 --height 36 --methods path --no-finish --reference reference.exr --progress none -o out";

/// A folder with a reference, and with a script in place of Python. The program calls it as `-I -B -c PROBE MODULES`,
/// which always succeeds, or as `-I -B FOLDER DRIVER SCENE OUT --mode=.. ..`.
fn folder(script: &str) -> Folder {
    let folder = Folder::new();
    let size = "--width 48 --height 36 --no-combine --layers beauty";
    folder.run(&format!("render scene.glb -o reference.exr --method bdpt --iterations 64 --seed 9 {size}"));
    folder.run(&format!("render scene.glb -o same.exr --method bdpt --iterations 16 --seed 8 {size}"));
    folder.run(&format!("render scene.glb -o other.exr --method bdpt --iterations 16 --env 0.2,0.2,0.2 {size}"));
    let script = format!("#!/bin/sh\n[ \"$3\" = -c ] && exit 0\n{script}\n");
    std::fs::write(folder.path("python"), script).expect("it can be written");
    Command::new("chmod").arg("+x").arg(folder.path("python")).status().expect("chmod runs");
    folder
}

fn command(folder: &Folder, arguments: &str) -> Command {
    let mut command = folder.command(arguments);
    command.env("CAUSTIQUE_PEERS_PYTHON", folder.path("python"));
    command
}

fn report(folder: &Folder) -> Value {
    let text = std::fs::read_to_string(folder.path("out/points.json")).expect("it is there");
    serde_json::from_str(&text).expect("it is JSON")
}

const ANSWERS: &str = r#"
case "$*" in
*--mode=path\ *) cp same.exr "$6" ;;
*--mode=path_cache\ *) echo 'PEER {"cannot": ["spots", "fog"]}'; exit 0 ;;
*) echo 'it is broken' >&2; exit 3 ;;
esac
echo "$*" >> calls
echo 'noise of a library'
echo 'PEER {"seconds": 0.25, "core_seconds": 0.5, "startup_seconds": 1.5, "passes": 12, "version": "9.9", "approximations": ["red is blue"]}'
"#;

/// One mode renders, one cannot express the scene, and one fails. Each has a row in the report, and the comparison
/// succeeds.
#[test]
fn peers_have_a_curve_or_a_row_with_a_reason() {
    let folder = folder(ANSWERS);
    let outcome = Outcome::of(command(&folder, &format!("{SMALL} --time 0.8 --seed 3 --with luxcore")));
    assert_eq!((outcome.code, outcome.stderr.contains("warning: --with")), (Some(0), false), "{}", outcome.stderr);
    let json = report(&folder);
    let run = |name: &str| {
        let runs = json["runs"].as_array().expect("a list");
        runs.iter().find(|run| run["name"] == name).unwrap_or_else(|| panic!("no {name}")).clone()
    };
    let points = |name: &str| -> Vec<Value> {
        let points = json["points"].as_array().expect("a list");
        points.iter().filter(|point| point["run"] == name).cloned().collect()
    };
    // Budgets double from a sixteenth of the time to all of it.
    let calls = std::fs::read_to_string(folder.path("calls")).expect("it was called");
    let budget =
        |line: &str| line.split("--budget=").nth(1).and_then(|rest| rest.split(' ').next()?.parse::<f64>().ok());
    let budgets: Vec<f64> = calls.lines().filter_map(budget).collect();
    assert_eq!(budgets, [0.05, 0.1, 0.2, 0.4, 0.8]);
    assert!(
        calls.lines().all(|line| line.contains("luxcore_driver scene.glb ") && line.contains("--width=48 --height=36"))
    );
    assert!(calls.lines().all(|line| line.contains("--seed=3")));

    let raw = points("LuxCore path");
    assert_eq!(raw.len(), 5);
    assert!(raw.iter().all(|p| p["seconds"] == 0.25 && p["cpu_seconds"] == 0.5 && p["iterations"] == 12));
    let compared = folder.run("compare same.exr reference.exr --json").json();
    for key in ["relmse", "relmse_trimmed", "mean_ratio"] {
        assert_eq!(raw[0][key], compared[key], "{key}");
    }
    let denoised = points("LuxCore path + OIDN");
    assert_eq!(denoised.len(), 5);
    for (point, raw) in denoised.iter().zip(&raw) {
        let [seconds, finish] = ["seconds", "finish_seconds"].map(|key| point[key].as_f64().expect("a number"));
        assert!(finish > 0.0 && (seconds - 0.25 - finish).abs() < 1e-9, "{point}");
        assert_ne!(point["relmse"], raw["relmse"]);
    }
    let path = run("LuxCore path");
    assert_eq!((&path["version"], &path["startup_seconds"], &path["out"]), (&"9.9".into(), &1.5.into(), &Value::Null));
    assert_eq!((&path["approximations"][0], &path["same_scene"]), (&"red is blue".into(), &true.into()));
    assert_eq!(run("LuxCore cache")["out"], "cannot render the scene: spots; fog");
    let failed = run("LuxCore bidir")["out"].as_str().expect("it failed").to_string();
    assert!(failed.contains("it is broken") && failed.contains("exit status: 3"), "{failed}");
    assert_eq!(points("LuxCore cache").len() + points("LuxCore bidir").len(), 0);
    let page = std::fs::read_to_string(folder.path("out/index.html")).expect("it is there");
    for text in ["spots; fog", "it is broken", "red is blue", "LuxCore path + OIDN", "within 1 %"] {
        assert!(page.contains(text), "{text}");
    }
    assert!(folder.path("out/luxcore-path.exr").exists() && folder.path("out/luxcore-path-oidn.exr").exists());
}

/// If the mean of a picture differs from the reference, the row says that the scene is not the same, and by how much.
#[test]
fn a_peer_that_renders_another_scene_is_reported() {
    let folder = folder(&ANSWERS.replace("same.exr", "other.exr"));
    let outcome = Outcome::of(command(&folder, &format!("{SMALL} --time 0.2 --with luxcore")));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let json = report(&folder);
    let run = &json["runs"][1];
    let compared = folder.run("compare other.exr reference.exr --json").json();
    assert_eq!((&run["same_scene"], &run["mean_ratio"]["value"]), (&false.into(), &compared["mean_ratio"]));
    // Options that drivers do not support would change the scene.
    let arguments = format!("{SMALL} --time 0.1 --env 1,1,1 --with luxcore");
    let outcome = Outcome::of(command(&folder, &arguments));
    let warning = "warning: --with: drivers do not know --env; other renderers are left out\n";
    assert!(outcome.code == Some(0) && outcome.stderr.contains(warning), "{}", outcome.stderr);
    assert_eq!(report(&folder)["runs"][1]["out"], "drivers do not know --env");
}

#[test]
fn missing_modules_give_a_hint_how_to_install_them() {
    let folder = folder("");
    std::fs::write(folder.path("python"), "#!/bin/sh\necho 'no module pyluxcore' >&2; exit 1\n")
        .expect("it is written");
    let arguments = format!("{SMALL} --time 0.1 --with luxcore");
    let outcome = Outcome::of(command(&folder, &arguments));
    let place = folder.path("python").display().to_string();
    let expected = format!("{place}: no module pyluxcore\nhint: run 'scripts/compare/setup.sh peers'\n");
    assert_eq!((outcome.code, outcome.stderr.contains(&expected)), (Some(1), true), "{}", outcome.stderr);
    let mut missing = folder.command(&arguments);
    let outcome = Outcome::of({
        missing.env("CAUSTIQUE_PEERS_PYTHON", "/no/such/python");
        missing
    });
    let expected = "CAUSTIQUE_PEERS_PYTHON=/no/such/python: no such file\n";
    assert!(
        outcome.stderr.contains(expected) && outcome.stderr.contains("scripts/compare/setup.sh peers"),
        "{}",
        outcome.stderr
    );
    assert!(!folder.path("out").exists());
}

/// Ctrl-C ends a driver that would render for ten minutes, and the report is written.
#[test]
fn a_signal_ends_a_driver() {
    let folder = folder("echo $$ > pid.part; mv pid.part pid; sleep 600");
    let mut command = command(&folder, &format!("{SMALL} --time 0.2 --with mitsuba"));
    let mut child = command.stderr(Stdio::null()).spawn().expect("the program starts");
    let noted = folder.path("pid");
    while !noted.exists() {
        assert_eq!(child.try_wait().expect("its state is known"), None, "it ended before the driver began");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let kill = format!("kill -INT {}", child.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().expect("sh runs").success());
    assert_eq!(child.wait().expect("the program ends").code(), Some(130));
    let id = std::fs::read_to_string(&noted).expect("it is there");
    let state = std::fs::read_to_string(format!("/proc/{}/stat", id.trim())).unwrap_or_default();
    assert!(state.rsplit_once(')').is_none_or(|(_, rest)| rest.trim_start().starts_with('Z')), "{state}");
    assert_eq!(report(&folder)["interrupted"], true);
}
