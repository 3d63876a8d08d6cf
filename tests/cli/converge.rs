//! `caustique converge`: the report of a small comparison, and errors.

use crate::{Folder, Outcome, values};
use serde_json::Value;

/// Arguments of a small comparison.
const SMALL: &str = "converge scene.glb --width 48 --height 36 --progress none -o out";

/// Runs a comparison with one `--run` argument for each of `runs`.
fn converge(folder: &Folder, arguments: &str, runs: &[&str]) -> Outcome {
    let mut command = folder.command(arguments);
    for run in runs {
        command.args(["--run", run]);
    }
    Outcome::of(command)
}

fn text(folder: &Folder, name: &str) -> String {
    std::fs::read_to_string(folder.path(name)).expect("the file is there")
}

/// Checks that all elements of a document are closed in the right order, and returns the names of all elements.
fn elements(document: &str) -> Vec<String> {
    let void = ["meta", "img", "br", "!doctype"];
    let (mut open, mut all) = (Vec::new(), Vec::new());
    for part in document.split('<').skip(1) {
        let (tag, _) = part.split_once('>').unwrap_or_else(|| panic!("a tag without end: <{part}"));
        let name: String =
            tag.trim_start_matches('/').chars().take_while(|c| !c.is_whitespace() && *c != '/').collect();
        let name = name.to_lowercase();
        if tag.starts_with('/') {
            assert_eq!(open.pop().as_ref(), Some(&name), "closed in the wrong order");
        } else {
            if !tag.ends_with('/') && !void.contains(&name.as_str()) {
                open.push(name.clone());
            }
            all.push(name);
        }
    }
    assert_eq!(open, [""; 0], "never closed");
    all
}

