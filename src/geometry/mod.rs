//! Meshes, their placements, and the surface point a ray has hit.

mod mesh;
mod precision;
mod shapes;
mod surface;

pub use mesh::{Instance, Mesh, Placement};
pub use precision::{Extent, coordinate_error, offset_origin, shadow_end, triangle_error};
pub use shapes::Shapes;
pub use surface::Surface;
