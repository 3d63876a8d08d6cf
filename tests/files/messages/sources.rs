//! Searches the sources of the loaders: each message must occur in some case.

use super::everything_said;
use std::fs;
use std::path::{Path, PathBuf};

/// Source files and folders of the loaders.
const LOADERS: [&str; 10] = [
    "src/scene/gltf",
    "src/scene/folder.rs",
    "src/scene/environment_file.rs",
    "src/scene/usd/mod.rs",
    "src/scene/converter",
    "src/image/exr/read.rs",
    "src/combine/model.rs",
    "src/combine/network.rs",
    "src/pipeline/checkpoint.rs",
    "src/pipeline/shard.rs",
];

/// Texts that no case can produce, and the reason.
const UNSAID: [(&str, &[&str]); 7] = [
    (
        "there is memory enough where tests run",
        &[
            "render fewer or simpler meshes, or with more memory",
            "{placed} placed meshes",
            "place fewer copies, join them into one mesh, or render with more memory",
            "save the image smaller, or render with more memory",
            "files that the scene names",
            "name each file once, or render with more memory",
            "its texels",
            "decompressed data",
            "its pixels",
            "meshes on nodes whose scale is zero along an axis",
        ],
    ),
    (
        "another check, of the crate that is used, comes before it",
        &[
            "its weights",
            "its {key} is not {N} numbers",
            "it has no texels",
            "its texels are neither of 8 nor of 16 bits",
            "its texels are not of 8 bits",
            "the display window has no pixels",
            "part index",
            "the file is deep",
            "the file has subsampled channels",
            "the file ends too early",
            "copy or render it again; it is not whole",
            "no part",
            "an attribute is damaged",
            "the output is missing",
            "the output has shape {shape:?} instead of {expected:?}",
        ],
    ),
    (
        "decoders have no fault that is known",
        &[
            "it cannot be decoded: the decoder failed",
            "the decoder takes more than {seconds} s",
            "the decoder asks for more than {} MiB",
            "no process for its decoder can be started: {error}",
            "the decoder failed",
            "the file contradicts itself",
            "its size contradicts its header",
        ],
    ),
    (
        "it is about a file beside the scene",
        &[
            "medium.density must be a grid of one channel",
            "its angles times {scale} leave no light",
            "give another angle_scale",
        ],
    ),
    ("no mesh has a rim of one edge", &["edge has one face only"]),
    (
        "tests/python/usd_render.py says it, by a variable of the environment or a signal",
        &[
            "{} is no number of seconds",
            "give a whole number from 1 to 2000000, or none",
            "interrupted while the scene was read",
        ],
    ),
    (
        "they are no messages",
        &[
            "caustique checkpoint 7n",
            "caustique checkpoint ",
            "file identifier missing",
            "not said",
            "default material",
            "xabKTX 20xbbrnx1an",
        ],
    ),
];

/// The source files of the loaders.
fn files() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let of = |name: &str| -> Vec<PathBuf> {
        let path = root.join(name);
        match fs::read_dir(&path) {
            Ok(entries) => entries.map(|entry| entry.expect("an entry").path()).collect(),
            Err(_) => vec![path],
        }
    };
    LOADERS.into_iter().flat_map(of).collect()
}

/// The string literals of a source without tests and comments, unescaped.
fn texts(source: &str) -> Vec<String> {
    let shipped = source.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
    let mut found = Vec::new();
    let mut at = shipped.char_indices().peekable();
    while let Some((i, c)) = at.next() {
        if c == '/' && shipped[i..].starts_with("//") {
            while at.next_if(|(_, c)| *c != '\n').is_some() {}
        } else if c == '\'' && (shipped[i..].starts_with("'\"'") || shipped[i..].starts_with("'\\")) {
            // A character literal, which may be a quotation mark.
            at.by_ref().skip(1).find(|(_, c)| *c == '\'');
        } else if c == '"' {
            let mut text = String::new();
            while let Some((_, c)) = at.next().filter(|(_, c)| *c != '"') {
                match (c, at.peek().map(|(_, next)| *next)) {
                    ('\\', Some('\n')) => while at.next_if(|(_, c)| c.is_whitespace()).is_some() {},
                    ('\\', Some(next)) => {
                        text.push(next);
                        at.next();
                    }
                    (c, _) => text.push(c),
                }
            }
            found.push(text);
        }
    }
    found
}

/// The fixed parts of a format string.
fn fixed(text: &str) -> Vec<&str> {
    let parts = text.split('{').enumerate();
    parts.map(|(i, part)| if i == 0 { part } else { part.split_once('}').map_or(part, |(_, rest)| rest) }).collect()
}

/// Whether a text is a message: it has more than one word, and is not the place of an error.
fn is_message(text: &str) -> bool {
    let words = fixed(text).join(" ");
    let words = words.split_whitespace().filter(|word| word.chars().filter(|c| c.is_alphabetic()).count() > 1);
    words.count() > 1
}

/// Whether a line contains the fixed parts of a text in order.
fn is_said(text: &str, line: &str) -> bool {
    let mut rest = Some(line);
    for part in fixed(text) {
        rest = rest.and_then(|rest| rest.find(part).map(|at| &rest[at + part.len()..]));
    }
    rest.is_some()
}

/// Messages of a source that no case produces.
fn unsaid(source: &str, said: &str) -> Vec<String> {
    // Titles of cases do not count as messages.
    let lines: Vec<&str> = said.lines().filter(|line| !line.starts_with("# ")).collect();
    let missing = |text: &String| is_message(text) && !lines.iter().any(|line| is_said(text, line));
    texts(source).into_iter().filter(missing).collect()
}

#[test]
fn every_message_is_said_in_some_case() {
    let said = everything_said();
    let excepted: Vec<&str> = UNSAID.iter().flat_map(|(_, texts)| *texts).copied().collect();
    let mut faults = Vec::new();
    let mut used = Vec::new();
    for file in files() {
        for text in unsaid(&fs::read_to_string(&file).expect("it can be read"), &said) {
            match excepted.contains(&&*text) {
                true => used.push(text),
                false => faults.push(format!("{}: {text}", file.display())),
            }
        }
    }
    assert!(faults.is_empty(), "messages without a case:\n{}", faults.join("\n"));
    let idle: Vec<_> = excepted.iter().filter(|text| !used.iter().any(|used| used == *text)).collect();
    assert!(idle.is_empty(), "exceptions that are none: {idle:?}");
}

#[test]
fn a_message_without_a_case_is_found() {
    let source = r#"fn f() { fault(place, format!("its {kind} is odd")) } // "not this one"
        #[cfg(test)]
mod tests { fn f() { g("nor that one"); } }"#;
    assert_eq!(unsaid(source, "a.glb: it is fine"), ["its {kind} is odd"]);
    assert_eq!(unsaid(source, "a.glb: its head is odd"), [] as [&str; 0]);
}