#[test]
fn the_report_of_a_small_comparison() {
    let folder = Folder::new();
    let runs = [
        "one: --method sppm --levels 1 --photons 2000",
        "\"a<b\" & 'c': --method sppm --levels 2 --no-combine --photons 2000",
        "five: --method sppm --photons 2000",
    ];
    let arguments = format!(
        "{SMALL} --methods path --iterations 12 --seeds 2 --target-of one@10 --targets 1e-9 --reference-method vcm --reference-iterations 40"
    );
    let outcome = converge(&folder, &arguments, &runs);
    assert_eq!((outcome.code, outcome.stdout.as_str()), (Some(0), ""), "{}", outcome.stderr);
    let mut files: Vec<String> = std::fs::read_dir(folder.path("out"))
        .expect("the folder is there")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    files.sort();
    let expected = "a-b-c.exr error-core-seconds.svg error-iterations.svg error-seconds.svg five-finished.exr five.exr index.html one-finished.exr one.exr path-finished.exr path.exr points.csv points.json reference.exr trimmed-core-seconds.svg trimmed-iterations.svg trimmed-seconds.svg";
    assert_eq!(files.join(" "), expected);

    // A row per curve, seed and measured iteration: 1, 2, 3, 4, 6, 8, 11 and the last, for one run also 10, which the
    // target needs. Three of the four runs have a curve of finished pictures.
    let csv = text(&folder, "out/points.csv");
    let mut lines = csv.lines();
    let header = "run,method,seed,iterations,light_paths,seconds,cpu_seconds,finish_seconds,figure,relmse,relmse_trimmed,mse,mean_ratio,estimated_error,fireflies";
    assert_eq!(lines.next(), Some(header));
    assert_eq!(lines.clone().count(), 2 * (7 * 8 + 2));
    let json: Value = serde_json::from_str(&text(&folder, "out/points.json")).expect("it is JSON");
    let points = json["points"].as_array().expect("a list");
    assert_eq!(points.len(), 2 * (7 * 8 + 2));
    let of = |run: &str, key: &str| -> Vec<f64> {
        let mine = points.iter().filter(|p| p["run"] == run && p["seed"] == 1);
        mine.map(|p| p[key].as_f64().unwrap_or_else(|| panic!("{key}: {p}"))).collect()
    };
    assert_eq!(of("one", "iterations"), [1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 11.0, 12.0]);
    assert_eq!(of("five", "iterations"), [1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 11.0, 12.0]);
    for run in ["path", "path, finished", "one", "one, finished", "\"a<b\" & 'c'", "five", "five, finished"] {
        for key in ["seconds", "cpu_seconds"] {
            let times = of(run, key);
            assert!(times[0] > 0.0 && times.is_sorted(), "{run} {key} {times:?}");
        }
        let errors = of(run, "relmse");
        assert!(errors[errors.len() - 1] < errors[0], "{run} {errors:?}");
    }
    assert!(of("five, finished", "finish_seconds").iter().all(|seconds| *seconds > 0.0));
    let finished = |p: &Value| p["run"].as_str().is_some_and(|name| name.ends_with(", finished"));
    assert!(
        points
            .iter()
            .all(|p| p["finish_seconds"].is_null() != finished(p) && p["estimated_error"].is_null() >= finished(p))
    );
    // The time of a finished picture includes the time of the finish.
    let (raw, whole, finish) =
        (of("five", "seconds"), of("five, finished", "seconds"), of("five, finished", "finish_seconds"));
    assert!((0..raw.len()).all(|i| (whole[i] - raw[i] - finish[i]).abs() < 1e-9));
    let own = json["reference"]["error"]["relmse"].as_f64().expect("a number");
    assert!(own > 0.0 && own < of("five", "relmse")[0], "{own}");
    for point in points {
        let (figure, measured) = (point["figure"].as_f64(), point["relmse"].as_f64().expect("a number"));
        match figure {
            // Parsing JSON may change the last bit of a number.
            Some(figure) => assert!(figure > own && (figure + own - measured).abs() < 1e-12 * measured, "{point}"),
            None => assert!(measured - own <= own, "{point}"),
        }
    }
    // A target below the error of the reference cannot be reached.
    assert_eq!(json["targets"][0]["error"], 1e-9);
    assert_eq!(json["targets"][0]["runs"][1]["because"], "below the reference's error");
    assert_eq!(json["targets"][1]["of"], "one after 10 iterations");
    let verdict = json["verdict"].as_str().expect("a sentence");
    let said = [" reaches an error of ", " ends with the least error, "].map(|part| verdict.contains(part));
    assert!(said != [false; 2] && verdict.contains(" % "), "{verdict}");
    // What the eye sees of each curve; the scene has a glass ball.
    let seen = json["at_equal_time"].as_array().expect("a list");
    assert_eq!(seen.len(), 7);
    for one in seen {
        let [all, inside] = [&one["grain"], &one["inside"]["grain"]].map(|grain| grain.as_f64().expect("a number"));
        assert!(all > 0.0 && inside > 0.0 && one["inside"]["pixels"] != 48 * 36, "{one}");
    }
    assert_eq!(json["runs"][0]["theory"]["exponent"], -1.0);
    let last = &json["runs"][6];
    assert_eq!((&last["name"], &last["theory"]), (&"five, finished".into(), &Value::Null));
    assert!(last["finish"].as_str().is_some_and(|name| name.starts_with("Open Image Denoise 2.")));
    assert_eq!(last["no_fit"], "denoised pictures follow no power");
    assert_eq!(json["runs"][6]["levels"], 5);
    assert!(json["runs"][5]["overhead"]["finish_seconds"].as_f64().is_some_and(|seconds| seconds > 0.0));

    // The page is self-contained, and escapes names.
    let page = text(&folder, "out/index.html");
    let names = elements(&page);
    let count = |name: &str| names.iter().filter(|n| n.as_str() == name).count();
    assert_eq!((count("svg"), count("html"), count("script"), count("link")), (6, 1, 0, 0));
    assert!(count("table") >= 5 && count("figure") >= 2 * 5, "tables or figures are missing");
    assert_eq!(page.matches("http").count(), page.matches("xmlns=\"http://www.w3.org/2000/svg\"").count());
    assert_eq!(page.matches("src=").count(), page.matches("src=\"data:image/png;base64,").count());
    assert!(!page.contains("href") && !page.contains("url(") && !page.contains("@import"));
    assert!(page.contains("&quot;a&lt;b&quot; &amp; 'c'") && !page.contains("a<b"));
    assert!(page.contains("Visible errors at equal time") && page.contains("in glass and mirrors"));
    for svg in ["out/error-seconds.svg", "out/error-iterations.svg"] {
        let names = elements(&text(&folder, svg));
        assert!(names[0] == "svg" && names.iter().filter(|name| *name == "circle").count() > 20, "{svg}");
    }
    let header = "run,method,seed";
    assert!(csv.starts_with(header) && !csv.contains("NaN") && !page.contains("NaN") && !page.contains("inf "));
}

