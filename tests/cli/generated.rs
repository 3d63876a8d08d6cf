//! Compares generated files with the definition of a render's options (`src/options`). `scripts/generate.sh` writes
//! them.

use crate::Folder;
use caustique::options::catalogue;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// Compares a file with its expected content, or writes it.
fn compare(path: &str, expected: &str) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    if std::env::var_os("CAUSTIQUE_WRITE").is_some() {
        fs::write(&file, expected).expect("the file can be written");
    }
    let found = fs::read_to_string(&file).unwrap_or_default();
    assert!(found == expected, "{path} is not what src/options gives: run scripts/generate.sh");
}

/// Compares the part of a file between two markers, or writes it.
fn compare_part(path: &str, [begin, end]: [&str; 2], expected: &str) {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).expect("the file can be read");
    let (before, rest) = text.split_once(begin).expect("the part begins");
    let (_, after) = rest.split_once(end).expect("the part ends");
    compare(path, &format!("{before}{begin}{expected}{end}{after}"));
}

/// All options of `render`, as the program describes them.
fn options() -> Vec<Value> {
    let printed = Folder::new().run("options").stdout;
    let described: Value = serde_json::from_str(&printed).expect("it is JSON");
    described["render"].as_array().expect("there are options").clone()
}

fn text<'a>(option: &'a Value, key: &str) -> &'a str {
    option[key].as_str().unwrap_or_default()
}

/// Options that are arguments of Python's `render`, or of its `plan`, which has no options about output and running.
fn arguments(all: &[Value], plan: bool) -> Vec<&Value> {
    let runs = |option: &Value| ["Output", "Running"].contains(&text(option, "heading")) && option["name"] != "threads";
    all.iter()
        .filter(|option| !option["python"].is_null() && option["of_scene"] == false)
        .filter(|option| !(plan && runs(option)))
        .collect()
}

#[test]
fn generated_json_lists_the_options_that_files_may_set() {
    let all = options();
    let of_stages = all.iter().filter(|option| option["stage"] == true);
    let names: Vec<&Value> = of_stages
        .flat_map(|option| std::iter::once(&option["name"]).chain(option["aliases"].as_array().into_iter().flatten()))
        .collect();
    let shown = |option: &&Value| {
        ["method", "seed", "iterations", "time", "target_error", "denoise"].contains(&text(option, "name"))
    };
    let panel: serde_json::Map<String, Value> = all
        .iter()
        .filter(shown)
        .map(|option| {
            let keys = ["default", "range", "choices", "help"].map(|key| (key.to_string(), option[key].clone()));
            (text(option, "name").to_string(), keys.into_iter().collect())
        })
        .collect();
    let made = format!("{:#}\n", json!({"files_may_give": names, "panel": panel}));
    compare("scripts/usd/options.json", &made);
    compare("scripts/blender/caustique_addon/options.json", &made);
}

/// USD stages and Blender files come from untrusted sources, so they cannot set files or permissions.
#[test]
fn stages_cannot_set_files_or_permissions() {
    let all = options();
    for name in [
        "output",
        "png",
        "model",
        "env",
        "resume",
        "checkpoint",
        "allow_outside",
        "strict",
        "memory",
        "threads",
        "preview",
    ] {
        let option = all.iter().find(|option| option["name"] == name).expect(name);
        assert_eq!(option["stage"], false, "{name}");
    }
}

#[test]
fn python_has_all_options_or_a_reason() {
    let given: Vec<String> =
        catalogue::of_python().into_iter().chain(catalogue::of_scene()).map(|entry| entry.name).collect();
    for option in options() {
        let name = text(&option, "name");
        assert!(given.iter().any(|known| known == name) || !option["not_in_python"].is_null(), "{name}");
    }
    for name in ["radius_rule", "kernel", "indirect", "eye_paths", "photon_memory", "memory", "max_depth"] {
        assert!(given.iter().any(|known| known == name), "{name}");
    }
}

/// The Python type of an argument.
fn python_type(option: &Value) -> String {
    let literal = |names: Vec<&str>| {
        let names: Vec<String> = names.iter().map(|name| format!("\"{name}\"")).collect();
        format!("Literal[{}]", names.join(", "))
    };
    let choices =
        || option["choices"].as_array().into_iter().flatten().filter_map(|choice| choice[0].as_str()).collect();
    let of_kind = match text(option, "kind") {
        "flag" | "switch" => "bool".into(),
        "integer" => "int".into(),
        "number" => "float".into(),
        "path" => "str | os.PathLike[str]".into(),
        "choice" => literal(choices()),
        _ => "str".into(),
    };
    match text(option, "name") {
        "method" => "_Method".into(),
        "denoise" => "_Denoise".into(),
        "filter" => "_Filter | tuple[_Filter, float]".into(),
        "crop" => "Sequence[float]".into(),
        "orbit" => "Sequence[float] | str".into(),
        "layers" => "str | Sequence[str]".into(),
        "cppm_grid" | "shard" => "tuple[int, int]".into(),
        "initial_bandwidth" => "float | Literal[\"knn\", \"footprint\"]".into(),
        _ => of_kind,
    }
}

