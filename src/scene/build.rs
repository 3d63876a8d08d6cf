//! Building a scene from a description: places and bakes meshes, makes lights, commits shapes to Embree.

use super::description::{self, Description, EnvironmentSource, PunctualLight};
use super::nesting::{Volumes, alpha_solids};
use super::{Contacts, Scene, SolidStacks, Survey, dense, links};
use crate::error::Result;
use crate::geometry::{ALL_LINKINGS, Instance, Mesh, Placement, Shapes};
use crate::light::{
    Bulb, Distribution, Emitter, Environment, Group, Groups, ImageEnvironment, Light, LightLinks, LightPlacement,
    Lights, Linking, MAX_GROUP_NAME, MAX_GROUPS, Pattern, PointLight, ShapedLight, Sky, SpotCone,
};
use crate::material::{Alpha, Material, Materials, MediumParameters, Objects, Scattering};
use crate::math::{DAffine3, DVec3, Rgb, Vec3, bounding_box};
use crate::texture::Texture;
use crate::trace::{CAMERA_RAY_BIT, HitFilter, Tracer};
use std::sync::Arc;

/// Distance of the scene's centre from the origin, in scene radii. A scene farther out is moved to the origin, because
/// f32 coordinates would lose digits.
const FAR_FROM_ORIGIN: f64 = 8.0;

/// Share of the box of an emission that may lie outside of the mesh, on each side, without a warning.
const MAX_FIRE_OUTSIDE: f32 = 1e-3;

/// Builds the scene from its description; Embree builds with `threads` threads (0: all).
///
/// # Errors
/// Embree is missing, or out of memory.
pub(super) fn build(mut description: Description, threads: usize) -> Result<Scene> {
    let mut warnings = std::mem::take(&mut description.warnings);
    warn_of_dispersion(&description, &mut warnings);
    if description.instances.is_empty() {
        warnings.push(
            "the scene has no mesh: the picture shows lights and the environment alone (was it exported with its objects?)"
                .into(),
        );
    }
    let first_light_sphere = description.objects.len() as u32;
    add_light_spheres(&mut description);
    let groups = light_groups(&description, first_light_sphere, &mut warnings);
    let shutter = description.blur();
    let (center, radius) = bounding_sphere(&description);
    let origin = if center.length() > FAR_FROM_ORIGIN * radius { center } else { DVec3::ZERO };

    let linked = links::resolve(&description, first_light_sphere, &mut warnings);
    let mut shapes = place_instances(&mut description, origin);
    for (instance, &linkings) in shapes.instances.iter_mut().zip(&linked.objects) {
        instance.linkings = linkings;
    }
    let shapes = Arc::new(shapes);
    let mut materials = Materials { list: description.materials, textures: description.textures.into() };
    dense::limit_densities(&shapes, &mut materials, &mut description.medium, &mut warnings);
    let materials = Arc::new(materials);
    let objects = Objects { shapes: &shapes, materials: &materials };
    let (tracer, pass_through_lights) = tracers(&shapes, &materials, &linked.lights, threads)?;
    let catchers = catchers(&shapes, &materials, &linked.lights, threads)?;
    // The picture is laid over a photograph.
    description.picture.film_transparent |= catchers.is_some();

    // Cameras may see black instead of the environment.
    let background =
        description.background.map(|seen| environment(Some(seen)).unwrap_or(Environment::Uniform(Rgb::ZERO)));
    let lighting = environment(description.environment);
    let sky = Sky {
        center: (center - origin).as_vec3(),
        // Slightly larger, so that no light path from infinity starts inside the geometry.
        radius: radius as f32 * 1.001,
        hidden_from_camera: description.environment_hidden_from_camera || description.picture.film_transparent,
        environment: if background.is_some() { lighting.or(Some(Environment::Uniform(Rgb::ZERO))) } else { lighting },
        background,
        learnt: None,
    };
    let others = description.lights.iter().filter(|light| !light.is_sphere());
    let mut distributions = Distributions::default();
    let (light_names, others) =
        others.map(|light| (light.name.clone(), punctual(light, origin, &mut distributions))).unzip();
    let lights = Lights::new(objects, others, sky).with_groups(groups).with_links(linked.lights);
    warn_of_cut_solids(objects, &mut warnings);
    warn_of_fires(objects, &mut warnings);
    warn_of_lights(objects, &lights, description.medium, &mut warnings);
    // With motion blur, lights that are dark at the frame may shine at another moment.
    if lights.is_empty() && !(shutter.is_some() && description.has_light) {
        warnings.push(black_warning(description.lights.len()));
    }
    if description.cameras.is_empty() {
        warnings
            .push("the scene has no camera: a three-quarter view of the whole scene is used (--orbit turns it)".into());
    }
    let scattering = Arc::new(Scattering::new(&materials.list));
    let contacts = Arc::new(Contacts::new(objects));
    warn_of_thin_walls(&shapes, &contacts, &mut warnings);
    let survey = Survey::new(objects, &lights, description.medium);
    let ranks = Volumes::of(objects).ranks(&shapes);
    let alpha_solids = alpha_solids(objects).into();
    Ok(Scene {
        source: description.source,
        files: description.files,
        origin,
        shapes,
        materials,
        objects: description.objects,
        first_light_sphere,
        preset_floor: description.preset_floor,
        tracer,
        pass_through_lights,
        catchers,
        lights,
        light_names,
        guessed_units: description.guessed_units,
        environment_unknown: description.environment_unknown,
        contents: description.contents,
        cameras: description.cameras,
        picture: description.picture,
        shutter,
        medium: description.medium,
        scattering,
        survey,
        contacts,
        ranks,
        alpha_solids,
        solid_stacks: SolidStacks::default(),
        warnings,
    })
}

