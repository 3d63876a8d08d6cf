//! Scene, camera and settings that a render reads.

use crate::camera::Camera;
use crate::estimator::PixelAccumulator;
use crate::render::settings::{Levels, Settings};
use crate::scene::Scene;
use crate::transport::{CameraPaths, InitialMedia};

/// Scene, camera and settings of a render, and the media at the ray origins of camera and lights.
pub struct RenderInput<'a> {
    pub(in crate::render) scene: &'a Scene,
    pub(in crate::render) camera: &'a Camera,
    pub(in crate::render) settings: Settings,
    pub(in crate::render) initial_media: InitialMedia,
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

    /// Makes the tracer of camera paths.
    pub(in crate::render) fn camera_paths(&self) -> CameraPaths<'_> {
        self.settings.camera_paths(self.scene, self.camera, &self.initial_media)
    }

    /// All pixels before the first iteration, for methods whose pixels have no bandwidths.
    pub(in crate::render) fn initial_pixels(&self) -> Vec<PixelAccumulator> {
        self.settings.initial_pixels(self.scene, self.camera)
    }

    /// Width and height of the picture (pixels).
    pub fn size(&self) -> (u32, u32) {
        self.camera.size()
    }
}
