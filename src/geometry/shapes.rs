//! All meshes and instances of a scene.

use super::mesh::Corner;
use super::{Instance, Mesh, Surface};

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

    /// The surface at barycentric coordinates of a triangle; `None` if it has no area.
    #[inline]
    pub fn surface(&self, instance: u32, primitive: u32, barycentric: [f32; 2]) -> Option<Surface> {
        let placed = &self.instances[instance as usize];
        let (mesh, corners) = (&self.meshes[placed.mesh as usize], &self.corners[placed.mesh as usize]);
        Surface::at(instance, placed, mesh, corners, primitive, barycentric)
    }
}
