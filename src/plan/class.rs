//! Classes of light paths, in the manner of Heckbert: every path is in exactly one.
//!
//! A path is what happens at its vertices from the camera to the light, a letter each ([`Event`]): `C` a perfect mirror
//! or clear glass, `M` the perfect mirror of a surface that also scatters otherwise (a coat), `S` a sharp lobe, `B` a
//! broad one, `V` a medium. `N` is any of `C M S`, `G` one of `M S`, `D` one of `C M`. It ends on a light that has a
//! size, `L`, or none, `P`; the table says `L` where that makes no difference.
//!
//! | class | path | effect | part |
//! | --- | --- | --- | --- |
//! | `Emission` | `C* L` | emission | emission |
//! | `Direct` | `C* B L` | direct | direct |
//! | `Highlight` | `C* S L` | glossy | direct |
//! | `Coat` | `C* M D* L` | glossy | indirect |
//! | `Reflection` | `C* G N* L`, none of the other three of narrow lobes alone | glossy | indirect |
//! | `ReflectedDirect` | `C* G N* (B or V) L` | glossy | indirect |
//! | `ReflectedIndirect` | `C* G` and whatever follows, the last lobe broad | glossy | indirect |
//! | `ReflectedFocus` | the same, narrow lobes after the last broad one, and no `Sds` | glossy | indirect |
//! | `Indirect` | `C* B`, whatever follows, and then a broad lobe or a medium | indirect | indirect |
//! | `IndirectFocus` | the same, and then narrow lobes | indirect | indirect |
//! | `Caustic` | `B N+ L`; `S D+ P` | caustic | caustic |
//! | `Sds` | `N+ B N+ L`; `N+ S D+ P` | sds | caustic |
//! | `Single` | `C* V L` | volume | volume |
//! | `Volume` | `C* V` and whatever follows | volume | volume |
//!
//! So the effect *glossy* is what narrow lobes show, caustics excepted: first of all events that are not clear there is
//! a narrow lobe. Nobody sees a light without size but by a lobe that has a width: where only perfect mirrors and glass
//! are between the two, that lobe, if it is sharp, shows a caustic.
//!
//! [`CameraSuffix`] reads a path from the camera, [`LightPrefix`] from the light, and where they meet they tell the class
//! ([`CameraSuffix::class_with`]).

mod camera_suffix;
mod present;

pub use camera_suffix::{CameraSuffix, LightPrefix};
pub use present::classes_in;

use super::effect::{Effect, EffectSet, Switches};
use crate::bsdf::LobeSet;
use serde::{Deserialize, Serialize};
use std::ops::BitAnd;

/// What a vertex does to a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A perfect mirror or clear glass and nothing else.
    Clear,
    /// The perfect mirror or clear interface of a surface that has other lobes.
    Mirror,
    /// A sharp lobe.
    Sharp,
    /// A broad lobe.
    Broad,
    /// A medium.
    Medium,
}

impl Event {
    /// All of them.
    pub const ALL: [Event; 5] = [Event::Clear, Event::Mirror, Event::Sharp, Event::Broad, Event::Medium];

    /// A surface with `lobes` scatters by one of them.
    #[inline]
    pub fn of(lobe: LobeSet, lobes: LobeSet) -> Event {
        if lobe.intersects(LobeSet::BROAD) {
            Event::Broad
        } else if lobe.intersects(LobeSet::SHARP) {
            Event::Sharp
        } else if lobes.intersects(LobeSet::SMOOTH) {
            Event::Mirror
        } else {
            Event::Clear
        }
    }

    /// The same where it may be a medium, which has no lobes.
    #[inline]
    pub fn by(lobe: LobeSet, lobes: Option<LobeSet>) -> Event {
        lobes.map_or(Event::Medium, |lobes| Event::of(lobe, lobes))
    }

    #[inline]
    fn is_narrow(self) -> bool {
        matches!(self, Event::Clear | Event::Mirror | Event::Sharp)
    }
}

/// A class of light paths; see the table above.
#[allow(missing_docs, reason = "the table says it")]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum PathClass {
    Emission,
    Direct,
    Highlight,
    Coat,
    Reflection,
    ReflectedDirect,
    ReflectedIndirect,
    ReflectedFocus,
    Indirect,
    IndirectFocus,
    Caustic,
    Sds,
    Single,
    Volume,
}

/// Additive part of the picture, a layer each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Emitters seen directly or through perfect mirrors and clear glass.
    Emission,
    /// Light from lights at the first vertex that scatters otherwise.
    Direct,
    /// Light focused by mirrors and glass.
    Caustic,
    /// Everything else from surfaces.
    Indirect,
    /// Light whose first vertex that is not clear, seen from the eye, is in a medium.
    Volume,
}

