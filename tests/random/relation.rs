//! Relations that must hold for any scene, and planted bugs that must violate them.

use super::picture::{
    Difference, Found, MEANS, SIGNIFICANCE, Set, Shot, TILES, TOLERANCE, confirmed, differences, pictures,
};
use super::random::Random;
use super::shapes::cuboid;
use super::world::{Later, Lens, Light, LightKind, Matter, Mesh, Panorama, Placement, ThingKind, World};
use caustique::render::Method;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A relation between the picture of a scene and the picture of a changed scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Relation {
    /// The whole scene is moved.
    Moved,
    /// The whole scene is rotated.
    Turned,
    /// The whole scene is scaled.
    Scaled,
    /// Every triangle is split into four.
    Subdivided,
    /// Every instance becomes its own mesh in world space, without parent nodes.
    Copied,
    /// Triangles, nodes and lights have another order.
    Reordered,
    /// Every light is split into two.
    LightsSplit,
    /// The sum of pictures with one light each. Lamps that are off stay as black objects.
    SumOfLights,
    /// All light is doubled.
    Doubled,
    /// Colour channels are exchanged.
    Permuted,
    /// Things that stand on something opaque are lifted by 10^-4 of their size.
    Lifted,
    /// A crop window of the picture.
    Cropped,
    /// The camera of a panorama of all directions is turned by a tile about its vertical axis.
    Panned,
    /// Every mesh is mirrored in the file and mirrored back by its node.
    MirroredTwice,
    /// A small black object is added far away.
    FarThing,
    /// The scene appears after its frame, and the shutter is open then, for no time or for some.
    Later,
    /// Hidden solids without any content are added, around the camera and around a thing.
    Void,
    /// The scene is read as a USD stage, reduced to what USD can express ([`super::usd::reduced`]).
    Usd,
    /// Another method renders the scene.
    Method(Method),
}

/// Relations between pictures of one method.
pub const RELATIONS: [Relation; 16] = [
    Relation::Moved,
    Relation::Turned,
    Relation::Scaled,
    Relation::Subdivided,
    Relation::Copied,
    Relation::Reordered,
    Relation::LightsSplit,
    Relation::SumOfLights,
    Relation::Doubled,
    Relation::Permuted,
    Relation::Lifted,
    Relation::Cropped,
    Relation::MirroredTwice,
    Relation::FarThing,
    Relation::Later,
    Relation::Void,
];

/// The counterpart of a scene in a relation.
pub struct Other {
    /// Scenes whose pictures are added.
    pub worlds: Vec<World>,
    pub shot: Shot,
    /// Divisor of the pictures.
    pub factor: f64,
    /// The channel of these pictures that is compared with each channel of the scene's pictures.
    pub channels: [usize; 3],
    /// Number of tiles by which these pictures are shifted to the right, around the picture.
    pub roll: usize,
    pub tolerance: f64,
}

