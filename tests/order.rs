//! The order of modules in `src/lib.rs`, and other rules for all source files.

use caustique::render::Method;
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

/// All Rust files below a folder.
fn files(folder: &str) -> Vec<PathBuf> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).expect("the folder can be read") {
            let path = entry.expect("the entry can be read").path();
            if path.is_dir() {
                if path.file_name().is_some_and(|name| name != "target") {
                    walk(&path, found);
                }
            } else if path.extension().is_some_and(|e| e == "rs") {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    walk(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder), &mut found);
    found.sort();
    assert!(!found.is_empty(), "no file in {folder}");
    found
}

/// Position of every module in `src/lib.rs`.
fn order(lib: &str) -> HashMap<&str, usize> {
    let names = lib.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'));
    names.enumerate().map(|(i, name)| (name, i)).collect()
}

/// The modules that a file names after `crate::`, in `use` lines, groups and paths; comments do not count.
fn used(text: &str) -> Vec<String> {
    let code: String = text.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n");
    let mut found = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        if at > 0 && code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == '$') {
            continue;
        }
        let rest = &code[at + "crate::".len()..];
        if let Some(group) = rest.strip_prefix('{') {
            let mut depth = 1;
            let mut name = String::new();
            for c in group.chars() {
                match c {
                    '{' => depth += 1,
                    '}' => depth -= 1,
                    _ => {}
                }
                if depth == 0 || (depth == 1 && c == ',') {
                    found.push(std::mem::take(&mut name));
                    if depth == 0 {
                        break;
                    }
                } else if depth == 1 {
                    name.push(c);
                }
            }
        } else {
            found.push(rest.into());
        }
    }
    let word = |s: String| s.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    found.into_iter().map(word).filter(|name| !name.is_empty()).collect()
}

/// Violations of the order: the modules that module `own` uses although they are not above it.
fn broken(order: &HashMap<&str, usize>, own: &str, text: &str) -> Vec<String> {
    let Some(&place) = order.get(own) else { return vec![format!("module {own} is not in src/lib.rs")] };
    let wrong = |name: &String| name != "error" && order.get(name.as_str()).is_some_and(|&other| other > place);
    used(text).into_iter().filter(wrong).collect()
}

#[test]
fn modules_use_only_modules_above_them() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let lib = fs::read_to_string(root.join("src/lib.rs")).expect("src/lib.rs can be read");
    let order = order(&lib);
    assert!(order.contains_key("math") && order.contains_key("render"), "{order:?}");
    let mut faults = Vec::new();
    for file in files("src") {
        let inside = file.strip_prefix(root.join("src")).expect("it is below src");
        let own = inside.components().next().expect("it has a name").as_os_str().to_string_lossy().replace(".rs", "");
        // The program uses the library from outside, so all modules are above it.
        if ["lib", "main", "cli"].contains(&own.as_str()) {
            continue;
        }
        let text = fs::read_to_string(&file).expect("it can be read");
        faults.extend(broken(&order, &own, &text).into_iter().map(|name| format!("{}: {name}", inside.display())));
    }
    assert!(faults.is_empty(), "used before they are declared:\n{}", faults.join("\n"));
}

#[test]
fn the_order_test_finds_planted_faults() {
    let order = order("pub mod error;\npub mod math;\npub mod trace;\npub mod scene;\n");
    assert_eq!(
        broken(&order, "trace", "use crate::math::Vec3;\nuse crate::error::Error; // crate::scene"),
        [] as [&str; 0]
    );
    assert_eq!(broken(&order, "math", "use crate::trace::Ray;"), ["trace"]);
    assert_eq!(broken(&order, "math", "use crate::{\n  error::{Error, Kind},\n  scene::Scene,\n};"), ["scene"]);
    assert_eq!(broken(&order, "trace", "fn f() -> crate::scene::Scene {}"), ["scene"]);
    assert_eq!(broken(&order, "math", "use embree_crate::scene;"), [] as [&str; 0]);
}

