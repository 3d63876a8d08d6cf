//! Surfaces that touch: a glass on a table, a liquid in a glass, a stack of sheets.
//!
//! A ray starts at a small offset from the surface it leaves ([`Surface::error`]). Rounding decides which of two
//! surfaces within the offset is nearer, so rays cannot find the order of touching surfaces. Where triangles may touch
//! ([`Contacts`](super::Contacts)), a query collects all surfaces at the point, and the ray crosses them in an order
//! that does not depend on Embree's first hit.
//!
//! Transmitting surfaces are in optical contact with each other:
//!
//! - The ray enters a solid before it leaves another one, so the solids overlap, and nested dielectrics
//!   (`transport/interior.rs`) determine what fills the space. Liquid and glass meet without air between them.
//! - A sheet, which has no inside, is behind the solids in front of it.
//!
//! Transmitting surfaces are separated from an opaque surface by a film of air, as rigid bodies are. So a picture does
//! not change when a glass is lifted off its table by a tiny distance:
//!
//! - The ray leaves solids before it hits the opaque surface, and enters solids after it has left the opaque surface.
//! - A sheet is on the side of the opaque surface that its front points to.
//!
//! A material with `Material::optical_contact` (paint, a label, water on the floor of a pool) has no such film: if one
//! of the two materials has it, the ray hits the opaque surface alone.
//!
//! A reversed ray crosses the surfaces in the reverse order, so light paths and camera paths are the same.

use super::Scene;
use super::contacts::face_each_other;
use crate::geometry::{Surface, triangle_error};
use crate::light::{Emitter, TriangleLight};
use crate::math::Vec3;
use crate::trace::{Hit, Ray};
use smallvec::SmallVec;

/// Whether rays may continue behind the surface, because its material may transmit light.
#[inline(always)]
fn passes(scene: &Scene, surface: &Surface) -> bool {
    scene.materials.list[surface.material as usize].transmits()
}

/// A point on a surface that other surfaces may touch.
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
    /// The point of `surface`, if other surfaces touch it there; otherwise `None`.
    #[inline(always)]
    pub fn touching(surface: &Surface) -> Option<ContactPoint> {
        surface.touching.then(|| ContactPoint::of(surface))
    }

    #[inline(always)]
    fn of(surface: &Surface) -> ContactPoint {
        let Surface { p, ng, instance, primitive, material, error, .. } = *surface;
        ContactPoint { p, ng, instance, primitive, material, error }
    }

    /// The point nearest to `near` on the triangle of the light with index `index`, if other surfaces may touch the
    /// triangle; otherwise `None`.
    #[inline]
    pub fn on_light(scene: &Scene, index: u32, near: Vec3) -> Option<ContactPoint> {
        if scene.contacts.is_empty() { None } else { ContactPoint::on_touched_light(scene, index, near) }
    }

    #[inline(never)]
    fn on_touched_light(scene: &Scene, index: u32, near: Vec3) -> Option<ContactPoint> {
        let Emitter::Triangle(TriangleLight { instance, primitive, plane, corners: [corner, a, b], .. }) =
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

/// Sort key of a surface among those that touch at `point`: sorted by it, they are in the order in which a ray along
/// `direction` crosses them. `film`: an opaque surface is among them, with a film of air before it.
fn rank(scene: &Scene, point: &ContactPoint, direction: Vec3, film: bool) -> (u8, i64, i64) {
    let front = direction.dot(point.ng) < 0.0;
    let material = &scene.materials.list[point.material as usize];
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
    (rank, reversed(point.instance), reversed(point.primitive))
}

/// Surfaces that touch at one point, each with its hit by a ray.
type Stack = SmallVec<[(ContactPoint, Hit); 4]>;

/// The other surfaces that touch the surface at `at`, in no order. `token` holds the random bits of the ray for alpha.
fn others(scene: &Scene, at: &ContactPoint, token: u32) -> Stack {
    let reach = at.error;
    let (origin, direction) = (at.p - at.ng * reach, at.ng);
    let mut others = Stack::new();
    let mut add = |hit: Hit| {
        if (hit.instance, hit.primitive) == (at.instance, at.primitive) {
            return;
        }
        let Some(other) = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric) else { return };
        // Neighbouring triangles of one mesh are one surface.
        let same = |point: &ContactPoint| point.instance == other.instance && !face_each_other(point.ng, other.ng);
        if !same(at) && !others.iter().any(|(point, _)| same(point)) {
            others.push((ContactPoint { error: reach, ..ContactPoint::of(&other) }, hit));
        }
    };
    scene.tracer.each_hit(&Ray { origin, direction, tmax: 2.0 * reach, token }, &mut add);
    others
}

