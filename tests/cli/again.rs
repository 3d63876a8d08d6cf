//! Stored renders that are finished or merged again: what their files hold stays right.

use crate::{Folder, Outcome, values};
use caustique::film::LayerSet;
use caustique::image::exr;
use std::path::Path;

const COMMON: &str = "render scene.glb --width 40 --height 24 --progress none";

fn done(outcome: &Outcome) {
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
}

fn mean(set: &LayerSet, layer: &str) -> f64 {
    let values = values(set, layer);
    values.iter().map(|value| f64::from(value[0] + value[1] + value[2])).sum::<f64>() / values.len() as f64
}

/// A file may have some of the parts of its picture. The light of the others is not theirs.
#[test]
fn parts_keep_their_light_where_others_are_missing() {
    let folder = Folder::new();
    for denoise in ["own", "none"] {
        for parts in ["Direct", "Emission,Indirect", "Caustic"] {
            let layers = format!("beauty,Noisy,Variance,{parts}");
            done(
                &folder
                    .run(&format!("{COMMON} --method bdpt --iterations 4 --no-finish --layers {layers} -o some.exr")),
            );
            done(&folder.run(&format!("finish some.exr -o finished.exr --denoise {denoise}")));
            let (set, _) = folder.read("finished.exr");
            let all = mean(&set, "Noisy");
            for part in parts.split(',') {
                let (before, after) = (mean(&set, part), mean(&set, &format!("Combined{part}")));
                assert!(
                    (after - before).abs() < 0.2 * before + 0.01 * all,
                    "{denoise}, {part}: {before}, {after} of {all}"
                );
            }
        }
    }
}

/// The order of merged renders does not matter, and their file is finished to the picture that merging makes. A quarter of
/// the iterations that one render lacks is that of the others.
#[test]
fn merged_seeds_are_finished_like_their_file() {
    let folder = Folder::new();
    for (seed, iterations) in [(1, 9), (2, 2)] {
        let options = format!("--method path --layers all,Quarter --iterations {iterations} --seed {seed}");
        done(&folder.run(&format!("{COMMON} {options} -o {seed}.exr")));
    }
    for (inputs, output) in [("1.exr 2.exr", "a.exr"), ("2.exr 1.exr", "b.exr")] {
        done(&folder.run(&format!("merge {inputs} -o {output} --denoise own")));
    }
    done(&folder.run("finish a.exr -o later.exr --denoise own"));
    let [a, b, later, first, second] =
        ["a.exr", "b.exr", "later.exr", "1.exr", "2.exr"].map(|name| folder.read(name).0);
    assert!(values(&a, "") == values(&later, ""));
    for ((a, b), whole) in values(&a, "").iter().zip(values(&b, "")).zip(values(&a, "Noisy")) {
        assert!((0..3).all(|c| (a[c] - b[c]).abs() <= 1e-4 * (whole[c].abs() + 0.01)), "{a:?} {b:?}");
    }
    // Of nine iterations the first quarter has three and the others two; of two, the first two have one each.
    for (layer, shares) in [("Quarter1", [3.0, 1.0]), ("Quarter2", [2.0, 1.0]), ("Quarter4", [2.0, 0.0])] {
        let weighted: f64 =
            [&first, &second].into_iter().zip(shares).map(|(set, share)| mean(set, layer) * share).sum();
        let expected = weighted / shares.iter().sum::<f64>();
        assert!((mean(&a, layer) / expected - 1.0).abs() < 1e-4, "{layer}");
    }
}

