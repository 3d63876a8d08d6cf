//! Where light arrives, learnt before a render.

mod lights;
mod sky;
mod table;

pub(super) use lights::{BINS, LightCell};
pub use lights::{LearntLights, LightBins};
pub use sky::{LearntSky, SkySectors};
pub(super) use table::LEARNT_SHARE;
pub use table::{LightSamples, LitSample};

use std::sync::Arc;

/// What was learnt about the light of a picture.
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
