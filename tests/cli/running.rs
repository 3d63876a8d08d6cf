//! Progress, stop conditions and signals.

use crate::{Folder, values};
use caustique::film::LayerSet;
use caustique::image::exr;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

#[test]
fn progress_for_programs_is_json_or_open_job_description() {
    let folder = Folder::new();
    let outcome = folder.render("-o out.exr --iterations 3 --no-combine --progress json");
    let events: Vec<Value> = outcome.stderr.lines().map(|l| serde_json::from_str(l).expect("a JSON line")).collect();
    let kinds: Vec<&str> = events.iter().filter_map(|event| event["event"].as_str()).collect();
    assert_eq!(kinds, ["start", "progress", "progress", "progress", "output", "finish"], "{}", outcome.stderr);
    assert_eq!((&events[0]["scene"], &events[0]["iterations"]), (&"scene.glb".into(), &3.into()));
    assert_eq!((&events[4]["path"], &events[4]["kind"]), (&"out.exr".into(), &"exr".into()));
    assert_eq!((&events[5]["iterations"], &events[5]["interrupted"]), (&3.into(), &false.into()));
    assert!(events.iter().all(|event| event["version"] == 1));
    let lines = &events[1..4];
    for (i, line) in lines.iter().enumerate() {
        let keys: Vec<&String> = line.as_object().expect("an object").keys().collect();
        assert_eq!(
            keys,
            ["error", "error_of", "event", "iteration", "iterations", "light_paths", "remaining", "seconds", "version"]
        );
        assert_eq!((&line["iteration"], &line["iterations"]), (&(i + 1).into(), &3.into()));
        assert_eq!(line["light_paths"], 2000 * (i + 1));
    }
    assert!(lines[0]["error"].is_null() && lines[2]["error"].as_f64().is_some_and(|e| e > 0.0));

    let outcome = folder.render("-o out.exr --iterations 2 --no-combine --progress openjd");
    assert!(outcome.stderr.contains("openjd_progress: 50.0\nopenjd_status: iteration 1 of 2, "), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("openjd_progress: 100.0\n"), "{}", outcome.stderr);
    assert_eq!(folder.render("-o out.exr --iterations 2 --no-combine --progress none").stderr, "");
}

/// Errors, also those of the command line, and warnings are events, too.
#[test]
fn all_that_programs_read_is_json() {
    let folder = Folder::new();
    for (words, code) in [("--iterations 0", 2), ("--no-such-option", 2), ("--camera nobody", 2), ("--env no.exr", 1)] {
        let outcome = folder.run(&format!("render scene.glb -o out.exr {words} --progress plain --progress=json"));
        let events: Vec<Value> =
            outcome.stderr.lines().map(|l| serde_json::from_str(l).expect("a JSON line")).collect();
        let last = events.last().expect("there is an error");
        assert_eq!((&last["event"], &last["exit_code"]), (&"error".into(), &code.into()), "{}", outcome.stderr);
        assert_eq!(outcome.code, Some(code));
        assert!(last["message"].as_str().is_some_and(|message| !message.is_empty()));
    }
    let outcome = folder.run(
        "render scene.glb -o out.exr --method path --iterations 1 --width 8 --no-finish --threads 1024 --progress json",
    );
    let first: Value = serde_json::from_str(outcome.stderr.lines().next().unwrap_or_default()).expect("a JSON line");
    assert_eq!(first["event"], "warning");
    assert!(first["message"].as_str().is_some_and(|message| message.starts_with("--threads 1024")), "{first}");
}

