//! Reading a path from either end: what of it decides its class.

use super::{ClassSet, Event, PathClass, glossy};

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
pub struct CameraSuffix {
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

impl CameraSuffix {
    /// Nothing has happened yet.
    pub const START: CameraSuffix = CameraSuffix {
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
    pub fn then(self, event: Event) -> CameraSuffix {
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
        CameraSuffix {
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
    pub fn class_at_light(self, sizeless: bool) -> PathClass {
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
    pub fn class_with(self, beam: LightPrefix) -> PathClass {
        let mut sight = self;
        for _ in 0..beam.spreads() {
            sight = sight.then(if beam.0 & LightPrefix::MEDIUM != 0 { Event::Medium } else { Event::Broad });
        }
        match beam.tail() {
            Tail::None => sight.class_at_light(false),
            Tail::Narrow => sight.then(Event::Sharp).class_at_light(false),
            Tail::Delta => sight.then(Event::Mirror).class_at_light(true),
            Tail::Glint => sight.then(Event::Sharp).then(Event::Mirror).class_at_light(true),
        }
    }

    /// Nothing so far but perfect mirrors and clear glass.
    #[inline]
    pub fn is_clear(self) -> bool {
        self.first == First::Nothing
    }

    /// Classes that it can still come to, or is in; rather too many than too few.
    pub fn reachable_classes(self) -> ClassSet {
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

/// A path so far, from a light. A byte, for photons: two bits of what is next to the light (`Tail`), two that count
/// broad lobes and media up to two, one set where there is one and it is a medium, one of the light without size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LightPrefix(u8);

impl LightPrefix {
    const MEDIUM: u8 = 1 << 4;
    const SIZELESS: u8 = 1 << 5;

    /// How many there can be.
    pub const COUNT: usize = 1 << 6;

    /// Below [`LightPrefix::COUNT`].
    #[inline]
    pub fn index(self) -> usize {
        usize::from(self.0) % LightPrefix::COUNT
    }

    /// From a light that has a size, by narrow lobes alone.
    pub const FOCUSED: LightPrefix = LightPrefix(Tail::Narrow as u8);
    /// The same, and then by a broad lobe.
    pub const SCATTERED: LightPrefix = LightPrefix(Tail::Narrow as u8 | 1 << 2);

    /// Straight from a light.
    #[inline]
    pub fn start(sizeless: bool) -> LightPrefix {
        LightPrefix(if sizeless { LightPrefix::SIZELESS } else { 0 })
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
    pub fn then(self, event: Event) -> LightPrefix {
        let (tail, sizeless) = (self.tail(), self.0 & LightPrefix::SIZELESS);
        if !event.is_narrow() {
            let medium = if self.spreads() == 0 && event == Event::Medium { LightPrefix::MEDIUM } else { 0 };
            return LightPrefix(tail as u8 | (self.spreads() + 1).min(2) << 2 | medium | sizeless);
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
        LightPrefix(tail as u8 | sizeless)
    }
}