/// Adds a warning for each material with dispersion that has no effect, because it does not refract.
fn warn_of_dispersion(description: &Description, warnings: &mut Vec<String>) {
    for placed in &description.instances {
        let material = &description.materials[placed.material as usize];
        let warning =
            format!("material \"{}\": its dispersion is ignored: it is no solid that refracts", material.name);
        if material.dispersion > 0.0 && !material.disperses() && !warnings.contains(&warning) {
            warnings.push(warning);
        }
    }
}

/// Adds a warning for each object with walls that are thinner than the rounding error of positions.
fn warn_of_thin_walls(shapes: &Shapes, contacts: &Contacts, warnings: &mut Vec<String>) {
    for &(instance, within) in &contacts.thin {
        warnings.push(format!(
            "object \"{}\": it has walls thinner than positions are exact where it is ({within:.1e} m), which light passes as if they were one surface (make them thicker, or the scene smaller)",
            shapes.instances[instance as usize].name
        ));
    }
}

/// The light groups of the scene (named sets of lights, each with a layer), in order of appearance, and the group of
/// each light. Objects from `first_light_sphere` on are spheres made for point lights.
fn light_groups(description: &Description, first_light_sphere: u32, warnings: &mut Vec<String>) -> Groups {
    let mut groups = Groups::default();
    let mut of = |name: &Option<String>| {
        let Some(name) = name.as_deref().filter(|name| !name.is_empty()) else { return Group::NONE };
        groups.get_or_add(name).unwrap_or_else(|| {
            let warning = format!("light group \"{name}\": it is left out: there are {MAX_GROUPS} others");
            if !warnings.contains(&warning) {
                warnings.push(warning);
            }
            Group::NONE
        })
    };
    let glows = |placed: &&description::PlacedMesh| description.may_glow(placed, first_light_sphere);
    let instances: Vec<Group> = description
        .instances
        .iter()
        .map(|placed| Some(placed).filter(glows).map_or(Group::NONE, |placed| of(&placed.light_group)))
        .collect();
    let others: Vec<Group> =
        description.lights.iter().filter(|light| !light.is_sphere()).map(|light| of(&light.light_group)).collect();
    let environment =
        description.environment.as_ref().map_or(Group::NONE, |_| of(&description.environment_light_group));
    let renamed = groups.renamed().map(|(label, name)| {
        format!("light group \"{label}\": its layers are called {name}: names are at most {MAX_GROUP_NAME} letters and all different")
    });
    warnings.extend(renamed);
    (groups.instances, groups.others, groups.environment) = (instances, others, environment);
    groups
}

