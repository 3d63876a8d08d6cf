//! Errors of the command line, word for word, and its help.

use crate::{Folder, Outcome, support};

/// Every error is `place: cause`, then `hint: remedy`, and nothing else. It comes before any work is done.
#[test]
fn errors_name_place_cause_and_remedy() {
    let folder = Folder::new();
    let render = "render scene.glb -o out.exr --no-combine";
    let help = "'--help' explains every option";
    let cases: [(&str, i32, &str, &str); 38] = [
        ("", 2, "command line: a command is missing", "'caustique --help' lists the commands"),
        ("rendr", 2, "command line: unrecognized subcommand 'rendr'", "a similar subcommand exists: 'render'"),
        (
            &format!("{render} --itertions 3"),
            2,
            "command line: unexpected argument '--itertions' found",
            "a similar argument exists: '--iterations'",
        ),
        (
            &format!("{render} --effects volume"),
            2,
            "command line: invalid value 'volume' for '--effects <LIST>': each effect needs a sign: -volume leaves it out, +volume asks for it",
            help,
        ),
        (
            &format!("{render} --effects -bloom"),
            2,
            "command line: invalid value '-bloom' for '--effects <LIST>': there is no effect 'bloom'; there are emission, direct, indirect, glossy, caustic, sds, volume, dispersion, depth_of_field, environment, alpha, textures",
            help,
        ),
        (
            &format!("{render} --method cppm --kernel gaussian"),
            2,
            "command line: cppm needs the box kernel",
            "leave --kernel out, or choose --method sppm with the memoryless rule, or appm",
        ),
        (
            &format!("{render} --radius-rule local --kernel epanechnikov"),
            2,
            "command line: the local rule needs the box kernel",
            "leave --kernel out, or choose --method sppm with the memoryless rule, or appm",
        ),
        (
            &format!("{render} --method vcm --radius-rule local"),
            2,
            "command line: --radius-rule has no effect with --method vcm",
            "leave --radius-rule out, or choose --method sppm",
        ),
        (
            &format!("{render} --method ppm --shard 0/2"),
            2,
            "command line: --shard cannot divide --method ppm: its bandwidths depend on all iterations before",
            "choose --method sppm with the memoryless rule, or render on one machine",
        ),
        (
            &format!("{render} --initial-bandwidth 1e-10"),
            2,
            "command line: invalid value '1e-10' for '--initial-bandwidth <knn|footprint|R>': a length must be from 1e-9 to 1e9",
            help,
        ),
        (
            &format!("{render} --initial-bandwidth inf"),
            2,
            "command line: invalid value 'inf' for '--initial-bandwidth <knn|footprint|R>': a length must be from 1e-9 to 1e9",
            help,
        ),
        (
            &format!("{render} --photons 50000001"),
            2,
            "command line: invalid value '50000001' for '--photons <N>': it must be a whole number from 1 to 50000000",
            help,
        ),
        (
            &format!("{render} --iterations 2000000001"),
            2,
            "command line: invalid value '2000000001' for '--iterations <N>': it must be a whole number from 1 to 8388608",
            help,
        ),
        (
            &format!("{render} --alpha 2"),
            2,
            "command line: invalid value '2' for '--alpha <A>': it must be in (0, 1]",
            help,
        ),
        (
            &format!("{render} --alpha nan"),
            2,
            "command line: invalid value 'nan' for '--alpha <A>': it is not a finite number",
            help,
        ),
        (
            &format!("{render} --knn 1025"),
            2,
            "command line: invalid value '1025' for '--knn <K>': it must be a whole number from 1 to 1024",
            help,
        ),
        (
            &format!("{render} --levels 9"),
            2,
            "command line: invalid value '9' for '--levels <M>': it must be a whole number from 1 to 5",
            help,
        ),
        (
            &format!("{render} --method teapot"),
            2,
            "command line: invalid value 'teapot' for '--method <METHOD>' [possible values: auto, path, light, bdpt, pm, ppm, sppm, appm, cppm, bpm, vcm, mlt]",
            help,
        ),
        (
            &format!("{render} --shard 2/2"),
            2,
            "command line: invalid value '2/2' for '--shard <I/N>': shards of 2 are 0 to 1",
            help,
        ),
        (
            &format!("{render} --shard 5/8 --iterations 4"),
            2,
            "command line: shard 5 of 8 holds none of 4 iterations",
            "use fewer shards or more --iterations",
        ),
        (
            &format!("{render} --knn 5 --initial-bandwidth 0.1"),
            2,
            "command line: --knn has no effect with this --initial-bandwidth",
            "leave one of the two out",
        ),
        (
            &format!("{render} --cppm-k 0.7"),
            2,
            "command line: --cppm-k has no effect before a method is chosen",
            "leave --cppm-k out, or choose --method cppm",
        ),
        (
            &format!("{render} --method cppm --cppm-grid 9,9"),
            2,
            "command line: invalid value '9,9' for '--cppm-grid <NA,NS>': there must be 2 to 64 cells",
            help,
        ),
        (
            &format!("{render} --method cppm --shard 0/2"),
            2,
            "command line: --shard cannot divide --method cppm: its bandwidths depend on all iterations before",
            "choose --method sppm with the memoryless rule, or render on one machine",
        ),
        (
            &format!("{render} --env 1,2"),
            2,
            "command line: invalid value '1,2' for '--env <FILE|R,G,B>': a colour has three numbers R,G,B, not 2",
            help,
        ),
        (
            &format!("{render} --time -3"),
            2,
            "command line: invalid value '-3' for '--time <SECONDS|1h30m>': it must be above 0",
            help,
        ),
        (
            &format!("{render} --seed -1"),
            2,
            "command line: invalid value '-1' for '--seed <S>': it must be a whole number from 0 to 18446744073709551615",
            help,
        ),
        (
            &format!("{render} --env -1,0,0"),
            2,
            "command line: unexpected argument '-1' found",
            "a value that begins with '-' is joined to its option, as in --option=-1,2",
        ),
        (
            &format!("{render} --target-error 5"),
            2,
            "command line: invalid value '5' for '--target-error <E>': it must be in (0, 1)",
            "did you mean 0.05, which is 5 %?",
        ),
        (
            "help rendering",
            2,
            "command line: unrecognized subcommand 'rendering'",
            "'caustique --help' lists the commands",
        ),
        (&format!("{render} --layers albeod"), 2, "--layers: no layer \"albeod\"", "did you mean \"albedo\"?"),
        (&format!("{render} --layers Level6"), 2, "--layers: no layer \"Level6\"", "did you mean \"Level1\"?"),
        (
            "render nope.glb -o out.exr --no-combine",
            1,
            "nope.glb: No such file or directory (os error 2)",
            "check the path of the scene file and your right to read it",
        ),
        ("render scene.glb -o no/out.exr", 1, "no/out.exr: its folder does not exist", "mkdir -p no"),
        (
            "render scene.glb -o out.png",
            2,
            "out.png: the name does not end in .exr",
            "the output is an EXR; --png writes a picture to look at beside it",
        ),
        ("render scene.glb -o out.exr --png no/out.png", 1, "no/out.png: its folder does not exist", "mkdir -p no"),
        (
            &format!("{render} --camera Camrea"),
            2,
            "scene.glb: there is no camera \"Camrea\"",
            "it has \"Camera\", \"Side\"",
        ),
        (
            &format!("{render} --env-strength 2"),
            2,
            "scene.glb: --env-strength: the scene has no environment",
            "give one with --env",
        ),
    ];
    for (arguments, code, error, hint) in cases {
        let outcome = folder.run(arguments);
        assert_eq!(outcome.stderr, format!("{error}\nhint: {hint}\n"), "{arguments}");
        assert_eq!((outcome.code, outcome.stdout.as_str()), (Some(code), ""), "{arguments}");
    }
    assert_eq!(folder.files(), [""; 0]);
}

