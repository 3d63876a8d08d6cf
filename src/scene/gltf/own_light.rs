//! Whether a file has a light of its own at any time, so that no other light is added to the file.

use super::animation::MovingParts;
use super::document::Document;
use super::profiles;
use serde_json::Value;

/// Whether one of the nodes, given by their indices, has a light at some time. Punctual lights and fires count at any
/// strength, also if they are hidden, because they are there on purpose. Surfaces count if `surfaces` is true, and if
/// they glow at some time.
pub(super) fn has_light(
    document: &Document,
    moving: Option<&MovingParts>,
    mut nodes: impl Iterator<Item = usize>,
    surfaces: bool,
) -> bool {
    let glows = |index: usize| {
        let material = document.part("materials", index);
        let is_fire = material["extras"]["caustique"]["medium"]["emission"].is_object();
        is_fire || (surfaces && (emits(material) || moving.is_some_and(|moving| moving.emissions.contains(&index))))
    };
    nodes.any(|node| {
        let raw = document.part("nodes", node);
        let mesh = document.nodes[node].mesh.and_then(|mesh| document.meshes.get(mesh.value()));
        let mut materials = mesh.into_iter().flat_map(|mesh| &mesh.primitives).filter_map(|part| part.material);
        raw["extensions"]["KHR_lights_punctual"].is_object()
            || profiles::has_light(raw)
            || materials.any(|material| glows(material.value()))
    })
}

/// Whether surfaces of a raw material emit light.
fn emits(material: &Value) -> bool {
    let extensions = &material["extensions"];
    let strength = extensions["KHR_materials_emissive_strength"]["emissiveStrength"].as_f64().unwrap_or(1.0);
    let mut factors = material["emissiveFactor"].as_array().into_iter().flatten().filter_map(Value::as_f64);
    extensions["KHR_materials_unlit"].is_object() || (strength > 0.0 && factors.any(|factor| factor > 0.0))
}
