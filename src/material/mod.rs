//! Materials as glTF and its extensions define them, and their evaluation at surface points.

mod evaluate;
mod input;
mod library;
mod objects;
mod scattering;

pub use crate::medium::{EmissionGrid, MediumGrids, MediumParameters};
pub use input::Input;
pub use library::{MAX_FOCUSING_ROUGHNESS, Materials};
pub use objects::Objects;
pub use scattering::Scattering;

use crate::bsdf::SheenModel;
use crate::math::{Rgb, Vec4};
use crate::texture::TextureRef;
use input::AnyInput;
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

/// A glTF material.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name of the material for messages.
    pub name: String,
    /// Base colour (linear RGB) and alpha, 0 to 1.
    pub base_color: [f32; 4],
    /// Base colour texture (sRGB), alpha in its fourth channel.
    pub base_color_texture: Option<TextureRef>,
    /// Roughness of diffuse reflection, 0 (Lambertian) to 1.
    pub diffuse_roughness: Input<f32>,
    /// Metalness, 0 (dielectric) to 1 (metal).
    pub metallic: Input<f32, 2>,
    /// Perceptual roughness, 0 to 1; the GGX alpha is its square.
    pub roughness: Input<f32, 1>,
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
    pub transmission: Input<f32>,
    /// Share of the diffuse light that leaves on the other side, 0 to 1 (KHR_materials_diffuse_transmission): of a thin
    /// sheet, or of the boundary of a solid, which then does not refract it.
    pub diffuse_transmission: Input<f32, 3>,
    /// Colour of the diffuse light that leaves on the other side.
    pub diffuse_transmission_color: Input<Rgb>,
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
    pub specular: Input<f32, 3>,
    /// Colour of the dielectric's specular reflection at normal incidence (KHR_materials_specular).
    pub specular_color: Input<Rgb>,
    /// Colour of the dielectric's specular reflection at all angles.
    pub reflection_color: Rgb,
    /// Whether light that facets scatter more than once is lost, except in solid glass.
    pub single_scattering: bool,
    /// Strength of the thin film on the interface, 0 to 1 (KHR_materials_iridescence).
    pub iridescence: Input<f32>,
    /// Index of refraction of the thin film, at least 1.
    pub iridescence_ior: f32,
    /// Thickness of the thin film (nm) where its texture is 0, and where it is 1 or there is no texture.
    pub iridescence_thickness: Input<[f32; 2], 1>,
    /// Strength of the clear coat, 0 to 1 (KHR_materials_clearcoat).
    pub clearcoat: Input<f32>,
    /// Perceptual roughness of the clear coat, 0 to 1.
    pub clearcoat_roughness: Input<f32, 1>,
    /// Index of refraction of the clear coat, at least 1; its texture multiplies what exceeds 1.
    pub clearcoat_ior: Input<f32>,
    /// Colour of light that passes the clear coat in and out along its normal; white absorbs nothing.
    pub clearcoat_color: Input<Rgb>,
    /// Texture of tangent-space normals of the clear coat, and the scale of their slopes.
    pub clearcoat_normal_texture: Option<(TextureRef, f32)>,
    /// Sheen colour (KHR_materials_sheen).
    pub sheen_color: Input<Rgb>,
    /// Perceptual roughness of the sheen, 0 to 1.
    pub sheen_roughness: Input<f32, 3>,
    /// Model of the sheen.
    pub sheen_model: SheenModel,
    /// Strength of the anisotropy, 0 to 1 (KHR_materials_anisotropy).
    pub anisotropy: f32,
    /// Rotation of the direction of anisotropy against the tangent (rad, counter-clockwise).
    pub anisotropy_rotation: f32,
    /// Texture of the anisotropy: its direction in RG, its strength in B.
    pub anisotropy_texture: Option<TextureRef>,
    /// Dispersion, as 20 / Abbe number; 0 is none (KHR_materials_dispersion).
    pub dispersion: f32,
}

/// All inputs of a material, given by `&self` or `&mut self`. The first [`SHARES`] do not affect the interface.
macro_rules! inputs {
    ($($material:tt)+) => {
        [
            $($material)+.metallic,
            $($material)+.transmission,
            $($material)+.diffuse_roughness,
            $($material)+.roughness,
            $($material)+.diffuse_transmission,
            $($material)+.diffuse_transmission_color,
            $($material)+.specular,
            $($material)+.specular_color,
            $($material)+.iridescence,
            $($material)+.iridescence_thickness,
            $($material)+.clearcoat,
            $($material)+.clearcoat_roughness,
            $($material)+.clearcoat_ior,
            $($material)+.clearcoat_color,
            $($material)+.sheen_color,
            $($material)+.sheen_roughness,
        ]
    };
}