/// Adds a warning for each glass solid with alpha, which is only approximated. If alpha varies over the solid, the
/// alpha where a ray enters also decides at its exit, so reversed paths may differ. If an emissive solid has alpha,
/// each face decides by itself, so that light samples and hits agree, and a ray may pass one wall of the solid alone.
fn warn_of_cut_solids(objects: Objects<'_>, warnings: &mut Vec<String>) {
    let mut named = vec![false; objects.materials.list.len()];
    for instance in &objects.shapes.instances {
        let (material, colors) = (objects.material(instance), &objects.mesh(instance).colors);
        let texture = material.base_color_texture.map(|t| &objects.materials.textures[t.texture as usize]);
        let varies = || texture.is_some_and(Texture::has_alpha) || colors.iter().any(|color| color.w < 1.0);
        let opaque_from = if let Alpha::Mask(cutoff) = material.alpha { cutoff } else { 1.0 };
        let glows = material.is_solid() && material.emits() && material.alpha != Alpha::Opaque;
        let problem = if glows && (varies() || material.base_color[3] < opaque_from) {
            "its alpha takes walls of solid glass that glows one by one, so light that passes two of them is not what it should be (give the glow to an object of its own, or set its alpha to opaque)"
        } else if material.has_alpha_per_entry() && varies() {
            "its alpha cuts holes into solid glass, and a ray that enters through one leaves through one (model the holes, or give it no thickness)"
        } else {
            continue;
        };
        if !std::mem::replace(&mut named[instance.material as usize], true) {
            warnings.push(format!("material \"{}\": {problem}", material.name));
        }
    }
}

/// Adds a warning for each object whose medium emits light outside of its mesh, where it does not exist.
fn warn_of_fires(objects: Objects<'_>, warnings: &mut Vec<String>) {
    for instance in &objects.shapes.instances {
        let Some(emission) = objects.material(instance).medium_emission() else { continue };
        let (low, high) = bounding_box(objects.mesh(instance).positions.iter().copied());
        let [from, to] = emission.grid().bounds();
        let tolerance = MAX_FIRE_OUTSIDE * (to - from);
        if (from + tolerance).cmplt(low).any() || (to - tolerance).cmpgt(high).any() {
            warnings.push(format!(
                "object \"{}\": the grid of its emission reaches out of its mesh, where it does not burn \
                 (make the mesh larger)",
                instance.name
            ));
        }
    }
}

/// The warning that a picture will be black; `punctual` is the number of point, spot and directional lights in the file.
fn black_warning(punctual: usize) -> String {
    let dark = match punctual {
        0 => "the scene has no light",
        _ => "the intensities of all lights are zero",
    };
    format!(
        "{dark}: the picture will be black (add --light-preset studio, --env, a lamp or an emissive material; Blender's own exporter leaves out \
         area lights and the world)"
    )
}

/// Adds warnings about lights without effect.
fn warn_of_lights(objects: Objects<'_>, lights: &Lights, medium: Option<MediumParameters>, warnings: &mut Vec<String>) {
    for (i, instance) in objects.shapes.instances.iter().enumerate() {
        if objects.material(instance).emits() && !lights.emits(i as u32) {
            warnings
                .push(format!("object \"{}\": its emissive surface has no area, so it gives no light", instance.name));
        }
    }
    let opaque = medium.is_some_and(|medium| medium.transmittance(f32::INFINITY) == Rgb::ZERO);
    if opaque && lights.emitters().iter().any(Light::is_infinite) {
        warnings.push(
            "the scene's medium has no end: no light of suns and environments gets through it (give a mesh around the \
             scene the medium instead)"
                .into(),
        );
    }
}

