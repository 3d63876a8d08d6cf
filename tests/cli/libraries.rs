//! Origins of libraries and Python interpreters: never the current folder, which may have untrusted files.

use crate::{Folder, Outcome};
use std::path::Path;
use std::process::Command;

/// C source of a library that writes a file when it is loaded.
const LIBRARY: &str = r#"
#include <stdio.h>
__attribute__((constructor)) static void run(void) { FILE *file = fopen("ran-library", "w"); if (file) fclose(file); }
"#;

/// Fills a folder with libraries and programs that write a file `ran-...` if the program loads or runs them.
fn write_traps(folder: &Folder) {
    let write = |name: &str, text: &str| {
        let path = folder.path(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("it can be made");
        std::fs::write(path, text).expect("it can be written");
    };
    write("library.c", LIBRARY);
    for name in [".deps/oidn/libOpenImageDenoise.so.9", ".deps/onnxruntime/libonnxruntime.so.9"] {
        write(name, "");
        let mut compiler = Command::new("cc");
        let made = compiler.args(["-shared", "-fPIC", "-o", name, "library.c"]).current_dir(&folder.folder).status();
        assert!(made.expect("cc runs, as it links this test").success());
    }
    for name in [".venv-usd/bin/python", ".venv-peers/bin/python", ".venv-bpy/bin/python"] {
        write(name, "#!/bin/sh\ntouch ran-python\nexit 1\n");
        assert!(Command::new("chmod").arg("+x").arg(folder.path(name)).status().expect("chmod runs").success());
    }
    for module in ["numpy", "pxr", "OpenEXR", "PIL", "mapbox_earcut", "json", "types", "argparse", "importlib"] {
        write(&format!("{module}.py"), "open('ran-module', 'w')\n");
    }
}

/// Files that traps of [`write_traps`] have written.
fn triggered(folder: &Folder) -> Vec<String> {
    folder.files().into_iter().filter(|name| name.starts_with("ran-")).collect()
}

#[test]
fn nothing_in_the_current_folder_is_run_or_loaded() {
    let folder = Folder::new();
    write_traps(&folder);
    std::fs::write(folder.path("stage.usda"), "#usda 1.0\n").expect("it can be written");
    let render = "render scene.glb -o out.exr --width 8 --height 8 --iterations 4 --progress none --denoise oidn";
    let converge = "converge scene.glb --width 8 --height 8 --methods path --iterations 4 --no-finish --progress none";
    for arguments in [
        "doctor",
        "info stage.usda",
        &format!("{render} --model compact"),
        &format!("{converge} --with luxcore,cycles -o compared"),
    ] {
        let mut command = folder.command(arguments);
        command.env_remove("CAUSTIQUE_HOME");
        let outcome = Outcome::of(command);
        assert_eq!(triggered(&folder), [""; 0], "{arguments}: {}", outcome.stderr);
    }
    // The traps work when they are named explicitly.
    let mut command = folder.command("doctor");
    command.env("CAUSTIQUE_OIDN", folder.path(".deps/oidn/libOpenImageDenoise.so.9"));
    command.env("CAUSTIQUE_USD_PYTHON", folder.path(".venv-usd/bin/python"));
    Outcome::of(command);
    assert_eq!(triggered(&folder), ["ran-library", "ran-python"]);
}

#[test]
fn caustique_home_is_searched_and_doctor_prints_the_origin_of_libraries() {
    let folder = Folder::new();
    let found = folder.run("doctor --json").json();
    let path = found["oidn"]["path"].as_str().expect("Open Image Denoise is found");
    let run = |variable: &str, value: &Path| {
        let mut command = folder.command("doctor --json");
        command.env(variable, value);
        Outcome::of(command).json()["oidn"].clone()
    };
    let named = run("CAUSTIQUE_OIDN", Path::new(path));
    assert_eq!((named["path"].as_str(), named["from"].as_str()), (Some(path), Some("CAUSTIQUE_OIDN")));
    if found["oidn"]["from"] == "system" {
        return;
    }
    assert_eq!(found["oidn"]["from"], "scripts/setup.sh");
    assert!(folder.run("doctor").stdout.contains(&format!("{path} (from scripts/setup.sh)\n")));
    assert_eq!(run("CAUSTIQUE_HOME", &folder.path("empty"))["found"], false);
    let lib = Path::new(path).parent().expect("a folder");
    std::fs::create_dir_all(folder.path("home/.deps")).expect("it can be made");
    std::os::unix::fs::symlink(lib, folder.path("home/.deps/oidn")).expect("a link can be made");
    let home = run("CAUSTIQUE_HOME", &folder.path("home"));
    assert_eq!((home["path"].as_str(), home["from"].as_str()), (Some(path), Some("scripts/setup.sh")));
}

/// A program in `bin` of a package takes the libraries in `lib/caustique` before others, wherever the package is moved.
#[test]
fn a_package_finds_its_own_libraries_first() {
    let folder = Folder::new();
    let found = folder.run("doctor --json").json();
    let path = found["oidn"]["path"].as_str().expect("Open Image Denoise is found");
    for place in ["package", "moved"] {
        // Open Image Denoise finds its modules in `../lib` of its folder.
        let (bin, lib) = (folder.path(place).join("bin"), folder.path(place).join("lib/caustique/lib"));
        std::fs::create_dir_all(&bin).expect("it can be made");
        std::fs::create_dir_all(&lib).expect("it can be made");
        let original = folder.command("doctor").get_program().to_owned();
        // A child process copies it, because a file that a fork of another test holds open for writing cannot run.
        let copied = Command::new("cp").arg(original).arg(bin.join("caustique")).status();
        assert!(copied.expect("cp runs").success());
        for entry in Path::new(path).parent().expect("a folder").read_dir().expect("it can be read").flatten() {
            let name = entry.file_name();
            let wanted = ["libOpenImageDenoise", "libtbb"].iter().any(|stem| name.to_string_lossy().starts_with(stem));
            if wanted && entry.path().is_file() && !entry.path().is_symlink() {
                std::fs::copy(entry.path(), lib.join(name)).expect("it can be copied");
            }
        }
        let mut command = Command::new(bin.join("caustique"));
        command.args(["doctor", "--json"]).env_remove("CAUSTIQUE_OIDN");
        let oidn = Outcome::of(command).json()["oidn"].clone();
        assert_eq!(oidn["from"], "package", "{oidn}");
        let own = oidn["path"].as_str().expect("it is found");
        assert!(Path::new(own).starts_with(lib.canonicalize().expect("it exists")), "{own}");
    }
}
