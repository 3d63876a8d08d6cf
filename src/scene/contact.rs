//! Surfaces that lie on each other: a glass on a table, a liquid in a glass, sheets in a stack.
//!
//! A ray goes on a little past the surface it leaves ([`Surface::error`]), because rounding decides which of two surfaces
//! within that distance is nearer. So everything within it has to be found by other means. Where triangles may touch
//! ([`Contacts`](super::Contacts)), all surfaces at a place are collected and met in a stated order, whichever of them
//! Embree finds first.
//!
//! Surfaces that pass light, among themselves, are in optical contact:
//!
//! - a solid is entered before another is left, so that solids overlap, and nested dielectrics
//!   (`transport/interior.rs`) say what fills the space: liquid and glass meet without air between them;
//! - a sheet, which has no inside, is behind solids that are in front of it.
//!
//! Beside an opaque surface they stand off it by a film of air, as rigid bodies do, so that a picture does not change
//! when a glass is lifted off its table by a hair:
//!
//! - solids are left before the opaque surface is met, and entered after it has been left;
//! - a sheet lies on the side of the opaque surface that its front points to.
//!
//! A material in optical contact (`Material::optical_contact`: paint, a label, water on the floor of a pool) has no such
//! film: where one of the two has it, a ray meets the opaque surface alone.
//!
//! A ray in the other direction meets the surfaces in the reverse order, so light and importance take the same paths.

use super::Scene;
use super::contacts::face_each_other;
use crate::geometry::{Surface, triangle_error};
use crate::light::Emitter;
use crate::math::Vec3;
use crate::trace::{Hit, Ray};
use smallvec::SmallVec;

/// Whether rays may go on behind the surface.
#[inline(always)]
fn passes(scene: &Scene, surface: &Surface) -> bool {
    scene.materials.list[surface.material as usize].transmits()
}

/// A point of a surface, by what tells it from others there.
#[derive(Clone, Copy, Debug)]
pub struct ContactPoint {
    p: Vec3,
    ng: Vec3,
    instance: u32,
    primitive: u32,
    material: u32,
    error: f32,
}

impl ContactPoint {
    /// Where the surface is, if others lie on it there.
    #[inline(always)]
    pub fn touching(surface: &Surface) -> Option<ContactPoint> {
        surface.touching.then(|| ContactPoint::of(surface))
    }

    #[inline(always)]
    fn of(surface: &Surface) -> ContactPoint {
        let Surface { p, ng, instance, primitive, material, error, .. } = *surface;
        ContactPoint { p, ng, instance, primitive, material, error }
    }

    /// The place on the triangle of light `index` that is nearest to `near`, if others may lie on that triangle.
    #[inline]
    pub fn on_light(scene: &Scene, index: u32, near: Vec3) -> Option<ContactPoint> {
        if scene.contacts.is_empty() { None } else { ContactPoint::on_touched_light(scene, index, near) }
    }

    #[inline(never)]
    fn on_touched_light(scene: &Scene, index: u32, near: Vec3) -> Option<ContactPoint> {
        let Emitter::Triangle { instance, primitive, plane, corners: [corner, a, b], .. } =
            scene.lights.emitters()[index as usize]
        else {
            return None;
        };
        let ng = plane.truncate();
        let p = near - ng * (ng.dot(near) - plane.w);
        let error = scene.contacts.reach(instance, primitive, triangle_error([corner, corner + a, corner + b]))?;
        let material = scene.shapes.instances[instance as usize].material;
        Some(ContactPoint { p, ng, instance, primitive, material, error })
    }
}

