//! Moments of a moving scene. They share with the scene at its frame all parts that do not move: meshes, their Embree
//! scenes, materials, and the distributions of lights.

use super::dense::limit_densities;
use super::description::{Description, PlacedMesh, missing_at_moments};
use super::nesting::{Volumes, alpha_solids};
use super::{Contacts, Scene, Survey, build};
use crate::error::Result;
use crate::geometry::{Instance, Mesh, Shapes};
use crate::light::{Emitter, Sky};
use crate::material::{Material, Materials, MediumParameters, Objects, Scattering};
use crate::math::{Vec3, bounding_box, corners};
use crate::trace::Tracer;
use std::sync::Arc;

/// Lower and upper corner of a bounding box.
type Box3 = (Vec3, Vec3);

/// Builds the moments of a scene in which something moves.
pub struct MomentBuilder<'a> {
    scene: &'a Scene,
    /// Bounding box of each mesh, in the space of its positions.
    mesh_boxes: Vec<Box3>,
    /// Bounding box of each instance at the frame, in world space.
    boxes: Vec<Box3>,
    /// Volumes of the solids at the frame.
    volumes: Volumes,
    /// Number of meshes from the scene file. Those of spheres made for point lights follow.
    meshes: usize,
    /// Number of materials from the scene file. Those of spheres made for point lights follow.
    materials: usize,
}

