//! Scene, camera and settings that a render reads.

use crate::camera::Camera;
use crate::error::Result;
use crate::estimator::PixelAccumulator;
use crate::random::{Domain, Purpose, Streams};
use crate::render::settings::{Levels, Settings};
use crate::scene::Scene;
use crate::transport::{CameraPaths, InitialMedia};

/// The moments of a scene that moves while the shutter is open.
pub trait Motion: Sync {
    /// The scene and the camera at `time`, from 0, when the shutter opens, to 1, when it closes. All moments have the
    /// same instances and lights, in the same order.
    ///
    /// # Errors
    /// The scene cannot be read or built at this time.
    fn at(&self, time: f64) -> Result<(Scene, Camera)>;
}

/// Scene, camera and settings of a render, and the media at the ray origins of camera and lights.
pub struct RenderInput<'a> {
    pub(in crate::render) scene: &'a Scene,
    pub(in crate::render) camera: &'a Camera,
    pub(in crate::render) settings: Settings,
    pub(in crate::render) initial_media: InitialMedia,
    /// The moments of the scene, one of which each iteration renders; `None`: nothing moves.
    pub(in crate::render) motion: Option<&'a dyn Motion>,
}

impl<'a> RenderInput<'a> {
    /// Joins the input of a render. For methods without bandwidth levels it sets one level.
    pub fn new(scene: &'a Scene, camera: &'a Camera, settings: &Settings) -> RenderInput<'a> {
        let mut settings = settings.clone();
        if !settings.method.has_levels() {
            settings.levels = Levels::new(1);
        }
        RenderInput { scene, camera, settings, initial_media: InitialMedia::of(scene, camera), motion: None }
    }

    /// The input of a render with motion blur: every iteration renders the scene at one of the moments.
    #[must_use]
    pub fn with_motion(self, motion: Option<&'a dyn Motion>) -> RenderInput<'a> {
        RenderInput { motion, ..self }
    }

    /// Whether the scene changes between iterations.
    pub(in crate::render) fn moves(&self) -> bool {
        self.motion.is_some()
    }

    /// Renders one iteration by `render`, with the input at the moment of the iteration.
    ///
    /// # Errors
    /// The scene cannot be built at this moment.
    pub(in crate::render) fn at_iteration<T>(&self, i: u64, render: impl FnOnce(&RenderInput<'_>) -> T) -> Result<T> {
        self.at_time(time_of_iteration(self.settings.seed, i), render)
    }

    /// Measures the scene by `measure` in the middle of the shutter interval. The frame itself may be outside of it, and
    /// lights may be dark there.
    ///
    /// # Errors
    /// The scene cannot be built at this moment.
    pub(in crate::render) fn in_the_middle<T>(&self, measure: impl FnOnce(&RenderInput<'_>) -> T) -> Result<T> {
        self.at_time(0.5, measure)
    }

    fn at_time<T>(&self, time: f64, act: impl FnOnce(&RenderInput<'_>) -> T) -> Result<T> {
        let Some(motion) = self.motion else { return Ok(act(self)) };
        let (scene, camera) = motion.at(time)?;
        let input = RenderInput::new(&scene, &camera, &self.settings);
        Ok(act(&input.with_motion(Some(motion))))
    }

    /// The settings of the render.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Makes the tracer of camera paths.
    pub(in crate::render) fn camera_paths(&self) -> CameraPaths<'_> {
        self.settings.camera_paths(self.scene, self.camera, &self.initial_media)
    }

    /// All pixels before the first iteration, for methods whose pixels have no bandwidths; none if the user has stopped the
    /// render.
    pub(in crate::render) fn initial_pixels(&self) -> Vec<PixelAccumulator> {
        self.settings.pixels(self.scene, &vec![[0.0; 2]; self.pixels()])
    }

    /// All pixels of a render without iterations.
    pub(in crate::render) fn empty_pixels(&self) -> Vec<PixelAccumulator> {
        vec![self.settings.pixel_factory(self.scene)(&[0.0; 2]); self.pixels()]
    }

    /// Width and height of the picture (pixels).
    pub fn size(&self) -> (u32, u32) {
        self.camera.size()
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        let (width, height) = self.size();
        width as usize * height as usize
    }
}

/// The time of iteration `i` (from 1) within the shutter interval, 0 to 1. The times of a quarter of the iterations follow
/// a low-discrepancy sequence, and the sequences of the quarters are scrambled independently.
fn time_of_iteration(seed: u64, i: u64) -> f64 {
    Streams::in_sequence(seed, i, Domain::Shutter).path(0).vertex(0).one_fine(Purpose::Moment)
}
