//! Path classes that are possible in a scene.

use super::{ClassSet, Effect, PathClass};
use crate::scene::Survey;

/// Path classes that are possible in a scene with this survey of its contents.
pub fn classes_in(survey: &Survey) -> ClassSet {
    let mut absent = ClassSet::NONE;
    if !survey.scattering {
        absent = absent.and(ClassSet::of(Effect::Volume));
    }
    if !survey.narrow_lobes {
        let narrow = [Effect::Glossy, Effect::Caustic, Effect::Sds].map(ClassSet::of);
        absent = narrow.into_iter().fold(absent, ClassSet::and).and(ClassSet::one(PathClass::IndirectFocus));
    }
    absent.complement()
}