/// For an option name of another renderer, the hint names the option of this program, in commands that have it.
#[test]
fn option_names_of_other_programs_get_a_hint() {
    let folder = Folder::new();
    let iterations = "--iterations N sends N camera paths through every pixel; --time SECONDS stops after that time";
    let size = "--width W and --height H are the picture's size in pixels; one alone keeps the camera's aspect";
    let depth = "--max-depth N is the longest light path in segments, one more than it has bounces";
    let layers = "--layers LIST chooses the layers of the EXR";
    let output = "the command prints to standard output: '> FILE' writes to a file";
    let cases = [
        ("render", "--samples", iterations),
        ("render", "--spp", iterations),
        ("converge", "--spp", iterations),
        ("render", "--size", size),
        ("plan", "--resolution", size),
        ("render", "--max-bounces", depth),
        ("converge", "--depth", depth),
        ("render", "--aovs", layers),
        ("render", "--quiet", "--progress none says nothing but warnings and errors"),
        ("combine", "--denoiser", "--denoise auto|oidn|own|none chooses the denoiser"),
        ("combine", "--jobs", "--threads T is the number of threads; 0 takes all cores"),
        ("render", "--out", "--output, or -o, names what is written"),
        ("compare", "--output", output),
        ("info", "--out", output),
        ("doctor", "--spp", "'--help' explains every option"),
    ];
    for (command, word, hint) in cases {
        let outcome = folder.run(&format!("{command} {word}"));
        let error = format!("command line: unexpected argument '{word}' found\nhint: {hint}\n");
        assert_eq!((outcome.code, outcome.stderr), (Some(2), error), "{command}");
    }
    for word in ["--frame", "--frames", "--passes"] {
        let outcome = folder.run(&format!("render scene.glb {word}"));
        assert!(outcome.code == Some(2) && !outcome.stderr.contains("similar"), "{}", outcome.stderr);
    }
    let run = Outcome::of({
        let mut command = folder.command("converge scene.glb -o out --run");
        command.arg("few: --spp 4");
        command
    });
    assert_eq!(run.stderr, format!("--run \"few\": unexpected argument '--spp' found\nhint: {iterations}\n"));
}

