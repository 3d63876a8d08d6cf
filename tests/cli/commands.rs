//! The commands `finish`, `compare` and `info`.

use crate::{Folder, Outcome, support, values};
use caustique::film::{Layer, LayerSet, Naming};
use caustique::image::exr::{self, Attributes};

#[test]
fn finishing_later_gives_the_picture_of_finishing_at_once() {
    let folder = Folder::new();
    folder.render("-o at_once.exr --iterations 3");
    folder.render("-o levels.exr --iterations 3 --no-combine");
    let outcome = folder.run("combine levels.exr -o later.exr --png later.png");
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let ((at_once, _), (levels, _), (later, header)) =
        (folder.read("at_once.exr"), folder.read("levels.exr"), folder.read("later.exr"));
    assert!(values(&at_once, "") == values(&later, ""));
    assert!(values(&levels, "") != values(&later, ""));
    // The finish adds the finished parts: direct, indirect, caustic, emission.
    assert_eq!(levels.layers.len() + 4, later.layers.len());
    assert_eq!(at_once.layers.len(), later.layers.len());
    assert!(values(&at_once, "CombinedCaustic") == values(&later, "CombinedCaustic"));
    let denoiser = header["combined"]["denoiser"].as_str().expect("it says with what");
    assert!(denoiser.starts_with("Open Image Denoise 2.") && header["iterations"] == 3, "{denoiser}");
    // Equation (6) with its network, without a denoiser.
    let outcome = folder.run("combine levels.exr -o network.exr --model compact --denoise none");
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let (network, header) = folder.read("network.exr");
    assert_eq!((&header["combined"]["model"], &header["combined"]["levels"]), (&"compact".into(), &5.into()));
    assert!(values(&network, "") != values(&later, "") && values(&network, "") != values(&levels, ""));
    folder.render("-o blender.exr --iterations 3 --no-combine --exr-naming blender");
    assert_eq!(folder.run("combine blender.exr -o combined.exr").code, Some(0));
    assert!(values(&folder.read("combined.exr").0, "ViewLayer.Combined") == values(&later, ""));
    folder.render("-o beauty.exr --iterations 2 --layers beauty");
    let outcome = folder.run("combine beauty.exr -o no.exr");
    let error = "beauty.exr: nothing tells how noisy the picture is: there is no layer Variance1, Variance, or Half1 and Half2\n\
                 hint: render with --layers all, or add the variance of the mean, or two independent halves\n";
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(1), error));
    let outcome = folder.run("combine beauty.exr -o no.exr --model compact");
    assert_eq!(outcome.code, Some(1), "{}", outcome.stderr);
}

/// The picture is made of the whole estimate and of its parts, whatever layers are delivered, if the parts sum to it.
#[test]
fn layers_do_not_change_the_picture() {
    let folder = Folder::new();
    let render = "--iterations 3 --reproducible";
    for (name, layers) in [("all.exr", "all"), ("beauty.exr", "beauty")] {
        folder.render(&format!("-o {name} {render} --denoise own --layers {layers}"));
    }
    folder.render(&format!("-o raw.exr {render} --no-finish"));
    let (raw, attributes) = exr::read(&folder.path("raw.exr")).expect("the file can be read");
    let parts = ["Emission", "Volume", "Caustic", "Direct", "Indirect"];
    assert!(parts.iter().filter(|part| raw.get(part).is_some()).count() > 2);
    let finished_without = |name: &str, without: &[&str]| {
        let layers = raw.layers.iter().filter(|layer| !without.contains(&&*layer.name)).cloned().collect();
        let set = LayerSet { layers, ..raw.clone() };
        let written = exr::write(&folder.path("some.exr"), &set, &attributes, exr::Options::default());
        written.expect("it can be written");
        let outcome = folder.run(&format!("finish some.exr -o {name} --denoise own"));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        values(&folder.read(name).0, "")
    };
    let picture = values(&folder.read("all.exr").0, "");
    assert!(picture == values(&folder.read("beauty.exr").0, "") && picture == finished_without("later.exr", &[]));
    let whole = finished_without("whole.exr", &parts);
    assert!(whole != picture && whole == finished_without("some_parts.exr", &["Direct"]));
}

