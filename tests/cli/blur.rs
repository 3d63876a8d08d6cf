//! Motion blur from the command line: the shutter, its warnings and errors, and equal bytes.

use crate::frames::write_animation;
use crate::{Folder, Outcome, values};
use serde_json::{Value, json};

const COMMON: &str = "render moving.gltf --width 8 --height 8 --no-combine --progress none";

/// A folder with the animated wall of `moving.gltf`, which jumps aside at frame 3, after a change of its document.
fn folder(change: impl Fn(&mut Value)) -> Folder {
    let folder = Folder::new();
    write_animation(&folder);
    let text = std::fs::read(folder.path("moving.gltf")).expect("it is there");
    let mut document = serde_json::from_slice(&text).expect("it is JSON");
    change(&mut document);
    std::fs::write(folder.path("moving.gltf"), document.to_string()).expect("it can be written");
    folder
}

fn run(folder: &Folder, arguments: &str) -> Outcome {
    let outcome = folder.run(&format!("{COMMON} {arguments}"));
    assert_eq!(outcome.code, Some(0), "{arguments}: {}", outcome.stderr);
    outcome
}

/// The mean of the picture, in which the wall has radiance 1.
fn mean(folder: &Folder, arguments: &str) -> f32 {
    run(folder, &format!("{arguments} --method path --iterations 64 --overwrite -o mean.exr"));
    let pixels = values(&folder.read("mean.exr").0, "");
    pixels.iter().flatten().sum::<f32>() / (3 * pixels.len()) as f32
}

#[test]
fn the_shutter_decides_what_share_of_the_wall_is_seen() {
    let still = folder(|_| ());
    let near = |found: f32, expected: f32| assert!((found - expected).abs() < 0.04, "{found}, {expected}");
    near(mean(&still, "--frames 3"), 0.0);
    near(mean(&still, "--frames 3 --shutter -0.25,0.25"), 0.5);
    near(mean(&still, "--frames 3 --shutter=-0.75,0.25"), 0.75);
    near(mean(&still, "--frames 2 --shutter 0,0.5"), 1.0);
    let blurred = folder(|document| document["scenes"][0]["extras"]["caustique"]["shutter"] = json!([-0.5, 0.5]));
    near(mean(&blurred, "--frames 3"), 0.5);
    near(mean(&blurred, "--frames 3 --shutter 0"), 0.0);
    // Without blur, the bytes do not depend on how it is turned off.
    run(&still, "--frames 3 --method vcm --iterations 4 --reproducible -o a.exr");
    run(&still, "--frames 3 --method vcm --iterations 4 --reproducible --shutter 0 -o b.exr");
    assert!(still.read("a.exr").0.layers == still.read("b.exr").0.layers);
}

/// Bandwidths are measured while the shutter is open, not at the frame, where lights may be dark: here in fog, whose wall
/// begins to shine at frame 3.
#[test]
fn bandwidths_are_those_of_the_open_shutter() {
    let shines =
        json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": "/materials/0/emissiveFactor"}}});
    let folder = folder(|document| {
        document["animations"][0]["channels"][0]["target"] = shines.clone();
        document["scenes"][0]["extras"]["caustique"]["medium"] = json!({"sigma_s": [0.5, 0.5, 0.5]});
    });
    let bandwidth = |arguments: &str| {
        let fixed = "--method sppm --photons 300 --iterations 2 --layers all --overwrite -o fog.exr";
        run(&folder, &format!("{arguments} {fixed}"));
        values(&folder.read("fog.exr").0, "VolumeRadius1")[0][0]
    };
    let (dark, lit) = (bandwidth("--frames 2"), bandwidth("--frames 3"));
    let open = bandwidth("--frames 2 --shutter 1.25,1.75");
    assert!((open / lit - 1.0).abs() < 0.2 && dark < 0.2 * lit, "{open}, lit {lit}, dark {dark}");
}

/// The studio has no floor below moving objects, and says so.
#[test]
fn moving_objects_have_no_studio_floor() {
    let folder = folder(|_| ());
    let render = |options: &str, out: &str| {
        let fixed = "--frames 2 --method path --iterations 2 --reproducible --orbit 20,20";
        let stderr = run(&folder, &format!("{fixed} {options} -o {out}")).stderr;
        (stderr.contains("the studio has no floor, because the scene has motion blur"), folder.read(out).0.layers)
    };
    let [bare, moving] = ["studio", "studio-floor"]
        .map(|preset| render(&format!("--light-preset {preset} --shutter 0,0.5"), &format!("{preset}.exr")));
    assert_eq!((bare.0, moving.0), (false, true));
    assert!(bare.1 == moving.1, "the picture is not that of a studio without a floor");
    let [bare, still] = ["studio", "studio-floor"]
        .map(|preset| render(&format!("--light-preset {preset} --shutter 0"), &format!("still-{preset}.exr")));
    assert_eq!((bare.0, still.0), (false, false));
    assert!(bare.1 != still.1, "a still scene has no floor");
}

