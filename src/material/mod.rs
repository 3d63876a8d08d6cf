//! Materials as glTF and its extensions define them: parameters and textures, evaluated at a surface.

mod evaluate;
mod library;
mod scattering;

pub use crate::medium::MediumParameters;
pub use library::{MAX_FOCUSING_ROUGHNESS, Materials};
pub use scattering::Scattering;

use crate::math::Rgb;
use crate::texture::TextureRef;
use std::f32::consts::FRAC_PI_2;

/// How alpha acts.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Alpha {
    /// Ignored.
    #[default]
    Opaque,
    /// A hit counts where alpha is at least the cut-off.
    Mask(f32),
    /// A hit counts with probability alpha.
    Blend,
}

/// A glTF material. Factors multiply their textures.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name for messages.
    pub name: String,
    /// Base colour and alpha.
    pub base_color: [f32; 4],
    /// Base colour texture (sRGB), alpha in its fourth channel.
    pub base_color_texture: Option<TextureRef>,
    /// Metalness.
    pub metallic: f32,
    /// Perceptual roughness; the GGX alpha is its square.
    pub roughness: f32,
    /// Roughness in G, metalness in B.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normals and their scale.
    pub normal_texture: Option<(TextureRef, f32)>,
    /// Emitted radiance (W/sr/m2): factor times strength.
    pub emission: Rgb,
    /// Half angle (rad) of the cone that it emits into, towards whose edge it falls off; a right angle: Lambertian.
    pub spread: f32,
    /// Emission texture (sRGB).
    pub emission_texture: Option<TextureRef>,
    /// Alpha mode.
    pub alpha: Alpha,
    /// Back faces emit too (and nothing else: scattering always has two sides).
    pub double_sided: bool,
    /// Cameras look through its back faces; all light meets them.
    pub culled: bool,
    /// Light passes it as if nothing were there; what it emits it emits all the same.
    pub null_bsdf: bool,
    /// KHR_materials_unlit: emits its base colour, scatters nothing.
    pub unlit: bool,
    /// Index of refraction (KHR_materials_ior), at least 1; infinity for the extension's legacy 0.
    pub ior: f32,
    /// KHR_materials_transmission.
    pub transmission: f32,
    /// Transmission texture, R.
    pub transmission_texture: Option<TextureRef>,
    /// The mesh is a thin wall (no refraction) rather than the boundary of a solid.
    pub thin: bool,
    /// What fills the solid: absorption from KHR_materials_volume, or `extras.caustique.medium`.
    pub medium: Option<MediumParameters>,
    /// Nested dielectrics: where solids overlap, the one of highest priority is there.
    pub priority: i32,
    /// It lies on opaque surfaces, or others on it, without a film of air: paint, a label, a liquid.
    pub optical_contact: bool,
    /// KHR_materials_specular strength.
    pub specular: f32,
    /// Its texture, A.
    pub specular_texture: Option<TextureRef>,
    /// KHR_materials_specular colour.
    pub specular_color: Rgb,
    /// Its texture (sRGB).
    pub specular_color_texture: Option<TextureRef>,
    /// KHR_materials_clearcoat.
    pub clearcoat: f32,
    /// Its texture, R.
    pub clearcoat_texture: Option<TextureRef>,
    /// Clearcoat roughness.
    pub clearcoat_roughness: f32,
    /// Its texture, G.
    pub clearcoat_roughness_texture: Option<TextureRef>,
    /// KHR_materials_sheen colour.
    pub sheen_color: Rgb,
    /// Its texture (sRGB).
    pub sheen_color_texture: Option<TextureRef>,
    /// Sheen roughness.
    pub sheen_roughness: f32,
    /// Its texture, A.
    pub sheen_roughness_texture: Option<TextureRef>,
    /// KHR_materials_anisotropy strength.
    pub anisotropy: f32,
    /// Rotation of its direction against the tangent, radians counter-clockwise.
    pub anisotropy_rotation: f32,
    /// Its texture: direction in RG, strength in B.
    pub anisotropy_texture: Option<TextureRef>,
    /// KHR_materials_dispersion: 20 / Abbe number; 0 is none.
    pub dispersion: f32,
}

impl Default for Material {
    /// glTF's default material: white, rough, fully metallic (the specification's own defaults).
    fn default() -> Self {
        Material {
            name: String::new(),
            base_color: [1.0; 4],
            base_color_texture: None,
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
            thin: true,
            medium: None,
            priority: 0,
            optical_contact: false,
            specular: 1.0,
            specular_texture: None,
            specular_color: Rgb::ONE,
            specular_color_texture: None,
            clearcoat: 0.0,
            clearcoat_texture: None,
            clearcoat_roughness: 0.0,
            clearcoat_roughness_texture: None,
            sheen_color: Rgb::ZERO,
            sheen_color_texture: None,
            sheen_roughness: 0.0,
            sheen_roughness_texture: None,
            anisotropy: 0.0,
            anisotropy_rotation: 0.0,
            anisotropy_texture: None,
            dispersion: 0.0,
        }
    }
}
