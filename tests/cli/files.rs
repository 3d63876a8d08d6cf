//! The files that a render writes.

use crate::{Folder, support, values};
use caustique::film::{LayerSet, Sample};
use caustique::image::exr;
use serde_json::Value;

/// Without `-o`, an EXR and a PNG with the scene's name are written beside it, also by frame, and a line says so.
#[test]
fn without_output_the_picture_is_beside_the_scene() {
    let folder = Folder::new();
    let outcome = folder.render("--iterations 2 --no-finish");
    assert!(outcome.stderr.starts_with("no --output: writing scene.exr and scene.png\n"), "{}", outcome.stderr);
    assert_eq!(folder.files(), ["scene.exr", "scene.png"]);
    let again = folder.run("render scene.glb --width 8 --iterations 1 --method path --progress none");
    assert_eq!(again.code, Some(0), "{}", again.stderr);
    for lost in ["scene.exr", "scene.png"] {
        for name in folder.files() {
            std::fs::remove_file(folder.path(&name)).expect("it can be removed");
        }
        std::fs::write(folder.path(lost), "of another program").expect("it can be written");
        let refused = folder.run("render scene.glb --width 8 --iterations 1 --method path --progress none");
        let error =
            "is there, and may be no render of this program\nhint: name the picture with --output, or move this one\n";
        assert_eq!(refused.code, Some(2), "{}", refused.stderr);
        assert!(refused.stderr.ends_with(&format!("{lost}: {error}")), "{}", refused.stderr);
        assert_eq!(std::fs::read(folder.path(lost)).expect("it is there"), b"of another program");
    }
    std::fs::remove_file(folder.path("scene.png")).expect("it can be removed");
    folder.render("--iterations 2 --no-finish");
    let refused = folder.run("render none.glb");
    assert!(refused.code != Some(0) && !refused.stderr.contains("no --output"), "{}", refused.stderr);
    folder.render("--iterations 2 --no-finish --frames 3 --png look.####.png");
    assert_eq!(folder.files(), ["look.0003.png", "scene.0003.exr", "scene.exr", "scene.png"]);
}

