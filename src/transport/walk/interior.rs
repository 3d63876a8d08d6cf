//! Nested dielectrics: the solids that a path is inside of.
//!
//! A path keeps the solids that it has entered and not left. Where several overlap, the one of highest priority
//! (`extras.caustique.priority`, 0 by default) fills the space; of equal ones the smaller ([`Scene::ranks`]), so that
//! paths of both directions agree. A surface is a boundary only if different materials fill the space on its two sides;
//! otherwise it does not scatter \[Schmidt and Budge 2002, "Simple Nested Dielectrics in Ray Traced Images"\]. A path
//! that leaves a solid that it never entered (camera or light were inside) is taken to have been in it.
//!
//! Alpha decides once, where a path enters a solid or starts in it, whether the solid exists until the path leaves it.
//! Two subpaths that are joined inside have both decided. They are joined only if they agree, and the product of the
//! probabilities of their common decisions ([`Presence::chance`]), which both have sampled, divides the contribution
//! and multiplies the density of the technique in MIS weights.

use crate::geometry::{ALL_LINKINGS, Placement};
use crate::material::{Material, MediumParameters};
use crate::math::Vec3;
use crate::medium::{GridRay, MediumGrids};
use crate::random::{Draws, Purpose};
use crate::scene::contact::{self, ContactPoint};
use crate::scene::{ABSENT, EMPTY_STACK, Scene, SolidStack};
use crate::spectrum::Wavelength;
use crate::trace::Ray;
use smallvec::SmallVec;

/// Number of solids around a path that are stored with it, the innermost ones. A single index stands for all outer
/// ones.
const MAX_STORED_SOLIDS: usize = 5;

/// Hits of an object belong to one edge if their distances differ by less than this fraction.
const EDGE_TOLERANCE: f32 = 8.0 * f32::EPSILON;

/// A hit of the ray that finds the solids around a point.
struct Boundary {
    object: u32,
    t: f32,
    instance: u32,
    leaves: bool,
}

/// The solids around a path in order of entry, each by the instance through whose surface the path entered, with the
/// bit [`ABSENT`] if alpha has decided that the solid does not exist for the path.
#[derive(Clone, Copy, Debug)]
pub struct Interior {
    inside: [u32; MAX_STORED_SOLIDS],
    len: u8,
    /// The outer solids: a stack of the scene's [`crate::scene::SolidStacks`], or [`EMPTY_STACK`]. If it is not empty,
    /// `inside` is full.
    outer: u32,
}

impl PartialEq for Interior {
    fn eq(&self, other: &Interior) -> bool {
        self.entries() == other.entries() && self.outer == other.outer
    }
}

impl Default for Interior {
    /// The open space: no solid is around the path.
    fn default() -> Interior {
        Interior { inside: [0; MAX_STORED_SOLIDS], len: 0, outer: EMPTY_STACK }
    }
}

/// What alpha has decided about the solids around a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Presence {
    /// Code of the solids that do not exist for the path. Paths with equal codes at a point agree about the solids there
    /// ([`crate::scene::AlphaSolid::code`]).
    pub absent: u8,
    /// Probability of the decisions.
    pub chance: f32,
}

impl Presence {
    /// No solid with alpha is around the path.
    pub const CERTAIN: Presence = Presence { absent: 0, chance: 1.0 };

    /// The decisions about the solids in `interior`.
    #[inline(always)]
    pub fn of(scene: &Scene, interior: &Interior) -> Presence {
        if scene.alpha_solids.is_empty() { Presence::CERTAIN } else { interior.presence(scene) }
    }

    /// The decisions about the solids on both sides of a surface, which may itself bound a solid with alpha that exists.
    #[inline(always)]
    pub fn at_surface(scene: &Scene, sides: [&Interior; 2]) -> Presence {
        let [here, behind] = sides.map(|side| Presence::of(scene, side));
        if here.chance < behind.chance { here } else { behind }
    }
}

