//! Numbers of geometries, and the space that they may fill.

use std::fmt;

/// The number of a mesh or instance within its scene.
///
/// Give small, dense numbers: Embree keeps a table up to the largest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct GeometryId(pub u32);

/// The largest id a mesh or instance may have.
pub const MAX_GEOMETRY_ID: GeometryId = GeometryId((1 << 24) - 1);

/// Embree (`FLT_LARGE` in its sources) drops triangles with coordinates beyond this without a word, and takes no
/// rays with such.
pub(crate) const MAX_COORDINATE: f32 = 1.844e18;

impl fmt::Display for GeometryId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "geometry {}", self.0)
    }
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least x, y and z.
    pub min: [f32; 3],
    /// Greatest x, y and z.
    pub max: [f32; 3],
}
