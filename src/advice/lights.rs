//! Warns about lights in wrong units, about blocked lights, and about a missing environment.

use super::rays;
use crate::camera::Camera;
use crate::light::{Emitter, Light, Owner, TriangleLight};
use crate::math::{Vec3, bounding_box, luminance};
use crate::path_class::Effect;
use crate::plan::PlanRequest;
use crate::plan::names::truncate_names;
use crate::scene::Scene;
use std::collections::{BTreeMap, BTreeSet};
use std::f32::consts::PI;

/// Lumens per watt with which exporters convert the power of lights.
const EFFICACY: f32 = 683.0;
/// The powers of two lights are suspicious if their ratio is `EFFICACY`, up to this factor in either direction.
const RATIO_TOLERANCE: f32 = 5.0;
/// Maximum number of lights that are checked.
const MAX_LIGHTS: usize = 64;
/// Number of test rays from a point light, in directions all around it.
const DIRECTIONS: u32 = 256;
/// Number of surfaces that a test ray may hit one after the other before the light counts as enclosed.
const BOUNCES: usize = 4;
/// Maximum number of triangles of an emissive object that are sampled.
const MAX_EMITTING_TRIANGLES: usize = 8;
/// Number of test rays from each sampled triangle of an emissive object.
const DIRECTIONS_PER_TRIANGLE: u32 = 64;

/// A warning if the guessed units of punctual lights seem wrong: their ratio to other lights is about the ratio of
/// lumens to watts, so the other units would make them comparable. Points and spots are compared with emissive
/// surfaces, suns with the environment. Without anything to compare lumens with, the warning states the guess.
pub(super) fn wrong_units(scene: &Scene) -> Option<String> {
    let guessed = scene.guessed_units.as_ref()?;
    let sky = scene.lights.sky();
    let (mut points, mut surfaces, mut suns) = (0.0, 0.0, 0.0);
    for emitter in scene.lights.emitters() {
        match emitter.owner() {
            Owner::Surface(instance) => {
                let own = scene.shapes.instances[instance as usize].object < scene.first_light_sphere;
                *if own { &mut surfaces } else { &mut points } += emitter.power(sky) as f32;
            }
            Owner::Light if emitter.is_infinite() => suns += emitter.irradiance(sky),
            Owner::Light => points += emitter.power(sky) as f32,
            Owner::Medium(_) | Owner::Environment => {}
        }
    }
    let alone = surfaces == 0.0 && sky.environment.is_none() && points + suns > 0.0;
    if alone && guessed.photometric {
        return Some(format!(
            "lamps give all its light, and their numbers were taken for lumens, going by {}; if the picture is far too dark, use --light-units radiometric",
            guessed.from
        ));
    }
    let around = sky.environment.as_ref().map_or(0.0, |environment| PI * luminance(environment.mean()));
    let suspicious = EFFICACY / RATIO_TOLERANCE..EFFICACY * RATIO_TOLERANCE;
    let pairs =
        [(points, "its lamps", surfaces, "its surfaces that glow"), (suns, "its suns", around, "the environment")];
    let (strong, weak, many) = pairs.into_iter().find_map(|(a, named_a, b, named_b)| {
        // Lumens taken for watts are too strong; watts taken for lumens are too weak.
        let many = if guessed.photometric { b / a } else { a / b };
        let (strong, weak) = if guessed.photometric { (named_b, named_a) } else { (named_a, named_b) };
        suspicious.contains(&many).then_some((strong, weak, many))
    })?;
    let (taken, other) = if guessed.photometric { ("lumens", "radiometric") } else { ("watts", "photometric") };
    Some(format!(
        "the light of {strong} is {many:.0} times that of {weak}: the numbers of lamps were taken for {taken}, going by {}; if that is wrong, use --light-units {other}",
        guessed.from
    ))
}

/// A warning that the scene has no environment, if the exporter that wrote the file never writes one. A scene without
/// any light gets none, because building it already warns.
pub(super) fn missing_environment(scene: &Scene, request: &PlanRequest) -> Option<String> {
    let dark = scene.environment_unknown && scene.lights.sky().environment.is_none() && !scene.lights.is_empty();
    (dark && !request.switches.off.has(Effect::Environment)).then(|| {
        "no environment: Blender's own exporter leaves the world out, so what it shines is missing; export with scripts/blender/export.py, or give it with --env (--env 0,0,0 if it is dark)".into()
    })
}

