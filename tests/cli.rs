//! The program from outside: what it prints, word for word, where, how it exits, and what it leaves in its files.

mod support;

#[path = "files/gltf/glb.rs"]
mod glb;

#[path = "cli/again.rs"]
mod again;
#[path = "cli/blur.rs"]
mod blur;
#[path = "cli/checkpoints.rs"]
mod checkpoints;
#[path = "cli/commands.rs"]
mod commands;
#[path = "cli/converge.rs"]
mod converge;
#[path = "cli/files.rs"]
mod files;
#[path = "cli/first_picture.rs"]
mod first_picture;
#[path = "cli/frames.rs"]
mod frames;
#[path = "cli/generated.rs"]
mod generated;
#[path = "cli/inputs.rs"]
mod inputs;
#[path = "cli/libraries.rs"]
mod libraries;
#[path = "cli/light.rs"]
mod light;
#[path = "cli/limits.rs"]
mod limits;
#[path = "cli/lobes.rs"]
mod lobes;
#[path = "cli/merge.rs"]
mod merge;
#[path = "cli/peers.rs"]
mod peers;
#[path = "cli/plan.rs"]
mod plan;
#[path = "cli/rejected.rs"]
mod rejected;
#[path = "cli/running.rs"]
mod running;
#[path = "cli/serve.rs"]
mod serve;
#[path = "cli/stated_limits.rs"]
mod stated_limits;
#[path = "cli/temporal.rs"]
mod temporal;
#[path = "cli/usage.rs"]
mod usage;
#[path = "cli/vectors.rs"]
mod vectors;

use caustique::film::LayerSet;
use caustique::image::exr;
use serde_json::Value;
use std::path::PathBuf;
use std::process::Command;

/// A folder of its own for each test, with a small scene in it; the program runs there.
struct Folder {
    folder: tempfile::TempDir,
}

/// Output and exit code of a run of the program.
struct Outcome {
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

impl Folder {
    fn new() -> Folder {
        let folder = tempfile::tempdir().expect("a folder can be made");
        support::glb::write(&folder.path().join("scene.glb"), true);
        Folder { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_caustique"));
        command.current_dir(&self.folder).args(arguments.split_whitespace());
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
