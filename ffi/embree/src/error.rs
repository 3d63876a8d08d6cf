//! The errors of this crate.

use std::fmt;
use std::path::PathBuf;

use crate::geometry::{GeometryId, MAX_GEOMETRY_ID};
use crate::library::LIBRARY_VARIABLE;

/// A failure to find or use Embree, or an invalid argument.
///
/// `Display` says what is wrong, [`Error::hint`] what to do about it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// Embree was not found under any of its names.
    NotFound {
        /// File names or paths tried, in order, each with the reason it failed.
        tried: Vec<(PathBuf, String)>,
    },
    /// A library was found, but cannot be used.
    Unusable {
        /// Path of the library file.
        path: PathBuf,
        /// Reason why the library cannot be used.
        reason: String,
    },
    /// Embree reported an error.
    Embree {
        /// The operation that failed, such as "build a scene".
        during: &'static str,
        /// Embree's message.
        message: String,
    },
    /// A vertex is NaN, infinite, or farther out than Embree can represent (about 1.8e18).
    BadVertex {
        /// Id of the mesh with the vertex.
        geometry: GeometryId,
        /// Index of the vertex.
        vertex: usize,
        /// Coordinates of the vertex.
        position: [f32; 3],
    },
    /// A triangle has an index of a vertex that does not exist.
    BadIndex {
        /// Id of the mesh with the triangle.
        geometry: GeometryId,
        /// Index of the triangle.
        triangle: usize,
        /// The invalid index.
        index: u32,
        /// Number of vertices of the mesh.
        vertices: usize,
    },
    /// The matrix of an instance contains NaN or infinity, is not invertible, or is too extreme for single precision:
    /// it scales by less than about 1e-9, or moves the scene beyond 1.8e18.
    BadTransform {
        /// Id of the instance.
        geometry: GeometryId,
        /// The column-major 3x4 matrix of the instance.
        local_to_world: [f32; 12],
    },
    /// A geometry id is used twice in one scene.
    DuplicateId(GeometryId),
    /// A geometry id is above [`MAX_GEOMETRY_ID`].
    IdTooLarge(GeometryId),
    /// A filter was set for an id that is not a triangle mesh of the scene.
    NoSuchMesh(GeometryId),
    /// The instanced scene contains instances itself. Only one level is supported.
    NestedInstance(GeometryId),
    /// The instanced scene belongs to another device.
    OtherDevice(GeometryId),
}

impl Error {
    /// Advice for the user, if there is any: one line without a full stop. For a missing or unusable library, the
    /// package to install on each distribution.
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
