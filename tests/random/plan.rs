//! Chooses the checks of a scene.

use super::picture::{Shot, finds_all, read};
use super::relation::{RELATIONS, Relation};
use super::world::World;
use caustique::render::Method;

/// The methods that get most checks.
pub const METHODS: [Method; 4] = [Method::Path, Method::Bdpt, Method::Vcm, Method::Sppm];
/// The other methods.
pub const OTHERS: [Method; 7] =
    [Method::Light, Method::Mlt, Method::Appm, Method::Cppm, Method::Ppm, Method::Bpm, Method::Pm];

/// `count` checks of the scene of a seed with the four methods, in an order that covers all pairs of relation and
/// method; one check with another method; one of a turned panorama; and one comparison of two methods. With shadow
/// linking, path tracing alone.
pub fn checks(world: &World, count: usize) -> Vec<(Relation, Shot)> {
    let i = world.seed as usize;
    let cameras = world.cameras();
    let shadow_links = world.things.iter().any(|thing| !thing.unblocked.is_empty());
    let shot = |method: Method| Shot::new(if shadow_links { Method::Path } else { method }, cameras[i % cameras.len()]);
    let n = RELATIONS.len();
    let mut list: Vec<(Relation, Shot)> =
        (0..count).map(|k| (RELATIONS[(i + 5 * k) % n], shot(METHODS[(i + k + i / n) % METHODS.len()]))).collect();
    list.push((RELATIONS[(3 * i + 1) % n], shot(OTHERS[i % OTHERS.len()])));
    // It applies to panoramas alone.
    list.push((Relation::Panned, shot(METHODS[i % METHODS.len()])));
    if !shadow_links {
        list.extend(methods(world, i).map(|(a, b)| (Relation::Method(b), shot(a))));
    }
    list
}

/// Two methods that find all light of the scene.
fn methods(world: &World, turn: usize) -> Option<(Method, Method)> {
    let scene = read(world).ok()?;
    let camera = world.cameras()[0].to_owned();
    let all: Vec<Method> = [Method::Path, Method::Bdpt, Method::Vcm, Method::Light, Method::Sppm]
        .into_iter()
        .filter(|method| finds_all(world, &scene, &Shot::new(*method, &camera)))
        .collect();
    let first = *all.get(turn % all.len().max(1))?;
    let second = all[(turn + 1 + turn / 7 % all.len().max(2).saturating_sub(1)) % all.len()];
    (first != second).then_some((first, second))
}
