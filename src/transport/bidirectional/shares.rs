//! Shares of light by class, for techniques that evaluate all lobes of a vertex at once.
//!
//! At a vertex with broad and sharp lobes, light of one path belongs to two classes. The values of the lobes give exact
//! shares. If both classes belong to one part of the picture and none is switched off, shares are not computed.
//!
//! A path that samples all lobes at once continues with the class of the lobe that it sampled. So light that it hits is
//! shared in proportion to densities, which nearly agree with the values of the lobes; the sum over classes is exact.

use super::light_vertex::LightVertex;
use crate::bsdf::{LobeSet, Transport};
use crate::math::{Rgb, Vec3};
use crate::path_class::{CameraSuffix, ClassSet, Event, LightPrefix, PathClass};
use crate::transport::walk::scattering_vertex::ScatterPoint;

/// The path classes (by kinds of bounces) that some light belongs to, and the fraction of the light in each, by
/// channel.
#[derive(Clone, Copy, Debug)]
pub(in crate::transport) struct Shares {
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

    /// Whether the light belongs only to classes that the picture does not show.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Path classes of the light that the picture shows, each with its fraction of the light by channel.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = (PathClass, Rgb)> {
        self.list[..self.count].iter().copied()
    }
}

/// The two halves of a path that meet at a vertex; together they determine its class.
#[derive(Clone, Copy)]
pub(in crate::transport) struct PathHalves {
    /// Class of the camera path up to the vertex: the kinds of its bounces.
    pub suffix: CameraSuffix,
    /// Class of the light path up to the vertex: the kinds of its bounces.
    pub prefix: LightPrefix,
}

/// Direction and BSDF value of light that arrives at a vertex.
#[derive(Clone, Copy)]
pub(in crate::transport) struct Incident {
    /// Unit direction towards where the light comes from.
    pub wi: Vec3,
    pub transport: Transport,
    /// Value of all lobes for this direction, times the cosine.
    pub f: Rgb,
}

/// Kinds of bounces that the lobes `smooth` (those that are not delta) make: two kinds, broad and sharp, if there are
/// both; otherwise one.
#[inline]
fn events(smooth: LobeSet, in_medium: bool) -> (Event, Option<Event>) {
    match smooth {
        _ if in_medium => (Event::Medium, None),
        LobeSet::SMOOTH => (Event::Broad, Some(Event::Sharp)),
        LobeSet::SHARP => (Event::Sharp, None),
        _ => (Event::Broad, None),
    }
}

/// Classes of a path through a vertex: if its broad lobes scatter the light, and, if it also has sharp lobes, if these
/// do.
#[inline]
fn classes<S: ScatterPoint>(vertex: &S, halves: PathHalves) -> (PathClass, Option<PathClass>) {
    let (first, second) = events(vertex.smooth(), S::IN_MEDIUM);
    let class = |event| halves.suffix.then(event).class_with(halves.prefix);
    (class(first), second.map(class))
}

/// Whether a path whose halves meet at a vertex belongs to a class in `on`, the classes that the picture shows.
#[inline]
pub(in crate::transport) fn wanted<S: ScatterPoint>(vertex: &S, halves: PathHalves, on: ClassSet) -> bool {
    on.is_all() || {
        let (first, second) = classes(vertex, halves);
        on.has(first) || second.is_some_and(|second| on.has(second))
    }
}

/// Whether a camera path of class `suffix` that continues by a lobe of `set`, at a surface that has `lobes`, can reach
/// light of a class in `on`.
pub(in crate::transport) fn leads(suffix: CameraSuffix, lobes: LobeSet, set: LobeSet, on: ClassSet) -> bool {
    let each = [LobeSet::DELTA, LobeSet::SHARP, LobeSet::BROAD].into_iter();
    let ahead = |lobe: LobeSet| !(suffix.then(Event::at_surface(lobe, lobes)).reachable_classes() & on).is_empty();
    each.filter(|lobe| set.intersects(*lobe)).any(ahead)
}

/// Fraction of the scattered light (`all`) that broad lobes scatter (`broad`), 0 to 1 by channel; 0 without light.
#[inline]
fn ratio(broad: Rgb, all: Rgb) -> Rgb {
    Rgb::select(all.cmpgt(Rgb::ZERO), (broad / all).min(Rgb::ONE), Rgb::ZERO)
}

/// Divides the light that a vertex scatters among its path classes; classes outside `on` are left out.
#[inline]
pub(in crate::transport) fn shares<S: ScatterPoint>(
    vertex: &S,
    halves: PathHalves,
    incident: Incident,
    on: ClassSet,
) -> Shares {
    shares_of(vertex, classes(vertex, halves), incident, on)
}

/// Divides the light that a vertex scatters between the class of its broad lobes and the class of its sharp lobes;
/// classes outside `on` are left out.
#[inline]
fn shares_of<S: ScatterPoint>(
    vertex: &S,
    classes: (PathClass, Option<PathClass>),
    Incident { wi, transport, f }: Incident,
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

/// Divides the light of many photons at one vertex among path classes. The classes of each [`LightPrefix`] are computed
/// once.
pub(in crate::transport) struct PhotonShares<'v, S> {
    vertex: &'v S,
    suffix: CameraSuffix,
    on: ClassSet,
    known: [Option<(PathClass, Option<PathClass>)>; LightPrefix::COUNT],
}

impl<'v, S: ScatterPoint> PhotonShares<'v, S> {
    /// For photons at a vertex that ends a camera path of class `suffix`; only classes in `on` are shown in the
    /// picture.
    #[inline]
    pub fn new(vertex: &'v S, suffix: CameraSuffix, on: ClassSet) -> PhotonShares<'v, S> {
        PhotonShares { vertex, suffix, on, known: [None; LightPrefix::COUNT] }
    }

    /// Path classes, with their fractions, of the light of a photon that arrives along `wi`, of which all lobes scatter
    /// `f` towards the camera.
    #[inline]
    pub fn shares(&mut self, prefix: LightPrefix, wi: Vec3, f: Rgb) -> Shares {
        let known = &mut self.known[prefix.index()];
        let classes = *known.get_or_insert_with(|| classes(self.vertex, PathHalves { suffix: self.suffix, prefix }));
        shares_of(self.vertex, classes, Incident { wi, transport: Transport::Radiance, f }, self.on)
    }
}

/// A connection of a camera vertex with a light vertex.
pub(in crate::transport) struct Connection {
    /// Unit direction from the camera vertex to the light vertex.
    pub d: Vec3,
    /// Value of all lobes of the camera vertex, times the cosine.
    pub f: Rgb,
    /// Value of all lobes of the light vertex, times the cosine.
    pub f_light: Rgb,
}

/// Divides the light on a connection between two vertices among its path classes.
#[inline]
pub(in crate::transport) fn connection_shares<S: ScatterPoint>(
    vertex: &S,
    light: &LightVertex<'_>,
    suffix: CameraSuffix,
    connection: &Connection,
    on: ClassSet,
) -> Shares {
    let Connection { d, f, f_light } = *connection;
    let incident = Incident { wi: d, transport: Transport::Radiance, f };
    let (first, second) = events(light.smooth(), light.in_medium());
    let halves = |event: Event| PathHalves { suffix, prefix: light.prefix.then(event) };
    let of = |event: Event| shares(vertex, halves(event), incident, on);
    let Some(second) = second else { return of(first) };
    let parts = |event: Event| {
        let (first, second) = classes(vertex, halves(event));
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
