//! Warns about back faces that the camera looks through.

use super::rays;
use crate::camera::Camera;
use crate::math::Vec2;
use crate::scene::Scene;
use std::collections::BTreeSet;

/// Number of test rays along each edge of the picture.
const RAYS_PER_EDGE: u32 = 16;
/// Maximum number of objects that the warning names; the others are counted.
const MAX_NAMES: usize = 3;

/// A warning that names the objects whose back faces the camera would see if glTF did not cull them; `None` if there
/// are none.
pub(super) fn culled_objects(scene: &Scene, camera: &Camera) -> Option<String> {
    if !scene.survey.culled {
        return None;
    }
    let (width, height) = camera.size();
    let mut objects = BTreeSet::new();
    for k in 0..RAYS_PER_EDGE * RAYS_PER_EDGE {
        let at = |k: u32, size: u32| (k as f32 + 0.5) / RAYS_PER_EDGE as f32 * size as f32;
        let ray = camera.ray(Vec2::new(at(k % RAYS_PER_EDGE, width), at(k / RAYS_PER_EDGE, height)), Vec2::splat(0.5));
        if let Some(surface) = rays::first(scene, ray.origin, ray.direction, f32::INFINITY, 0)
            && scene.culls(&surface, ray.direction)
        {
            objects.insert(scene.shapes.instances[surface.instance as usize].name.as_str());
        }
    }
    let names: Vec<String> = objects.iter().take(MAX_NAMES).map(|name| format!("\"{name}\"")).collect();
    let more =
        if objects.len() > MAX_NAMES { format!(" and {} more", objects.len() - MAX_NAMES) } else { String::new() };
    let objects = if objects.len() == 1 { "object" } else { "objects" };
    (!names.is_empty()).then(|| {
        format!(
            "{objects} {}{more}: the camera looks through back faces, which glTF culls where a material is not double-sided; set doubleSided to see them",
            names.join(", ")
        )
    })
}
