//! Meshes and their instances, surface points of ray hits, and bounds on rounding errors.

mod mesh;
mod precision;
mod shapes;
mod surface;

pub use mesh::{ALL_LINKINGS, Instance, Mesh, Placement};
pub use precision::{Extent, coordinate_error, offset_origin, shadow_end, triangle_error};
pub use shapes::Shapes;
pub use surface::Surface;
