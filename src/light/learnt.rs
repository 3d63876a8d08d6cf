//! What was learnt about the light of a picture before a render.

use super::learnt_lights::LearntLights;
use super::learnt_sky::LearntSky;
use std::sync::Arc;

/// Where light arrives in a picture.
#[derive(Clone, Default)]
pub struct LearntLight {
    /// From where light of the environment arrives; `None` if knowing it would not reduce the noise.
    pub sky: Option<Arc<LearntSky>>,
    /// Which lights arrive; `None` if knowing it would not reduce the noise.
    pub lights: Option<Arc<LearntLights>>,
}

impl LearntLight {
    /// Whether nothing was learnt.
    pub fn is_empty(&self) -> bool {
        self.sky.is_none() && self.lights.is_none()
    }
}