/// Scripts can put their own options before those of their caller.
#[test]
fn the_last_value_of_a_repeated_option_counts() {
    let folder = Folder::new();
    let outcome = folder.run(
        "render scene.glb -o first.exr --width 64 --iterations 9 --photons 100 --no-combine --method pm --progress none \
         -o last.exr --width 32 --iterations 1 --method sppm",
    );
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), ""));
    assert_eq!(folder.files(), ["last.exr"]);
    let (set, header) = folder.read("last.exr");
    assert_eq!((set.width, &header["iterations"], &header["method"]), (32, &1.into(), &"sppm".into()));
    let mut command = folder.command("converge scene.glb -o out --width 16 --iterations 1 --progress none --run");
    command.arg("twice: --method path --method bdpt --no-combine");
    assert_eq!(Outcome::of(command).code, Some(0));
}

#[test]
fn more_threads_than_a_machine_can_use_give_a_warning() {
    let folder = Folder::new();
    let cores = std::thread::available_parallelism().expect("the cores are known").get();
    let plan = |threads: usize| folder.run(&format!("plan scene.glb --method path --threads {threads}"));
    let (most, more) = (4 * cores, 4 * cores + 1);
    assert_eq!(plan(most).stderr, "");
    let warning = format!(
        "warning: --threads {more}: there are {cores} cores: more threads take memory, and make nothing faster\n"
    );
    let outcome = plan(more);
    assert_eq!((outcome.code, outcome.stderr), (Some(0), warning));
}