#[test]
fn a_render_writes_all_layers_and_a_complete_header() {
    let folder = Folder::new();
    let outcome = folder.render("-o out.exr --png out.png --iterations 6 --seed 7");
    assert_eq!(folder.files(), ["out.exr", "out.png"]);
    for part in [
        "method: auto: sppm, for the only candidate that these options leave\n",
        "\niteration 6 of 6, ",
        "\npeak memory ",
        "\nout.exr: 64 x 48, 110 channels\n",
    ] {
        assert!(outcome.stderr.contains(part), "{part:?} in {}", outcome.stderr);
    }
    let (set, header) = folder.read("out.exr");
    assert_eq!((set.width, set.height), (64, 48));
    let mut expected: Vec<String> =
        ["", "Noisy", "Direct", "Indirect", "Caustic", "Emission", "Error"].map(String::from).into();
    for k in 1..=5 {
        expected.extend(["Level", "Variance", "Radius", "CausticRadius"].map(|stem| format!("{stem}{k}")));
    }
    expected.extend(["albedo", "normal", "depth", "Z", "P", "Rejected"].map(String::from));
    expected.extend(["Direct", "Indirect", "Caustic", "Emission"].map(|part| format!("Combined{part}")));
    for k in 0..3 {
        expected.extend(["CryptoObject", "CryptoMaterial"].map(|stem| format!("{stem}0{k}")));
    }
    let mut found: Vec<String> = set.layers.iter().map(|layer| layer.name.clone()).collect();
    expected.sort();
    found.sort();
    assert_eq!(found, expected);
    assert!(set.layers.iter().flat_map(|l| &l.planes).all(|plane| plane.values.iter().all(|v| v.is_finite())));

    // The parts sum to the estimate, which is level 4. The picture is finished, and it has a caustic.
    let (noisy, level) = (values(&set, "Noisy"), values(&set, "Level4"));
    let parts = ["Direct", "Indirect", "Caustic", "Emission"].map(|name| values(&set, name));
    for i in 0..noisy.len() {
        for c in 0..3 {
            let sum: f32 = parts.iter().map(|part| part[i][c]).sum();
            assert!(
                (sum - noisy[i][c]).abs() <= 1e-5 * noisy[i][c].abs().max(1e-3),
                "pixel {i}: {sum} {}",
                noisy[i][c]
            );
        }
        assert_eq!(noisy[i], level[i]);
    }
    // The finished parts sum to the finished picture up to rounding, and none is negative.
    let finished = ["Direct", "Indirect", "Caustic", "Emission"].map(|name| values(&set, &format!("Combined{name}")));
    for (i, beauty) in values(&set, "").iter().enumerate() {
        for c in 0..3 {
            let sum: f32 = finished.iter().map(|part| part[i][c]).sum();
            assert!((sum - beauty[c]).abs() <= 3e-7 * beauty[c].max(1e-3), "pixel {i}: {sum} {}", beauty[c]);
            assert!(beauty[c] >= 0.0 && finished.iter().all(|part| part[i][c] >= 0.0));
        }
    }
    let caustic: f32 = parts[2].iter().map(|p| p[0]).sum();
    assert!(caustic > 0.0 && values(&set, "") != noisy);
    // The radius of each level is 1/sqrt(2) of the next larger one.
    for k in 1..5 {
        for stem in ["Radius", "CausticRadius"] {
            let [small, large] = [k, k + 1].map(|k| values(&set, &format!("{stem}{k}")));
            assert!(small.iter().zip(&large).all(|(s, l)| (s[0] / l[0] * 2f32.sqrt() - 1.0).abs() < 1e-5));
        }
    }

    assert_eq!(header["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!((&header["seed"], &header["iterations"], &header["light_paths"]), (&7.into(), &6.into(), &12000.into()));
    assert_eq!((&header["method"], &header["stopped"]), (&"sppm".into(), &"iterations".into()));
    assert_eq!(header["arguments"]["scene"], "scene.glb");
    assert_eq!(header["arguments"]["photons"], 2000);
    assert!(header["combined"]["model"].is_null() && header["combined"]["error_at_half"].is_number());
    for key in ["seconds", "phases", "threads", "peak_memory", "error", "rejected", "warnings"] {
        assert!(!header[key].is_null(), "{key} in {header}");
    }
    for moment in header["history"].as_array().expect("a history") {
        for key in ["seconds", "cpu_seconds", "iterations", "light_paths", "error", "variance"] {
            assert!(moment.get(key).is_some(), "{key} in {moment}");
        }
    }
    let json = folder.run("info out.exr --json").json();
    assert_eq!((&json["width"], &json["height"], &json["seed"]), (&64.into(), &48.into(), &7.into()));
    assert_eq!(json["layers"].as_array().map(Vec::len), Some(expected.len()));
    assert_eq!(json["history"], header["history"]);
    let text = folder.run("info out.exr").stdout;
    assert!(text.contains("\n          +-----") && text.contains("6 iterations, 12000 light paths"), "{text}");
}

/// The header lists each effect with its reasons and whether it is simulated, and the core-seconds of each phase.
#[test]
fn the_header_has_the_plan_and_the_phases() {
    let folder = Folder::new();
    folder.render("-o out.exr --iterations 3 --no-combine --max-depth 3");
    let (_, header) = folder.read("out.exr");
    let plan = &header["plan"];
    assert_eq!(plan["method"], "sppm");
    assert!(plan["because"].as_str().is_some_and(|because| because.starts_with("auto: ")), "{plan}");
    let effects = plan["effects"].as_array().expect("a list");
    let of = |key: &str| -> Vec<&str> {
        let with = effects.iter().filter(|effect| effect[key] == true);
        with.filter_map(|effect| effect["name"].as_str()).collect()
    };
    let names: Vec<&str> = effects.iter().filter_map(|effect| effect["name"].as_str()).collect();
    let all = "emission direct indirect glossy caustic sds volume dispersion depth_of_field environment alpha textures";
    assert_eq!(names.join(" "), all);
    // A perfect mirror does not call for the effect glossy.
    assert_eq!(of("present"), ["direct", "indirect", "caustic", "sds"]);
    // A path of a caustic in a mirror has at least four segments.
    assert_eq!(of("simulated"), ["direct", "indirect", "caustic"]);
    assert_eq!(effects[4]["because"], serde_json::json!(["material \"silver\" on \"Mirror\" under light \"Lamp\""]));

    let phases = header["phases"].as_object().expect("phases");
    let sum: f64 = ["pilot", "light", "map", "eye"].iter().filter_map(|name| phases[*name].as_f64()).sum();
    let total = header["history"].as_array().and_then(|h| h.last()?["cpu_seconds"].as_f64()).expect("a number");
    // The clock ticks every 10 ms.
    assert!((sum - total).abs() < 0.1, "{sum} of {total}");
}

/// Every method writes levels and bandwidths if it has them, parts that sum to its estimate, and a warning about
/// effects that it does not find.
#[test]
fn every_method_writes_its_layers() {
    let folder = Folder::new();
    let cases = [
        ("path", 1, false, true),
        ("light", 1, false, true),
        ("bdpt", 1, false, true),
        ("pm", 1, false, false),
        ("sppm", 5, true, false),
        ("bpm", 1, true, false),
        ("vcm", 5, true, false),
    ];
    let mut means = vec![];
    for (method, levels, bandwidths, misses) in cases {
        let options =
            format!("render scene.glb --width 48 --height 36 -o {method}.exr --iterations 24 --method {method}");
        let outcome = folder.run(&format!("{options} --progress none"));
        assert_eq!(outcome.code, Some(0), "{method}: {}", outcome.stderr);
        let warned = outcome.stderr.contains(&format!("--method {method} does not find all light of the effect 'sds'"));
        assert_eq!(warned, misses, "{method}: {}", outcome.stderr);
        let (set, header) = folder.read(&format!("{method}.exr"));
        assert_eq!((&header["method"], &header["plan"]["method"]), (&method.into(), &method.into()));
        assert!(header["combined"]["denoiser"].is_string(), "{method}");
        for k in 1..=5 {
            for (stem, there) in [("Level", true), ("Variance", true), ("Radius", bandwidths)] {
                assert_eq!(set.get(&format!("{stem}{k}")).is_some(), there && k <= levels, "{method}: {stem}{k}");
            }
        }
        let noisy = values(&set, "Noisy");
        let parts = ["Direct", "Indirect", "Caustic", "Emission"].map(|name| values(&set, name));
        for (i, noisy) in noisy.iter().enumerate() {
            let sum: f32 = parts.iter().map(|part| part[i][1]).sum();
            assert!(
                (sum - noisy[1]).abs() <= 1e-5 * noisy[1].abs().max(1e-3),
                "{method}, pixel {i}: {sum} {}",
                noisy[1]
            );
        }
        means.push(noisy.iter().map(|p| p[1]).sum::<f32>() / noisy.len() as f32);
    }
    // The methods that find all light agree roughly. Other tests compare them precisely.
    assert!(means[3..].iter().all(|mean| (mean / means[4] - 1.0).abs() < 0.1), "{means:?}");

    let rejected = folder.run("render scene.glb -o out.exr --method vcm --photons 1000");
    assert_eq!(
        (rejected.code, rejected.stderr.as_str()),
        (
            Some(2),
            "command line: --photons has no effect with --method vcm\nhint: leave --photons out, or choose --method sppm\n"
        )
    );
}

/// `--debug-techniques` writes a weighted and an unweighted picture per technique. The weighted ones sum to the
/// estimate, and none is brighter than its unweighted picture.
#[test]
fn weighted_pictures_of_all_techniques_sum_to_the_estimate() {
    let folder = Folder::new();
    let cases = [
        ("path", &["nextevent_s1_t2", "nextevent_s1_t3"][..]),
        ("light", &["camera_s2_t1", "camera_s3_t1"]),
        ("bdpt", &["nextevent_s1_t2", "camera_s2_t1", "camera_s3_t1"]),
        ("bpm", &["merge_s2_t2", "merge_s3_t2"]),
        ("vcm", &["nextevent_s1_t2", "camera_s2_t1", "merge_s3_t3"]),
    ];
    for (method, expected) in cases {
        let options = format!("--width 40 --height 30 --iterations 4 --method {method} --no-combine --progress none");
        let outcome =
            folder.run(&format!("render scene.glb -o {method}.exr {options} --debug-techniques {method}/techniques"));
        assert_eq!((outcome.code, outcome.stderr.contains("panicked")), (Some(0), false), "{}", outcome.stderr);
        let path = format!("{method}/techniques");
        let names = std::fs::read_dir(folder.path(&path)).expect("the folder is there");
        let names: Vec<String> = names.map(|e| e.expect("an entry").file_name().to_string_lossy().into()).collect();
        for name in expected {
            for end in ["weighted.exr", "weighted.png", "unweighted.exr", "unweighted.png"] {
                assert!(names.contains(&format!("{name}.{end}")), "{method}: {name}.{end} in {names:?}");
            }
        }
        let (set, _) = folder.read(&format!("{method}.exr"));
        let noisy = values(&set, "Noisy");
        let mut sum = vec![[0f64; 3]; noisy.len()];
        let picture = |name: &str| {
            let (set, _) = exr::read(&folder.path(&format!("{path}/{name}"))).expect("a picture");
            values(&set, "")
        };
        for name in names.iter().filter(|name| name.ends_with(".weighted.exr")) {
            let (weighted, unweighted) = (picture(name), picture(&name.replace(".weighted", ".unweighted")));
            for (i, sum) in sum.iter_mut().enumerate() {
                for c in 0..3 {
                    assert!(weighted[i][c] <= unweighted[i][c] * 1.00001, "{method}: {name}, pixel {i}");
                    sum[c] += f64::from(weighted[i][c]);
                }
            }
        }
        for (i, (sum, noisy)) in sum.iter().zip(&noisy).enumerate() {
            for c in 0..3 {
                let (sum, noisy) = (sum[c], f64::from(noisy[c]));
                assert!((sum - noisy).abs() <= 1e-5 * noisy.max(1e-3), "{method}, pixel {i}: {sum} {noisy}");
            }
        }
        assert!(noisy.iter().any(|p| p[1] > 0.0));
    }
    let rejected = folder.run("render scene.glb -o out.exr --debug-techniques d");
    let cause = "command line: --debug-techniques has no effect before a method is chosen\nhint: ";
    assert!(rejected.code == Some(2) && rejected.stderr.starts_with(cause), "{}", rejected.stderr);
    std::fs::write(folder.path("file"), "").expect("a file");
    let refused = folder.run("render scene.glb -o out.exr --method path --debug-techniques file");
    assert!(refused.code == Some(1) && refused.stderr.starts_with("file: "), "{}", refused.stderr);
}

/// If guided light paths carry caustics alone, their default number is the number of pixels.
#[test]
fn small_pictures_have_few_guided_light_paths() {
    let folder = Folder::new();
    let guided = "--method sppm --indirect paths --guide on";
    for (options, paths) in [(guided, 48 * 36), ("--method sppm --indirect paths", 100_000)] {
        for (photons, paths) in [("", paths), (" --photons 3000", 3000)] {
            let render =
                format!("render scene.glb --width 48 --height 36 --iterations 1 --no-combine {options}{photons}");
            let outcome = folder.run(&format!("{render} -o out.exr"));
            assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
            assert_eq!(folder.read("out.exr").1["light_paths"], paths, "{options}{photons}");
        }
    }
}

/// The number of light paths per pixel is a multiple of a sixteenth, in whole tiles. Without light paths the method is
/// `path`, without merging `bdpt`; options that would have no effect are refused.
#[test]
fn numbers_of_light_paths_connections_and_merges_are_options() {
    let folder = Folder::new();
    let vcm = "render scene.glb --width 48 --height 32 --iterations 1 --no-finish --progress none --method vcm";
    for (options, method, paths) in [
        ("--light-paths 2", "vcm", 2 * 48 * 32),
        ("--light-paths 0.0625 --connections 0 --merging 0.5", "vcm", 48 * 32 / 16),
        ("--light-paths 0.25 --merging 0", "bdpt", 48 * 32 / 4),
        ("--light-paths 0", "path", 0),
    ] {
        let outcome = folder.run(&format!("{vcm} {options} -o out.exr"));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        let header = folder.read("out.exr").1;
        assert_eq!((&header["plan"]["method"], &header["light_paths"]), (&method.into(), &paths.into()), "{options}");
    }
    for (options, cause) in [
        ("--light-paths 0.3", "--light-paths must be a multiple of 1/16"),
        ("--light-paths 0 --connections 1", "--connections needs light paths, and --light-paths 0 traces none"),
        ("--light-paths 0 --merging 1", "--merging needs light paths, and --light-paths 0 traces none"),
        ("--method path --light-paths 1", "--light-paths has no effect with --method path"),
        ("--method bdpt --merging 1", "--merging has no effect with --method bdpt"),
    ] {
        let refused = folder.run(&format!("{vcm} {options} -o out.exr"));
        let expected = format!("command line: {cause}\nhint: ");
        assert!(refused.code == Some(2) && refused.stderr.starts_with(&expected), "{}", refused.stderr);
    }
}

/// A photon map that is full ends tracing early with a warning, and the picture is not darker.
#[test]
fn a_full_photon_map_gives_a_warning_and_loses_no_light() {
    let folder = Folder::new();
    let pm = "render scene.glb --width 48 --height 36 --iterations 4 --method pm --photons 400000 --progress none";
    let mut means = vec![];
    for (name, memory, full) in [("all.exr", 64, false), ("some.exr", 1, true)] {
        let outcome = folder.run(&format!("{pm} -o {name} --photon-memory {memory}"));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        assert_eq!(outcome.stderr.contains("warning: the photon map was full at "), full, "{}", outcome.stderr);
        let (set, header) = folder.read(name);
        let photons = header["map"]["photons"].as_u64().expect("a number");
        assert_eq!(header["map"]["full"], full);
        assert_eq!(header["light_paths"].as_u64() < Some(400_000), full);
        assert!(photons > 0 && photons * 152 <= memory << 20, "{photons}");
        let by_photons = ["Caustic", "Indirect"].map(|name| values(&set, name).iter().map(|p| p[1]).sum::<f32>());
        means.push(by_photons[0] + by_photons[1]);
    }
    // About 7000 photons, in wide kernels. Divided by the full number of paths, the mean would be a fraction.
    assert!((means[1] / means[0] - 1.0).abs() < 0.15, "{means:?}");
    for (option, cause) in [
        ("--method pm --knn 1", "--knn must be 2 or more with --method pm"),
        ("--method vcm --photon-memory 10", "--photon-memory has no effect with --method vcm"),
        ("--method pm --initial-bandwidth 0.1", "--initial-bandwidth has no effect with --method pm"),
    ] {
        let outcome = folder.run(&format!("render scene.glb -o out.exr {option}"));
        assert_eq!(outcome.code, Some(2));
        assert!(outcome.stderr.starts_with(&format!("command line: {cause}\nhint: ")), "{}", outcome.stderr);
    }
}

#[test]
fn the_same_bytes_with_any_number_of_threads() {
    let folder = Folder::new();
    for combine in ["", "--no-combine"] {
        let files: Vec<Vec<u8>> = (1..=3)
            .map(|threads| {
                let name = format!("t{threads}.exr");
                folder.render(&format!("-o {name} --iterations 3 --threads {threads} --reproducible {combine}"));
                std::fs::read(folder.path(&name)).expect("the file is there")
            })
            .collect();
        assert!(files[0] == files[1] && files[0] == files[2], "{combine}");
    }
    // The picture is two tiles of the network and thirty bands of rows.
    let files = [1, 3].map(|threads| {
        let name = format!("large{threads}.exr");
        let size = "--width 600 --height 480 --photons 2000 --iterations 1 --layers beauty --reproducible";
        let outcome = folder.run(&format!("render scene.glb -o {name} {size} --threads {threads}"));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        std::fs::read(folder.path(&name)).expect("the file is there")
    });
    assert!(files[0] == files[1]);
    folder.render("-o seed.exr --iterations 3 --seed 1 --reproducible --no-combine");
    let ((a, _), (b, _)) = (folder.read("t1.exr"), folder.read("seed.exr"));
    assert!(values(&a, "Noisy") != values(&b, "Noisy"));
    let (_, header) = folder.read("t1.exr");
    for key in ["seconds", "phases", "threads", "peak_memory"] {
        assert!(header.get(key).is_none(), "{key}");
    }
    assert!(header["history"][0].get("seconds").is_none());
}

/// Shards render disjoint iterations, so their weighted mean is the whole render.
#[test]
fn shards_divide_the_iterations() {
    let folder = Folder::new();
    folder.render("-o whole.exr --iterations 5 --no-combine");
    folder.render("-o a.exr --iterations 5 --shard 0/2 --no-combine");
    folder.render("-o b.exr --iterations 5 --shard 1/2 --no-combine");
    let ((whole, _), (a, first), (b, second)) = (folder.read("whole.exr"), folder.read("a.exr"), folder.read("b.exr"));
    assert_eq!((&first["iterations"], &second["iterations"]), (&3.into(), &2.into()));
    assert_eq!((&first["shard"]["index"], &first["shard"]["count"]), (&0.into(), &2.into()));
    for layer in ["Noisy", "Level1", "Level5", "Caustic"] {
        let (whole, a, b) = (values(&whole, layer), values(&a, layer), values(&b, layer));
        assert!(a != b, "{layer}");
        for i in 0..whole.len() {
            for c in 0..3 {
                let merged = (3.0 * a[i][c] + 2.0 * b[i][c]) / 5.0;
                assert!((merged - whole[i][c]).abs() <= 1e-5 * whole[i][c].abs().max(1e-3), "{layer}, pixel {i}");
            }
        }
    }
}

#[test]
fn options_set_levels_layers_names_and_bandwidths() {
    let folder = Folder::new();
    folder.render("-o one.exr --iterations 2 --levels 1 --layers beauty,Radius1 --initial-bandwidth 0.25 --alpha 1");
    let (set, header) = folder.read("one.exr");
    let names: Vec<&str> = set.layers.iter().map(|layer| layer.name.as_str()).collect();
    assert_eq!((names, &header["combined"]["model"]), (vec!["", "Radius1"], &Value::Null));
    assert!(values(&set, "Radius1").iter().all(|r| r[0] == 0.25));
    folder.render("-o three.exr --iterations 2 --levels 3 --no-combine --exr-naming blender --compression piz");
    let (set, _) = folder.read("three.exr");
    assert!(set.get("ViewLayer.Combined").is_some() && set.get("ViewLayer.Level3").is_some());
    assert!(set.get("ViewLayer.Level4").is_none());
    let refused = folder.run("render scene.glb -o no.exr --iterations 2 --levels 3 --model compact --method sppm");
    let error = "command line: the network compact combines 5 levels, not 3\nhint: leave --model out, or render with --levels 5\n";
    assert_eq!((refused.code, refused.stderr.as_str()), (Some(2), error));
}

/// Photons in media have separate bandwidths, and the volume of the kernel doubles from level to level. Methods that
/// gather no photons in media do not write these layers.
#[test]
fn media_add_layers_of_their_own() {
    let folder = Folder::new();
    support::glb::write_foggy(&folder.path("scene.glb"));
    folder.render("-o fog.exr --iterations 2 --no-combine");
    let (set, _) = folder.read("fog.exr");
    for k in 1..5 {
        let [small, large] = [k, k + 1].map(|k| values(&set, &format!("VolumeRadius{k}")));
        assert!(small.iter().zip(&large).all(|(s, l)| l[0] > 0.0 && ((s[0] / l[0]).powi(3) - 0.5).abs() < 1e-5));
    }
    assert!(set.get("VolumeRadius6").is_none() && set.get("Volume").is_some());
    folder.run("render scene.glb -o vcm.exr --width 64 --height 48 --iterations 2 --no-combine --method vcm");
    let (set, _) = folder.read("vcm.exr");
    assert!(set.get("Volume").is_some() && set.get("Radius1").is_some() && set.get("VolumeRadius1").is_none());
}

/// One iteration gives no variance. The header says so, and all values in the file are finite.
#[test]
fn after_one_iteration_the_variance_is_unknown() {
    let folder = Folder::new();
    folder.render("-o out.exr --iterations 1 --no-combine");
    let (set, header) = folder.read("out.exr");
    assert_eq!((&header["variance_known"], &header["error"]), (&false.into(), &Value::Null));
    assert!(set.layers.iter().flat_map(|l| &l.planes).all(|plane| plane.values.iter().all(|v| v.is_finite())));
    assert!(values(&set, "Error") == values(&set, "Noisy"));
}

/// Renders a few pixels with the method `path`.
pub fn small(folder: &Folder, options: &str) -> crate::Outcome {
    let outcome = folder.run(&format!("render scene.glb -o out.exr --width 8 --height 8 --method path {options}"));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    outcome
}

/// Each light group has its own layers with legal names, for any names of groups in the scene.
#[test]
fn light_groups_of_any_names_have_layers() {
    let folder = Folder::new();
    let long = "k".repeat(43);
    for (groups, expected, naming) in [
        (["key light", "key-light", long.as_str()], ["key_light", "key_light_2", &long[..32]], "plain"),
        (["\u{4e3b}\u{5149}", "\u{9006}\u{5149}", &long[..33]], ["__", "___2", &long[..32]], "blender"),
    ] {
        support::glb::write_grouped(&folder.path("scene.glb"), groups);
        let outcome = small(&folder, &format!("--iterations 4 --exr-naming {naming}"));
        let (set, _) = folder.read("out.exr");
        for name in expected {
            let of_naming = if naming == "blender" { "ViewLayer." } else { "" };
            for prefix in ["LightGroup_", "FinishedLightGroup_"] {
                assert!(set.get(&format!("{of_naming}{prefix}{name}")).is_some(), "{name} in {}", outcome.stderr);
            }
        }
        for (group, name) in groups.into_iter().zip(expected).skip(1) {
            let warning = format!("light group \"{group}\": its layers are called {name}: ");
            assert!(outcome.stderr.contains(&warning), "{warning} in {}", outcome.stderr);
        }
    }
}

/// The pictures of a file in ACEScg are other numbers in the file, and the same picture to its readers.
#[test]
fn pictures_can_be_in_acescg() {
    let folder = Folder::new();
    let render = "--iterations 2 --exr-naming plain --reproducible";
    small(&folder, render);
    std::fs::rename(folder.path("out.exr"), folder.path("rec709.exr")).expect("it can be renamed");
    small(&folder, &format!("{render} --colorspace acescg"));
    let of = |name: &str| {
        let meta = ::exr::meta::MetaData::read_from_file(folder.path(name), true).expect("it is an EXR");
        meta.headers[0].shared_attributes.chromaticities.expect("they are declared")
    };
    assert!((of("rec709.exr").red.0 - 0.64).abs() < 1e-6 && (of("out.exr").red.0 - 0.713).abs() < 1e-6);
    let raw = ::exr::prelude::read_first_flat_layer_from_file(folder.path("out.exr")).expect("it is an EXR");
    let stored = raw.layer_data.channel_data.list.iter().find(|channel| channel.name.to_string() == "Noisy.R");
    let stored: Vec<f32> = stored.expect("it is there").sample_data.values_as_f32().collect();
    let ((rec709, _), (read, _)) = (folder.read("rec709.exr"), folder.read("out.exr"));
    let plane = |set: &LayerSet, name: &str| set.get("Noisy").expect(name).plane(name).expect(name).values.clone();
    let [r, g, b] = ["R", "G", "B"].map(|name| plane(&rec709, name));
    for pixel in 0..stored.len() {
        let wanted = 0.613_097 * r[pixel] + 0.339_523 * g[pixel] + 0.047_379 * b[pixel];
        assert!((stored[pixel] - wanted).abs() <= 1e-4 * wanted.abs().max(1e-3), "{} {wanted}", stored[pixel]);
    }
    for layer in &rec709.layers {
        let found = read.get(&layer.name).expect("it is there");
        for (plane, other) in layer.planes.iter().zip(&found.planes) {
            for (a, b) in plane.values.iter().zip(&other.values) {
                assert!((a - b).abs() <= 1e-4 * a.abs().max(1e-2), "{}: {a} {b}", layer.name);
            }
        }
    }
}

/// Each layer is a part, of the layer's name, and half floats hold what they suffice for. All layers read back.
#[test]
fn layers_can_be_parts_and_half_floats() {
    let folder = Folder::new();
    let render = "--iterations 2 --exr-naming plain --reproducible";
    small(&folder, render);
    std::fs::rename(folder.path("out.exr"), folder.path("one.exr")).expect("it can be renamed");
    small(&folder, &format!("{render} --multi-part"));
    let ((one, first), (many, header)) = (folder.read("one.exr"), folder.read("out.exr"));
    assert_eq!(first, header);
    assert_eq!(one.layers.len(), many.layers.len());
    for layer in &one.layers {
        assert_eq!(Some(layer), many.get(&layer.name), "{}", layer.name);
    }
    let parts = ::exr::meta::MetaData::read_from_file(folder.path("out.exr"), true).expect("it is an EXR").headers;
    let names: Vec<String> =
        parts.iter().map(|part| part.own_attributes.layer_name.clone().expect("it has a name").to_string()).collect();
    assert_eq!(names.len(), one.layers.len());
    assert_eq!(names[0], "Combined");
    assert!(["Noisy", "Level1", "Z"].iter().all(|name| names.contains(&(*name).to_string())), "{names:?}");

    small(&folder, &format!("{render} --half"));
    let (half, _) = folder.read("out.exr");
    small(&folder, &format!("{render} --layers comp"));
    let (comp, _) = folder.read("out.exr");
    let of_comp =
        |name: &str| ["", "Z", "Error"].contains(&name) || name.starts_with("Crypto") || (name.starts_with("Combined"));
    assert!(["Z", "Error", "CombinedCaustic", "CryptoObject00"].iter().all(|name| comp.get(name).is_some()));
    assert!(comp.layers.iter().all(|layer| of_comp(&layer.name) && !layer.name.contains("Diffuse")));
    let sample = |set: &LayerSet, layer: &str| set.get(layer).expect(layer).planes[0].sample;
    assert_eq!(["", "albedo", "normal"].map(|layer| sample(&half, layer)), [Sample::Half; 3]);
    assert_eq!(["Noisy", "Z", "Variance1"].map(|layer| sample(&half, layer)), [Sample::Float; 3]);
    for (exact, rounded) in values(&one, "").as_flattened().iter().zip(values(&half, "").as_flattened()) {
        assert!((exact - rounded).abs() <= exact.abs() / 2048.0 + 1e-7, "{exact} {rounded}");
    }
}

/// A layer of light that a scene does not have is black if the user names it, so that all shots have the same layers.
#[test]
fn a_named_part_without_light_is_black() {
    let folder = Folder::new();
    let outcome = small(&folder, "--iterations 4 --layers beauty,Volume,CombinedVolume");
    assert!(outcome.stderr.contains("layer \"Volume\" is black: the render has no such light"), "{}", outcome.stderr);
    let (set, _) = folder.read("out.exr");
    for layer in ["Volume", "CombinedVolume"] {
        assert!(values(&set, layer).as_flattened().iter().all(|value| *value == 0.0), "{layer}");
    }
    assert!(values(&set, "").as_flattened().iter().any(|value| *value > 0.0));
}

#[cfg(target_os = "linux")]
#[test]
fn names_may_be_invalid_utf8() {
    use std::os::unix::ffi::OsStrExt;
    let bytes = |name: &'static [u8]| std::ffi::OsStr::from_bytes(name);
    let folder = Folder::new();
    let name = bytes(b"sc\xffne.glb");
    std::fs::rename(folder.path("scene.glb"), folder.path("").join(name)).expect("it can be renamed");
    for command in
        ["render -o out.exr --width 8 --iterations 1 --method path --progress none", "plan --width 16", "info"]
    {
        let mut command = folder.command(command);
        command.arg(name);
        let outcome = crate::Outcome::of(command);
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    }
    assert_eq!(folder.read("out.exr").1["arguments"]["scene"], "sc\u{fffd}ne.glb");
    for progress in ["none", "json"] {
        let mut command = folder.command("render --width 8 --iterations 1 --method path --progress");
        command
            .arg(progress)
            .arg(name)
            .arg("-o")
            .arg(bytes(b"pi\xffture.exr"))
            .arg("--png")
            .arg(bytes(b"pi\xffture.png"));
        let outcome = crate::Outcome::of(command);
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    }
}
