//! Which triangles may lie on others where light passes one of the two: only there does a ray look for more than what
//! it hits (`scene/contact.rs`).

use crate::geometry::{Extent, Shapes, coordinate_error};
use crate::material::Materials;
use crate::math::Vec3;
use rayon::prelude::*;
use rstar::{AABB, RTree, RTreeObject};
use std::collections::BTreeMap;

/// Surfaces lie on each other where they are as good as parallel: cosine of the angle between them, or more. Where they
/// cross, they do along a line, which no ray meets.
const PARALLEL: f32 = 0.99;

/// In a scene of more triangles than this, copies counted, any that light passes is taken to have others on it.
const MOST: usize = 1 << 26;
/// And in one where light passes more than this: a tree over them takes as long and as much memory as the scene itself
/// (20,000 copies of a glass ball: minutes and gigabytes), a look beside each hit a tenth of a render's time.
const MOST_PASSED: usize = 1 << 21;

/// Whether two surfaces of one mesh that are at one place lie on each other there. Those that do not are neighbours,
/// one surface where they meet.
pub(super) fn face_each_other(a: Vec3, b: Vec3) -> bool {
    a.dot(b) < -PARALLEL
}

/// A triangle in world space.
#[derive(Clone, Copy)]
struct Triangle {
    corners: [Vec3; 3],
    normal: Vec3,
    /// How far its positions may be off its plane.
    error: f32,
    /// Largest coordinate of its corners.
    largest: f32,
    instance: u32,
    primitive: u32,
}

impl Triangle {
    fn new(corners: [Vec3; 3], instance: u32, primitive: u32) -> Option<Triangle> {
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a).try_normalize()?;
        let extent = Extent::of(corners);
        let (error, largest) = (extent.plane_error(), extent.largest.max_element());
        Some(Triangle { corners, normal, error, largest, instance, primitive })
    }

    /// How far apart the two may be where one lies on the other: at points that are within both.
    fn reach(&self, other: &Triangle) -> f32 {
        let nearest = self.largest.min(other.largest);
        self.error + other.error + 2.0 * coordinate_error(Vec3::splat(nearest))
    }

    /// Whether another may lie on it: it is as good as parallel and reaches its plane.
    fn may_touch(&self, other: &Triangle) -> bool {
        let parallel = match self.instance == other.instance {
            true => face_each_other(self.normal, other.normal),
            false => self.normal.dot(other.normal).abs() > PARALLEL,
        };
        let heights = other.corners.map(|corner| (corner - self.corners[0]).dot(self.normal));
        let reach = 2.0 * self.reach(other);
        parallel && heights.iter().any(|height| *height >= -reach) && heights.iter().any(|height| *height <= reach)
    }
}

impl Triangle {
    /// Whether another of the same mesh lies on it, all of it, facing it: two sides of a pane that positions cannot
    /// tell apart.
    fn is_one_with(&self, other: &Triangle) -> bool {
        let reach = self.reach(other);
        let within = |corner: Vec3| (corner - self.corners[0]).dot(self.normal).abs() <= reach;
        self.instance == other.instance && other.corners.into_iter().all(within)
    }
}

impl RTreeObject for Triangle {
    type Envelope = AABB<[f32; 3]>;

    fn envelope(&self) -> AABB<[f32; 3]> {
        let [a, b, c] = self.corners;
        let error = self.error + coordinate_error(Vec3::splat(self.largest));
        let (low, high) = (a.min(b).min(c) - error, a.max(b).max(c) + error);
        AABB::from_corners(low.to_array(), high.to_array())
    }
}

/// Triangles that may lie on others, at least one of the two passing light.
#[derive(Clone, Debug, Default)]
pub struct Contacts {
    /// By instance, then by triangle: how far apart two surfaces in contact there may be (metres), 0 where there is no
    /// contact; empty where no triangle of an instance has any.
    reach: Vec<Box<[f32]>>,
    /// They have not been looked for.
    unknown: bool,
    /// A sheet of thin glass may lie on an opaque surface.
    pub sheets: bool,
    /// Instances with walls that are thinner than positions are exact there, and how exact those are (metres).
    pub thin: Vec<(u32, f32)>,
}

/// What the triangles that light passes tell of a triangle that may lie on some of them.
#[derive(Clone, Copy, Default)]
struct Touched {
    instance: u32,
    primitive: u32,
    /// Largest distance of two surfaces in contact there.
    reach: f32,
    /// Thickness below which it is one with another of the same mesh, if it is.
    thin: f32,
    /// One of the two is thin glass, the other opaque.
    sheet: bool,
}

