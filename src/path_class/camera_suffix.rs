//! Incremental classification of a path from the camera or from a light.

use super::{ClassSet, Event, PathClass, glossy};

/// The first scattering event of a camera path that is not a perfect mirror or clear glass ([`Event::Clear`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum First {
    Nothing,
    Narrow,
    Broad,
    Medium,
}

/// Summary of the scattering events on a camera path so far: all that the class of the whole light path depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CameraSuffix {
    first: First,
    /// Whether the path has any event so far.
    begun: bool,
    /// Whether the last event is the only one that is not a perfect mirror or clear glass.
    alone: bool,
    /// Whether all events so far are delta lobes.
    delta: bool,
    /// Number of broad lobes and media on the path so far; 2 also stands for more.
    broad_count: u8,
    /// Whether any event so far is in a medium.
    medium: bool,
    /// Whether there was a narrow lobe (delta or sharp) since the last broad lobe or medium.
    narrowed: bool,
    /// Whether any event precedes the first broad lobe or, without a broad lobe so far, the last sharp lobe.
    preceded: bool,
    /// Whether all events so far are narrow lobes (sharp or delta), and delta lobes follow the last sharp one. A path
    /// that then ends on a delta light is a caustic.
    glint: bool,
}

impl CameraSuffix {
    /// The state of a camera path without events.
    pub const START: CameraSuffix = CameraSuffix {
        first: First::Nothing,
        begun: false,
        alone: false,
        delta: true,
        broad_count: 0,
        medium: false,
        narrowed: false,
        preceded: false,
        glint: false,
    };

    /// The state after one more scattering event, farther from the camera.
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
        let may_focus = self.broad_count == 0 && (sharp || !narrow);
        CameraSuffix {
            first,
            begun: true,
            alone: clear && first != First::Nothing,
            delta: self.delta && narrow && !sharp,
            broad_count: (self.broad_count + u8::from(!narrow)).min(2),
            medium: self.medium || event == Event::Medium,
            narrowed: narrow && (self.narrowed || self.broad_count > 0),
            preceded: if may_focus { self.begun } else { self.preceded },
            glint: self.broad_count == 0 && narrow && !sharp && !self.delta,
        }
    }

    /// The class of the light path if the camera path ends on a light here. `sizeless`: the light has no size, so that
    /// no camera path can hit it.
    #[inline]
    pub fn class_at_light(self, sizeless: bool) -> PathClass {
        use PathClass as C;
        let caustic = if self.preceded { C::Sds } else { C::Caustic };
        match (self.first, self.broad_count, self.narrowed) {
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

    /// The class of the whole light path that joins this camera path with a path from a light.
    #[inline]
    pub fn class_with(self, light: LightPrefix) -> PathClass {
        let mut path = self;
        for _ in 0..light.broad_count() {
            path = path.then(if light.0 & LightPrefix::MEDIUM != 0 { Event::Medium } else { Event::Broad });
        }
        match light.narrow() {
            NarrowPart::None => path.class_at_light(false),
            NarrowPart::Any => path.then(Event::Sharp).class_at_light(false),
            NarrowPart::Delta => path.then(Event::Mirror).class_at_light(true),
            NarrowPart::Glint => path.then(Event::Sharp).then(Event::Mirror).class_at_light(true),
        }
    }

    /// Whether all events on the camera path so far are perfect mirrors or clear glass.
    #[inline]
    pub fn is_clear(self) -> bool {
        self.first == First::Nothing
    }

    /// Path classes that include all those that the camera path can still have if it ends now or after more events.
    pub fn reachable_classes(self) -> ClassSet {
        use PathClass as C;
        let caustic = if self.broad_count == 1 && self.medium || self.broad_count > 1 {
            ClassSet::NONE
        } else if self.broad_count == 1 {
            ClassSet::one(if self.preceded { C::Sds } else { C::Caustic })
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

/// Narrow lobes (delta or sharp) on a light path, between the light and its first broad lobe or medium.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum NarrowPart {
    None,
    /// Any narrow lobes that none of the other values describes.
    Any,
    /// Only delta lobes, on a path from a delta light.
    Delta,
    /// Delta lobes after a delta light, then a sharp lobe, which shows a caustic, then any narrow lobes.
    Glint,
}

/// Summary of the scattering events on a light path so far: all that the class of the whole path depends on. Photons
/// store it in one byte: two bits for the `NarrowPart`, two bits for the number of broad lobes and media (at most 2),
/// one bit if the first of these is a medium, one bit for a delta light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LightPrefix(u8);

impl LightPrefix {
    const MEDIUM: u8 = 1 << 4;
    const SIZELESS: u8 = 1 << 5;

    /// Number of possible values of [`LightPrefix::index`].
    pub const COUNT: usize = 1 << 6;

    /// The summary as an array index below [`LightPrefix::COUNT`].
    #[inline]
    pub fn index(self) -> usize {
        usize::from(self.0) % LightPrefix::COUNT
    }

    /// The summary of a path from a light of finite size that has met narrow lobes (delta or sharp) alone.
    pub const FOCUSED: LightPrefix = LightPrefix(NarrowPart::Any as u8);
    /// The summary of a path from a light of finite size that has met narrow lobes (delta or sharp) and then a broad
    /// lobe.
    pub const SCATTERED: LightPrefix = LightPrefix(NarrowPart::Any as u8 | 1 << 2);

    /// The summary of a light path without events. `sizeless`: it starts at a delta light.
    #[inline]
    pub fn start(sizeless: bool) -> LightPrefix {
        LightPrefix(if sizeless { LightPrefix::SIZELESS } else { 0 })
    }

    #[inline]
    fn narrow(self) -> NarrowPart {
        match self.0 & 3 {
            0 => NarrowPart::None,
            1 => NarrowPart::Any,
            2 => NarrowPart::Delta,
            _ => NarrowPart::Glint,
        }
    }

    /// Number of broad lobes and media on the light path so far; 2 also stands for more.
    #[inline]
    fn broad_count(self) -> u8 {
        self.0 >> 2 & 3
    }

    /// The summary after one more scattering event, farther from the light.
    #[must_use]
    #[inline]
    pub fn then(self, event: Event) -> LightPrefix {
        let (narrow, sizeless) = (self.narrow(), self.0 & LightPrefix::SIZELESS);
        if !event.is_narrow() {
            let medium = if self.broad_count() == 0 && event == Event::Medium { LightPrefix::MEDIUM } else { 0 };
            return LightPrefix(narrow as u8 | (self.broad_count() + 1).min(2) << 2 | medium | sizeless);
        }
        if self.broad_count() > 0 {
            return self;
        }
        let narrow = match (narrow, event) {
            (NarrowPart::None, Event::Sharp) => NarrowPart::Any,
            (NarrowPart::None, _) if sizeless != 0 => NarrowPart::Delta,
            (NarrowPart::None, _) => NarrowPart::Any,
            (NarrowPart::Delta, Event::Sharp) => NarrowPart::Glint,
            (narrow, _) => narrow,
        };
        LightPrefix(narrow as u8 | sizeless)
    }
}
