//! Materials as glTF and its extensions define them, and their evaluation at surface points.

mod evaluate;
mod library;
mod scattering;

pub use crate::medium::{EmissionGrid, MediumGrids, MediumParameters};
pub use library::{MAX_FOCUSING_ROUGHNESS, Materials};
pub use scattering::Scattering;

use crate::bsdf::SheenModel;
use crate::math::Rgb;
use crate::texture::TextureRef;
use std::f32::consts::FRAC_PI_2;
use std::sync::Arc;

/// The effect of the alpha channel: the alpha mode of glTF.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Alpha {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Rays hit the surface where alpha is at least this cut-off.
    Mask(f32),
    /// Rays hit the surface with the probability alpha.
    Blend,
}

/// A glTF material. Factors multiply their textures.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name of the material for messages.
    pub name: String,
    /// Base colour (linear RGB) and alpha, 0 to 1.
    pub base_color: [f32; 4],
    /// Base colour texture (sRGB), alpha in its fourth channel.
    pub base_color_texture: Option<TextureRef>,
    /// Roughness of diffuse reflection, 0 (Lambertian) to 1.
    pub diffuse_roughness: f32,
    /// Texture of the roughness of diffuse reflection, in R.
    pub diffuse_roughness_texture: Option<TextureRef>,
    /// Metalness, 0 (dielectric) to 1 (metal).
    pub metallic: f32,
    /// Perceptual roughness, 0 to 1; the GGX alpha is its square.
    pub roughness: f32,
    /// Texture with roughness in G and metalness in B.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Texture of tangent-space normals, and the scale of their slopes.
    pub normal_texture: Option<(TextureRef, f32)>,
    /// Emitted radiance (W/sr/m2): factor times strength.
    pub emission: Rgb,
    /// Half angle (rad) of the cone into which the surface emits; emission falls off towards its edge. Pi / 2 means
    /// Lambertian emission.
    pub spread: f32,
    /// Emission texture (sRGB).
    pub emission_texture: Option<TextureRef>,
    /// How alpha decides whether rays hit the surface.
    pub alpha: Alpha,
    /// Whether back faces emit. Scattering always has two sides.
    pub double_sided: bool,
    /// Whether camera rays pass through back faces. Other rays hit them.
    pub culled: bool,
    /// Whether all rays pass through the surface. It may still emit.
    pub null_bsdf: bool,
    /// Whether the surface only emits its base colour and scatters nothing (KHR_materials_unlit).
    pub unlit: bool,
    /// Index of refraction (KHR_materials_ior), at least 1; infinity for the extension's legacy 0.
    pub ior: f32,
    /// Share of light that the dielectric's base transmits, 0 to 1 (KHR_materials_transmission).
    pub transmission: f32,
    /// Texture of the transmission, in R.
    pub transmission_texture: Option<TextureRef>,
    /// Share of the diffuse light that leaves on the other side, 0 to 1 (KHR_materials_diffuse_transmission): of a thin
    /// sheet, or of the boundary of a solid, which then does not refract it.
    pub diffuse_transmission: f32,
    /// Texture of the diffuse transmission, in A.
    pub diffuse_transmission_texture: Option<TextureRef>,
    /// Colour of the diffuse light that leaves on the other side.
    pub diffuse_transmission_color: Rgb,
    /// Texture of the colour of diffuse transmission (sRGB).
    pub diffuse_transmission_color_texture: Option<TextureRef>,
    /// Whether the mesh is a thin wall without refraction. Otherwise it is the boundary of a solid.
    pub thin: bool,
    /// Medium that fills the solid: from KHR_materials_volume and KHR_materials_volume_scatter, or
    /// `extras.caustique.medium`.
    pub medium: Option<MediumParameters>,
    /// Grids by which the medium varies in space; `None` for a homogeneous one.
    pub grids: Option<Arc<MediumGrids>>,
    /// Priority of nested dielectrics: where solids overlap, the one with the highest priority counts.
    pub priority: i32,
    /// Whether the surface touches opaque surfaces without a film of air: paint, a label, a liquid.
    pub optical_contact: bool,
    /// Strength of the dielectric's specular reflection, 0 to 1 (KHR_materials_specular).
    pub specular: f32,
    /// Texture of the specular strength, in A.
    pub specular_texture: Option<TextureRef>,
    /// Colour of the dielectric's specular reflection at normal incidence (KHR_materials_specular).
    pub specular_color: Rgb,
    /// Texture of the specular colour (sRGB).
    pub specular_color_texture: Option<TextureRef>,
    /// Strength of the thin film on the interface, 0 to 1 (KHR_materials_iridescence).
    pub iridescence: f32,
    /// Texture of the thin film's strength, in R.
    pub iridescence_texture: Option<TextureRef>,
    /// Index of refraction of the thin film, at least 1.
    pub iridescence_ior: f32,
    /// Thickness of the thin film (nm) where its texture is 0, and where it is 1 or there is no texture.
    pub iridescence_thickness: [f32; 2],
    /// Texture of the thin film's thickness, in G.
    pub iridescence_thickness_texture: Option<TextureRef>,
    /// Strength of the clear coat, 0 to 1 (KHR_materials_clearcoat).
    pub clearcoat: f32,
    /// Texture of the clear coat's strength, in R.
    pub clearcoat_texture: Option<TextureRef>,
    /// Perceptual roughness of the clear coat, 0 to 1.
    pub clearcoat_roughness: f32,
    /// Index of refraction of the clear coat, at least 1, where its texture is 1 or there is none.
    pub clearcoat_ior: f32,
    /// Texture of the index of refraction of the clear coat, which is 1 where the texture is 0, in R.
    pub clearcoat_ior_texture: Option<TextureRef>,
    /// Colour of light that passes the clear coat in and out along its normal; white absorbs nothing.
    pub clearcoat_color: Rgb,
    /// Texture of the colour of the clear coat (sRGB).
    pub clearcoat_color_texture: Option<TextureRef>,
    /// Texture of the clear coat's roughness, in G.
    pub clearcoat_roughness_texture: Option<TextureRef>,
    /// Texture of tangent-space normals of the clear coat, and the scale of their slopes.
    pub clearcoat_normal_texture: Option<(TextureRef, f32)>,
    /// Sheen colour (KHR_materials_sheen).
    pub sheen_color: Rgb,
    /// Texture of the sheen colour (sRGB).
    pub sheen_color_texture: Option<TextureRef>,
    /// Perceptual roughness of the sheen, 0 to 1.
    pub sheen_roughness: f32,
    /// Model of the sheen.
    pub sheen_model: SheenModel,
    /// Texture of the sheen's roughness, in A.
    pub sheen_roughness_texture: Option<TextureRef>,
    /// Strength of the anisotropy, 0 to 1 (KHR_materials_anisotropy).
    pub anisotropy: f32,
    /// Rotation of the direction of anisotropy against the tangent (rad, counter-clockwise).
    pub anisotropy_rotation: f32,
    /// Texture of the anisotropy: its direction in RG, its strength in B.
    pub anisotropy_texture: Option<TextureRef>,
    /// Dispersion, as 20 / Abbe number; 0 is none (KHR_materials_dispersion).
    pub dispersion: f32,
}