impl Contacts {
    /// Looks through a scene.
    pub fn new(shapes: &Shapes, materials: &Materials) -> Contacts {
        let passes = |instance: u32| materials.list[shapes.instances[instance as usize].material as usize].transmits();
        let instances = 0..shapes.instances.len() as u32;
        let passing: Vec<u32> = instances.clone().filter(|&instance| passes(instance)).collect();
        if passing.is_empty() {
            return Contacts::default();
        }
        let triangles =
            |instance: u32| shapes.meshes[shapes.instances[instance as usize].mesh as usize].triangles.len();
        let passed: usize = passing.iter().map(|&instance| triangles(instance)).sum();
        if shapes.triangles() > MOST || passed > MOST_PASSED {
            return Contacts { unknown: true, ..Contacts::default() };
        }
        let triangle = |instance: u32, primitive: u32| {
            let placed = &shapes.instances[instance as usize];
            Triangle::new(placed.corners(&shapes.meshes[placed.mesh as usize], primitive), instance, primitive)
        };
        let of = |instance: u32| {
            let mesh = &shapes.meshes[shapes.instances[instance as usize].mesh as usize];
            (0..mesh.triangles.len() as u32).filter_map(move |primitive| triangle(instance, primitive))
        };
        let tree = RTree::bulk_load(passing.iter().flat_map(|&instance| of(instance)).collect());
        let is_thin = |instance: u32| materials.list[shapes.instances[instance as usize].material as usize].thin;
        let touched_by = |instance: u32| -> Vec<Touched> {
            let opaque = !passes(instance);
            let met = |other: Triangle| {
                let near = tree.locate_in_envelope_intersecting(other.envelope());
                let pairs = near.filter(|triangle| triangle.may_touch(&other)).map(|triangle| {
                    let reach = triangle.reach(&other);
                    let thin = if triangle.is_one_with(&other) { reach } else { 0.0 };
                    let Triangle { instance, primitive, .. } = *triangle;
                    Touched { instance, primitive, reach, thin, sheet: opaque && is_thin(instance) }
                });
                let mut touched: Vec<Touched> = pairs.collect();
                if opaque && !touched.is_empty() {
                    let reach = touched.iter().map(|touched| touched.reach).fold(0.0, f32::max);
                    let Triangle { instance, primitive, .. } = other;
                    touched.push(Touched { instance, primitive, reach, ..Touched::default() });
                }
                touched
            };
            of(instance).flat_map(met).collect()
        };
        let found: Vec<Touched> = instances.into_par_iter().flat_map_iter(touched_by).collect();
        Contacts::from_pairs(shapes, &found)
    }

    fn from_pairs(shapes: &Shapes, found: &[Touched]) -> Contacts {
        let mut all: Vec<Box<[f32]>> = vec![Box::default(); shapes.instances.len()];
        let mut walls: BTreeMap<u32, f32> = BTreeMap::new();
        for &Touched { instance, primitive, reach, thin, .. } in found {
            if thin > 0.0 {
                let most = walls.entry(instance).or_default();
                *most = most.max(thin);
            }
            let of_instance = &mut all[instance as usize];
            if of_instance.is_empty() {
                let mesh = &shapes.meshes[shapes.instances[instance as usize].mesh as usize];
                *of_instance = vec![0.0; mesh.triangles.len()].into();
            }
            let most = &mut of_instance[primitive as usize];
            *most = most.max(reach);
        }
        if all.iter().all(|of_instance| of_instance.is_empty()) {
            all.clear();
        }
        let sheets = found.iter().any(|touched| touched.sheet);
        Contacts { reach: all, unknown: false, sheets, thin: walls.into_iter().collect() }
    }

    /// No triangle is known to lie on another.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.reach.is_empty()
    }

    /// How far apart (metres) surfaces may be that lie on a triangle, whose own positions may be off by `error`; `None`
    /// where none does.
    #[inline(always)]
    pub fn reach(&self, instance: u32, primitive: u32, error: f32) -> Option<f32> {
        if self.reach.is_empty() {
            return self.unknown.then_some(2.0 * error);
        }
        let reach = self.reach[instance as usize].get(primitive as usize).copied()?;
        (reach > 0.0).then_some(reach)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(corners: [[f32; 3]; 3], instance: u32) -> Triangle {
        let triangle = Triangle::new(corners.map(Vec3::from_array), instance, 0).expect("an area");
        Triangle { error: 1e-6, ..triangle }
    }

    /// What lies on a triangle touches it, from either side; what stands above it, crosses it or goes on from it does
    /// not.
    #[test]
    fn what_lies_on_a_triangle_touches_it() {
        let flat = triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], 0);
        let at = |z: f32, instance: u32| triangle([[0.2, 0.2, z], [0.9, 0.1, z], [0.1, 0.9, z]], instance);
        let turned = |z: f32, instance: u32| triangle([[0.2, 0.2, z], [0.1, 0.9, z], [0.9, 0.1, z]], instance);
        for z in [0.0, 1e-6, -1e-6] {
            assert!(flat.may_touch(&at(z, 1)) && flat.may_touch(&turned(z, 1)) && flat.may_touch(&turned(z, 0)));
            assert!(!flat.may_touch(&at(z, 0)));
        }
        assert!(!flat.may_touch(&at(1e-4, 1)) && !flat.may_touch(&turned(-1e-4, 0)));
        assert!(!flat.may_touch(&triangle([[0.2, 0.2, -1.0], [0.9, 0.1, 0.5], [0.1, 0.9, 1.0]], 1)));
    }
}
