//! Nested dielectrics: which solids a path is inside of.
//!
//! The rule: a path keeps the solids it has entered and not left. Where several overlap, the one of highest priority
//! (`extras.caustique.priority`, 0 by default) fills the space, and among equals the smaller one ([`Scene::ranks`]):
//! paths of both directions must agree. A surface is a boundary only if what fills the space differs on its two sides;
//! otherwise, and where both sides are of one material, it is no bounce at all \[Schmidt and Budge 2002, "Simple Nested
//! Dielectrics in Ray Traced Images"\]. A path that leaves a solid it never entered (the eye or a lamp was inside) is
//! taken to have been in it.

use crate::material::{Material, MediumParameters};
use crate::math::Vec3;
use crate::scene::contact::{self, ContactPoint};
use crate::scene::{EMPTY_STACK, Scene, SolidStack};
use crate::spectrum::Wavelength;
use crate::trace::Ray;
use smallvec::SmallVec;

/// Solids that a path keeps with it, the last ones entered; of those before them it keeps one number.
const INNERMOST: usize = 5;

/// Two hits of an object that differ by less than this part of their distance are hits of one edge.
const SAME_CROSSING: f32 = 8.0 * f32::EPSILON;

/// Where the ray that looks for the solids around a point crosses the surface of one.
struct Boundary {
    object: u32,
    t: f32,
    instance: u32,
    leaves: bool,
}

/// The solids a path is inside of, in order of entry: each by the instance through whose surface it was entered.
#[derive(Clone, Copy, Debug)]
pub struct Interior {
    inside: [u32; INNERMOST],
    len: u8,
    /// Those entered before: a stack of the scene's [`crate::scene::SolidStacks`], or [`EMPTY_STACK`]; where there are some,
    /// `inside` is full.
    outer: u32,
}

impl PartialEq for Interior {
    fn eq(&self, other: &Interior) -> bool {
        self.entries() == other.entries() && self.outer == other.outer
    }
}

impl Default for Interior {
    /// The open space.
    fn default() -> Interior {
        Interior { inside: [0; INNERMOST], len: 0, outer: EMPTY_STACK }
    }
}

/// What is on the two sides of a solid's surface.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Material that fills the space on the side the path comes from; `None` is the open space.
    pub before: Option<u32>,
    /// Material that fills the space behind the surface.
    pub after: Option<u32>,
    /// The solids a path is in once it has crossed.
    pub interior: Interior,
}

impl Interior {
    fn entries(&self) -> &[u32] {
        &self.inside[..usize::from(self.len)]
    }

    /// Enters a solid.
    #[inline]
    fn push(&mut self, scene: &Scene, instance: u32) {
        if usize::from(self.len) == INNERMOST && !self.spill_outermost(scene) {
            // As if it replaced the last.
            self.len -= 1;
        }
        self.inside[usize::from(self.len)] = instance;
        self.len += 1;
    }

    /// Moves the first of those it has with it to the others.
    #[cold]
    #[inline(never)]
    fn spill_outermost(&mut self, scene: &Scene) -> bool {
        let Some(outer) = pushed(scene, self.outer, self.inside[0]) else { return false };
        self.outer = outer;
        self.inside.copy_within(1.., 0);
        self.len -= 1;
        true
    }

    /// Leaves the solid of the same object that was entered last; whether there is one.
    #[inline]
    fn remove(&mut self, scene: &Scene, instance: u32) -> bool {
        let object_of = |instance: u32| scene.shapes.instances[instance as usize].object;
        if let Some(at) = self.entries().iter().rposition(|&entry| object_of(entry) == object_of(instance)) {
            self.inside.copy_within(at + 1.., at);
            self.len -= 1;
            self.fill(scene);
            return true;
        }
        if self.outer == EMPTY_STACK {
            return false;
        }
        let left = without(scene, self.outer, object_of(instance));
        self.outer = left.unwrap_or(self.outer);
        left.is_some()
    }

    /// Takes one of the others back where there is room.
    #[inline]
    fn fill(&mut self, scene: &Scene) {
        if self.outer != EMPTY_STACK {
            let SolidStack { outer, last, .. } = scene.solid_stacks.get(self.outer);
            self.inside.copy_within(..INNERMOST - 1, 1);
            (self.inside[0], self.outer) = (last, outer);
            self.len += 1;
        }
    }

    /// The solids around `p`, where paths start: those that a ray from there leaves more often than it enters them. All
    /// surfaces along the ray count, however many lie on each other or on opaque ones.
    pub fn at(scene: &Scene, p: Vec3) -> Interior {
        let mut interior = Interior::default();
        if !scene.survey.solids {
            return interior;
        }
        // No axis, so that it grazes no wall of a box.
        let direction = Vec3::new(0.267_261, 0.801_784, 0.534_522);
        let mut crossings = SmallVec::<[Boundary; 16]>::new();
        scene.tracer.each_hit(&Ray { origin: p, direction, tmax: f32::INFINITY, token: 0 }, &mut |hit| {
            let Some(surface) = scene.shapes.surface(hit.instance, hit.primitive, hit.barycentric) else { return };
            if scene.materials.list[surface.material as usize].is_solid_glass() {
                let object = scene.shapes.instances[surface.instance as usize].object;
                let leaves = direction.dot(surface.ng) >= 0.0;
                crossings.push(Boundary { object, t: hit.t, instance: surface.instance, leaves });
            }
        });
        crossings.sort_unstable_by(|a, b| a.object.cmp(&b.object).then(a.t.total_cmp(&b.t)));
        // Triangles that share the edge a ray hits are crossed once.
        crossings.dedup_by(|b, a| (a.object, a.leaves) == (b.object, b.leaves) && b.t - a.t <= SAME_CROSSING * a.t);
        let mut around = SmallVec::<[(f32, u32, usize); 8]>::new();
        for of_object in crossings.chunk_by(|a, b| a.object == b.object) {
            let left = of_object.iter().filter(|crossing| crossing.leaves).count();
            if let Some(last) = of_object.iter().rfind(|crossing| crossing.leaves) {
                around.push((last.t, last.instance, (2 * left).saturating_sub(of_object.len())));
            }
        }
        // The solid that the ray leaves last was entered first.
        around.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        for (_, instance, times) in around {
            (0..times).for_each(|_| interior.push(scene, instance));
        }
        interior
    }

