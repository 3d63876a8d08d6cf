//! The scene: a reader turns a file into a plain [`Description`], which [`Scene::build`] turns into a [`Scene`].

pub mod blend;
mod build;
mod camera_request;
pub mod contact;
mod contacts;
pub mod converter;
mod dense;
pub mod description;
mod edit;
pub mod environment_file;
pub mod folder;
pub mod gltf;
pub mod grid_file;
pub mod ies;
pub mod light_preset;
mod links;
mod moment;
mod nesting;
mod pose;
mod survey;
pub mod usd;
mod view;

pub use camera_request::{CameraRequest, Crop, Distance, MAX_SIZE, Orbit};
pub use contacts::Contacts;
pub use description::Description;
pub use light_preset::LightPreset;
pub use moment::MomentBuilder;
pub use nesting::{ABSENT, AlphaSolid, EMPTY_STACK, SolidStack, SolidStacks};
pub use pose::{Pose, TrianglePoint};
pub use survey::Survey;
pub use view::View;

use crate::error::Result;
use crate::geometry::{ALL_LINKINGS, Shapes, Surface};
use crate::light::{Environment, LearntLight, Light, Lights, Owner};
use crate::material::{Materials, MediumParameters, Scattering};
use crate::math::{DVec3, Vec3};
use crate::trace::Tracer;
use description::{CameraDescription, FileContents, GuessedUnits, PictureDefaults};
use std::path::PathBuf;
use std::sync::Arc;

/// A validated, immutable scene with all data that rendering reads. Clones share the large parts.
#[derive(Clone)]
pub struct Scene {
    /// Path of the scene file.
    pub source: PathBuf,
    /// Paths of all files that the scene names or is read from, the scene file included.
    pub files: Vec<PathBuf>,
    /// Offset (m) that was subtracted from all world positions; zero except for scenes far from the origin.
    pub origin: DVec3,
    /// Meshes and their instances.
    pub shapes: Arc<Shapes>,
    /// Materials and their textures.
    pub materials: Arc<Materials>,
    /// Names of objects, by the index of the object.
    pub objects: Vec<String>,
    /// Index of the first object that is a sphere made for a point light with a radius. All later objects are, too.
    pub first_light_sphere: u32,
    /// Index of the object that a light preset has added, which views of the whole scene do not frame.
    pub preset_floor: Option<u32>,
    /// Embree scene of all shapes except lights that rays pass through.
    pub tracer: Tracer,
    /// Embree scene of the lights whose light camera paths meet beside surfaces, if there are any: those that rays pass
    /// through ([`crate::material::Material::null_bsdf`]), and glowing objects with shadow linking, whose light passes
    /// objects.
    pub pass_through_lights: Option<Tracer>,
    /// Embree scene of the shadow catchers, which alone block the light of [`crate::transport`]'s unshadowed rays; `None`
    /// if there are none.
    pub catchers: Option<Tracer>,
    /// All lights, with the distributions that sample them.
    pub lights: Lights,
    /// Names of the lights that are not triangles: points, spots and suns, in the order of [`Lights::emitters`].
    pub light_names: Vec<String>,
    /// Units of the intensities of punctual lights, if they were guessed; otherwise `None`.
    pub guessed_units: Option<GuessedUnits>,
    /// Whether the original scene may have an environment that the file lacks: see
    /// [`Description::environment_unknown`].
    pub environment_unknown: bool,
    /// Cameras, in the order of the file.
    pub cameras: Vec<CameraDescription>,
    /// Settings of the picture in the scene file, which options override.
    pub picture: PictureDefaults,
    /// Times at which the shutter opens and closes, relative to the frame (frames); `None` if nothing moves while it is
    /// open.
    pub shutter: Option<[f64; 2]>,
    /// The medium that fills the space outside all solids; `None` if it is empty.
    pub medium: Option<MediumParameters>,
    /// Scattering data of the materials that were computed in advance.
    pub scattering: Arc<Scattering>,
    /// Kinds of things that the scene contains, such as media and delta lights.
    pub survey: Survey,
    /// Triangles that other triangles may touch, where rays need to find all touching surfaces.
    pub contacts: Arc<Contacts>,
    /// Rank of the solid that each instance belongs to. Where solids of equal priority overlap, the highest rank fills
    /// the space.
    pub ranks: Arc<[u32]>,
    /// The solids of all instances, which alpha lets exist with a probability; empty if all solids exist for all paths.
    pub alpha_solids: Arc<[AlphaSolid]>,
    /// Stacks of solids, too deep for a path to carry, that paths have entered.
    pub solid_stacks: SolidStacks,
    /// What the scene file offers to choose from, and its extensions.
    pub contents: FileContents,
    /// Warnings about ignored or approximated features, from the reader and from [`Scene::build`].
    pub warnings: Vec<String>,
}