/// A network of the finish reads pictures of one level, which it chooses. The header and `info` name it, and a stored
/// picture is finished like a new one.
#[test]
fn a_network_of_the_finish_improves_pictures_of_one_level() {
    let folder = Folder::new();
    let network = include_bytes!("../../src/finish/testdata/finish.onnx");
    std::fs::write(folder.path("a.onnx"), network).expect("it can be written");
    for method in ["sppm", "vcm", "path", "bdpt"] {
        let photons = if method == "sppm" { "--photons 2000" } else { "" };
        let render = format!("render scene.glb --width 64 --height 48 --iterations 4 --method {method} {photons}");
        let with = format!("{render} --layers all,Quarter --reproducible --model a.onnx");
        for (name, threads) in [("at_once.exr", 1), ("threads.exr", 3)] {
            let outcome = folder.run(&format!("{with} -o {name} --threads {threads} --overwrite"));
            assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        }
        let read = |name: &str| std::fs::read(folder.path(name)).expect("it is there");
        assert!(read("at_once.exr") == read("threads.exr"), "{method}");
        let (at_once, header) = folder.read("at_once.exr");
        let finish = &header["combined"];
        assert_eq!((&finish["model"], &finish["levels"]), (&"a.onnx".into(), &serde_json::Value::Null));
        assert_eq!(finish["model_hash"], blake3::hash(network).to_hex().as_str());
        assert!(at_once.get("Level2").is_none() && at_once.get("CombinedDirect").is_some(), "{method}");
        let levels = if matches!(method, "sppm" | "vcm") { "--levels 1" } else { "" };
        let raw = folder.run(&format!("{render} {levels} --layers all,Quarter -o raw.exr --no-finish --overwrite"));
        assert_eq!(raw.code, Some(0), "{}", raw.stderr);
        for (name, model) in [("later.exr", "--model a.onnx"), ("without.exr", "")] {
            let outcome = folder.run(&format!("finish raw.exr -o {name} {model}"));
            assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        }
        let [later, without] = ["later.exr", "without.exr"].map(|name| values(&folder.read(name).0, ""));
        assert!(values(&at_once, "") == later && later != without, "{method}");
    }
    let info = folder.run("info later.exr").stdout;
    assert!(info.contains("finished with the network a.onnx (BLAKE3 "), "{info}");
    for (options, error) in [
        ("--levels 5", "reads pictures of one level, not of 5\nhint: leave --model out, or render with --levels 1\n"),
        ("--denoise none", "reads the denoised picture, which --denoise none does not make\nhint: leave one of"),
    ] {
        let refused = folder.run(&format!("render scene.glb -o no.exr --method sppm --model a.onnx {options}"));
        assert_eq!(refused.code, Some(2), "{}", refused.stderr);
        assert!(refused.stderr.starts_with(&format!("command line: the network a.onnx {error}")), "{}", refused.stderr);
    }
    folder.render("-o levels.exr --iterations 2 --no-finish --method sppm");
    let refused = folder.run("finish levels.exr -o no.exr --model a.onnx");
    assert_eq!(refused.code, Some(1), "{}", refused.stderr);
    let error = "levels.exr: the image has 5 levels, the network takes 1\nhint: render with --levels 1";
    assert!(refused.stderr.starts_with(error), "{}", refused.stderr);
}

