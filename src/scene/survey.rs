//! Kinds of things that a scene contains.

use crate::light::{Light, Lights};
use crate::material::{Alpha, MediumParameters, Objects};

/// Which kinds of things a scene contains; each field is true if there is at least one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Survey {
    /// Whether some material has alpha cut-outs or blending.
    pub alpha: bool,
    /// Whether some instance is hidden from cameras.
    pub hidden_from_camera: bool,
    /// Whether some solid is hidden from cameras.
    pub hidden_solids: bool,
    /// Whether camera rays pass through the back faces of some surface.
    pub culled: bool,
    /// Whether some mesh bounds a solid that light enters.
    pub solids: bool,
    /// Whether rays may cross boundaries that do not scatter: index-matched solids, solids inside others, solids with
    /// alpha.
    pub null_boundaries: bool,
    /// Whether some medium absorbs or scatters.
    pub media: bool,
    /// Whether the density of some medium varies.
    pub grids: bool,
    /// Whether some medium emits light.
    pub fire: bool,
    /// Whether some medium scatters.
    pub scattering: bool,
    /// Whether some solid of clear glass contains a medium that scatters.
    pub cloudy_glass: bool,
    /// Whether some solid refracts with dispersion.
    pub dispersion: bool,
    /// Whether some surface may have narrow lobes: mirrors, glass, glossy materials.
    pub narrow_lobes: bool,
    /// Whether sharp lobes may reflect lights of finite size by way of perfect mirrors or clear glass.
    pub glints: bool,
    /// Whether some light is a delta light, which no ray can hit.
    pub delta_lights: bool,
    /// Whether some light is at infinity.
    pub infinite_lights: bool,
    /// Whether only some objects block the light of some light.
    pub shadow_links: bool,
    /// Whether some solid does not block the light of some light.
    pub unlinked_solids: bool,
    /// Whether some instance is a shadow catcher.
    pub catchers: bool,
    /// Whether some instance is a holdout.
    pub holdouts: bool,
    /// Whether the scene has an environment that cameras see.
    pub environment: bool,
}

impl Survey {
    /// Whether the first surface on a shadow ray always blocks it, and media do not attenuate it, unless surfaces touch
    /// at one of its ends.
    #[inline]
    pub fn shadow_rays_end_at_surfaces(&self) -> bool {
        !(self.media || self.null_boundaries || self.culled || self.hidden_solids || self.unlinked_solids)
    }

    /// Whether only path tracing renders the scene.
    pub fn needs_camera_paths(&self) -> bool {
        self.catchers || self.shadow_links
    }

    /// Finds out which kinds of things a scene contains.
    pub fn new(objects: Objects<'_>, lights: &Lights, medium: Option<MediumParameters>) -> Survey {
        let scatters = |medium: &Option<MediumParameters>| medium.is_some_and(|medium| medium.scatters());
        let blockers = lights.links().blockers();
        let mut survey = Survey {
            media: medium.is_some(),
            scattering: scatters(&medium),
            shadow_links: blockers != 0,
            environment: lights.sky().environment.is_some() && !lights.sky().hidden_from_camera,
            ..Survey::default()
        };
        let mut uses = vec![0usize; objects.materials.list.len()];
        for instance in &objects.shapes.instances {
            uses[instance.material as usize] += 1;
            survey.hidden_from_camera |= instance.hidden_from_camera;
            survey.hidden_solids |= instance.hidden_from_camera && objects.material(instance).is_solid();
            survey.unlinked_solids |= blockers & !instance.linkings != 0 && objects.material(instance).is_solid();
            survey.catchers |= instance.shadow_catcher;
            survey.holdouts |= instance.holdout;
        }
        let (mut solids, mut perfect, mut sharp) = (0, false, false);
        for (material, &uses) in objects.materials.list.iter().zip(&uses) {
            if uses == 0 {
                continue;
            }
            survey.culled |= material.culled;
            survey.alpha |= material.alpha != Alpha::Opaque;
            survey.narrow_lobes |= material.is_glossy() || material.transmission.factor > 0.0;
            let lobes = material.perfect_and_sharp();
            (perfect, sharp) = (perfect | lobes.0, sharp | lobes.1);
            if material.is_solid() {
                solids += uses;
                survey.media |= material.medium.is_some();
                survey.grids |= material.medium.is_some() && material.grids.is_some();
                survey.fire |= material.medium_emission().is_some();
                let scatters = scatters(&material.medium);
                survey.scattering |= scatters;
                survey.cloudy_glass |= scatters && material.transmission.factor > 0.0 && material.ior != 1.0 && lobes.0;
                survey.null_boundaries |= material.ior == 1.0 || material.has_alpha_per_entry();
                survey.dispersion |= material.disperses();
            }
        }
        survey.solids = solids > 0;
        survey.null_boundaries |= solids > 1;
        for emitter in lights.emitters() {
            survey.delta_lights |= emitter.is_delta();
            survey.glints |= perfect && sharp && !emitter.is_delta();
            survey.infinite_lights |= emitter.is_infinite();
        }
        survey
    }
}
