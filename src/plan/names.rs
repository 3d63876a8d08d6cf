//! Names of materials, objects and lights in reasons and warnings; long lists are truncated.

use crate::light::{Emitter, Light};
use crate::material::Material;
use crate::scene::Scene;
use std::collections::HashSet;

/// Maximum number of names on a line of a message; the others are counted.
const MAX_NAMES: usize = 3;
/// Maximum number of reasons in a list of a message; the others are counted.
const MAX_REASONS: usize = 4;

/// Lists names, at most [`MAX_NAMES`] of them: `a, b, c and 12 more`.
pub(crate) fn truncate_names(names: &[String]) -> String {
    let shown = names.iter().take(MAX_NAMES).cloned().collect::<Vec<_>>().join(", ");
    if names.len() > MAX_NAMES { format!("{shown} and {} more", names.len() - MAX_NAMES) } else { shown }
}

/// Keeps at most [`MAX_REASONS`] reasons for an effect, and appends the number of the others.
pub(crate) fn truncate_reasons(mut reasons: Vec<String>) -> Vec<String> {
    let more = reasons.len().saturating_sub(MAX_REASONS);
    if more > 0 {
        reasons.truncate(MAX_REASONS);
        reasons.push(format!("and {more} more"));
    }
    reasons
}

/// A material and the objects of the scene that use it, for messages.
pub(crate) struct UsedMaterial<'a> {
    pub(crate) material: &'a Material,
    /// Quoted names of the objects, each once, in the scene's order.
    pub(crate) objects: Vec<String>,
}

impl UsedMaterial<'_> {
    /// Describes the material in a message: `material "glass" on "Cube", "Ball" and 2 more`.
    pub(crate) fn label(&self) -> String {
        format!("material \"{}\" on {}", self.material.name, truncate_names(&self.objects))
    }
}

/// The materials that `instances` use; each item is the index of a material and the name of an object with it.
pub(crate) fn used_materials<'a>(
    materials: &'a [Material],
    instances: impl Iterator<Item = (u32, &'a str)>,
) -> Vec<UsedMaterial<'a>> {
    let mut all: Vec<UsedMaterial> =
        materials.iter().map(|material| UsedMaterial { material, objects: vec![] }).collect();
    let mut known = HashSet::new();
    for (material, object) in instances {
        if known.insert((material, object)) {
            all[material as usize].objects.push(format!("\"{object}\""));
        }
    }
    all.retain(|used| !used.objects.is_empty());
    all
}

/// The materials that the instances of a scene use.
pub(crate) fn used_in_scene(scene: &Scene) -> Vec<UsedMaterial<'_>> {
    used_materials(&scene.materials.list, scene.shapes.instances.iter().map(|i| (i.material, i.name.as_str())))
}

/// Names of the lights that have power and satisfy `which`; each emissive object is listed once.
pub(crate) fn lights(scene: &Scene, which: impl Fn(&Emitter) -> bool) -> Vec<String> {
    let sky = scene.lights.sky();
    let mut known = HashSet::new();
    let emitters = scene.lights.emitters().iter().enumerate();
    let shining = emitters.filter(|(_, emitter)| which(emitter) && emitter.power(sky) > 0.0);
    shining.map(|(index, _)| scene.light_name(index)).filter(|name| known.insert(name.clone())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lists_are_truncated() {
        let names = |n: usize| (0..n).map(|i| format!("n{i}")).collect::<Vec<_>>();
        assert_eq!(truncate_names(&names(3)), "n0, n1, n2");
        assert_eq!(truncate_names(&names(15)), "n0, n1, n2 and 12 more");
        assert_eq!(truncate_reasons(names(4)).len(), 4);
        assert_eq!(truncate_reasons(names(16)).last().map(String::as_str), Some("and 12 more"));
    }
}
