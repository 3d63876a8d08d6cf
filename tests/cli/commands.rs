//! Combining, comparing, and what files hold.

use crate::{Folder, support, values};

#[test]
fn combining_later_is_combining_at_once() {
    let folder = Folder::new();
    folder.render("-o at_once.exr --iterations 3");
    folder.render("-o levels.exr --iterations 3 --no-combine");
    let outcome = folder.run("combine levels.exr -o later.exr --png later.png");
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let ((at_once, _), (levels, _), (later, header)) =
        (folder.read("at_once.exr"), folder.read("levels.exr"), folder.read("later.exr"));
    assert!(values(&at_once, "") == values(&later, ""));
    assert!(values(&levels, "") != values(&later, ""));
    assert_eq!(levels.layers.len(), later.layers.len());
    assert_eq!((&header["combined"]["model"], &header["iterations"]), (&"compact".into(), &3.into()));
    folder.render("-o blender.exr --iterations 3 --no-combine --exr-naming blender");
    assert_eq!(folder.run("combine blender.exr -o combined.exr").code, Some(0));
    assert!(values(&folder.read("combined.exr").0, "ViewLayer.Combined") == values(&later, ""));
    folder.render("-o beauty.exr --iterations 2 --layers beauty");
    let outcome = folder.run("combine beauty.exr -o no.exr");
    let error = "beauty.exr: the file has no bandwidth levels (Level1, Level2, ...)\nhint: render with --layers all\n";
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(1), error));
}

#[test]
fn comparisons() {
    let folder = Folder::new();
    folder.render("-o a.exr --iterations 2 --no-combine");
    folder.render("-o b.exr --iterations 2 --no-combine --seed 1");
    let json = folder.run("compare a.exr a.exr --json").json();
    assert_eq!((json["relmse"].as_f64(), json["mean_ratio"].as_f64()), (Some(0.0), Some(1.0)));
    let outcome = folder.run("compare a.exr b.exr --json --png heat.png");
    let json = outcome.json();
    for key in ["relmse", "relmse_trimmed", "mse", "mean_ratio", "flip", "grain"] {
        assert!(json[key].as_f64().is_some_and(|x| x > 0.0), "{key} in {json}");
    }
    assert_eq!(json["pixels_not_finite"], 0);
    assert!(folder.path("heat.png").exists());
    assert!(folder.run("compare a.exr b.exr --layer Level1").stdout.starts_with("relMSE "));
    let outcome = folder.run("compare a.exr b.exr --layer Nope");
    let error = "a.exr: there is no layer \"Nope\"\nhint: it has R G B A, ";
    assert!(outcome.code == Some(2) && outcome.stderr.starts_with(error), "{}", outcome.stderr);
    let outcome = folder.run("compare a.exr nope.exr");
    assert_eq!(outcome.code, Some(1));
    assert!(outcome.stderr.starts_with("nope.exr: "), "{}", outcome.stderr);
}

#[test]
fn what_a_scene_holds() {
    let folder = Folder::new();
    let json = folder.run("info scene.glb --json").json();
    assert_eq!((&json["meshes"], &json["triangles"]), (&2.into(), &4.into()));
    assert_eq!(json["cameras"], serde_json::json!(["Camera", "Side"]));
    assert_eq!(json["materials"], serde_json::json!(["stone", "silver"]));
    assert_eq!((&json["lights"]["point"], &json["warnings"]), (&1.into(), &serde_json::json!([])));
    let text = folder.run("info scene.glb").stdout;
    assert!(text.contains("  cameras    2: Camera, Side\n"), "{text}");
    let outcome = folder.run("info nope");
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(1), "nope: No such file or directory (os error 2)\n"));
}

/// Warnings are lines of their own; `--strict` makes an error of them before rendering.
#[test]
fn warnings_and_strict() {
    let folder = Folder::new();
    support::glb::write(&folder.path("dark.glb"), false);
    let render = "render dark.glb -o out.exr --width 32 --iterations 1 --photons 100 --no-combine --progress none";
    let warning = "warning: dark.glb: the scene has no light: the picture will be black (add --env, a lamp or an emissive material; Blender's own exporter leaves out area lights and the world)\n";
    let outcome = folder.run(render);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), warning));
    assert_eq!(folder.read("out.exr").1["warnings"].as_array().map(Vec::len), Some(1));
    std::fs::remove_file(folder.path("out.exr")).expect("it was there");
    let outcome = folder.run(&format!("{render} --strict"));
    let error = "dark.glb: 1 thing is ignored or approximated, and --strict forbids it\n\
                 hint: mend what the warnings above name, or leave --strict out\n";
    assert_eq!((outcome.code, outcome.stderr), (Some(1), format!("{warning}{error}")));
    assert!(!folder.path("out.exr").exists());
    // An environment is light, and a background that can be seen.
    assert_eq!(folder.run(&format!("{render} --env 1,1,1 --strict")).code, Some(0));
    let (set, _) = folder.read("out.exr");
    let alpha = &set.get("").and_then(|beauty| beauty.plane("A")).expect("alpha").values;
    assert!(alpha.iter().all(|a| *a == 1.0));
}
