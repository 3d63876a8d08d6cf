//! Initial media: the solids around the camera and around each light, where paths start.

use super::interior::Interior;
use crate::camera::Camera;
use crate::light::{Emitter, Light, TriangleLight};
use crate::math::{Vec3, bounding_box};
use crate::scene::Scene;
use std::collections::HashMap;

/// The solids around the points where paths from one camera or light start.
#[derive(Clone, Copy, Debug)]
pub enum InitialMedium {
    /// The solids are equal for all start points.
    Same(Interior),
    /// The start points may lie on both sides of a solid's surface, so the solids are found for each point.
    Differs,
}

impl InitialMedium {
    /// The solids around `p`, one of the start points.
    #[inline]
    pub fn at(&self, scene: &Scene, p: Vec3) -> Interior {
        match self {
            InitialMedium::Same(interior) => *interior,
            InitialMedium::Differs => Interior::at(scene, p),
        }
    }
}

/// The solids around the camera and around each light.
pub struct InitialMedia {
    /// The solids around the camera.
    pub camera: InitialMedium,
    /// The solids around each light, by index; empty when the scene has no solids.
    lights: Vec<InitialMedium>,
}

impl InitialMedia {
    /// Finds the solids around all points where rays of the camera and of the lights start.
    pub fn of(scene: &Scene, camera: &Camera) -> InitialMedia {
        let mut initial_media = InitialMedia::new(scene, camera.position());
        let starts = Extent::of(camera.origins());
        if scene.survey.solids && Solid::all(scene).iter().any(|solid| solid.intersects(scene, &starts)) {
            initial_media.camera = InitialMedium::Differs;
        }
        initial_media
    }

    /// Finds the solids around all lights, and around a camera at a single point.
    pub fn new(scene: &Scene, camera: Vec3) -> InitialMedia {
        let lights = if scene.survey.solids { around_lights(scene) } else { Vec::new() };
        InitialMedia { camera: InitialMedium::Same(Interior::at(scene, camera)), lights }
    }

    /// The solids around a point just off light `index`.
    #[inline]
    pub fn light(&self, scene: &Scene, index: u32, p: Vec3) -> Interior {
        self.lights.get(index as usize).map_or(Interior::default(), |around| around.at(scene, p))
    }
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
struct Extent {
    low: Vec3,
    high: Vec3,
}

impl Extent {
    fn of(points: impl IntoIterator<Item = Vec3>) -> Extent {
        let (low, high) = bounding_box(points);
        Extent { low, high }
    }

    fn intersects(&self, other: &Extent) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }
}

/// An instance whose surface bounds a solid, with its bounding box.
struct Solid {
    instance: u32,
    extent: Extent,
}

impl Solid {
    /// All solids of a scene.
    fn all(scene: &Scene) -> Vec<Solid> {
        let instances = (0..).zip(&scene.shapes.instances);
        let solid = instances.filter(|(_, i)| scene.materials.list[i.material as usize].is_solid());
        solid.map(|(instance, _)| Solid { instance, extent: extent(scene, instance) }).collect()
    }

    /// Whether the bounding box of a triangle of the solid intersects `other`.
    fn intersects(&self, scene: &Scene, other: &Extent) -> bool {
        let instance = &scene.shapes.instances[self.instance as usize];
        let mesh = &scene.shapes.meshes[instance.mesh as usize];
        let passes = |primitive| Extent::of(instance.corners(mesh, primitive)).intersects(other);
        self.extent.intersects(other) && (0..mesh.triangles.len() as u32).any(passes)
    }
}

fn extent(scene: &Scene, instance: u32) -> Extent {
    let instance = &scene.shapes.instances[instance as usize];
    Extent::of(scene.shapes.meshes[instance.mesh as usize].positions.iter().map(|&p| instance.point(p)))
}

/// The initial medium of each emitter. It is the same for all points of a triangle unless bounding boxes of the
/// triangle and of a solid intersect, and the solid's surface may cross the whole light.
fn around_lights(scene: &Scene) -> Vec<InitialMedium> {
    let solids = Solid::all(scene);
    let mut crossed: HashMap<u32, Vec<&Solid>> = HashMap::new();
    let mut around = |emitter: &Emitter| {
        if let Emitter::Triangle(TriangleLight { instance, two_sided, corners: [a, b, c], .. }) = emitter {
            let crossed = crossed.entry(*instance).or_insert_with(|| {
                let light = extent(scene, *instance);
                // A one-sided light emits on one side of its own surface only.
                let others = solids.iter().filter(|solid| *two_sided || solid.instance != *instance);
                others.filter(|solid| solid.intersects(scene, &light)).collect()
            });
            let own = Extent::of([*a, *a + *b, *a + *c]);
            if crossed.iter().any(|solid| solid.extent.intersects(&own)) {
                return InitialMedium::Differs;
            }
        }
        if matches!(emitter, Emitter::Volume(_)) {
            return InitialMedium::Differs;
        }
        InitialMedium::Same(emitter.any_point(&scene.shapes).map_or(Interior::default(), |p| Interior::at(scene, p)))
    };
    scene.lights.emitters().iter().map(&mut around).collect()
}
