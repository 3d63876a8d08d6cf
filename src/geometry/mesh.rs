//! Triangle meshes and where they stand.

use super::precision::error_within;
use crate::math::{Affine3A, Mat3A, Vec2, Vec3, Vec4};

/// One triangle mesh with one material: a glTF primitive. Vertex attributes are per vertex, or empty where the file has
/// none.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name for messages.
    pub name: String,
    /// Vertex positions: world space when the mesh stands in one place, local space when instances share it.
    pub positions: Vec<Vec3>,
    /// Unit shading normals; empty: the geometric normal serves (flat shading).
    pub normals: Vec<Vec3>,
    /// Unit tangents, w = handedness of the bitangent; empty when nothing needs them.
    pub tangents: Vec<Vec4>,
    /// Texture coordinate sets 0 and 1.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA vertex colours.
    pub colors: Vec<Vec4>,
    /// Vertex indices, counter-clockwise seen from the front; every index is below `positions.len()`.
    pub triangles: Vec<[u32; 3]>,
    /// Every edge (vertices welded by position) is shared by exactly two triangles that run along it in opposite
    /// directions.
    pub closed: bool,
}

/// What almost every hit needs of a vertex, in half a cache line.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
pub(super) struct Corner {
    pub p: Vec3,
    /// Zero: the geometric normal serves.
    pub n: Vec3,
    /// Texture coordinate set 0.
    pub uv: Vec2,
}

impl Corner {
    /// The vertices of a mesh, out of which normals and the first texture coordinates move.
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

/// A mesh standing in the scene.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Name of the object (the glTF node), for messages and cryptomatte.
    pub name: String,
    /// Index into the scene's meshes.
    pub mesh: u32,
    /// Index into the scene's materials.
    pub material: u32,
    /// Index of the object: several instances (primitives) of one node share it.
    pub object: u32,
    /// Cameras look through it; all else meets it.
    pub hidden_from_camera: bool,
    /// Local to world; `None` when the mesh is already in world space.
    pub to_world: Option<Placement>,
}

/// A transform of points, and of normals (inverse transpose).
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Of points and directions.
    pub points: Affine3A,
    /// Of normals, up to length: the inverse transpose. The front of a mirrored mesh stays its front, as glTF wants.
    pub normals: Mat3A,
    /// Largest coordinate of a point of the mesh, once turned and scaled, over its largest coordinate before.
    stretch: f32,
}

impl Placement {
    /// From an affine transform that can be inverted.
    pub fn new(points: Affine3A) -> Placement {
        let normals = points.matrix3.inverse().transpose();
        let rows = points.matrix3.transpose();
        let sums = [rows.x_axis, rows.y_axis, rows.z_axis].map(|row| row.abs().element_sum());
        Placement { points, normals, stretch: sums.into_iter().fold(0.0, f32::max) }
    }
}

impl Instance {
    /// A point of the mesh in world space.
    #[inline]
    pub fn point(&self, p: Vec3) -> Vec3 {
        match &self.to_world {
            None => p,
            Some(placement) => placement.points.transform_point3(p),
        }
    }

    /// How far a point `p` in world space may be off from a triangle of the mesh no coordinate of whose corners is
    /// larger than `largest` in the mesh's own space.
    #[inline]
    pub(super) fn error(&self, largest: f32, p: Vec3) -> f32 {
        let stretch = self.to_world.as_ref().map_or(1.0, |placement| placement.stretch);
        error_within((largest * stretch).max(p.abs().max_element()))
    }

    /// A normal of the mesh in world space, not normalised.
    #[inline]
    pub fn normal(&self, n: Vec3) -> Vec3 {
        match &self.to_world {
            None => n,
            Some(placement) => placement.normals * n,
        }
    }

    /// A direction (tangent) of the mesh in world space, not normalised.
    #[inline]
    pub fn direction(&self, v: Vec3) -> Vec3 {
        match &self.to_world {
            None => v,
            Some(placement) => placement.points.transform_vector3(v),
        }
    }

    /// The three corners of triangle `primitive` in world space.
    #[inline]
    pub fn corners(&self, mesh: &Mesh, primitive: u32) -> [Vec3; 3] {
        mesh.triangles[primitive as usize].map(|i| self.point(mesh.positions[i as usize]))
    }
}