/// Rank of a surface among those at one place, for a ray along `direction`; `film`: one of them is opaque.
fn rank(scene: &Scene, place: &ContactPoint, direction: Vec3, film: bool) -> (u8, i64, i64) {
    let front = direction.dot(place.ng) < 0.0;
    let material = &scene.materials.list[place.material as usize];
    let rank = match (material.transmits(), material.thin, front) {
        (false, ..) => 2,
        (true, false, false) if film => 0,
        (true, true, true) if film => 1,
        (true, true, false) if film => 3,
        (true, false, true) if film => 4,
        (true, true, false) => 1,
        (true, false, true) => 2,
        (true, false, false) => 3,
        (true, true, true) => 4,
    };
    let reversed = |index: u32| if front { i64::from(index) } else { -i64::from(index) };
    (rank, reversed(place.instance), reversed(place.primitive))
}

/// Surfaces at one place.
type Stack = SmallVec<[(ContactPoint, Hit); 4]>;

/// The surfaces at a place besides `at`, in no order.
fn others(scene: &Scene, at: &ContactPoint, token: u32) -> Stack {
    let reach = at.error;
    let (origin, direction) = (at.p - at.ng * reach, at.ng);
    let mut others = Stack::new();
    let mut add = |hit: Hit| {
        if (hit.instance, hit.primitive) == (at.instance, at.primitive) {
            return;
        }
        let Some(other) = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric) else { return };
        let one = |place: &ContactPoint| place.instance == other.instance && !face_each_other(place.ng, other.ng);
        if !one(at) && !others.iter().any(|(place, _)| one(place)) {
            others.push((ContactPoint { error: reach, ..ContactPoint::of(&other) }, hit));
        }
    };
    scene.tracer.each_hit(&Ray { origin, direction, tmax: 2.0 * reach, token }, &mut add);
    others
}

/// Leaves out what touches an opaque surface of `stack` without a film of air, and whether there is a film.
fn without_wetted(scene: &Scene, stack: &mut Stack) -> bool {
    let material = |place: &ContactPoint| &scene.materials.list[place.material as usize];
    let opaque = |place: &ContactPoint| !material(place).transmits();
    let film = stack.iter().any(|(place, _)| opaque(place));
    if film {
        let wets = stack.iter().any(|(place, _)| opaque(place) && material(place).optical_contact);
        stack.retain(|(place, _)| opaque(place) || !(wets || material(place).optical_contact));
    }
    film
}

/// The surfaces at the place where a ray along `direction` has met `met`, in order.
fn stack(scene: &Scene, met: ContactPoint, hit: Hit, direction: Vec3, token: u32) -> Stack {
    let mut stack = others(scene, &met, token);
    if !stack.is_empty() {
        stack.push((met, hit));
        let film = without_wetted(scene, &mut stack);
        stack.sort_unstable_by_key(|(place, _)| rank(scene, place, direction, film));
    }
    stack
}

/// The surfaces at a place that come after the one there for a ray along `direction`, in order.
fn following(scene: &Scene, place: &ContactPoint, direction: Vec3, token: u32) -> Stack {
    let mut others = others(scene, place, token);
    let passes = |place: &ContactPoint| scene.materials.list[place.material as usize].transmits();
    // A ray that leaves an opaque surface does not meet another one that coincides with it.
    others.retain(|(other, _)| passes(place) || passes(other));
    let own = (*place, Hit { t: 0.0, instance: place.instance, primitive: place.primitive, barycentric: [0.0; 2] });
    others.push(own);
    let film = without_wetted(scene, &mut others);
    let leaving = rank(scene, place, direction, film);
    others.retain(|(other, _)| rank(scene, other, direction, film) > leaving);
    others.sort_unstable_by_key(|(other, _)| rank(scene, other, direction, film));
    others
}

/// What is met at a place, in order.
fn surfaces<'a>(scene: &'a Scene, stack: &'a Stack) -> impl Iterator<Item = Surface> + 'a {
    stack.iter().filter_map(|(_, hit)| scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric))
}

#[cold]
#[inline(never)]
fn next(scene: &Scene, place: &ContactPoint, direction: Vec3, token: u32) -> Option<Hit> {
    following(scene, place, direction, token).first().map(|(_, hit)| *hit)
}

