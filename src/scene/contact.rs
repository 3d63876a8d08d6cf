//! Surfaces that lie on each other: a glass on a table, a liquid in a glass, sheets in a stack.
//!
//! A ray goes on a little past the surface it leaves ([`Surface::error`]), for rounding decides about what is nearer; so
//! whatever lies in that little way has to be met by other means. Where light passes a triangle that others may lie on
//! ([`Contacts`](super::Contacts)), all others there are looked for, and taken to lie on each other in this order,
//! whichever Embree finds first:
//!
//! - what lets no light pass comes first: glass and the table that it stands on are in contact;
//! - a solid is entered before another is left, so that solids overlap, and nested dielectrics
//!   (`transport/interior.rs`) say what fills the space: liquid and glass are in contact, without air between them;
//! - what has no inside is behind solids that are in front of it.
//!
//! Seen from the other side, the order is the reverse, but for the opaque, which nothing passes: light and importance
//! go the same ways.

use super::Scene;
use super::contacts::face_each_other;
use crate::geometry::Surface;
use crate::math::Vec3;
use crate::trace::{Hit, Ray};
use smallvec::SmallVec;

/// Whether rays may go on behind the surface.
#[inline(always)]
fn passes(scene: &Scene, surface: &Surface) -> bool {
    scene.materials.list[surface.material as usize].transmits()
}

/// A point of a surface, by what tells it from others there.
#[derive(Clone, Copy)]
pub struct Place {
    p: Vec3,
    ng: Vec3,
    instance: u32,
    primitive: u32,
    material: u32,
    error: f32,
}

impl Place {
    /// Where the surface is, if others lie on it there.
    #[inline(always)]
    pub fn touching(surface: &Surface) -> Option<Place> {
        surface.touching.then(|| Place::of(surface))
    }

    #[inline(always)]
    fn of(surface: &Surface) -> Place {
        let Surface { p, ng, instance, primitive, material, error, .. } = *surface;
        Place { p, ng, instance, primitive, material, error }
    }
}

/// Where a surface comes among those at one place, for a ray along `direction`.
fn order(scene: &Scene, place: &Place, direction: Vec3) -> (u8, i64, i64) {
    let front = direction.dot(place.ng) < 0.0;
    let material = &scene.materials.list[place.material as usize];
    let rank = match (material.transmits(), material.thin, front) {
        (false, ..) => 0,
        (true, true, false) => 1,
        (true, false, true) => 2,
        (true, false, false) => 3,
        (true, true, true) => 4,
    };
    let reversed = |index: u32| if front { i64::from(index) } else { -i64::from(index) };
    (rank, reversed(place.instance), reversed(place.primitive))
}

/// What is at a place besides what is known to be there.
type Others = SmallVec<[(Place, Hit); 3]>;

fn others(scene: &Scene, at: &Place, token: u32) -> Others {
    let reach = at.error;
    let (origin, direction) = (at.p - at.ng * reach, at.ng);
    let mut others = Others::new();
    let mut add = |hit: Hit| {
        if (hit.instance, hit.primitive) == (at.instance, at.primitive) {
            return;
        }
        let Some(other) = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric) else { return };
        let one = |place: &Place| place.instance == other.instance && !face_each_other(place.ng, other.ng);
        if !one(at) && !others.iter().any(|(place, _)| one(place)) {
            others.push((Place::of(&other), hit));
        }
    };
    scene.tracer.each_hit(&Ray { origin, direction, tmax: 2.0 * reach, token }, &mut add);
    others
}

/// The first of the surfaces that lie where a ray along `direction` has met one that light passes; `None` where that is
/// alone.
#[inline(never)]
fn first(scene: &Scene, met: Place, hit: Hit, direction: Vec3, token: u32) -> Option<Hit> {
    let others = others(scene, &met, token);
    if others.is_empty() {
        return None;
    }
    let all = others.into_iter().chain([(met, hit)]);
    all.min_by_key(|(place, _)| order(scene, place, direction)).map(|(_, hit)| hit)
}

/// What lies at a place and comes after the surface there for a ray along `direction`, the next first.
fn after(scene: &Scene, place: &Place, direction: Vec3, token: u32) -> Others {
    let mut others = others(scene, place, token);
    others.retain(|(other, _)| order(scene, other, direction) > order(scene, place, direction));
    others.sort_unstable_by_key(|(other, _)| order(scene, other, direction));
    others
}

#[cold]
#[inline(never)]
fn next(scene: &Scene, place: &Place, direction: Vec3, token: u32) -> Option<Hit> {
    after(scene, place, direction, token).first().map(|(_, hit)| *hit)
}

/// Surfaces at a place that a ray along `direction` has to pass before it reaches the one there, in order.
#[cold]
#[inline(never)]
pub fn before(scene: &Scene, place: &Place, direction: Vec3, token: u32) -> SmallVec<[Surface; 2]> {
    // They come after it for light on its way back.
    let back = after(scene, place, -direction, token);
    let surface = |(_, hit): &(Place, Hit)| scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric);
    back.iter().rev().filter_map(surface).collect()
}

/// The surfaces along a ray, one after the other.
#[derive(Clone, Copy)]
pub struct Along {
    ray: Ray,
    /// Where the ray is, if there may be more.
    here: Option<Place>,
}

impl Along {
    /// Starts at the ray's origin; `leaving`: where on a surface that is, if others lie on it.
    #[inline(always)]
    pub fn new(ray: Ray, leaving: Option<Place>) -> Along {
        Along { ray, here: leaving }
    }

    /// What is left of the ray.
    #[inline(always)]
    pub fn ray(&self) -> &Ray {
        &self.ray
    }

    /// The next surface and how far from where the ray is now; `None` where there is none.
    #[inline(always)]
    pub fn next(&mut self, scene: &Scene) -> Option<(Surface, f32)> {
        if let Some(place) = self.here.take()
            && let Some(hit) = next(scene, &place, self.ray.direction, self.ray.token)
        {
            return self.surface(scene, hit, true).map(|surface| (surface, 0.0));
        }
        let hit = scene.tracer.intersect(&self.ray)?;
        self.met(scene, &hit)
    }

    /// The same where what is hit is known.
    #[inline(always)]
    pub fn met(&self, scene: &Scene, hit: &Hit) -> Option<(Surface, f32)> {
        self.surface(scene, *hit, false).map(|surface| (surface, hit.t))
    }

    /// What is hit, or what comes before it there; `is_first`: it is known that nothing does.
    #[inline(always)]
    fn surface(&self, scene: &Scene, mut hit: Hit, mut is_first: bool) -> Option<Surface> {
        loop {
            let surface = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric)?;
            // What lets no light pass is left on the side from which it was met, where nothing is in front of it.
            if !passes(scene, &surface) {
                return Some(surface);
            }
            if is_first {
                return Some(Surface { touching: true, ..surface });
            }
            if !scene.contacts.may_touch(hit.instance, hit.primitive) {
                return Some(surface);
            }
            let Some(other) = first(scene, Place::of(&surface), hit, self.ray.direction, self.ray.token) else {
                return Some(surface);
            };
            (hit, is_first) = (other, true);
        }
    }

    /// Goes on behind a surface.
    #[inline(always)]
    pub fn pass(&mut self, surface: &Surface) {
        let next = surface.spawn(self.ray.direction);
        self.ray.tmax -= (next - self.ray.origin).dot(self.ray.direction);
        self.ray.origin = next;
        self.here = Place::touching(surface);
    }
}
