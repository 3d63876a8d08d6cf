//! Finds triangles that may touch transmitting triangles. Only there do rays query touching surfaces
//! (`scene/contact.rs`).

use crate::geometry::{Extent, Shapes, coordinate_error};
use crate::material::Objects;
use crate::math::Vec3;
use rayon::prelude::*;
use rstar::{AABB, RTree, RTreeObject};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Minimum cosine of the angle between surfaces that count as touching. Surfaces that cross at larger angles share a
/// line, which rays hit with probability zero.
const MIN_PARALLEL_COSINE: f32 = 0.99;

/// Maximum number of triangles of a scene, instances included, that are searched for contacts. In a larger scene, every
/// hit queries touching surfaces.
const MAX_TRIANGLES: usize = 1 << 26;
/// Maximum number of transmitting triangles that are searched. A tree over more of them takes as long and as much
/// memory as the scene itself (20,000 instances of a glass ball: minutes and gigabytes); queries at every hit take a
/// tenth of the render time.
const MAX_TRANSMITTING: usize = 1 << 21;

/// Maximum number of pairs of instances, one of them moving, whose bounding boxes are compared at a moment. With more of
/// them, every hit queries touching surfaces.
const MAX_BOX_PAIRS: usize = 1 << 22;
/// Distance of bounding boxes that may touch, over the largest coordinate: a multiple of the rounding errors of positions.
const TOUCHING_SHARE: f32 = 64.0 * f32::EPSILON;

/// Whether two triangles of one mesh at the same point are opposite walls that touch. Otherwise they are neighbours on
/// one surface.
pub(super) fn face_each_other(a: Vec3, b: Vec3) -> bool {
    a.dot(b) < -MIN_PARALLEL_COSINE
}

/// A triangle in world space.
#[derive(Clone, Copy)]
struct Triangle {
    corners: [Vec3; 3],
    normal: Vec3,
    /// Bound on the distance of rounded positions on the triangle from its plane (m).
    error: f32,
    /// Largest absolute coordinate of the corners (m).
    largest: f32,
    instance: u32,
    primitive: u32,
}