/// Number of inputs that are shares of what is below the interface.
const SHARES: usize = 2;

impl Material {
    /// References to the textures that the material uses.
    pub fn textures(&self) -> impl Iterator<Item = TextureRef> {
        let inputs: [&dyn AnyInput; _] = inputs!(&self);
        let inputs = inputs.into_iter().filter_map(|input| *input.texture());
        let maps = [self.normal_texture, self.clearcoat_normal_texture].into_iter().flatten().map(|(map, _)| map);
        let others = [self.base_color_texture, self.emission_texture, self.anisotropy_texture];
        inputs.chain(others.into_iter().flatten()).chain(maps)
    }

    /// The references to textures, to change them.
    pub fn textures_mut(&mut self) -> impl Iterator<Item = &mut TextureRef> {
        let inputs: [&mut dyn AnyInput; _] = inputs!(&mut self);
        let inputs = inputs.into_iter().filter_map(|input| input.texture_mut().as_mut());
        let maps = [&mut self.normal_texture, &mut self.clearcoat_normal_texture].into_iter().flatten();
        let others = [&mut self.base_color_texture, &mut self.emission_texture, &mut self.anisotropy_texture];
        inputs.chain(others.into_iter().flatten()).chain(maps.map(|(map, _)| map))
    }

    /// Whether no texture affects the interface, so that all surfaces of the material can share one.
    pub fn has_plain_interface(&self) -> bool {
        let inputs: [&dyn AnyInput; _] = inputs!(&self);
        self.anisotropy_texture.is_none() && inputs[SHARES..].iter().all(|input| input.texture().is_none())
    }

    /// Multiplies the factors by the means of their textures and removes the textures. `keep_alpha`: the base colour's
    /// alpha does not change, because its texture stays.
    pub fn flatten(&mut self, mean: impl Fn(TextureRef) -> Vec4, keep_alpha: bool) {
        let tinted = self.has_textured_tint();
        // What exceeds 1 is multiplied.
        if let Some(texture) = self.clearcoat_ior.texture.take() {
            self.clearcoat_ior.factor = 1.0 + (self.clearcoat_ior.factor - 1.0) * mean(texture).x;
        }
        let inputs: [&mut dyn AnyInput; _] = inputs!(&mut self);
        for input in inputs {
            if let Some(texture) = input.texture_mut().take() {
                input.multiply(mean(texture));
            }
        }
        if let Some(texture) = self.base_color_texture.take() {
            let texel = mean(texture);
            let alpha = if keep_alpha { 1.0 } else { texel.w };
            self.base_color = (Vec4::from_array(self.base_color) * texel.truncate().extend(alpha)).to_array();
        }
        if let Some(texture) = self.emission_texture.take() {
            self.emission *= mean(texture).truncate();
        }
        if tinted {
            self.tint_emission();
        }
        if let Some(texture) = self.anisotropy_texture.take() {
            let texel = mean(texture);
            self.anisotropy *= texel.z;
            self.anisotropy_rotation += (2.0 * texel.y - 1.0).atan2(2.0 * texel.x - 1.0);
        }
        // The mean of a normal map is the surface's normal.
        (self.normal_texture, self.clearcoat_normal_texture) = (None, None);
    }

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
            diffuse_roughness: 0.0.into(),
            metallic: 1.0.into(),
            roughness: 1.0.into(),
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
            transmission: 0.0.into(),
            diffuse_transmission: 0.0.into(),
            diffuse_transmission_color: Rgb::ONE.into(),
            thin: true,
            medium: None,
            grids: None,
            priority: 0,
            optical_contact: false,
            specular: 1.0.into(),
            specular_color: Rgb::ONE.into(),
            reflection_color: Rgb::ONE,
            single_scattering: false,
            iridescence: 0.0.into(),
            iridescence_ior: 1.3,
            iridescence_thickness: [100.0, 400.0].into(),
            clearcoat: 0.0.into(),
            clearcoat_roughness: 0.0.into(),
            clearcoat_ior: 1.5.into(),
            clearcoat_color: Rgb::ONE.into(),
            clearcoat_normal_texture: None,
            sheen_color: Rgb::ZERO.into(),
            sheen_roughness: 0.0.into(),
            sheen_model: SheenModel::Charlie,
            anisotropy: 0.0,
            anisotropy_rotation: 0.0,
            anisotropy_texture: None,
            dispersion: 0.0,
        }
    }
}
