//! The order of modules in `src/lib.rs`, and habits that no file may leave.

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
