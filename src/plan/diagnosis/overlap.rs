//! Solids that overlap and have the same priority.

use super::rays;
use crate::geometry::{Instance, Mesh};
use crate::math::Vec3;
use crate::scene::Scene;
use crate::scene::contact::RaySurfaces;
use crate::trace::Ray;

/// Solids that are looked at, and triangles of each whose edges are followed.
const SOLIDS: usize = 64;
const TRIANGLES: usize = 256;
/// Surfaces that an edge may cross.
const MOST_CROSSED: usize = 16;
/// Parts of an edge at its ends in which it may touch another surface, and the cosine to a surface that it may lie in.
const TOUCHES: f32 = 1e-3;

/// Pairs of solids of different materials where an edge of one goes through the surface of the other.
pub(super) fn unordered(scene: &Scene) -> Vec<String> {
    let materials = &scene.materials.list;
    let solid = |instance: &&Instance| materials[instance.material as usize].is_solid_glass();
    let solids: Vec<&Instance> = scene.shapes.instances.iter().filter(solid).take(SOLIDS).collect();
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    for instance in &solids {
        for crossed in crossed(scene, instance) {
            let other = &scene.shapes.instances[crossed as usize];
            let [own, its] = [instance, other].map(|i| materials[i.material as usize].priority);
            let pair = (instance.object.min(other.object), instance.object.max(other.object));
            if pair.0 != pair.1 && instance.material != other.material && own == its && !pairs.contains(&pair) {
                pairs.push(pair);
            }
        }
    }
    let name = |object: u32| &scene.objects[object as usize];
    let tell = |(a, b): (u32, u32)| {
        format!(
            "objects \"{}\" and \"{}\" overlap, and their materials have the same priority: where they do, the smaller one is taken to fill the space; give one of them the higher priority (extras.caustique.priority)",
            name(a),
            name(b)
        )
    };
    pairs.into_iter().map(tell).collect()
}

/// Instances of solids through whose surface edges of one go.
fn crossed(scene: &Scene, instance: &Instance) -> Vec<u32> {
    let mesh: &Mesh = &scene.shapes.meshes[instance.mesh as usize];
    let mut crossed = Vec::new();
    for at in rays::spread(mesh.triangles.len(), TRIANGLES) {
        let [a, b, c] = instance.corners(mesh, at as u32);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            follow(scene, instance.object, from, to, &mut crossed);
        }
    }
    crossed
}

/// Follows an edge of an object.
fn follow(scene: &Scene, object: u32, from: Vec3, to: Vec3, crossed: &mut Vec<u32>) {
    let length = from.distance(to);
    let Some(direction) = (to - from).try_normalize() else { return };
    let mut along = RaySurfaces::new(Ray { origin: from, direction, tmax: length, token: 0 }, None);
    for _ in 0..MOST_CROSSED {
        let Some((surface, _)) = along.next(scene, false) else { return };
        let share = surface.p.distance(from) / length;
        let across = direction.dot(surface.ng).abs() > TOUCHES && share > TOUCHES && share < 1.0 - TOUCHES;
        let solid = scene.materials.list[surface.material as usize].is_solid_glass();
        let other = scene.shapes.instances[surface.instance as usize].object != object;
        if across && solid && other && !crossed.contains(&surface.instance) {
            crossed.push(surface.instance);
        }
        along.pass(&surface);
    }
}
