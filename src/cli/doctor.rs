//! `caustique doctor`: finds the libraries that the program loads, and the programs that read USD and Blender files.

use super::{print, print_json};
use caustique::combine::Runtime;
use caustique::error::{Error, ErrorKind, Result};
use caustique::finish::denoiser;
use caustique::scene::blend::Blender;
use caustique::scene::usd::Interpreter;
use caustique::trace;
use serde_json::{Value, json};
use std::path::Path;

/// Show which Embree, ONNX Runtime, Open Image Denoise, USD and Blender are found, their files and versions, and how to install
/// missing ones
#[derive(clap::Args)]
pub struct DoctorArgs {
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// The commit that the program was built from, if the build says so, as `scripts/package.sh` does.
const COMMIT: Option<&str> = option_env!("CAUSTIQUE_COMMIT");

/// Version and commit of the program, and versions and files of the libraries that it loads, for `--version`.
pub fn version() -> String {
    let commit = COMMIT.map(|commit| format!(" (commit {commit})")).unwrap_or_default();
    let line = |finding: Finding| match finding.found {
        Ok(Found(version, path, _)) => format!("{} {version}, {path}\n", finding.name),
        Err(_) => format!("{} not found\n", finding.name),
    };
    let libraries: String = [embree(), onnxruntime(), oidn()].into_iter().map(line).collect();
    format!("caustique {}{commit}\n{libraries}", env!("CARGO_PKG_VERSION"))
}

/// The result of the search for a library that the program loads.
struct Finding {
    name: &'static str,
    key: &'static str,
    needed_for: &'static str,
    /// Whether renders of glTF scenes work without the library.
    optional: bool,
    found: std::result::Result<Found, (String, Option<String>)>,
}

/// A library that was found: its version, its file, and the origin of the file.
struct Found(String, String, &'static str);

/// Prints the libraries that were found and those that are missing. Returns an error if a required one is missing.
pub fn run(args: &DoctorArgs) -> Result<()> {
    let findings = [embree(), onnxruntime(), oidn(), usd(), blender()];
    if args.json {
        let mut object = serde_json::Map::new();
        object.insert("version".into(), env!("CARGO_PKG_VERSION").into());
        object.insert("commit".into(), COMMIT.into());
        for finding in &findings {
            object.insert(finding.key.into(), finding.json());
        }
        print_json(&Value::Object(object))?;
    } else {
        let lines: String = findings.iter().map(Finding::text).collect();
        print(&format!("caustique {}\n{lines}", env!("CARGO_PKG_VERSION")))?;
    }
    let missing: Vec<&Finding> = findings.iter().filter(|f| f.found.is_err() && !f.optional).collect();
    match missing.first() {
        None => Ok(()),
        Some(first) => {
            let names: Vec<&str> = missing.iter().map(|f| f.name).collect();
            let mut error = Error::new(ErrorKind::Library, "doctor", format!("cannot use {}", names.join(" and ")));
            error.hint = first.found.as_ref().err().and_then(|(_, hint)| hint.clone());
            Err(error)
        }
    }
}

fn embree() -> Finding {
    let found = match trace::library() {
        Ok(library) => Ok(Found(library.version().to_string(), show(library.path()), trace::origin(&library))),
        Err(error) => Err((error.to_string(), error.hint())),
    };
    Finding { name: "Embree", key: "embree", needed_for: "render", optional: false, found }
}

fn onnxruntime() -> Finding {
    let found = match Runtime::find() {
        Ok(runtime) => {
            let version = runtime.version().unwrap_or("1.17 or later").to_string();
            Ok(Found(version, show(runtime.path()), runtime.origin()))
        }
        Err(error) => Err((error.to_string(), error.hint)),
    };
    Finding { name: "ONNX Runtime", key: "onnxruntime", needed_for: "combine", optional: true, found }
}

fn oidn() -> Finding {
    let found = match denoiser::library() {
        Ok(library) => Ok(Found(library.version().to_string(), show(library.path()), denoiser::origin(&library))),
        Err(error) => Err((error.to_string(), error.hint())),
    };
    Finding { name: "Open Image Denoise", key: "oidn", needed_for: "denoise", optional: true, found }
}

fn usd() -> Finding {
    let found =
        Interpreter::find().and_then(|python| Ok(Found(python.version()?, show(python.path()), python.origin())));
    let found = found.map_err(|error| (error.to_string(), error.hint));
    Finding { name: "USD", key: "usd", needed_for: "read .usd files", optional: true, found }
}

fn blender() -> Finding {
    let found = Blender::find().and_then(|it| Ok(Found(it.version()?, show(it.path()), it.origin())));
    let found = found.map_err(|error| (error.to_string(), error.hint));
    Finding { name: "Blender", key: "blender", needed_for: "read .blend files", optional: true, found }
}

fn show(path: &Path) -> String {
    path.display().to_string()
}

impl Finding {
    fn json(&self) -> Value {
        match &self.found {
            Ok(Found(version, path, origin)) => {
                json!({"found": true, "version": version, "path": path, "from": origin})
            }
            Err((cause, hint)) => json!({"found": false, "cause": cause, "hint": hint}),
        }
    }

    fn text(&self) -> String {
        match &self.found {
            Ok(Found(version, path, origin)) => format!("{:<18} {version:<14} {path} (from {origin})\n", self.name),
            Err((cause, hint)) => {
                let hint = hint.as_ref().map(|h| format!("{:<18} {h}\n", "")).unwrap_or_default();
                format!("{:<18} not usable, needed to {}: {cause}\n{hint}", self.name, self.needed_for)
            }
        }
    }
}
