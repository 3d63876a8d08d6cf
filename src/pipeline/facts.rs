//! The facts of a scene that the layers and the header of its picture need, so that shards can be merged without the
//! scene.

use super::layers::SceneNames;
use crate::film::output::Shape;
use crate::image::exr;
use crate::light::MAX_GROUPS;
use crate::render::output::layer_shape;
use crate::render::{Settings, ShardResult};
use crate::scene::description::PictureDefaults;
use crate::scene::{CameraRequest, MAX_SIZE, Scene};
use serde::{Deserialize, Serialize};

use crate::error::Result;

/// The facts of a scene that the layers and the header of its picture need.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SceneFacts {
    /// The layers that the render's EXR has.
    pub shape: Shape,
    /// Names of objects and materials for the cryptomatte layers.
    pub(super) names: SceneNames,
    /// Position of the rendered window within the whole picture, and the matrices of the camera.
    pub frame: exr::Frame,
    /// Warnings from reading the scene.
    pub warnings: Vec<String>,
    /// Motion vectors of the pixels, row by row from the top; `None` unless the user has asked for them.
    pub(super) motion: Option<Vec<[f32; 4]>>,
    /// Frame, frame rate, exposure and tone curve that the scene asks for.
    pub made_for: PictureDefaults,
}

impl SceneFacts {
    /// Collects the facts for a render of a scene with these settings.
    ///
    /// # Errors
    /// The scene has no such camera.
    pub(super) fn new(scene: &Scene, request: &CameraRequest, settings: &Settings) -> Result<SceneFacts> {
        let whole = scene.whole_camera(request)?;
        let (width, height) = whole.size();
        let [x, y, ..] = scene.window(request, (width, height))?.unwrap_or_default();
        let (world_to_camera, world_to_ndc) = whole.matrices(scene.origin);
        Ok(SceneFacts {
            shape: layer_shape(settings, scene),
            names: SceneNames::of(scene),
            frame: exr::Frame { display: [width, height], corner: [x, y], world_to_camera, world_to_ndc },
            warnings: scene.warnings.clone(),
            motion: None,
            made_for: scene.picture,
        })
    }

    /// Whether the facts fit the shard `part`: both may come from a damaged or forged file.
    pub(super) fn are_sound(&self, part: &ShardResult) -> bool {
        let Settings { method, levels, .. } = &part.settings;
        let Shape { levels: count, own, compared, groups, .. } = &self.shape;
        let [width, height] = self.frame.display;
        let [x, y] = self.frame.corner;
        let inside = |corner: u32, size: u32, whole: u32| corner.checked_add(size).is_some_and(|end| end <= whole);
        (*count, *own, *compared) == (levels.count, levels.picture_level(), part.settings.compared_levels())
            && (groups.is_empty() || method.has_techniques() && groups.len() <= MAX_GROUPS)
            && self.shape.lobes == part.settings.lobes
            && self.shape.merges == part.settings.merges_one_level()
            && inside(x, part.size.0, width.min(MAX_SIZE))
            && inside(y, part.size.1, height.min(MAX_SIZE))
            && self.motion.as_ref().is_none_or(|motion| motion.len() == part.size.0 as usize * part.size.1 as usize)
    }
}