/// The media on both sides of the surface of a solid that a path hits.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Index of the material that fills the space before the surface, on the side of the path; `None` is the open
    /// space.
    pub before: Option<u32>,
    /// Index of the material that fills the space behind the surface; `None` is the open space.
    pub after: Option<u32>,
    /// The solids around the path behind the surface.
    pub interior: Interior,
}

impl Interior {
    fn entries(&self) -> &[u32] {
        &self.inside[..usize::from(self.len)]
    }

    /// Enters a solid.
    #[inline]
    fn push(&mut self, scene: &Scene, instance: u32) {
        if usize::from(self.len) == MAX_STORED_SOLIDS && !self.spill_outermost(scene) {
            // Replaces the innermost solid.
            self.len -= 1;
        }
        self.inside[usize::from(self.len)] = instance;
        self.len += 1;
    }

    /// Moves the outermost of the stored solids to the stack. Returns false if the stack is full.
    #[cold]
    #[inline(never)]
    fn spill_outermost(&mut self, scene: &Scene) -> bool {
        let Some(outer) = push_solid(scene, self.outer, self.inside[0]) else { return false };
        self.outer = outer;
        self.inside.copy_within(1.., 0);
        self.len -= 1;
        true
    }

    /// Leaves the innermost solid of the instance's object. Returns its entry; `None` if the path is in none.
    #[inline]
    fn remove(&mut self, scene: &Scene, instance: u32) -> Option<u32> {
        let object = object_of(scene, instance);
        if let Some(at) = self.entries().iter().rposition(|&entry| object_of(scene, entry) == object) {
            let entry = self.inside[at];
            self.inside.copy_within(at + 1.., at);
            self.len -= 1;
            self.refill(scene);
            return Some(entry);
        }
        if self.outer == EMPTY_STACK {
            return None;
        }
        let (outer, entry) = remove_solid(scene, self.outer, object)?;
        self.outer = outer;
        Some(entry)
    }

    /// The solids behind the surface of a solid that alpha lets not exist for the path: it enters the absent solid, or
    /// leaves one that was absent on entry, or that it never entered. `None` if it leaves a solid that exists.
    #[inline]
    pub fn pass_absent(&self, scene: &Scene, instance: u32, entering: bool) -> Option<Interior> {
        let mut interior = *self;
        if entering {
            interior.push(scene, instance | ABSENT);
            return Some(interior);
        }
        let entry = interior.remove(scene, instance);
        entry.is_none_or(|entry| entry & ABSENT != 0).then_some(interior)
    }

    /// The solids around the start of a path, of which alpha decides whether they exist.
    #[inline(always)]
    pub fn decided(self, scene: &Scene, draws: Draws) -> Interior {
        if scene.alpha_solids.is_empty() || self.is_open() {
            return self;
        }
        self.decide(scene, draws.token(Purpose::Alpha))
    }

    #[cold]
    #[inline(never)]
    fn decide(self, scene: &Scene, token: u32) -> Interior {
        self.limited(scene, |instance| scene.starts_in_solid(instance, token))
    }

    /// These solids, of which those of the instances for which `exists` is false are absent.
    #[cold]
    #[inline(never)]
    pub fn limited(self, scene: &Scene, exists: impl Fn(u32) -> bool) -> Interior {
        let mut decided = Interior::default();
        let mut push = |entry: u32| {
            decided.push(scene, if exists(entry & !ABSENT) { entry } else { entry | ABSENT });
        };
        let mut outer = SmallVec::<[u32; 8]>::new();
        self.for_each_outer(scene, |entry| outer.push(entry));
        outer.into_iter().rev().for_each(&mut push);
        self.entries().iter().copied().for_each(&mut push);
        decided
    }

    /// Calls `each` with the entries of the outer solids, innermost first.
    fn for_each_outer(&self, scene: &Scene, mut each: impl FnMut(u32)) {
        let mut stack = self.outer;
        while stack != EMPTY_STACK {
            let SolidStack { outer, last, .. } = scene.solid_stacks.get(stack);
            each(last);
            stack = outer;
        }
    }