/// Does the work of [`Scene::with_materials`].
///
/// # Errors
/// Embree is out of memory.
pub(super) fn rebuild_with_materials(
    scene: &Scene,
    materials: Materials,
    medium: Option<MediumParameters>,
    environment: Option<Environment>,
) -> Result<Scene> {
    let (shapes, materials) = (Arc::clone(&scene.shapes), Arc::new(materials));
    let objects = Objects { shapes: &shapes, materials: &materials };
    // Embree's filters keep the materials that they were built with.
    let traced = |materials: &Materials| materials.list.iter().map(hit_behaviour).collect::<Vec<_>>();
    let passing = |materials: &Materials| materials.list.iter().map(Material::transmits).collect::<Vec<bool>>();
    let contacts = match passing(&materials) == passing(&scene.materials) {
        true => Arc::clone(&scene.contacts),
        false => Arc::new(Contacts::new(objects)),
    };
    let (tracer, pass_through_lights) = match traced(&materials) == traced(&scene.materials) {
        true => (scene.tracer.clone(), scene.pass_through_lights.clone()),
        false => tracers(&shapes, &materials, scene.lights.links(), rayon::current_num_threads())?,
    };
    let catchers = catchers(&shapes, &materials, scene.lights.links(), rayon::current_num_threads())?;
    let others = scene.lights.others().cloned();
    let sky = Sky { environment, learnt: None, ..scene.lights.sky().clone() };
    let lights = Lights::new(objects, others.collect(), sky).with_groups(scene.lights.groups().clone());
    let lights = lights.with_links(scene.lights.links().clone());
    Ok(Scene {
        tracer,
        pass_through_lights,
        catchers,
        medium,
        scattering: Arc::new(scene.scattering.for_materials(&materials.list)),
        survey: Survey::new(objects, &lights, medium),
        contacts,
        alpha_solids: alpha_solids(objects).into(),
        warnings: Vec::new(),
        shapes,
        materials,
        lights,
        ..scene.clone()
    })
}

/// World-space bounding sphere of all meshes, in f64: centre and radius. A unit sphere for a scene without meshes.
fn bounding_sphere(description: &Description) -> (DVec3, f64) {
    let (low, high) = description.bounds();
    if low.cmple(high).all() {
        ((low + high) * 0.5, ((high - low).length() * 0.5).max(1e-6))
    } else {
        (DVec3::ZERO, 1.0)
    }
}

/// Moves the meshes and instances of the description into shapes, with `origin` subtracted from positions. A mesh with
/// one instance that does not move and has no grid inside is transformed to world space; other meshes stay in their own
/// space.
fn place_instances(description: &mut Description, origin: DVec3) -> Shapes {
    let mut uses = vec![0u32; description.meshes.len()];
    for placed in &description.instances {
        uses[placed.mesh as usize] += 1;
    }
    let (mut meshes, mut instances) = (std::mem::take(&mut description.meshes), Vec::new());
    for placed in &description.instances {
        let mut to_world = placed.to_world;
        to_world.translation -= origin;
        // Grids of media need the space of the object.
        let has_grid = description.materials[placed.material as usize].grids.is_some();
        let shared = placed.moves || uses[placed.mesh as usize] > 1 || has_grid;
        if !shared {
            bake(Arc::make_mut(&mut meshes[placed.mesh as usize]), &to_world);
        }
        instances.push(Instance {
            name: placed.name.clone(),
            mesh: placed.mesh,
            material: placed.material,
            object: placed.object,
            hidden_from_camera: placed.hidden_from_camera,
            shadow_catcher: placed.shadow_catcher,
            holdout: placed.holdout,
            linkings: ALL_LINKINGS,
            moves: placed.moves,
            to_world: shared.then(|| placement(&to_world)),
        });
    }
    Shapes::new(meshes, instances)
}