impl Relation {
    /// The counterpart of the scene; `None` if the relation does not apply to it.
    pub fn other(self, world: &World, shot: &Shot) -> Option<Other> {
        let mut random = Random::new(world.seed ^ 0x5eed);
        let identity = [0, 1, 2];
        let one = |made: World| Other {
            worlds: vec![made],
            shot: shot.clone(),
            factor: 1.0,
            channels: identity,
            roll: 0,
            tolerance: TOLERANCE,
        };
        Some(match self {
            Relation::Moved => one(similar(world, 1.0, DQuat::IDENTITY, random.vector(-3.0, 3.0) * world.size)),
            Relation::Turned => one(similar(world, 1.0, random.turn(), DVec3::ZERO)),
            Relation::Scaled => one(similar(world, random.scale(1e-2, 1e2), DQuat::IDENTITY, DVec3::ZERO)),
            Relation::Subdivided => one(subdivided(world)),
            Relation::Copied => one(copied(world)),
            Relation::Reordered => one(reordered(world, &mut random)),
            Relation::LightsSplit => one(split(world)?),
            Relation::SumOfLights => {
                let worlds = single_lights(world);
                if worlds.len() < 2 {
                    return None;
                }
                Other { worlds, ..one(world.clone()) }
            }
            Relation::Doubled => Other { factor: 2.0, ..one(brighter(world, DVec3::splat(2.0))) },
            Relation::Permuted => Other { channels: [2, 0, 1], ..one(permuted(world)) },
            Relation::Lifted => one(lifted(world, 1e-4)?),
            Relation::Cropped => {
                Other { shot: Shot { window: Some([1, 1, 2, 3]), ..shot.clone() }, ..one(world.clone()) }
            }
            Relation::Panned => Other { roll: 1, ..one(panned(world, &shot.camera)?) },
            Relation::MirroredTwice => one(mirrored(world)),
            Relation::FarThing => one(with_far_thing(world)?),
            Relation::Later => {
                // The grids of fires are no part of the file, which is read again at each moment.
                if world.materials.iter().any(|matter| matter.fire.is_some()) {
                    return None;
                }
                let shutter = [[0.75, 0.75], [0.5, 0.75], [0.4, 1.0]][random.below(3)];
                one(World { later: Some(Later { seed: world.seed, shutter }), ..world.clone() })
            }
            Relation::Void => one(with_voids(world)?),
            Relation::Usd => Other { shot: Shot { usd: true, ..shot.clone() }, ..one(world.clone()) },
            Relation::Method(method) => Other {
                shot: Shot { method, ..shot.clone() },
                tolerance: bias(shot.method).max(bias(method)),
                ..one(world.clone())
            },
        })
    }
}

/// Allowed relative bias of a method's tiles with the few iterations of these tests, due to the blur of kernels.
fn bias(method: Method) -> f64 {
    match method {
        Method::Path | Method::Bdpt | Method::Light | Method::Mlt => TOLERANCE,
        Method::Vcm => 0.06,
        _ => 0.25,
    }
}

/// A violated relation.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Broken {
    pub relation: Relation,
    pub method: Method,
    pub camera: String,
    /// The differences that the second set confirms, or an error.
    pub differences: Vec<Difference>,
    pub error: Option<String>,
}

impl std::fmt::Display for Broken {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{:?} by {}, {}:", self.relation, self.method.name(), self.camera)?;
        self.error.iter().try_for_each(|error| write!(f, " {error}"))?;
        self.differences.iter().take(4).try_for_each(|difference| write!(f, "\n    {difference}"))
    }
}

/// Factor on the number of photons with which a difference between methods with kernels must remain.
const MORE_PHOTONS: u32 = 16;

/// Compares a scene with its counterpart. A difference counts if sets of four times as many other seeds confirm it.
/// Between methods with kernels it must also remain with more photons, because the bias of a kernel shrinks with its
/// size.
pub fn check(world: &World, relation: Relation, shot: &Shot) -> Option<Broken> {
    let mut other = relation.other(world, shot)?;
    let mut shot = shot.clone();
    let broken = |shot: &Shot, differences, error| {
        Some(Broken { relation, method: shot.method, camera: shot.camera.clone(), differences, error })
    };
    let mut differences = match confirmed(|effort, seeds| found(world, &other, &shot, effort, seeds)) {
        Ok(differences) => differences?,
        Err(error) => return broken(&shot, vec![], Some(error)),
    };
    if other.tolerance > TOLERANCE {
        shot.photons = MORE_PHOTONS;
        other.shot.photons = MORE_PHOTONS;
        let again = match confirmed(|effort, seeds| found(world, &other, &shot, effort, seeds)) {
            Ok(again) => again?,
            Err(error) => return broken(&shot, vec![], Some(error)),
        };
        differences.retain(|difference| again.iter().any(|same| same.index == difference.index));
    }
    if differences.is_empty() { None } else { broken(&shot, differences, None) }
}

/// The differences between sets of some seeds.
///
/// # Errors
/// The renderer refuses one of the scenes.
pub fn found(
    world: &World,
    other: &Other,
    shot: &Shot,
    effort: f64,
    seeds: std::ops::Range<u64>,
) -> Result<Found, String> {
    let with_effort = |shot: &Shot| Shot { effort: effort * shot.effort, ..shot.clone() };
    let a = pictures(world, &with_effort(shot), seeds.clone())?;
    let b = others(other, &with_effort(&other.shot), seeds)?;
    Ok(Found::new(differences(&a, &b, other.tolerance, SIGNIFICANCE), &[&a, &b]))
}

