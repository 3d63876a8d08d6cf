//! Why is there no caustic? What looks like a mistake in the scene, told from the scene alone, each with a remedy.
//!
//! What the file itself shows (open and inverted meshes, a scene without light) is told when it is read and built.
//! Where rays are asked here, they go in fixed directions and their number is fixed: the same scene gets the same
//! answer everywhere.

pub(super) mod black;
mod culling;
mod glass;
mod lamps;
mod overlap;
mod rays;

use super::PlanRequest;
use crate::camera::Camera;
use crate::scene::Scene;

/// All that looks like a mistake.
pub(super) fn warnings(scene: &Scene, camera: &Camera, asked: &PlanRequest) -> Vec<String> {
    let mut warnings = glass::thin(scene);
    warnings.extend(culling::culled(scene, camera));
    warnings.extend(glass::wide(scene));
    warnings.extend(glass::faded(scene));
    warnings.extend(overlap::unordered(scene));
    warnings.extend(lamps::units(scene));
    warnings.extend(lamps::no_environment(scene, asked));
    if !scene.lights.is_empty() {
        warnings.extend(lamps::encased(scene, camera.position()));
        warnings.extend(lamps::shut_out(scene, camera.position()));
        warnings.extend(lamps::behind_glass(scene, asked));
        warnings.extend(glass::unlit(scene));
        warnings.extend(black::nothing_seen(scene, camera));
    }
    warnings
}