impl PathClass {
    /// All of them.
    pub const ALL: [PathClass; 14] = [
        PathClass::Emission,
        PathClass::Direct,
        PathClass::Highlight,
        PathClass::Coat,
        PathClass::Reflection,
        PathClass::ReflectedDirect,
        PathClass::ReflectedIndirect,
        PathClass::ReflectedFocus,
        PathClass::Indirect,
        PathClass::IndirectFocus,
        PathClass::Caustic,
        PathClass::Sds,
        PathClass::Single,
        PathClass::Volume,
    ];

    /// Of a whole path, from the camera to a light, `sizeless` or not.
    pub fn of(events: impl IntoIterator<Item = Event>, sizeless: bool) -> PathClass {
        events.into_iter().fold(CameraSuffix::START, CameraSuffix::then).class_at_light(sizeless)
    }

    /// The part of the picture that it belongs to.
    #[inline]
    pub fn part(self) -> Part {
        use PathClass as C;
        match self {
            C::Emission => Part::Emission,
            C::Direct | C::Highlight => Part::Direct,
            C::Caustic | C::Sds => Part::Caustic,
            C::Single | C::Volume => Part::Volume,
            C::Coat | C::Reflection | C::ReflectedDirect | C::ReflectedIndirect | C::ReflectedFocus => Part::Indirect,
            C::Indirect | C::IndirectFocus => Part::Indirect,
        }
    }

    /// The effect that it belongs to.
    pub fn effect(self) -> Effect {
        use PathClass as C;
        match self {
            C::Emission => Effect::Emission,
            C::Direct => Effect::Direct,
            C::Indirect | C::IndirectFocus => Effect::Indirect,
            C::Caustic => Effect::Caustic,
            C::Sds => Effect::Sds,
            C::Single | C::Volume => Effect::Volume,
            C::Highlight | C::Coat | C::Reflection => Effect::Glossy,
            C::ReflectedDirect | C::ReflectedIndirect | C::ReflectedFocus => Effect::Glossy,
        }
    }
}

/// A set of classes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClassSet(u16);

impl ClassSet {
    /// Every class.
    pub const ALL: ClassSet = ClassSet((1 << PathClass::ALL.len()) - 1);
    /// No class.
    pub const NONE: ClassSet = ClassSet(0);

    /// Those of an effect.
    pub fn of(effect: Effect) -> ClassSet {
        PathClass::ALL.into_iter().filter(|class| class.effect() == effect).collect()
    }

    /// All but those of some effects.
    pub fn without(effects: EffectSet) -> ClassSet {
        PathClass::ALL.into_iter().filter(|class| !effects.has(class.effect())).collect()
    }

    /// One class.
    #[inline]
    pub const fn one(class: PathClass) -> ClassSet {
        ClassSet(1 << class as u16)
    }

    /// All but these.
    pub const fn complement(self) -> ClassSet {
        ClassSet(ClassSet::ALL.0 & !self.0)
    }

    /// Both.
    #[inline]
    pub const fn and(self, other: ClassSet) -> ClassSet {
        ClassSet(self.0 | other.0)
    }

    /// Whether it holds a class.
    #[inline]
    pub const fn has(self, class: PathClass) -> bool {
        self.0 & 1 << class as u16 != 0
    }

    /// Whether it holds a class of a part.
    pub fn has_part(self, part: Part) -> bool {
        PathClass::ALL.into_iter().any(|class| self.has(class) && class.part() == part)
    }

    /// Whether it holds every class.
    #[inline]
    pub const fn is_all(self) -> bool {
        self.0 == ClassSet::ALL.0
    }

    /// Whether it holds none.
    #[inline]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}

impl BitAnd for ClassSet {
    type Output = ClassSet;
    #[inline]
    fn bitand(self, other: ClassSet) -> ClassSet {
        ClassSet(self.0 & other.0)
    }
}

impl FromIterator<PathClass> for ClassSet {
    fn from_iter<I: IntoIterator<Item = PathClass>>(classes: I) -> ClassSet {
        classes.into_iter().fold(ClassSet::NONE, |set, class| set.and(ClassSet::one(class)))
    }
}

/// What narrow lobes show.
fn glossy() -> ClassSet {
    ClassSet::of(Effect::Glossy)
}

impl Switches {
    /// Classes of light paths that are left. The other effects switched off are gone from the scene itself.
    pub fn classes(self) -> ClassSet {
        ClassSet::without(self.off.classes())
    }
}

#[cfg(test)]
mod tests;
