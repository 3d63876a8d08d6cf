//! What of a scene decides which classes of light there are, and which layers.

use crate::plan::{ClassSet, Effect, PathClass};
use crate::scene::Scene;

/// What of a scene decides which layers there are.
#[derive(Clone, Copy, Debug, Default)]
pub struct Present {
    /// An environment shines.
    pub environment: bool,
    /// Media scatter.
    pub volume: bool,
    /// Mirrors, glass or gloss are there.
    pub narrow_lobes: bool,
}

impl Present {
    /// In `scene`.
    pub fn of(scene: &Scene) -> Present {
        Present {
            environment: scene.lights.sky().environment.is_some(),
            volume: scene.survey.scattering,
            narrow_lobes: scene.survey.narrow_lobes,
        }
    }

    /// Classes of light paths that there can be.
    pub fn classes(self) -> ClassSet {
        let mut absent = ClassSet::NONE;
        if !self.volume {
            absent = absent.and(ClassSet::of(Effect::Volume));
        }
        if !self.narrow_lobes {
            let narrow = [Effect::Glossy, Effect::Caustic, Effect::Sds].map(ClassSet::of);
            absent = narrow.into_iter().fold(absent, ClassSet::and).and(ClassSet::one(PathClass::IndirectFocus));
        }
        absent.complement()
    }
}
