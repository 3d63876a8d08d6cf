//! Triangle meshes and their instances.

use super::precision::{Extent, coordinate_error};
use crate::math::{Affine3A, Mat3A, Vec2, Vec3, Vec4};
use std::sync::Arc;

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
    fn pack(mesh: &mut Mesh) -> Vec<Corner> {
        let (normals, uvs) = (std::mem::take(&mut mesh.normals), std::mem::take(&mut mesh.uvs[0]));
        let corner = |(i, &p): (usize, &Vec3)| Corner {
            p,
            n: normals.get(i).copied().unwrap_or_default(),
            uv: uvs.get(i).copied().unwrap_or_default(),
        };
        mesh.positions.iter().enumerate().map(corner).collect()
    }
}

/// The data of a triangle that every hit reads, in a quarter of a cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(super) struct Face {
    /// Indices of the corners.
    pub corners: [u32; 3],
    /// Bound (m) on the distance of positions from the plane of the triangle, in the space of the mesh, without the
    /// rounding of their coordinates ([`Extent::plane_error`]).
    pub plane_error: f32,
}

impl Face {
    fn pack(mesh: &Mesh) -> Vec<Face> {
        let face = |&corners: &[u32; 3]| Face {
            corners,
            plane_error: Extent::from_corners(corners.map(|i| mesh.positions[i as usize])).plane_error(),
        };
        mesh.triangles.iter().map(face).collect()
    }
}

/// The data of a mesh that surface lookups read. Clones share it.
#[derive(Clone, Debug)]
pub(super) struct PackedMesh {
    pub faces: Arc<[Face]>,
    pub corners: Arc<[Corner]>,
    /// Whether the mesh has other attributes: texture coordinate set 1, vertex colours or tangents.
    pub has_more: bool,
}

impl PackedMesh {
    /// Packs a mesh for surface lookups. Moves normals and texture coordinate set 0 out of `mesh`.
    pub fn new(mesh: &mut Mesh) -> PackedMesh {
        let has_more = !(mesh.uvs[1].is_empty() && mesh.colors.is_empty() && mesh.tangents.is_empty());
        PackedMesh { faces: Face::pack(mesh).into(), corners: Corner::pack(mesh).into(), has_more }
    }
}

/// Bits of the linkings of lights ([`crate::light::LightLinks`]) of an object that is part of all of them. Bit 0 is
/// that of lights without linking.
pub const ALL_LINKINGS: u64 = u64::MAX;

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
    /// Whether the picture shows only the shadows of other objects on the instance, as alpha, and their light.
    pub shadow_catcher: bool,
    /// Whether cameras see black without coverage where they see the instance. Other rays hit it.
    pub holdout: bool,
    /// Linkings of lights that the instance is part of: a bit for each ([`ALL_LINKINGS`]).
    pub linkings: u64,
    /// Whether the place or the shape of the instance depends on the time while the shutter is open.
    pub moves: bool,
    /// Transform from local to world space; `None` if the mesh is in world space.
    pub to_world: Option<Placement>,
}

/// An affine transform of points, and the matching transform of normals.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Transform of points and directions from local to world space.
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

    /// Bound (m) on the distance of positions from the plane of a triangle with these local corners, after the
    /// transform ([`Extent::plane_error`]). Not inlined, so that the code for meshes in world space stays small.
    #[inline(never)]
    fn plane_error(&self, corners: [Vec3; 3]) -> f32 {
        let local = Extent::from_corners(corners);
        let edges = local.edges.map(|edge| self.points.transform_vector3(edge));
        Extent { largest: self.absolute.transform_point3(local.largest), edges }.plane_error()
    }
}

impl Instance {
    /// Whether cameras do not see the light that the surface of the instance scatters.
    #[inline]
    pub fn is_unseen(&self) -> bool {
        self.hidden_from_camera || self.holdout
    }

    /// Transforms a point of the mesh to world space.
    #[inline]
    pub fn point(&self, p: Vec3) -> Vec3 {
        match &self.to_world {
            None => p,
            Some(placement) => placement.points.transform_point3(p),
        }
    }

    /// Bound (m) on the distance of the computed world position `p` from the plane of its triangle. `local` is the
    /// bound in the space of the mesh, `corners` are its corners there.
    #[inline]
    pub(super) fn position_error(&self, local: f32, corners: [Vec3; 3], p: Vec3) -> f32 {
        let plane_error = match &self.to_world {
            None => local,
            Some(placement) => placement.plane_error(corners),
        };
        plane_error + coordinate_error(p)
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