/// The placement by a transform from local to world space, in single precision.
pub(super) fn placement(to_world: &DAffine3) -> Placement {
    Placement::new(glam::Affine3A::from_mat4(glam::DMat4::from(*to_world).as_mat4()))
}

/// Transforms a mesh to world space. A mirroring transform also flips the winding, so that the front stays the front,
/// and the handedness of the tangents.
fn bake(mesh: &mut Mesh, to_world: &DAffine3) {
    let mirrored = to_world.matrix3.determinant() < 0.0;
    let normals = to_world.matrix3.inverse().transpose();
    for p in &mut mesh.positions {
        *p = to_world.transform_point3(p.as_dvec3()).as_vec3();
    }
    for n in &mut mesh.normals {
        *n = (normals * n.as_dvec3()).normalize_or_zero().as_vec3();
    }
    for t in &mut mesh.tangents {
        let d = to_world.transform_vector3(t.truncate().as_dvec3()).normalize_or_zero().as_vec3();
        *t = d.extend(if mirrored { -t.w } else { t.w });
    }
    if mirrored {
        for triangle in &mut mesh.triangles {
            triangle.swap(1, 2);
        }
    }
}

/// The properties of a material that Embree's hit filters use: how alpha acts at each hit, whether all rays pass through
/// the surface, and whether it bounds a solid.
pub(super) fn hit_behaviour(material: &Material) -> (Alpha, bool, bool) {
    (material.alpha_per_hit(), material.null_bsdf, material.is_solid())
}

/// Commits the shapes to Embree. Returns the scenes of [`Scene::tracer`] and of [`Scene::pass_through_lights`].
pub(super) fn tracers(
    shapes: &Arc<Shapes>,
    materials: &Arc<Materials>,
    links: &LightLinks,
    threads: usize,
) -> Result<(Tracer, Option<Tracer>)> {
    let (objects, filter) = (Objects { shapes, materials }, hit_filter(shapes, materials, links));
    let build = |filtered: &[Option<bool>]| Tracer::build(shapes, filtered, &filter, threads);
    let [surfaces, lights] = [false, true].map(|lights| filtered(objects, links, lights));
    let has_lights = lights.iter().any(Option::is_some);
    Ok((build(&surfaces)?, has_lights.then(|| build(&lights)).transpose()?))
}

/// An Embree scene of the shadow catchers; `None` if there are none.
pub(super) fn catchers(
    shapes: &Arc<Shapes>,
    materials: &Arc<Materials>,
    links: &LightLinks,
    threads: usize,
) -> Result<Option<Tracer>> {
    if !shapes.instances.iter().any(|instance| instance.shadow_catcher) {
        return Ok(None);
    }
    let all = filtered(Objects { shapes, materials }, links, false);
    let chosen: Vec<Option<bool>> =
        shapes.instances.iter().zip(all).map(|(instance, of)| of.filter(|_| instance.shadow_catcher)).collect();
    Tracer::build(shapes, &chosen, &hit_filter(shapes, materials, links), threads).map(Some)
}

/// For each instance, whether its hits are filtered; `None` for instances that are not in
/// [`Scene::pass_through_lights`], if `lights`, and otherwise for those that are not in [`Scene::tracer`].
pub(super) fn filtered(objects: Objects<'_>, links: &LightLinks, lights: bool) -> Vec<Option<bool>> {
    let blockers = links.blockers();
    let filtered = |(index, instance): (usize, &Instance)| {
        let material = objects.material(instance);
        let unlinked = blockers & !instance.linkings != 0;
        let filtered = instance.hidden_from_camera || unlinked || material.alpha_per_hit() != Alpha::Opaque;
        let chosen = match lights {
            true => material.null_bsdf || !links.blockers_of(index as u32).is_all(),
            false => !material.null_bsdf,
        };
        chosen.then_some(filtered)
    };
    objects.shapes.instances.iter().enumerate().map(filtered).collect()
}

