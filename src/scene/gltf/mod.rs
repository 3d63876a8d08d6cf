//! Reads glTF 2.0 files (`.glb`, `.gltf`) from Blender and other programs into a [`Description`].
//!
//! The specification is at <https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html>. The `gltf` crate defines the
//! types of a document. Indices, ranges and lengths are checked here, because files come from untrusted sources. An
//! invalid file gives an error that names the place in the file; a feature that is ignored or approximated gives a
//! warning.
//!
//! Data flow one way: `container` (bytes to JSON and buffers) -> `document` (typed parts) -> `animation` (applies the
//! chosen time to the document) -> `nodes` (the hierarchy). `nodes` reads meshes, materials and textures on demand, so
//! data that no node uses are not decoded.

mod accessor;
mod animation;
mod choice;
mod clipping;
mod codec;
mod compressed;
mod container;
mod curve;
mod deform;
mod document;
mod draco;
mod extras;
mod files;
mod flat;
mod isolated;
mod lights;
mod material;
mod materials;
mod mesh;
mod nodes;
mod own_light;
mod pointer;
mod profiles;
mod shading_frame;
mod shells;
mod texture;
mod topology;
mod transform;
mod uri;

pub use files::{files, hash};
pub use isolated::decode_for_program;
pub use transform::affine;
pub(super) use transform::{check_reach, is_finite, is_invertible};

use super::Description;
use crate::error::{Error, ErrorKind, Result};
use crate::geometry::Mesh;
use serde::Serialize;
use std::borrow::Cow;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Units of the intensities of punctual lights.
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

/// Treatment of transmissive meshes without a volume extension.
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

/// The frame of an animation at which a file is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameTime {
    /// Frame number; frame N is at N / rate seconds.
    pub number: u32,
    /// Frames per second, for files without a frame rate of their own; `None` is 24.
    pub rate: Option<f64>,
    /// Whether the file is one of a sequence with a file per frame, so that a missing animation needs no warning.
    pub of_sequence: bool,
}

/// Pose of the parts that a file animates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Pose {
    /// As the animations place them at the frame
    #[default]
    Animated,
    /// As the file places its nodes, without any animation
    Rest,
}

/// Choices of the user for properties that a file may leave open.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct ReadOptions {
    /// Units of punctual lights.
    pub light_units: LightUnits,
    /// Treatment of glass meshes without a volume extension: solid or thin.
    pub glass: Glass,
    /// Whether the scene may name files outside its own folder.
    pub allow_outside: bool,
    /// Name of the scene to read; `None`: the file's default scene.
    pub scene: Option<String>,
    /// Name of the only animation that moves the scene; `None`: all move it.
    pub animation: Option<String>,
    /// Name of the material variant (KHR_materials_variants); `None`: each primitive's own material.
    pub variant: Option<String>,
    /// Pose of the parts that the file animates.
    pub pose: Pose,
    /// The frame to read; `None`: the time of the first key of all animations.
    pub frame: Option<FrameTime>,
    /// Times at which the shutter opens and closes, relative to the frame (frames); `None`: those of the file.
    pub shutter: Option<[f64; 2]>,
    /// Whether the scene is read again at the frames around its frame, for motion vectors.
    pub motion_vectors: bool,
}

/// The time (frames after the frame) at which a shutter that opens and closes at once shows the scene; 0 for any other
/// shutter.
pub fn instant(shutter: Option<[f64; 2]>) -> f64 {
    shutter.filter(|[open, close]| open == close).map_or(0.0, |[open, _]| open)
}

/// Reads the scene file at `path`. The buffers, textures and environment that it names must be in its folder, unless
/// `options` allow other files.
///
/// # Errors
/// The file, or one that it names, cannot be read, is damaged, or requires an unsupported extension. The error names
/// the file and the place in it.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Description> {
    Ok(MovingFile::open(path, options)?.0)
}

/// Does the work of [`read`] for the bytes of a file; files that the scene names are relative to `path`.
///
/// # Errors
/// As for [`read`].
pub fn read_bytes(bytes: &[u8], path: &Path, options: &ReadOptions) -> Result<Description> {
    Ok(MovingFile::from_bytes(bytes.into(), path, options)?.0)
}

/// A scene file that is read again at other moments: something moves while the shutter is open, or motion vectors are to
/// be computed.
pub struct MovingFile {
    path: PathBuf,
    bytes: Vec<u8>,
    options: ReadOptions,
    shared: nodes::Shared,
    /// The meshes as they were read; empty unless motion vectors are to be computed.
    meshes: Vec<Arc<Mesh>>,
    /// The temporary folder of the file, if it was converted from another format.
    _folder: Option<tempfile::TempDir>,
}