/// Control characters in names of a scene are escaped, so they affect neither a terminal nor a farm.
#[test]
fn names_in_a_scene_cannot_control_terminals_or_farms() {
    let folder = Folder::new();
    let name = "\u{1b}]0;title\u{7}\nopenjd_fail: forged\r\u{9b}2J\u{202e}";
    crate::support::glb::write_grouped(&folder.path("scene.glb"), [name, "a-b", "a b"]);
    let acts = |text: &str| text.chars().any(|c| c != '\n' && (c.is_control() || c == '\u{202e}'));
    for progress in ["plain", "openjd", "json"] {
        let outcome = crate::files::small(&folder, &format!("--iterations 2 --no-combine --progress {progress}"));
        let escaped = match progress {
            "json" => r"\u001b]0;title\u0007\nopenjd_fail: forged",
            _ => r"\u{1b}]0;title\u{7}\nopenjd_fail: forged",
        };
        assert!(outcome.stderr.contains(escaped), "{}", outcome.stderr);
        assert!(!outcome.stderr.contains("\nopenjd_fail") && !acts(&outcome.stderr), "{progress}");
    }
    for command in ["info scene.glb", "plan scene.glb --width 16", "info out.exr"] {
        let [text, json] = ["", " --json"].map(|form| folder.run(&format!("{command}{form}")).stdout);
        assert!(!text.contains("\nopenjd_fail") && !acts(&text) && !acts(&json), "{command}");
        let json: Value = serde_json::from_str(&json).expect("it is JSON");
        let warned = json["warnings"]
            .as_array()
            .is_some_and(|all| all.iter().any(|one| one.as_str().is_some_and(|one| one.contains(name))));
        assert!(warned, "{command}: {json}");
    }
}

#[test]
fn a_render_stops_at_its_time_limit_or_target_error() {
    let folder = Folder::new();
    folder.render("-o time.exr --time 0.2 --no-combine");
    let (_, header) = folder.read("time.exr");
    assert_eq!(header["stopped"], "time");
    folder.render("-o error.exr --target-error 0.9 --no-combine");
    let (_, header) = folder.read("error.exr");
    assert_eq!(header["stopped"], "error");
    assert!(header["error"].as_f64().is_some_and(|e| e <= 0.9), "{header}");
}

/// Reads stderr up to a line that begins with `start`, and returns the rest.
fn wait_for_line(child: &mut Child, start: &str) -> BufReader<impl Read + use<>> {
    let mut lines = BufReader::new(child.stderr.take().expect("stderr is piped"));
    read_to_line(&mut lines, start);
    lines
}

fn read_to_line(lines: &mut impl BufRead, start: &str) {
    loop {
        let mut line = String::new();
        assert_ne!(lines.read_line(&mut line).expect("stderr can be read"), 0, "the program ended before {start:?}");
        if line.starts_with(start) {
            return;
        }
    }
}

/// The rest of stderr of a program, which ends with this code.
fn ended(child: &mut Child, mut rest: impl Read, code: i32) -> String {
    let mut text = String::new();
    rest.read_to_string(&mut text).expect("stderr can be read");
    assert_eq!(child.wait().expect("the program ends").code(), Some(code), "{text}");
    text
}

fn signal(child: &Child, name: &str) {
    // `kill` of the shell, because a minimal Debian has no such program.
    let kill = format!("kill {name} {}", child.id());
    let status = Command::new("sh").args(["-c", &kill]).status().expect("sh runs");
    assert!(status.success());
}

#[test]
fn a_signal_writes_the_finished_iterations() {
    // Children of a test that `nohup` has started ignore SIGHUP.
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux has it");
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).expect("a mask");
    let hangs_up = u64::from_str_radix(ignored.trim(), 16).expect("a mask") & 1 == 0;
    for name in ["-INT", "-TERM"].into_iter().chain(hangs_up.then_some("-HUP")) {
        let folder = Folder::new();
        let arguments =
            "render scene.glb -o out.exr --width 64 --photons 2000 --time 600 --no-combine --progress plain";
        let mut command = folder.command(arguments);
        let mut child = command.stderr(Stdio::piped()).spawn().expect("the program starts");
        let rest = wait_for_line(&mut child, "iteration 1,");
        signal(&child, name);
        let text = ended(&mut child, rest, 130);
        let (set, header) = folder.read("out.exr");
        let iterations = header["iterations"].as_u64().expect("a number");
        assert!(iterations >= 1 && set.get("Level1").is_some());
        assert_eq!(header["stopped"], "interrupted");
        let last = format!("out.exr: interrupted after {iterations} iterations, which are written\n");
        let hint = "hint: the same command with --resume out.exr.checkpoint goes on\n";
        assert!(text.ends_with(&format!("{last}{hint}")), "{text}");
        assert!(folder.path("out.exr.checkpoint").exists());
    }
}

