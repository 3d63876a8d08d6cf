//! A glTF document in parts with types, its raw JSON beside them for extensions and extras.

use super::container::{self, malformed};
use super::{fault, uri};
use crate::error::Result;
use crate::memory;
use crate::scene::folder::Folder;
use gltf::json;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use std::borrow::Cow;
use std::cell::Cell;
use std::fmt::Display;

/// The most elements that a file may have without data. An accessor without a buffer view has such elements, most of which
/// a sparse accessor is meant to replace.
const MAX_ZEROS: u64 = 1 << 20;

/// A parsed document. Indices in it are not checked yet: `get` does that.
pub(super) struct Document<'a> {
    pub(super) raw: Value,
    pub(super) folder: Folder<'a>,
    pub(super) accessors: Vec<json::Accessor>,
    pub(super) views: Vec<json::buffer::View>,
    pub(super) meshes: Vec<json::Mesh>,
    pub(super) nodes: Vec<json::Node>,
    pub(super) scenes: Vec<json::Scene>,
    pub(super) cameras: Vec<json::Camera>,
    pub(super) images: Vec<json::Image>,
    pub(super) textures: Vec<json::Texture>,
    pub(super) samplers: Vec<json::texture::Sampler>,
    /// Number of further elements that the file may have without data.
    pub(super) zeros_left: Cell<u64>,
    /// Bytes that were taken since memory was last asked for.
    unasked: Cell<u64>,
    buffers: Vec<Cow<'a, [u8]>>,
}

impl<'a> Document<'a> {
    /// Blender's exporter wrote it, perhaps with more from ours: the world is left out.
    pub(super) fn is_by_blender(&self) -> bool {
        self.blender_version().is_some()
    }

    /// First two numbers of the version of Blender's exporter, if it wrote the file; the newest if it does not say one.
    pub(super) fn blender_version(&self) -> Option<[u32; 2]> {
        let version = self.raw["asset"]["generator"].as_str()?.strip_prefix("Khronos glTF Blender I/O")?;
        let mut numbers = version.trim_start().trim_start_matches('v').split('.').map(|n| n.parse().ok());
        Some([numbers.next().flatten().unwrap_or(u32::MAX), numbers.next().flatten().unwrap_or(0)])
    }

    /// Parses a file and loads its buffers; other files are looked for in `folder`.
    pub(super) fn parse(bytes: &'a [u8], folder: Folder<'a>, warnings: &mut Vec<String>) -> Result<Document<'a>> {
        let (mut raw, binary) = container::split(bytes)?;
        container::check(&raw, warnings)?;
        // A scene without nodes is valid glTF; the crate wants the list.
        for scene in raw.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
            if let Some(scene) = scene.as_object_mut() {
                scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
            }
        }
        let described = parts::<json::Buffer>(&raw, "buffers")?;
        let mut document = Document {
            accessors: parts(&raw, "accessors")?,
            views: parts(&raw, "bufferViews")?,
            meshes: parts(&raw, "meshes")?,
            nodes: parts(&raw, "nodes")?,
            scenes: parts(&raw, "scenes")?,
            cameras: parts(&raw, "cameras")?,
            images: parts(&raw, "images")?,
            textures: parts(&raw, "textures")?,
            samplers: parts(&raw, "samplers")?,
            raw,
            folder,
            zeros_left: Cell::new(MAX_ZEROS),
            unasked: Cell::new(0),
            buffers: Vec::new(),
        };
        document.buffers = document.load_buffers(&described, binary)?;
        Ok(document)
    }

    /// Counts bytes that are about to be taken for `what`, and asks whether there are so many once they are many: a file
    /// of many parts can name the same data in all of them.
    pub(super) fn take(&self, bytes: u64, what: impl Display) -> Result<()> {
        let unasked = self.unasked.get().saturating_add(bytes);
        self.unasked.set(unasked);
        if unasked < memory::MIN_CHECKED_BYTES {
            return Ok(());
        }
        self.unasked.set(0);
        memory::require(unasked, what)
    }

    fn load_buffers(&self, list: &[json::Buffer], binary: &'a [u8]) -> Result<Vec<Cow<'a, [u8]>>> {
        let load = |(i, buffer): (usize, &json::Buffer)| {
            let place = at("buffer", i);
            let bytes = match &buffer.uri {
                Some(uri) => Cow::Owned(self.bytes_of(uri).map_err(|e| e.within(&place))?),
                None if i == 0 => Cow::Borrowed(binary),
                None => Cow::Borrowed(&[][..]),
            };
            let (promised, there) = (buffer.byte_length.0, bytes.len());
            if promised > there as u64 {
                if let Some(error) = container::compressed(&self.raw["buffers"][i]) {
                    return Err(error.within(place));
                }
                return Err(fault(place, format!("{promised} bytes are promised, {there} are there"))
                    .hint("the file is damaged or incomplete: copy or export it again"));
            }
            Ok(bytes)
        };
        list.iter().enumerate().map(load).collect()
    }

    /// The bytes that a URI stands for.
    pub(super) fn bytes_of(&self, uri: &str) -> Result<Vec<u8>> {
        uri::load(uri, self.folder, |bytes| {
            let error = self.take(bytes, "files that the scene names");
            error.map_err(|e| e.hint("name each file once, or render with more memory"))
        })
    }

    /// Index of the scene that is shown.
    pub(super) fn default_scene(&self) -> Result<usize> {
        let Some(value) = self.raw.get("scene") else { return Ok(0) };
        let index = value.as_u64().and_then(|i| usize::try_from(i).ok());
        let index = index.ok_or_else(|| fault("scene", "the default scene is not an index"))?;
        get(&self.scenes, index, "scene").map(|_| index)
    }

    /// Reads what may have been moved in the raw JSON.
    pub(super) fn read_again(&mut self) -> Result<()> {
        self.nodes = parts(&self.raw, "nodes")?;
        self.cameras = parts(&self.raw, "cameras")?;
        Ok(())
    }

    /// The raw JSON of part `index` of a list of the document; `null` if there is none.
    pub(super) fn part(&self, list: &str, index: usize) -> &Value {
        &self.raw[list][index]
    }

    /// The bytes of a buffer view.
    pub(super) fn view(&self, index: usize) -> Result<&[u8]> {
        let view = get(&self.views, index, "buffer view")?;
        let buffer =
            get(&self.buffers, view.buffer.value(), "buffer").map_err(|e| e.within(at("buffer view", index)))?;
        let start = view.byte_offset.unwrap_or_default().0;
        let end = start.checked_add(view.byte_length.0);
        let range = end.and_then(|end| Some(usize::try_from(start).ok()?..usize::try_from(end).ok()?));
        range.and_then(|range| buffer.get(range)).ok_or_else(|| {
            let (length, have) = (view.byte_length.0, buffer.len());
            fault(
                at("buffer view", index),
                format!("{length} bytes from byte {start} run past the {have} of buffer {}", view.buffer.value()),
            )
            .hint("the file is damaged: export it again")
        })
    }
}