/// The default of an argument in Python syntax.
fn python_default(option: &Value, quote: char) -> String {
    match (text(option, "kind"), option["default"].as_str()) {
        ("flag", _) if option["python"] != "finish" => "False".into(),
        ("integer" | "number", Some(value)) => value.into(),
        (_, Some(value)) => format!("{quote}{value}{quote}"),
        _ => "None".into(),
    }
}

#[test]
fn python_stubs_match_the_options() {
    let all = options();
    for (call, plan) in [("render", false), ("plan", true)] {
        let line = |option: &&Value| {
            let default = python_default(option, '"');
            let none = if default == "None" { " | None" } else { "" };
            format!("        {}: {}{none} = {default},\n", text(option, "python"), python_type(option))
        };
        let lines: String = arguments(&all, plan).iter().map(line).collect();
        let marks = [&format!("        # Options of {call}.\n"), &format!("        # End of options of {call}.\n")];
        compare_part("ffi/python/caustique/_native.pyi", marks.map(String::as_str), &lines);
    }
    let methods = python_type(&json!({"kind": "choice", "name": "", "choices": find(&all, "method")["choices"]}));
    compare_part("ffi/python/caustique/_native.pyi", ["\n_Method = ", "\n_Denoise"], &methods);
}

fn find<'a>(all: &'a [Value], name: &str) -> &'a Value {
    all.iter().find(|option| option["name"] == name).expect("there is such an option")
}

/// Wraps text into lines of at most `width` characters.
fn wrap(words: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in words.split_whitespace() {
        let last = lines.last_mut().expect("there is a line");
        if last.is_empty() {
            *last = word.into();
        } else if last.len() + 1 + word.len() <= width {
            *last += &format!(" {word}");
        } else {
            lines.push(word.into());
        }
    }
    lines
}

/// The first paragraph of an option's help, with the names of Python's arguments in place of options.
fn python_help(all: &[Value], option: &Value) -> String {
    if option["python"] == "finish" {
        return "False: the picture is not finished, it is the method's own estimate, at one bandwidth".into();
    }
    let mut help = text(option, "help").split("\n\n").next().unwrap_or_default().to_string();
    let mut names: Vec<(&str, &str)> = all.iter().map(|other| (text(other, "option"), text(other, "python"))).collect();
    names.sort_by_key(|(option, _)| std::cmp::Reverse(option.len()));
    for (name, argument) in names.into_iter().filter(|(_, argument)| !argument.is_empty()) {
        help = help.replace(name, argument);
    }
    match text(option, "kind") {
        "choice" => {
            let choices = option["choices"].as_array().into_iter().flatten();
            let names: Vec<String> = choices.filter_map(|choice| Some(format!("'{}'", choice[0].as_str()?))).collect();
            format!("{help}. One of {}", names.join(", "))
        }
        "switch" => help.replace("'on'", "True").replace("'off'", "False"),
        _ => help,
    }
}

#[test]
fn python_docstrings_match_the_options() {
    let all = options();
    let progress = "called with a Progress after every iteration, in the calling thread; False stops the render";
    for (call, plan, about, end) in [
        (
            "render",
            false,
            "Renders the scene and returns an Image.\n\n\
             The options are those of `caustique render`. Equal options and seeds give the same bytes in every layer, here\n\
             and on the command line, with any number of threads.\n\n",
            "\nAn exception of `progress`, or Ctrl-C, stops the render and discards the running iteration. The attribute `image` of\n\
             the exception holds the picture so far, if there is one. Other threads of Python run meanwhile.\n",
        ),
        (
            "plan",
            true,
            "The plan of a render: which effects it simulates and why, and its warnings. The object of `caustique plan --json`, a\n\
             dict. The options are those of `render`.\n",
            "",
        ),
    ] {
        let options = arguments(&all, plan);
        let of = |option: &&Value| format!("{}={}", text(option, "python"), python_default(option, '\''));
        let mut signature: Vec<String> = options.iter().map(of).collect();
        let mut entries: Vec<(&str, String)> =
            options.iter().map(|option| (text(option, "python"), python_help(&all, option))).collect();
        if plan {
            entries.clear();
        } else {
            signature.push("progress=None".into());
            entries.push(("progress", progress.into()));
        }
        let line = |(name, help): &(&str, String)| {
            let lines = wrap(help, 94);
            let shown = |(i, line): (usize, &String)| format!("{:<20}{line}\n", if i == 0 { name } else { "" });
            lines.iter().enumerate().map(shown).collect::<String>()
        };
        let lines: String = entries.iter().map(line).collect();
        let made = format!("{call}($self, *, {})\n--\n\n{about}{lines}{end}", signature.join(", "));
        compare(&format!("ffi/python/src/{call}.txt"), &made);
    }
}

#[test]
fn the_page_about_python_lists_all_arguments() {
    let all = options();
    let own = ["finish", "progress"];
    let names: Vec<String> = arguments(&all, false)
        .iter()
        .map(|option| text(option, "python"))
        .filter(|name| !own.contains(name))
        .map(|name| format!("`{name}`"))
        .collect();
    let lines = wrap(&format!("Options are those of `caustique render` by the same names: {}.", names.join(", ")), 120);
    let marks = ["<!-- options of render -->\n\n", "\n\n<!-- end of options of render -->"];
    compare_part("docs/python.md", marks, &lines.join("\n"));
}
