//! Ids of geometries, bounding boxes, and the largest coordinate.

use std::fmt;

/// Id of a mesh or instance in its scene. Ids should be small and dense, because Embree has a table up to the largest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct GeometryId(pub u32);

/// The largest id of a mesh or instance.
pub const MAX_GEOMETRY_ID: GeometryId = GeometryId((1 << 24) - 1);

/// Largest coordinate that Embree accepts (`FLT_LARGE` in its sources). Embree silently drops triangles with larger
/// ones, and must not be called with such rays.
pub(crate) const MAX_COORDINATE: f32 = 1.844e18;

impl fmt::Display for GeometryId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "geometry {}", self.0)
    }
}

/// An axis-aligned box around a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest x, y and z in the box.
    pub min: [f32; 3],
    /// Largest x, y and z in the box.
    pub max: [f32; 3],
}