/// `accessor 12`.
pub(super) fn at(kind: &str, index: usize) -> String {
    format!("{kind} {index}")
}

/// `mesh "water"`, or `mesh 3` without a name.
pub(super) fn named(kind: &str, name: Option<&str>, index: usize) -> String {
    match name.filter(|name| !name.is_empty()) {
        Some(name) => format!("{kind} \"{name}\""),
        None => at(kind, index),
    }
}

/// The item at `index`.
pub(super) fn get<'l, T>(list: &'l [T], index: usize, kind: &str) -> Result<&'l T> {
    list.get(index).ok_or_else(|| {
        let cause = match list.len() {
            0 => format!("{kind} {index} does not exist: the file has none"),
            n => format!("{kind} {index} does not exist: the last one is {}", n - 1),
        };
        fault("", cause).hint("the file is damaged: export it again")
    })
}

/// An extension of a part of the document, and its type.
pub(super) fn extension<T: DeserializeOwned>(part: &Value, name: &str, place: impl Display) -> Result<Option<T>> {
    match part.get("extensions").and_then(|e| e.get(name)) {
        None => Ok(None),
        Some(value) => T::deserialize(value).map(Some).map_err(|e| malformed(format!("{place}, {name}"), &e)),
    }
}

/// The parts in a list of the document.
fn parts<T: DeserializeOwned>(raw: &Value, list: &str) -> Result<Vec<T>> {
    let items = match raw.get(list) {
        None => return Ok(Vec::new()),
        Some(Value::Array(items)) => items,
        Some(_) => return Err(fault(list, "it is not a list").hint("the file is damaged: export it again")),
    };
    let part = |(i, item)| {
        let place = format!("{list}[{i}]");
        let core = core(item, &place)?;
        serde_json::from_value(core).map_err(|e| malformed(&place, &e))
    };
    items.iter().enumerate().map(part).collect()
}

/// Keys whose numbers are 64-bit integers, or floats.
const WIDE: [&str; 16] = [
    "count",
    "byteLength",
    "byteOffset",
    "min",
    "max",
    "matrix",
    "rotation",
    "scale",
    "translation",
    "weights",
    "yfov",
    "aspectRatio",
    "znear",
    "zfar",
    "xmag",
    "ymag",
];

/// A part without its extensions and extras, which the crate cannot parse in every place where they may stand; and
/// without numbers that the crate would cut down to 32 bits.
fn core(value: &Value, place: &str) -> Result<Value> {
    let wide = |key: &str| WIDE.contains(&key);
    Ok(match value {
        Value::Object(object) => {
            let mut kept = Map::new();
            for (key, item) in object {
                match key.as_str() {
                    "extensions" | "extras" => {}
                    key if wide(key) => drop(kept.insert(key.into(), item.clone())),
                    key => drop(kept.insert(key.into(), core(item, place)?)),
                }
            }
            Value::Object(kept)
        }
        Value::Array(list) => Value::Array(list.iter().map(|item| core(item, place)).collect::<Result<_>>()?),
        Value::Number(number) if number.as_u64().is_some_and(|n| n > u64::from(u32::MAX)) => {
            return Err(
                fault(place, format!("the number {number} is too large")).hint("the file is damaged: export it again")
            );
        }
        other => other.clone(),
    })
}
