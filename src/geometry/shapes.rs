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

    /// Number of triangles standing in the scene.
    pub fn triangles(&self) -> usize {
        self.instances.iter().map(|instance| self.meshes[instance.mesh as usize].triangles.len()).sum()
    }

    /// Looks at the memory of triangles (instance, index) that [`Shapes::surface`] is about to be asked for, at all of
    /// it at once, so that the processor waits once. Returns something that depends on it.
    #[inline]
    pub fn touch(&self, triangles: impl Iterator<Item = (u32, u32)> + Clone) -> f32 {
        let corners = |(instance, primitive): (u32, u32)| {
            let mesh = self.instances[instance as usize].mesh as usize;
            (mesh, self.meshes[mesh].triangles[primitive as usize])
        };
        let indices: u32 = triangles.clone().map(|t| corners(t).1[0] & 1).sum();
        let places = triangles.map(|t| {
            let (mesh, corners) = corners(t);
            corners.iter().map(|&c| self.corners[mesh][c as usize].p.x).sum::<f32>()
        });
        places.sum::<f32>() + indices as f32
    }

    /// The surface at barycentric coordinates of a triangle; `None` if it has no area.
    #[inline(always)]
    pub fn surface(&self, instance: u32, primitive: u32, barycentric: [f32; 2]) -> Option<Surface> {
        let placed = &self.instances[instance as usize];
        let (mesh, corners) = (&self.meshes[placed.mesh as usize], &self.corners[placed.mesh as usize]);
        Surface::at(instance, placed, mesh, corners, primitive, barycentric)
    }
}