/// First seed of the counterparts.
const OTHER_SEEDS: u64 = 1 << 20;

fn others(other: &Other, shot: &Shot, seeds: std::ops::Range<u64>) -> Result<Set, String> {
    let mut sum: Set = vec![vec![0.0; MEANS]; (seeds.end - seeds.start) as usize];
    for (index, world) in (1..).zip(&other.worlds) {
        let first = index * OTHER_SEEDS;
        let set = pictures(world, shot, first + seeds.start..first + seeds.end)?;
        for (total, means) in sum.iter_mut().zip(&set) {
            for (at, total) in total.iter_mut().enumerate() {
                let (tile, width) = (at / 3, TILES as usize);
                let from =
                    if tile < width * width { tile - tile % width + (tile % width + other.roll) % width } else { tile };
                *total += means[3 * from + other.channels[at % 3]] / other.factor;
            }
        }
    }
    Ok(sum)
}

/// The scene scaled, then rotated, then moved. Its picture stays the same.
pub fn similar(world: &World, scale: f64, rotation: DQuat, translation: DVec3) -> World {
    let mut made = world.clone();
    let parent = Placement { translation, rotation, scale: DVec3::splat(scale) };
    made.size *= scale;
    made.fog = made.fog.map(|fog| fog.scaled(scale));
    for matter in &mut made.materials {
        matter.medium = matter.medium.map(|medium| medium.scaled(scale));
        matter.fire = matter.fire.map(|fire| fire / scale);
    }
    for thing in &mut made.things {
        thing.chain.insert(0, parent);
        match &mut thing.kind {
            ThingKind::Mesh { .. } => {}
            ThingKind::Light(light) => match &mut light.kind {
                LightKind::Point { radius } | LightKind::Spot { radius, .. } => {
                    *radius *= scale;
                    light.color *= scale * scale;
                }
                LightKind::Sun { .. } => {}
            },
            ThingKind::Camera(lens) => {
                lens.aperture *= scale;
                lens.focus *= scale;
                lens.view *= if lens.orthographic { scale } else { 1.0 };
            }
        }
    }
    made
}

