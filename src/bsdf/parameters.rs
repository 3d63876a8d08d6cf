//! What a material says at one point, textures looked up.

use crate::math::Rgb;

/// Parameters of the scattering model at one point: glTF's metallic-roughness model with its extensions.
/// Colours and strengths are in `[0, 1]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Colour of metal, of diffuse reflection and of transmission.
    pub base_color: Rgb,
    /// Share of metal.
    pub metallic: f32,
    /// GGX width along the frame's x axis (the square of perceptual roughness, widened by anisotropy).
    pub alpha_x: f32,
    /// GGX width along the frame's y axis.
    pub alpha_y: f32,
    /// Index of refraction below the surface (local z < 0, the back) over the one above.
    pub eta: f32,
    /// Share of the dielectric that transmits instead of reflecting diffusely.
    pub transmission: f32,
    /// Transmits without refraction: a wall without thickness.
    pub thin: bool,
    /// KHR_materials_specular strength.
    pub specular: f32,
    /// KHR_materials_specular colour of reflection at normal incidence; may exceed 1.
    pub specular_color: Rgb,
    /// Strength of the clear coat.
    pub clearcoat: f32,
    /// GGX width of the clear coat.
    pub clearcoat_alpha: f32,
    /// Sheen colour.
    pub sheen_color: Rgb,
    /// Sheen's width (the square of its perceptual roughness).
    pub sheen_alpha: f32,
}

impl Default for Parameters {
    /// White matte, without a Fresnel layer.
    fn default() -> Self {
        Parameters {
            base_color: Rgb::ONE,
            metallic: 0.0,
            alpha_x: 1.0,
            alpha_y: 1.0,
            eta: 1.5,
            transmission: 0.0,
            thin: false,
            specular: 0.0,
            specular_color: Rgb::ONE,
            clearcoat: 0.0,
            clearcoat_alpha: 0.0,
            sheen_color: Rgb::ZERO,
            sheen_alpha: 0.0,
        }
    }
}

impl Parameters {
    /// Something lies on top of the base.
    #[inline]
    pub(super) fn is_covered(&self) -> bool {
        self.clearcoat > 0.0 || self.sheen_color.max_element() > 0.0
    }

    /// Where the indices match, light goes straight through it, tinted by the base colour, and does nothing else.
    #[inline]
    pub fn is_clear_if_matched(&self) -> bool {
        self.metallic == 0.0 && self.transmission == 1.0 && !self.is_covered()
    }
}