/// A single picture that was stopped is not there yet: the same command with --skip-existing goes on.
#[test]
fn skip_existing_goes_on_with_a_stopped_picture() {
    let folder = Folder::new();
    let line =
        "render scene.glb -o out.exr --width 64 --photons 2000 --iterations 400 --progress plain --skip-existing";
    let mut child = folder.command(line).stderr(Stdio::piped()).spawn().expect("the program starts");
    let rest = wait_for_line(&mut child, "iteration 1 ");
    signal(&child, "-TERM");
    ended(&mut child, rest, 130);
    assert_eq!(folder.read("out.exr").1["stopped"], "interrupted");
    folder.run(line);
    let (_, header) = folder.read("out.exr");
    assert_eq!((&header["stopped"], &header["iterations"]), (&"iterations".into(), &400.into()));
    assert!(!folder.path("out.exr.checkpoint").exists());
}

/// A render that `nohup` has started goes on when the terminal is closed.
#[test]
fn nohup_keeps_a_render() {
    let folder = Folder::new();
    let command = folder.command("render scene.glb -o out.exr --width 64 --photons 2000 --time 3 --progress plain");
    let mut child = Command::new("sh")
        .args(["-c", "trap '' HUP; exec \"$0\" \"$@\""])
        .arg(command.get_program())
        .args(command.get_args())
        .envs(command.get_envs().filter_map(|(name, value)| Some((name, value?))))
        .current_dir(command.get_current_dir().expect("the folder"))
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let rest = wait_for_line(&mut child, "iteration 1,");
    signal(&child, "-HUP");
    ended(&mut child, rest, 0);
    assert_eq!(folder.read("out.exr").1["stopped"], "time");
}

#[test]
fn a_signal_writes_the_report_of_an_unfinished_comparison() {
    let folder = Folder::new();
    folder.run("render scene.glb -o reference.exr --method bdpt --width 48 --height 36 --iterations 4 --seed 9");
    let arguments = "converge scene.glb --width 48 --height 36 --methods bdpt,path --time 600 --reference reference.exr --progress plain -o out";
    let mut child = folder.command(arguments).stderr(Stdio::piped()).spawn().expect("the program starts");
    let rest = wait_for_line(&mut child, "0 %, ");
    signal(&child, "-INT");
    let text = ended(&mut child, rest, 130);
    assert!(text.ends_with("out: interrupted; the report on what was done is written\n"), "{text}");
    let json = std::fs::read_to_string(folder.path("out/points.json")).expect("it is there");
    let json: Value = serde_json::from_str(&json).expect("it is JSON");
    assert_eq!(json["interrupted"], true);
    assert!(folder.path("out/index.html").exists());
}

#[test]
fn signals_end_a_running_iteration() {
    let folder = Folder::new();
    // An iteration takes many seconds, so a warning comes before it.
    let arguments = "render scene.glb -o out.exr --method sppm --width 64 --photons 20000000 --time 1 --no-combine --progress plain";
    let mut child = folder.command(arguments).stderr(Stdio::piped()).spawn().expect("the program starts");
    let mut rest = wait_for_line(&mut child, "warning: scene.glb: one iteration takes about ");
    signal(&child, "-TERM");
    read_to_line(&mut rest, "out.exr: interrupted before the first iteration; nothing is written\n");
    let mut waited = 0;
    let status = loop {
        if let Some(status) = child.try_wait().expect("its state is known") {
            break status;
        }
        waited += 1;
        assert!(waited < 100, "the signal did not end it");
        std::thread::sleep(Duration::from_millis(100));
    };
    assert_eq!(status.code(), Some(130));
    assert_eq!(folder.files(), [""; 0]);
}

