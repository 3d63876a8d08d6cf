//! The surface point of a ray hit, with the attributes that shading needs.

use super::mesh::{Face, PackedMesh};
use super::precision::{offset_origin, shadow_end};
use super::{Instance, Mesh};
use crate::math::{Vec2, Vec3, Vec4};

/// A point on a triangle, with the attributes that shading needs.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// World position, interpolated by barycentric coordinates, which is more precise than the point along the ray.
    pub p: Vec3,
    /// Unit geometric normal on the front side, from which the triangle is counter-clockwise.
    pub ng: Vec3,
    /// Unit shading normal, in the hemisphere of `ng`.
    pub ns: Vec3,
    /// Tangent, the direction of increasing u, with its handedness in w. Not orthonormalized. Zero if the mesh has
    /// neither tangents nor texture coordinates.
    pub tangent: Vec4,
    /// Texture coordinates, sets 0 and 1.
    pub uv: [Vec2; 2],
    /// Linear RGBA vertex colour; white if the mesh has none.
    pub color: Vec4,
    /// Index of the instance in the scene.
    pub instance: u32,
    /// Index of the triangle in the instance's mesh.
    pub primitive: u32,
    /// Index of the material in the scene.
    pub material: u32,
    /// Bound (m) on the distance of `p` from the triangle's plane as Embree's arithmetic sees it.
    pub error: f32,
    /// Whether other surfaces coincide with this one here and their order is known (`scene/contact.rs`).
    pub touching: bool,
}

impl Surface {
    /// The surface at barycentric coordinates (`b1`, `b2`) of triangle `primitive`. `None` for a triangle without area.
    #[inline(always)]
    pub(super) fn at(
        instance_index: u32,
        instance: &Instance,
        packed: &PackedMesh,
        mesh: &Mesh,
        primitive: u32,
        [b1, b2]: [f32; 2],
    ) -> Option<Surface> {
        let Face { corners: indices, plane_error } = packed.faces[primitive as usize];
        let [c0, c1, c2] = indices.map(|i| &packed.corners[i as usize]);
        let b0 = 1.0 - b1 - b2;
        let e1 = c1.p - c0.p;
        let e2 = c2.p - c0.p;
        let p = instance.point(c0.p + e1 * b1 + e2 * b2);
        let ng = instance.normal(e1.cross(e2)).try_normalize()?;
        // Normals of a file may disagree with the winding. The winding determines the front.
        let ns = match instance.normal(c0.n * b0 + c1.n * b1 + c2.n * b2).try_normalize() {
            Some(n) if n.dot(ng) < 0.0 => -n,
            Some(n) => n,
            None => ng,
        };
        let mut surface = Surface {
            p,
            ng,
            ns,
            tangent: Vec4::ZERO,
            uv: [c0.uv * b0 + c1.uv * b1 + c2.uv * b2, Vec2::ZERO],
            color: Vec4::ONE,
            instance: instance_index,
            primitive,
            material: instance.material,
            error: instance.position_error(plane_error, [c0.p, c1.p, c2.p], p),
            touching: false,
        };
        if packed.has_more {
            surface.interpolate_more(instance, mesh, indices, [b0, b1, b2]);
        }
        Some(surface)
    }

    /// Sets the attributes that few meshes have, from the corners with these indices and barycentric weights: texture
    /// coordinate set 1, vertex colour and tangent.
    #[inline(never)]
    fn interpolate_more(&mut self, instance: &Instance, mesh: &Mesh, indices: [u32; 3], [b0, b1, b2]: [f32; 3]) {
        let [i0, i1, i2] = indices.map(|i| i as usize);
        let second = &mesh.uvs[1];
        if !second.is_empty() {
            self.uv[1] = second[i0] * b0 + second[i1] * b1 + second[i2] * b2;
        }
        if !mesh.colors.is_empty() {
            self.color = mesh.colors[i0] * b0 + mesh.colors[i1] * b1 + mesh.colors[i2] * b2;
        }
        if !mesh.tangents.is_empty() {
            let t = mesh.tangents[i0] * b0 + mesh.tangents[i1] * b1 + mesh.tangents[i2] * b2;
            self.tangent = instance.tangent(t.truncate().extend(if t.w < 0.0 { -1.0 } else { 1.0 }));
        }
    }

    /// Origin of a ray that leaves the surface along `direction`: the position, moved by the error bound to the side
    /// that the direction points to, so that the ray does not hit the surface again.
    #[inline]
    pub fn ray_origin(&self, direction: Vec3) -> Vec3 {
        offset_origin(self.p, self.ng, direction, self.error)
    }

    /// End of a shadow ray of length `distance` that arrives at this surface point; `direction` points back along the
    /// ray. It is moved off the surface, so that the surface does not block the ray.
    #[inline]
    pub fn shadow_end(&self, direction: Vec3, distance: f32) -> Vec3 {
        shadow_end(self.p, self.ng, direction, self.error, distance)
    }
}
