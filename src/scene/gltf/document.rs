//! A glTF document: its parts as typed lists, and its raw JSON for extensions and extras.

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
use std::collections::HashMap;
use std::fmt::Display;

/// Maximum number of elements without data in a file. Accessors without a buffer view have them; they are zero unless a
/// sparse accessor replaces them.
const MAX_ZEROS: u64 = 1 << 20;

/// A parsed document. `get` checks indices when they are used.
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
    /// Index of the scene that the user chooses; `None`: the default scene.
    pub(super) chosen_scene: Option<usize>,
    /// The animations that move the nodes.
    pub(super) playing: Playing,
    /// Number of accessor elements without data, which count as zeros, that the file may still declare.
    pub(super) zeros_left: Cell<u64>,
    /// Bytes that were allocated since free memory was last checked.
    unchecked_bytes: Cell<u64>,
    buffers: Vec<Cow<'a, [u8]>>,
    /// Data of the buffer views that were compressed, by the index of the view.
    pub(super) decoded: HashMap<usize, Vec<u8>>,
}

/// The animations of a document that move its nodes.
#[derive(Clone, Copy)]
pub(super) enum Playing {
    All,
    None,
    /// The animation with this index.
    One(usize),
}

impl Playing {
    /// Whether the animation with this index moves the nodes.
    pub(super) fn plays(self, index: usize) -> bool {
        match self {
            Playing::All => true,
            Playing::None => false,
            Playing::One(one) => one == index,
        }
    }
}

impl<'a> Document<'a> {
    /// Whether Blender's exporter wrote the file, which does not export the world. Our own exporter uses it, too.
    pub(super) fn is_by_blender(&self) -> bool {
        self.blender_version().is_some()
    }

    /// Major and minor version of Blender's exporter, if it wrote the file. A missing version counts as the newest.
    pub(super) fn blender_version(&self) -> Option<[u32; 2]> {
        let version = self.raw["asset"]["generator"].as_str()?.strip_prefix("Khronos glTF Blender I/O")?;
        let mut numbers = version.trim_start().trim_start_matches('v').split('.').map(|n| n.parse().ok());
        Some([numbers.next().flatten().unwrap_or(u32::MAX), numbers.next().flatten().unwrap_or(0)])
    }

