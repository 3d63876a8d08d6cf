//! Warnings about likely mistakes in a scene, such as glass without a caustic, each with a remedy.
//!
//! Reading and building the scene already warns about mistakes in the file itself (open and inverted meshes, a scene
//! without light). The checks here trace a fixed number of rays in fixed directions, so a scene always gets the same
//! warnings.

mod black;
mod culling;
mod glass;
mod lights;
mod overlap;
mod rays;
mod terminator;

use crate::camera::Camera;
use crate::plan::{Plan, PlanRequest};
use crate::scene::Scene;

/// Adds the warnings of all checks to a plan that was made for `request`, and the likely reason if the picture turns out
/// black.
pub fn add(plan: &mut Plan, scene: &Scene, camera: &Camera, request: &PlanRequest) {
    plan.warnings.extend(warnings(scene, camera, request));
    plan.reason_if_black = black::reason(scene, camera, &plan.effects, request, !plan.warnings.is_empty());
    plan.warnings.extend(terminator::stepped_shadows(scene));
}

/// Warnings about likely mistakes in the scene, in sentences for the user.
fn warnings(scene: &Scene, camera: &Camera, request: &PlanRequest) -> Vec<String> {
    let mut warnings = glass::thin_walls(scene);
    warnings.extend(culling::culled_objects(scene, camera));
    warnings.extend(glass::frosted_glass(scene));
    warnings.extend(glass::alpha_glass(scene));
    warnings.extend(overlap::overlapping_solids(scene));
    warnings.extend(lights::wrong_units(scene));
    warnings.extend(lights::missing_environment(scene, request));
    if !scene.lights.is_empty() {
        warnings.extend(lights::encased_lights(scene, camera.position()));
        warnings.extend(lights::blocked_environment(scene, camera));
        warnings.extend(lights::delta_lights_behind_glass(scene, request));
        warnings.extend(glass::unlit_glass(scene));
        warnings.extend(black::empty_view(scene, camera));
    }
    warnings
}
