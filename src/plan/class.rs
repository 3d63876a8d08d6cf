//! Classes of light paths, in the manner of Heckbert: every path is in exactly one.
//!
//! A path is what happens at its vertices from the camera to the light, a letter each ([`Event`]): `C` a perfect mirror or clear glass, `M` the perfect
//! mirror of a surface that also scatters otherwise (a coat), `S` a sharp lobe, `B` a broad one, `V` a medium. `N` is any of `C M S`, `G` one of `M S`,
//! `D` one of `C M`. It ends on a light that has a size, `L`, or none, `P`; the table says `L` where that makes no difference.
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
//! So the effect *glossy* is what narrow lobes show, caustics excepted: first of all events that are not clear there is a narrow lobe. Nobody sees a light
//! without size but by a lobe that has a width: where only perfect mirrors and glass are between the two, that lobe, if it is sharp, shows a caustic.
//!
//! [`Sight`] reads a path from the camera, [`Beam`] from the light, and where they meet they tell the class ([`Sight::receives`]).

use super::effect::{Effect, EffectSet};
use crate::bsdf::LobeSet;
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
        if lobe.has(LobeSet::BROAD) {
            Event::Broad
        } else if lobe.has(LobeSet::SHARP) {
            Event::Sharp
        } else if lobes.has(LobeSet::SMOOTH) {
            Event::Mirror
        } else {
            Event::Clear
        }
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
        events.into_iter().fold(Sight::START, Sight::then).lit(sizeless)
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClassSet(u16);

impl ClassSet {
    /// Every class.
    pub const ALL: ClassSet = ClassSet((1 << PathClass::ALL.len()) - 1);
    /// No class.
    pub const NONE: ClassSet = ClassSet(0);

    /// All but those of some effects.
    pub fn without(effects: EffectSet) -> ClassSet {
        PathClass::ALL.into_iter().filter(|class| !effects.has(class.effect())).collect()
    }

    /// One class.
    #[inline]
    pub const fn one(class: PathClass) -> ClassSet {
        ClassSet(1 << class as u16)
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
    PathClass::ALL.into_iter().filter(|class| class.effect() == Effect::Glossy).collect()
}

/// First event of a path that is not clear.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum First {
    Nothing,
    Narrow,
    Broad,
    Medium,
}

/// A path so far, from the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sight {
    first: First,
    /// Anything has happened.
    begun: bool,
    /// Exactly one event is not clear, and it is the last.
    alone: bool,
    /// Nothing but delta lobes.
    delta: bool,
    /// Broad lobes and media, up to two.
    spreads: u8,
    /// One of them is a medium.
    medium: bool,
    /// Narrow lobes since the last of them.
    narrowed: bool,
    /// Something was before the first broad lobe; as long as there is none, before the last sharp one.
    before: bool,
    /// Of narrow lobes alone: a sharp one, and delta lobes since.
    glint: bool,
}

impl Sight {
    /// Nothing has happened yet.
    pub const START: Sight = Sight {
        first: First::Nothing,
        begun: false,
        alone: false,
        delta: true,
        spreads: 0,
        medium: false,
        narrowed: false,
        before: false,
        glint: false,
    };

    /// It goes on.
    #[must_use]
    #[inline]
    pub fn then(self, event: Event) -> Sight {
        let clear = self.first == First::Nothing;
        let narrow = event.is_narrow();
        let first = match (self.first, event) {
            (First::Nothing, Event::Clear) => First::Nothing,
            (First::Nothing, Event::Mirror | Event::Sharp) => First::Narrow,
            (First::Nothing, Event::Broad) => First::Broad,
            (First::Nothing, Event::Medium) => First::Medium,
            (first, _) => first,
        };
        let sharp = event == Event::Sharp;
        let marks = self.spreads == 0 && (sharp || !narrow);
        Sight {
            first,
            begun: true,
            alone: clear && first != First::Nothing,
            delta: self.delta && narrow && !sharp,
            spreads: (self.spreads + u8::from(!narrow)).min(2),
            medium: self.medium || event == Event::Medium,
            narrowed: narrow && (self.narrowed || self.spreads > 0),
            before: if marks { self.begun } else { self.before },
            glint: self.spreads == 0 && narrow && !sharp && !self.delta,
        }
    }