    /// Parses a file and loads its buffers from `folder`.
    pub(super) fn parse(bytes: &'a [u8], folder: Folder<'a>, warnings: &mut Vec<String>) -> Result<Document<'a>> {
        let (mut raw, binary) = container::split(bytes)?;
        container::check(&raw, warnings)?;
        // A scene without nodes is valid glTF, but the crate requires the list.
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
            chosen_scene: None,
            playing: Playing::All,
            zeros_left: Cell::new(MAX_ZEROS),
            unchecked_bytes: Cell::new(0),
            buffers: Vec::new(),
            decoded: HashMap::new(),
        };
        document.buffers = document.load_buffers(&described, binary)?;
        Ok(document)
    }

    /// Counts bytes that are about to be allocated for `what`, and checks free memory whenever the count gets large. A
    /// small file can use the same data in many parts, so each allocation alone may be small.
    pub(super) fn count_bytes(&self, bytes: u64, what: impl Display) -> Result<()> {
        let unchecked = self.unchecked_bytes.get().saturating_add(bytes);
        self.unchecked_bytes.set(unchecked);
        if unchecked < memory::MIN_CHECKED_BYTES {
            return Ok(());
        }
        self.unchecked_bytes.set(0);
        memory::require(unchecked, what)
    }

    fn load_buffers(&self, list: &[json::Buffer], binary: &'a [u8]) -> Result<Vec<Cow<'a, [u8]>>> {
        let load = |(i, buffer): (usize, &json::Buffer)| {
            let place = at("buffer", i);
            let bytes = match &buffer.uri {
                Some(uri) => Cow::Owned(self.bytes_of(uri).map_err(|e| e.within(&place))?),
                // The data of its views are elsewhere, and compressed.
                None if container::is_fallback(&self.raw["buffers"][i]) => return Ok(Cow::Borrowed(&[][..])),
                None if i == 0 => Cow::Borrowed(binary),
                None => Cow::Borrowed(&[][..]),
            };
            let (promised, there) = (buffer.byte_length.0, bytes.len());
            if promised > there as u64 {
                if let Some(error) = container::compression_error(&self.raw["buffers"][i]) {
                    return Err(error.within(place));
                }
                return Err(fault(place, format!("{promised} bytes are promised, {there} are there"))
                    .hint("the file is damaged or incomplete: copy or export it again"));
            }
            Ok(bytes)
        };
        list.iter().enumerate().map(load).collect()
    }

    /// The bytes that a URI of the document names: in the URI itself, or in a file.
    pub(super) fn bytes_of(&self, uri: &str) -> Result<Vec<u8>> {
        uri::load(uri, self.folder, |bytes| {
            let error = self.count_bytes(bytes, "files that the scene names");
            error.map_err(|e| e.hint("name each file once, or render with more memory"))
        })
    }

    /// Index of the scene to read: the chosen one, or the document's default scene.
    pub(super) fn scene_index(&self) -> Result<usize> {
        if let Some(chosen) = self.chosen_scene {
            return Ok(chosen);
        }
        let Some(value) = self.raw.get("scene") else { return Ok(0) };
        let index = value.as_u64().and_then(|i| usize::try_from(i).ok());
        let index = index.ok_or_else(|| fault("scene", "the default scene is not an index"))?;
        get(&self.scenes, index, "scene").map(|_| index)
    }

    /// Parses the nodes and cameras again, after an animation has changed the raw JSON.
    pub(super) fn reparse_animated(&mut self) -> Result<()> {
        self.nodes = parts(&self.raw, "nodes")?;
        self.cameras = parts(&self.raw, "cameras")?;
        Ok(())
    }

    /// Raw JSON of the item at `index` in the document's list `list`; `null` if there is none.
    pub(super) fn part(&self, list: &str, index: usize) -> &Value {
        &self.raw[list][index]
    }

    /// The bytes of the buffer view with this index.
    pub(super) fn view(&self, index: usize) -> Result<&[u8]> {
        if let Some(bytes) = self.decoded.get(&index) {
            return Ok(bytes);
        }
        let view = get(&self.views, index, "buffer view")?;
        let start = view.byte_offset.unwrap_or_default().0;
        self.buffer_range(view.buffer.value(), start, view.byte_length.0)
            .map_err(|e| e.within(at("buffer view", index)))
    }

    /// `length` bytes of a buffer from byte `start`.
    pub(super) fn buffer_range(&self, buffer: usize, start: u64, length: u64) -> Result<&[u8]> {
        let bytes = get(&self.buffers, buffer, "buffer")?;
        let end = start.checked_add(length);
        let range = end.and_then(|end| Some(usize::try_from(start).ok()?..usize::try_from(end).ok()?));
        range.and_then(|range| bytes.get(range)).ok_or_else(|| {
            let have = bytes.len();
            fault("", format!("{length} bytes from byte {start} run past the {have} of buffer {buffer}"))
                .hint("the file is damaged: export it again")
        })
    }
}

/// A place for error messages, from the kind of an item and its index: `accessor 12`.
pub(super) fn at(kind: &str, index: usize) -> String {
    format!("{kind} {index}")
}

/// A place for error messages, from the kind of an item and its name: `mesh "water"`, or `mesh 3` without a name.
pub(super) fn named(kind: &str, name: Option<&str>, index: usize) -> String {
    match name.filter(|name| !name.is_empty()) {
        Some(name) => format!("{kind} \"{name}\""),
        None => at(kind, index),
    }
}

/// The item at `index` of a list of the document; an error if there is none. `kind` names the item in the error.
pub(super) fn get<'l, T>(list: &'l [T], index: usize, kind: &str) -> Result<&'l T> {
    list.get(index).ok_or_else(|| {
        let cause = match list.len() {
            0 => format!("{kind} {index} does not exist: the file has none"),
            n => format!("{kind} {index} does not exist: the last one is {}", n - 1),
        };
        fault("", cause).hint("the file is damaged: export it again")
    })
}

/// Parses the extension `name` of a part of the document, if there is one.
pub(super) fn extension<T: DeserializeOwned>(part: &Value, name: &str, place: impl Display) -> Result<Option<T>> {
    match part.get("extensions").and_then(|e| e.get(name)) {
        None => Ok(None),
        Some(value) => T::deserialize(value).map(Some).map_err(|e| malformed(format!("{place}, {name}"), &e)),
    }
}

/// Parses all items of the document's list `list`; an absent list is empty.
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

/// Names of the keys in glTF whose values are integers of 64 bits or floats.
const WIDE_KEYS: [&str; 16] = [
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

/// A part of the document without extensions and extras, which the `gltf` crate cannot parse everywhere. Rejects
/// integers that the crate would truncate to 32 bits.
fn core(value: &Value, place: &str) -> Result<Value> {
    let wide = |key: &str| WIDE_KEYS.contains(&key);
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
