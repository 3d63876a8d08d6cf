//! What an iteration costs, by counted work. The constants are core-seconds on the machine they were fitted on (`scripts/figures.sh cost`); choices depend
//! on their ratios.

use super::auto::Way;
use super::method::Method;
use super::output::Present;
use super::settings::Settings;
use crate::camera::Camera;
use crate::estimator::InitialBandwidth;
use crate::estimator::bandwidth::footprint;
use crate::light::Guide;
use crate::plan::{ClassSet, PathClass};
use crate::scene::Scene;
use crate::transport::{Eye, Indirect, Lengths, Surroundings};

/// A ray from the eye, the pixel it belongs to and its statistics.
const EYE_PATH: f64 = 0.43e-6;
/// A vertex of an eye path with its light sample.
const EYE_VERTEX: f64 = 0.63e-6;
/// Photons gathered at a vertex.
const GATHER: f64 = 0.07e-6;
/// The start of a light path.
const LIGHT_PATH: f64 = 0.06e-6;
/// What guiding adds to that.
const GUIDE: f64 = 0.09e-6;
/// A vertex of a light path, its photon, and its share of the map.
const LIGHT_VERTEX: f64 = 0.84e-6;
/// A vertex of either path where both are kept and their MIS weights with them.
const TWO_WAY_VERTEX: f64 = 0.65e-6;
/// A connection of two vertices.
const CONNECTION: f64 = 0.62e-6;
/// A vertex where photons to merge with are looked for.
const LOOK: f64 = 0.1e-6;
/// A photon that is merged.
const MERGE: f64 = 0.058e-6;
/// What counting photons adds to gathering them.
const COUNTING: f64 = 0.13e-6;
/// What the start of a guided light path costs, in vertices of one.
pub(super) const GUIDED_START: f64 = (LIGHT_PATH + GUIDE) / LIGHT_VERTEX;
/// Times as much where media scatter, of path tracing, where both paths are kept, and where photons are gathered: vertices on the way, which are not counted,
/// and paths that are longer.
const MEDIA: [f64; 3] = [2.8, 3.2, 2.0];

/// Light that was scattered broadly, or in a medium, before it is where the eye looks; and where the eye looks by narrow lobes.
const SCATTERED: ClassSet = ClassSet::one(PathClass::Indirect)
    .and(ClassSet::one(PathClass::IndirectFocus))
    .and(ClassSet::one(PathClass::Volume));
const REFLECTED: ClassSet = ClassSet::one(PathClass::ReflectedIndirect).and(ClassSet::one(PathClass::ReflectedFocus));

/// Eye paths of a pixel in an iteration.
fn eye_paths(settings: &Settings) -> f64 {
    if settings.levels.count > 1 && settings.levels.two_paths { 2.0 } else { 1.0 }
}

/// The counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cost {
    /// Mean numbers of vertices of paths.
    pub lengths: Lengths,
    /// What there is.
    pub present: Present,
}

impl Cost {
    /// Counts what paths of a view meet; light paths are guided if there is a guide.
    pub fn count(scene: &Scene, camera: &Camera, settings: &Settings, guide: Option<&Guide>) -> Cost {
        let surroundings = Surroundings::new(scene, camera.position());
        let Settings { max_depth, seed, classes, .. } = *settings;
        let eye = Eye { scene, camera, interior: surroundings.eye, max_depth, indirect: Indirect::Photons, classes };
        let reach = |length: f32| match settings.initial {
            InitialBandwidth::Fixed(radius) => radius,
            _ => footprint(camera, length),
        };
        let lengths = Lengths::new(&eye, &surroundings, seed, guide, reach);
        Cost { lengths, present: Present::of(scene) }
    }

    /// Core-seconds of an iteration of a picture of so many pixels.
    pub fn of(&self, way: Way, settings: &Settings, pixels: f64) -> f64 {
        let Lengths { eye, eye_to_broad, light, light_to_broad, eye_open, light_open, merged } = self.lengths;
        let paths = pixels * eye_paths(settings);
        // Photons that nobody wants are not sent, and light that was scattered before is not looked for in vain.
        let unwanted = way.method.gathers() && settings.of_photons(self.present).is_empty();
        let photons = if unwanted { 0.0 } else { f64::from(settings.photons) };
        let wanted = |classes: ClassSet| !(settings.classes & self.present.classes() & classes).is_empty();
        let eye_alone = if wanted(SCATTERED) { eye } else { eye_to_broad };
        let light_alone = if wanted(SCATTERED.and(REFLECTED)) { light } else { light_to_broad };
        let start = LIGHT_PATH + if way.guided { GUIDE } else { 0.0 };
        let gather = match way.method {
            _ if unwanted => 0.0,
            Method::Cppm => GATHER + COUNTING,
            _ => GATHER,
        };
        let seconds = match (way.method, way.indirect) {
            (Method::Path, _) => pixels * (EYE_PATH + eye_alone * EYE_VERTEX),
            (method, Indirect::Photons) if method.gathers() => {
                paths * (EYE_PATH + eye_to_broad * (EYE_VERTEX + gather))
                    + photons * (start + light_alone * LIGHT_VERTEX)
            }
            (method, Indirect::Paths) if method.gathers() => {
                paths * (EYE_PATH + eye_alone * EYE_VERTEX + eye_open * gather)
                    + photons * (start + light_to_broad * LIGHT_VERTEX)
            }
            (method, _) => {
                let merges = if method.has_bandwidths() { eye_open * LOOK + merged * MERGE } else { 0.0 };
                let both = EYE_PATH + start + (eye + light) * TWO_WAY_VERTEX;
                paths * (both + eye_open * light_open * CONNECTION + merges)
            }
        };
        seconds * self.media(way.method)
    }

    fn media(&self, method: Method) -> f64 {
        match method {
            _ if !self.present.volume => 1.0,
            Method::Path => MEDIA[0],
            method if method.gathers() => MEDIA[2],
            _ => MEDIA[1],
        }
    }
}