/// A merged file brings the seeds of its renders with it.
#[test]
fn no_seed_is_merged_twice() {
    let folder = Folder::new();
    for seed in [1, 2, 3] {
        done(&folder.run(&format!("{COMMON} --method path --iterations 2 --seed {seed} -o {seed}.exr")));
    }
    done(&folder.run("merge 1.exr 2.exr -o both.exr"));
    for (inputs, second, first) in [("both.exr 2.exr", "2.exr", "both.exr"), ("2.exr both.exr", "both.exr", "2.exr")] {
        let refused = folder.run(&format!("merge {inputs} -o merged.exr"));
        let error = format!("{second}: has the seed 2 as {first} has: the same noise twice\n");
        assert_eq!(refused.code, Some(2), "{}", refused.stderr);
        assert!(refused.stderr.starts_with(&error), "{}", refused.stderr);
    }
    for inputs in ["both.exr 3.exr", "3.exr both.exr"] {
        done(&folder.run(&format!("merge {inputs} -o merged.exr")));
        let (_, header) = folder.read("merged.exr");
        let seeds = header["merged"]["seeds"].as_array().expect("a list of seeds");
        assert!((1..=3).all(|seed: u64| seeds.contains(&seed.into())) && seeds.len() == 3, "{seeds:?}");
        assert_eq!(header["iterations"], 6);
    }
}

/// A checkpoint with more iterations than are asked for is not ended early, and stays.
#[test]
fn a_checkpoint_is_not_ended_by_fewer_iterations() {
    let folder = Folder::new();
    done(&folder.run(&format!("{COMMON} --method path --iterations 6 -o a.exr --checkpoint state")));
    let refused = folder.run(&format!("{COMMON} --method path --iterations 4 -o b.exr --resume state"));
    let error = "state: has 6 iterations already, and --iterations asks for 4\n\
                 hint: ask for more, or start anew without --resume\n";
    assert_eq!((refused.code, refused.stderr.as_str()), (Some(2), error));
    assert!(folder.path("state").exists() && !folder.path("b.exr").exists());
}

#[test]
fn renders_of_two_scenes_are_not_merged() {
    let folder = Folder::new();
    let other = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/torus.glb");
    std::fs::copy(other, folder.path("torus.glb")).expect("it can be copied");
    for (seed, scene) in [(1, "scene"), (2, "torus")] {
        let render = COMMON.replace("scene.glb", &format!("{scene}.glb"));
        done(&folder.run(&format!("{render} --method path --iterations 2 --seed {seed} -o {scene}.exr")));
    }
    let refused = folder.run("merge scene.exr torus.exr -o merged.exr");
    let error = "torus.exr: was rendered from other scene files than scene.exr\nhint: merge renders of one scene\n";
    assert_eq!((refused.code, refused.stderr.as_str()), (Some(2), error));
}

/// The error in the header is that of the picture in the file, and the error of the estimate stays what it was.
#[test]
fn a_finish_states_no_error_of_another_one() {
    let folder = Folder::new();
    let render = format!("{COMMON} --method path --iterations 8");
    done(&folder.run(&format!("{render} --layers all,Quarter -o with.exr")));
    done(&folder.run(&format!("{render} --layers all -o without.exr")));
    for name in ["with", "without"] {
        done(&folder.run(&format!("finish {name}.exr -o {name}.again.exr --denoise none")));
    }
    let [(_, before), (with, again), (without, unknown)] =
        ["with.exr", "with.again.exr", "without.again.exr"].map(|name| folder.read(name));
    assert_eq!(again["error_noisy"], before["error_noisy"]);
    assert!(again["error"] != before["error"] && again["error_of"] == before["error_of"]);
    assert!(with.get("Error").is_some() && without.get("Error").is_none());
    assert_eq!((&unknown["error"], &unknown["error_of"]), (&before["error_noisy"], &"Noisy".into()));
    assert!(unknown.get("accuracy").is_none() && unknown.get("error_noisy").is_none());
}

