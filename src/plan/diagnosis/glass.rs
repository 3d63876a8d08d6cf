//! Glass that casts no caustic.

use super::super::names::{Worn, cut, worn, worn_in};
use super::rays;
use crate::geometry::{Instance, Mesh};
use crate::light::Receiver;
use crate::material::{Alpha, MAX_FOCUSING_ROUGHNESS, Material};
use crate::math::{Vec2, Vec3};
use crate::scene::Scene;
use crate::stat::median;
use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};

/// A mesh whose points are this near a plane, in parts of its size, is flat.
const FLAT: f32 = 1e-3;
/// Glass objects that are looked at.
const OBJECTS: usize = 64;
/// Meshes, or copies, of one.
const COPIES: usize = 16;
/// Points on each of these.
const POINTS: usize = 16;
/// Lights asked for from each point.
const SAMPLES: u32 = 64;
/// Rays from all lights together.
const EMITTED: u32 = 1 << 14;
/// Bodies that fade less may be meant to.
const MOST_ALPHA: f32 = 0.75;
/// Share of a body that fades, at least, and faces on which that is looked up.
const MOST_OF_BODY: f32 = 0.9;
const FACES: usize = 256;

fn is_glass(material: &Material) -> bool {
    material.transmission >= 0.5 && material.ior != 1.0
}

/// Curved thin walls: most were meant to be solid, and thin only because the exporter wrote no thickness and the mesh
/// is open. Flat ones are panes, which a thickness would change little.
pub(super) fn thin(scene: &Scene) -> Vec<String> {
    let (meshes, materials) = (&scene.shapes.meshes, &scene.materials.list);
    let mut flat: BTreeMap<u32, bool> = BTreeMap::new();
    let mut meant_solid = |instance: &&Instance| {
        let material = &materials[instance.material as usize];
        let wall = is_glass(material) && material.thin && material.focuses();
        wall && !*flat.entry(instance.mesh).or_insert_with(|| is_flat(&meshes[instance.mesh as usize]))
    };
    let instances = scene.shapes.instances.iter().filter(|instance| meant_solid(instance));
    let worn = worn(materials, instances.map(|i| (i.material, i.name.as_str())));
    let tell = |label: String| {
        format!(
            "{label}: a thin wall does not bend light and casts no caustic; close the mesh (a bowl has an inside and an outside), or give the material a thickness"
        )
    };
    worn.iter().map(|worn| tell(worn.label())).collect()
}

fn is_flat(mesh: &Mesh) -> bool {
    let corners = |t: &[u32; 3]| t.map(|i| mesh.positions[i as usize]);
    let areas = mesh.triangles.iter().map(corners).map(|[a, b, c]| (a, (b - a).cross(c - a)));
    let Some((origin, normal)) = areas.max_by(|a, b| a.1.length_squared().total_cmp(&b.1.length_squared())) else {
        return true;
    };
    let Some(normal) = normal.try_normalize() else { return true };
    let (mut off, mut size) = (0f32, 0f32);
    for p in &mesh.positions {
        off = off.max((*p - origin).dot(normal).abs());
        size = size.max(p.distance(origin));
    }
    off <= FLAT * size
}

/// Glass too rough to focus light.
pub(super) fn wide(scene: &Scene) -> Vec<String> {
    let tell = |material: &Material, label: String| {
        format!(
            "{label}: its roughness of {} spreads light too wide for a caustic to show; {MAX_FOCUSING_ROUGHNESS} and more is frosted",
            material.roughness
        )
    };
    let worn = worn_in(scene);
    let wide = worn.iter().filter(|worn| is_glass(worn.material) && !worn.material.focuses());
    wide.map(|worn| tell(worn.material, worn.label())).collect()
}

/// Smooth closed bodies that fade by alpha, as old models have it for glass: a veil of that share, and no lens.
pub(super) fn faded(scene: &Scene) -> Vec<String> {
    let materials = &scene.materials.list;
    let mut alphas: BTreeMap<u32, f32> = BTreeMap::new();
    let mut named = Vec::new();
    for (index, instance) in scene.shapes.instances.iter().enumerate() {
        let material = &materials[instance.material as usize];
        let smooth = material.metallic < 0.5 && material.roughness < MAX_FOCUSING_ROUGHNESS && !material.unlit;
        if material.alpha != Alpha::Blend || !smooth || material.transmission >= 0.5 {
            continue;
        }
        if let Some(alpha) = alpha_of_body(scene, index as u32) {
            alphas.entry(instance.material).or_insert(alpha);
            named.push((instance.material, instance.name.as_str()));
        }
    }
    let tell = |(worn, alpha): (&Worn, f32)| {
        format!(
            "{}: its alpha of {} lets light through straight, so it bends no light and casts no caustic; if it is glass, give it transmission 1 and alpha 1",
            worn.label(),
            (100.0 * alpha).round() / 100.0
        )
    };
    // In the order of materials, both of them.
    worn(materials, named.into_iter()).iter().zip(alphas.into_values()).map(tell).collect()
}