/// The alternation between runs does not change pictures: after equal iterations they equal those of `render`, finished
/// or not. A reference that was rendered has its error in the file.
#[test]
fn pictures_equal_those_of_render_and_references_have_their_error() {
    let folder = Folder::new();
    let options = [
        ("one", "--method sppm --levels 1 --photons 2000 --no-combine"),
        ("five", "--method sppm --photons 2000"),
        ("network", "--method sppm --photons 2000 --model compact"),
        ("cppm", "--method cppm --levels 1 --photons 2000"),
    ];
    let runs = options.map(|(name, options)| format!("{name}: {options}"));
    let runs: Vec<&str> = runs.iter().map(String::as_str).collect();
    let arguments = format!("{SMALL} --iterations 5 --seed 3 --reference-method bdpt --reference-iterations 8");
    let outcome = converge(&folder, &arguments, &runs);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    for (name, options) in options {
        let render = format!("render scene.glb --width 48 --height 36 --iterations 5 --seed 3 -o {name}.exr {options}");
        assert_eq!(folder.run(&render).code, Some(0));
        let (alone, _) = folder.read(&format!("{name}.exr"));
        let (estimate, header) = folder.read(&format!("out/{name}.exr"));
        assert_eq!(
            (&header["iterations"], &header["name"], &header["combined"]),
            (&5.into(), &name.into(), &Value::Null)
        );
        if options.contains("--no-combine") {
            assert_eq!(values(&estimate, ""), values(&alone, ""), "{name}");
        } else {
            let (finished, of) = folder.read(&format!("out/{name}-finished.exr"));
            assert_eq!(values(&finished, ""), values(&alone, ""), "{name}");
            assert_eq!(values(&estimate, ""), values(&alone, "Noisy"), "{name}");
            assert!(of["name"] == format!("{name}, finished") && !of["combined"].is_null());
        }
        let history = header["history"].as_array().expect("a list");
        let last = &history[history.len() - 1];
        let (error, variance) = (last["error"].as_f64().expect("known"), last["variance"].as_f64().expect("known"));
        assert!(variance > 0.0 && error >= variance.sqrt() * 0.999, "{last}");
    }
    let json = |folder: &Folder| serde_json::from_str::<Value>(&text(folder, "out/points.json")).expect("it is JSON");
    let first = json(&folder)["reference"]["error"].clone();
    assert!(first["mse"].as_f64().is_some_and(|mse| mse > 0.0));
    // The measured error equals that of `compare`.
    let compared = folder.run("compare out/one.exr out/reference.exr --json").json();
    let points = json(&folder)["points"].clone();
    let last = points.as_array().and_then(|points| points.iter().rfind(|point| point["run"] == "one").cloned());
    assert_eq!(last.expect("a point")["relmse"], compared["relmse"]);
    std::fs::rename(folder.path("out/reference.exr"), folder.path("reference.exr")).expect("it is there");
    let outcome =
        converge(&folder, &format!("{SMALL} --iterations 1 --error-metric mse --reference reference.exr"), &runs[..1]);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), ""));
    assert_eq!((&json(&folder)["reference"]["error"], &json(&folder)["metric"]), (&first, &"mse".into()));
    // A reference with the method and seed of a run gives a warning.
    let same = "warning: one.exr: it has method and seed 3 of the run \"one\", whose error will look too small; choose another --seed\n";
    let outcome = converge(&folder, &format!("{SMALL} --iterations 1 --seed 3 --reference one.exr"), &runs[..1]);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), same));
    assert!(json(&folder)["reference"]["error"]["relmse"].as_f64().is_some_and(|error| error > 0.0));
}

