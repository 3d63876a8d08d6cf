//! All meshes and instances of a scene.

use super::{Instance, Mesh, Surface};

/// The scene's geometry.
#[derive(Clone, Debug, Default)]
pub struct Shapes {
    /// Meshes.
    pub meshes: Vec<Mesh>,
    /// Where they stand. Indices in them are valid.
    pub instances: Vec<Instance>,
}

impl Shapes {
    /// The surface at barycentric coordinates of a triangle; `None` if it has no area.
    #[inline]
    pub fn surface(&self, instance: u32, primitive: u32, barycentric: [f32; 2]) -> Option<Surface> {
        let placed = &self.instances[instance as usize];
        Surface::at(instance, placed, &self.meshes[placed.mesh as usize], primitive, barycentric[0], barycentric[1])
    }
}
