//! The order of modules in `src/lib.rs`, and habits that no file may leave.

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

/// What breaks the order: module `own` uses one that is not above it.
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
        // The program uses the library from outside: all of it is above.
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

/// The modules of a room below `src`, each with its text, but for what is in the room's `mod.rs`; those in folders of
/// their own count as one.
fn room(root: &Path, name: &str) -> Vec<(String, String)> {
    let mut modules: HashMap<String, String> = HashMap::new();
    for file in files(&format!("src/{name}")) {
        let inside = file.strip_prefix(root.join("src").join(name)).expect("it is below the room");
        let own = inside.components().next().expect("it has a name").as_os_str().to_string_lossy().replace(".rs", "");
        if own != "mod" && own != "tests" {
            *modules.entry(own).or_default() += &shipped(&fs::read_to_string(&file).expect("it can be read"));
        }
    }
    let mut modules: Vec<(String, String)> = modules.into_iter().collect();
    modules.sort();
    modules
}

/// Names that a module gives to others of its room.
fn given(text: &str) -> Vec<String> {
    let kinds = ["fn ", "const fn ", "struct ", "enum ", "trait ", "type ", "const ", "static "];
    let name = |line: &str| {
        let line = line.strip_prefix("pub")?;
        let line = line.strip_prefix("(super)").unwrap_or(line).trim_start();
        let rest = kinds.iter().rev().find_map(|kind| line.strip_prefix(kind))?;
        Some(rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>())
    };
    text.lines().filter_map(name).filter(|name| !name.is_empty()).collect()
}

/// The modules of a room that use each other in a circle.
fn circle(room: &str, modules: &[(String, String)]) -> Vec<String> {
    let mut home: HashMap<String, &str> = HashMap::new();
    for (own, text) in modules {
        for name in given(text) {
            home.entry(name).or_insert(own);
        }
        home.insert(own.clone(), own);
    }
    let uses = |(own, text): &(String, String)| -> Vec<&str> {
        // Other rooms may have modules of the same names.
        let text = text.replace(&format!("crate::{room}::"), "super::").replace("crate::", "other::");
        let named = used(&text.replace("super::super::", "super::").replace("super::", "crate::"));
        named.iter().filter_map(|name| home.get(name).copied()).filter(|other| other != own).collect()
    };
    let edges: Vec<(&str, Vec<&str>)> = modules.iter().map(|module| (module.0.as_str(), uses(module))).collect();
    let mut left: Vec<&str> = edges.iter().map(|(own, _)| *own).collect();
    // What uses nothing that is left is in no circle, and neither is what nothing left uses.
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
fn no_room_is_a_circle() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let lib = fs::read_to_string(root.join("src/lib.rs")).expect("src/lib.rs can be read");
    let mut faults = Vec::new();
    for name in order(&lib).keys().filter(|name| root.join("src").join(name).is_dir()) {
        let found = circle(name, &room(root, name));
        if !found.is_empty() {
            faults.push(format!("{name}: {}", found.join(", ")));
        }
    }
    assert!(faults.is_empty(), "files that use each other in a circle:\n{}", faults.join("\n"));
}

#[test]
fn the_circle_test_finds_planted_faults() {
    let modules = |texts: [&str; 3]| -> Vec<(String, String)> {
        ["a", "b", "c"].into_iter().zip(texts).map(|(name, text)| (name.into(), text.into())).collect()
    };
    let right = ["pub struct A;", "use super::a::A;\npub(super) fn b() {}", "use crate::room::{A, b};"];
    assert_eq!(circle("room", &modules(right)), [] as [&str; 0]);
    let wrong = ["use super::c;\npub struct A;", right[1], right[2]];
    assert_eq!(circle("room", &modules(wrong)), ["a", "b", "c"]);
    let by_item = ["use super::b;\npub struct A;", right[1], ""];
    assert_eq!(circle("room", &modules(by_item)), ["a", "b"]);
}

/// The part of a file that ships: what stands before its tests, without comments.
fn shipped(text: &str) -> String {
    let body = text.split("#[cfg(test)]\nmod ").next().unwrap_or("");
    body.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// Unfinished work and panics that no shipped line may hold; printing that panics when nobody listens is one.
fn forbidden(text: &str) -> Vec<&'static str> {
    let words = ["todo!(", "unimplemented!(", ".unwrap()", ".unwrap_err()", "dbg!(", "println!(", "eprint!("];
    let code = shipped(text);
    words.into_iter().filter(|word| code.contains(word)).collect()
}

#[test]
fn nothing_is_left_undone_or_unwrapped() {
    let mut faults = Vec::new();
    for file in files("src").into_iter().chain(files("ffi")) {
        let path = file.to_string_lossy().replace('\\', "/");
        // Tests, and programs that show how the binding is used, may end where they stand.
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

/// Files that name methods: the table of methods and their passes, what auto chooses from, and defaults of comparisons.
const NAMES_METHODS: [&str; 8] = [
    "src/render/method.rs",
    "src/render/choice.rs",
    "src/render/strategy.rs",
    "src/render/auto/pilot.rs",
    "src/report/guests.rs",
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

/// A method is its pass and one row of a table: other files ask the row, so that a new method does not touch them.
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
    assert!(faults.is_empty(), "ask the method's row in src/render/method.rs instead:\n{}", faults.join("\n"));
}

#[test]
fn the_scan_for_methods_finds_planted_faults() {
    assert_eq!(named_methods("match m { render::Method::Pm | Method::Vcm => 1 }"), ["pm", "vcm"]);
    assert_eq!(named_methods("use render::Method as M;"), ["another name for Method"]);
    let allowed =
        "// Method::Pm\nlet all = Method::ALL; let other = Method::Pmx;\n#[cfg(test)]\nmod tests { Method::Pm }";
    assert_eq!(named_methods(allowed), [] as [&str; 0]);
}