    /// What alpha has decided about the solids.
    #[cold]
    #[inline(never)]
    fn presence(&self, scene: &Scene) -> Presence {
        let Presence { mut absent, mut chance } = Presence::CERTAIN;
        let mut count = |entry: u32| {
            let solid = scene.alpha_solids[(entry & !ABSENT) as usize];
            if entry & ABSENT == 0 {
                chance *= solid.chance;
            } else if solid.chance < 1.0 {
                chance *= 1.0 - solid.chance;
                absent ^= solid.code;
            }
        };
        self.entries().iter().copied().for_each(&mut count);
        self.for_each_outer(scene, count);
        Presence { absent, chance }
    }

    /// Takes a solid back from the stack after one was removed.
    #[inline]
    fn refill(&mut self, scene: &Scene) {
        if self.outer != EMPTY_STACK {
            let SolidStack { outer, last, .. } = scene.solid_stacks.get(self.outer);
            self.inside.copy_within(..MAX_STORED_SOLIDS - 1, 1);
            (self.inside[0], self.outer) = (last, outer);
            self.len += 1;
        }
    }

    /// The solids around `p`, where a path starts: those that a ray from there leaves more often than it enters. All
    /// surfaces along the ray count, including those that lie on each other or on opaque ones.
    pub fn at(scene: &Scene, p: Vec3) -> Interior {
        let mut interior = Interior::default();
        if !scene.survey.solids {
            return interior;
        }
        // Not along an axis, so that it does not graze the walls of boxes.
        let direction = Vec3::new(0.267_261, 0.801_784, 0.534_522);
        let mut crossings = SmallVec::<[Boundary; 16]>::new();
        scene.tracer.each_hit(&Ray { origin: p, direction, tmax: f32::INFINITY, token: 0 }, &mut |hit| {
            let Some(surface) = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric) else { return };
            if scene.materials.list[surface.material as usize].is_solid() {
                let object = scene.shapes.instances[surface.instance as usize].object;
                let leaves = direction.dot(surface.ng) >= 0.0;
                crossings.push(Boundary { object, t: hit.t, instance: surface.instance, leaves });
            }
        });
        crossings.sort_unstable_by(|a, b| a.object.cmp(&b.object).then(a.t.total_cmp(&b.t)));
        // A hit on an edge that triangles share counts once.
        crossings.dedup_by(|b, a| (a.object, a.leaves) == (b.object, b.leaves) && b.t - a.t <= EDGE_TOLERANCE * a.t);
        let mut around = SmallVec::<[(f32, u32, usize); 8]>::new();
        for of_object in crossings.chunk_by(|a, b| a.object == b.object) {
            let left = of_object.iter().filter(|crossing| crossing.leaves).count();
            if let Some(last) = of_object.iter().rfind(|crossing| crossing.leaves) {
                around.push((last.t, last.instance, (2 * left).saturating_sub(of_object.len())));
            }
        }
        // The solid that the ray leaves last is the outermost.
        around.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        for (_, instance, times) in around {
            (0..times).for_each(|_| interior.push(scene, instance));
        }
        interior
    }

    /// Whether no solid is around the path.
    #[inline(always)]
    pub fn is_open(&self) -> bool {
        self.len == 0 && self.outer == EMPTY_STACK
    }

    /// The solids around the start of a light path, without those that it enters because their surfaces lie on the
    /// light.
    #[cold]
    pub fn before_entering(mut self, scene: &Scene, place: &ContactPoint, direction: Vec3, token: u32) -> Interior {
        for surface in contact::surfaces_after(scene, place, direction, token) {
            if direction.dot(surface.ng) < 0.0 {
                self.remove(scene, surface.instance);
            }
        }
        self
    }

    /// Identifier of the medium around the path, whose photons it gathers: the index of its material, or `u32::MAX` for
    /// the medium that fills the scene. It also tells which solids with alpha are absent.
    #[inline]
    pub fn medium_id(&self, scene: &Scene) -> u32 {
        self.material(scene).unwrap_or(u32::MAX) ^ u32::from(Presence::of(scene, self).absent) << 24
    }

    /// Index of the material that fills the space around the path; `None` is the open space.
    #[inline]
    pub fn material(&self, scene: &Scene) -> Option<u32> {
        if self.is_open() {
            return None;
        }
        self.host(scene).map(|instance| scene.shapes.instances[instance as usize].material)
    }

    /// Index of the instance whose material fills the space around the path; `None` is the open space.
    #[inline(never)]
    pub fn host(&self, scene: &Scene) -> Option<u32> {
        let present = self.entries().iter().copied().filter(|entry| entry & ABSENT == 0);
        // `max_by_key` returns the last of equal ones, which belong to one object.
        let inner = present.max_by_key(|&instance| strength(scene, instance));
        if self.outer == EMPTY_STACK { inner } else { stronger(scene, self.outer, inner) }
    }

    /// Linkings that the medium around the path is part of ([`crate::geometry::Instance::linkings`]).
    #[inline]
    pub fn linkings(&self, scene: &Scene) -> u64 {
        if scene.lights.links().is_empty() {
            return ALL_LINKINGS;
        }
        self.host(scene).map_or(scene.lights.links().medium_linkings, |instance| scene.linkings(instance))
    }

    /// Whether a solid that is hidden from cameras fills the space around the path.
    #[cold]
    pub fn is_hidden(&self, scene: &Scene) -> bool {
        self.host(scene).is_some_and(|instance| scene.shapes.instances[instance as usize].hidden_from_camera)
    }

    /// Radiance that a camera in these solids measures, relative to the radiance there. Radiance over the squared index
    /// of refraction is constant along a ray \[Veach 1998, 5.2\], and a camera is not in the solids hidden from it.
    #[cold]
    pub fn seen_radiance(&self, scene: &Scene) -> f32 {
        let mut host = None;
        let mut see = |entry: u32| {
            let seen = entry & ABSENT == 0 && !scene.shapes.instances[entry as usize].hidden_from_camera;
            if seen && host.is_none_or(|host| strength(scene, entry) > strength(scene, host)) {
                host = Some(entry);
            }
        };
        self.entries().iter().copied().for_each(&mut see);
        self.for_each_outer(scene, see);
        let seen = ior(scene, host.map(|instance| scene.shapes.instances[instance as usize].material));
        (seen / self.ior(scene)).powi(2)
    }

    /// The medium that fills the space around the path; `None` without one.
    #[inline]
    pub fn medium(&self, scene: &Scene) -> Option<MediumParameters> {
        match self.material(scene) {
            Some(m) => scene.materials.list[m as usize].medium,
            None => scene.medium,
        }
    }

    /// The ray from `origin` along the unit `direction` in the density grid of the medium that fills the space around
    /// the path; `None` if that medium is homogeneous, or if there is none.
    #[inline]
    pub fn grid_ray<'s>(&self, scene: &'s Scene, origin: Vec3, direction: Vec3) -> Option<GridRay<'s>> {
        if !scene.survey.grids {
            return None;
        }
        let (_, grids, placement) = self.grids(scene)?;
        Some(GridRay::new(&grids.density, placement, origin, direction))
    }

    /// The instance whose medium fills the space around the path, the grids of that medium, and the placement of the
    /// instance; `None` if the medium is homogeneous, or if there is none.
    #[inline(never)]
    pub fn grids<'s>(&self, scene: &'s Scene) -> Option<(u32, &'s MediumGrids, &'s Placement)> {
        let host = self.host(scene)?;
        let instance = &scene.shapes.instances[host as usize];
        let grids = scene.materials.list[instance.material as usize].grids.as_ref()?;
        Some((host, grids, instance.to_world.as_ref()?))
    }

    /// Index of refraction of the medium that fills the space around the path; 1 in the open.
    #[inline]
    pub fn ior(&self, scene: &Scene) -> f32 {
        ior(scene, self.material(scene))
    }

    /// The media on both sides of the surface of `instance`; `entering`: the path comes from its front.
    #[inline]
    pub fn crossing(&self, scene: &Scene, instance: u32, entering: bool) -> Crossing {
        let mut interior = *self;
        let mut before = self.material(scene);
        if entering {
            interior.push(scene, instance);
        } else if interior.remove(scene, instance).is_none() {
            before = Some(scene.shapes.instances[instance as usize].material);
        }
        Crossing { before, after: interior.material(scene), interior }
    }
}

