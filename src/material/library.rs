//! All materials and textures of a scene.

use super::Material;
use crate::texture::Texture;

/// The scene's materials, and the textures they refer to.
#[derive(Clone, Debug, Default)]
pub struct Materials {
    /// Materials; texture indices in them are valid.
    pub list: Vec<Material>,
    /// Textures.
    pub textures: Vec<Texture>,
}

impl Material {
    /// Whether surfaces of this material give light of their own.
    pub fn emits(&self) -> bool {
        self.unlit || self.emission.max_element() > 0.0
    }

    /// Whether the mesh that wears it bounds a solid that light enters.
    pub fn is_solid_glass(&self) -> bool {
        self.transmission > 0.0 && !self.thin
    }
}
