//! Warns about glass that casts no caustic.

use super::rays;
use crate::geometry::{Instance, Mesh};
use crate::light::Receiver;
use crate::material::{Alpha, MAX_FOCUSING_ROUGHNESS, Material};
use crate::math::{Vec2, Vec3};
use crate::plan::names::{UsedMaterial, truncate_names, used_in_scene, used_materials};
use crate::scene::Scene;
use crate::stat::median;
use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};

/// A mesh is flat if its points are nearer to a plane than this, relative to the size of the mesh.
const FLAT_TOLERANCE: f32 = 1e-3;
/// Maximum number of glass objects that are checked for light.
const MAX_OBJECTS: usize = 64;
/// Maximum number of instances of an object that are checked for light.
const MAX_INSTANCES: usize = 16;
/// Maximum number of sample points on an instance of a glass object, from which shadow rays go to the lights.
const MAX_POINTS: usize = 16;
/// Number of light samples (shadow rays) from each sample point.
const LIGHT_SAMPLES: u32 = 64;
/// Number of test rays that leave all lights together, in search of glass.
const LIGHT_RAYS: u32 = 1 << 14;
/// A transparent body with a higher mean alpha gets no warning, because its alpha may be intended.
const MAX_ALPHA: f32 = 0.75;
/// Minimum share of a body's faces that are transparent; otherwise it gets no warning.
const MIN_TRANSPARENT_SHARE: f32 = 0.9;
/// Maximum number of faces of a body whose alpha is looked up.
const MAX_FACES: usize = 256;

fn is_glass(material: &Material) -> bool {
    material.transmission.factor >= 0.5 && material.ior != 1.0
}

/// Warnings about curved glass objects that are thin walls. Most are meant to be solid, and are thin because the
/// exporter wrote no thickness and the mesh is open. Flat walls are panes, where a thickness would change little.
pub(super) fn thin_walls(scene: &Scene) -> Vec<String> {
    let (meshes, materials) = (&scene.shapes.meshes, &scene.materials.list);
    let mut flat: BTreeMap<u32, bool> = BTreeMap::new();
    let mut meant_solid = |instance: &&Instance| {
        let material = &materials[instance.material as usize];
        let wall = is_glass(material) && material.thin && material.focuses();
        wall && !*flat.entry(instance.mesh).or_insert_with(|| is_flat(&meshes[instance.mesh as usize]))
    };
    let instances = scene.shapes.instances.iter().filter(|instance| meant_solid(instance));
    let used = used_materials(materials, instances.map(|i| (i.material, i.name.as_str())));
    let warning = |label: String| {
        format!(
            "{label}: a thin wall does not bend light and casts no caustic; close the mesh (a bowl has an inside and an outside), or give the material a thickness"
        )
    };
    used.iter().map(|used| warning(used.label())).collect()
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
    off <= FLAT_TOLERANCE * size
}

/// Warnings about glass that is too rough to focus light into caustics.
pub(super) fn frosted_glass(scene: &Scene) -> Vec<String> {
    let warning = |material: &Material, label: String| {
        format!(
            "{label}: its roughness of {} spreads light too wide for a caustic to show; {MAX_FOCUSING_ROUGHNESS} and more is frosted",
            material.roughness.factor
        )
    };
    let used = used_in_scene(scene);
    let frosted = used.iter().filter(|used| is_glass(used.material) && !used.material.focuses());
    frosted.map(|used| warning(used.material, used.label())).collect()
}

/// Warnings about smooth closed bodies with partial alpha, which old models use for glass. Alpha does not refract.
pub(super) fn alpha_glass(scene: &Scene) -> Vec<String> {
    let materials = &scene.materials.list;
    let mut alphas: BTreeMap<u32, f32> = BTreeMap::new();
    let mut named = Vec::new();
    for (index, instance) in scene.shapes.instances.iter().enumerate() {
        let material = &materials[instance.material as usize];
        let smooth =
            material.metallic.factor < 0.5 && material.roughness.factor < MAX_FOCUSING_ROUGHNESS && !material.unlit;
        if material.alpha != Alpha::Blend || !smooth || material.transmission.factor >= 0.5 {
            continue;
        }
        if let Some(alpha) = alpha_of_body(scene, index as u32) {
            alphas.entry(instance.material).or_insert(alpha);
            named.push((instance.material, instance.name.as_str()));
        }
    }
    let warning = |(used, alpha): (&UsedMaterial, f32)| {
        format!(
            "{}: its alpha of {} lets light through straight, so it bends no light and casts no caustic; if it is glass, give it transmission 1 and alpha 1",
            used.label(),
            (100.0 * alpha).round() / 100.0
        )
    };
    // Both lists are in the order of materials.
    used_materials(materials, named.into_iter()).iter().zip(alphas.into_values()).map(warning).collect()
}

