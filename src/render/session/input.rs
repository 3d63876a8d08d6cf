//! Scene, camera and settings that a session renders.

use crate::camera::Camera;
use crate::render::settings::{Levels, Settings};
use crate::scene::Scene;
use crate::transport::InitialMedia;

/// Scene, camera and settings of a render, and the media at the ray origins of camera and lights.
pub struct RenderInput<'a> {
    pub(super) scene: &'a Scene,
    pub(super) camera: &'a Camera,
    pub(super) settings: Settings,
    pub(super) initial_media: InitialMedia,
}

impl<'a> RenderInput<'a> {
    /// Joins the input of a render. For methods without bandwidth levels it sets one level.
    pub fn new(scene: &'a Scene, camera: &'a Camera, settings: &Settings) -> RenderInput<'a> {
        let mut settings = settings.clone();
        if !settings.method.has_levels() {
            settings.levels = Levels::new(1);
        }
        RenderInput { scene, camera, settings, initial_media: InitialMedia::of(scene, camera) }
    }

    /// The settings of the render.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Width and height of the picture (pixels).
    pub fn size(&self) -> (u32, u32) {
        self.camera.size()
    }
}
