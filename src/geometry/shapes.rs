//! All meshes and instances of a scene.

use super::mesh::Corner;
use super::{Instance, Mesh, Surface};
use crate::processor::prefetch;

/// The scene's geometry.
#[derive(Clone, Debug, Default)]
pub struct Shapes {
    /// Meshes.
    pub meshes: Vec<Mesh>,
    /// Where they stand. Indices in them are valid.
    pub instances: Vec<Instance>,
    /// Vertices of the meshes, as hits read them.
    corners: Vec<Vec<Corner>>,
}

impl Shapes {
    /// Instances standing in the scene; their indices must be valid.
    pub fn new(mut meshes: Vec<Mesh>, instances: Vec<Instance>) -> Shapes {
        let corners = meshes.iter_mut().map(Corner::pack).collect();
        Shapes { meshes, instances, corners }
    }

    /// Number of triangles standing in the scene.
    pub fn triangles(&self) -> usize {
        self.instances.iter().map(|instance| self.meshes[instance.mesh as usize].triangles.len()).sum()
    }

    /// Prefetches the triangles (instance, index) that [`Shapes::surface`] is about to be asked for.
    #[inline]
    pub fn prefetch(&self, triangles: impl Iterator<Item = (u32, u32)> + Clone) {
        let corners = |(instance, primitive): (u32, u32)| {
            let mesh = self.instances[instance as usize].mesh as usize;
            (mesh, self.meshes[mesh].triangles[primitive as usize])
        };
        // All indices before the first corner, because a corner's address waits for its index.
        prefetch(triangles.clone().map(|triangle| corners(triangle).1[0]));
        prefetch(triangles.flat_map(|triangle| {
            let (mesh, corners) = corners(triangle);
            corners.map(|corner| self.corners[mesh][corner as usize].p.x)
        }));
    }

    /// The surface at barycentric coordinates of a triangle; `None` if it has no area.
    #[inline(always)]
    pub fn surface(&self, instance: u32, primitive: u32, barycentric: [f32; 2]) -> Option<Surface> {
        let placed = &self.instances[instance as usize];
        let (mesh, corners) = (&self.meshes[placed.mesh as usize], &self.corners[placed.mesh as usize]);
        Surface::at(instance, placed, mesh, corners, primitive, barycentric)
    }
}
