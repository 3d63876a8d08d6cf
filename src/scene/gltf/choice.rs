//! Choice of the scene, the animations and the material variant to read, and the list of all that a file offers.

use super::container;
use super::document::{Document, Playing, get, named};
use super::{Pose, ReadOptions, fault};
use crate::error::{Error, ErrorKind, Result};
use crate::scene::description::{AnimationContents, ExtensionContents, FileContents};
use gltf::json::Index;
use serde_json::Value;

const VARIANTS: &str = "KHR_materials_variants";

/// Sets the scene, the animations and the material variant of a document to those that `options` name.
///
/// # Errors
/// The document has none of that name.
pub(super) fn apply(document: &mut Document, options: &ReadOptions) -> Result<()> {
    if let Some(name) = &options.scene {
        document.chosen_scene = Some(find(&list(&document.raw["scenes"]), "scene", name)?);
    }
    if let Some(name) = &options.variant {
        let variant = find(&list(&document.raw["extensions"][VARIANTS]["variants"]), "variant", name)?;
        set_materials(document, variant)?;
    }
    document.playing = match (options.pose, &options.animation) {
        (Pose::Rest, _) => Playing::None,
        (Pose::Animated, None) => Playing::All,
        (Pose::Animated, Some(name)) => Playing::One(find(&list(&document.raw["animations"]), "animation", name)?),
    };
    Ok(())
}

/// Gives each primitive the material that it has in the variant with this index.
fn set_materials(document: &mut Document, variant: usize) -> Result<()> {
    let Document { raw, meshes, .. } = document;
    for (index, mesh) in meshes.iter_mut().enumerate() {
        let raw = &raw["meshes"][index]["primitives"];
        for (i, primitive) in mesh.primitives.iter_mut().enumerate() {
            let mappings = raw[i]["extensions"][VARIANTS]["mappings"].as_array().into_iter().flatten();
            let is_for = |mapping: &&Value| {
                mapping["variants"].as_array().is_some_and(|list| list.contains(&Value::from(variant)))
            };
            let Some(mapping) = mappings.into_iter().find(is_for) else { continue };
            let material = mapping["material"].as_u64().and_then(|material| u32::try_from(material).ok());
            primitive.material = Some(Index::new(material.ok_or_else(|| {
                let place = format!("{}, primitive {i}, {VARIANTS}", named("mesh", mesh.name.as_deref(), index));
                fault(place, "its material is not an index").hint("the file is damaged: export it again")
            })?));
        }
    }
    Ok(())
}

/// Names of the items of a list in the document; an item without a name is called by its index.
fn list(items: &Value) -> Vec<String> {
    let name = |(i, item): (usize, &Value)| {
        let name = item["name"].as_str().filter(|name| !name.is_empty());
        name.map_or_else(|| i.to_string(), str::to_owned)
    };
    items.as_array().into_iter().flatten().enumerate().map(name).collect()
}

/// Index of the first item called `name`.
fn find(names: &[String], kind: &str, name: &str) -> Result<usize> {
    names.iter().position(|own| own == name).ok_or_else(|| {
        let quoted: Vec<String> = names.iter().map(|own| format!("\"{own}\"")).collect();
        let error = Error::new(ErrorKind::Usage, "", format!("there is no {kind} \"{name}\""));
        error.hint(match quoted.len() {
            0 => format!("the file has no {kind}"),
            _ => format!("the file has {}", quoted.join(", ")),
        })
    })
}

/// Lists the scenes, animations, variants and extensions of a document.
pub(super) fn contents(document: &Document) -> FileContents {
    let scenes = list(&document.raw["scenes"]);
    let scene = document.scene_index().ok().filter(|index| *index < scenes.len());
    let animations = list(&document.raw["animations"]).into_iter().enumerate();
    let animations = animations.map(|(i, name)| AnimationContents { name, seconds: seconds(document, i) }).collect();
    let variants = list(&document.raw["extensions"][VARIANTS]["variants"]);
    let (used, required) = container::extensions(&document.raw);
    let extension = |name: String| ExtensionContents {
        is_required: required.contains(&name),
        is_read: container::is_supported(&name),
        name,
    };
    let extensions = used.into_iter().map(extension).collect();
    FileContents { scenes, scene, animations, variants, extensions, is_by_blender: document.is_by_blender() }
}

/// Times of the first and the last key of an animation (seconds), as its accessors state them.
fn seconds(document: &Document, animation: usize) -> Option<[f64; 2]> {
    let samplers = document.raw["animations"][animation]["samplers"].as_array()?;
    let bound = |sampler: &Value, key: &str| {
        let accessor = usize::try_from(sampler["input"].as_u64()?).ok()?;
        get(&document.accessors, accessor, "accessor").ok()?;
        document.part("accessors", accessor)[key][0].as_f64()
    };
    let times = |key| samplers.iter().filter_map(move |sampler| bound(sampler, key));
    Some([times("min").min_by(f64::total_cmp)?, times("max").max_by(f64::total_cmp)?])
}