/// Priority of an instance, and its rank among instances of equal priority. Of several solids around a point, the one
/// with the larger pair fills the space.
#[inline]
fn strength(scene: &Scene, instance: u32) -> (i32, u32) {
    let material = scene.shapes.instances[instance as usize].material;
    (scene.materials.list[material as usize].priority, scene.ranks[instance as usize])
}

/// The object that an entry of an [`Interior`] belongs to.
#[inline]
fn object_of(scene: &Scene, entry: u32) -> u32 {
    scene.shapes.instances[(entry & !ABSENT) as usize].object
}

/// The instance that fills the space, out of the host of `stack` and `inner`.
fn stronger(scene: &Scene, stack: u32, inner: Option<u32>) -> Option<u32> {
    if stack == EMPTY_STACK {
        return inner;
    }
    // Of equal ones the later, `inner`.
    scene.solid_stacks.get(stack).host.into_iter().chain(inner).max_by_key(|&instance| strength(scene, instance))
}

/// Adds a solid to a stack; `None` if there are too many stacks.
fn push_solid(scene: &Scene, outer: u32, last: u32) -> Option<u32> {
    let host = stronger(scene, outer, (last & ABSENT == 0).then_some(last));
    scene.solid_stacks.push(SolidStack { outer, last, host })
}