impl Triangle {
    fn new(corners: [Vec3; 3], instance: u32, primitive: u32) -> Option<Triangle> {
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a).try_normalize()?;
        let extent = Extent::from_corners(corners);
        let (error, largest) = (extent.plane_error(), extent.largest.max_element());
        Some(Triangle { corners, normal, error, largest, instance, primitive })
    }

    /// Maximum distance (m) between two triangles that count as touching, at points in both.
    fn reach(&self, other: &Triangle) -> f32 {
        let nearest = self.largest.min(other.largest);
        self.error + other.error + 2.0 * coordinate_error(Vec3::splat(nearest))
    }

    /// Whether another triangle may touch this one: it is nearly parallel and reaches the plane of this one.
    fn may_touch(&self, other: &Triangle) -> bool {
        let parallel = match self.instance == other.instance {
            true => face_each_other(self.normal, other.normal),
            false => self.normal.dot(other.normal).abs() > MIN_PARALLEL_COSINE,
        };
        let heights = other.corners.map(|corner| (corner - self.corners[0]).dot(self.normal));
        let reach = 2.0 * self.reach(other);
        parallel && heights.iter().any(|height| *height >= -reach) && heights.iter().any(|height| *height <= reach)
    }

    /// Whether all of another triangle of the same mesh touches this one: the sides of a pane that is thinner than the
    /// rounding error of positions.
    fn is_opposite_wall(&self, other: &Triangle) -> bool {
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

/// The triangles of a scene that other triangles may touch, if at least one of the two transmits light.
#[derive(Clone, Debug, Default)]
pub struct Contacts {
    /// For each instance and triangle, the maximum distance of touching surfaces (metres), or 0 without contact. Empty
    /// for an instance without contacts.
    reach: Arc<[Box<[f32]>]>,
    /// For each instance, whether all its hits query touching surfaces, because it or its neighbour has moved since the
    /// search; empty if none has.
    queried: Box<[bool]>,
    /// Whether contacts were not searched, because the scene is large, so that every hit queries touching surfaces.
    unknown: bool,
    /// Whether any sheet of thin glass may touch an opaque surface.
    pub sheets: bool,
    /// Index of each instance with walls thinner than the rounding error of positions, and this error (metres).
    pub thin: Vec<(u32, f32)>,
}

/// A triangle that another triangle may touch, and how near the other one is.
#[derive(Clone, Copy, Default)]
struct Contact {
    instance: u32,
    primitive: u32,
    /// Maximum distance of the surfaces that touch the triangle (metres).
    reach: f32,
    /// Equal to `reach` if the other triangle is the opposite wall of the same mesh; otherwise 0.
    thin: f32,
    /// Whether one of the two triangles is thin glass and the other opaque.
    sheet: bool,
}

impl Contacts {
    /// Finds the contacts of a scene.
    pub fn new(Objects { shapes, materials }: Objects<'_>) -> Contacts {
        let transmits =
            |instance: u32| materials.list[shapes.instances[instance as usize].material as usize].transmits();
        let instances = 0..shapes.instances.len() as u32;
        let transmitting: Vec<u32> = instances.clone().filter(|&instance| transmits(instance)).collect();
        if transmitting.is_empty() {
            return Contacts::default();
        }
        let triangles =
            |instance: u32| shapes.meshes[shapes.instances[instance as usize].mesh as usize].triangles.len();
        let count: usize = transmitting.iter().map(|&instance| triangles(instance)).sum();
        if shapes.triangles() > MAX_TRIANGLES || count > MAX_TRANSMITTING {
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
        let tree = RTree::bulk_load(transmitting.iter().flat_map(|&instance| of(instance)).collect());
        let is_thin = |instance: u32| materials.list[shapes.instances[instance as usize].material as usize].thin;
        let contacts_of_instance = |instance: u32| -> Vec<Contact> {
            let opaque = !transmits(instance);
            let contacts_with = |other: Triangle| {
                let near = tree.locate_in_envelope_intersecting(other.envelope());
                let pairs = near.filter(|triangle| triangle.may_touch(&other)).map(|triangle| {
                    let reach = triangle.reach(&other);
                    let thin = if triangle.is_opposite_wall(&other) { reach } else { 0.0 };
                    let Triangle { instance, primitive, .. } = *triangle;
                    Contact { instance, primitive, reach, thin, sheet: opaque && is_thin(instance) }
                });
                let mut contacts: Vec<Contact> = pairs.collect();
                if opaque && !contacts.is_empty() {
                    let reach = contacts.iter().map(|contact| contact.reach).fold(0.0, f32::max);
                    let Triangle { instance, primitive, .. } = other;
                    contacts.push(Contact { instance, primitive, reach, ..Contact::default() });
                }
                contacts
            };
            of(instance).flat_map(contacts_with).collect()
        };
        let found: Vec<Contact> = instances.into_par_iter().flat_map_iter(contacts_of_instance).collect();
        Contacts::collect(shapes, &found)
    }

    fn collect(shapes: &Shapes, found: &[Contact]) -> Contacts {
        let mut all: Vec<Box<[f32]>> = vec![Box::default(); shapes.instances.len()];
        let mut walls: BTreeMap<u32, f32> = BTreeMap::new();
        for &Contact { instance, primitive, reach, thin, .. } in found {
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
        let sheets = found.iter().any(|contact| contact.sheet);
        Contacts { reach: all.into(), sheets, thin: walls.into_iter().collect(), ..Contacts::default() }
    }

    /// The contacts at another moment of a moving scene. Touching surfaces are queried at every hit of an instance that
    /// moves or may touch one that does, if either transmits light. `boxes`: bounding box of each instance.
    pub fn at_moment(&self, Objects { shapes, materials }: Objects<'_>, boxes: &[(Vec3, Vec3)]) -> Contacts {
        let material = |i: usize| &materials.list[shapes.instances[i].material as usize];
        let transmits: Vec<bool> = (0..boxes.len()).map(|i| material(i).transmits()).collect();
        let moving: Vec<usize> = (0..boxes.len()).filter(|&i| shapes.instances[i].moves).collect();
        if self.unknown || moving.is_empty() || !transmits.contains(&true) {
            return self.clone();
        }
        let is_sheet = |i: usize| transmits[i] && material(i).thin;
        if moving.len().saturating_mul(boxes.len()) > MAX_BOX_PAIRS {
            let sheets = (0..boxes.len()).any(is_sheet);
            return Contacts { unknown: true, sheets, ..Contacts::default() };
        }
        let touch = |(low, high): (Vec3, Vec3), (other_low, other_high): (Vec3, Vec3)| {
            let largest = low.abs().max(high.abs()).max_element();
            let reach = Vec3::splat(TOUCHING_SHARE * largest);
            (low - reach).cmple(other_high).all() && (other_low - reach).cmple(high).all()
        };
        let mut queried = vec![false; boxes.len()];
        let mut sheets = self.sheets;
        for &i in &moving {
            queried[i] |= self.reach.get(i).is_some_and(|reach| !reach.is_empty());
            let near = |j: &usize| *j != i && (transmits[i] || transmits[*j]) && touch(boxes[i], boxes[*j]);
            for j in (0..boxes.len()).filter(near) {
                (queried[i], queried[j]) = (true, true);
                sheets |= is_sheet(i) != is_sheet(j) && (!transmits[i] || !transmits[j]);
            }
        }
        if !queried.contains(&true) {
            return self.clone();
        }
        let none = || vec![Box::default(); boxes.len()].into();
        let reach = if self.reach.is_empty() { none() } else { Arc::clone(&self.reach) };
        Contacts { reach, queried: queried.into(), sheets, ..Contacts::default() }
    }

    /// Whether the search has found no contact, so that no hit needs to query touching surfaces.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.reach.is_empty()
    }

    /// Maximum distance (metres) of surfaces that touch a triangle; `None` if there are none. `error` is the rounding
    /// error of positions on the triangle.
    #[inline(always)]
    pub fn reach(&self, instance: u32, primitive: u32, error: f32) -> Option<f32> {
        if self.reach.is_empty() {
            return self.unknown.then_some(2.0 * error);
        }
        let reach = self.reach[instance as usize].get(primitive as usize).copied().unwrap_or(0.0);
        if self.queried.get(instance as usize) == Some(&true) {
            return Some(reach.max(2.0 * error));
        }
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

    /// A triangle on either side of another one touches it. Triangles above it, across it or next to it in the same
    /// surface do not.
    #[test]
    fn only_parallel_triangles_in_the_same_plane_touch() {
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