/// A light and sampled rays that leave it, to test whether its light gets out of its casing.
struct LightRays {
    name: String,
    /// Index of the light's object, for an emissive surface; `None` for other lights.
    object: Option<u32>,
    /// Origin and unit direction of each ray.
    rays: Vec<(Vec3, Vec3)>,
}

/// Sampled rays of each light that has power and is not at infinity.
fn light_rays(scene: &Scene) -> Vec<LightRays> {
    let mut sources = Vec::new();
    let mut glowing: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    let sky = scene.lights.sky();
    for (index, emitter) in scene.lights.emitters().iter().enumerate().filter(|(_, e)| e.power(sky) > 0.0) {
        match emitter.owner() {
            Owner::Light => sources.extend(emitter.any_point(&scene.shapes).map(|p| LightRays {
                name: scene.light_name(index),
                object: None,
                rays: rays::directions(DIRECTIONS).filter(|d| emitter.shines(*d)).map(|d| (p, d)).collect(),
            })),
            Owner::Surface(instance) => glowing.entry(instance).or_default().push(index),
            Owner::Medium(_) | Owner::Environment => {}
        }
        if sources.len() >= MAX_LIGHTS {
            break;
        }
    }
    for (instance, triangles) in glowing.into_iter().take(MAX_LIGHTS) {
        let mut rays = Vec::new();
        for at in rays::spread_indices(triangles.len(), MAX_EMITTING_TRIANGLES) {
            let Emitter::Triangle(TriangleLight { primitive, two_sided, .. }) = &scene.lights.emitters()[triangles[at]]
            else {
                continue;
            };
            let Some(place) = scene.shapes.surface(instance, *primitive, [1.0 / 3.0; 2]) else { continue };
            let shines = |d: &Vec3| *two_sided || place.ng.dot(*d) > 0.0;
            rays.extend(rays::directions(DIRECTIONS_PER_TRIANGLE).filter(shines).map(|d| (place.ray_origin(d), d)));
        }
        let object = Some(scene.shapes.instances[instance as usize].object);
        sources.push(LightRays { name: scene.light_name(triangles[0]), object, rays });
    }
    sources
}

/// Warnings about lights in a casing that lets no light out. A closed room with the camera inside is not a casing.
pub(super) fn encased_lights(scene: &Scene, camera: Vec3) -> Vec<String> {
    let mut warnings = Vec::new();
    for LightRays { name, object, rays } in light_rays(scene) {
        let Some(mut casing) = enclosure(scene, rays) else { continue };
        casing.retain(|lit| Some(*lit) != object);
        if casing.is_empty() || is_within(scene, &casing, camera) {
            continue;
        }
        let names: Vec<String> = casing.iter().map(|lit| format!("\"{}\"", scene.objects[*lit as usize])).collect();
        warnings.push(format!(
            "{name}: all its light stays within {}, and the camera is outside; make an opening, or give the casing a material that transmits light",
            truncate_names(&names)
        ));
    }
    warnings
}

/// A warning if the environment or suns cannot light the surroundings of the camera, or the surfaces that it sees from
/// outside, because a sky dome or a closed room blocks them.
pub(super) fn blocked_environment(scene: &Scene, camera: &Camera) -> Option<String> {
    let has_sun = scene.lights.others().any(Light::is_infinite);
    let lights = match (&scene.lights.sky().environment, has_sun) {
        (Some(_), false) => "the environment lights",
        (Some(_), true) => "the environment and the sun light",
        (None, true) => "the sun lights",
        (None, false) => return None,
    };
    let position = camera.position();
    let around_camera = enclosure(scene, rays::directions(DIRECTIONS).map(|d| (position, d)).collect());
    let (mut around, inside) = match around_camera {
        Some(around) => (around, position),
        None => {
            let rays = rays_from_seen_surfaces(scene, camera);
            let inside = rays.first()?.0;
            (enclosure(scene, rays)?, inside)
        }
    };
    around.retain(|object| is_within(scene, &BTreeSet::from([*object]), inside));
    let names: Vec<String> = around.iter().map(|object| format!("\"{}\"", scene.objects[*object as usize])).collect();
    let by = if names.is_empty() { "everything around the camera".into() } else { truncate_names(&names) };
    Some(format!(
        "{lights} nothing that the camera sees: {by} shuts it out; make an opening, let it glow if it is the sky, or take it away"
    ))
}

