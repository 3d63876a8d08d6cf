//! Triangle meshes and where they stand.

use super::precision::{Extent, coordinate_error};
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
    /// `points` with the absolute value of each number: bounds all terms of a transformed coordinate.
    absolute: Affine3A,
    /// -1 for a mirroring transform, which turns the handedness of tangents over; 1 for others.
    handedness: f32,
}

impl Placement {
    /// From an affine transform that can be inverted.
    pub fn new(points: Affine3A) -> Placement {
        let normals = points.matrix3.inverse().transpose();
        let absolute = Affine3A { matrix3: points.matrix3.abs(), translation: points.translation.abs() };
        let handedness = points.matrix3.determinant().signum();
        Placement { points, normals, absolute, handedness }
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

    /// How far a point `p` in world space may be off the plane of its triangle, given by the largest coordinates of its
    /// corners and two edges, in the mesh's own space.
    #[inline]
    pub(super) fn error(&self, own: Extent, p: Vec3) -> f32 {
        let extent = match &self.to_world {
            None => own,
            Some(placement) => Extent {
                largest: placement.absolute.transform_point3(own.largest),
                edges: own.edges.map(|edge| placement.points.transform_vector3(edge)),
            },
        };
        extent.plane_error() + coordinate_error(p)
    }

    /// A normal of the mesh in world space, not normalised.
    #[inline]
    pub fn normal(&self, n: Vec3) -> Vec3 {
        match &self.to_world {
            None => n,
            Some(placement) => placement.normals * n,
        }
    }

    /// A tangent of the mesh with its handedness in world space, not normalised.
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
