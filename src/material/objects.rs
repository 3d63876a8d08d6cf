//! The objects of a scene, as far as rays see them.

use super::{Material, Materials};
use crate::geometry::{Instance, Mesh, Shapes};

/// The objects of a scene: the instances of its meshes, with their materials. All indices are valid.
#[derive(Clone, Copy)]
pub struct Objects<'a> {
    /// Meshes and their instances.
    pub shapes: &'a Shapes,
    /// Materials and their textures.
    pub materials: &'a Materials,
}

impl<'a> Objects<'a> {
    /// The mesh of an instance, in the space of [`Shapes::meshes`].
    pub fn mesh(self, instance: &Instance) -> &'a Mesh {
        &self.shapes.meshes[instance.mesh as usize]
    }

    /// The material of an instance.
    pub fn material(self, instance: &Instance) -> &'a Material {
        &self.materials.list[instance.material as usize]
    }
}
