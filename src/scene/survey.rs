//! What a scene contains, from the scene alone.

use crate::geometry::Shapes;
use crate::light::{Emitter, Lights};
use crate::material::{Alpha, Materials, MediumParameters};

/// Kinds of things present in a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Survey {
    alpha: bool,
    /// Some mesh bounds a solid that light enters.
    pub solids: bool,
    /// Rays may cross boundaries that do not scatter: index-matched solids, or solids inside others.
    pub null_boundaries: bool,
    media: bool,
    scattering: bool,
    dispersion: bool,
    /// Some surface may have narrow lobes: mirrors, glass, what shines.
    pub narrow_lobes: bool,
    /// Sharp lobes may show lamps that have a size, by way of perfect mirrors or clear glass.
    pub glints: bool,
    /// Some light cannot be hit by a ray.
    pub delta_lights: bool,
    /// Light comes from infinity.
    pub infinite_lights: bool,
}

/// The program has all effects. Without some of them, only to measure what they cost scenes that do not call for them, it refuses scenes that do.
const COMPLETE: bool = !cfg!(feature = "bare");

impl Survey {
    /// Some material has alpha cut-outs or blending.
    #[inline(always)]
    pub fn alpha(&self) -> bool {
        COMPLETE && self.alpha
    }

    /// Something absorbs or scatters between surfaces.
    #[inline(always)]
    pub fn media(&self) -> bool {
        COMPLETE && self.media
    }

    /// Something scatters between surfaces.
    #[inline(always)]
    pub fn scattering(&self) -> bool {
        COMPLETE && self.scattering
    }

    /// Some solid refracts colours differently.
    #[inline(always)]
    pub fn dispersion(&self) -> bool {
        COMPLETE && self.dispersion
    }

    /// What the scene calls for and the program lacks.
    pub(super) fn lacking(&self, materials: &Materials, lenses: bool) -> Option<&'static str> {
        let textures = !materials.textures.is_empty();
        let all = [
            (self.alpha, "alpha"),
            (self.media, "media"),
            (self.dispersion, "dispersion"),
            (textures, "textures"),
            (lenses, "lenses"),
        ];
        all.into_iter().find(|(called_for, _)| !COMPLETE && *called_for).map(|(_, name)| name)
    }

    /// Looks through the scene.
    pub fn new(shapes: &Shapes, materials: &Materials, lights: &Lights, medium: Option<MediumParameters>) -> Survey {
        let scatters = |medium: &Option<MediumParameters>| medium.is_some_and(|medium| medium.scatters());
        let mut survey = Survey { media: medium.is_some(), scattering: scatters(&medium), ..Survey::default() };
        let mut worn = vec![0usize; materials.list.len()];
        for instance in &shapes.instances {
            worn[instance.material as usize] += 1;
        }
        let (mut solids, mut perfect, mut sharp) = (0, false, false);
        for (material, &worn) in materials.list.iter().zip(&worn) {
            if worn == 0 {
                continue;
            }
            survey.alpha |= material.alpha != Alpha::Opaque;
            survey.narrow_lobes |= material.is_glossy() || material.transmission > 0.0;
            let lobes = material.perfect_and_sharp();
            (perfect, sharp) = (perfect | lobes.0, sharp | lobes.1);
            if material.is_solid_glass() {
                solids += worn;
                survey.media |= material.medium.is_some();
                survey.scattering |= scatters(&material.medium);
                survey.null_boundaries |= material.ior == 1.0;
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