/// A render that is finished or merged again keeps its camera, its frame number, and its place in a larger picture.
#[test]
fn the_frame_of_a_picture_stays() {
    let folder = Folder::new();
    for naming in ["plain", "blender"] {
        let render = format!("{COMMON} --method path --iterations 2 --crop 10,5,20,12 --exr-naming {naming}");
        for seed in [1, 2] {
            done(&folder.run(&format!("{render} --seed {seed} -o {seed}.exr")));
        }
        done(&folder.run("finish 1.exr -o finished.exr"));
        done(&folder.run("merge 1.exr 2.exr -o merged.exr"));
        let read = |name: &str| exr::read_window(&folder.path(name)).expect("it can be read");
        let (window, attributes) = read("1.exr");
        assert!(window.corner == [10, 5] && attributes.frame.is_some(), "{naming}");
        for name in ["finished.exr", "merged.exr"] {
            let (again, same) = read(name);
            assert_eq!((again.corner, again.set.width, again.set.height), ([10, 5], 20, 12), "{naming}, {name}");
            assert_eq!((same.frame, same.moment), (attributes.frame, attributes.moment), "{naming}, {name}");
        }
    }
}

/// Other programs write text that is not ASCII, such as the folder of a scene, which Python's OpenEXR refuses.
#[test]
fn text_that_is_not_ascii_is_left_out() {
    let folder = Folder::new();
    done(&folder.run(&format!("{COMMON} --method path --iterations 2 -o own.exr")));
    let (set, mut attributes) = exr::read(&folder.path("own.exr")).expect("it can be read");
    attributes.texts.insert("File".into(), "/home/j##rg".into());
    attributes.texts.insert("names".into(), "{\"k##rper\": 1}".into());
    exr::write(&folder.path("other.exr"), &set, &attributes, exr::Options::default()).expect("it can be written");
    let bytes = std::fs::read(folder.path("other.exr")).expect("it is there");
    let changed = replaced(&bytes, b"##rg", "örg".as_bytes());
    let changed = replaced(&changed, b"k##r", "kör".as_bytes());
    std::fs::write(folder.path("other.exr"), changed).expect("it can be written");
    let outcome = folder.run("finish other.exr -o finished.exr");
    done(&outcome);
    let warning = "warning: other.exr: attribute \"File\" is not ASCII and is left out\n";
    assert!(outcome.stderr.contains(warning), "{}", outcome.stderr);
    let (_, attributes) = exr::read(&folder.path("finished.exr")).expect("it can be read");
    assert!(!attributes.texts.contains_key("File"));
    assert_eq!(attributes.texts["names"], "{\"k\\u00f6rper\": 1}");
}

/// Pixels outside of the display window are not finished, and the user learns that.
#[test]
fn overscan_is_left_out_with_a_warning() {
    let folder = Folder::new();
    done(&folder.run(&format!("{COMMON} --method path --iterations 2 --no-finish --crop 10,5,20,12 -o own.exr")));
    let bytes = std::fs::read(folder.path("own.exr")).expect("it is there");
    // The display window, from (0, 0) to (39, 23), ends within the data window.
    let window = |x: i32, y: i32| [0, 0, x, y].map(i32::to_le_bytes).concat();
    std::fs::write(folder.path("other.exr"), replaced(&bytes, &window(39, 23), &window(24, 23)))
        .expect("it can be written");
    for name in ["own", "other"] {
        let outcome = folder.run(&format!("finish {name}.exr -o {name}.out.exr --denoise own"));
        done(&outcome);
        let warning = "warning: other.exr: what lies outside of its display window is left out\n";
        assert_eq!(outcome.stderr.contains(warning), name == "other", "{}", outcome.stderr);
    }
    let kept = exr::read_window(&folder.path("other.out.exr")).expect("it can be read").0.set;
    assert_eq!((kept.width, kept.height), (15, 12));
}