/// A random number in (0, 1] that depends on the ray's token, the instance and `key` alone.
pub(super) fn random_cutoff(token: u32, instance: u32, key: u32) -> f32 {
    let key = u64::from(token) << 32 ^ u64::from(instance).wrapping_mul(0x9e37_79b9) << 20 ^ u64::from(key);
    (crate::random::mix(key) >> 40) as f32 * (1.0 / 16_777_216.0) + f32::MIN_POSITIVE
}

/// The filter of Embree's hits: rejects hits of camera rays on instances hidden from cameras, of shadow rays on
/// instances that do not block their light, and hits on surfaces that the ray passes because of alpha. These rays hit
/// solids all the same, because they keep track of the solids around them.
pub(super) fn hit_filter(shapes: &Arc<Shapes>, materials: &Arc<Materials>, links: &LightLinks) -> HitFilter {
    let (shapes, materials) = (Arc::clone(shapes), Arc::clone(materials));
    let linked = links.blockers() != 0;
    Arc::new(move |instance, primitive, barycentric, token| {
        let placed = &shapes.instances[instance as usize];
        let material = &materials.list[placed.material as usize];
        if placed.hidden_from_camera && token & CAMERA_RAY_BIT != 0 && !material.is_solid() {
            return false;
        }
        if linked && !Linking::of_ray(token).has(placed.linkings) && !material.is_solid() {
            return false;
        }
        let cutoff = match material.alpha_per_hit() {
            Alpha::Opaque => return true,
            Alpha::Mask(cutoff) => cutoff,
            // One number per ray and triangle, so that the order of Embree's calls does not matter.
            Alpha::Blend => random_cutoff(token, instance, primitive),
        };
        let Some(surface) = shapes.surface(instance, primitive, barycentric) else { return false };
        material.alpha(&surface, &materials.textures) >= cutoff
    })
}

fn environment(described: Option<description::EnvironmentDescription>) -> Option<Environment> {
    let described = described?;
    match described.source {
        EnvironmentSource::Color(color) => {
            let radiance = color * described.strength;
            (radiance.max_element() > 0.0).then_some(Environment::Uniform(radiance))
        }
        EnvironmentSource::Image { width, height, mut texels } => {
            for texel in &mut texels {
                *texel = texel.map(|x| x * described.strength);
            }
            ImageEnvironment::new(width as usize, height as usize, &texels, described.rotation_deg.to_radians())
                .map(|image| Environment::Image(Arc::new(image)))
        }
    }
}

/// The distributions of the lights of a scene, which lights with equal patterns and cones share.
#[derive(Default)]
pub(super) struct Distributions(Vec<KnownDistribution>);

/// A pattern and the cone that limits it, with their distribution; `None` if no light is left.
type KnownDistribution = (Arc<Pattern>, Option<SpotCone>, Option<Arc<Distribution>>);

impl Distributions {
    /// The distributions of lights that were built before.
    pub(super) fn of<'a>(lights: impl Iterator<Item = &'a Emitter>) -> Distributions {
        let shaped = lights.filter_map(|light| match light {
            Emitter::Shaped(shaped) => Some(&shaped.distribution),
            _ => None,
        });
        Distributions(shaped.map(|of| (Arc::clone(of.pattern()), of.cone(), Some(Arc::clone(of)))).collect())
    }

    /// The distribution of a pattern within a cone; `None` if no light is left.
    fn get(&mut self, pattern: &Arc<Pattern>, cone: Option<SpotCone>) -> Option<Arc<Distribution>> {
        let known = self.0.iter().find(|(other, of, _)| Arc::ptr_eq(other, pattern) && *of == cone);
        if let Some((.., known)) = known {
            return known.clone();
        }
        let made = Distribution::new(Arc::clone(pattern), cone).map(Arc::new);
        self.0.push((Arc::clone(pattern), cone, made.clone()));
        made
    }
}

