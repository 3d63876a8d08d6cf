//! All materials and textures of a scene.

use super::{Alpha, Material};
use crate::bsdf::{DELTA_ALPHA, refraction_width};
use crate::geometry::Surface;
use crate::math::Rgb;
use crate::texture::{Texture, TextureRef};
use std::sync::Arc;

/// Wider lobes focus no light and show no reflections.
pub const MAX_FOCUSING_ROUGHNESS: f32 = 0.45;

/// The scene's materials, and the textures they refer to.
#[derive(Clone, Debug, Default)]
pub struct Materials {
    /// Materials; texture indices in them are valid.
    pub list: Vec<Material>,
    /// Textures; another scene may share them.
    pub textures: Arc<[Texture]>,
}

/// Whether lobes of some roughness have no width.
fn is_perfect(roughness: f32) -> bool {
    roughness * roughness < DELTA_ALPHA
}

impl Material {
    /// Whether surfaces of this material give light of their own.
    pub fn emits(&self) -> bool {
        self.unlit || self.emission.max_element() > 0.0
    }

    /// No texel emits more than this, vertex colours aside.
    pub fn brightest_emission(&self) -> Rgb {
        if self.unlit { Rgb::from_slice(&self.base_color[..3]) } else { self.emission }
    }

    /// How alpha acts on each ray that comes by. That of a solid decides once, where a ray enters it: a face that is
    /// passed on the way in or out alone would leave light in glass that is not there.
    pub fn alpha_per_hit(&self) -> Alpha {
        if self.has_alpha_per_entry() { Alpha::Opaque } else { self.alpha }
    }

    /// Whether it fills a solid that a ray passes, or not, as a whole. One that gives light is hit or not, face by face.
    #[inline]
    pub fn has_alpha_per_entry(&self) -> bool {
        self.alpha != Alpha::Opaque && self.is_solid_glass() && !self.emits()
    }

    /// Probability that a ray that comes by meets the surface: 1 but for cut-outs.
    pub fn coverage(&self, surface: &Surface, textures: &[Texture]) -> f32 {
        match self.alpha {
            Alpha::Opaque => 1.0,
            Alpha::Mask(cutoff) => f32::from(u8::from(self.alpha(surface, textures) >= cutoff)),
            Alpha::Blend => self.alpha(surface, textures).clamp(0.0, 1.0),
        }
    }

    /// Whether light may go on behind it.
    #[inline]
    pub fn transmits(&self) -> bool {
        self.transmission > 0.0
    }

    /// Whether the mesh that wears it bounds a solid that light enters.
    pub fn is_solid_glass(&self) -> bool {
        self.transmits() && !self.thin
    }

    /// Whether its base (coatings aside) reflects or bends light into narrow lobes somewhere.
    fn has_narrow_base(&self) -> bool {
        let width = if self.is_solid_glass() { refraction_width(self.ior) } else { 1.0 };
        self.roughness * width.sqrt() < MAX_FOCUSING_ROUGHNESS || self.metallic_roughness_texture.is_some()
    }

    /// Whether it shows reflections: its base, or a coating, has a narrow lobe.
    pub fn is_glossy(&self) -> bool {
        self.has_narrow_base() || self.clearcoat > 0.0
    }

    /// Whether its base or a coating may have a lobe without width, and whether one that is narrow and has a width.
    pub fn perfect_and_sharp(&self) -> (bool, bool) {
        let base = (self.roughness, self.metallic_roughness_texture.is_some());
        let coat = (self.clearcoat_roughness, self.clearcoat_roughness_texture.is_some());
        let lobes = [Some(base), (self.clearcoat > 0.0).then_some(coat)];
        let any =
            |of: &dyn Fn(f32) -> bool| lobes.iter().flatten().any(|&(roughness, textured)| textured || of(roughness));
        let sharp = any(&|roughness| !is_perfect(roughness) && roughness < MAX_FOCUSING_ROUGHNESS);
        (any(&is_perfect), sharp || (self.has_narrow_base() && !is_perfect(self.roughness)))
    }

    /// Whether it is a perfect mirror or clear glass and nothing else, which shows what is behind it and has no light
    /// of its own to show.
    pub fn is_clear(&self) -> bool {
        let perfect = is_perfect(self.roughness) && self.metallic_roughness_texture.is_none();
        let glass = self.transmission == 1.0 && self.transmission_texture.is_none() && self.metallic == 0.0;
        let covered = self.clearcoat > 0.0 || self.sheen_color != Rgb::ZERO;
        perfect && (glass || self.metallic == 1.0) && !covered
    }

    /// Whether it makes caustics that count: mirrors and glass, narrow enough to focus light.
    pub fn focuses(&self) -> bool {
        self.has_narrow_base() && (self.transmission > 0.0 || self.metallic >= 0.5)
    }

    /// The textures it reads.
    pub fn textures(&self) -> impl Iterator<Item = TextureRef> {
        [
            self.base_color_texture,
            self.metallic_roughness_texture,
            self.normal_texture.map(|(texture, _)| texture),
            self.emission_texture,
            self.transmission_texture,
            self.specular_texture,
            self.specular_color_texture,
            self.clearcoat_texture,
            self.clearcoat_roughness_texture,
            self.sheen_color_texture,
            self.sheen_roughness_texture,
            self.anisotropy_texture,
        ]
        .into_iter()
        .flatten()
    }

    /// Whether the index of refraction of the solid it fills depends on the wavelength.
    #[inline]
    pub fn disperses(&self) -> bool {
        self.dispersion > 0.0 && self.ior > 1.0 && self.ior.is_finite() && self.is_solid_glass()
    }

    /// Index of refraction at a wavelength (nm), where it disperses: Cauchy's equation with the Abbe number's lines of
    /// 486.1, 587.6 and 656.3 nm \[KHR_materials_dispersion\].
    #[inline]
    pub fn ior_at(&self, nm: f32) -> f32 {
        let spread = (self.ior - 1.0) * self.dispersion * (1.0 / 20.0);
        (self.ior + spread * (523_655.0 / (nm * nm) - 1.5168)).max(1.0)
    }
}