/// A picture with Blender's layer names can be finished: combined, albedo, normal, and either two halves or the
/// equivalent variance, which give the same picture.
#[test]
fn pictures_of_other_renderers_can_be_finished() {
    let folder = Folder::new();
    folder.render("-o own.exr --iterations 8 --no-combine --layers beauty,Quarter,albedo,normal --levels 1");
    let (own, _) = folder.read("own.exr");
    let quarters: Vec<Vec<[f32; 3]>> = (1..=4).map(|k| values(&own, &format!("Quarter{k}"))).collect();
    let half = |a: usize| -> Vec<[f32; 3]> {
        let pairs = quarters[a].iter().zip(&quarters[a + 1]);
        pairs.map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect()
    };
    let halves = [half(0), half(2)];
    let beauty: Vec<[f32; 3]> =
        halves[0].iter().zip(&halves[1]).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect();
    let write = |name: &str, with: &[(&str, Vec<[f32; 3]>)]| {
        let mut set = LayerSet::new(own.width, own.height);
        let layers = [("", beauty.clone()), ("albedo", values(&own, "albedo"))];
        for (layer, values) in layers.into_iter().chain(with.iter().cloned()) {
            set.push(Layer::interleaved(layer, "RGB", values)).expect("as many pixels");
        }
        let normal = values(&own, "normal");
        set.push(Layer::interleaved("normal", "XYZ", normal)).expect("as many pixels");
        let options = exr::Options { naming: Naming::Blender, ..exr::Options::default() };
        exr::write(&folder.path(name), &set, &Attributes::default(), options).expect("it can be written");
    };
    write("halves.exr", &[("Half1", halves[0].clone()), ("Half2", halves[1].clone())]);
    let variance = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|c| (0.5 * (a[c] - b[c])).powi(2));
    write("variance.exr", &[("Variance", halves[0].iter().zip(&halves[1]).map(variance).collect())]);
    for name in ["halves", "variance"] {
        let outcome = folder.run(&format!("combine {name}.exr -o {name}-done.exr"));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    }
    let [by_halves, by_variance] =
        ["halves", "variance"].map(|name| values(&folder.read(&format!("{name}-done.exr")).0, "ViewLayer.Combined"));
    assert!(by_halves != beauty);
    let apart = by_halves.iter().flatten().zip(by_variance.iter().flatten()).map(|(a, b)| (a - b).abs());
    assert!(apart.fold(0.0, f32::max) < 1e-4);
}

#[test]
fn compare_prints_error_measures() {
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
fn info_lists_the_content_of_a_scene() {
    let folder = Folder::new();
    let json = folder.run("info scene.glb --json").json();
    assert_eq!((&json["meshes"], &json["triangles"]), (&2.into(), &4.into()));
    assert_eq!(json["cameras"], serde_json::json!(["Camera", "Side"]));
    assert_eq!(json["materials"], serde_json::json!(["stone", "silver"]));
    assert_eq!((&json["lights"]["point"], &json["warnings"]), (&1.into(), &serde_json::json!([])));
    assert_eq!((&json["scenes"], &json["scene_shown"]), (&serde_json::json!(["0"]), &"0".into()));
    assert_eq!(
        (&json["dimensions"], &json["triangles_of_objects"]),
        (&[10.0, 2.0, 10.0][..].into(), &[2, 2][..].into())
    );
    assert_eq!(json["light_names"], serde_json::json!(["light \"Lamp\""]));
    let extension = serde_json::json!({"name": "KHR_lights_punctual", "required": false, "read": true});
    assert_eq!(json["extensions"], serde_json::json!([extension]));
    let text = folder.run("info scene.glb").stdout;
    for line in [
        "  dimensions 10.000 x 2.000 x 10.000 m (X, Y, Z)",
        "  objects    2: Floor (2 triangles), Mirror (2 triangles)",
        "  textures   none",
        "  lights     point 1; 1: light \"Lamp\"",
        "  cameras    2: Camera, Side",
        "  extensions 1: KHR_lights_punctual (read)",
    ] {
        assert!(text.contains(&format!("{line}\n")), "{line}: {text}");
    }
    let outcome = folder.run("info nope");
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(1), "nope: No such file or directory (os error 2)\n"));
}

/// Each warning is a line. `--strict` turns warnings into an error before rendering.
#[test]
fn strict_turns_warnings_into_an_error() {
    let folder = Folder::new();
    support::glb::write(&folder.path("dark.glb"), false);
    let render = "render dark.glb -o out.exr --width 32 --iterations 1 --photons 100 --no-combine --progress none";
    let warning = "warning: dark.glb: the scene has no light of its own: a neutral studio lights it (--light-preset chooses another light or none, --env an image)\n";
    let outcome = folder.run(render);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), warning));
    assert_eq!(folder.read("out.exr").1["warnings"].as_array().map(Vec::len), Some(1));
    std::fs::remove_file(folder.path("out.exr")).expect("it was there");
    let outcome = folder.run(&format!("{render} --strict"));
    let error = "dark.glb: 1 thing is ignored or approximated, and --strict forbids it\n\
                 hint: fix what the warnings above name, or leave --strict out\n";
    assert_eq!((outcome.code, outcome.stderr), (Some(1), format!("{warning}{error}")));
    assert!(!folder.path("out.exr").exists());
    // An environment gives light, and an opaque background.
    assert_eq!(folder.run(&format!("{render} --env 1,1,1 --strict")).code, Some(0));
    let (set, _) = folder.read("out.exr");
    let alpha = &set.get("").and_then(|beauty| beauty.plane("A")).expect("alpha").values;
    assert!(alpha.iter().all(|a| *a == 1.0));
}

