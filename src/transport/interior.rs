//! Nested dielectrics: which solids a path is inside of.
//!
//! The rule: a path keeps the solids it has entered and not left. Where several overlap, the one of highest priority
//! (`extras.caustique.priority`, 0 by default) fills the space, and among equals the one entered last. A surface is a boundary
//! only if what fills the space differs on its two sides; otherwise, and where both sides are of one material, it is no bounce at all
//! \[Schmidt and Budge 2002, "Simple Nested Dielectrics in Ray Traced Images"\]. A path that leaves a solid it never entered
//! (the eye or a lamp was inside) is taken to have been in it.

use super::contact::Along;
use crate::material::{Material, MediumParameters};
use crate::math::Vec3;
use crate::scene::Scene;
use crate::spectrum::Wavelength;
use crate::trace::Ray;

/// Most solids a path can be inside of at once; further ones are entered as if they replaced the innermost.
const MAX_NESTED: usize = 6;

/// Surfaces looked at to find where a path starts; a scene with more along one ray has walls enough around the point.
const MAX_SURROUNDING_HITS: u32 = 1000;

/// The solids a path is inside of, in order of entry: each by the instance through whose surface it was entered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Interior {
    inside: [u32; MAX_NESTED],
    len: u8,
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

    /// The solids around `p`: those that a ray from it leaves without having entered. Where paths start.
    pub fn at(scene: &Scene, p: Vec3) -> Interior {
        let mut interior = Interior::default();
        if !scene.survey.solids {
            return interior;
        }
        // No axis, so that it grazes no wall of a box.
        let direction = Vec3::new(0.267_261, 0.801_784, 0.534_522);
        let mut along = Along::new(Ray { origin: p, direction, tmax: f32::INFINITY, token: 0 }, None);
        let mut entered: Vec<u32> = Vec::new();
        let mut left: Vec<u32> = Vec::new();
        for _ in 0..MAX_SURROUNDING_HITS {
            let Some((surface, _)) = along.next(scene) else { break };
            along.pass(&surface);
            if !scene.materials.list[surface.material as usize].is_solid_glass() {
                continue;
            }
            let object = scene.shapes.instances[surface.instance as usize].object;
            if direction.dot(surface.ng) < 0.0 {
                entered.push(object);
            } else if let Some(at) = entered.iter().position(|&o| o == object) {
                entered.swap_remove(at);
            } else {
                left.push(surface.instance);
            }
        }
        // What is left last was entered first.
        for &entry in left.iter().rev().take(MAX_NESTED) {
            interior.inside[usize::from(interior.len)] = entry;
            interior.len += 1;
        }
        interior
    }

    /// Material that fills the space here; `None` is the open space.
    #[inline]
    pub fn material(&self, scene: &Scene) -> Option<u32> {
        let material = |instance: &u32| scene.shapes.instances[*instance as usize].material;
        // `max_by_key` keeps the last of equals: the one entered last.
        self.entries().iter().map(material).max_by_key(|&m| scene.materials.list[m as usize].priority)
    }

    /// The instance whose material fills the space here; `None` is the open space.
    #[inline]
    pub fn host(&self, scene: &Scene) -> Option<u32> {
        let priority = |&&instance: &&u32| {
            scene.materials.list[scene.shapes.instances[instance as usize].material as usize].priority
        };
        self.entries().iter().max_by_key(priority).copied()
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
        let object_of = |instance: u32| scene.shapes.instances[instance as usize].object;
        let mut interior = *self;
        let mut before = self.material(scene);
        if entering {
            let at = usize::from(interior.len).min(MAX_NESTED - 1);
            interior.inside[at] = instance;
            interior.len = at as u8 + 1;
        } else if let Some(at) = self.entries().iter().rposition(|&e| object_of(e) == object_of(instance)) {
            interior.inside.copy_within(at + 1.., at);
            interior.len -= 1;
        } else {
            before = Some(scene.shapes.instances[instance as usize].material);
        }
        Crossing { before, after: interior.material(scene), interior }
    }
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

    /// Index of refraction behind the surface (its back) over the one before it at a wavelength; `entering`: the path comes from its front.
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

/// Where the paths of a render start: the solids around the camera and around each light.
pub struct Surroundings {
    /// Around the camera.
    pub eye: Interior,
    /// Around the lights, by index; empty when the scene has no solids.
    lights: Vec<Interior>,
}

impl Surroundings {
    /// Looks around the camera and one point of every light.
    pub fn new(scene: &Scene, eye: Vec3) -> Surroundings {
        let lights = if scene.survey.solids {
            let emitters = scene.lights.emitters().iter();
            emitters
                .map(|e| e.anywhere(&scene.shapes).map_or(Interior::default(), |p| Interior::at(scene, p)))
                .collect()
        } else {
            Vec::new()
        };
        Surroundings { eye: Interior::at(scene, eye), lights }
    }

    /// Around light `index`.
    #[inline]
    pub fn light(&self, index: u32) -> Interior {
        self.lights.get(index as usize).copied().unwrap_or_default()
    }
}
