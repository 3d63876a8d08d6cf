//! Learning where light of the environment arrives, before a method is chosen, so that pilots and render know the same.

use crate::light::LearntSky;
use crate::render::{Settings, TimeSpent, learn_sky};
use crate::scene::{Scene, View};
use crate::stop::Stop;
use std::sync::Arc;

/// Where light of the environment arrives in a picture.
pub struct Learnt {
    /// The table; `None` if it would not reduce the noise.
    pub sky: Option<Arc<LearntSky>>,
    /// Time that the learning took.
    pub spent: TimeSpent,
}

impl Learnt {
    /// Learns for the picture of a view. If `stop` is requested, it ends early, and the render has to end.
    pub fn new(view: View<'_>, settings: &Settings, stop: &Stop) -> Learnt {
        let settings = Settings { stop: stop.clone(), ..settings.clone() };
        let mut spent = TimeSpent::default();
        let sky = spent.measure(|| learn_sky(view, &settings));
        Learnt { sky, spent }
    }

    /// A copy of the scene with the table; `None` if there is none.
    pub fn scene(&self, scene: &Scene) -> Option<Scene> {
        Some(scene.with_learnt_sky(Arc::clone(self.sky.as_ref()?)))
    }

    /// The scene with the table, if there is one.
    pub fn apply(&self, scene: Scene) -> Scene {
        self.scene(&scene).unwrap_or(scene)
    }
}
