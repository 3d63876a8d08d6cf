//! The point of a surface that a ray has hit, with everything shading needs.

use super::mesh::Corner;
use super::precision::{Extent, offset_origin, shadow_end};
use super::{Instance, Mesh};
use crate::math::{Vec2, Vec3, Vec4};

/// A point on a triangle.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// World position, from barycentric coordinates (more exact than along the ray).
    pub p: Vec3,
    /// Unit geometric normal; points to the front (counter-clockwise) side.
    pub ng: Vec3,
    /// Unit shading normal, in the hemisphere of `ng`.
    pub ns: Vec3,
    /// Direction of growing u in the surface (not orthonormalised; zero when the mesh has neither tangents nor uvs), w
    /// = handedness.
    pub tangent: Vec4,
    /// Texture coordinates, sets 0 and 1.
    pub uv: [Vec2; 2],
    /// Linear vertex colour; white when there is none.
    pub color: Vec4,
    /// Index of the instance.
    pub instance: u32,
    /// Index of the triangle in its mesh.
    pub primitive: u32,
    /// Index of the material.
    pub material: u32,
    /// How far from its triangle the position may be, and how far Embree's own arithmetic may see that triangle from
    /// there (scene units).
    pub error: f32,
    /// Others lie on it here, and it is known which comes first (`scene/contact.rs`).
    pub touching: bool,
}

impl Surface {
    /// The surface at barycentric coordinates (`b1`, `b2`) of triangle `primitive`. `None` for a triangle without area.
    #[inline(always)]
    pub(super) fn at(
        instance_index: u32,
        instance: &Instance,
        mesh: &Mesh,
        corners: &[Corner],
        primitive: u32,
        [b1, b2]: [f32; 2],
    ) -> Option<Surface> {
        let [i0, i1, i2] = mesh.triangles[primitive as usize];
        let (i0, i1, i2) = (i0 as usize, i1 as usize, i2 as usize);
        let (c0, c1, c2) = (&corners[i0], &corners[i1], &corners[i2]);
        let b0 = 1.0 - b1 - b2;
        let e1 = c1.p - c0.p;
        let e2 = c2.p - c0.p;
        let p = instance.point(c0.p + e1 * b1 + e2 * b2);
        let ng = instance.normal(e1.cross(e2)).try_normalize()?;
        // A file may carry normals that disagree with the winding: the winding decides which side is the front.
        let ns = match instance.normal(c0.n * b0 + c1.n * b1 + c2.n * b2).try_normalize() {
            Some(n) if n.dot(ng) < 0.0 => -n,
            Some(n) => n,
            None => ng,
        };
        let mut uv = [c0.uv * b0 + c1.uv * b1 + c2.uv * b2, Vec2::ZERO];
        let second = &mesh.uvs[1];
        if !second.is_empty() {
            uv[1] = second[i0] * b0 + second[i1] * b1 + second[i2] * b2;
        }
        let mut color = Vec4::ONE;
        if !mesh.colors.is_empty() {
            color = mesh.colors[i0] * b0 + mesh.colors[i1] * b1 + mesh.colors[i2] * b2;
        }
        let mut tangent = Vec4::ZERO;
        if !mesh.tangents.is_empty() {
            let t = mesh.tangents[i0] * b0 + mesh.tangents[i1] * b1 + mesh.tangents[i2] * b2;
            tangent = instance.tangent(t.truncate().extend(if t.w < 0.0 { -1.0 } else { 1.0 }));
        }
        let largest = c0.p.abs().max(c1.p.abs()).max(c2.p.abs());
        Some(Surface {
            p,
            ng,
            ns,
            tangent,
            uv,
            color,
            instance: instance_index,
            primitive,
            material: instance.material,
            error: instance.error(Extent { largest, edges: [e1, e2] }, p),
            touching: false,
        })
    }

    /// Where a ray towards `direction` starts: moved off the surface, to the side the direction points to, by the
    /// error bound of the position, so that the ray does not hit the surface it leaves.
    #[inline]
    pub fn ray_origin(&self, direction: Vec3) -> Vec3 {
        offset_origin(self.p, self.ng, direction, self.error)
    }

    /// Where a shadow ray of length `distance` ends that comes against `direction`.
    #[inline]
    pub fn shadow_end(&self, direction: Vec3, distance: f32) -> Vec3 {
        shadow_end(self.p, self.ng, direction, self.error, distance)
    }
}
