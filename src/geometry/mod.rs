//! Meshes, their placements, and the surface point a ray has hit.

mod mesh;
mod surface;

pub use mesh::{Instance, Mesh, Placement};
pub use surface::Surface;
