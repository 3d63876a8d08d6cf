//! Which triangles that light passes may have others lying on them: only there does a ray look for more than what it
//! hits (`scene/contact.rs`).

use crate::geometry::{Shapes, error};
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
    /// How far its positions may be off.
    error: f32,
    instance: u32,
    primitive: u32,
}

impl Triangle {
    /// Whether another may lie on it: it is as good as parallel and reaches its plane.
    fn may_touch(&self, other: &Triangle) -> bool {
        let parallel = match self.instance == other.instance {
            true => face_each_other(self.normal, other.normal),
            false => self.normal.dot(other.normal).abs() > PARALLEL,
        };
        let heights = other.corners.map(|corner| (corner - self.corners[0]).dot(self.normal));
        let reach = 2.0 * (self.error + other.error);
        parallel && heights.iter().any(|height| *height >= -reach) && heights.iter().any(|height| *height <= reach)
    }
}

impl Triangle {
    /// Whether another of the same mesh lies on it, all of it, facing it: two sides of a pane that positions cannot
    /// tell apart.
    fn is_one_with(&self, other: &Triangle) -> bool {
        let reach = self.error + other.error;
        let within = |corner: Vec3| (corner - self.corners[0]).dot(self.normal).abs() <= reach;
        self.instance == other.instance && other.corners.into_iter().all(within)
    }
}

impl RTreeObject for Triangle {
    type Envelope = AABB<[f32; 3]>;

    fn envelope(&self) -> AABB<[f32; 3]> {
        let [a, b, c] = self.corners;
        let (low, high) = (a.min(b).min(c) - self.error, a.max(b).max(c) + self.error);
        AABB::from_corners(low.to_array(), high.to_array())
    }
}

/// Triangles that light passes and others may lie on.
#[derive(Clone, Debug, Default)]
pub struct Contacts {
    /// By instance, then by triangle; empty where none of an instance has any.
    touched: Vec<Box<[bool]>>,
    /// They have not been looked for.
    unknown: bool,
    /// Instances with walls that are thinner than positions are exact there, and how exact those are (metres).
    pub thin: Vec<(u32, f32)>,
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
            let corners = placed.corners(&shapes.meshes[placed.mesh as usize], primitive);
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a).try_normalize()?;
            Some(Triangle { corners, normal, error: error(corners), instance, primitive })
        };
        let of = |instance: u32| {
            let mesh = &shapes.meshes[shapes.instances[instance as usize].mesh as usize];
            (0..mesh.triangles.len() as u32).filter_map(move |primitive| triangle(instance, primitive))
        };
        let tree = RTree::bulk_load(passing.iter().flat_map(|&instance| of(instance)).collect());
        let touched_by = |instance: u32| -> Vec<(u32, u32, f32)> {
            let met = |other: Triangle| {
                let near = tree.locate_in_envelope_intersecting(other.envelope());
                let touched = near.filter(move |triangle| triangle.may_touch(&other));
                let found = |triangle: &Triangle| {
                    let thin = if triangle.is_one_with(&other) { triangle.error + other.error } else { 0.0 };
                    (triangle.instance, triangle.primitive, thin)
                };
                touched.map(found).collect::<Vec<_>>()
            };
            of(instance).flat_map(met).collect()
        };
        let mut touched: Vec<Box<[bool]>> = vec![Box::default(); shapes.instances.len()];
        let found: Vec<(u32, u32, f32)> = instances.into_par_iter().flat_map_iter(touched_by).collect();
        let mut thin: BTreeMap<u32, f32> = BTreeMap::new();
        for (instance, primitive, within) in found {
            if within > 0.0 {
                let most = thin.entry(instance).or_default();
                *most = most.max(within);
            }
            let flags = &mut touched[instance as usize];
            if flags.is_empty() {
                let mesh = &shapes.meshes[shapes.instances[instance as usize].mesh as usize];
                *flags = vec![false; mesh.triangles.len()].into();
            }
            flags[primitive as usize] = true;
        }
        if touched.iter().all(|flags| flags.is_empty()) {
            touched.clear();
        }
        Contacts { touched, unknown: false, thin: thin.into_iter().collect() }
    }

    /// Whether others may lie on a triangle that light passes.
    #[inline(always)]
    pub fn may_touch(&self, instance: u32, primitive: u32) -> bool {
        if self.touched.is_empty() {
            return self.unknown;
        }
        let flags = &self.touched[instance as usize];
        flags.get(primitive as usize).copied().unwrap_or(false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(corners: [[f32; 3]; 3], instance: u32) -> Triangle {
        let corners = corners.map(Vec3::from_array);
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        Triangle { corners, normal, error: 1e-6, instance, primitive: 0 }
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
