//! Meshes, their placements, and the surface point a ray has hit.

mod mesh;
mod shapes;
mod surface;

pub use mesh::{Instance, Mesh, Placement};
pub use shapes::Shapes;
pub use surface::{Surface, error, spawn};