/// An object that is there for half of the time covers half of its pixels.
#[test]
fn albedo_and_cryptomattes_are_averaged_over_moments() {
    let folder = folder(|_| ());
    let means = |arguments: &str| {
        run(&folder, &format!("{arguments} --method path --iterations 64 --overwrite -o layers.exr"));
        let set = folder.read("layers.exr").0;
        let albedo = values(&set, "albedo");
        let objects = set.get("CryptoObject00").expect("a cryptomatte");
        let coverage = objects.plane("g").or(objects.plane("G")).expect("the coverage of the first object");
        let albedo = albedo.iter().flatten().sum::<f32>() / (3 * albedo.len()) as f32;
        [albedo, coverage.values.iter().sum::<f32>() / coverage.values.len() as f32]
    };
    let whole = means("--frames 2");
    let half = means("--frames 3 --shutter -0.25,0.25");
    for (half, whole) in half.into_iter().zip(whole) {
        assert!(whole > 0.5 && (half / whole - 0.5).abs() < 0.05, "{half} and {whole}");
    }
}

#[test]
fn too_few_moments_are_warned_of() {
    let folder = folder(|_| ());
    let warning = "motion blur is the mean of 8 moments, one per iteration, which show as copies of what moves \
                   (ask for --iterations 32 or more, or more --time)";
    let few = run(&folder, "--frames 3 --shutter -0.25,0.25 --method path --iterations 8 -o few.exr");
    assert!(few.stderr.contains(warning), "{}", few.stderr);
    let header = folder.read("few.exr").1;
    assert!(header["plan"]["warnings"].to_string().contains("motion blur is the mean of 8 moments"), "{header}");
    for enough in ["--shutter -0.25,0.25 --iterations 32", "--shutter 0 --iterations 8", "--iterations 8"] {
        let outcome = run(&folder, &format!("--frames 3 --method path {enough} --overwrite -o enough.exr"));
        assert!(!outcome.stderr.contains("motion blur"), "{enough}: {}", outcome.stderr);
    }
}

#[test]
fn invalid_shutters_and_vanishing_objects_are_errors() {
    let folder = folder(|document| {
        let add = |document: &mut Value, list: &str, item: Value| {
            let list = document[list].as_array_mut().expect("a list");
            list.push(item);
            list.len() - 1
        };
        // The numbers 1 and 0: the wall is visible until frame 3.
        let data = "data:application/octet-stream;base64,AACAPwAAAAA=";
        let buffer = add(document, "buffers", json!({"uri": data, "byteLength": 8}));
        let view = add(document, "bufferViews", json!({"buffer": buffer, "byteLength": 8}));
        let shown = json!({"bufferView": view, "componentType": 5126, "type": "SCALAR", "count": 2});
        document["animations"][0]["samplers"][0]["output"] = add(document, "accessors", shown).into();
        document["animations"][0]["channels"][0]["target"] = json!({"path": "pointer",
            "extensions": {"KHR_animation_pointer": {"pointer": "/nodes/0/extensions/KHR_node_visibility/visible"}}});
        document["nodes"][0]["extensions"] = json!({"KHR_node_visibility": {"visible": true}});
    });
    let refused = |arguments: &str, expected: &str| {
        let outcome = folder.run(&format!("{COMMON} --method path --iterations 2 -o no.exr {arguments}"));
        assert!(outcome.code != Some(0) && outcome.stderr.contains(expected), "{arguments}: {}", outcome.stderr);
    };
    refused("--shutter 0.5,-0.5", "the shutter must not close before it opens");
    refused("--shutter open", "it must be two numbers OPEN,CLOSE, such as -0.25,0.25, or 0 for no motion blur");
    refused("--shutter nan,1", "it must be two numbers OPEN,CLOSE");
    for frame in [2, 3] {
        let vanishes = "moving.gltf: object \"wall\" is there only for a part of the time for which the shutter is open\n\
                        hint: let it appear between two frames' shutters, or render without blur: --shutter 0";
        refused(&format!("--frames {frame} --shutter -1.5,1.5"), vanishes);
    }
}

/// Every method, in shards, with other numbers of threads, or resumed: the moment of an iteration follows from its number.
#[test]
fn blurred_renders_have_equal_bits() {
    let folder = folder(|document| document["animations"][0]["samplers"][0]["interpolation"] = "LINEAR".into());
    for method in ["path", "bdpt", "vcm", "sppm --photons 500", "pm --photons 500"] {
        let common = format!("--frames 1 --shutter 0,0.1 --method {method} --seed 3 --overwrite");
        run(&folder, &format!("{common} --iterations 9 --threads 1 -o one.exr"));
        let whole = folder.read("one.exr").0;
        run(&folder, &format!("{common} --iterations 9 --threads 2 -o two.exr"));
        assert!(whole.layers == folder.read("two.exr").0.layers, "{method}: threads");
        for shard in 0..3 {
            run(&folder, &format!("{common} --iterations 9 --shard {shard}/3 -o shard{shard}.exr"));
        }
        let merged = folder.run("merge shard2.exr shard0.exr shard1.exr -o merged.exr");
        assert_eq!(merged.code, Some(0), "{method}: {}", merged.stderr);
        assert!(whole.layers == folder.read("merged.exr").0.layers, "{method}: shards");
        run(&folder, &format!("{common} --iterations 4 -o part.exr --checkpoint state"));
        run(&folder, &format!("{common} --iterations 9 -o part.exr --resume state --no-checkpoint"));
        assert!(whole.layers == folder.read("part.exr").0.layers, "{method}: resumed");
        let other = folder.run(&format!(
            "{COMMON} --frames 1 --shutter 0,0.2 --method {method} --seed 3 --iterations 9 -o part.exr --resume state"
        ));
        assert!(other.stderr.contains("was rendered with another --shutter"), "{method}: {}", other.stderr);
    }
}