/// The output is checked before the scene is read. A failed render does not change an existing file.
#[test]
fn outputs_are_checked_first() {
    let folder = Folder::new();
    std::fs::write(folder.path("broken.glb"), "no scene at all").expect("it can be written");
    std::fs::create_dir(folder.path("folder.exr")).expect("it can be made");
    let outcome = folder.run("render broken.glb -o folder.exr");
    assert_eq!(
        (outcome.code, outcome.stderr.as_str()),
        (Some(1), "folder.exr: is a folder\nhint: name a file in it\n")
    );
    std::fs::write(folder.path("old.exr"), "old").expect("it can be written");
    let outcome = folder.run("render nope.glb -o old.exr");
    assert_eq!(outcome.code, Some(1));
    assert_eq!(std::fs::read(folder.path("old.exr")).expect("it is there"), b"old");
}

#[test]
fn help_and_version_are_data_and_offer_only_what_exists() {
    let folder = Folder::new();
    let help = folder.run("render --help");
    assert_eq!((help.code, help.stderr.as_str()), (Some(0), ""));
    for option in [
        "--photons",
        "--kernel",
        "--cppm-plus",
        "--exr-naming",
        "--usd-layer",
        "--target-error",
        "--strict",
        "--effects",
        "--reproducible",
        "--checkpoint-every",
        "--resume",
    ] {
        assert!(help.stdout.contains(option), "{option}");
    }
    // `compact` is the only network that comes with the program.
    assert!(help.stdout.contains("--model <compact|FILE.onnx>"));
    let commands = folder.run("--help").stdout;
    for (command, listed) in
        [("finish", true), ("compare", true), ("converge", true), ("doctor", true), ("plan", true), ("merge", true)]
    {
        assert_eq!(commands.contains(&format!("\n  {command} ")), listed, "{command}");
    }
}

/// `--version` prints the version, the commit if the build has it, and the libraries.
#[test]
fn the_version_names_the_libraries() {
    let folder = Folder::new();
    let lines: Vec<String> = folder.run("--version").stdout.lines().map(str::to_owned).collect();
    assert!(lines[0].starts_with(concat!("caustique ", env!("CARGO_PKG_VERSION"))), "{lines:?}");
    let found = folder.run("doctor --json").json();
    for (line, (name, key)) in
        lines[1..].iter().zip([("Embree", "embree"), ("ONNX Runtime", "onnxruntime"), ("Open Image Denoise", "oidn")])
    {
        let text = |field: &str| found[key][field].as_str().unwrap_or("none").to_owned();
        assert_eq!(*line, format!("{name} {}, {}", text("version"), text("path")));
    }
    assert_eq!(lines.len(), 4, "{lines:?}");
    let mut without = folder.command("--version");
    without.env("CAUSTIQUE_OIDN", "/no/such/library.so");
    assert!(Outcome::of(without).stdout.ends_with("Open Image Denoise not found\n"));
}

/// The help begins with the most needed options. Options for researchers are last, and not in the short help.
#[test]
fn help_lists_the_most_needed_options_first() {
    let folder = Folder::new();
    let stop = ["When to stop", "Picture"];
    let rest = ["Method", "Light and glass", "Effects", "Finish", "Running", "Expert"];
    let (all, output) = ([&stop[..], &["Output"], &rest].concat(), ["Output"]);
    for (command, headings) in [("render", &all[..]), ("plan", &[&stop[..], &rest].concat()), ("converge", &output)] {
        let long = folder.run(&format!("{command} --help")).stdout;
        let places: Vec<Option<usize>> = headings.iter().map(|heading| long.find(&format!("\n{heading}:\n"))).collect();
        assert!(places.iter().all(Option::is_some) && places.is_sorted(), "{command}: {places:?}");
    }
    let (long, short) = (folder.run("render --help").stdout, folder.run("render -h").stdout);
    let expert = [
        "--cppm-grid",
        "--cppm-k",
        "--cppm-plus",
        "--knn",
        "--alpha",
        "--initial-bandwidth",
        "--kernel",
        "--radius-rule",
        "--photon-memory",
        "--levels",
        "Expert",
    ];
    for option in expert {
        assert!(long.contains(option) && !short.contains(option), "{option}");
    }
    for option in ["--time", "--iterations", "--target-error", "--width", "--output", "--png", "--method", "--env"] {
        assert!(short.contains(option), "{option}");
    }
    let lines = short.lines().count();
    assert!(lines <= 80, "the short help has {lines} lines");
}