/// Methods that trace the light paths of the whole picture warn about the time of an iteration, also for a small
/// window.
#[test]
fn a_window_of_a_huge_picture_gives_a_warning_about_its_time() {
    let folder = Folder::new();
    let render = "render scene.glb -o out.exr --width 16000 --height 16000 --crop 8000,8000,16,16 --time 1 --no-combine --progress plain";
    for (method, warns) in [("bdpt", true), ("light", true), ("path", false)] {
        let mut command = folder.command(&format!("{render} --method {method}"));
        let mut child = command.stderr(Stdio::piped()).spawn().expect("the program starts");
        let mut lines = BufReader::new(child.stderr.take().expect("stderr is piped"));
        let mut text = String::new();
        while !text.contains("one iteration takes about ")
            && lines.read_line(&mut text).expect("stderr can be read") > 0
        {}
        if warns {
            signal(&child, "-TERM");
        }
        child.wait().expect("the program ends");
        assert_eq!(text.contains("one iteration takes about "), warns, "{method}: {text}");
    }
}

/// Messages explain long waits: for the pilot, and for reading a scene, here from a slow pipe.
#[test]
fn waits_are_explained() {
    let folder = Folder::new();
    // Nothing in the scene focuses light, so the pilot compares several methods.
    let blocks = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/blocks.glb");
    std::fs::copy(blocks, folder.path("blocks.glb")).expect("it can be copied");
    let arguments = "render blocks.glb -o out.exr --width 640 --time 3600 --progress plain";
    let mut child = folder.command(arguments).stderr(Stdio::piped()).spawn().expect("the program starts");
    let rest = wait_for_line(&mut child, "choosing a method\n");
    signal(&child, "-INT");
    let text = ended(&mut child, rest, 130);
    let end = "out.exr: interrupted before the first iteration; nothing is written\n";
    assert_eq!(text, format!("stopping; press again to stop now\n{end}"));

    let made = Command::new("mkfifo").arg(folder.path("pipe.glb")).status().expect("mkfifo runs");
    assert!(made.success());
    let scene = std::fs::read(folder.path("scene.glb")).expect("it is there");
    let render = "render pipe.glb -o out.exr --width 16 --iterations 1 --photons 100 --no-combine --progress";
    for form in ["plain", "none"] {
        let mut command = folder.command(&format!("{render} {form}"));
        let mut child = command.stderr(Stdio::piped()).spawn().expect("the program starts");
        std::thread::sleep(Duration::from_millis(1500));
        std::fs::write(folder.path("pipe.glb"), &scene).expect("the program reads");
        let mut text = String::new();
        child.stderr.take().expect("stderr is piped").read_to_string(&mut text).expect("stderr can be read");
        assert_eq!(child.wait().expect("it ends").code(), Some(0), "{text}");
        assert_eq!(text.starts_with("reading pipe.glb\n"), form == "plain", "{text}");
    }
}

#[test]
fn a_render_continues_when_stderr_is_closed() {
    for form in ["plain", "json", "openjd"] {
        let folder = Folder::new();
        let arguments =
            format!("render scene.glb -o out.exr --width 64 --photons 2000 --iterations 20 --progress {form}");
        let mut child = folder.command(&arguments).stderr(Stdio::piped()).spawn().expect("the program starts");
        drop(child.stderr.take());
        assert_eq!(child.wait().expect("it ends").code(), Some(0), "{form}");
        assert_eq!(folder.read("out.exr").1["iterations"], 20);
    }
}

#[test]
fn a_closed_stdout_is_not_an_error() {
    let folder = Folder::new();
    for arguments in ["render --help", "info scene.glb"] {
        let mut command = folder.command(arguments);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts");
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("it ends");
        assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]), "{arguments}");
    }
}

