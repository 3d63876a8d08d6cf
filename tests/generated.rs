//! Compares generated files with the tables of the program that they are made from. `CAUSTIQUE_WRITE=1 cargo test
//! --release --test generated` writes them.

use caustique::estimator::QUARTERS;
use caustique::film::cryptomatte::RANKS;
use caustique::film::kind::{LAYERS, LayerKind, Suffix};
use caustique::film::{describe, finished_part, part_names};
use caustique::limits::{LIMITS, Limit};
use caustique::render::Method;
use caustique::transport::MAX_LEVELS;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// Compares a file with its expected content, or writes it.
fn compare(path: &str, expected: &str) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    if std::env::var_os("CAUSTIQUE_WRITE").is_some() {
        fs::write(&file, expected).expect("the file can be written");
    }
    let found = fs::read_to_string(&file).expect("the file can be read");
    assert!(
        found == expected,
        "{path} is not what its table gives: CAUSTIQUE_WRITE=1 cargo test --release --test generated"
    );
}

/// Compares the part of a page between `<!-- NAME -->` and `<!-- end of NAME -->`, or writes it.
fn compare_part(path: &str, name: &str, expected: &str) {
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).expect("the page can be read");
    let [begin, end] = [format!("<!-- {name} -->\n\n"), format!("\n<!-- end of {name} -->\n")];
    let (before, rest) = page.split_once(&begin).expect("the part begins");
    let (_, after) = rest.split_once(&end).expect("the part ends");
    compare(path, &format!("{before}{begin}{expected}{end}{after}"));
}

/// Names of the layers of a kind, with `NAME` for the name of a light group.
fn names(kind: &LayerKind, beginning: &str) -> Vec<String> {
    let numbers: Vec<String> = match kind.suffix {
        Suffix::None => vec![String::new()],
        Suffix::Level => (1..=MAX_LEVELS).map(|n| n.to_string()).collect(),
        Suffix::Quarter => (1..=QUARTERS).map(|n| n.to_string()).collect(),
        Suffix::Ranks => (0..RANKS / 2).map(|n| format!("{n:02}")).collect(),
        Suffix::Group => vec!["NAME".into()],
    };
    numbers.iter().map(|number| format!("{beginning}{number}")).collect()
}

/// The properties of layers that Blender's add-on and the USD converter use.
fn layers() -> Value {
    let of_group = |kind: &&LayerKind| kind.suffix == Suffix::Group;
    let part =
        |name: String| json!({"name": &name, "components": "RGB", "layer": &name, "switch": "parts", "always": false});
    let pass = |kind: &LayerKind| {
        let Some(switch) = kind.switch.filter(|_| kind.suffix != Suffix::Group) else { return vec![] };
        // Not every scene has all finished parts, and not every method all levels.
        let always = kind.suffix != Suffix::Level && kind.finished().is_none();
        let entry = |name: String| {
            // All ranks of a cryptomatte are selected together.
            let layer = if kind.suffix == Suffix::Ranks { kind.name } else { &name };
            let pass = kind.blender.unwrap_or(&name);
            json!({"name": pass, "components": kind.components, "layer": layer, "switch": switch, "always": always})
        };
        names(kind, kind.name).into_iter().map(entry).collect()
    };
    let passes = part_names().filter_map(finished_part).map(part).chain(LAYERS.iter().flat_map(pass));
    let alone = |kind: &&LayerKind| matches!(kind.suffix, Suffix::None | Suffix::Ranks) && !kind.name.is_empty();
    let finished = part_names().filter_map(finished_part);
    let names = finished.chain(LAYERS.iter().filter(alone).map(|kind| kind.name.into()));
    json!({
        "passes": passes.collect::<Vec<_>>(),
        "parts": part_names().collect::<Vec<_>>(),
        "groups": LAYERS.iter().filter(of_group).map(|kind| kind.name).collect::<Vec<_>>(),
        "layers": names.collect::<Vec<String>>(),
        "on_request": LAYERS.iter().filter(|kind| kind.on_request).map(|kind| kind.name).collect::<Vec<_>>(),
    })
}

#[test]
fn python_knows_all_layers() {
    let text = format!("{:#}\n", layers());
    compare("scripts/blender/caustique_addon/layers.json", &text);
    compare("scripts/usd/layers.json", &text);
}

#[test]
fn scripts_know_all_methods() {
    let method = |method: &Method| json!({"name": method.name(), "photons": method.takes_photon_count()});
    let all: Vec<Value> = Method::ALL.iter().map(method).collect();
    compare("tests/methods.json", &format!("{:#}\n", Value::from(all)));
}

/// A row of the page's table.
fn row(names: &[String], of: &str) -> String {
    let known = describe(of).expect("it is in the table");
    let shown: Vec<String> = match names {
        [first, .., last] => vec![format!("`{first}` ... `{last}`")],
        [name] if name.is_empty() => vec!["(root)".into()],
        all => all.iter().map(|name| format!("`{name}`")).collect(),
    };
    let components: Vec<String> = known.components.chars().map(String::from).collect();
    let unit = known.unit.replace("^2", "²");
    format!("| {} | `{}` | {unit} | {} |\n", shown.concat(), components.join(" "), known.meaning)
}

#[test]
fn the_page_for_compositors_lists_all_layers() {
    let mut text = String::from("| layer | components | unit | meaning |\n| --- | --- | --- | --- |\n");
    for kind in LAYERS {
        text += &row(&names(kind, kind.name), kind.name);
        if let Some(finished) = kind.finished() {
            text += &row(&names(kind, &finished), &finished);
        }
    }
    compare_part("docs/compositors.md", "layers", &text);
}

/// The items of a list, wrapped to lines of at most 120 characters.
fn list<'a>(limits: impl Iterator<Item = &'a Limit>, of_pages: &str) -> String {
    let item = |limit: &Limit| {
        let mut lines = vec![String::from("-")];
        for word in limit.sentence.replace("](", &format!("]({of_pages}")).split(' ') {
            if lines.last().is_some_and(|line| line.len() + word.len() >= 120) {
                lines.push(String::from(" "));
            }
            lines.last_mut().into_iter().for_each(|line| *line += &format!(" {word}"));
        }
        lines.join("\n") + "\n"
    };
    limits.map(item).collect()
}

#[test]
fn the_readme_and_the_guide_list_the_limits() {
    compare_part("README.md", "limits", &list(LIMITS.iter().filter(|limit| limit.in_readme), "docs/"));
    compare_part("docs/guide.md", "limits", &list(LIMITS.iter(), ""));
}