fn subdivided(world: &World) -> World {
    let mut made = world.clone();
    for mesh in &mut made.meshes {
        let source = std::mem::take(mesh);
        mesh.positions.clone_from(&source.positions);
        mesh.normals.clone_from(&source.normals);
        mesh.uvs.clone_from(&source.uvs);
        for &[a, b, c] in &source.triangles {
            let mut middle = |i: u32, j: u32| {
                let (i, j) = (i as usize, j as usize);
                // Computed like the numbers in a file, so that neighbours share the vertex.
                let p = 0.5 * (source.positions[i] + source.positions[j]);
                mesh.positions.push(p);
                if !source.normals.is_empty() {
                    mesh.normals.push((source.normals[i] + source.normals[j]).normalize());
                }
                if !source.uvs.is_empty() {
                    mesh.uvs.push(0.5 * (source.uvs[i] + source.uvs[j]));
                }
                mesh.positions.len() as u32 - 1
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            mesh.triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
    }
    made
}

fn copied(world: &World) -> World {
    let mut made = World { meshes: vec![], ..world.clone() };
    for thing in &mut made.things {
        let to_world = thing.to_world();
        // The box of a fire lies in the space of its mesh.
        if world.matter(thing).is_some_and(|matter| matter.fire.is_some()) {
            if let ThingKind::Mesh { mesh, .. } = &mut thing.kind {
                made.meshes.push(world.meshes[*mesh].clone());
                *mesh = made.meshes.len() - 1;
            }
            continue;
        }
        if let ThingKind::Mesh { mesh, .. } = &mut thing.kind {
            made.meshes.push(world.meshes[*mesh].transformed(&to_world));
            *mesh = made.meshes.len() - 1;
            thing.chain.clear();
        }
    }
    made
}

fn reordered(world: &World, random: &mut Random) -> World {
    let mut made = world.clone();
    random.shuffle(&mut made.things);
    for mesh in &mut made.meshes {
        random.shuffle(&mut mesh.triangles);
        for triangle in &mut mesh.triangles {
            triangle.rotate_left(random.below(3));
        }
    }
    made
}

/// Splits every light into two, by intensity or by triangles. Solids of glass are not split.
fn split(world: &World) -> Option<World> {
    let mut made = world.clone();
    let mut any = false;
    for index in world.lights() {
        let mut second = world.things[index].clone();
        second.name += " too";
        match &mut second.kind {
            ThingKind::Light(light) => {
                // A sphere would hide the other one.
                if matches!(light.kind, LightKind::Point { radius } if radius > 0.0) {
                    continue;
                }
                light.color *= 0.3;
                if let ThingKind::Light(first) = &mut made.things[index].kind {
                    first.color *= 0.7;
                }
            }
            ThingKind::Mesh { mesh, material } => {
                let whole = &world.meshes[*mesh];
                if world.materials[*material].is_glass() || whole.triangles.len() < 2 {
                    continue;
                }
                made.meshes.push(whole.part(|i| i % 3 == 0));
                made.meshes.push(whole.part(|i| i % 3 != 0));
                *mesh = made.meshes.len() - 1;
                made.things[index].kind = ThingKind::Mesh { mesh: *mesh - 1, material: *material };
            }
            ThingKind::Camera(_) => continue,
        }
        made.things.push(second);
        any = true;
    }
    any.then_some(made)
}

/// One scene per light.
fn single_lights(world: &World) -> Vec<World> {
    let lights = world.lights();
    let dark = {
        let mut dark = World { sky: None, ..world.clone() };
        lights.iter().for_each(|&index| switch_off(&mut dark, index));
        dark
    };
    let mut worlds: Vec<World> = lights
        .iter()
        .map(|&index| {
            let mut made = dark.clone();
            made.things[index].kind = world.things[index].kind;
            made
        })
        .collect();
    if world.sky.is_some() {
        worlds.push(World { sky: world.sky, ..dark });
    }
    worlds
}

/// Relative intensity of a sphere light that is off. With zero it would not exist and block no light.
const FAINT: f64 = 1e-9;

/// Turns a light off. Its object stays.
pub fn switch_off(world: &mut World, index: usize) {
    match world.things[index].kind {
        ThingKind::Mesh { mesh, material } => {
            let fire = world.materials[material].fire.map(|_| DVec3::ZERO);
            let off = Matter { emission: DVec3::ZERO, fire, ..world.materials[material].clone() };
            world.materials.push(off);
            world.things[index].kind = ThingKind::Mesh { mesh, material: world.materials.len() - 1 };
        }
        ThingKind::Light(light) => {
            let faint = if matches!(light.kind, LightKind::Point { radius } if radius > 0.0) { FAINT } else { 0.0 };
            world.things[index].kind = ThingKind::Light(Light { color: light.color * faint, ..light });
        }
        ThingKind::Camera(_) => {}
    }
}

/// Multiplies all light by a factor per channel.
pub fn brighter(world: &World, factor: DVec3) -> World {
    let mut made = world.clone();
    made.sky = made.sky.map(|sky| sky * factor);
    for matter in &mut made.materials {
        matter.emission *= factor;
        matter.fire = matter.fire.map(|fire| fire * factor);
    }
    for thing in &mut made.things {
        if let ThingKind::Light(light) = &mut thing.kind {
            light.color *= factor;
        }
    }
    made
}

/// Exchanges channels: red becomes blue, green red, and blue green.
fn permuted(world: &World) -> World {
    let turn = |color: &mut DVec3| *color = DVec3::new(color.y, color.z, color.x);
    let mut made = world.clone();
    made.sky.iter_mut().for_each(turn);
    let media = made.materials.iter_mut().filter_map(|matter| matter.medium.as_mut()).chain(made.fog.as_mut());
    for medium in media {
        turn(&mut medium.sigma_a);
        turn(&mut medium.sigma_s);
    }
    for matter in &mut made.materials {
        turn(&mut matter.base);
        turn(&mut matter.emission);
        matter.fire.iter_mut().for_each(turn);
    }
    for thing in &mut made.things {
        if let ThingKind::Light(light) = &mut thing.kind {
            turn(&mut light.color);
        }
    }
    for texture in made.textures.iter_mut().filter(|texture| texture.color) {
        texture.texels.iter_mut().for_each(|[r, g, b]| (*r, *g, *b) = (*g, *b, *r));
    }
    made
}

/// Raises objects that stand on something by a share of their size (lowers them if it is negative). `None` if there are
/// none.
pub fn lifted(world: &World, share: f64) -> Option<World> {
    let mut made = world.clone();
    for thing in made.things.iter_mut().filter(|thing| thing.rests) {
        // A liquid is raised with its vessel, which is larger.
        let of_body = world.things.iter().filter(|other| other.body == thing.body);
        let radius = of_body.map(|other| world.radius(other)).fold(0.0, f64::max);
        // The vertical axis of a thing is that of the floor.
        let up = thing.to_world().transform_vector3(DVec3::Y);
        thing.chain.push(Placement::at(DVec3::Y * share * 2.0 * radius / up.length()));
    }
    made.things.iter().any(|thing| thing.rests).then_some(made)
}

/// Turns a panorama of all directions by a tile to the left. `None` for other cameras.
fn panned(world: &World, camera: &str) -> Option<World> {
    let is_whole = |kind| matches!(kind, ThingKind::Camera(Lens { panorama: Some(Panorama::WHOLE), .. }));
    let index = world.things.iter().position(|thing| thing.name == camera && is_whole(thing.kind))?;
    let mut made = world.clone();
    made.things[index].chain.push(Placement::turned(DQuat::from_rotation_y(TAU / f64::from(TILES))));
    Some(made)
}

/// Mirrors every mesh, and mirrors it back by its node.
fn mirrored(world: &World) -> World {
    let mut made = world.clone();
    let mirror = Placement::scaled(DVec3::new(1.0, -1.0, 1.0));
    made.meshes = world.meshes.iter().map(|mesh| mesh.transformed(&mirror.affine())).collect();
    made.things.iter_mut().filter(|thing| thing.mesh().is_some()).for_each(|thing| thing.chain.push(mirror));
    made
}

/// Adds a small black box far away, from which no light returns. `None` under a sky or sun, because the larger scene
/// would reduce their photon density.
fn with_far_thing(world: &World) -> Option<World> {
    let from_infinity = |kind: &ThingKind| matches!(kind, ThingKind::Light(Light { kind: LightKind::Sun { .. }, .. }));
    if world.sky.is_some() || world.fog.is_some() || world.things.iter().any(|thing| from_infinity(&thing.kind)) {
        return None;
    }
    let mut made = world.clone();
    let mesh: Mesh = cuboid(DVec3::splat(-0.01), DVec3::splat(0.01), false);
    let place = Placement { translation: DVec3::new(20.0, 17.0, -25.0) * world.size, ..Placement::IDENTITY };
    let place = Placement { scale: DVec3::splat(world.size), ..place };
    made.add("far", mesh, Matter::matte(DVec3::ZERO), vec![place]);
    Some(made)
}

/// Adds solids without any content: hidden ones around the cameras and around the largest thing that glows or stands
/// free. `None` in fog, which they would displace.
fn with_voids(world: &World) -> Option<World> {
    if world.fog.is_some() {
        return None;
    }
    let mut made = world.clone();
    let matter = Matter { specular: 0.0, priority: -9, ..Matter::glass(1.0, 0.0) };
    let cube = cuboid(DVec3::splat(-1.0), DVec3::ONE, false);
    let size = |thing: &&super::world::Thing| world.radius(thing);
    let free = world.things.iter().filter(|thing| thing.name.starts_with("floating"));
    let around = free.max_by(|a, b| size(a).total_cmp(&size(b))).map(|thing| (thing, 1.3 * world.radius(thing)));
    let cameras = world.things.iter().filter(|thing| thing.is_camera()).map(|thing| (thing, 0.04 * world.size));
    for (thing, half) in cameras.chain(around) {
        let translation = thing.to_world().translation;
        let place = Placement { translation, rotation: DQuat::from_rotation_y(0.3), scale: DVec3::splat(half) };
        made.add("void", cube.clone(), matter.clone(), vec![place]).hidden = true;
    }
    Some(made)
}