#[test]
fn errors_of_converge_name_cause_and_remedy() {
    let folder = Folder::new();
    folder.render("-o other.exr --iterations 1 --no-combine --layers beauty");
    folder.render("-o depth.exr --iterations 1 --no-combine --layers depth");
    let small = "converge scene.glb --width 48 --height 36 -o out --iterations 1";
    let help = "'--help' explains every option";
    let cases: [(&str, &[&str], i32, &str, &str); 15] = [
        (
            "converge scene.glb",
            &[],
            2,
            "command line: the following required arguments were not provided: --output <DIR>",
            help,
        ),
        (
            &format!("{small} --moments 1"),
            &[],
            2,
            "command line: invalid value '1' for '--moments <RATIO>': it must be in (1, 10]",
            help,
        ),
        (
            &format!("{small} --crop 1,2,3"),
            &[],
            2,
            "command line: invalid value '1,2,3' for '--crop <X,Y,W,H>': it must be X,Y,W,H in pixels, such as 120,40,64,64",
            help,
        ),
        (
            &format!("{small} --crop 40,0,9,9"),
            &[],
            2,
            "--crop: 40,0,9,9 is not within the picture",
            "it has 48 x 36 pixels",
        ),
        (
            &format!("{small} --methods path,path"),
            &[],
            2,
            "command line: two runs are called \"path\"",
            "give each --run a name of its own: --run 'NAME: OPTIONS'",
        ),
        (
            &format!("{small} --methods path --target-of sppm@4"),
            &[],
            2,
            "--target-of: there is no run \"sppm\"",
            "there are \"path\"",
        ),
        (
            &format!("{small} --methods path --target-of path@4"),
            &[],
            2,
            "--target-of: 4 iterations are more than the 1 of --iterations",
            "use --iterations 4 or a smaller number here",
        ),
        (
            &format!("{small} --methods path --with mitsuba"),
            &[],
            2,
            "command line: --with needs --time: other renderers count no iterations",
            "add --time SECONDS",
        ),
        (
            small,
            &["x: --methd sppm"],
            2,
            "--run \"x\": unexpected argument '--methd' found",
            "a similar argument exists: '--method'",
        ),
        (
            small,
            &["x: --method sppm --width 3"],
            2,
            "--run \"x\": --width cannot differ from run to run",
            "a run has the method and finish options of 'caustique render'; the others, where there are such, concern all runs",
        ),
        (
            small,
            &["x: --method path --cppm-k 0.5"],
            2,
            "--run \"x\": --cppm-k has no effect with --method path",
            "leave --cppm-k out, or choose --method cppm",
        ),
        (
            &format!("{small} --methods path --reference other.exr"),
            &[],
            2,
            "other.exr: the reference has 64 x 48 pixels, not 48 x 36",
            "use --width 64 --height 48",
        ),
        (
            "converge scene.glb --width 64 --height 48 -o out --iterations 1 --methods path --reference depth.exr",
            &[],
            1,
            "depth.exr: no picture among the layers (depth)",
            "a picture has the channels R, G, B, or a layer named Combined, beauty or rgba",
        ),
        (
            "converge scene.glb --width 64 --height 48 -o out --iterations 1 --methods path --reference nope.exr",
            &[],
            1,
            "nope.exr: No such file or directory (os error 2)",
            "",
        ),
        (
            "converge scene.glb -o other.exr",
            &[],
            1,
            "other.exr: Not a directory (os error 20)",
            "-o names a folder; a file of that name is there",
        ),
    ];
    for (arguments, runs, code, error, hint) in cases {
        let outcome = converge(&folder, arguments, runs);
        let hint = if hint.is_empty() { String::new() } else { format!("hint: {hint}\n") };
        // Warnings about effects that a method does not find come first.
        let errors: String = outcome
            .stderr
            .lines()
            .filter(|line| !line.starts_with("warning: "))
            .map(|line| format!("{line}\n"))
            .collect();
        assert_eq!(errors, format!("{error}\n{hint}"), "{arguments}");
        assert_eq!((outcome.code, outcome.stdout.as_str()), (Some(code), ""), "{arguments}");
    }
    assert_eq!(folder.files(), ["depth.exr", "other.exr"]);
}
