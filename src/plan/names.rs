//! Materials, objects and lights by name: what calls for an effect, in words that are cut where there are many.

use crate::light::Emitter;
use crate::material::Material;
use crate::scene::Scene;
use std::collections::HashSet;

/// Names that stand on a line; the others are counted.
const ON_A_LINE: usize = 3;
/// Reasons that are listed; the others are counted.
const REASONS: usize = 4;

/// `a, b, c and 12 more`.
pub(super) fn cut(names: &[String]) -> String {
    let shown = names.iter().take(ON_A_LINE).cloned().collect::<Vec<_>>().join(", ");
    if names.len() > ON_A_LINE { format!("{shown} and {} more", names.len() - ON_A_LINE) } else { shown }
}

/// The first reasons, and how many there are besides.
pub(super) fn cut_list(mut reasons: Vec<String>) -> Vec<String> {
    let more = reasons.len().saturating_sub(REASONS);
    if more > 0 {
        reasons.truncate(REASONS);
        reasons.push(format!("and {more} more"));
    }
    reasons
}

/// A material and the objects that wear it.
pub(super) struct Worn<'a> {
    pub(super) material: &'a Material,
    /// Quoted names, each once, in the scene's order.
    pub(super) objects: Vec<String>,
}

impl Worn<'_> {
    /// `material "glass" on "Cube", "Ball" and 2 more`.
    pub(super) fn label(&self) -> String {
        format!("material \"{}\" on {}", self.material.name, cut(&self.objects))
    }
}

/// The materials that something wears; `instances` are index of the material and name of the object.
pub(super) fn worn<'a>(materials: &'a [Material], instances: impl Iterator<Item = (u32, &'a str)>) -> Vec<Worn<'a>> {
    let mut all: Vec<Worn> = materials.iter().map(|material| Worn { material, objects: vec![] }).collect();
    let mut known = HashSet::new();
    for (material, object) in instances {
        if known.insert((material, object)) {
            all[material as usize].objects.push(format!("\"{object}\""));
        }
    }
    all.retain(|worn| !worn.objects.is_empty());
    all
}

/// The materials that something in the scene wears.
pub(super) fn worn_in(scene: &Scene) -> Vec<Worn<'_>> {
    worn(&scene.materials.list, scene.shapes.instances.iter().map(|i| (i.material, i.name.as_str())))
}

/// Lights that give light, each object that glows once; `which` chooses among them.
pub(super) fn lights(scene: &Scene, which: impl Fn(&Emitter) -> bool) -> Vec<String> {
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
    fn long_lists_are_cut() {
        let names = |n: usize| (0..n).map(|i| format!("n{i}")).collect::<Vec<_>>();
        assert_eq!(cut(&names(3)), "n0, n1, n2");
        assert_eq!(cut(&names(15)), "n0, n1, n2 and 12 more");
        assert_eq!(cut_list(names(4)).len(), 4);
        assert_eq!(cut_list(names(16)).last().map(String::as_str), Some("and 12 more"));
    }
}