    /// The class if it ends on a light, `sizeless` or not.
    #[inline]
    pub fn lit(self, sizeless: bool) -> PathClass {
        use PathClass as C;
        let caustic = if self.before { C::Sds } else { C::Caustic };
        match (self.first, self.spreads, self.narrowed) {
            (First::Nothing, ..) => C::Emission,
            (First::Medium, ..) if self.alone => C::Single,
            (First::Medium, ..) => C::Volume,
            (First::Narrow | First::Broad, 0, _) => match self {
                _ if self.delta => C::Coat,
                _ if self.alone => C::Highlight,
                _ if self.glint && sizeless => caustic,
                _ => C::Reflection,
            },
            (First::Broad, 1, false) => C::Direct,
            (First::Narrow, 1, false) => C::ReflectedDirect,
            (_, 1, true) if !self.medium => caustic,
            (First::Broad, _, false) => C::Indirect,
            (First::Broad, _, true) => C::IndirectFocus,
            (First::Narrow, _, false) => C::ReflectedIndirect,
            (First::Narrow, _, true) => C::ReflectedFocus,
        }
    }

    /// The class if the rest is a path from a light.
    #[inline]
    pub fn receives(self, beam: Beam) -> PathClass {
        let mut sight = self;
        for _ in 0..beam.spreads() {
            sight = sight.then(if beam.0 & Beam::MEDIUM != 0 { Event::Medium } else { Event::Broad });
        }
        match beam.tail() {
            Tail::None => sight.lit(false),
            Tail::Narrow => sight.then(Event::Sharp).lit(false),
            Tail::Delta => sight.then(Event::Mirror).lit(true),
            Tail::Glint => sight.then(Event::Sharp).then(Event::Mirror).lit(true),
        }
    }

    /// Nothing so far but perfect mirrors and clear glass.
    #[inline]
    pub fn is_clear(self) -> bool {
        self.first == First::Nothing
    }

    /// Classes that it can still come to, or is in; rather too many than too few.
    pub fn ahead(self) -> ClassSet {
        use PathClass as C;
        let caustic = if self.spreads == 1 && self.medium || self.spreads > 1 {
            ClassSet::NONE
        } else if self.spreads == 1 {
            ClassSet::one(if self.before { C::Sds } else { C::Caustic })
        } else {
            [C::Caustic, C::Sds].into_iter().collect()
        };
        match self.first {
            First::Nothing => ClassSet::ALL,
            First::Medium => [C::Single, C::Volume].into_iter().collect(),
            First::Broad => [C::Direct, C::Indirect, C::IndirectFocus].into_iter().collect::<ClassSet>().and(caustic),
            First::Narrow => glossy().and(caustic),
        }
    }
}

/// What is between a light and the first broad lobe or medium on a path's way from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Tail {
    None,
    /// Narrow lobes.
    Narrow,
    /// Delta lobes after a light without size.
    Delta,
    /// The same and then narrow lobes, a sharp one first.
    Glint,
}

/// A path so far, from a light. A byte, for photons: two bits of what is next to the light ([`Tail`]), two that count broad lobes and media up to two,
/// one set where there is one and it is a medium, one of the light without size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Beam(u8);

impl Beam {
    const MEDIUM: u8 = 1 << 4;
    const SIZELESS: u8 = 1 << 5;

    /// How many there can be.
    pub const COUNT: usize = 1 << 6;

    /// Below [`Beam::COUNT`].
    #[inline]
    pub fn index(self) -> usize {
        usize::from(self.0) % Beam::COUNT
    }

    /// From a light that has a size, by narrow lobes alone.
    pub const FOCUSED: Beam = Beam(Tail::Narrow as u8);
    /// The same, and then by a broad lobe.
    pub const SCATTERED: Beam = Beam(Tail::Narrow as u8 | 1 << 2);

    /// Straight from a light.
    #[inline]
    pub fn start(sizeless: bool) -> Beam {
        Beam(if sizeless { Beam::SIZELESS } else { 0 })
    }

    #[inline]
    fn tail(self) -> Tail {
        match self.0 & 3 {
            0 => Tail::None,
            1 => Tail::Narrow,
            2 => Tail::Delta,
            _ => Tail::Glint,
        }
    }

    #[inline]
    fn spreads(self) -> u8 {
        self.0 >> 2 & 3
    }

    /// It goes on.
    #[must_use]
    #[inline]
    pub fn then(self, event: Event) -> Beam {
        let (tail, sizeless) = (self.tail(), self.0 & Beam::SIZELESS);
        if !event.is_narrow() {
            let medium = if self.spreads() == 0 && event == Event::Medium { Beam::MEDIUM } else { 0 };
            return Beam(tail as u8 | (self.spreads() + 1).min(2) << 2 | medium | sizeless);
        }
        if self.spreads() > 0 {
            return self;
        }
        let tail = match (tail, event) {
            (Tail::None, Event::Sharp) => Tail::Narrow,
            (Tail::None, _) if sizeless != 0 => Tail::Delta,
            (Tail::None, _) => Tail::Narrow,
            (Tail::Delta, Event::Sharp) => Tail::Glint,
            (tail, _) => tail,
        };
        Beam(tail as u8 | sizeless)
    }
}

#[cfg(test)]
mod tests;
