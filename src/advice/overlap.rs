//! Warns about overlapping solids of equal priority.

use super::rays;
use crate::geometry::{Instance, Mesh};
use crate::math::Vec3;
use crate::scene::Scene;
use crate::scene::contact::RaySurfaces;
use crate::trace::Ray;

/// Maximum number of solids that are checked.
const MAX_SOLIDS: usize = 64;
/// Maximum number of triangles of a solid whose edges are traced.
const MAX_TRIANGLES: usize = 256;
/// Maximum number of surfaces that a test ray along an edge crosses.
const MAX_SURFACES: usize = 16;
/// An edge touches a surface, instead of crossing it, at a smaller cosine, or within this share of its length from an
/// end.
const TOUCH_TOLERANCE: f32 = 1e-3;

/// Warnings about pairs of solids of different materials and equal priority, if an edge of one crosses the surface of
/// the other.
pub(super) fn overlapping_solids(scene: &Scene) -> Vec<String> {
    let materials = &scene.materials.list;
    let solid = |instance: &&Instance| materials[instance.material as usize].is_solid();
    let solids: Vec<&Instance> = scene.shapes.instances.iter().filter(solid).take(MAX_SOLIDS).collect();
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    for instance in &solids {
        for crossed in crossed_solids(scene, instance) {
            let other = &scene.shapes.instances[crossed as usize];
            let [own, its] = [instance, other].map(|i| materials[i.material as usize].priority);
            let pair = (instance.object.min(other.object), instance.object.max(other.object));
            // Media without a surface of their own, such as smoke, are not meant to exclude others.
            let refract = [instance, other].iter().all(|i| materials[i.material as usize].ior != 1.0);
            let differ = pair.0 != pair.1 && instance.material != other.material;
            if differ && own == its && refract && !pairs.contains(&pair) {
                pairs.push(pair);
            }
        }
    }
    let name = |object: u32| &scene.objects[object as usize];
    let place = match scene.contents.is_by_blender {
        true => "Priority in the panel Glass and Water, or the material's custom property \"priority\"",
        false => "extras.caustique.priority",
    };
    let warning = |(a, b): (u32, u32)| {
        format!(
            "objects \"{}\" and \"{}\" overlap, and their materials have the same priority: where they do, the smaller one is taken to fill the space; give one of them the higher priority ({place})",
            name(a),
            name(b)
        )
    };
    pairs.into_iter().map(warning).collect()
}

/// Indices of the instances of solids whose surface an edge of `instance` crosses.
fn crossed_solids(scene: &Scene, instance: &Instance) -> Vec<u32> {
    let mesh: &Mesh = &scene.shapes.meshes[instance.mesh as usize];
    let mut crossed = Vec::new();
    for at in rays::spread_indices(mesh.triangles.len(), MAX_TRIANGLES) {
        let [a, b, c] = instance.corners(mesh, at as u32);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            trace_edge(scene, instance.object, from, to, &mut crossed);
        }
    }
    crossed
}

/// Traces a ray along an edge of an object, and adds the instances of the solids whose surface it crosses to `crossed`.
fn trace_edge(scene: &Scene, object: u32, from: Vec3, to: Vec3, crossed: &mut Vec<u32>) {
    let length = from.distance(to);
    let Some(direction) = (to - from).try_normalize() else { return };
    let mut along = RaySurfaces::new(Ray { origin: from, direction, tmax: length, token: 0 }, None);
    for _ in 0..MAX_SURFACES {
        let Some((surface, _)) = along.next(scene, false) else { return };
        let share = surface.p.distance(from) / length;
        let across = direction.dot(surface.ng).abs() > TOUCH_TOLERANCE
            && share > TOUCH_TOLERANCE
            && share < 1.0 - TOUCH_TOLERANCE;
        let solid = scene.materials.list[surface.material as usize].is_solid();
        let other = scene.shapes.instances[surface.instance as usize].object != object;
        if across && solid && other && !crossed.contains(&surface.instance) {
            crossed.push(surface.instance);
        }
        along.pass(&surface);
    }
}
