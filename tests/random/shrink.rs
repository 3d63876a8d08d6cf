//! Reduces a failing scene as far as possible while it still fails.

use super::world::{Lens, LightKind, Matter, Placement, ThingKind, World};
use caustique::camera::Filter;
use glam::DVec3;

/// Returns the smallest scene found for which `fails` is true, by removing and simplifying one thing after another.
pub fn shrink(world: World, mut fails: impl FnMut(&World) -> bool) -> World {
    let mut smallest = world;
    loop {
        let before = smallest.clone();
        for step in [without_a_thing, without_space, with_plain_matter, with_plain_light, with_flat_chain] {
            let mut index = 0;
            while let Some(candidate) = step(&smallest, index) {
                match candidate {
                    // The next thing now has this index.
                    Some(candidate) if fails(&candidate) => {
                        let shorter = candidate.things.len() < smallest.things.len();
                        smallest = candidate;
                        index += usize::from(!shorter);
                    }
                    _ => index += 1,
                }
            }
        }
        if format!("{before:?}") == format!("{smallest:?}") {
            return tidied(smallest);
        }
    }
}

/// A simpler scene. The outer `None` ends the steps of one kind, the inner `None` means that this step changes nothing.
type Candidate = Option<Option<World>>;

fn without_a_thing(world: &World, index: usize) -> Candidate {
    let thing = world.things.get(index)?;
    let last = thing.is_camera() && world.cameras().len() == 1;
    Some((!last).then(|| {
        let mut made = world.clone();
        made.things.remove(index);
        made
    }))
}

fn without_space(world: &World, index: usize) -> Candidate {
    Some(match index {
        0 => world.sky.map(|_| World { sky: None, ..world.clone() }),
        1 => world.fog.map(|_| World { fog: None, ..world.clone() }),
        2 => (world.filter != Filter::default()).then(|| World { filter: Filter::default(), ..world.clone() }),
        _ => return None,
    })
}

/// Removes rare features of a material; the last step makes it grey.
fn with_plain_matter(world: &World, index: usize) -> Candidate {
    const STEPS: usize = 6;
    let matter = world.materials.get(index / STEPS)?;
    let plain = match index % STEPS {
        0 => Matter::matte(DVec3::splat(0.5)),
        1 => Matter::glowing(DVec3::splat(matter.emission.max_element())),
        2 => Matter { texture: None, bumps: None, clearcoat: 0.0, ..matter.clone() },
        3 => Matter { medium: None, ..matter.clone() },
        4 => Matter { roughness: if matter.roughness > 0.0 { 1.0 } else { 0.0 }, metallic: 0.0, ..matter.clone() },
        _ => Matter { base: DVec3::splat(matter.base.max_element()), ..matter.clone() },
    };
    Some((plain != *matter && (plain.glows() == matter.glows())).then(|| {
        let mut made = world.clone();
        made.materials[index / STEPS] = plain;
        made
    }))
}

/// Lights and cameras of size zero, without panoramas.
fn with_plain_light(world: &World, index: usize) -> Candidate {
    let thing = world.things.get(index)?;
    let mut kind = thing.kind;
    let changed = match &mut kind {
        ThingKind::Light(light) => {
            let plain = LightKind::Point { radius: 0.0 };
            std::mem::replace(&mut light.kind, plain) != plain
        }
        ThingKind::Camera(lens) => {
            let plain = Lens { aperture: 0.0, panorama: None, ..*lens };
            std::mem::replace(lens, plain) != plain
        }
        ThingKind::Mesh { .. } => false,
    };
    Some(changed.then(|| {
        let mut made = world.clone();
        made.things[index].kind = kind;
        made
    }))
}

/// A thing with a single node.
fn with_flat_chain(world: &World, index: usize) -> Candidate {
    let thing = world.things.get(index)?;
    Some((thing.chain.len() > 1).then(|| {
        let (scale, rotation, translation) = thing.to_world().to_scale_rotation_translation();
        let mut made = world.clone();
        made.things[index].chain = vec![Placement { translation, rotation, scale }];
        made
    }))
}

/// Removes unused meshes, materials and textures.
fn tidied(mut world: World) -> World {
    let (meshes, materials) = (std::mem::take(&mut world.meshes), std::mem::take(&mut world.materials));
    for thing in &mut world.things {
        if let ThingKind::Mesh { mesh, material } = &mut thing.kind {
            world.meshes.push(meshes[*mesh].clone());
            world.materials.push(materials[*material].clone());
            (*mesh, *material) = (world.meshes.len() - 1, world.materials.len() - 1);
        }
    }
    if world.materials.iter().all(|matter| matter.texture.is_none() && matter.bumps.is_none()) {
        world.textures.clear();
    }
    world
}