/// The folders with the modules of one parent: `src`, the sources of each crate in `ffi`, and all their subfolders.
fn folders(root: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> =
        files("src").into_iter().chain(files("ffi")).filter_map(|file| parent(&file)).collect();
    found.retain(|folder| folder.components().any(|part| part.as_os_str() == "src"));
    found.sort();
    found.dedup();
    assert!(found.contains(&root.join("src")) && found.contains(&root.join("ffi/embree/src")), "{found:?}");
    found
}

fn parent(file: &Path) -> Option<PathBuf> {
    file.parent().map(Path::to_path_buf)
}

/// The modules in a folder with their code. A subfolder counts as one module. The code of the parent itself (`mod.rs`,
/// `lib.rs`, `main.rs`) is left out, because it may use all of its modules.
fn modules(folder: &Path, path: &str) -> Vec<(String, String)> {
    let mut modules: HashMap<String, String> = HashMap::new();
    for file in files(&folder.to_string_lossy()) {
        let inside = file.strip_prefix(folder).expect("it is below the folder").with_extension("");
        let mut place: Vec<String> = inside.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        if place.last().is_some_and(|name| name == "mod") {
            place.pop();
        }
        let Some(own) = place.first().filter(|name| !["lib", "main", "tests"].contains(&name.as_str())) else {
            continue;
        };
        let code = shipped(&fs::read_to_string(&file).expect("it can be read"));
        *modules.entry(own.clone()).or_default() += &from_parent(&code, path, place.len());
    }
    let mut modules: Vec<(String, String)> = modules.into_iter().collect();
    modules.sort();
    modules
}

/// The code with every path into the module `path` (empty for the crate) written as `parent::...`, and without other
/// paths that begin with `crate` or `super`. The code is `depth` modules below.
fn from_parent(code: &str, path: &str, depth: usize) -> String {
    let code = if path.is_empty() {
        code.replace("crate::", "parent::")
    } else {
        code.replace(&format!("crate::{path}::"), "parent::").replace("crate::", "outside::")
    };
    let mut rest = code.as_str();
    let mut written = String::new();
    while let Some(at) = rest.find("super::") {
        written += &rest[..at];
        let mut levels = 0;
        rest = &rest[at..];
        while let Some(after) = rest.strip_prefix("super::") {
            levels += 1;
            rest = after;
        }
        written += if levels == depth { "parent::" } else { "elsewhere::" };
    }
    written + rest
}

/// Names that a module exports to other modules of its parent.
fn given(text: &str) -> Vec<String> {
    let kinds = ["fn ", "const fn ", "struct ", "enum ", "trait ", "type ", "const ", "static "];
    let name = |line: &str| {
        let line = line.strip_prefix("pub")?;
        let line =
            line.strip_prefix('(').and_then(|line| line.split_once(')')).map_or(line, |(_, rest)| rest).trim_start();
        let rest = kinds.iter().rev().find_map(|kind| line.strip_prefix(kind))?;
        Some(rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>())
    };
    text.lines().filter_map(name).filter(|name| !name.is_empty()).collect()
}

/// The modules of one parent that use each other in a circle.
fn circle(modules: &[(String, String)]) -> Vec<String> {
    let mut home: HashMap<String, &str> = HashMap::new();
    for (own, text) in modules {
        for name in given(text) {
            home.entry(name).or_insert(own);
        }
    }
    for (own, _) in modules {
        home.insert(own.clone(), own);
    }
    let uses = |(own, text): &(String, String)| -> Vec<&str> {
        let named = used(&text.replace("parent::", "crate::"));
        named.iter().filter_map(|name| home.get(name).copied()).filter(|other| other != own).collect()
    };
    let edges: Vec<(&str, Vec<&str>)> = modules.iter().map(|module| (module.0.as_str(), uses(module))).collect();
    let mut left: Vec<&str> = edges.iter().map(|(own, _)| *own).collect();
    // A module that uses no remaining module is in no circle, and neither is one that no remaining module uses.
    loop {
        let before = left.len();
        let of = |own: &str| edges.iter().find(|(name, _)| *name == own).map_or(&[][..], |(_, others)| &others[..]);
        let still: Vec<&str> = left
            .iter()
            .copied()
            .filter(|own| of(own).iter().any(|other| left.contains(other)))
            .filter(|own| left.iter().any(|other| other != own && of(other).contains(own)))
            .collect();
        left = still;
        if left.len() == before {
            return left.into_iter().map(str::to_string).collect();
        }
    }
}

