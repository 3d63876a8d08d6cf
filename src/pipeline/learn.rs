//! Learning where light arrives, before a method is chosen, so that pilots and render know the same.

use crate::light::LearntLight;
use crate::render::{Settings, TimeSpent, learn_light};
use crate::scene::View;
use crate::stop::Stop;

/// Where light arrives in a picture.
pub struct Learnt {
    /// What was learnt.
    pub light: LearntLight,
    /// Time that the learning took.
    pub spent: TimeSpent,
}

impl Learnt {
    /// Learns for the picture of a view. If `stop` is requested, it ends early, and the render has to end.
    pub fn new(view: View<'_>, settings: &Settings, stop: &Stop) -> Learnt {
        let settings = Settings { stop: stop.clone(), ..settings.clone() };
        let mut spent = TimeSpent::default();
        let light = spent.measure(|| learn_light(view, &settings));
        Learnt { light, spent }
    }
}
