//! Checkpoints: a render that was killed and resumed gives the bytes of an uninterrupted render.

use crate::Folder;
use caustique::render::Method;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

const COMMON: &str = "render scene.glb --width 48 --height 32 --reproducible --no-combine --seed 5 --progress none";

fn bytes(folder: &Folder, name: &str) -> Vec<u8> {
    std::fs::read(folder.path(name)).expect("the file is there")
}

/// Kills a render `delay` after it has written its checkpoint, and waits for its end.
fn kill_after_checkpoint(folder: &Folder, arguments: &str, checkpoint: &Path, delay: Duration) {
    let mut render = folder.command(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("it starts");
    let mut checks = 0;
    while !checkpoint.exists() {
        checks += 1;
        assert!(checks < 60_000, "no checkpoint was written");
        assert!(render.try_wait().expect("its state is known").is_none(), "the render has ended");
        std::thread::sleep(Duration::from_millis(2));
    }
    std::thread::sleep(delay);
    render.kill().expect("it can be killed");
    render.wait().expect("it ends");
}

/// Every method, killed at some time and resumed, gives the same bytes. The choice of `auto` depends on the budget, so
/// its first run already has the final number of iterations.
#[test]
fn a_killed_render_resumes_to_the_same_bytes() {
    let methods = Method::ALL.iter().map(|method| method.name()).chain(["auto"]);
    for (i, method) in methods.enumerate() {
        let folder = Folder::new();
        let common = format!("{COMMON} --method {method}");
        let (first, delay) = if method == "auto" { (400, 0) } else { (1_000_000, 7 * i as u64) };
        let state = folder.path("cut.exr.checkpoint");
        let cut = format!("{common} --iterations {first} -o cut.exr --checkpoint-every 0.001");
        kill_after_checkpoint(&folder, &cut, &state, Duration::from_millis(delay));
        assert!(!folder.path("cut.exr").exists());
        // A few more iterations than the checkpoint has.
        let (head, done) = state_of(&folder, "cut.exr.checkpoint");
        assert_eq!(head["version"], env!("CARGO_PKG_VERSION"));
        let total = if method == "auto" { 400 } else { done + 7 };
        let resumed = folder.run(&format!("{common} --iterations {total} -o cut.exr --resume cut.exr.checkpoint"));
        assert_eq!(resumed.code, Some(0), "{method}: {}", resumed.stderr);
        let whole = folder.run(&format!("{common} --iterations {total} -o whole.exr"));
        assert_eq!(whole.code, Some(0), "{method}: {}", whole.stderr);
        assert!(
            bytes(&folder, "whole.exr") == bytes(&folder, "cut.exr"),
            "{method}: other bytes after a kill at {done}"
        );
        // A render that is killed while it writes leaves an incomplete `.part` file.
        let files: Vec<String> = folder.files().into_iter().filter(|name| !name.ends_with(".part")).collect();
        assert_eq!(files, ["cut.exr", "whole.exr"], "{method}: the checkpoint is removed");
    }
}

/// The head of a checkpoint, and its number of iterations.
fn state_of(folder: &Folder, name: &str) -> (serde_json::Value, u64) {
    let (head, state) = caustique::pipeline::checkpoint::read(&folder.path(name)).expect("it can be read");
    (serde_json::to_value(head).expect("it is an object"), state.iterations())
}

/// A file of --checkpoint is kept, so that a complete render can be extended.
#[test]
fn a_complete_render_can_be_extended() {
    let folder = Folder::new();
    let run = |more: &str| {
        let outcome = folder.run(&format!("{COMMON} --method cppm {more}"));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    };
    run("--iterations 12 -o whole.exr");
    run("--iterations 5 -o part.exr --checkpoint state");
    run("--iterations 12 -o part.exr --resume state --no-checkpoint");
    let [whole, part] = ["whole.exr", "part.exr"].map(|name| folder.read(name).0);
    assert!(whole.layers == part.layers);
    assert!(folder.path("state").exists());
}

#[test]
fn a_checkpoint_of_another_render_or_a_damaged_one_is_rejected() {
    let folder = Folder::new();
    let run = |more: &str| folder.run(&format!("{COMMON} --iterations 2 -o a.exr {more}"));
    assert_eq!(run("--method path --checkpoint state").code, Some(0));
    let refused = |more: &str, what: &str| {
        let outcome = run(more);
        assert!(outcome.code != Some(0) && outcome.stderr.contains(what), "{more}: {}", outcome.stderr);
        assert!(outcome.stderr.contains("hint: "), "{}", outcome.stderr);
    };
    refused("--method vcm --resume state", "another --method");
    refused("--method path --seed 6 --resume state", "another --seed");
    refused("--method path --width 50 --resume state", "another --width");
    refused("--method path --resume scene.glb", "is no checkpoint");
    refused("--method path --resume nowhere", "No such file");
    let whole = bytes(&folder, "state");
    for place in [30, whole.len() / 2, whole.len() - 3] {
        let mut damaged = whole.clone();
        damaged[place] ^= 4;
        std::fs::write(folder.path("damaged"), damaged).expect("it can be written");
        refused("--method path --resume damaged", "the checkpoint is damaged");
    }
    std::fs::write(folder.path("damaged"), &whole[..whole.len() / 3]).expect("it can be written");
    refused("--method path --resume damaged", "the checkpoint is damaged");
    std::fs::write(folder.path("damaged"), &whole[..25]).expect("it can be written");
    refused("--method path --resume damaged", "the checkpoint is damaged");
    let mut scene = bytes(&folder, "scene.glb");
    let name = scene.windows(5).position(|letters| letters == b"floor").expect("there is a floor");
    scene[name..name + 5].copy_from_slice(b"table");
    std::fs::write(folder.path("scene.glb"), scene).expect("it can be written");
    refused("--method path --resume state", "another scene");
}

/// A new render replaces the checkpoint of a stopped one only with --overwrite. A file that is not a checkpoint is
/// never replaced.
#[test]
fn the_checkpoint_of_a_stopped_render_is_not_replaced() {
    let folder = Folder::new();
    let state = folder.path("a.exr.checkpoint");
    let render = format!("{COMMON} --method path -o a.exr");
    kill_after_checkpoint(
        &folder,
        &format!("{render} --iterations 1000000 --checkpoint-every 0.001"),
        &state,
        Duration::ZERO,
    );
    let saved = bytes(&folder, "a.exr.checkpoint");
    let anew = folder.run(&format!("{render} --iterations 2"));
    let error = "a.exr.checkpoint: is the checkpoint of a render that was not finished\n\
                 hint: go on with --resume a.exr.checkpoint, or start anew with --overwrite\n";
    assert_eq!((anew.code, anew.stderr.as_str()), (Some(2), error));
    assert!(bytes(&folder, "a.exr.checkpoint") == saved && !folder.path("a.exr").exists());
    // A render without a checkpoint does not touch the file.
    assert_eq!(folder.run(&format!("{render} --iterations 2 --no-checkpoint")).code, Some(0));
    assert!(bytes(&folder, "a.exr.checkpoint") == saved);
    // --resume finds the checkpoint by another spelling of its path.
    let (_, done) = state_of(&folder, "a.exr.checkpoint");
    let resumed = folder.run(&format!("{render} --iterations {} --resume ./a.exr.checkpoint", done + 1));
    assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
    let anew = folder.run(&format!("{render} --iterations 2 --overwrite --checkpoint a.exr.checkpoint"));
    assert_eq!(anew.code, Some(0), "{}", anew.stderr);
    // The checkpoint of a complete render may be replaced.
    let again = folder.run(&format!("{render} --iterations 2 --checkpoint a.exr.checkpoint"));
    assert_eq!(again.code, Some(0), "{}", again.stderr);
    for overwrite in ["", "--overwrite"] {
        let other = folder.run(&format!("{render} --iterations 2 --checkpoint scene.glb {overwrite}"));
        let error = "scene.glb: is no checkpoint, so it is not replaced by one\n\
                     hint: name another file with --checkpoint, or move this one\n";
        assert_eq!((other.code, other.stderr.as_str()), (Some(2), error));
    }
}

/// The checkpoint is kept until the picture is written.
#[test]
fn a_picture_that_cannot_be_written_leaves_the_checkpoint() {
    let folder = Folder::new();
    let state = folder.path("a.exr.checkpoint");
    let render = format!("{COMMON} --method path -o a.exr");
    kill_after_checkpoint(
        &folder,
        &format!("{render} --iterations 1000000 --checkpoint-every 0.001"),
        &state,
        Duration::ZERO,
    );
    let (_, done) = state_of(&folder, "a.exr.checkpoint");
    let resume = format!("{render} --iterations {} --resume a.exr.checkpoint --png full.png", done + 3);
    std::os::unix::fs::symlink("/dev/full", folder.path("full.png")).expect("a link");
    let failed = folder.run(&resume);
    assert_eq!(failed.code, Some(1), "{}", failed.stderr);
    assert!(state.exists());
    std::fs::remove_file(folder.path("full.png")).expect("it can be removed");
    assert_eq!(folder.run(&resume).code, Some(0));
    assert!(!state.exists());
}

/// A checkpoint that was written before `auto` chose numbers of samples continues with one sample of each technique.
#[test]
fn candidates_without_numbers_of_samples_have_the_default_ones() {
    use caustique::render::{Candidate, Counts};
    let mut stored = serde_json::to_value(Candidate::GUIDED).expect("it is serialized");
    assert!(stored.as_object_mut().is_some_and(|candidate| candidate.remove("counts").is_some()));
    let read: Candidate = serde_json::from_value(stored).expect("it is read");
    assert_eq!((read, read.counts), (Candidate::GUIDED, Counts::DEFAULT));
}