#[test]
fn no_modules_use_each_other_in_a_circle() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut faults = Vec::new();
    for folder in folders(root) {
        let inside = folder.to_string_lossy();
        let path = inside.rsplit_once("/src").map_or("", |(_, path)| path.trim_matches('/')).replace('/', "::");
        let mut modules = modules(&folder, &path);
        // The program uses the library by its name.
        modules.retain(|(own, _)| !(path.is_empty() && folder == root.join("src") && own == "cli"));
        let found = circle(&modules);
        if !found.is_empty() {
            faults.push(format!("{inside}: {}", found.join(", ")));
        }
    }
    assert!(faults.is_empty(), "modules that use each other in a circle:\n{}", faults.join("\n"));
}

#[test]
fn the_circle_test_finds_planted_faults() {
    let circle = |texts: [&str; 3]| -> Vec<String> {
        let place = |(name, text): (&str, &str)| (name.into(), from_parent(text, "outer::room", 1));
        circle(&["a", "b", "c"].into_iter().zip(texts).map(place).collect::<Vec<(String, String)>>())
    };
    let right = ["pub struct A;", "use super::a::A;\npub(super) fn b() {}", "use crate::outer::room::{A, b};"];
    assert_eq!(circle(right), [] as [&str; 0]);
    assert_eq!(circle(["use super::c;\npub struct A;", right[1], right[2]]), ["a", "b", "c"]);
    assert_eq!(circle(["use super::b;\npub struct A;", right[1], ""]), ["a", "b"]);
    // Modules with the same names in other folders are other modules.
    assert_eq!(circle(["use crate::room::b;\nuse super::super::b;\npub struct A;", right[1], ""]), [] as [&str; 0]);
}

#[test]
fn paths_of_nested_files_are_resolved() {
    assert_eq!(from_parent("use super::super::x;", "a", 2), "use parent::x;");
    assert_eq!(from_parent("use super::x;", "a", 2), "use elsewhere::x;");
    assert_eq!(from_parent("use crate::a::x; use crate::x;", "a", 2), "use parent::x; use outside::x;");
    assert_eq!(from_parent("use crate::x;", "", 1), "use parent::x;");
}

/// The part of a file that ships: the code before its tests, without comments.
fn shipped(text: &str) -> String {
    let body = text.split("#[cfg(test)]\nmod ").next().unwrap_or("");
    body.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// Unfinished work, and calls that may panic, which shipped lines must not contain. Printing panics if the output is
/// closed.
fn forbidden(text: &str) -> Vec<&'static str> {
    let words = ["todo!(", "unimplemented!(", ".unwrap()", ".unwrap_err()", "dbg!(", "println!(", "eprint!("];
    let code = shipped(text);
    words.into_iter().filter(|word| code.contains(word)).collect()
}