/// Surfaces at a place that a ray along `direction` meets after the one there, in order.
#[cold]
#[inline(never)]
pub fn surfaces_after(scene: &Scene, place: &ContactPoint, direction: Vec3, token: u32) -> SmallVec<[Surface; 2]> {
    surfaces(scene, &following(scene, place, direction, token)).collect()
}

/// Surfaces at a place that a ray along `direction` has to pass before it reaches the one there, in order.
pub fn surfaces_before(scene: &Scene, place: &ContactPoint, direction: Vec3, token: u32) -> SmallVec<[Surface; 2]> {
    // They come after it for light on its way back.
    let mut back = surfaces_after(scene, place, -direction, token);
    back.reverse();
    back
}

/// A surface that lies on one which a camera looks through along `direction`, and which it sees.
#[cold]
#[inline(never)]
pub fn visible_on_culled(scene: &Scene, culled: &Surface, direction: Vec3, token: u32) -> Option<Surface> {
    let others = others(scene, &ContactPoint::of(culled), token);
    surfaces(scene, &others).find(|other| !scene.culls(other, direction))
}

/// The surfaces along a ray, one after the other.
#[derive(Clone, Copy)]
pub struct RaySurfaces {
    ray: Ray,
    /// Where the ray is, if there may be more.
    here: Option<ContactPoint>,
}

impl RaySurfaces {
    /// Starts at the ray's origin; `leaving`: where on a surface that is, if others lie on it.
    #[inline(always)]
    pub fn new(ray: Ray, leaving: Option<ContactPoint>) -> RaySurfaces {
        RaySurfaces { ray, here: leaving }
    }

    /// What is left of the ray.
    #[inline(always)]
    pub fn ray(&self) -> &Ray {
        &self.ray
    }

    /// The next surface and its distance from where the ray is now; `None` where there is none. `inside`: the ray is in
    /// a solid, which it may have to leave before it meets an opaque surface.
    #[inline(always)]
    pub fn next(&mut self, scene: &Scene, inside: bool) -> Option<(Surface, f32)> {
        if let Some(place) = self.here.take()
            && let Some(hit) = next(scene, &place, self.ray.direction, self.ray.token)
        {
            let surface = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric)?;
            return Some((Surface { touching: true, error: place.error, ..surface }, 0.0));
        }
        let hit = scene.tracer.intersect(&self.ray)?;
        self.surface_at(scene, &hit, inside)
    }

    /// [`Along::next`] where it is known which triangle the ray hits.
    #[inline(always)]
    pub fn surface_at(&self, scene: &Scene, hit: &Hit, inside: bool) -> Option<(Surface, f32)> {
        let surface = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric)?;
        // From outside of all solids nothing is left before an opaque surface, unless a sheet lies on it.
        let alone = !passes(scene, &surface) && !inside && !scene.contacts.sheets;
        let reach = if alone { None } else { scene.contacts.reach(hit.instance, hit.primitive, surface.error) };
        let first = reach.and_then(|error| first(scene, &Surface { error, ..surface }, *hit, &self.ray));
        Some((first.unwrap_or(surface), hit.t))
    }

    /// Goes on behind a surface.
    #[inline(always)]
    pub fn pass(&mut self, surface: &Surface) {
        let next = surface.ray_origin(self.ray.direction);
        self.ray.tmax -= (next - self.ray.origin).dot(self.ray.direction);
        self.ray.origin = next;
        self.here = ContactPoint::touching(surface);
    }
}

/// The first of the surfaces at the place where a ray has met `met`; `None` where that is alone.
#[inline(never)]
fn first(scene: &Scene, met: &Surface, hit: Hit, ray: &Ray) -> Option<Surface> {
    let stack = stack(scene, ContactPoint::of(met), hit, ray.direction, ray.token);
    let (_, first) = stack.first()?;
    let surface = scene.shapes.surface(first.instance, first.primitive, first.barycentric)?;
    Some(Surface { touching: stack.len() > 1, error: met.error, ..surface })
}