/// Rays that leave the opaque surfaces which the camera sees, on the side of the camera.
fn rays_from_seen_surfaces(scene: &Scene, camera: &Camera) -> Vec<(Vec3, Vec3)> {
    let onward: Vec<Vec3> = rays::directions(DIRECTIONS).collect();
    let mut from = Vec::new();
    for (index, ray) in rays::of_camera(camera).enumerate() {
        let Some(surface) = rays::first_seen(scene, ray.origin, ray.direction, index as u32) else { continue };
        let front = if ray.direction.dot(surface.ng) < 0.0 { surface.ng } else { -surface.ng };
        let next = onward[97 * index % onward.len()];
        let next = if next.dot(front) < 0.0 { -next } else { next };
        from.push((surface.ray_origin(next), next));
    }
    from
}

/// Indices of the opaque objects that rays (origin and direction) hit while they bounce from surface to surface; `None`
/// if a ray leaves the scene.
fn enclosure(scene: &Scene, mut rays: Vec<(Vec3, Vec3)>) -> Option<BTreeSet<u32>> {
    let onward: Vec<Vec3> = rays::directions(DIRECTIONS).collect();
    let mut met = BTreeSet::new();
    for bounce in 0..BOUNCES {
        for (index, ray) in rays.iter_mut().enumerate() {
            let (origin, direction) = *ray;
            let surface = rays::first_opaque(scene, origin, direction, f32::INFINITY, 2 * index as u32)?;
            met.insert(scene.shapes.instances[surface.instance as usize].object);
            // Continues on the side that the ray came from, in different directions for neighbouring rays.
            let front = if direction.dot(surface.ng) < 0.0 { surface.ng } else { -surface.ng };
            let next = onward[(97 * index + 41 * bounce) % onward.len()];
            let next = if next.dot(front) < 0.0 { -next } else { next };
            *ray = (surface.ray_origin(next), next);
        }
    }
    (!rays.is_empty()).then_some(met)
}

/// Whether the point `p` is in the common bounding box of objects, given by their indices.
fn is_within(scene: &Scene, objects: &BTreeSet<u32>, p: Vec3) -> bool {
    let (low, high) = bounding_box(scene.shapes.points_of(|instance| objects.contains(&instance.object)));
    p.cmpge(low).all() && p.cmple(high).all()
}

/// Warnings about delta lights behind glass if the method of the planned render does not find their caustics.
pub(super) fn delta_lights_behind_glass(scene: &Scene, request: &PlanRequest) -> Vec<String> {
    if request.search.finds(Effect::Caustic, &scene.survey) {
        return vec![];
    }
    let mut warnings = Vec::new();
    for source in light_rays(scene).into_iter().filter(|source| source.object.is_none()) {
        let mut panes = BTreeMap::new();
        let n = source.rays.len();
        for (token, (origin, direction)) in source.rays.into_iter().enumerate() {
            let Some(surface) = rays::first(scene, origin, direction, f32::INFINITY, token as u32) else { continue };
            let material = &scene.materials.list[surface.material as usize];
            if material.transmission.factor > 0.0 && (material.thin || material.ior != 1.0) {
                let name = format!("\"{}\"", scene.shapes.instances[surface.instance as usize].name);
                *panes.entry(name).or_insert(0usize) += 1;
            }
        }
        let through: usize = panes.values().sum();
        // If less than half of the light passes glass, the glass is hardly a mistake.
        if 2 * through < n || through == 0 {
            continue;
        }
        let names: Vec<String> = panes.into_keys().collect();
        warnings.push(format!(
            "{}: {} % of its light goes through the glass of {}, and --method {} cannot find a lamp without size there; choose --method sppm or vcm, or give it a radius",
            source.name,
            100 * through / n,
            truncate_names(&names),
            request.method
        ));
    }
    warnings
}
