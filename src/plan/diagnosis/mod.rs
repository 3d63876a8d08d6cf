//! Warnings about likely mistakes in a scene, such as glass without a caustic, each with a remedy.
//!
//! Reading and building the scene already warns about mistakes in the file itself (open and inverted meshes, a scene
//! without light). The checks here trace a fixed number of rays in fixed directions, so a scene always gets the same
//! warnings.

pub(super) mod black;
mod culling;
mod glass;
mod lights;
mod overlap;
mod rays;

use super::PlanRequest;
use crate::camera::Camera;
use crate::scene::Scene;

/// The warnings of all checks.
pub(super) fn warnings(scene: &Scene, camera: &Camera, request: &PlanRequest) -> Vec<String> {
    let mut warnings = glass::thin(scene);
    warnings.extend(culling::culled(scene, camera));
    warnings.extend(glass::frosted(scene));
    warnings.extend(glass::alpha_glass(scene));
    warnings.extend(overlap::unordered(scene));
    warnings.extend(lights::units(scene));
    warnings.extend(lights::no_environment(scene, request));
    if !scene.lights.is_empty() {
        warnings.extend(lights::encased(scene, camera.position()));
        warnings.extend(lights::shut_out(scene, camera.position()));
        warnings.extend(lights::behind_glass(scene, request));
        warnings.extend(glass::unlit(scene));
        warnings.extend(black::nothing_seen(scene, camera));
    }
    warnings
}