impl Scene {
    /// Distance (m) from the scene's centre beyond which paths from `origin` in an unbounded medium only move away:
    /// outside the scene's bounding sphere plus one mean free path, and farther out than `origin`. Infinite if no
    /// medium scatters outside solids.
    pub fn reach(&self, origin: Vec3) -> f32 {
        let Some(medium) = self.medium.filter(MediumParameters::scatters) else { return f32::INFINITY };
        let sky = self.lights.sky();
        (sky.radius + 1.0 / medium.sigma_t().max_element()).max(origin.distance(sky.center))
    }

    /// Builds a scene; Embree builds with `threads` threads (0: all).
    ///
    /// # Errors
    /// Embree is missing, or out of memory.
    pub fn build(description: Description, threads: usize) -> Result<Scene> {
        build::build(description, threads)
    }

    /// A copy of the scene that knows where light arrives; `None` if nothing was learnt.
    pub fn with_learnt(&self, learnt: &LearntLight) -> Option<Scene> {
        (!learnt.is_empty()).then(|| Scene { lights: self.lights.clone().with_learnt(learnt), ..self.clone() })
    }

    /// A copy of the scene with other materials, medium and environment. The indices of refraction and the coatings of
    /// the new materials must be among those of the old ones.
    ///
    /// # Errors
    /// Embree is out of memory.
    pub fn with_materials(
        &self,
        materials: Materials,
        medium: Option<MediumParameters>,
        environment: Option<Environment>,
    ) -> Result<Scene> {
        build::rebuild_with_materials(self, materials, medium, environment)
    }

    /// Whether a ray that enters the solid at `surface` finds it present, not passed over by alpha, if the solid's
    /// alpha decides once per entry. `token` holds the random bits of the ray.
    pub fn solid_is_present(&self, surface: &Surface, token: u32) -> bool {
        let material = &self.materials.list[surface.material as usize];
        let chance = material.coverage(surface, &self.materials.textures);
        chance >= build::random_cutoff(token, surface.instance, u32::MAX)
    }

    /// Whether a path that starts in the solid bounded by `instance` finds it present, as [`Scene::solid_is_present`].
    pub fn starts_in_solid(&self, instance: u32, token: u32) -> bool {
        self.alpha_solids[instance as usize].chance >= build::random_cutoff(token, instance, u32::MAX - 1)
    }

    /// Whether a camera ray along `direction` passes through the surface, because glTF culls its back face.
    #[inline(always)]
    pub fn culls(&self, surface: &Surface, direction: Vec3) -> bool {
        self.survey.culled && self.materials.list[surface.material as usize].culled && direction.dot(surface.ng) > 0.0
    }

    /// Linkings that the instance (object) is part of ([`crate::geometry::Instance::linkings`]).
    #[inline]
    pub fn linkings(&self, instance: u32) -> u64 {
        if self.lights.links().is_empty() {
            return ALL_LINKINGS;
        }
        self.shapes.instances[instance as usize].linkings
    }

    /// Whether all rays pass through an instance, which is a light.
    pub fn passes(&self, instance: u32) -> bool {
        self.materials.list[self.shapes.instances[instance as usize].material as usize].null_bsdf
    }

    /// The name of a light in messages: `light "Sun"`, or `object "Panel"` for an emissive triangle or
    /// medium of the object.
    pub fn light_name(&self, index: usize) -> String {
        match self.lights.emitters()[index].owner() {
            Owner::Surface(instance) | Owner::Medium(instance) => {
                let instance = &self.shapes.instances[instance as usize];
                let kind = if instance.object < self.first_light_sphere { "object" } else { "light" };
                format!("{kind} \"{}\"", instance.name)
            }
            Owner::Environment => "the environment".into(),
            Owner::Light => {
                let environment = usize::from(self.lights.sky().shines());
                let first = self.lights.emitters().len() - environment - self.light_names.len();
                format!("light \"{}\"", self.light_names[index - first])
            }
        }
    }
}
