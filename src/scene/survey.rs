//! What a scene contains, from the scene alone.

use crate::geometry::Shapes;
use crate::light::{Emitter, Lights};
use crate::material::{Alpha, Materials, MediumParameters};

/// Kinds of things present in a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Survey {
    /// Some material has alpha cut-outs or blending.
    pub alpha: bool,
    /// Something is hidden from cameras.
    pub hidden_from_camera: bool,
    /// Cameras look through the back faces of something.
    pub culled: bool,
    /// Some mesh bounds a solid that light enters.
    pub solids: bool,
    /// Rays may cross boundaries that do not scatter: index-matched solids, solids inside others or there in part.
    pub null_boundaries: bool,
    /// Something absorbs or scatters between surfaces.
    pub media: bool,
    /// Something scatters between surfaces.
    pub scattering: bool,
    /// Clear glass holds a medium that scatters.
    pub cloudy_glass: bool,
    /// Some solid refracts colours differently.
    pub dispersion: bool,
    /// Some surface may have narrow lobes: mirrors, glass, what shines.
    pub narrow_lobes: bool,
    /// Sharp lobes may show lamps that have a size, by way of perfect mirrors or clear glass.
    pub glints: bool,
    /// Some light cannot be hit by a ray.
    pub delta_lights: bool,
    /// Light comes from infinity.
    pub infinite_lights: bool,
    /// An environment shines that cameras see.
    pub environment: bool,
}

impl Survey {
    /// Looks through the scene.
    pub fn new(shapes: &Shapes, materials: &Materials, lights: &Lights, medium: Option<MediumParameters>) -> Survey {
        let scatters = |medium: &Option<MediumParameters>| medium.is_some_and(|medium| medium.scatters());
        let mut survey = Survey {
            media: medium.is_some(),
            scattering: scatters(&medium),
            environment: lights.sky().environment.is_some() && !lights.sky().hidden_from_camera,
            ..Survey::default()
        };
        let mut worn = vec![0usize; materials.list.len()];
        for instance in &shapes.instances {
            worn[instance.material as usize] += 1;
            survey.hidden_from_camera |= instance.hidden_from_camera;
        }
        let (mut solids, mut perfect, mut sharp) = (0, false, false);
        for (material, &worn) in materials.list.iter().zip(&worn) {
            if worn == 0 {
                continue;
            }
            survey.culled |= material.culled;
            survey.alpha |= material.alpha != Alpha::Opaque;
            survey.narrow_lobes |= material.is_glossy() || material.transmission > 0.0;
            let lobes = material.perfect_and_sharp();
            (perfect, sharp) = (perfect | lobes.0, sharp | lobes.1);
            if material.is_solid_glass() {
                solids += worn;
                survey.media |= material.medium.is_some();
                let scatters = scatters(&material.medium);
                survey.scattering |= scatters;
                survey.cloudy_glass |= scatters && material.ior != 1.0 && lobes.0;
                survey.null_boundaries |= material.ior == 1.0 || material.has_alpha_per_entry();
                survey.dispersion |= material.disperses();
            }
        }
        survey.solids = solids > 0;
        survey.null_boundaries |= solids > 1;
        for emitter in lights.emitters() {
            survey.delta_lights |= emitter.is_delta();
            survey.glints |= perfect && sharp && !emitter.is_delta();
            survey.infinite_lights |= matches!(emitter, Emitter::Sun { .. } | Emitter::Environment);
        }
        survey
    }
}