/// Every command that reads scenes rejects files that the scene names outside its folder, unless --allow-outside is
/// given. Files that the command line names may be anywhere.
#[test]
fn files_outside_the_scenes_folder_are_rejected() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("scenes")).expect("it can be made");
    image::Rgb32FImage::from_pixel(2, 1, image::Rgb([1.0; 3])).save(folder.path("sky.hdr")).expect("it can be written");
    support::glb::write_under(&folder.path("scenes/out.glb"), "../sky.hdr");
    support::glb::write(&folder.path("scenes/in.glb"), true);
    let error = "scenes/out.glb: scene 0: environment: the file ../sky.hdr is outside the scene's folder\n\
                 hint: put it beside the scene file and name it so, or allow such files with --allow-outside\n";
    let render = "-o out.exr --width 16 --iterations 1 --photons 100 --no-combine --progress none";
    let converge = "-o out --methods path --time 0.1 --width 16";
    for (command, options) in [("info", ""), ("plan", "--width 16"), ("render", render), ("converge", converge)] {
        let outcome = folder.run(&format!("{command} scenes/out.glb {options}"));
        assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(1), error), "{command}");
        if command != "converge" {
            let outcome = folder.run(&format!("{command} scenes/out.glb {options} --allow-outside"));
            assert_eq!(outcome.code, Some(0), "{command}: {}", outcome.stderr);
        }
    }
    assert_eq!(folder.run(&format!("render scenes/in.glb --env sky.hdr {render}")).code, Some(0));
}

/// Four million instances of a kilobyte each exceed a limit of two gigabytes. The error comes before they are
/// allocated.
#[test]
fn scenes_larger_than_memory_are_rejected() {
    let folder = Folder::new();
    support::glb::write_copies(&folder.path("copies.glb"), 64);
    let mut command = std::process::Command::new("sh");
    let line = format!("ulimit -v 2097152; exec {} info copies.glb", env!("CARGO_BIN_EXE_caustique"));
    // Many threads would fill the limit with their stacks.
    command.current_dir(folder.path("")).args(["-c", &line]).env("RAYON_NUM_THREADS", "2").env("MALLOC_ARENA_MAX", "2");
    let outcome = Outcome::of(command);
    let (start, end) = (
        "copies.glb: node ",
        " GiB are left by 'ulimit -v'\n\
         hint: place fewer copies, join them into one mesh, or render with more memory\n",
    );
    // On a busy machine, a message about the wait comes first.
    let error = outcome.stderr.strip_prefix("reading copies.glb\n").unwrap_or(&outcome.stderr);
    assert!(error.starts_with(start) && error.ends_with(end), "{error}");
    assert!(error.contains(" placed meshes need about "), "{error}");
    assert_eq!(outcome.code, Some(1));
}

/// Equation (6) subtracts levels, so the network's picture has negative pixels. They are clamped in the file, and the
/// header has their number.
#[test]
fn no_finished_pixel_is_negative() {
    let folder = Folder::new();
    for denoise in ["none", "own"] {
        let outcome = folder.run(&format!(
            "render scene.glb -o out.exr --width 64 --height 48 --photons 500 --method sppm --iterations 2 \
             --model compact --denoise {denoise}"
        ));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        let (set, header) = folder.read("out.exr");
        assert!(values(&set, "").iter().flatten().all(|value| *value >= 0.0), "{denoise}");
        let clamped = &header["combined"]["clamped"];
        assert!(clamped["below_zero"].is_u64() && clamped["too_bright"].is_u64(), "{clamped}");
        println!("{denoise}: {clamped}");
    }
}