/// Removes the transmitting surfaces that are in optical contact with an opaque surface. Returns whether an opaque
/// surface is in the stack, so that a film of air separates the remaining surfaces from it.
fn remove_optical_contacts(scene: &Scene, stack: &mut Stack) -> bool {
    let material = |point: &ContactPoint| &scene.materials.list[point.material as usize];
    let opaque = |point: &ContactPoint| !material(point).transmits();
    let film = stack.iter().any(|(point, _)| opaque(point));
    if film {
        let contact = stack.iter().any(|(point, _)| opaque(point) && material(point).optical_contact);
        stack.retain(|(point, _)| opaque(point) || !(contact || material(point).optical_contact));
    }
    film
}

/// All surfaces that touch at `hit_point`, in the order in which a ray along `direction` crosses them; empty if no
/// other surface touches the one that was hit.
fn stack(scene: &Scene, hit_point: ContactPoint, hit: Hit, direction: Vec3, token: u32) -> Stack {
    let mut stack = others(scene, &hit_point, token);
    if !stack.is_empty() {
        stack.push((hit_point, hit));
        let film = remove_optical_contacts(scene, &mut stack);
        stack.sort_unstable_by_key(|(point, _)| rank(scene, point, direction, film));
    }
    stack
}

/// The touching surfaces, with their hits, that a ray along `direction` crosses after the one at `point`, in order.
fn following(scene: &Scene, point: &ContactPoint, direction: Vec3, token: u32) -> Stack {
    let mut others = others(scene, point, token);
    let passes = |point: &ContactPoint| scene.materials.list[point.material as usize].transmits();
    // A ray that leaves an opaque surface does not hit another opaque surface that coincides with it.
    others.retain(|(other, _)| passes(point) || passes(other));
    let own = (*point, Hit { t: 0.0, instance: point.instance, primitive: point.primitive, barycentric: [0.0; 2] });
    others.push(own);
    let film = remove_optical_contacts(scene, &mut others);
    let leaving = rank(scene, point, direction, film);
    others.retain(|(other, _)| rank(scene, other, direction, film) > leaving);
    others.sort_unstable_by_key(|(other, _)| rank(scene, other, direction, film));
    others
}

/// The surface at each hit of a stack of touching surfaces, in the order of the stack.
fn surfaces<'a>(scene: &'a Scene, stack: &'a Stack) -> impl Iterator<Item = Surface> + 'a {
    stack.iter().filter_map(|(_, hit)| scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric))
}

/// The surfaces touching the one at `point` that a ray along `direction` crosses after it, in order.
#[cold]
#[inline(never)]
pub fn surfaces_after(scene: &Scene, point: &ContactPoint, direction: Vec3, token: u32) -> SmallVec<[Surface; 2]> {
    surfaces(scene, &following(scene, point, direction, token)).collect()
}

/// The surfaces touching the one at `point` that a ray along `direction` crosses before it, in order.
pub fn surfaces_before(scene: &Scene, point: &ContactPoint, direction: Vec3, token: u32) -> SmallVec<[Surface; 2]> {
    // The reversed ray crosses them after the one at `point`.
    let mut back = surfaces_after(scene, point, -direction, token);
    back.reverse();
    back
}

/// A surface that touches `culled`, a back face through which camera rays pass, and that a camera ray along `direction`
/// does not pass; `None` if there is none.
#[cold]
#[inline(never)]
pub fn visible_on_culled(scene: &Scene, culled: &Surface, direction: Vec3, token: u32) -> Option<Surface> {
    let others = others(scene, &ContactPoint::of(culled), token);
    surfaces(scene, &others).find(|other| !scene.culls(other, direction))
}