/// The view layer of a file of Blender may have any name.
#[test]
fn view_layers_of_other_names_are_finished() {
    let folder = Folder::new();
    let options = "--method path --iterations 2 --no-finish --exr-naming blender";
    done(&folder.run(&format!("{COMMON} {options} -o own.exr")));
    let mut bytes = std::fs::read(folder.path("own.exr")).expect("it is there");
    let at = |bytes: &[u8]| bytes.windows(9).position(|window| window == b"ViewLayer");
    while let Some(at) = at(&bytes) {
        bytes[at..at + 9].copy_from_slice(b"Main.0001");
    }
    std::fs::write(folder.path("other.exr"), bytes).expect("it can be written");
    for name in ["own", "other"] {
        let outcome = folder.run(&format!("finish {name}.exr -o {name}.out.exr --denoise own"));
        done(&outcome);
        let warning = "warning: other.exr: the view layer \"Main.0001\" will be called ViewLayer\n";
        assert_eq!(outcome.stderr.contains(warning), name == "other", "{}", outcome.stderr);
    }
    let read = |name: &str| std::fs::read(folder.path(name)).expect("it is there");
    assert!(read("own.out.exr") == read("other.out.exr"));
}

/// The bytes with the first occurrence of some replaced by as many others.
fn replaced(bytes: &[u8], old: &[u8], new: &[u8]) -> Vec<u8> {
    assert_eq!(old.len(), new.len());
    let at = bytes.windows(old.len()).position(|window| window == old).expect("it is there");
    [&bytes[..at], new, &bytes[at + old.len()..]].concat()
}

/// Technique pictures do not replace an input through a link, --skip-existing keeps a picture that is no frame, and a
/// protected file and a pipe are refused.
#[cfg(unix)]
#[test]
fn inputs_and_pictures_that_exist_are_not_lost() {
    let folder = Folder::new();
    done(&folder.run(&format!("{COMMON} --method path --iterations 1 -o env.exr")));
    std::fs::create_dir(folder.path("techniques")).expect("it can be made");
    std::os::unix::fs::symlink("../env.exr", folder.path("techniques/hit_s0_t3.unweighted.exr")).expect("a link");
    let options = "--method path --iterations 1 -o out.exr";
    let refused = folder.run(&format!("{COMMON} {options} --env env.exr --debug-techniques techniques"));
    assert_eq!(refused.code, Some(2), "{}", refused.stderr);
    assert!(refused.stderr.contains("is an input in this folder, which might be overwritten"), "{}", refused.stderr);
    let before = std::fs::read(folder.path("env.exr")).expect("it is there");
    let skipped = folder.run(&format!("{COMMON} --method path --iterations 2 -o env.exr --skip-existing"));
    assert_eq!((skipped.code, std::fs::read(folder.path("env.exr")).ok()), (Some(0), Some(before)));
    let env = std::fs::metadata(folder.path("env.exr")).expect("it is there");
    let mut permissions = env.permissions();
    permissions.set_readonly(true);
    std::fs::set_permissions(folder.path("env.exr"), permissions).expect("they can be set");
    let refused = folder.run(&format!("{COMMON} --method path --iterations 1 -o env.exr"));
    let error = "env.exr: is protected against writing\nhint: choose another name, or let it be written: chmod u+w\n";
    assert_eq!((refused.code, refused.stderr.as_str()), (Some(1), error));
    let pipe = std::process::Command::new("mkfifo").arg(folder.path("pipe")).status();
    assert!(pipe.is_ok_and(|status| status.success()));
    let refused = folder.run(&format!("{COMMON} {options} --checkpoint pipe"));
    let error = "pipe: is a pipe, from which no render can continue\nhint: name a file with --checkpoint\n";
    assert_eq!((refused.code, refused.stderr.as_str()), (Some(2), error));
}

/// If the PNG cannot be written, the EXR is whole, and nothing is left beside it.
#[cfg(target_os = "linux")]
#[test]
fn a_png_that_fails_leaves_the_exr_alone() {
    let folder = Folder::new();
    let out = folder.path("out");
    std::fs::create_dir(&out).expect("it can be made");
    let failed = folder.run(&format!("{COMMON} --method path --iterations 2 -o out/a.exr --png /dev/full"));
    assert_eq!(failed.code, Some(1), "{}", failed.stderr);
    let names: Vec<_> =
        std::fs::read_dir(&out).expect("it can be read").map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names, ["a.exr"]);
    folder.read("out/a.exr");
}
