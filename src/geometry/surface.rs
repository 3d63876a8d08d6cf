//! The point of a surface that a ray has hit, with everything shading needs.

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
    /// Direction of growing u in the surface (not orthonormalised; zero when the mesh has neither tangents nor uvs), w = handedness.
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
}

/// Relative error of a position computed from barycentric coordinates and a transform, in units of the largest coordinate:
/// 32 units in the last place, the factor that Mitsuba settled on after reports of self-intersection far from the origin.
const POSITION_ERROR: f32 = 32.0 * f32::EPSILON;

impl Surface {
    /// The surface at barycentric coordinates (`b1`, `b2`) of triangle `primitive`. `None` for a triangle without area.
    #[inline]
    pub fn at(
        instance_index: u32,
        instance: &Instance,
        mesh: &Mesh,
        primitive: u32,
        b1: f32,
        b2: f32,
    ) -> Option<Surface> {
        let triangle = mesh.triangles[primitive as usize].map(|i| i as usize);
        let [p0, p1, p2] = triangle.map(|i| mesh.positions[i]);
        let b0 = 1.0 - b1 - b2;
        let e1 = p1 - p0;
        let e2 = p2 - p0;
        let p = instance.point(p0 + e1 * b1 + e2 * b2);
        let ng = instance.normal(e1.cross(e2)).try_normalize()?;
        let blend3 = |values: &[Vec3]| values[triangle[0]] * b0 + values[triangle[1]] * b1 + values[triangle[2]] * b2;
        let mut ns = ng;
        if !mesh.normals.is_empty()
            && let Some(n) = instance.normal(blend3(&mesh.normals)).try_normalize()
        {
            // A file may carry normals that disagree with the winding: the winding decides which side is the front.
            ns = if n.dot(ng) < 0.0 { -n } else { n };
        }
        let uv = [0, 1].map(|set: usize| {
            let values = &mesh.uvs[set];
            if values.is_empty() {
                Vec2::ZERO
            } else {
                values[triangle[0]] * b0 + values[triangle[1]] * b1 + values[triangle[2]] * b2
            }
        });
        let color = if mesh.colors.is_empty() {
            Vec4::ONE
        } else {
            mesh.colors[triangle[0]] * b0 + mesh.colors[triangle[1]] * b1 + mesh.colors[triangle[2]] * b2
        };
        let tangent = if mesh.tangents.is_empty() {
            Vec4::ZERO
        } else {
            let t = mesh.tangents[triangle[0]] * b0 + mesh.tangents[triangle[1]] * b1 + mesh.tangents[triangle[2]] * b2;
            instance.direction(t.truncate()).extend(if t.w < 0.0 { -1.0 } else { 1.0 })
        };
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
        })
    }

    /// Where a ray towards `direction` starts: moved off the surface, to the side the direction points to, by the
    /// error bound of the position, so that the ray does not hit the surface it leaves.
    #[inline]
    pub fn spawn(&self, direction: Vec3) -> Vec3 {
        let error = POSITION_ERROR * self.p.abs().max_element().max(1e-3);
        self.p + self.ng * error.copysign(direction.dot(self.ng))
    }
}