/// A network that does not exist is found before `auto` chooses a method.
#[test]
fn a_missing_network_is_found_before_any_work() {
    let folder = Folder::new();
    let outcome = folder.run("render scene.glb -o out.exr --iterations 100000 --model none.onnx --progress plain");
    assert_eq!(outcome.code, Some(1), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("none.onnx") && !outcome.stderr.contains("method:"), "{}", outcome.stderr);
    // A shard is finished after the merge, perhaps on another machine.
    let shard = "render scene.glb -o out.exr --shard 0/2 --iterations 2 --width 16 --height 12 --photons 500";
    let outcome = folder.run(&format!("{shard} --method sppm --model none.onnx"));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
}

/// If the network fails when it runs, the unfinished render is written. Its stride is changed to 3, which does not fit
/// its grids of 4.
#[test]
fn a_network_that_fails_leaves_the_unfinished_render() {
    let folder = Folder::new();
    let mut network = include_bytes!("../../src/combine/models/compact.onnx").to_vec();
    let stride = b"caustique.stride\x12\x014";
    let at = network.windows(stride.len()).position(|part| part == stride).expect("the network has a stride");
    network[at + stride.len() - 1] = b'3';
    std::fs::write(folder.path("odd.onnx"), network).expect("it can be written");
    let render = "render scene.glb -o out.exr --png out.png --width 65 --height 48 --photons 2000 --iterations 2";
    let outcome = folder.run(&format!("{render} --layers beauty --model odd.onnx --progress none"));
    assert_eq!(outcome.code, Some(1), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("odd.onnx"), "{}", outcome.stderr);
    let hint = "hint: the unfinished render is in out.exr: 'caustique finish out.exr -o OUT.exr' finishes it\n";
    assert!(outcome.stderr.ends_with(hint), "{}", outcome.stderr);
    assert_eq!(folder.files(), ["odd.onnx", "out.exr", "out.png"]);
    let (set, header) = folder.read("out.exr");
    assert!(header["combined"].is_null() && values(&set, "") == values(&set, "Level4"));
    let again = folder.run("combine out.exr -o again.exr");
    assert_eq!(again.code, Some(0), "{}", again.stderr);
}

/// If the output cannot be written at the end, the render is saved in the folder for temporary files.
#[test]
fn an_output_folder_that_disappears_loses_no_render() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("gone")).expect("it can be made");
    std::fs::create_dir(folder.path("temporary")).expect("it can be made");
    let arguments =
        "render scene.glb -o gone/out.exr --width 64 --photons 2000 --time 600 --no-combine --progress json";
    let mut command = folder.command(arguments);
    command.env("TMPDIR", folder.path("temporary"));
    let mut child = command.stderr(Stdio::piped()).spawn().expect("the program starts");
    let rest = wait_for_line(&mut child, "{\"iteration\":");
    std::fs::remove_dir_all(folder.path("gone")).expect("it can be removed");
    signal(&child, "-INT");
    let text = ended(&mut child, rest, 1);
    let error: Value = serde_json::from_str(text.trim_end().lines().last().unwrap_or_default()).expect("an event");
    assert!(error["message"].as_str().is_some_and(|message| message.starts_with("gone/out.exr: ")), "{text}");
    let hint = error["hint"].as_str().unwrap_or_default();
    let rescued = hint.strip_prefix("the render is in ").expect("the hint names a file");
    assert!(rescued.starts_with(&*folder.path("temporary").to_string_lossy()), "{rescued}");
    assert!(exr::read(rescued.as_ref()).is_ok_and(|(set, _)| set.get("Level5").is_some()));
}