/// Whether all frames of a file are the same: it has no animation, or its animations move nothing. `false` if the file
/// cannot be read, which its render reports.
pub fn is_still(path: &Path, options: &ReadOptions) -> bool {
    let still = |bytes: Vec<u8>| {
        let mut document = document::Document::parse(
            &bytes,
            crate::scene::folder::Folder::of(path, options.allow_outside),
            &mut Vec::new(),
        )?;
        choice::apply(&mut document, options)?;
        let tracks = animation::Tracks::read(&document, options, &mut Vec::new())?;
        tracks.are_still(&document)
    };
    std::fs::read(path).is_ok_and(|bytes| still(bytes).unwrap_or(false))
}

impl MovingFile {
    /// Reads a scene file, and keeps it for other moments if something moves while the shutter is open, or if something is
    /// animated and motion vectors are to be computed.
    ///
    /// # Errors
    /// As for [`read`].
    pub fn open(path: &Path, options: &ReadOptions) -> Result<(Description, Option<MovingFile>)> {
        // A scene may also come through a pipe, which can be read once.
        let bytes =
            crate::files::receive(path, crate::memory::available().map_or(u64::MAX, |available| available.bytes / 2))
                .map_err(|e| Error::io(path, &e).hint("check the path of the scene file and your right to read it"))?;
        MovingFile::from_bytes(bytes.into(), path, options)
    }

    /// Does the work of [`MovingFile::open`] for the bytes of a file.
    ///
    /// # Errors
    /// As for [`read_bytes`].
    pub fn from_bytes(
        bytes: Cow<'_, [u8]>,
        path: &Path,
        options: &ReadOptions,
    ) -> Result<(Description, Option<MovingFile>)> {
        let (description, shared) = nodes::describe(&bytes, path, options).map_err(|e| e.within(path.display()))?;
        let vectors = options.motion_vectors && description.animated;
        let kept = vectors || description.blur().is_some();
        let meshes = if vectors { description.meshes.clone() } else { Vec::new() };
        let file = || MovingFile {
            path: path.to_owned(),
            bytes: bytes.into_owned(),
            options: options.clone(),
            shared,
            meshes,
            _folder: None,
        };
        Ok((description, kept.then(file)))
    }

    /// Keeps the temporary folder of the file for its moments.
    pub(super) fn in_folder(self, folder: tempfile::TempDir) -> MovingFile {
        MovingFile { _folder: Some(folder), ..self }
    }

    /// Parses the file for descriptions of its moments.
    ///
    /// # Errors
    /// A file that the scene names cannot be read any more.
    pub fn moments(&self) -> Result<FileMoments<'_>> {
        let mut document = nodes::parse(&self.bytes, &self.path, &self.options, &mut Vec::new())
            .map_err(|e| e.within(self.path.display()))?;
        let tracks = animation::Tracks::read(&document, &self.options, &mut Vec::new())?;
        tracks.apply(&mut document, 0.0, &mut Vec::new())?;
        Ok(FileMoments { file: self, moving: tracks.moving_parts(), tracks, document: Mutex::new(document) })
    }
}

/// Describes the moments of a scene file.
pub struct FileMoments<'a> {
    file: &'a MovingFile,
    tracks: animation::Tracks,
    moving: animation::MovingParts,
    document: Mutex<document::Document<'a>>,
}

impl FileMoments<'_> {
    /// Describes the scene `after_frame` frames after its frame. Meshes that keep their shape are those of `meshes`, the
    /// meshes of the scene that was built from the file, and the description has no materials if they do not change.
    ///
    /// # Errors
    /// A value is invalid at this moment, or an object is there that is missing at the frame.
    pub fn describe(&self, after_frame: f64, meshes: &[Arc<Mesh>]) -> Result<Description> {
        self.describe_sharing(after_frame, meshes, false)
    }

    /// Describes the scene `after_frame` frames after its frame, with meshes in their own space and without objects that
    /// are missing at its frame. The file must have been read for motion vectors.
    ///
    /// # Errors
    /// A value is invalid at this moment.
    pub fn describe_pose(&self, after_frame: f64) -> Result<Description> {
        self.describe_sharing(after_frame, &self.file.meshes, true)
    }

    fn describe_sharing(&self, after_frame: f64, meshes: &[Arc<Mesh>], partial: bool) -> Result<Description> {
        let mut document = self.document.lock().unwrap_or_else(PoisonError::into_inner);
        self.tracks
            .apply(&mut document, after_frame, &mut Vec::new())
            .map_err(|e| e.within(self.file.path.display()))?;
        let MovingFile { path, options, shared, .. } = self.file;
        let moment = nodes::Moment { shared, moving: &self.moving, meshes, partial };
        nodes::describe_moment(&document, path, options, moment).map_err(|e| e.within(path.display()))
    }
}

/// A number with its noun: `1 vertex`, `2 vertices`.
fn counted(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

/// An error whose message names a place in the scene file and the cause.
fn fault(place: impl Display, cause: impl Display) -> Error {
    Error::new(ErrorKind::Scene, place, cause)
}
