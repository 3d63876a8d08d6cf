//! The parameters of the BSDF at one point, after texture lookups.

use super::SheenModel;
use crate::math::Rgb;

/// Parameters of the BSDF at one point: the metallic-roughness model of glTF with its extensions. Colours and strengths
/// are in `[0, 1]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Colour of metal, of diffuse reflection and of transmission.
    pub base_color: Rgb,
    /// Roughness of diffuse reflection, 0 (Lambertian) to 1: the parameter r of EON.
    pub diffuse_roughness: f32,
    /// Metalness, 0 to 1: weight of the metal in the mixture of metal and dielectric.
    pub metallic: f32,
    /// GGX alpha along the x axis of the frame: the square of the perceptual roughness, increased by anisotropy.
    pub alpha_x: f32,
    /// GGX alpha along the y axis of the frame.
    pub alpha_y: f32,
    /// Index of refraction below the surface (z < 0, the back) over the index above.
    pub eta: f32,
    /// Share (0 to 1) of the dielectric whose base transmits light instead of reflecting it diffusely.
    pub transmission: f32,
    /// Share (0 to 1) of the diffuse light that leaves on the other side (KHR_materials_diffuse_transmission).
    pub diffuse_transmission: f32,
    /// Colour of the diffuse light that leaves on the other side.
    pub diffuse_transmission_color: Rgb,
    /// Whether the surface is a thin wall, which transmits without refraction.
    pub thin: bool,
    /// Strength of the specular reflection of the dielectric (KHR_materials_specular).
    pub specular: f32,
    /// Colour of the dielectric's reflection at normal incidence (KHR_materials_specular); may exceed 1.
    pub specular_color: Rgb,
    /// Colour of the dielectric's reflection at all angles. What it takes away is lost.
    pub reflection_color: Rgb,
    /// Whether light that facets scatter more than once is lost. Solid glass keeps it.
    pub single_scattering: bool,
    /// Strength of the thin film on the interface (KHR_materials_iridescence).
    pub film: f32,
    /// Index of refraction of the thin film over the index above the surface.
    pub film_eta: f32,
    /// Optical path (nm) through the thin film and back at normal incidence: twice its index times its thickness.
    pub film_path: f32,
    /// Strength of the clear coat.
    pub clearcoat: f32,
    /// GGX alpha of the clear coat: the square of its perceptual roughness.
    pub clearcoat_alpha: f32,
    /// Index of refraction of the clear coat over the index above the surface, at least 1.
    pub clearcoat_eta: f32,
    /// Colour of light that passes the clear coat in and out along its normal; white absorbs nothing.
    pub clearcoat_color: Rgb,
    /// Sheen colour.
    pub sheen_color: Rgb,
    /// Alpha of the sheen: the square of its perceptual roughness.
    pub sheen_alpha: f32,
    /// Model of the sheen.
    pub sheen_model: SheenModel,
}

impl Default for Parameters {
    /// Parameters of white diffuse reflection without a specular interface.
    fn default() -> Self {
        Parameters {
            base_color: Rgb::ONE,
            diffuse_roughness: 0.0,
            metallic: 0.0,
            alpha_x: 1.0,
            alpha_y: 1.0,
            eta: 1.5,
            transmission: 0.0,
            diffuse_transmission: 0.0,
            diffuse_transmission_color: Rgb::ONE,
            thin: false,
            specular: 0.0,
            specular_color: Rgb::ONE,
            reflection_color: Rgb::ONE,
            single_scattering: false,
            film: 0.0,
            film_eta: 1.3,
            film_path: 0.0,
            clearcoat: 0.0,
            clearcoat_alpha: 0.0,
            clearcoat_eta: 1.5,
            clearcoat_color: Rgb::ONE,
            sheen_color: Rgb::ZERO,
            sheen_alpha: 0.0,
            sheen_model: SheenModel::Charlie,
        }
    }
}

impl Parameters {
    /// Whether there is a cover over the base: a clear coat or sheen.
    #[inline]
    pub(super) fn is_covered(&self) -> bool {
        self.clearcoat > 0.0 || self.sheen_color.max_element() > 0.0
    }

    /// Whether a surface whose indices of refraction are matched does nothing but transmit light straight, tinted by
    /// the base colour.
    #[inline]
    pub fn is_clear_if_matched(&self) -> bool {
        self.metallic == 0.0 && self.transmission == 1.0 && !self.is_covered()
    }
}
