//! A scene as one camera sees it.

use super::Scene;
use crate::camera::Camera;

/// A scene and the camera that a render, a plan or a pilot looks through.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// The scene to look at.
    pub scene: &'a Scene,
    /// The camera, sized for the picture.
    pub camera: &'a Camera,
}

impl<'a> View<'a> {
    /// The view of `scene` through `camera`.
    pub fn new(scene: &'a Scene, camera: &'a Camera) -> View<'a> {
        View { scene, camera }
    }
}
