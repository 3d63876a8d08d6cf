//! Surfaces that lie on each other: a glass on a table, a liquid in a glass, sheets in a stack.
//!
//! A ray goes on a little past the surface it leaves ([`Surface::error`]), for rounding decides about what is nearer; so whatever lies in
//! that little way has to be met by other means. Where light passes a surface, all others there are looked for, and taken to lie on each
//! other in this order, whichever Embree finds first:
//!
//! - what lets no light pass comes first: glass and the table that it stands on are in contact;
//! - a solid is entered before another is left, so that solids overlap, and nested dielectrics (`interior.rs`) say what fills the space:
//!   liquid and glass are in contact, without air between them;
//! - what has no inside is behind solids that are in front of it.
//!
//! Seen from the other side, the order is the reverse, but for the opaque, which nothing passes: light and importance go the same ways.

use crate::geometry::Surface;
use crate::math::Vec3;
use crate::scene::Scene;
use crate::trace::{Hit, Ray};
use smallvec::SmallVec;
use std::cmp::Ordering;

/// Two surfaces of one mesh lie on each other where their normals are opposite: closer than this cosine. What is not is its neighbour.
const OPPOSITE: f32 = -0.99;

/// Whether rays may go on behind the surface.
#[inline(always)]
pub(super) fn passes(scene: &Scene, surface: &Surface) -> bool {
    scene.materials.list[surface.material as usize].transmission > 0.0
}

/// Where a surface comes among those at one place, for a ray along `direction`.
fn order(scene: &Scene, surface: &Surface, direction: Vec3) -> (u8, i64, i64) {
    let front = direction.dot(surface.ng) < 0.0;
    let rank = match (passes(scene, surface), scene.materials.list[surface.material as usize].thin, front) {
        (false, ..) => 0,
        (true, true, false) => 1,
        (true, false, true) => 2,
        (true, false, false) => 3,
        (true, true, true) => 4,
    };
    let reversed = |index: u32| if front { i64::from(index) } else { -i64::from(index) };
    (rank, reversed(surface.instance), reversed(surface.primitive))
}

/// Surfaces at the place of another, besides it.
type Others = SmallVec<[Surface; 3]>;

fn others(scene: &Scene, surface: &Surface, token: u32) -> Others {
    let reach = surface.error();
    let (origin, direction) = (surface.p - surface.ng * reach, surface.ng);
    let mut others = Others::new();
    let mut add = |hit: Hit| {
        if (hit.instance, hit.primitive) == (surface.instance, surface.primitive) {
            return;
        }
        let Some(other) = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric) else { return };
        // Where triangles of a mesh meet, they are one surface.
        let one = |of: &Surface| of.instance == other.instance && of.ng.dot(other.ng) > OPPOSITE;
        if !one(surface) && !others.iter().any(one) {
            // What lets no light pass is left on the side from which it was met, where nothing is in front of it.
            others.push(Surface { touching: passes(scene, &other), ..other });
        }
    };
    scene.tracer.each_hit(&Ray { origin, direction, tmax: 2.0 * reach, token }, &mut add);
    others
}

/// The first of the surfaces that lie where a ray along `direction` has met one that light passes.
#[inline(never)]
pub(super) fn first(scene: &Scene, met: Surface, direction: Vec3, token: u32) -> Surface {
    let others = others(scene, &met, token);
    if others.is_empty() {
        return met;
    }
    let by_order = |a: &Surface, b: &Surface| order(scene, a, direction).cmp(&order(scene, b, direction));
    let met = Surface { touching: true, ..met };
    others.into_iter().chain([met]).min_by(by_order).unwrap_or(met)
}

/// Surfaces that lie where `touching` does and come after it for a ray along `direction`, the next first.
#[cold]
#[inline(never)]
pub(super) fn after(scene: &Scene, touching: &Surface, direction: Vec3, token: u32) -> Others {
    let place = |surface: &Surface| order(scene, surface, direction);
    let mut others = others(scene, touching, token);
    others.retain(|other| place(other).cmp(&place(touching)) == Ordering::Greater);
    others.sort_unstable_by_key(|other| place(other));
    others
}

/// The surfaces along a ray, one after the other.
pub struct Along {
    ray: Ray,
    /// Those at the place where the ray is, the next last.
    here: Others,
}

impl Along {
    /// Starts at the ray's origin; `leaving`: the surface that it is on, if that touches others.
    #[inline(always)]
    pub fn new(scene: &Scene, ray: Ray, leaving: Option<&Surface>) -> Along {
        let mut along = Along { ray, here: Others::new() };
        if let Some(surface) = leaving {
            along.stay(scene, surface);
        }
        along
    }

    /// What is left of the ray.
    #[inline(always)]
    pub fn ray(&self) -> &Ray {
        &self.ray
    }

    #[cold]
    #[inline(never)]
    fn stay(&mut self, scene: &Scene, surface: &Surface) {
        self.here = after(scene, surface, self.ray.direction, self.ray.token);
        self.here.reverse();
    }

    /// The next surface and how far from where the ray is now; `None` where there is none.
    #[inline(always)]
    pub fn next(&mut self, scene: &Scene) -> Option<(Surface, f32)> {
        match self.here.pop() {
            Some(surface) => Some((surface, 0.0)),
            None => scene.tracer.intersect(&self.ray).and_then(|hit| self.met(scene, &hit)),
        }
    }

    /// The same where what is hit is known.
    #[inline(always)]
    pub fn met(&self, scene: &Scene, hit: &Hit) -> Option<(Surface, f32)> {
        let surface = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric)?;
        let surface =
            if passes(scene, &surface) { first(scene, surface, self.ray.direction, self.ray.token) } else { surface };
        Some((surface, hit.t))
    }

    /// Goes on behind a surface.
    #[inline(always)]
    pub fn pass(&mut self, scene: &Scene, surface: &Surface) {
        let next = surface.spawn(self.ray.direction);
        self.ray.tmax -= (next - self.ray.origin).dot(self.ray.direction);
        self.ray.origin = next;
        if surface.touching && self.here.is_empty() {
            self.stay(scene, surface);
        }
    }
}