#[test]
fn shipped_code_has_no_unfinished_work_or_panics() {
    let mut faults = Vec::new();
    for file in files("src").into_iter().chain(files("ffi")) {
        let path = file.to_string_lossy().replace('\\', "/");
        // Tests and examples may panic.
        if ["/tests/", "/examples/", "/tests.rs"].iter().any(|place| path.contains(place)) {
            continue;
        }
        let text = fs::read_to_string(&file).expect("it can be read");
        faults.extend(forbidden(&text).into_iter().map(|word| format!("{path}: {word}")));
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn the_scan_finds_planted_faults() {
    assert_eq!(forbidden("fn f() { todo!() }"), ["todo!("]);
    assert_eq!(forbidden("let x = y.unwrap();"), [".unwrap()"]);
    assert_eq!(forbidden("eprintln!();"), ["println!("]);
    assert_eq!(
        forbidden("// never .unwrap()\nfn f() {}\n#[cfg(test)]\nmod tests { fn t() { x.unwrap() } }"),
        [] as [&str; 0]
    );
}

/// Files that may name methods: the table of methods and their passes, the candidates of auto, and defaults of
/// comparisons.
const NAMES_METHODS: [&str; 8] = [
    "src/render/settings/method.rs",
    "src/render/pass/choice.rs",
    "src/render/settings/candidate.rs",
    "src/choose/pilot.rs",
    "src/report/peer_renders.rs",
    "src/cli/converge/reference.rs",
    "src/cli/converge/runs.rs",
    "ffi/python/src/converge.rs",
];

/// The methods that shipped lines of a file name one by one.
fn named_methods(text: &str) -> Vec<&'static str> {
    let code = shipped(text);
    let variant = |name: &str| format!("Method::{}{}", name[..1].to_uppercase(), &name[1..]);
    let ends = |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_');
    let names = |variant: &str| code.match_indices(variant).any(|(at, _)| ends(&code[at + variant.len()..]));
    let mut found: Vec<&str> = Method::ALL.iter().map(|method| method.name()).filter(|n| names(&variant(n))).collect();
    if code.contains("Method as ") || code.contains("Method::*") {
        found.push("another name for Method");
    }
    found
}

/// Only the table of methods names single methods, so that a new method is its pass and one row. Other files ask the
/// row.
#[test]
fn only_the_table_and_choices_name_methods() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut faults = Vec::new();
    for file in files("src").into_iter().chain(files("ffi")) {
        let path = file.strip_prefix(root).expect("it is below the root").to_string_lossy().replace('\\', "/");
        let named = named_methods(&fs::read_to_string(&file).expect("it can be read"));
        if !named.is_empty() && !NAMES_METHODS.contains(&path.as_str()) && !path.contains("/tests") {
            faults.push(format!("{path}: {}", named.join(", ")));
        }
    }
    assert!(faults.is_empty(), "ask the method's row in src/render/settings/method.rs instead:\n{}", faults.join("\n"));
}

#[test]
fn the_scan_for_methods_finds_planted_faults() {
    assert_eq!(named_methods("match m { render::Method::Pm | Method::Vcm => 1 }"), ["pm", "vcm"]);
    assert_eq!(named_methods("use render::Method as M;"), ["another name for Method"]);
    let allowed =
        "// Method::Pm\nlet all = Method::ALL; let other = Method::Pmx;\n#[cfg(test)]\nmod tests { Method::Pm }";
    assert_eq!(named_methods(allowed), [] as [&str; 0]);
}

/// The questions about the operating system in shipped lines of a file.
fn system_questions(text: &str) -> Vec<&'static str> {
    let words =
        ["cfg(unix", "cfg(windows", "not(unix", "not(windows", "target_os", "target_family", "os::unix", "os::windows"];
    let words = words.into_iter().chain(["os::linux", "os::fd", "\"/proc", "\"/sys", "rustix::", "signal_hook"]);
    let code = shipped(text);
    words.filter(|word| code.contains(word)).collect()
}

/// Only `src/system` asks on which system the program runs.
#[test]
fn only_the_system_module_depends_on_the_operating_system() {
    let mut faults = Vec::new();
    for file in files("src") {
        let path = file.to_string_lossy().replace('\\', "/");
        let found = system_questions(&fs::read_to_string(&file).expect("it can be read"));
        if !found.is_empty() && !path.contains("/src/system/") {
            faults.push(format!("{path}: {}", found.join(", ")));
        }
    }
    assert!(faults.is_empty(), "move it to src/system:\n{}", faults.join("\n"));
}

#[test]
fn the_scan_for_systems_finds_planted_faults() {
    assert_eq!(system_questions("#[cfg(windows)]\nuse std::os::windows::fs::X;"), ["cfg(windows", "os::windows"]);
    assert_eq!(system_questions("fs::read(\"/proc/cpuinfo\")"), ["\"/proc"]);
    assert_eq!(system_questions("// /proc\n#[cfg(test)]\nmod tests { use std::os::unix; }"), [] as [&str; 0]);
}