/// Removes the solid of an object that was entered last from a stack. Returns the new stack and the removed instance;
/// `None` if no solid of the object is in the stack.
fn remove_solid(scene: &Scene, stack: u32, object: u32) -> Option<(u32, u32)> {
    if stack == EMPTY_STACK {
        return None;
    }
    let SolidStack { outer, last, .. } = scene.solid_stacks.get(stack);
    if object_of(scene, last) == object {
        return Some((outer, last));
    }
    let (outer, entry) = remove_solid(scene, outer, object)?;
    Some((push_solid(scene, outer, last)?, entry))
}

/// Index of refraction of a material that fills space; 1 in the open.
#[inline]
pub fn ior(scene: &Scene, material: Option<u32>) -> f32 {
    material.map_or(1.0, |m| finite_ior(&scene.materials.list[m as usize]))
}

fn finite_ior(material: &Material) -> f32 {
    if material.ior.is_finite() { material.ior } else { 1.0 }
}

impl Crossing {
    /// Whether both sides of the surface have one material, so that it does not scatter.
    #[inline]
    pub fn is_nothing(&self) -> bool {
        self.before == self.after
    }

    /// Whether the index of refraction on one of the sides of the surface depends on the wavelength.
    #[inline]
    pub fn disperses(&self, scene: &Scene) -> bool {
        [self.before, self.after].into_iter().flatten().any(|m| scene.materials.list[m as usize].disperses())
    }

    /// Index of refraction on the back of the surface over that on its front, at a wavelength. `entering`: the path
    /// comes from its front.
    #[inline]
    pub fn eta(&self, scene: &Scene, entering: bool, wavelength: &Wavelength) -> f32 {
        let ior = |material: Option<u32>| match material.map(|m| &scene.materials.list[m as usize]) {
            Some(material) if material.disperses() => material.ior_at(wavelength.nm),
            _ => ior(scene, material),
        };
        let (before, after) = (ior(self.before), ior(self.after));
        if entering { after / before } else { before / after }
    }
}