#[test]
fn help_completions_and_manual_pages_are_printed() {
    let folder = Folder::new();
    let data = |arguments: &str| {
        let outcome = folder.run(arguments);
        assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), ""), "{arguments}");
        outcome.stdout
    };
    assert_eq!(data("help"), data("--help"));
    for command in ["render", "converge", "doctor"] {
        assert_eq!(data(&format!("help {command}")), data(&format!("{command} --help")));
    }
    let commands = data("--help");
    let places: Vec<Option<usize>> =
        ["render", "plan", "doctor", "help"].map(|command| commands.find(&format!("\n  {command} "))).into();
    assert!(places.iter().all(Option::is_some) && places.is_sorted(), "{commands}");
    for shell in ["bash", "zsh", "fish"] {
        let script = data(&format!("completions {shell}"));
        assert!(script.contains("caustique") && script.contains("target-error"), "{shell}");
    }
    let page = data("man");
    assert!(page.contains(".TH caustique 1") && page.contains("caustique\\-render(1)"), "{page}");
    let page = data("man render");
    assert!(page.contains(".TH caustique-render 1") && page.contains("\\-\\-target\\-error"), "{page}");
    let outcome = folder.run("man rendering");
    let error = "command line: there is no command 'rendering'\nhint: 'caustique --help' lists the commands\n";
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(2), error));
}

