//! The scene: read from a file into a plain [`Description`], then validated and committed into a [`Scene`].

mod build;
mod camera_request;
pub mod contact;
mod contacts;
mod dense;
pub mod description;
pub mod environment_file;
mod folder;
pub mod gltf;
mod nesting;
mod survey;
pub mod usd;
mod view;

pub use camera_request::{CameraRequest, Crop, MAX_SIZE};
pub use contacts::Contacts;
pub use description::Description;
pub use nesting::{EMPTY_STACK, SolidStack, SolidStacks};
pub use survey::Survey;
pub use view::View;

use crate::error::Result;
use crate::geometry::{Shapes, Surface};
use crate::light::{Emitter, Environment, Lights};
use crate::material::{Materials, MediumParameters, Scattering};
use crate::math::{DVec3, Vec3};
use crate::trace::Tracer;
use description::{CameraDescription, GuessedUnits, PictureDefaults};
use std::path::PathBuf;
use std::sync::Arc;

/// A validated, immutable scene; it owns everything a pass reads.
pub struct Scene {
    /// The file it came from.
    pub source: PathBuf,
    /// Hash of what a converter has made of it, see [`Description::converted`].
    pub converted: Option<String>,
    /// What was subtracted from all world positions: not zero only for scenes far from the origin.
    pub origin: DVec3,
    /// Meshes and instances.
    pub shapes: Arc<Shapes>,
    /// Materials and textures.
    pub materials: Arc<Materials>,
    /// Names of objects.
    pub objects: Vec<String>,
    /// Objects from this one on are spheres, made for point lights that have a radius.
    pub first_lamp: u32,
    /// Geometry in Embree: all that has a body.
    pub tracer: Tracer,
    /// What glows without a body ([`crate::material::Material::null_bsdf`]), if anything does.
    pub pass_through_lights: Option<Tracer>,
    /// Lights.
    pub lights: Lights,
    /// Names of the lights that are not triangles: points, spots and suns, in the order of [`Lights::emitters`].
    pub light_names: Vec<String>,
    /// In what units the numbers of punctual lights were taken, where that is a guess.
    pub guessed_units: Option<GuessedUnits>,
    /// Light from infinity may be missing: the file's writer leaves it out, and nothing there says that there is none.
    pub environment_unknown: bool,
    /// Cameras as described, in the file's order.
    pub cameras: Vec<CameraDescription>,
    /// The picture that the scene was made for.
    pub picture: PictureDefaults,
    /// The medium that fills the space.
    pub medium: Option<MediumParameters>,
    /// How the materials scatter.
    pub scattering: Scattering,
    /// What is present.
    pub survey: Survey,
    /// Triangles that others may lie on.
    pub contacts: Arc<Contacts>,
    /// Ranks of the instances' solids, where several of one priority overlap: the highest fills the space.
    pub ranks: Arc<[u32]>,
    /// Deep stacks of solids that paths have been in.
    pub solid_stacks: SolidStacks,
    /// Whatever was ignored or approximated, from the reader and from building.
    pub warnings: Vec<String>,
}

impl Scene {
    /// Distance from the middle of the scene up to which paths from `origin` are as near as can be to all that they may
    /// bring light from or to: that of the scene, of their first flight, or of where they start; infinite where no
    /// medium scatters outside of solids.
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

    /// The same shapes and lamps with other materials, in another medium and environment. The materials have indices of
    /// refraction and coverings of those here.
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

    /// Whether a ray that enters a solid finds it there, where the solid's alpha decides about that.
    pub fn solid_is_present(&self, surface: &Surface, token: u32) -> bool {
        let material = &self.materials.list[surface.material as usize];
        let chance = material.coverage(surface, &self.materials.textures);
        chance >= build::random_cutoff(token, surface.instance, u32::MAX)
    }

    /// Whether a camera's ray along `direction` looks through a surface: the back of one that glTF culls.
    #[inline(always)]
    pub fn culls(&self, surface: &Surface, direction: Vec3) -> bool {
        self.survey.culled && self.materials.list[surface.material as usize].culled && direction.dot(surface.ng) > 0.0
    }

    /// A light by name, for messages: `light "Sun"`, `object "Panel"` for the triangles of one that glows.
    pub fn light_name(&self, index: usize) -> String {
        match &self.lights.emitters()[index] {
            Emitter::Triangle { instance, .. } => {
                let instance = &self.shapes.instances[*instance as usize];
                let kind = if instance.object < self.first_lamp { "object" } else { "light" };
                format!("{kind} \"{}\"", instance.name)
            }
            Emitter::Environment => "the environment".into(),
            Emitter::Point { .. } | Emitter::Spot { .. } | Emitter::Sun { .. } => {
                let environment = usize::from(self.lights.sky().environment.is_some());
                let first = self.lights.emitters().len() - environment - self.light_names.len();
                format!("light \"{}\"", self.light_names[index - first])
            }
        }
    }
}
