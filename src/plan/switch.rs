//! `--effects`: removes effects that are properties of the scene, from its description before the scene is built, or
//! from a built scene to measure what they contribute.

use super::names::{truncate_reasons, used_materials};
use super::presence::{ENVIRONMENT, SPACE, material_reasons};
use crate::error::Result;
use crate::material::{Alpha, Material, Materials};
use crate::math::Vec4;
use crate::path_class::{Effect, EffectSet};
use crate::scene::{Description, Scene};
use crate::texture::{Integers, Texels, Texture, TextureRef};
use std::sync::Arc;

/// The effects that were removed from a scene, each with the names of the materials and so on that called for it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Removed(Vec<(Effect, Vec<String>)>);

impl Removed {
    /// Names of the materials and so on that called for the effect before its removal; empty if it was not removed.
    pub fn because(&self, effect: Effect) -> &[String] {
        self.0.iter().find(|(removed, _)| *removed == effect).map_or(&[], |(_, because)| because)
    }
}

/// Removes from a scene's description the effects that are properties of the scene; effects made of path classes stay.
pub fn remove_effects(description: &mut Description, effects: EffectSet) -> Removed {
    let properties = effects.iter().filter(|effect| !effect.is_class());
    Removed(properties.map(|effect| (effect, remove_effect(description, effect))).collect())
}

/// Removes one effect from a description. Returns the names of the materials and so on that called for it; empty if
/// none did.
fn remove_effect(description: &mut Description, effect: Effect) -> Vec<String> {
    let instances = description.instances.iter().map(|placed| (placed.material, placed.name.as_str()));
    let mut because = material_reasons(effect, &used_materials(&description.materials, instances));
    if let Some(left) = remove_from_materials(effect, &mut description.materials, &description.textures) {
        description.textures = left;
    }
    match effect {
        Effect::Volume => {
            because.splice(0..0, description.medium.take().map(|_| SPACE.into()));
        }
        Effect::DepthOfField => {
            for camera in description.cameras.iter_mut().filter(|camera| camera.aperture_radius > 0.0) {
                camera.aperture_radius = 0.0;
                because.push(format!("the aperture of camera \"{}\"", camera.name));
            }
        }
        Effect::Environment => because.extend(description.environment.take().map(|_| ENVIRONMENT.into())),
        _ => {}
    }
    truncate_reasons(because)
}

/// Removes effects from the description of a moment, which may lack materials and what does not move.
pub fn remove_at_moment(description: &mut Description, effects: EffectSet) {
    if !description.materials.is_empty() {
        remove_effects(description, effects);
    } else if effects.iter().any(|effect| effect == Effect::DepthOfField) {
        remove_effect(description, Effect::DepthOfField);
    }
}

/// A copy of the scene without one effect, as [`remove_effects`] removes it from the description. Unchanged data are
/// shared. For depth of field, see [`crate::camera::Camera::without_lens`].
///
/// # Errors
/// The effect is alpha, so shapes are committed to Embree again, and it is out of memory.
pub fn without_effect(scene: &Scene, effect: Effect) -> Result<Scene> {
    let mut list = scene.materials.list.clone();
    let shared = &scene.materials.textures;
    let textures = remove_from_materials(effect, &mut list, shared).map_or_else(|| Arc::clone(shared), Arc::from);
    let medium = scene.medium.filter(|_| effect != Effect::Volume);
    let environment = scene.lights.sky().environment.clone().filter(|_| effect != Effect::Environment);
    scene.with_materials(Materials { list, textures }, medium, environment)
}

/// Removes an effect from materials. Returns the scene's new list of textures if it changes, otherwise `None`.
fn remove_from_materials(effect: Effect, materials: &mut [Material], textures: &[Texture]) -> Option<Vec<Texture>> {
    match effect {
        Effect::Volume => {
            for material in materials {
                (material.medium, material.grids) = (None, None);
            }
        }
        Effect::Dispersion => materials.iter_mut().for_each(|material| material.dispersion = 0.0),
        Effect::Alpha => materials.iter_mut().for_each(|material| material.alpha = Alpha::Opaque),
        Effect::Textures => return Some(flatten_textures(materials, textures)),
        _ => {}
    }
    None
}

/// Replaces every texture of the materials by its mean. Returns the textures that remain, because cut-outs need their
/// alpha.
fn flatten_textures(materials: &mut [Material], textures: &[Texture]) -> Vec<Texture> {
    let means: Vec<Vec4> = textures.iter().map(Texture::mean).collect();
    // Cut-outs are another effect, so their alpha stays.
    let mut kept = Vec::new();
    for material in materials {
        let cutout = material.base_color_texture.filter(|_| material.alpha != Alpha::Opaque);
        let mask = cutout.and_then(|reference| Some((reference, textures.get(reference.texture as usize)?)));
        let mask = mask.map(|(reference, texture)| {
            kept.push(mask_of(texture));
            TextureRef { texture: kept.len() as u32 - 1, ..reference }
        });
        let mean = |reference: TextureRef| means.get(reference.texture as usize).copied().unwrap_or(Vec4::ONE);
        material.flatten(mean, mask.is_some());
        material.base_color_texture = mask;
    }
    kept
}

/// A white texture with the alpha of `texture`.
fn mask_of(texture: &Texture) -> Texture {
    fn white<T: Copy>(data: &[T], channels: u8, most: T) -> Vec<T> {
        // Two channels are grey and alpha, four are RGBA. Without alpha, the texture is opaque.
        let alpha = |texel: &[T]| if channels.is_multiple_of(2) { texel[texel.len() - 1] } else { most };
        data.chunks_exact(usize::from(channels.max(1))).flat_map(|texel| [most, alpha(texel)]).collect()
    }
    let texels = match &texture.texels {
        Texels::Integers { data, channels, encoding } => {
            let data = match &**data {
                Integers::Bytes(data) => Integers::Bytes(white(data, *channels, u8::MAX)),
                Integers::Words(data) => Integers::Words(white(data, *channels, u16::MAX)),
            };
            Texels::Integers { data: Arc::new(data), channels: 2, encoding: *encoding }
        }
        Texels::Floats(data) => Texels::Floats(data.iter().map(|texel| [1.0, 1.0, 1.0, texel[3]]).collect()),
    };
    Texture { name: texture.name.clone(), texels, ..*texture }
}
