//! No file that a run reads is overwritten or removed.

use crate::Folder;
use std::os::unix::fs::symlink;

const SMALL: &str = "--width 16 --height 12 --iterations 1 --photons 100 --no-finish --progress none";

/// Outputs that are inputs, by whatever name, are refused by every command, and all files stay as they are.
#[test]
fn no_output_is_an_input() {
    let folder = Folder::new();
    let path = |name: &str| folder.path(name);
    for name in ["a.1.exr", "a.2.exr"] {
        assert_eq!(folder.run(&format!("render scene.glb -o {name} {SMALL}")).code, Some(0));
    }
    let copy = |name: &str| assert!(std::fs::copy(path("a.1.exr"), path(name)).is_ok());
    let copies = ["b.png", "b.html", "points.csv", "reference.exr", "c.1.exr.claim", ".caustique-c.exr-abcdef.part"];
    copies.into_iter().for_each(copy);
    std::fs::hard_link(path("a.1.exr"), path("hard.exr")).expect("a link");
    symlink("a.1.exr", path("soft.exr")).expect("a link");
    symlink(".", path("here")).expect("a link");
    let before = contents(&folder);
    let converge = "converge scene.glb --methods path --iterations 1 --width 16 --progress none --no-finish";
    let render = format!("render scene.glb {SMALL}");
    for (command, output, input) in [
        ("finish a.1.exr -o a.1.exr".into(), "a.1.exr", "a.1.exr"),
        ("finish a.1.exr -o hard.exr".into(), "hard.exr", "a.1.exr"),
        ("finish soft.exr -o here/a.1.exr".into(), "here/a.1.exr", "soft.exr"),
        ("finish a.#.exr -o here/a.%d.exr".into(), "here/a.1.exr", "a.1.exr"),
        ("finish b.png -o c.exr --png b.png".into(), "b.png", "b.png"),
        ("merge a.1.exr a.2.exr -o soft.exr".into(), "soft.exr", "a.1.exr"),
        ("merge b.png a.2.exr -o c.exr --png here/b.png".into(), "here/b.png", "b.png"),
        ("compare a.1.exr b.png --png b.png".into(), "b.png", "b.png"),
        ("compare b.html a.1.exr --page here/b.html".into(), "here/b.html", "b.html"),
        (format!("{render} --env a.1.exr -o hard.exr"), "hard.exr", "a.1.exr"),
        (format!("{render} --env b.png -o c.exr --preview b.png"), "b.png", "b.png"),
        (format!("{render} --env a.1.exr -o a.#.exr --frames 1-2"), "a.1.exr", "a.1.exr"),
        (format!("{render} --env .caustique-c.exr-abcdef.part -o c.exr"), "c.exr", ".caustique-c.exr-abcdef.part"),
        (format!("{converge} -o . --env points.csv"), "./points.csv", "points.csv"),
        (format!("{converge} -o here --env reference.exr"), "here/reference.exr", "reference.exr"),
    ] {
        let outcome = folder.run(&command);
        let error = format!("{output}: {input} is an input, which is not overwritten\nhint: name another output\n");
        assert!(outcome.code == Some(2) && outcome.stderr.ends_with(&error), "{command}: {}", outcome.stderr);
        assert!(contents(&folder) == before, "{command}: {:?}", folder.files());
    }
    let claimed = folder.run(&format!("{render} --env c.1.exr.claim -o c.#.exr --frames 1 --skip-existing"));
    assert!(claimed.stderr.ends_with("c.1.exr.claim is no claim of a frame\n"), "{}", claimed.stderr);
    assert!(claimed.code == Some(1) && contents(&folder) == before);
    for (command, one, other) in [
        (format!("{render} -o c.exr --checkpoint here/c.exr"), "here/c.exr", "c.exr"),
        (format!("{render} -o c.exr --preview here/c.exr"), "here/c.exr", "c.exr"),
    ] {
        let outcome = folder.run(&command);
        let error = format!("{one}: is the same file as the output {other}\n");
        assert!(outcome.code == Some(2) && outcome.stderr.starts_with(&error), "{}", outcome.stderr);
    }
}

/// A render leaves a file alone that has the name of what used to be its temporary file, and leaves none of its own.
#[test]
fn temporary_files_have_names_of_their_own() {
    let folder = Folder::new();
    folder.render("-o room.estimate.exr --iterations 1");
    let sky = std::fs::read(folder.path("room.estimate.exr")).expect("it is there");
    crate::support::glb::write_under(&folder.path("under.glb"), "room.estimate.exr");
    let outcome = folder.run("render under.glb -o room.exr --width 64 --height 48 --iterations 20 --method path");
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    assert!(std::fs::read(folder.path("room.estimate.exr")).expect("it is there") == sky);
    assert_eq!(folder.files(), ["room.estimate.exr", "room.exr", "under.glb"]);
}

/// Names and bytes of the folder's files.
fn contents(folder: &Folder) -> Vec<(String, Vec<u8>)> {
    let read = |name: String| std::fs::read(folder.path(&name)).ok().map(|bytes| (name, bytes));
    folder.files().into_iter().filter_map(read).collect()
}