/// Median alpha of a closed body, looked up on faces spread over the mesh; `None` if the body is not transparent
/// everywhere.
fn alpha_of_body(scene: &Scene, index: u32) -> Option<f32> {
    let instance = &scene.shapes.instances[index as usize];
    let mesh = &scene.shapes.meshes[instance.mesh as usize];
    if !mesh.closed || is_flat(mesh) {
        return None;
    }
    let material = &scene.materials.list[instance.material as usize];
    let faces = rays::spread_indices(mesh.triangles.len(), MAX_FACES);
    let surfaces = faces.filter_map(|face| scene.shapes.surface(index, face as u32, [1.0 / 3.0; 2]));
    let mut alphas: Vec<f32> = surfaces.map(|surface| material.alpha(&surface, &scene.materials.textures)).collect();
    let transparent = alphas.iter().filter(|alpha| **alpha > 0.0 && **alpha <= MAX_ALPHA).count();
    let middle = median(&mut alphas, f32::total_cmp)?;
    (transparent as f32 >= MIN_TRANSPARENT_SHARE * alphas.len() as f32).then_some(middle)
}

/// Which lights reach a glass object, found by shadow rays from the object.
struct Shade {
    /// Whether a light shines on any tested point of the object.
    lit: bool,
    /// For each object between the glass and the lights, its quoted name and the number of shadow rays that it blocks.
    blockers: BTreeMap<String, usize>,
}

/// Warnings about glass objects without direct light. Mirrors and walls may still light them, but such light makes
/// hardly any caustic.
pub(super) fn unlit_glass(scene: &Scene) -> Vec<String> {
    let mut objects: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (index, instance) in scene.shapes.instances.iter().enumerate() {
        let material = &scene.materials.list[instance.material as usize];
        if is_glass(material) && material.focuses() {
            objects.entry(instance.object).or_default().push(index as u32);
        }
    }
    let mut warnings = Vec::new();
    let reached = OnceCell::new();
    for (object, instances) in objects.iter().take(MAX_OBJECTS) {
        let shade = shade(scene, instances);
        if shade.lit || reached.get_or_init(|| lit_objects(scene)).contains(object) {
            continue;
        }
        let mut blockers: Vec<(&String, &usize)> = shade.blockers.iter().collect();
        blockers.sort_by_key(|(_, rays)| std::cmp::Reverse(**rays));
        let names: Vec<String> = blockers.into_iter().map(|(name, _)| name.clone()).collect();
        let why = match names.is_empty() {
            true => "aim a light at it".to_string(),
            false => format!("it is in the shadow of {}", truncate_names(&names)),
        };
        let name = &scene.objects[*object as usize];
        warnings.push(format!("object \"{name}\": no light shines on its glass, so it casts no caustic; {why}"));
    }
    warnings
}

/// Indices of the objects that test rays from the lights hit, through transmitting surfaces. These rays find narrow
/// beams, which miss the few sampled points of a large face.
fn lit_objects(scene: &Scene) -> BTreeSet<u32> {
    /// Steps of the additive sequence that fills the hypercube evenly \[Roberts 2018\].
    const STEPS: [f64; 4] =
        [0.856_674_883_854_502_9, 0.733_891_856_627_126, 0.628_706_721_037_804_3, 0.538_596_948_320_147_3];
    let (shapes, materials) = (&scene.shapes, &scene.materials);
    let mut objects = BTreeSet::new();
    for k in 0..LIGHT_RAYS {
        let choice = (f64::from(k) + 0.5) / f64::from(LIGHT_RAYS);
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
    for index in rays::spread_indices(instances.len(), MAX_INSTANCES).map(|i| instances[i]) {
        let mesh = &scene.shapes.meshes[scene.shapes.instances[index as usize].mesh as usize];
        for primitive in rays::spread_indices(mesh.triangles.len(), MAX_POINTS) {
            let Some(point) = scene.shapes.surface(index, primitive as u32, [1.0 / 3.0; 2]) else { continue };
            for k in 0..LIGHT_SAMPLES {
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

/// Unit direction and distance (m) from `p` of a light that shines on `p` if nothing is between; the number `k` selects
/// the light and a point of it.
fn towards_light(scene: &Scene, p: Vec3, k: u32) -> Option<(Vec3, f32)> {
    /// Steps of the additive sequence that fills the square evenly \[Roberts 2018\].
    const STEPS: Vec2 = Vec2::new(0.754_877_7, 0.569_840_3);
    let choice = (f64::from(k) + 0.5) / f64::from(LIGHT_SAMPLES);
    let u = (STEPS * k as f32).fract();
    let light = scene.lights.sample_direct(&scene.shapes, &scene.materials, &Receiver::anywhere(p), choice, u)?;
    // Ends before the light's own surface.
    let distance = light.target.map_or(f32::INFINITY, |target| target.distance(p) * 0.9999);
    (light.radiance.max_element() > 0.0).then_some((light.wi, distance))
}