/// The alpha of a closed body which fades all over; that of a texture is looked up on faces spread over the mesh.
fn alpha_of_body(scene: &Scene, index: u32) -> Option<f32> {
    let instance = &scene.shapes.instances[index as usize];
    let mesh = &scene.shapes.meshes[instance.mesh as usize];
    if !mesh.closed || is_flat(mesh) {
        return None;
    }
    let material = &scene.materials.list[instance.material as usize];
    let faces = rays::spread(mesh.triangles.len(), FACES);
    let places = faces.filter_map(|face| scene.shapes.surface(index, face as u32, [1.0 / 3.0; 2]));
    let mut alphas: Vec<f32> = places.map(|place| material.alpha(&place, &scene.materials.textures)).collect();
    let fading = alphas.iter().filter(|alpha| **alpha > 0.0 && **alpha <= MOST_ALPHA).count();
    let middle = median(&mut alphas, f32::total_cmp)?;
    (fading as f32 >= MOST_OF_BODY * alphas.len() as f32).then_some(middle)
}

/// What stands between the lights and a glass object: `None` if light comes through somewhere.
struct Shade {
    lit: bool,
    /// Quoted names, and on how many of the ways each stands.
    blockers: BTreeMap<String, usize>,
}

/// Glass that no light shines on directly. It may still be lit by way of mirrors and walls, but hardly focuses that.
pub(super) fn unlit(scene: &Scene) -> Vec<String> {
    let mut objects: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (index, instance) in scene.shapes.instances.iter().enumerate() {
        let material = &scene.materials.list[instance.material as usize];
        if is_glass(material) && material.focuses() {
            objects.entry(instance.object).or_default().push(index as u32);
        }
    }
    let mut warnings = Vec::new();
    let reached = OnceCell::new();
    for (object, instances) in objects.iter().take(OBJECTS) {
        let shade = shade(scene, instances);
        if shade.lit || reached.get_or_init(|| objects_lit(scene)).contains(object) {
            continue;
        }
        let mut blockers: Vec<(&String, &usize)> = shade.blockers.iter().collect();
        blockers.sort_by_key(|(_, ways)| std::cmp::Reverse(**ways));
        let names: Vec<String> = blockers.into_iter().map(|(name, _)| name.clone()).collect();
        let why = match names.is_empty() {
            true => "aim a light at it".to_string(),
            false => format!("what stands in the way is {}", cut(&names)),
        };
        let name = &scene.objects[*object as usize];
        warnings.push(format!("object \"{name}\": no light shines on its glass, so it casts no caustic; {why}"));
    }
    warnings
}

/// Objects that rays from the lights meet, through whatever transmits light. Narrow beams miss the few points of a large
/// face that are asked for light.
fn objects_lit(scene: &Scene) -> BTreeSet<u32> {
    /// Steps of the additive sequence that fills the hypercube evenly \[Roberts 2018\].
    const STEPS: [f64; 4] =
        [0.856_674_883_854_502_9, 0.733_891_856_627_126, 0.628_706_721_037_804_3, 0.538_596_948_320_147_3];
    let (shapes, materials) = (&scene.shapes, &scene.materials);
    let mut objects = BTreeSet::new();
    for k in 0..EMITTED {
        let choice = (f64::from(k) + 0.5) / f64::from(EMITTED);
        let [a, b, c, d] = STEPS.map(|step| (step * f64::from(k)).fract() as f32);
        let emitted = scene.lights.sample_emission(shapes, materials, choice, Vec2::new(a, b), Vec2::new(c, d));
        let Some(ray) = emitted else { continue };
        rays::first_opaque_after(scene, ray.origin, ray.direction, f32::INFINITY, k, |surface| {
            objects.insert(shapes.instances[surface.instance as usize].object);
        });
    }
    objects
}

fn shade(scene: &Scene, instances: &[u32]) -> Shade {
    let mut shade = Shade { lit: false, blockers: BTreeMap::new() };
    for index in rays::spread(instances.len(), COPIES).map(|i| instances[i]) {
        let mesh = &scene.shapes.meshes[scene.shapes.instances[index as usize].mesh as usize];
        for primitive in rays::spread(mesh.triangles.len(), POINTS) {
            let Some(point) = scene.shapes.surface(index, primitive as u32, [1.0 / 3.0; 2]) else { continue };
            for k in 0..SAMPLES {
                let Some((direction, distance)) = towards_light(scene, point.p, k) else { continue };
                match rays::first_opaque(scene, point.ray_origin(direction), direction, distance, k) {
                    None => {
                        shade.lit = true;
                        return shade;
                    }
                    Some(blocker) => {
                        let name = &scene.shapes.instances[blocker.instance as usize].name;
                        *shade.blockers.entry(format!("\"{name}\"")).or_default() += 1;
                    }
                }
            }
        }
    }
    shade
}

/// Direction and distance of a light that would shine on `p`; `k` chooses one, and a point of it.
fn towards_light(scene: &Scene, p: Vec3, k: u32) -> Option<(Vec3, f32)> {
    /// Steps of the additive sequence that fills the square evenly \[Roberts 2018\].
    const STEPS: Vec2 = Vec2::new(0.754_877_7, 0.569_840_3);
    let choice = (f64::from(k) + 0.5) / f64::from(SAMPLES);
    let u = (STEPS * k as f32).fract();
    let light = scene.lights.sample_direct(&scene.shapes, &scene.materials, &Receiver::anywhere(p), choice, u)?;
    // The end of the way is off the light's own surface.
    let distance = light.target.map_or(f32::INFINITY, |target| target.distance(p) * 0.9999);
    (light.radiance.max_element() > 0.0).then_some((light.wi, distance))
}
