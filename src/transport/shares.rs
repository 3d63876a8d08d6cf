//! Light that techniques find for all lobes of a vertex at once, told apart by class.
//!
//! A vertex that has both broad and sharp lobes makes different things of the same light. What each makes of it is
//! known, so their shares are exact. Where both are in one part of the picture and no class is switched off, nobody
//! asks, and it costs nothing.
//!
//! A path drawn from all lobes of a vertex at once goes on as if by the lobe that drew it. That shares out light that
//! it runs into in proportion to densities, not to the lobes' own values, which nearly agree: the sum of the classes is
//! exact.

use super::light_vertex::LightVertex;
use super::scattering_vertex::ScatterPoint;
use crate::bsdf::{LobeSet, Transport};
use crate::math::{Rgb, Vec3};
use crate::plan::{CameraSuffix, ClassSet, Event, LightPrefix, PathClass};

/// Classes and their shares of some light, by channel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shares {
    list: [(PathClass, Rgb); 4],
    count: usize,
}

impl Shares {
    const NONE: Shares = Shares { list: [(PathClass::Emission, Rgb::ZERO); 4], count: 0 };

    #[inline]
    fn add(&mut self, class: PathClass, share: Rgb, on: ClassSet) {
        if on.has(class) {
            self.list[self.count] = (class, share);
            self.count += 1;
        }
    }

    /// All are switched off.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Those that are not switched off.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = (PathClass, Rgb)> {
        self.list.into_iter().take(self.count)
    }
}

/// What smooth lobes are there, broad first.
#[inline]
fn events(smooth: LobeSet, in_medium: bool) -> (Event, Option<Event>) {
    match smooth {
        _ if in_medium => (Event::Medium, None),
        LobeSet::SMOOTH => (Event::Broad, Some(Event::Sharp)),
        LobeSet::SHARP => (Event::Sharp, None),
        _ => (Event::Broad, None),
    }
}

/// Classes of light that comes to a vertex at the end of `sight` by `beam`: what its lobes make of it, broad ones
/// first.
#[inline]
fn classes<S: ScatterPoint>(vertex: &S, suffix: CameraSuffix, prefix: LightPrefix) -> (PathClass, Option<PathClass>) {
    let (first, second) = events(vertex.smooth(), S::IN_MEDIUM);
    let class = |event| suffix.then(event).class_with(prefix);
    (class(first), second.map(class))
}

/// Whether any class of that light is wanted.
#[inline]
pub(super) fn wanted<S: ScatterPoint>(vertex: &S, suffix: CameraSuffix, prefix: LightPrefix, on: ClassSet) -> bool {
    on.is_all() || {
        let (first, second) = classes(vertex, suffix, prefix);
        on.has(first) || second.is_some_and(|second| on.has(second))
    }
}

/// Whether going on by one lobe of `set`, of a surface that has `lobes`, can come to light of a class that is wanted.
pub(super) fn leads(suffix: CameraSuffix, lobes: LobeSet, set: LobeSet, on: ClassSet) -> bool {
    let each = [LobeSet::DELTA, LobeSet::SHARP, LobeSet::BROAD].into_iter();
    let ahead = |lobe: LobeSet| !(suffix.then(Event::of(lobe, lobes)).reachable_classes() & on).is_empty();
    each.filter(|lobe| set.intersects(*lobe)).any(ahead)
}

/// Share of broad lobes in `all` that lobes scatter.
#[inline]
fn ratio(broad: Rgb, all: Rgb) -> Rgb {
    Rgb::select(all.cmpgt(Rgb::ZERO), (broad / all).min(Rgb::ONE), Rgb::ZERO)
}

/// Shares of light that comes along `wi`, of which all lobes of the vertex scatter `f`.
#[inline]
pub(super) fn shares<S: ScatterPoint>(
    vertex: &S,
    (suffix, prefix): (CameraSuffix, LightPrefix),
    (wi, transport, f): (Vec3, Transport, Rgb),
    on: ClassSet,
) -> Shares {
    shares_of(vertex, classes(vertex, suffix, prefix), (wi, transport, f), on)
}

/// The same where the classes are known.
#[inline]
fn shares_of<S: ScatterPoint>(
    vertex: &S,
    classes: (PathClass, Option<PathClass>),
    (wi, transport, f): (Vec3, Transport, Rgb),
    on: ClassSet,
) -> Shares {
    let mut shares = Shares::NONE;
    match classes {
        (first, Some(second)) if first.part() != second.part() || !on.is_all() => {
            let broad = ratio(vertex.evaluate_cos(wi, transport, LobeSet::BROAD).0, f);
            shares.add(first, broad, on);
            shares.add(second, Rgb::ONE - broad, on);
        }
        (first, _) => shares.add(first, Rgb::ONE, on),
    }
    shares
}

/// Shares of the light of many photons at one vertex: each kind of [`LightPrefix`] is looked at once.
pub(super) struct Merged<'v, S> {
    vertex: &'v S,
    suffix: CameraSuffix,
    on: ClassSet,
    known: [Option<(PathClass, Option<PathClass>)>; LightPrefix::COUNT],
}

impl<'v, S: ScatterPoint> Merged<'v, S> {
    /// At a vertex at the end of `sight`.
    #[inline]
    pub fn new(vertex: &'v S, suffix: CameraSuffix, on: ClassSet) -> Merged<'v, S> {
        Merged { vertex, suffix, on, known: [None; LightPrefix::COUNT] }
    }

    /// Shares of light that comes by `beam` along `wi`, of which the vertex scatters `f` towards the eye.
    #[inline]
    pub fn shares(&mut self, prefix: LightPrefix, wi: Vec3, f: Rgb) -> Shares {
        let known = &mut self.known[prefix.index()];
        let classes = *known.get_or_insert_with(|| classes(self.vertex, self.suffix, prefix));
        shares_of(self.vertex, classes, (wi, Transport::Radiance, f), self.on)
    }
}

/// The same for light that a light path's vertex sends along `-d`, of which its lobes scatter `f_light`, to one from
/// where it is along `d`.
#[inline]
pub(super) fn connected<S: ScatterPoint>(
    vertex: &S,
    light: &LightVertex<'_>,
    suffix: CameraSuffix,
    (d, f, f_light): (Vec3, Rgb, Rgb),
    on: ClassSet,
) -> Shares {
    let (first, second) = events(light.smooth(), light.in_medium());
    let of = |event: Event| shares(vertex, (suffix, light.prefix.then(event)), (d, Transport::Radiance, f), on);
    let Some(second) = second else { return of(first) };
    let parts = |event: Event| {
        let (first, second) = classes(vertex, suffix, light.prefix.then(event));
        (first.part(), second.map(PathClass::part))
    };
    if on.is_all() && parts(first) == parts(second) {
        return of(first);
    }
    let broad = ratio(light.evaluate_set_cos(-d, LobeSet::BROAD).0, f_light);
    let mut shares = Shares::NONE;
    for (event, of_light) in [(first, broad), (second, Rgb::ONE - broad)] {
        for (class, share) in of(event).iter() {
            shares.add(class, share * of_light, on);
        }
    }
    shares
}
