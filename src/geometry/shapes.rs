//! All meshes and instances of a scene.

use super::mesh::PackedMesh;
use super::{Instance, Mesh, Surface};
use crate::math::{Vec3, bounding_box};
use crate::processor::prefetch;
use std::sync::Arc;

/// The scene's geometry: meshes and their instances.
#[derive(Clone, Debug, Default)]
pub struct Shapes {
    /// Meshes, in world space if they have one instance that does not move, otherwise in local space. The moments of a
    /// moving scene share meshes that keep their shape.
    pub meshes: Vec<Arc<Mesh>>,
    /// Instances of the meshes. All their indices are valid.
    pub instances: Vec<Instance>,
    /// Packed triangles and vertices of each mesh, by the index of the mesh.
    packed: Vec<PackedMesh>,
}

impl Shapes {
    /// The geometry of these meshes and instances. Indices in the instances must be valid.
    pub fn new(mut meshes: Vec<Arc<Mesh>>, instances: Vec<Instance>) -> Shapes {
        let packed = meshes.iter_mut().map(|mesh| PackedMesh::new(Arc::make_mut(mesh))).collect();
        Shapes { meshes, instances, packed }
    }

    /// The geometry at another moment of a moving scene. Meshes that are among the present ones are shared.
    #[must_use]
    pub fn at_moment(&self, mut meshes: Vec<Arc<Mesh>>, instances: Vec<Instance>) -> Shapes {
        let packed = meshes.iter_mut().enumerate().map(|(i, mesh)| match self.meshes.get(i) {
            Some(own) if Arc::ptr_eq(own, mesh) => self.packed[i].clone(),
            _ => PackedMesh::new(Arc::make_mut(mesh)),
        });
        Shapes { packed: packed.collect(), meshes, instances }
    }

    /// Vertices of all instances, in world space.
    pub fn points(&self) -> impl Iterator<Item = Vec3> {
        self.points_of(|_| true)
    }

    /// The vertices of the instances that `chosen` accepts, in world space.
    pub fn points_of(&self, chosen: impl Fn(&Instance) -> bool) -> impl Iterator<Item = Vec3> {
        let positions = |instance: &Instance| self.meshes[instance.mesh as usize].positions.iter();
        let chosen = self.instances.iter().filter(move |instance| chosen(instance));
        chosen.flat_map(move |instance| positions(instance).map(|p| instance.point(*p)))
    }

    /// The bounding box of all instances: its lowest and its highest corner. The first exceeds the second without
    /// vertices.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        bounding_box(self.points())
    }

    /// Number of triangles of all instances.
    pub fn triangles(&self) -> usize {
        self.instances.iter().map(|instance| self.meshes[instance.mesh as usize].triangles.len()).sum()
    }

    /// Prefetches the triangles (instance, primitive) that the next calls of [`Shapes::surface`] read.
    #[inline]
    pub fn prefetch(&self, triangles: impl Iterator<Item = (u32, u32)> + Clone) {
        let corners = |(instance, primitive): (u32, u32)| {
            let mesh = self.instances[instance as usize].mesh as usize;
            (mesh, self.packed[mesh].faces[primitive as usize].corners)
        };
        // All indices are read before the first corner, because the address of a corner depends on its index.
        prefetch(triangles.clone().map(|triangle| corners(triangle).1[0]));
        prefetch(triangles.flat_map(|triangle| {
            let (mesh, corners) = corners(triangle);
            corners.map(|corner| self.packed[mesh].corners[corner as usize].p.x)
        }));
    }

    /// The surface point at barycentric coordinates of a triangle; `None` if the triangle has no area.
    #[inline(always)]
    pub fn surface(&self, instance: u32, primitive: u32, barycentric: [f32; 2]) -> Option<Surface> {
        let placed = &self.instances[instance as usize];
        let mesh = placed.mesh as usize;
        Surface::at(instance, placed, &self.packed[mesh], &self.meshes[mesh], primitive, barycentric)
    }
}