/// The emitter of a punctual light that is not a sphere. A pattern without any light makes it a point of no intensity.
pub(super) fn punctual(light: &PunctualLight, origin: DVec3, distributions: &mut Distributions) -> Emitter {
    let place = LightPlacement {
        p: (light.to_world.translation - origin).as_vec3(),
        axis: (light.to_world.matrix3 * DVec3::NEG_Z).normalize_or(DVec3::NEG_Y).as_vec3(),
        right: (light.to_world.matrix3 * DVec3::X).normalize_or(DVec3::X).as_vec3(),
        intensity: light.intensity,
        radius: light.radius,
        bulb: (light.bulb && light.radius > 0.0).then_some(Bulb { hidden_from_camera: light.hidden_from_camera }),
        hidden_from_camera: light.hidden_from_camera,
    };
    match light.pattern.as_ref().map(|pattern| distributions.get(pattern, light.kind.cone())) {
        None => light.kind.emitter(&place),
        Some(Some(distribution)) => ShapedLight::new(&place, distribution).into(),
        Some(None) => PointLight { p: place.p, intensity: Rgb::ZERO }.into(),
    }
}

/// Turns point lights with a radius into emissive spheres, which are visible and cast soft shadows. A dark light has no
/// sphere, or, with motion blur, one that rays pass through, because it may shine at another moment.
pub(super) fn add_light_spheres(description: &mut Description) {
    let blurred = description.blur().is_some();
    for light in &description.lights {
        let dark = light.intensity.max_element() <= 0.0;
        if !light.is_sphere() || (dark && !blurred) {
            continue;
        }
        let mesh = icosphere(light.radius, 3);
        let area: f32 = mesh
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
                0.5 * (b - a).cross(c - a).length()
            })
            .sum();
        // The mean projected area of a convex body is a quarter of its surface (Cauchy), so the mean intensity over all
        // directions is exact.
        let emission: Rgb = light.intensity * (4.0 / area);
        let material = Material {
            name: light.name.clone(),
            base_color: [0.0, 0.0, 0.0, 1.0],
            metallic: 0.0.into(),
            specular: 0.0.into(),
            emission,
            null_bsdf: light.pass_through || dark,
            ..Material::default()
        };
        description.instances.push(description::PlacedMesh {
            name: light.name.clone(),
            mesh: description.meshes.len() as u32,
            material: description.materials.len() as u32,
            object: description.objects.len() as u32,
            hidden_from_camera: light.hidden_from_camera,
            shadow_catcher: false,
            holdout: false,
            light_group: light.light_group.clone(),
            links: light.links.clone(),
            moves: blurred,
            to_world: DAffine3::from_translation(light.to_world.translation),
        });
        description.objects.push(light.name.clone());
        description.meshes.push(Arc::new(mesh));
        description.materials.push(material);
    }
}

/// A sphere around the origin as a subdivided icosahedron of `20 * 4^subdivisions` triangles; `radius` is in metres.
fn icosphere(radius: f32, subdivisions: u32) -> Mesh {
    let t = (1.0 + 5f32.sqrt()) / 2.0;
    let mut positions: Vec<Vec3> = [
        [-1.0, t, 0.0],
        [1.0, t, 0.0],
        [-1.0, -t, 0.0],
        [1.0, -t, 0.0],
        [0.0, -1.0, t],
        [0.0, 1.0, t],
        [0.0, -1.0, -t],
        [0.0, 1.0, -t],
        [t, 0.0, -1.0],
        [t, 0.0, 1.0],
        [-t, 0.0, -1.0],
        [-t, 0.0, 1.0],
    ]
    .map(|p| Vec3::from_array(p).normalize())
    .to_vec();
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..subdivisions {
        let mut middles = std::collections::HashMap::new();
        let mut next = Vec::with_capacity(triangles.len() * 4);
        for [a, b, c] in triangles {
            let mut middle = |i: u32, j: u32| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    positions.push(((positions[i as usize] + positions[j as usize]) * 0.5).normalize());
                    positions.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            next.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = next;
    }
    for p in &mut positions {
        *p *= radius;
    }
    Mesh { name: "lamp".into(), positions, triangles, closed: true, ..Mesh::default() }
}
