//! Back faces that the camera looks through.

use super::rays;
use crate::camera::Camera;
use crate::math::Vec2;
use crate::scene::Scene;
use std::collections::BTreeSet;

/// Rays along each side of the picture.
const RAYS: u32 = 16;
/// Objects that are named.
const NAMES: usize = 3;

/// One sentence for all objects whose back faces the camera would see if glTF did not cull them.
pub(super) fn culled(scene: &Scene, camera: &Camera) -> Option<String> {
    if !scene.survey.culled {
        return None;
    }
    let (width, height) = camera.size();
    let mut objects = BTreeSet::new();
    for k in 0..RAYS * RAYS {
        let at = |k: u32, size: u32| (k as f32 + 0.5) / RAYS as f32 * size as f32;
        let ray = camera.ray(Vec2::new(at(k % RAYS, width), at(k / RAYS, height)), Vec2::splat(0.5));
        if let Some(surface) = rays::first(scene, ray.origin, ray.direction, f32::INFINITY, 0)
            && scene.culls(&surface, ray.direction)
        {
            objects.insert(scene.shapes.instances[surface.instance as usize].name.as_str());
        }
    }
    let names: Vec<String> = objects.iter().take(NAMES).map(|name| format!("\"{name}\"")).collect();
    let more = if objects.len() > NAMES { format!(" and {} more", objects.len() - NAMES) } else { String::new() };
    let objects = if objects.len() == 1 { "object" } else { "objects" };
    (!names.is_empty()).then(|| {
        format!(
            "{objects} {}{more}: the camera looks through back faces, which glTF culls where a material is not double-sided; set doubleSided to see them",
            names.join(", ")
        )
    })
}
