//! Bugs that a renderer could have, planted into one side of a comparison.

use super::forms::{Form, Known};
use super::relation::{Other, Relation, lifted, switch_off};
use super::world::{Medium, Mesh, Thing, ThingKind, World};
use caustique::camera::Filter;
use glam::DVec3;

/// A planted bug in one of the two sides of a relation.
pub struct Plant {
    pub name: &'static str,
    pub relation: Relation,
    /// Seed of a scene in which the bug is visible.
    pub seed: u64,
    /// Plants the bug in the scene or in its counterpart; false if the scene does not allow it.
    pub spoil: fn(&mut World, &mut Other) -> bool,
}

/// Lights shade themselves, as they did when shadow rays ended inside of them.
fn lights_hide_themselves(world: &World) -> World {
    let mut made = world.clone();
    made.sky = made.sky.map(|sky| 0.7 * sky);
    for index in world.lights() {
        match &mut made.things[index].kind {
            ThingKind::Light(light) => light.color *= 0.7,
            ThingKind::Mesh { mesh, .. } => {
                let whole = &world.meshes[*mesh];
                let part = if whole.triangles.len() < 3 { small(whole) } else { whole.part(|i| i % 3 != 0) };
                made.meshes.push(part);
                *mesh = made.meshes.len() - 1;
            }
            ThingKind::Camera(_) => {}
        }
    }
    made
}

/// A flat mesh with two thirds of the area.
fn small(mesh: &Mesh) -> Mesh {
    Mesh { positions: mesh.positions.iter().map(|p| 0.8 * *p).collect(), ..mesh.clone() }
}

fn hide(_: &mut World, other: &mut Other) -> bool {
    other.worlds.iter_mut().for_each(|world| *world = lights_hide_themselves(world));
    true
}

/// Glass that stands on something is glued to it: the floor is met inside the glass.
fn glue(world: &mut World, _: &mut Other) -> bool {
    let is_glass = |thing: &Thing| thing.rests && world.matter(thing).is_some_and(|m| m.is_glass() && m.ior > 1.3);
    // Large enough to be seen.
    let seen = world.things.iter().any(|thing| is_glass(thing) && world.radius(thing) > 0.15 * world.size);
    let sunk = lifted(world, -1e-3).filter(|_| seen);
    sunk.map(|sunk| *world = sunk).is_some()
}

fn lose_a_light(_: &mut World, other: &mut Other) -> bool {
    other.worlds.pop().is_some()
}

fn lose_a_thing(world: &mut World, other: &mut Other) -> bool {
    let size = |index: &usize| world.radius(&world.things[*index]);
    let largest = (0..world.things.len()).max_by(|a, b| size(a).total_cmp(&size(b)));
    largest.map(|largest| other.worlds[0].things.remove(largest)).is_some()
}

fn forget_a_mirror(_: &mut World, other: &mut Other) -> bool {
    other.worlds[0].things.iter_mut().filter(|thing| thing.mesh().is_some()).for_each(|thing| {
        thing.chain.pop();
    });
    true
}

fn forget_channels(_: &mut World, other: &mut Other) -> bool {
    other.channels = [0, 1, 2];
    true
}

fn double_less(_: &mut World, other: &mut Other) -> bool {
    other.factor = 2.2;
    true
}

fn brighten(world: &mut World, other: &mut Other) -> bool {
    *world = super::usd::reduced(world);
    other.worlds[0] = super::relation::brighter(world, DVec3::splat(1.1));
    world.sky.is_none()
}

fn widen(_: &mut World, other: &mut Other) -> bool {
    for thing in &mut other.worlds[0].things {
        if let ThingKind::Camera(lens) = &mut thing.kind {
            lens.view *= 1.2;
        }
    }
    true
}

fn forget_the_filter(world: &mut World, other: &mut Other) -> bool {
    other.worlds[0].filter = Filter::default();
    world.filter != Filter::default()
}

fn keep_the_camera(world: &mut World, other: &mut Other) -> bool {
    other.worlds[0] = world.clone();
    true
}

fn keep_intensity(world: &mut World, other: &mut Other) -> bool {
    let mut any = false;
    for (thing, before) in other.worlds[0].things.iter_mut().zip(&world.things) {
        if let (ThingKind::Light(light), ThingKind::Light(before)) = (&mut thing.kind, before.kind) {
            any |= light.color != before.color;
            light.color = before.color;
        }
    }
    any
}

fn turn_lights_off(world: &mut World, other: &mut Other) -> bool {
    let first = world.lights().first().copied();
    first.map(|first| switch_off(&mut other.worlds[0], first)).is_some()
}

/// Solids that are added around the camera absorb, and cameras see them.
fn fill_voids(_: &mut World, other: &mut Other) -> bool {
    let medium =
        Some(Medium { sigma_a: DVec3::splat(10.0), sigma_s: DVec3::ZERO, g: 0.0 }.scaled(other.worlds[0].size));
    let world = &mut other.worlds[0];
    let voids = world.things.iter_mut().filter(|thing| thing.hidden);
    let mut any = false;
    for thing in voids.filter(|thing| thing.name.starts_with("void")) {
        thing.hidden = false;
        let Some((_, material)) = thing.mesh() else { continue };
        world.materials[material].medium = medium;
        any = true;
    }
    any
}

/// Every relation with a fault that breaks it.
pub fn plants() -> Vec<Plant> {
    let plant = |name, relation, seed, spoil| Plant { name, relation, seed, spoil };
    let hiding = |relation| plant("lights hide themselves", relation, 0, hide);
    vec![
        hiding(Relation::Moved),
        hiding(Relation::Turned),
        hiding(Relation::Subdivided),
        hiding(Relation::FarThing),
        hiding(Relation::Method(caustique::render::Method::Bdpt)),
        plant("lamps do not grow with the scene", Relation::Scaled, 2, keep_intensity),
        plant("the largest copy is lost", Relation::Copied, 0, lose_a_thing),
        plant("the first light is lost", Relation::Reordered, 1, turn_lights_off),
        plant("lights hide each other", Relation::LightsSplit, 0, hide),
        plant("a light is lost", Relation::SumOfLights, 4, lose_a_light),
        plant("light does not double", Relation::Doubled, 0, double_less),
        plant("channels stay", Relation::Permuted, 0, forget_channels),
        plant("glass is glued to the floor", Relation::Lifted, 79, glue),
        plant("the frame is shown", Relation::Later, 0, turn_lights_off),
        plant("solids around the camera are seen", Relation::Void, 0, fill_voids),
        plant("the window shows more", Relation::Cropped, 0, widen),
        plant("the window has no filter", Relation::Cropped, 7047, forget_the_filter),
        plant("the camera stays", Relation::Panned, 7032, keep_the_camera),
        plant("lamps are a tenth too bright", Relation::Usd, 0, brighten),
        plant("a mirror is forgotten", Relation::MirroredTwice, 0, forget_a_mirror),
    ]
}

/// Plants a bug in a scene with a known picture.
pub fn spoil(form: Form, known: &mut Known) {
    match form {
        Form::Glowing | Form::Punctual | Form::Bounce => known.world = lights_hide_themselves(&known.world),
        Form::Absorbing | Form::Pane | Form::Overlap => {
            for medium in known.world.materials.iter_mut().filter_map(|matter| matter.medium.as_mut()) {
                medium.sigma_a *= 0.7;
            }
        }
        Form::Furnace | Form::Hidden => {
            for matter in &mut known.world.materials {
                matter.base = DVec3::splat(0.7);
            }
        }
    }
}
