//! Messages about networks, checkpoints, shards, and answers of the USD converter.

use super::{Said, message};
use crate::support::onnx;
use caustique::combine::network::Network;
use caustique::combine::{Model, Runtime};
use caustique::error::Result;
use caustique::pipeline::checkpoint::{self, Head};
use caustique::pipeline::records::{self, Record};
use caustique::pipeline::shard::{self, ShardFile};
use caustique::render::{MAX_SHARDS, Shard};
use caustique::scene::converter::answer;
use serde_json::json;
use std::fs;
use std::path::Path;
use std::process::Command;

fn refused<T>(outcome: Result<T>) -> Vec<String> {
    vec![message(&outcome.err().expect("it is refused"))]
}

fn networks(said: &mut Said, folder: &Path) {
    said.case("no network", &refused(Model::open("/nowhere/a.onnx")));
    said.case("the paper's network", &refused(Model::open("paper")));
    let runtime = Runtime::find().expect("ONNX Runtime is installed");
    let mut load = |what: &str, bytes: &[u8]| {
        let path = folder.join("a.onnx");
        fs::write(&path, bytes).expect("it can be written");
        let loaded = Network::load(&Model::from_file(&path).expect("it is there"), &runtime, 1);
        said.case(what, &refused(loaded));
    };
    for (what, key, value) in [
        ("a network without levels", "levels", ""),
        ("a network of too many levels", "levels", "99"),
        ("a network of another input", "normalisation", "2"),
        ("a network of another kind", "kind", "odd"),
        ("a network without a centre", "window", "4"),
        ("a network of more levels than its tensors", "levels", "3"),
        ("a network of other pictures", "pairs", "finished"),
        ("a network of a wide dilation", "dilations", "99"),
        ("a network of many dilations", "dilations", "1,1,1,1,1,1,1,1,1,1"),
    ] {
        load(what, &onnx::network("features", &[(key, value)]));
    }
    load("a network of weights with dilations", &onnx::network("weights", &[("dilations", "2")]));
    load("a network of the finish for other planes", &onnx::network("finish", &[("version", "1")]));
    load("a network of the finish of more planes", &onnx::with_planes(28, "finish", &[]));
    load("a network of the finish without a picture", &onnx::network("features", &[("kind", "finish")]));
    let right = onnx::network("features", &[]);
    load("a network without an input", &replaced(right, b"input", b"other"));
    load("a network of a flat tensor", &onnx::flat());
}

/// Replaces a word by another of the same length.
fn replaced(mut bytes: Vec<u8>, word: &[u8], other: &[u8]) -> Vec<u8> {
    for at in 0..bytes.len() - word.len() {
        if bytes[at..].starts_with(word) {
            bytes[at..at + word.len()].copy_from_slice(other);
        }
    }
    bytes
}

/// The header of a state file of a program version.
fn head(version: &str) -> Vec<u8> {
    let head = json!({"version": version, "scene": "", "arguments": {"width": 2}, "way": null, "plan": {}});
    serde_json::to_vec(&head).expect("it is JSON")
}

/// The bytes of records and their end.
fn sealed(contents: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = Vec::new();
    contents.iter().for_each(|content| Record::new(content).write(&mut bytes).expect("memory"));
    records::write_end(&mut bytes).expect("memory");
    bytes
}

fn checkpoints(said: &mut Said, folder: &Path) {
    let path = folder.join("state");
    said.case("no checkpoint", &refused(checkpoint::read(&path)));
    let mut read = |what: &str, bytes: &[u8]| {
        fs::write(&path, bytes).expect("it can be written");
        said.case(what, &refused(checkpoint::read(&path)));
    };
    read("another file as a checkpoint", b"glTF");
    read("a damaged checkpoint", &[&checkpoint::MAGIC[..], b"odd"].concat());
    read("a checkpoint of another version", &[&checkpoint::MAGIC[..], &sealed(&[head("0.0.1")])].concat());
    let own: Head = serde_json::from_slice(&head("0.1.0")).expect("a head");
    said.case("a checkpoint of another scene", &refused(checkpoint::check(&path, &own, Some("x"), &json!({}))));
    let other = json!({"width": 3});
    let refusal = checkpoint::check_replaceable(&path, false, "add --resume");
    said.case("the checkpoint of a render that was not finished", &refused(refusal));
    fs::write(&path, b"glTF").expect("it can be written");
    let refusal = checkpoint::check_replaceable(&path, true, "add --resume");
    said.case("another file where a checkpoint would be saved", &refused(refusal));
    let pipe = folder.join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().is_ok_and(|status| status.success()));
    let refusal = checkpoint::check_replaceable(&pipe, true, "add --resume");
    said.case("a pipe where a checkpoint would be saved", &refused(refusal));
    said.case("a checkpoint of other options", &refused(checkpoint::check(&path, &own, Some(""), &other)));
}

fn shards(said: &mut Said, folder: &Path) {
    let path = folder.join("shard.exr");
    for (what, version) in [("a shard of another version", "0.0.1"), ("a damaged shard", env!("CARGO_PKG_VERSION"))] {
        let tail = sealed(&[head(version), vec![1, 2, 3]]);
        let length = (tail.len() as u64 + 16).to_le_bytes();
        fs::write(&path, [&tail[..], &length, shard::MARK].concat()).expect("it can be written");
        said.case(what, &refused(ShardFile::open(&path)));
    }
}

fn stages(said: &mut Said) {
    let stage = Path::new("a.usda");
    said.case("a converter that says no options", &refused(answer::options(b"odd", stage)));
    said.case("a converter that fails silently", &[message(&answer::failure(b"", stage, "scripts/usd"))]);
    said.case(
        "a converter that fails",
        &[message(&answer::failure(b"Traceback\nKeyError: 'x'\n", stage, "scripts/usd"))],
    );
    let fault = br#"{"prim": "/World/Pool", "fault": "it is odd", "hint": "make it even"}"#;
    said.case("a fault of a stage", &[message(&answer::failure(fault, stage, "scripts/usd"))]);
}

pub fn said() -> String {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let mut said = Said::default();
    networks(&mut said, folder);
    checkpoints(&mut said, folder);
    shards(&mut said, folder);
    stages(&mut said);
    said.0.replace(&folder.display().to_string(), "DIR").replace(env!("CARGO_PKG_VERSION"), "VERSION")
}

#[test]
fn about_what_a_render_leaves() {
    let said = said();
    assert_eq!(super::silent(&said), [] as [&str; 0], "cases of which nothing is said");
    insta::assert_snapshot!("state", said);
}

/// A file may contain impossible shard numbers, which would be counted up to or divided by.
#[test]
fn shards_that_cannot_be() {
    let is_sound = |index, count| Shard { index, count }.is_sound();
    assert!(is_sound(0, 1) && is_sound(MAX_SHARDS - 1, MAX_SHARDS));
    assert!(!is_sound(0, 0) && !is_sound(1, 1) && !is_sound(0, MAX_SHARDS + 1) && !is_sound(0, u64::MAX));
}
