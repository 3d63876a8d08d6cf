//! Flattens meshes on nodes whose scale is zero along an axis: a ball becomes a disc, the limit for small scales.

use super::mesh::drop_degenerate;
use crate::geometry::Mesh;
use crate::math::{DMat3, Vec3};

/// Applies a transform that cannot be inverted to a mesh. `None` if no triangle with an area remains. Vertex normals
/// are removed, because the transformed ones would not be those of the plane.
pub(super) fn flatten(mesh: &Mesh, transform: &DMat3) -> Option<Mesh> {
    let mut flat = mesh.clone();
    for p in &mut flat.positions {
        *p = (*transform * p.as_dvec3()).as_vec3();
    }
    for t in &mut flat.tangents {
        let along = (*transform * t.truncate().as_dvec3()).normalize_or_zero().as_vec3();
        *t = along.extend(if along == Vec3::ZERO { 0.0 } else { t.w });
    }
    flat.normals.clear();
    drop_degenerate(&mut flat);
    (!flat.triangles.is_empty()).then_some(flat)
}