/// Iterates over the surfaces along a ray, touching ones included.
#[derive(Clone, Copy)]
pub struct RaySurfaces {
    ray: Ray,
    /// Current point of the ray, if more surfaces may touch there; otherwise `None`.
    here: Option<ContactPoint>,
}

impl RaySurfaces {
    /// Starts at the origin of `ray`. `leaving` is the point of the surface that the ray leaves, if other surfaces
    /// touch it there.
    #[inline(always)]
    pub fn new(ray: Ray, leaving: Option<ContactPoint>) -> RaySurfaces {
        RaySurfaces { ray, here: leaving }
    }

    /// The part of the ray that is still to be traced.
    #[inline(always)]
    pub fn ray(&self) -> &Ray {
        &self.ray
    }

    /// The next surface and its distance from the current point; `None` at the end of the ray. `inside`: the ray is in
    /// a solid, which it may leave before it hits an opaque surface.
    #[inline(always)]
    pub fn next(&mut self, scene: &Scene, inside: bool) -> Option<(Surface, f32)> {
        self.next_traced(scene, None, inside)
    }

    /// Does the work of [`RaySurfaces::next`]. `traced` is the nearest hit of the ray, if the ray has been traced.
    #[inline(always)]
    pub fn next_traced(&mut self, scene: &Scene, traced: Option<Option<Hit>>, inside: bool) -> Option<(Surface, f32)> {
        let hit = match traced {
            Some(hit) => hit,
            None => {
                if self.here.is_some()
                    && let Some(next) = self.next_touching(scene)
                {
                    return next;
                }
                scene.tracer.intersect(&self.ray)
            }
        };
        self.surface_at(scene, &hit?, inside)
    }

    /// The next surface at the current point of the ray, as [`RaySurfaces::next`] returns it; `None` if no more
    /// surfaces touch there.
    #[cold]
    #[inline(never)]
    fn next_touching(&mut self, scene: &Scene) -> Option<Option<(Surface, f32)>> {
        let point = self.here.take()?;
        let (_, hit) = *following(scene, &point, self.ray.direction, self.ray.token).first()?;
        let surface = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric);
        Some(surface.map(|surface| (Surface { touching: true, error: point.error, ..surface }, 0.0)))
    }

    /// Does the work of [`RaySurfaces::next`] for a ray whose nearest hit is known.
    #[inline(always)]
    pub fn surface_at(&self, scene: &Scene, hit: &Hit, inside: bool) -> Option<(Surface, f32)> {
        let mut surface = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric)?;
        // Outside all solids, an opaque surface comes first, unless a sheet touches it.
        let alone = !passes(scene, &surface) && !inside && !scene.contacts.sheets;
        if !alone
            && let Some(reach) = scene.contacts.reach(hit.instance, hit.primitive, surface.error)
            && let Some(first) = first(scene, &surface, reach, *hit, &self.ray)
        {
            surface = first;
        }
        Some((surface, hit.t))
    }

    /// Continues the ray behind `surface`, which it has just crossed.
    #[inline(always)]
    pub fn pass(&mut self, surface: &Surface) {
        let next = surface.ray_origin(self.ray.direction);
        self.ray.tmax -= (next - self.ray.origin).dot(self.ray.direction);
        self.ray.origin = next;
        self.here = ContactPoint::touching(surface);
    }
}

/// The surface that a ray crosses first among those within the distance `reach` of the surface that it hit; `None` if
/// there are no others.
#[inline(never)]
fn first(scene: &Scene, surface: &Surface, reach: f32, hit: Hit, ray: &Ray) -> Option<Surface> {
    let point = ContactPoint { error: reach, ..ContactPoint::of(surface) };
    let stack = stack(scene, point, hit, ray.direction, ray.token);
    let (_, first) = stack.first()?;
    let first = scene.shapes.surface(first.instance, first.primitive, first.barycentric)?;
    Some(Surface { touching: stack.len() > 1, error: reach, ..first })
}
