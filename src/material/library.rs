//! All materials and textures of a scene.

use super::{Alpha, Material};
use crate::bsdf::{DELTA_ALPHA, refraction_width};
use crate::geometry::Surface;
use crate::math::Rgb;
use crate::texture::Texture;
use std::sync::Arc;

/// Perceptual roughness from which on a lobe is too wide to focus light into caustics or to show reflections.
pub const MAX_FOCUSING_ROUGHNESS: f32 = 0.45;

/// The materials of a scene, and their textures.
#[derive(Clone, Debug, Default)]
pub struct Materials {
    /// The materials, by their index. Their texture indices are valid.
    pub list: Vec<Material>,
    /// Textures, which scenes may share.
    pub textures: Arc<[Texture]>,
}

/// Whether a lobe of this perceptual roughness is a delta lobe: a perfect mirror or clear interface.
fn is_perfect(roughness: f32) -> bool {
    roughness * roughness < DELTA_ALPHA
}

impl Material {
    /// Whether surfaces of this material emit light.
    pub fn emits(&self) -> bool {
        self.unlit || self.emission.max_element() > 0.0
    }

    /// Upper bound on the radiance that surfaces emit, over all texels, without vertex colours (W/sr/m2).
    pub fn brightest_emission(&self) -> Rgb {
        if self.unlit { Rgb::from_slice(&self.base_color[..3]) } else { self.emission }
    }

    /// How alpha acts at each hit. The alpha of a solid acts only where a ray enters it ([`Alpha::Opaque`] here): a ray
    /// that passed only one of its two faces would travel in the wrong medium.
    pub fn alpha_per_hit(&self) -> Alpha {
        if self.has_alpha_per_entry() { Alpha::Opaque } else { self.alpha }
    }

    /// Whether a ray passes or enters a solid of this material as a whole, by one decision at the entry. Solids that
    /// emit light decide at each face instead.
    #[inline]
    pub fn has_alpha_per_entry(&self) -> bool {
        self.alpha != Alpha::Opaque && self.is_solid() && !self.emits()
    }

    /// Probability that a ray hits the surface and does not pass through it because of alpha.
    pub fn coverage(&self, surface: &Surface, textures: &[Texture]) -> f32 {
        match self.alpha {
            Alpha::Opaque => 1.0,
            Alpha::Mask(cutoff) => f32::from(u8::from(self.alpha(surface, textures) >= cutoff)),
            Alpha::Blend => self.alpha(surface, textures).clamp(0.0, 1.0),
        }
    }

    /// Whether surfaces of this material may transmit light.
    #[inline]
    pub fn transmits(&self) -> bool {
        self.transmission.factor > 0.0 || self.diffuse_transmission.factor > 0.0
    }

    /// Whether a mesh of this material is the boundary of a solid that light enters: of glass, or of a body whose
    /// surface transmits light diffusely.
    pub fn is_solid(&self) -> bool {
        self.transmits() && !self.thin
    }

    /// Whether the base, without coats, may have a narrow lobe (delta or sharp).
    fn has_narrow_base(&self) -> bool {
        self.is_narrow() || self.roughness.texture.is_some()
    }

    /// Whether the lobe of the base is narrow (delta or sharp) everywhere: a texture can only make it narrower.
    fn is_narrow(&self) -> bool {
        let glass = self.transmission.factor > 0.0 && !self.thin;
        let width = if glass { refraction_width(self.ior) } else { 1.0 };
        self.roughness.factor * width.sqrt() < MAX_FOCUSING_ROUGHNESS
    }

    /// Whether the material is glass or a mirror, perfect or slightly rough, everywhere: it shows what is behind it or in
    /// front of it.
    pub fn is_smooth(&self) -> bool {
        let glass = self.transmission.factor >= 0.5 && self.transmission.texture.is_none();
        let metal = self.metallic.factor >= 0.5 && self.metallic.texture.is_none();
        self.is_narrow() && (glass || metal)
    }

    /// Whether the material shows reflections: its base or its clear coat may have a narrow lobe (delta or sharp).
    pub fn is_glossy(&self) -> bool {
        self.has_narrow_base() || self.clearcoat.factor > 0.0
    }

    /// Whether the base or the clear coat may have a delta lobe, and whether one of them may have a narrow lobe that is
    /// not a delta lobe.
    pub fn perfect_and_sharp(&self) -> (bool, bool) {
        let base = (self.roughness.factor, self.roughness.texture.is_some());
        let coat = (self.clearcoat_roughness.factor, self.clearcoat_roughness.texture.is_some());
        let lobes = [Some(base), (self.clearcoat.factor > 0.0).then_some(coat)];
        let any =
            |of: &dyn Fn(f32) -> bool| lobes.iter().flatten().any(|&(roughness, textured)| textured || of(roughness));
        let sharp = any(&|roughness| !is_perfect(roughness) && roughness < MAX_FOCUSING_ROUGHNESS);
        (any(&is_perfect), sharp || (self.has_narrow_base() && !is_perfect(self.roughness.factor)))
    }

    /// Whether the material is only a perfect mirror or clear glass, which shows other surfaces but no light that falls
    /// on itself.
    pub fn is_clear(&self) -> bool {
        let perfect = is_perfect(self.roughness.factor) && self.roughness.texture.is_none();
        let glass =
            self.transmission.factor == 1.0 && self.transmission.texture.is_none() && self.metallic.factor == 0.0;
        let covered = self.clearcoat.factor > 0.0 || self.sheen_color.factor != Rgb::ZERO;
        perfect && (glass || self.metallic.factor == 1.0) && !covered
    }

    /// Whether the material makes visible caustics: a mirror or glass with a narrow lobe. The boundary of smoke, with the
    /// index of air, bends no light; in water, the water is glass.
    pub fn focuses(&self) -> bool {
        let bends = self.transmission.factor > 0.0 && self.ior != 1.0;
        self.has_narrow_base() && (bends || self.metallic.factor >= 0.5)
    }

    /// Whether the material fills a solid whose index of refraction depends on the wavelength.
    #[inline]
    pub fn disperses(&self) -> bool {
        self.dispersion > 0.0 && self.ior > 1.0 && self.ior.is_finite() && self.transmission.factor > 0.0 && !self.thin
    }

    /// Index of refraction of a dispersive material at a wavelength (nm): Cauchy's equation through the lines of the
    /// Abbe number, 486.1, 587.6 and 656.3 nm \[KHR_materials_dispersion\].
    #[inline]
    pub fn ior_at(&self, nm: f32) -> f32 {
        let spread = (self.ior - 1.0) * self.dispersion * (1.0 / 20.0);
        (self.ior + spread * (523_655.0 / (nm * nm) - 1.5168)).max(1.0)
    }
}
