//! Explanations of a black picture.

use super::{lights, rays};
use crate::camera::Camera;
use crate::light::Light;
use crate::plan::{EffectPlan, PlanRequest};
use crate::scene::Scene;

/// A warning if the camera sees no surface, no scattering medium and no light at infinity; otherwise `None`.
pub(super) fn empty_view(scene: &Scene, camera: &Camera) -> Option<String> {
    let shows_more = scene.survey.scattering || scene.lights.emitters().iter().any(Light::is_infinite);
    (!shows_more && !sees_anything(scene, camera)).then(|| {
        "the camera sees no surface, so the picture will be black; look at its place and direction, or choose another with --camera".into()
    })
}

/// The most likely reason why a picture is black, with a remedy. `warned`: the plan has other warnings.
pub(super) fn reason(
    scene: &Scene,
    camera: &Camera,
    effects: &[EffectPlan],
    request: &PlanRequest,
    warned: bool,
) -> String {
    if scene.lights.is_empty() {
        return "the scene has no light; --light-preset studio or --env gives one".into();
    }
    if !sees_anything(scene, camera) {
        return "the camera sees no surface; look at its place and direction, or choose another with --camera".into();
    }
    if let Some(blocked) = lights::blocked_environment(scene, camera) {
        return blocked;
    }
    let left: Vec<&str> = effects.iter().filter(|e| e.present && !e.simulated).map(|e| e.effect.name()).collect();
    if !left.is_empty() {
        return format!("all its light may be in what is left out: {}", left.join(", "));
    }
    if warned {
        return "the warnings above name the likely reason".into();
    }
    let method = request.method;
    format!("no light has reached the camera: lights may be enclosed or turned away, or too hard to find for {method}")
}

fn sees_anything(scene: &Scene, camera: &Camera) -> bool {
    let mut along = rays::of_camera(camera).zip(0..);
    along.any(|(ray, i)| rays::first(scene, ray.origin, ray.direction, f32::INFINITY, i).is_some())
}
