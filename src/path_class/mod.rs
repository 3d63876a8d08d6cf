//! Classes of light paths in Heckbert's notation. Every path is in exactly one class.
//!
//! A path is a string of the events ([`Event`]) at its vertices, from the camera to the light: `C` is a perfect mirror
//! or clear glass, `M` the perfect mirror of a surface that has other lobes (a coat), `S` a sharp lobe, `B` a broad
//! lobe, `V` a medium. `N` is any of `C M S`, `G` is `M` or `S`, `D` is `C` or `M`. The path ends on a light of finite
//! size, `L`, or on a delta light, `P`. The table writes `L` where both are possible.
//!
//! | class | path | effect | part |
//! | --- | --- | --- | --- |
//! | `Emission` | `C* L` | emission | emission |
//! | `Direct` | `C* B L` | direct | direct |
//! | `Highlight` | `C* S L` | glossy | direct |
//! | `Coat` | `C* M D* L` | glossy | indirect |
//! | `Reflection` | `C* G N* L`, unless `Highlight`, `Coat`, `Caustic` or `Sds` | glossy | indirect |
//! | `ReflectedDirect` | `C* G N* (B or V) L` | glossy | indirect |
//! | `ReflectedIndirect` | `C* G`, any events with a `B` or `V`, then `(B or V) L` | glossy | indirect |
//! | `ReflectedFocus` | `C* G`, any events with a `B` or `V`, then `N+ L`, unless `Sds` | glossy | indirect |
//! | `Indirect` | `C* B`, any events, then `(B or V) L` | indirect | indirect |
//! | `IndirectFocus` | `C* B`, any events with a `B` or `V`, then `N+ L` | indirect | indirect |
//! | `Caustic` | `B N+ L`; `S D+ P` | caustic | caustic |
//! | `Sds` | `N+ B N+ L`; `N+ S D+ P` | sds | caustic |
//! | `Single` | `C* V L` | volume | volume |
//! | `Volume` | `C* V`, then at least one event | volume | volume |
//!
//! The effect *glossy* contains the paths whose first event after `C*` is a narrow lobe, except caustics. A delta light
//! is visible only through a lobe that is not a delta lobe. If this lobe is sharp, and only perfect mirrors and clear
//! glass are between the lobe and the light, the lobe shows a caustic.
//!
//! [`CameraSuffix`] reads a path from the camera, [`LightPrefix`] reads it from the light. Together they determine the
//! class of the whole path ([`CameraSuffix::class_with`]).

mod camera_suffix;
mod effect;
mod present;

pub use camera_suffix::{CameraSuffix, LightPrefix};
pub use effect::{Effect, EffectSet, Switches};
pub use present::classes_in;

use crate::bsdf::LobeSet;
use serde::{Deserialize, Serialize};
use std::ops::BitAnd;

/// How light is scattered at one vertex of a path: the letter of the vertex in Heckbert's notation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Scattering at a surface that is only a perfect mirror or only clear glass.
    Clear,
    /// Scattering by the perfect mirror or clear interface of a surface that also has other lobes, such as a coat.
    Mirror,
    /// Scattering by a sharp lobe: glossy, and too narrow to gather photons.
    Sharp,
    /// Scattering by a broad lobe, such as diffuse reflection, where photons can be gathered.
    Broad,
    /// Scattering in a participating medium.
    Medium,
}

impl Event {
    /// All kinds of scattering at a vertex.
    pub const ALL: [Event; 5] = [Event::Clear, Event::Mirror, Event::Sharp, Event::Broad, Event::Medium];

    /// The kind of scattering at a vertex on a surface that has `lobes` and scatters by `lobe`.
    #[inline]
    pub fn at_surface(lobe: LobeSet, lobes: LobeSet) -> Event {
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

    /// The kind of scattering at a vertex: on a surface that has `lobes` and scatters by `lobe`, or in a medium if
    /// `lobes` is `None`.
    #[inline]
    pub fn at_vertex(lobe: LobeSet, lobes: Option<LobeSet>) -> Event {
        lobes.map_or(Event::Medium, |lobes| Event::at_surface(lobe, lobes))
    }

    #[inline]
    fn is_narrow(self) -> bool {
        matches!(self, Event::Clear | Event::Mirror | Event::Sharp)
    }
}

/// A class of light paths by the events at their vertices; every path is in exactly one class of the table in
/// `path_class`.
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

/// A part of the picture that comes from some of the path classes and has a layer of its own. The parts add up to the
/// picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Lights seen directly or through perfect mirrors and clear glass.
    Emission,
    /// Direct light at the first surface that is neither a perfect mirror nor clear glass.
    Direct,
    /// Light focused by mirrors and glass (caustics).
    Caustic,
    /// All other light from surfaces: indirect light and reflections.
    Indirect,
    /// Light whose first scattering event seen from the camera, apart from perfect mirrors and clear glass, is in a
    /// participating medium.
    Volume,
}

impl PathClass {
    /// All path classes, in the order of the table.
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

    /// The class of a whole light path, given by its scattering events in the order from the camera to the light.
    /// `sizeless`: the light is a delta light.
    pub fn of(events: impl IntoIterator<Item = Event>, sizeless: bool) -> PathClass {
        events.into_iter().fold(CameraSuffix::START, CameraSuffix::then).class_at_light(sizeless)
    }

    /// The part (layer) of the picture to which paths of the class contribute.
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

    /// The effect of light transport, such as *caustic*, that paths of the class show.
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

/// A set of path classes, one bit per class.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClassSet(u16);

impl ClassSet {
    /// The set of all path classes.
    pub const ALL: ClassSet = ClassSet((1 << PathClass::ALL.len()) - 1);
    /// The empty set.
    pub const NONE: ClassSet = ClassSet(0);

    /// The path classes that show an effect.
    pub fn of(effect: Effect) -> ClassSet {
        PathClass::ALL.into_iter().filter(|class| class.effect() == effect).collect()
    }

    /// The path classes that show none of the effects.
    pub fn without(effects: EffectSet) -> ClassSet {
        PathClass::ALL.into_iter().filter(|class| !effects.has(class.effect())).collect()
    }

    /// The set that contains one path class alone.
    #[inline]
    pub const fn one(class: PathClass) -> ClassSet {
        ClassSet(1 << class as u16)
    }

    /// The path classes that are not in the set.
    pub const fn complement(self) -> ClassSet {
        ClassSet(ClassSet::ALL.0 & !self.0)
    }

    /// The path classes that are in one of the two sets or in both.
    #[inline]
    pub const fn and(self, other: ClassSet) -> ClassSet {
        ClassSet(self.0 | other.0)
    }

    /// Whether the set contains a path class.
    #[inline]
    pub const fn has(self, class: PathClass) -> bool {
        self.0 & 1 << class as u16 != 0
    }

    /// Whether the set contains any path class of a part (layer) of the picture.
    pub fn has_part(self, part: Part) -> bool {
        PathClass::ALL.into_iter().any(|class| self.has(class) && class.part() == part)
    }

    /// Whether the set contains every path class.
    #[inline]
    pub const fn is_all(self) -> bool {
        self.0 == ClassSet::ALL.0
    }

    /// Whether the set is empty.
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

/// The path classes of the effect *glossy*: reflections in narrow lobes, apart from caustics.
fn glossy() -> ClassSet {
    ClassSet::of(Effect::Glossy)
}

impl Switches {
    /// The path classes whose effects the user has not switched off. Effects that are not path classes are switched off
    /// by removing them from the scene.
    pub fn classes(self) -> ClassSet {
        ClassSet::without(self.off.classes())
    }
}

#[cfg(test)]
mod tests;
