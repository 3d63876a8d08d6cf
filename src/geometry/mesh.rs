//! Triangle meshes and their instances.

use super::precision::{Extent, coordinate_error};
use crate::math::{Affine3A, Mat3A, Vec2, Vec3, Vec4};

/// A triangle mesh with one material: a glTF primitive. An attribute has one value per vertex, or is empty if the file
/// has none.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name of the mesh for messages.
    pub name: String,
    /// Vertex positions: in world space if the mesh has one instance, in local space if several instances share it.
    pub positions: Vec<Vec3>,
    /// Unit shading normals. Without them the geometric normal is used (flat shading).
    pub normals: Vec<Vec3>,
    /// Unit tangents, w = handedness of the bitangent. Empty if the material needs none.
    pub tangents: Vec<Vec4>,
    /// Texture coordinate sets 0 and 1.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA vertex colours.
    pub colors: Vec<Vec4>,
    /// Vertex indices, counter-clockwise seen from the front. Every index is below `positions.len()`.
    pub triangles: Vec<[u32; 3]>,
    /// Whether the mesh is closed and consistently oriented: every edge (with vertices welded by position) belongs to
    /// exactly two triangles, which run along it in opposite directions.
    pub closed: bool,
}

/// The vertex attributes that almost every hit reads, in half a cache line.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
pub(super) struct Corner {
    pub p: Vec3,
    /// Shading normal; zero if the geometric normal is used.
    pub n: Vec3,
    /// Texture coordinate set 0.
    pub uv: Vec2,
}

impl Corner {
    /// Packs the vertices of a mesh for surface lookups. Moves normals and texture coordinate set 0 out of `mesh`.
    pub fn pack(mesh: &mut Mesh) -> Vec<Corner> {
        let (normals, uvs) = (std::mem::take(&mut mesh.normals), std::mem::take(&mut mesh.uvs[0]));
        let corner = |(i, &p): (usize, &Vec3)| Corner {
            p,
            n: normals.get(i).copied().unwrap_or_default(),
            uv: uvs.get(i).copied().unwrap_or_default(),
        };
        mesh.positions.iter().enumerate().map(corner).collect()
    }
}

/// A mesh placed in the scene.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Name of the object (the glTF node), for messages and cryptomatte.
    pub name: String,
    /// Index of the mesh in the scene's meshes.
    pub mesh: u32,
    /// Index of the material in the scene's materials.
    pub material: u32,
    /// Index of the object in the scene; all primitives of one glTF node share it.
    pub object: u32,
    /// Whether camera rays pass through the instance. All other rays hit it.
    pub hidden_from_camera: bool,
    /// Transform from local to world space; `None` if the mesh is in world space.
    pub to_world: Option<Placement>,
}

/// An affine transform of points, and the matching transform of normals.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Transform of points and directions.
    pub points: Affine3A,
    /// Transform of normals up to length: the inverse transpose. As glTF requires, the front of a mirrored mesh stays
    /// its front.
    pub normals: Mat3A,
    /// `points` with the absolute value of each number, which bounds the terms of a transformed coordinate.
    absolute: Affine3A,
    /// -1 if the transform contains a reflection, which flips the handedness of tangents; else 1.
    handedness: f32,
}

impl Placement {
    /// The placement of a mesh by an invertible affine transform from local to world space.
    pub fn new(points: Affine3A) -> Placement {
        let normals = points.matrix3.inverse().transpose();
        let absolute = Affine3A { matrix3: points.matrix3.abs(), translation: points.translation.abs() };
        let handedness = points.matrix3.determinant().signum();
        Placement { points, normals, absolute, handedness }
    }
}

impl Instance {
    /// Transforms a point of the mesh to world space.
    #[inline]
    pub fn point(&self, p: Vec3) -> Vec3 {
        match &self.to_world {
            None => p,
            Some(placement) => placement.points.transform_point3(p),
        }
    }

    /// Bound (m) on the distance of the computed world position `p` from the plane of its triangle. `local` is the
    /// extent of the triangle in the space of the mesh.
    #[inline]
    pub(super) fn position_error(&self, local: Extent, p: Vec3) -> f32 {
        let extent = match &self.to_world {
            None => local,
            Some(placement) => Extent {
                largest: placement.absolute.transform_point3(local.largest),
                edges: local.edges.map(|edge| placement.points.transform_vector3(edge)),
            },
        };
        extent.plane_error() + coordinate_error(p)
    }

    /// Transforms a normal of the mesh to world space, without normalizing it.
    #[inline]
    pub fn normal(&self, n: Vec3) -> Vec3 {
        match &self.to_world {
            None => n,
            Some(placement) => placement.normals * n,
        }
    }

    /// Transforms a tangent of the mesh and its handedness to world space, without normalizing it.
    #[inline]
    pub(super) fn tangent(&self, t: Vec4) -> Vec4 {
        match &self.to_world {
            None => t,
            Some(placement) => placement.points.transform_vector3(t.truncate()).extend(t.w * placement.handedness),
        }
    }

    /// The three corners of triangle `primitive` in world space.
    #[inline]
    pub fn corners(&self, mesh: &Mesh, primitive: u32) -> [Vec3; 3] {
        mesh.triangles[primitive as usize].map(|i| self.point(mesh.positions[i as usize]))
    }
}