/// A missing library is an error before rendering, with its name and a remedy.
#[test]
fn missing_libraries_are_named_before_rendering() {
    let folder = Folder::new();
    let missing = |variable: &str, arguments: &str| {
        let mut command = folder.command(arguments);
        command.env(variable, "/no/such/library.so");
        Outcome::of(command)
    };
    let render = "render scene.glb -o out.exr --width 32 --iterations 1 --photons 100";
    let outcome = missing("CAUSTIQUE_ONNXRUNTIME", &format!("{render} --model compact"));
    assert_eq!(outcome.code, Some(1));
    let lines: Vec<&str> = outcome.stderr.lines().collect();
    assert_eq!(lines[0], "CAUSTIQUE_ONNXRUNTIME=/no/such/library.so: no such file");
    assert!(lines[1].starts_with("hint: on Debian 13: apt-get install libonnxruntime1.21;"), "{}", lines[1]);
    assert!(lines[1].ends_with("; or leave --model out, and the network with it"), "{}", lines[1]);
    assert_eq!((lines.len(), folder.files().len()), (2, 0));
    assert_eq!(missing("CAUSTIQUE_ONNXRUNTIME", &format!("{render} --progress none")).code, Some(0));

    // Without Open Image Denoise, the program's own denoiser is used, unless --denoise oidn was given.
    let outcome = missing("CAUSTIQUE_OIDN", &format!("{render} --progress none"));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let lines: Vec<&str> = outcome.stderr.lines().collect();
    assert!(
        lines[0].contains("our own denoiser takes its place") && lines[1].contains("scripts/setup.sh"),
        "{lines:?}"
    );
    assert_eq!(folder.read("out.exr").1["combined"]["denoiser"], "own");
    let outcome = missing("CAUSTIQUE_OIDN", &format!("{render} --denoise oidn"));
    assert!(outcome.code == Some(1) && outcome.stderr.contains("\nhint: "), "{}", outcome.stderr);
    assert_eq!(missing("CAUSTIQUE_OIDN", &format!("{render} --denoise none --progress none")).stderr, "");

    let outcome = missing("CAUSTIQUE_EMBREE", render);
    assert_eq!(outcome.code, Some(1));
    assert!(outcome.stderr.contains("Embree") && outcome.stderr.contains("\nhint: "), "{}", outcome.stderr);

    let libraries = [
        ("CAUSTIQUE_EMBREE", "embree", "Embree", "Debian"),
        ("CAUSTIQUE_ONNXRUNTIME", "onnxruntime", "ONNX Runtime", "Debian"),
        ("CAUSTIQUE_OIDN", "oidn", "Open Image Denoise", "run scripts/setup.sh, or set CAUSTIQUE_OIDN to "),
    ];
    for (variable, key, name, advice) in libraries {
        let outcome = missing(variable, "doctor --json");
        // A render needs no other library.
        let needed = key == "embree";
        assert_eq!(outcome.code, Some(i32::from(needed)));
        let json = outcome.json();
        assert_eq!(json[key]["found"], false);
        assert!(json[key]["hint"].as_str().is_some_and(|hint| hint.contains(advice)), "{json}");
        for (_, other, ..) in libraries.iter().filter(|(_, other, ..)| *other != key) {
            assert_eq!(json[other]["found"], true, "{json}");
            assert!(json[other]["version"].as_str().is_some_and(|version| version.contains('.')), "{json}");
        }
        let error = format!("doctor: cannot use {name}\nhint: ");
        assert!(
            if needed { outcome.stderr.starts_with(&error) } else { outcome.stderr.is_empty() },
            "{}",
            outcome.stderr
        );
    }
    let well = folder.run("doctor");
    assert_eq!((well.code, well.stderr.as_str()), (Some(0), ""));
    // Whether USD and Blender are found does not matter to the exit code.
    let names = ["caustique ", "Embree ", "ONNX Runtime ", "Open Image Denoise ", "USD ", "Blender "];
    let lines: Vec<&str> = well.stdout.lines().collect();
    assert!(lines.len() >= 6 && lines.iter().zip(names).all(|(line, name)| line.starts_with(name)), "{lines:?}");
    let unwell = missing("CAUSTIQUE_OIDN", "doctor");
    let indent = " ".repeat(18);
    let text = format!(
        "Open Image Denoise not usable, needed to denoise: CAUSTIQUE_OIDN=/no/such/library.so: no such file\n\
         {indent} run scripts/setup.sh, or set CAUSTIQUE_OIDN to libOpenImageDenoise.so\n"
    );
    assert!(unwell.stdout.contains(&text), "{}", unwell.stdout);
    let without = missing("CAUSTIQUE_USD_PYTHON", "doctor --json");
    assert_eq!((without.code, &without.json()["usd"]["found"]), (Some(0), &serde_json::json!(false)));
    let without = missing("CAUSTIQUE_BLENDER", "doctor --json").json();
    assert!(without["blender"]["hint"].as_str().is_some_and(|hint| hint.contains("scripts/setup.sh bpy")), "{without}");
}

