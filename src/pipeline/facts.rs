//! What a picture's file tells of its scene: plain data, so that it can be told without the scene.

use super::layers;
use crate::film::output::Shape;
use crate::image::exr;
use crate::light::MAX_GROUPS;
use crate::render::output::layer_shape;
use crate::render::{Settings, ShardResult};
use crate::scene::description::PictureDefaults;
use crate::scene::{CameraRequest, MAX_SIZE, Scene};
use serde::{Deserialize, Serialize};

use crate::error::Result;

/// What layers, their names and the header need to know.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Facts {
    /// What layers there are.
    pub shape: Shape,
    /// What cryptomattes name.
    pub(super) named: layers::Named,
    /// Where the picture is in the whole one, and its camera.
    pub frame: exr::Frame,
    /// What reading the scene has warned of.
    pub warnings: Vec<String>,
    /// The picture that the scene was made for.
    pub made_for: PictureDefaults,
}

impl Facts {
    /// Those of a render of a scene with these settings.
    ///
    /// # Errors
    /// The scene has no such camera.
    pub(super) fn new(scene: &Scene, request: &CameraRequest, settings: &Settings) -> Result<Facts> {
        let whole = scene.whole_camera(request)?;
        let (width, height) = whole.size();
        let [x, y, ..] = scene.window(request, (width, height))?.unwrap_or_default();
        let [world_to_camera, world_to_ndc] = whole.matrices(scene.origin);
        Ok(Facts {
            shape: layer_shape(settings, scene),
            named: layers::Named::of(scene),
            frame: exr::Frame { display: [width, height], corner: [x, y], world_to_camera, world_to_ndc },
            warnings: scene.warnings.clone(),
            made_for: scene.picture,
        })
    }

    /// Whether they can be of a picture that is made of this part: a file can say anything.
    pub(super) fn are_sound(&self, part: &ShardResult) -> bool {
        let Settings { method, levels, .. } = &part.settings;
        let Shape { levels: count, own, compared, groups, .. } = &self.shape;
        let [width, height] = self.frame.display;
        let [x, y] = self.frame.corner;
        let inside = |corner: u32, size: u32, whole: u32| corner.checked_add(size).is_some_and(|end| end <= whole);
        (*count, *own, *compared) == (levels.count, levels.picture_level(), part.settings.compared_levels())
            && (groups.is_empty() || method.has_techniques() && groups.len() <= MAX_GROUPS)
            && inside(x, part.size.0, width.min(MAX_SIZE))
            && inside(y, part.size.1, height.min(MAX_SIZE))
    }
}
