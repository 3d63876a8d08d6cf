//! Reads glTF 2.0 (`.glb`, `.gltf`) as Blender exports it, and as others do, into a [`Description`].
//!
//! The specification: <https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html>. The `gltf` crate names the parts of
//! a document; what they say about indices, ranges and bytes is checked here, because files come from anywhere: a fault
//! is an error that names its place, and whatever is ignored or approximated is a warning.
//!
//! Data flows one way: `container` (bytes to JSON and buffers) -> `document` (typed parts) -> `animation` (which puts a
//! moment of its curves into the document) -> `nodes` (the hierarchy), which calls for meshes, materials and textures as
//! it meets them, so that what no node uses is not even decoded.

mod accessor;
mod animation;
mod clipping;
mod container;
mod curve;
mod deform;
mod document;
mod extras;
mod files;
mod flat;
mod lights;
mod material;
mod materials;
mod mesh;
mod nodes;
mod pointer;
mod shading_frame;
mod shells;
mod texture;
mod topology;
mod transform;
mod uri;

pub use files::{files, hash};

use super::Description;
use crate::error::{Error, ErrorKind, Result};
use serde::Serialize;
use std::fmt::Display;
use std::path::Path;

/// What the numbers of punctual lights mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum LightUnits {
    /// By the program that wrote the file
    ///
    /// `extras.caustique.light_units` of the scene, or else the generator: Blender's exporter multiplies watts by 683
    /// lm/W (and leaves emissive surfaces alone), so its files are photometric. Other files state lamps and emissive
    /// surfaces in one system, so their ratio holds when lamps are taken as they are.
    #[default]
    Auto,
    /// Watts: W/sr and W/m2, taken as they are
    Radiometric,
    /// Lumens: cd and lx, divided by 683 lm/W
    Photometric,
}

/// What a transmissive mesh without a volume extension is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Glass {
    /// Solid if the mesh is closed, thin if it is open
    #[default]
    Auto,
    /// The boundary of a solid: light refracts
    Solid,
    /// Thin panes that do not bend light, as the glTF specification says
    Thin,
}

/// A frame of the animations in a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameTime {
    /// Its number: frame N is N / rate seconds after the start.
    pub number: u32,
    /// Frames a second of files that do not tell theirs; 24 if this does not either.
    pub rate: Option<f64>,
    /// The file is that of this frame alone, and may well be still.
    pub of_sequence: bool,
}

/// How to read what a file leaves open.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct ReadOptions {
    /// Units of punctual lights.
    pub light_units: LightUnits,
    /// Glass without a volume extension.
    pub glass: Glass,
    /// Files that the scene names may lie outside its own folder.
    pub allow_outside: bool,
    /// The frame that is shown; otherwise that at the first key of all animations.
    pub frame: Option<FrameTime>,
}

/// Reads the scene file at `path`; buffers, textures and the environment that it names are looked for beside it, and
/// nowhere outside its folder unless `options` allow it.
///
/// # Errors
/// The file or one that it names cannot be read, is damaged, or requires an extension that is not supported. The place
/// in the error names the file and the part of it.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Description> {
    let bytes = std::fs::read(path)
        .map_err(|e| Error::io(path, &e).hint("check the path of the scene file and your right to read it"))?;
    read_bytes(&bytes, path, options)
}

/// Like [`read`], from the bytes of a file that stands (or would stand) at `path`.
///
/// # Errors
/// Those of [`read`].
pub fn read_bytes(bytes: &[u8], path: &Path, options: &ReadOptions) -> Result<Description> {
    nodes::describe(bytes, path, options).map_err(|e| e.within(path.display()))
}

/// `1 vertex`, `2 vertices`.
fn counted(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

/// A fault of the scene file at a place in it.
fn fault(place: impl Display, cause: impl Display) -> Error {
    Error::new(ErrorKind::Scene, place, cause)
}