/// Methods that gather photons only on surfaces, or only photons of caustics, would miss light scattered in media. They
/// reject such a scene before any work is done.
#[test]
fn methods_that_miss_light_of_scattering_media_reject_them() {
    let folder = Folder::new();
    support::glb::write_foggy(&folder.path("scene.glb"));
    let render = "render scene.glb -o out.exr --width 32 --height 24 --iterations 1 --no-combine --method";
    for method in ["pm", "bpm"] {
        let outcome = folder.run(&format!("{render} {method}"));
        let error = format!(
            "scene.glb: --method {method} does not render media that scatter light\nhint: choose --method sppm, cppm, vcm, bdpt or path\n"
        );
        assert_eq!((outcome.code, outcome.stderr), (Some(2), error));
        assert_eq!((outcome.stdout.as_str(), folder.files().len()), ("", 0));
    }
    let outcome = folder.run(&format!("{render} sppm --indirect paths"));
    let error =
        "scene.glb: --indirect paths does not render media that scatter light\nhint: leave --indirect paths out\n";
    assert_eq!((outcome.code, outcome.stderr.as_str(), folder.files().len()), (Some(2), error, 0));
    for method in ["pm", "bpm"] {
        let outcome = folder.run(&format!("plan scene.glb --method {method}"));
        let error = format!("scene.glb: --method {method} does not render media that scatter light\n");
        assert!(outcome.code == Some(2) && outcome.stderr.starts_with(&error), "{}", outcome.stderr);
    }
    let converge = "converge scene.glb -o out --width 32 --height 24 --iterations 1 --methods";
    let outcome = folder.run(&format!("{converge} sppm,pm"));
    let error = "--run \"pm\": --method pm does not render media that scatter light\nhint: choose --method sppm, cppm, vcm, bdpt or path\n";
    assert_eq!((outcome.code, outcome.stderr.as_str(), folder.files().len()), (Some(2), error, 0));
    for method in ["sppm --photons 100", "cppm --photons 100", "vcm", "bdpt", "path"] {
        let outcome = folder.run(&format!("{render} {method}"));
        assert_eq!(outcome.code, Some(0), "{method}: {}", outcome.stderr);
    }
}

#[test]
fn a_picture_larger_than_memory_is_rejected_before_rendering() {
    let folder = Folder::new();
    let outcome = folder.run("render scene.glb -o out.exr --width 32768 --height 32768 --no-combine");
    let error = "32768 x 32768 pixels with --method auto need about ";
    assert!(outcome.stderr.starts_with(error), "{}", outcome.stderr);
    let hint = "hint: use a smaller --width and --height, or --crop for a part of the picture\n";
    assert!(outcome.stderr.ends_with(hint), "{}", outcome.stderr);
    assert_eq!((outcome.code, folder.files()), (Some(1), vec![]));
    let remedies =
        [("path", "--crop for a part of the picture"), ("vcm", "fewer --levels"), ("sppm", "fewer --photons")];
    for (method, remedy) in remedies {
        let outcome = folder
            .run(&format!("render scene.glb -o out.exr --width 32768 --height 32768 --no-combine --method {method}"));
        let hint = format!("hint: use a smaller --width and --height, or {remedy}\n");
        assert!(outcome.stderr.ends_with(&hint), "{}", outcome.stderr);
    }
}

/// A bandwidth below the resolution of positions, or larger than the scene, would lose light without a warning.
#[test]
fn bandwidths_too_small_or_too_large_for_the_scene_are_rejected() {
    let folder = Folder::new();
    let render =
        "render scene.glb -o out.exr --width 32 --iterations 1 --photons 100 --method sppm --initial-bandwidth";
    let outcome = folder.run(&format!("{render} 1e-9"));
    let (start, end) = (
        "scene.glb: --initial-bandwidth 0.000000001: in a scene of radius ",
        "e-5 at least, or leave --initial-bandwidth out\n",
    );
    assert!(outcome.stderr.starts_with(start) && outcome.stderr.ends_with(end), "{}", outcome.stderr);
    assert_eq!((outcome.code, folder.files()), (Some(2), vec![]));
    assert_eq!(folder.run(&format!("{render} 0.001")).code, Some(0));
    let outcome = folder.run(&format!("{render} 1e9"));
    let start = "scene.glb: --initial-bandwidth 1000000000: the scene has a radius of ";
    let end = " at most, or leave --initial-bandwidth out\n";
    assert!(outcome.stderr.starts_with(start) && outcome.stderr.ends_with(end), "{}", outcome.stderr);
    assert_eq!(outcome.code, Some(2));
}
