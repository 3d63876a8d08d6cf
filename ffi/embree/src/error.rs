//! What can go wrong, as data.

use std::fmt;
use std::path::PathBuf;

use crate::geometry::{GeometryId, MAX_GEOMETRY_ID};
use crate::library::LIBRARY_VARIABLE;

/// A failure to find Embree, to use it, or to accept what it was given.
///
/// `Display` says what is wrong; [`Error::hint`] what to do about it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// No Embree was found under any of the names it goes by: each name with the loader's reason.
    NotFound {
        /// File names or paths tried, in order, each with the reason it failed.
        tried: Vec<(PathBuf, String)>,
    },
    /// A library was found and cannot be used.
    Unusable {
        /// The file.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// Embree reported an error of its own.
    Embree {
        /// What was being done.
        during: &'static str,
        /// Embree's words.
        message: String,
    },
    /// A vertex is NaN, infinite, or farther out than Embree can represent (about 1.8e18).
    BadVertex {
        /// The geometry it belongs to.
        geometry: GeometryId,
        /// Its place among the positions, from 0.
        vertex: usize,
        /// Its coordinates.
        position: [f32; 3],
    },
    /// A triangle names a vertex that does not exist.
    BadIndex {
        /// The geometry it belongs to.
        geometry: GeometryId,
        /// Its place among the triangles, from 0.
        triangle: usize,
        /// The index it names.
        index: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// An instance's matrix holds NaN or infinity, cannot be inverted, or is too extreme for single precision: scales
    /// below about 1e-9, or a scene moved or blown up beyond 1.8e18.
    BadTransform {
        /// The instance.
        geometry: GeometryId,
        /// The matrix, as it was given.
        local_to_world: [f32; 12],
    },
    /// A geometry id is used twice in one scene.
    DuplicateId(GeometryId),
    /// A geometry id above [`MAX_GEOMETRY_ID`].
    IdTooLarge(GeometryId),
    /// A filter was set on an id that is no triangle mesh of the scene.
    NoSuchMesh(GeometryId),
    /// An instance of a scene that itself holds instances: Embree follows one level only.
    NestedInstance(GeometryId),
    /// An instance of a scene that belongs to another device.
    OtherDevice(GeometryId),
}

impl Error {
    /// What the user can do about it, where that is known: one line, without a trailing full stop.
    ///
    /// For a missing or unusable library it names the package to install, by distribution.
    pub fn hint(&self) -> Option<String> {
        match self {
            Error::NotFound { .. } | Error::Unusable { .. } => Some(format!(
                "install Embree 3 or 4 (Debian 12, Ubuntu 22.04: apt install libembree3-3; Debian 13, \
                 Ubuntu 24.04: apt install libembree4-4; Fedora, openSUSE, Arch, Homebrew: embree), or set \
                 {LIBRARY_VARIABLE} to the path of the library file"
            )),
            Error::BadVertex { .. } => Some("clean the mesh of invalid or far-away vertices".into()),
            Error::BadTransform { .. } => {
                Some("give the object a finite scale that is not zero along any axis, or leave it out".into())
            }
            Error::Embree { message, .. } if message.contains("memory") => {
                Some("render fewer or simpler meshes, or with more memory".into())
            }
            _ => None,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::NotFound { tried } => {
                write!(f, "Embree was not found")?;
                for (i, (path, reason)) in tried.iter().enumerate() {
                    write!(f, "{} {}: {reason}", if i == 0 { "; tried" } else { ";" }, path.display())?;
                }
                Ok(())
            }
            Error::Unusable { path, reason } => write!(f, "{}: {reason}", path.display()),
            Error::Embree { during, message } => write!(f, "Embree failed to {during}: {message}"),
            Error::BadVertex { geometry, vertex, position: [x, y, z] } => {
                write!(f, "{geometry}: vertex {vertex} at ({x}, {y}, {z}) is not finite or too far away")
            }
            Error::BadIndex { geometry, triangle, index, vertices } => {
                write!(f, "{geometry}: triangle {triangle}: index {index} is past the {vertices} vertices")
            }
            Error::BadTransform { geometry, local_to_world } => {
                write!(
                    f,
                    "{geometry}: the instance's matrix {local_to_world:?} is not finite, not invertible, or too extreme"
                )
            }
            Error::DuplicateId(geometry) => write!(f, "{geometry}: the id is already in use"),
            Error::IdTooLarge(geometry) => {
                write!(f, "{geometry}: the id is larger than {}", MAX_GEOMETRY_ID.0)
            }
            Error::NoSuchMesh(geometry) => write!(f, "{geometry}: there is no triangle mesh of this id to filter"),
            Error::NestedInstance(geometry) => {
                write!(f, "{geometry}: the instanced scene itself holds instances, and only one level is followed")
            }
            Error::OtherDevice(geometry) => write!(f, "{geometry}: the instanced scene belongs to another device"),
        }
    }
}

impl std::error::Error for Error {}