/// The last preview is the picture itself, and the preview does not change the bytes of the render.
#[test]
fn a_preview_shows_the_picture_and_does_not_change_it() {
    let folder = Folder::new();
    folder.render("-o plain.exr --iterations 4 --reproducible");
    folder.render("-o a.exr --iterations 4 --reproducible --preview look.exr");
    let read = |name: &str| std::fs::read(folder.path(name)).expect("the file is there");
    assert!(read("plain.exr") == read("a.exr"), "the preview has changed the render");
    let (look, _) = exr::read(&folder.path("look.exr")).expect("the preview can be read");
    let (picture, _) = folder.read("a.exr");
    for component in ["R", "G", "B", "A"] {
        let plane = |set: &LayerSet| set.get("").and_then(|l| l.plane(component)).expect("a plane").values.clone();
        assert_eq!(plane(&look), plane(&picture));
    }
    assert_eq!(look.layers.len(), 1);

    folder.render("-o b.exr --iterations 1 --preview look.png");
    assert!(read("look.png").starts_with(b"\x89PNG"));
    let outcome = folder.run("render scene.glb -o b.exr --preview look.jpg");
    assert_eq!(outcome.code, Some(2));
    assert!(outcome.stderr.contains("a file that ends in .png or .exr, or 'tev'"), "{}", outcome.stderr);
    let outcome = folder.run("render scene.glb -o b.exr --preview b.exr");
    assert_eq!(outcome.code, Some(2));
    assert!(outcome.stderr.contains("b.exr: is the same file as the output b.exr"), "{}", outcome.stderr);
}

/// The error of a finished picture is estimated with an interval and the tiles with the largest error, which `info`
/// prints. A plan predicts the time for a target error.
#[test]
fn the_error_of_the_finished_picture_is_estimated() {
    let folder = Folder::new();
    let said = folder.render("-o out.exr --method sppm --iterations 16 --denoise own --progress plain").stderr;
    assert!(said.contains("; error ") && said.contains(" to ") && said.contains("where the error is: "), "{said}");
    let (set, header) = folder.read("out.exr");
    assert_eq!(header["error_of"], "finished picture");
    let (error, interval) = (header["error"].as_f64().expect("a number"), &header["accuracy"]["interval"]);
    let [low, high] = [0, 1].map(|end| interval[end].as_f64().expect("a number"));
    assert!(0.0 < low && low < error && error < high, "{header}");
    let shares: f64 =
        header["worst"]["by"].as_array().expect("places").iter().filter_map(|of| of["share"].as_f64()).sum();
    assert!((0.5..1.001).contains(&shares), "{header}");
    assert!(header["worst"]["tiles"].as_array().is_some_and(|tiles| tiles.len() == 10));
    assert!(values(&set, "Error").iter().flatten().all(|value| value.is_finite() && *value >= 0.0));
    let info = folder.run("info out.exr").stdout;
    assert!(info.contains("the error lies between ") && info.contains("where the error is: "), "{info}");

    // A second finish gives the same layer, because it does not depend on earlier iterations.
    let levels = "Variance1,Variance2,Variance3,Variance4,Variance5,Level4,Level5,albedo,normal";
    let layers = format!("beauty,Noisy,Quarter1,Quarter2,Quarter3,Quarter4,{levels}");
    folder.render(&format!("-o raw.exr --method sppm --iterations 16 --no-combine --layers {layers}"));
    let outcome = folder.run("combine raw.exr -o again.exr --denoise own");
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let (again, header) = folder.read("again.exr");
    assert!(values(&again, "Error") == values(&set, "Error"));
    assert!(header["accuracy"]["interval"].is_array());

    let plan = "plan scene.glb --method sppm --width 64 --height 48 --denoise own --target-error 0.01 --json";
    let outlook = &folder.run(plan).json()["outlook"];
    let [low, high] = [0, 1].map(|end| outlook["iterations_interval"][end].as_u64());
    assert!(outlook["iterations"].as_u64().is_some_and(|n| n >= 8 && low <= Some(n) && Some(n) < high), "{outlook}");
    assert!(outlook["seconds"].as_f64().is_some_and(|seconds| seconds > 0.0), "{outlook}");
}

/// The page of `compare` shows the picture, its reference, and the measured and the estimated error.
#[test]
fn compare_shows_errors_on_a_page() {
    let folder = Folder::new();
    folder.render("-o a.exr --method sppm --iterations 8 --denoise own");
    folder.render("-o b.exr --method sppm --iterations 32 --denoise own --seed 1");
    let outcome = folder.run("compare a.exr b.exr --page errors.html");
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let page = std::fs::read_to_string(folder.path("errors.html")).expect("the page is there");
    assert!(page.contains("error that the render has estimated") && page.matches("<figure>").count() == 5);
}