impl<'a> MomentBuilder<'a> {
    /// Makes the builder for moments of `scene`, which was built at its frame.
    pub fn new(scene: &'a Scene) -> MomentBuilder<'a> {
        let Shapes { meshes, instances, .. } = &*scene.shapes;
        let mesh_boxes: Vec<Box3> = meshes.iter().map(|mesh| bounding_box(mesh.positions.iter().copied())).collect();
        let boxes = instances.iter().map(|instance| placed_box(instance, mesh_boxes[instance.mesh as usize])).collect();
        let sphere = instances.iter().find(|instance| instance.object >= scene.first_light_sphere);
        MomentBuilder {
            scene,
            mesh_boxes,
            boxes,
            volumes: Volumes::of(Objects { shapes: &scene.shapes, materials: &scene.materials }),
            meshes: sphere.map_or(meshes.len(), |sphere| sphere.mesh as usize),
            materials: sphere.map_or(scene.materials.list.len(), |sphere| sphere.material as usize),
        }
    }

    /// The meshes of the scene file, which descriptions of moments share.
    pub fn meshes(&self) -> &[Arc<Mesh>] {
        &self.scene.shapes.meshes[..self.meshes]
    }

    /// Builds a moment from its description. If the description has no materials, they are those at the frame.
    ///
    /// # Errors
    /// An object or a light exists at only one of the two times, or Embree is out of memory.
    pub fn build(&self, mut description: Description) -> Result<Scene> {
        let scene = self.scene;
        let materials_move = !description.materials.is_empty();
        if !materials_move {
            description.materials = scene.materials.list[..self.materials].to_vec();
        }
        build::add_light_spheres(&mut description);
        self.check_objects(&description)?;
        self.share_light_spheres(&mut description);
        let instances = self.instances(&description);
        let shapes = Arc::new(scene.shapes.at_moment(std::mem::take(&mut description.meshes), instances));
        let (materials, medium) = self.materials(&mut description, &shapes, materials_move);
        let objects = Objects { shapes: &shapes, materials: &materials };
        let boxes = self.boxes(&shapes);
        let (sky, same_sky) = self.sky(&boxes);
        let lights = description.lights.iter().filter(|light| !light.is_sphere());
        let mut distributions = build::Distributions::of(scene.lights.others());
        let others: Vec<Emitter> =
            lights.map(|light| build::punctual(light, scene.origin, &mut distributions)).collect();
        let same_lights = same_sky
            && Arc::ptr_eq(&materials, &scene.materials)
            && others.iter().eq(scene.lights.others())
            && !self.moves_emitters(objects);
        let lights = scene.lights.at_moment(objects, others, sky, !same_lights);
        let (tracer, pass_through_lights) = self.tracers(&shapes, &materials)?;
        let catchers = build::catchers(&shapes, &materials, lights.links(), rayon::current_num_threads())?;
        Ok(Scene {
            tracer,
            pass_through_lights,
            catchers,
            cameras: description.cameras,
            medium,
            scattering: self.scattering(&materials),
            survey: Survey::new(objects, &lights, medium),
            contacts: self.contacts(objects, &boxes),
            ranks: self.volumes.at_moment(&scene.shapes, objects).ranks(&shapes),
            alpha_solids: match Arc::ptr_eq(&materials, &scene.materials) {
                true => Arc::clone(&scene.alpha_solids),
                false => alpha_solids(objects).into(),
            },
            warnings: Vec::new(),
            shapes,
            materials,
            lights,
            ..scene.clone()
        })
    }

    /// Checks that a description has the objects and lights of the frame.
    fn check_objects(&self, description: &Description) -> Result<()> {
        let scene = self.scene;
        let placed = description.instances.iter().map(|placed| &placed.name);
        let lights = description.lights.iter().filter(|light| !light.is_sphere()).map(|light| &light.name);
        let own = scene.shapes.instances.iter().map(|instance| &instance.name);
        match first_difference(placed, own).or_else(|| first_difference(lights, scene.light_names.iter())) {
            Some(name) => Err(missing_at_moments(name)),
            None => Ok(()),
        }
    }

    /// Replaces the meshes of spheres for point lights by those at the frame, where they are equal.
    fn share_light_spheres(&self, description: &mut Description) {
        let Shapes { meshes, instances, .. } = &*self.scene.shapes;
        let spheres = description.instances.iter().zip(instances);
        for (placed, own) in spheres.filter(|(_, own)| own.object >= self.scene.first_light_sphere) {
            let (mesh, own) = (&mut description.meshes[placed.mesh as usize], &meshes[own.mesh as usize]);
            if mesh.positions == own.positions {
                *mesh = Arc::clone(own);
            }
        }
    }

    /// The instances of a description. Those that do not move are those at the frame.
    fn instances(&self, description: &Description) -> Vec<Instance> {
        let place = |(placed, own): (&PlacedMesh, &Instance)| {
            if !own.moves {
                return own.clone();
            }
            let mut to_world = placed.to_world;
            to_world.translation -= self.scene.origin;
            Instance { mesh: placed.mesh, to_world: Some(build::placement(&to_world)), ..own.clone() }
        };
        description.instances.iter().zip(&self.scene.shapes.instances).map(place).collect()
    }

    /// The materials, and the medium outside all solids: those at the frame, if none of them moves.
    fn materials(
        &self,
        description: &mut Description,
        shapes: &Shapes,
        materials_move: bool,
    ) -> (Arc<Materials>, Option<MediumParameters>) {
        let own = &self.scene.materials;
        let emissions = |list: &[Material]| list[self.materials..].iter().map(|m| m.emission).collect::<Vec<_>>();
        let list = std::mem::take(&mut description.materials);
        if materials_move {
            let mut materials = Materials { list, textures: std::mem::take(&mut description.textures).into() };
            limit_densities(shapes, &mut materials, &mut description.medium, &mut Vec::new());
            (Arc::new(materials), description.medium)
        } else if emissions(&list) == emissions(&own.list) {
            (Arc::clone(own), self.scene.medium)
        } else {
            (Arc::new(Materials { list, textures: Arc::clone(&own.textures) }), self.scene.medium)
        }
    }

    /// The scattering of materials, with the tables of the frame if no index of refraction is new.
    fn scattering(&self, materials: &Materials) -> Arc<Scattering> {
        let own = &self.scene.materials.list;
        Arc::new(match materials.list.iter().all(|material| own.iter().any(|known| known.ior == material.ior)) {
            true => self.scene.scattering.for_materials(&materials.list),
            false => Scattering::new(&materials.list),
        })
    }

    /// The bounding box of each instance, in world space.
    fn boxes(&self, shapes: &Shapes) -> Vec<Box3> {
        let own = &self.scene.shapes;
        let bounds = |(i, instance): (usize, &Instance)| {
            let mesh = instance.mesh as usize;
            match own.meshes.get(mesh) {
                _ if !instance.moves => self.boxes[i],
                Some(before) if Arc::ptr_eq(before, &shapes.meshes[mesh]) => {
                    placed_box(instance, self.mesh_boxes[mesh])
                }
                _ => bounding_box(shapes.meshes[mesh].positions.iter().map(|&p| instance.point(p))),
            }
        };
        shapes.instances.iter().enumerate().map(bounds).collect()
    }

    /// The bounding sphere with the environment, and whether it is that of the frame, which is kept if nothing leaves the
    /// box that it was made for.
    fn sky(&self, boxes: &[Box3]) -> (Sky, bool) {
        let own = self.scene.lights.sky();
        let (low, high) = union(&self.boxes);
        let (now_low, now_high) = union(boxes);
        if low.cmple(now_low).all() && now_high.cmple(high).all() {
            return (own.clone(), true);
        }
        let (low, high) = (low.min(now_low), high.max(now_high));
        // As at the frame, slightly larger.
        let radius = ((high - low).length() * 0.5).max(1e-6) * 1.001;
        (Sky { center: (low + high) * 0.5, radius, ..own.clone() }, false)
    }

    /// Whether an emissive instance differs from that at the frame.
    fn moves_emitters(&self, objects: Objects<'_>) -> bool {
        let own = &self.scene.shapes;
        let points = |instance: &Instance| instance.to_world.map(|placement| placement.points);
        let differs = |now: &Instance, before: &Instance| {
            let mesh = &objects.shapes.meshes[now.mesh as usize];
            points(now) != points(before) || !Arc::ptr_eq(mesh, &own.meshes[before.mesh as usize])
        };
        let emits = |instance: &Instance| {
            let material = objects.material(instance);
            material.emits() || material.medium_emission().is_some()
        };
        let moving = objects.shapes.instances.iter().zip(&own.instances).filter(|(now, _)| now.moves && emits(now));
        moving.into_iter().any(|(now, before)| differs(now, before))
    }

    /// Commits the moving instances to Embree: those of [`Scene::tracer`], and those of [`Scene::pass_through_lights`].
    fn tracers(&self, shapes: &Arc<Shapes>, materials: &Arc<Materials>) -> Result<(Tracer, Option<Tracer>)> {
        let (scene, links) = (self.scene, self.scene.lights.links());
        let filtered = |passed| build::filtered(Objects { shapes, materials }, links, passed);
        // Embree's filters keep the materials that they were built with.
        let unfiltered = || [false, true].iter().all(|&passed| !filtered(passed).contains(&Some(true)));
        let behaviour = |materials: &Materials| materials.list.iter().map(build::hit_behaviour).collect::<Vec<_>>();
        let same = || behaviour(materials) == behaviour(&scene.materials) && unfiltered();
        if !(Arc::ptr_eq(materials, &scene.materials) || same()) {
            return build::tracers(shapes, materials, links, rayon::current_num_threads());
        }
        let filter = build::hit_filter(shapes, materials, links);
        let at = |tracer: &Tracer, passed| tracer.at_moment(&scene.shapes, shapes, &filtered(passed), &filter);
        let pass_through = scene.pass_through_lights.as_ref().map(|tracer| at(tracer, true)).transpose()?;
        Ok((at(&scene.tracer, false)?, pass_through))
    }

    fn contacts(&self, objects: Objects<'_>, boxes: &[Box3]) -> Arc<Contacts> {
        let passing = |materials: &Materials| materials.list.iter().map(Material::transmits).collect::<Vec<_>>();
        Arc::new(match passing(objects.materials) == passing(&self.scene.materials) {
            true => self.scene.contacts.at_moment(objects, boxes),
            false => Contacts::new(objects),
        })
    }
}

/// The first string by which two sequences differ; `None` if they are equal.
fn first_difference<'s>(
    mut a: impl Iterator<Item = &'s String>,
    mut b: impl Iterator<Item = &'s String>,
) -> Option<&'s str> {
    loop {
        match (a.next(), b.next()) {
            (None, None) => return None,
            (a, b) if a == b => {}
            (a, b) => return a.or(b).map(String::as_str),
        }
    }
}

/// A box in world space around the box of an instance's mesh.
fn placed_box(instance: &Instance, own: Box3) -> Box3 {
    if own.0.cmpgt(own.1).any() {
        return own;
    }
    bounding_box(corners(own).map(|corner| instance.point(corner)))
}

/// The smallest box around boxes.
fn union(boxes: &[Box3]) -> Box3 {
    boxes.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), of| (low.min(of.0), high.max(of.1)))
}
