//! `--effects`: leaves effects that are properties of the scene out of its description, before anything is built of it,
//! or out of the scene, to see what they mean to it.

use super::effect::{Effect, EffectSet};
use super::names::{cut_list, worn};
use super::presence::{ENVIRONMENT, SPACE, property};
use crate::error::Result;
use crate::material::{Alpha, Material, Materials};
use crate::math::{Rgb, Vec4};
use crate::scene::{Description, Scene};
use crate::texture::{Integers, Texels, Texture, TextureRef};
use std::sync::Arc;

/// What called for effects that were left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Removed(Vec<(Effect, Vec<String>)>);

impl Removed {
    /// What called for an effect that was left out, by name.
    pub fn because(&self, effect: Effect) -> &[String] {
        self.0.iter().find(|(removed, _)| *removed == effect).map_or(&[], |(_, because)| because)
    }
}

/// Leaves out those of the effects that are no classes of light paths: the scene without them is another scene.
pub fn off(description: &mut Description, effects: EffectSet) -> Removed {
    let properties = effects.iter().filter(|effect| !effect.is_class());
    Removed(properties.map(|effect| (effect, remove(description, effect))).collect())
}

/// Removes an effect; what called for it.
fn remove(description: &mut Description, effect: Effect) -> Vec<String> {
    let instances = description.instances.iter().map(|placed| (placed.material, placed.name.as_str()));
    let mut because = property(effect, &worn(&description.materials, instances));
    if let Some(left) = strip(effect, &mut description.materials, &description.textures) {
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
    cut_list(because)
}

/// The scene without an effect that is a property of it, as [`off`] leaves it out of its description; what is the same
/// is shared. Lenses are the camera's ([`crate::camera::Camera::pinhole`]).
///
/// # Errors
/// Without cut-outs shapes are committed to Embree again, which may be out of memory.
pub fn without(scene: &Scene, effect: Effect) -> Result<Scene> {
    let mut list = scene.materials.list.clone();
    let shared = &scene.materials.textures;
    let textures = strip(effect, &mut list, shared).map_or_else(|| Arc::clone(shared), Arc::from);
    let medium = scene.medium.filter(|_| effect != Effect::Volume);
    let environment = scene.lights.sky().environment.clone().filter(|_| effect != Effect::Environment);
    scene.with_materials(Materials { list, textures }, medium, environment)
}

/// Takes an effect out of materials; the textures that are left, where those change.
fn strip(effect: Effect, materials: &mut [Material], textures: &[Texture]) -> Option<Vec<Texture>> {
    match effect {
        Effect::Volume => materials.iter_mut().for_each(|material| material.medium = None),
        Effect::Dispersion => materials.iter_mut().for_each(|material| material.dispersion = 0.0),
        Effect::Alpha => materials.iter_mut().for_each(|material| material.alpha = Alpha::Opaque),
        Effect::Textures => return Some(flatten_all(materials, textures)),
        _ => {}
    }
    None
}

/// Puts the mean of every texture in its place; the textures that cut-outs need.
fn flatten_all(materials: &mut [Material], textures: &[Texture]) -> Vec<Texture> {
    let means: Vec<Vec4> = textures.iter().map(Texture::mean).collect();
    // Cut-outs are another effect: what they need of textures stays.
    let mut kept = Vec::new();
    for material in materials {
        let cutout = material.base_color_texture.filter(|_| material.alpha != Alpha::Opaque);
        let mask = cutout.and_then(|reference| Some((reference, textures.get(reference.texture as usize)?)));
        let mask = mask.map(|(reference, texture)| {
            kept.push(mask_of(texture));
            TextureRef { texture: kept.len() as u32 - 1, ..reference }
        });
        flatten(
            material,
            |reference| means.get(reference.texture as usize).copied().unwrap_or(Vec4::ONE),
            mask.is_some(),
        );
        material.base_color_texture = mask;
    }
    kept
}

/// White with the texture's alpha.
fn mask_of(texture: &Texture) -> Texture {
    fn white<T: Copy>(data: &[T], channels: u8, most: T) -> Vec<T> {
        // Grey and alpha, or RGBA; without alpha all is white.
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

/// Multiplies the factors of a material by the means of their textures, which it then lacks; `keep_alpha`: the alpha
/// stays with its texture.
fn flatten(material: &mut Material, mean: impl Fn(TextureRef) -> Vec4, keep_alpha: bool) {
    let take = |texture: &mut Option<TextureRef>| texture.take().map_or(Vec4::ONE, &mean);
    let mut base = take(&mut material.base_color_texture);
    if keep_alpha {
        base.w = 1.0;
    }
    material.base_color = (Vec4::from_array(material.base_color) * base).to_array();
    let metallic_roughness = take(&mut material.metallic_roughness_texture);
    material.roughness *= metallic_roughness.y;
    material.metallic *= metallic_roughness.z;
    // The mean of normals is the surface's own.
    material.normal_texture = None;
    let color = |factor: Rgb, texel: Vec4| factor * texel.truncate();
    material.emission = color(material.emission, take(&mut material.emission_texture));
    material.transmission *= take(&mut material.transmission_texture).x;
    material.specular *= take(&mut material.specular_texture).w;
    material.specular_color = color(material.specular_color, take(&mut material.specular_color_texture));
    material.clearcoat *= take(&mut material.clearcoat_texture).x;
    material.clearcoat_roughness *= take(&mut material.clearcoat_roughness_texture).y;
    material.sheen_color = color(material.sheen_color, take(&mut material.sheen_color_texture));
    material.sheen_roughness *= take(&mut material.sheen_roughness_texture).w;
    if material.anisotropy_texture.is_some() {
        let texel = take(&mut material.anisotropy_texture);
        material.anisotropy *= texel.z;
        material.anisotropy_rotation += (2.0 * texel.y - 1.0).atan2(2.0 * texel.x - 1.0);
    }
}