    /// No solid is around here.
    #[inline(always)]
    pub fn is_open(&self) -> bool {
        self.len == 0 && self.outer == EMPTY_STACK
    }

    /// Where a light path starts on a light that lies on solids, before it enters the first of them: without those.
    #[cold]
    pub fn before(mut self, scene: &Scene, place: &ContactPoint, direction: Vec3, token: u32) -> Interior {
        for surface in contact::surfaces_after(scene, place, direction, token) {
            if direction.dot(surface.ng) < 0.0 {
                self.remove(scene, surface.instance);
            }
        }
        self
    }

    /// Material that fills the space here; `None` is the open space.
    #[inline]
    pub fn material(&self, scene: &Scene) -> Option<u32> {
        self.host(scene).map(|instance| scene.shapes.instances[instance as usize].material)
    }

    /// The instance whose material fills the space here; `None` is the open space.
    #[inline]
    pub fn host(&self, scene: &Scene) -> Option<u32> {
        // `max_by_key` keeps the last of equals, which belong to one object.
        let inner = self.entries().iter().copied().max_by_key(|&instance| strength(scene, instance));
        if self.outer == EMPTY_STACK { inner } else { inner.map(|inner| stronger(scene, self.outer, inner)) }
    }

    /// Absorption and scattering here.
    #[inline]
    pub fn medium(&self, scene: &Scene) -> Option<MediumParameters> {
        match self.material(scene) {
            Some(m) => scene.materials.list[m as usize].medium,
            None => scene.medium,
        }
    }

    /// Index of refraction of what fills the space here.
    #[inline]
    pub fn ior(&self, scene: &Scene) -> f32 {
        ior(scene, self.material(scene))
    }

    /// What crossing the surface of `instance` means; `entering`: from its front to its back.
    #[inline]
    pub fn crossing(&self, scene: &Scene, instance: u32, entering: bool) -> Crossing {
        let mut interior = *self;
        let mut before = self.material(scene);
        if entering {
            interior.push(scene, instance);
        } else if !interior.remove(scene, instance) {
            before = Some(scene.shapes.instances[instance as usize].material);
        }
        Crossing { before, after: interior.material(scene), interior }
    }
}

/// Priority and rank: the larger fills the space.
#[inline]
fn strength(scene: &Scene, instance: u32) -> (i32, u32) {
    let material = scene.shapes.instances[instance as usize].material;
    (scene.materials.list[material as usize].priority, scene.ranks[instance as usize])
}

/// Which fills the space: the host of a stack or `inner`, which was entered later.
fn stronger(scene: &Scene, stack: u32, inner: u32) -> u32 {
    if stack == EMPTY_STACK {
        return inner;
    }
    let outer = scene.solid_stacks.get(stack).host;
    if strength(scene, outer) > strength(scene, inner) { outer } else { inner }
}

/// A stack with one more solid.
fn pushed(scene: &Scene, outer: u32, last: u32) -> Option<u32> {
    scene.solid_stacks.push(SolidStack { outer, last, host: stronger(scene, outer, last) })
}

/// A stack without the last solid of an object; `None` where it has none.
fn without(scene: &Scene, stack: u32, object: u32) -> Option<u32> {
    if stack == EMPTY_STACK {
        return None;
    }
    let SolidStack { outer, last, .. } = scene.solid_stacks.get(stack);
    if scene.shapes.instances[last as usize].object == object {
        return Some(outer);
    }
    pushed(scene, without(scene, outer, object)?, last)
}

/// Index of refraction of a material that fills space; 1 in the open.
#[inline]
pub fn ior(scene: &Scene, material: Option<u32>) -> f32 {
    material.map_or(1.0, |m| refractive(&scene.materials.list[m as usize]))
}

fn refractive(material: &Material) -> f32 {
    if material.ior.is_finite() { material.ior } else { 1.0 }
}

impl Crossing {
    /// The surface is none: the same material on both sides.
    #[inline]
    pub fn is_nothing(&self) -> bool {
        self.before == self.after
    }

    /// Whether the index of refraction on one of its sides depends on the wavelength.
    #[inline]
    pub fn disperses(&self, scene: &Scene) -> bool {
        [self.before, self.after].into_iter().flatten().any(|m| scene.materials.list[m as usize].disperses())
    }

    /// Index of refraction behind the surface (its back) over the one before it at a wavelength; `entering`: the path
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