impl Material {
    /// The light that the medium in a solid of the material emits; `None` if it emits none.
    pub fn medium_emission(&self) -> Option<&EmissionGrid> {
        self.grids.as_ref().filter(|_| self.medium.is_some() && self.is_solid())?.emission.as_ref()
    }
}

impl Default for Material {
    /// The default material of the glTF specification: white, rough, fully metallic.
    fn default() -> Self {
        Material {
            name: String::new(),
            base_color: [1.0; 4],
            base_color_texture: None,
            diffuse_roughness: 0.0,
            diffuse_roughness_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            emission: Rgb::ZERO,
            spread: FRAC_PI_2,
            emission_texture: None,
            alpha: Alpha::Opaque,
            double_sided: false,
            culled: false,
            null_bsdf: false,
            unlit: false,
            ior: 1.5,
            transmission: 0.0,
            transmission_texture: None,
            diffuse_transmission: 0.0,
            diffuse_transmission_texture: None,
            diffuse_transmission_color: Rgb::ONE,
            diffuse_transmission_color_texture: None,
            thin: true,
            medium: None,
            grids: None,
            priority: 0,
            optical_contact: false,
            specular: 1.0,
            specular_texture: None,
            specular_color: Rgb::ONE,
            specular_color_texture: None,
            iridescence: 0.0,
            iridescence_texture: None,
            iridescence_ior: 1.3,
            iridescence_thickness: [100.0, 400.0],
            iridescence_thickness_texture: None,
            clearcoat: 0.0,
            clearcoat_texture: None,
            clearcoat_roughness: 0.0,
            clearcoat_ior: 1.5,
            clearcoat_ior_texture: None,
            clearcoat_color: Rgb::ONE,
            clearcoat_color_texture: None,
            clearcoat_roughness_texture: None,
            clearcoat_normal_texture: None,
            sheen_color: Rgb::ZERO,
            sheen_color_texture: None,
            sheen_roughness: 0.0,
            sheen_model: SheenModel::Charlie,
            sheen_roughness_texture: None,
            anisotropy: 0.0,
            anisotropy_rotation: 0.0,
            anisotropy_texture: None,
            dispersion: 0.0,
        }
    }
}
