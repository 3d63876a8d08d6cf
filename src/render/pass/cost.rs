//! What an iteration costs, by counted work. The constants are core-seconds on the machine they were fitted on
//! (`scripts/lab.sh cost`); choices depend on their ratios.

use crate::camera::Camera;
use crate::estimator::InitialBandwidth;
use crate::estimator::bandwidth::footprint;
use crate::light::Guide;
use crate::plan::{ClassSet, Effect, PathClass, Search, classes_in};
use crate::render::settings::BandwidthRule;
use crate::render::settings::Candidate;
use crate::render::settings::Settings;
use crate::scene::{Scene, Survey};
use crate::transport::{CameraPaths, Indirect, InitialMedia, VertexCounts};

/// A ray from the eye, the pixel it belongs to and its statistics.
const EYE_PATH: f64 = 0.135e-6;
/// A vertex of an eye path with its light sample.
const EYE_VERTEX: f64 = 0.83e-6;
/// Of that, direct light at the first that has broad lobes.
const DIRECT: f64 = 0.2e-6;
/// Photons gathered at a vertex.
const GATHER: f64 = 0.047e-6;
/// The start of a light path.
const LIGHT_PATH: f64 = 0.17e-6;
/// What guiding adds to that.
const GUIDE: f64 = 0.11e-6;
/// A vertex of a light path, its photon, and its share of the map; in a medium much the same.
const LIGHT_VERTEX: f64 = 0.7e-6;
/// A vertex of either path where both are kept and their MIS weights with them.
const TWO_WAY_VERTEX: f64 = 0.78e-6;
/// A connection of two vertices.
const CONNECTION: f64 = 0.51e-6;
/// A vertex where photons to merge with are looked for.
const LOOK: f64 = 0.155e-6;
/// A photon that is merged.
const MERGE: f64 = 0.039e-6;
/// What counting photons adds to gathering them.
const COUNTING: f64 = 0.04e-6;
/// A vertex in a medium of an eye path; of either path where both are kept; a point that an eye path looks at on its
/// way through a medium, with the photons around it.
const EYE_MEDIUM: f64 = 0.89e-6;
const TWO_WAY_MEDIUM: f64 = 1.05e-6;
const ON_THE_WAY: f64 = 1.04e-6;
/// Times as much more a vertex takes whose material has textures.
const TEXTURED: f64 = 0.4;
/// Times as long where colours refract differently.
const DISPERSION: f64 = 1.1;
/// Rays take the longer the more triangles there are: these were fitted for so many, and their power is.
const TRIANGLES: f64 = 50_000.0;
const POWER: f64 = 0.1;
/// What the start of a guided light path costs, in vertices of one.
pub(super) const GUIDED_START: f64 = (LIGHT_PATH + GUIDE) / LIGHT_VERTEX;
/// Light that was scattered broadly, or in a medium, before it is where the eye looks; and where the eye looks by
/// narrow lobes.
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
pub(crate) struct Cost {
    /// Mean numbers of vertices of paths.
    pub lengths: VertexCounts,
    /// What there is.
    pub survey: Survey,
    /// Times as long as in a scene of [`TRIANGLES`] without dispersion.
    factor: f64,
}

impl Cost {
    /// Counts what paths of a view meet; light paths are guided if there is a guide.
    pub fn count(scene: &Scene, camera: &Camera, settings: &Settings, guide: Option<&Guide>) -> Cost {
        let initial_media = InitialMedia::of(scene, camera);
        let camera_paths =
            CameraPaths { indirect: Indirect::Photons, ..settings.camera_paths(scene, camera, &initial_media) };
        let reach = |length: f32| match settings.initial_bandwidth {
            InitialBandwidth::Fixed(radius) => radius,
            _ => footprint(camera, length),
        };
        let lengths = VertexCounts::new(&camera_paths, &initial_media, settings.seed, guide, reach);
        let triangles = scene.shapes.triangles().max(1) as f64;
        let dispersion = if scene.survey.dispersion { DISPERSION } else { 1.0 };
        Cost { lengths, survey: scene.survey, factor: dispersion * (triangles / TRIANGLES).powf(POWER) }
    }

    /// Core-seconds of an iteration of the camera's film: of a window, with the light paths of the whole picture.
    pub fn of_film(&self, candidate: Candidate, settings: &Settings, camera: &Camera) -> f64 {
        let [film, whole] = camera.sizes().map(|(width, height)| f64::from(width) * f64::from(height));
        let beyond = if candidate.method.walks_whole_picture() { whole - film } else { 0.0 };
        let VertexCounts { light, light_media, textured, .. } = self.lengths;
        let start = LIGHT_PATH + if candidate.guided { GUIDE } else { 0.0 };
        let path = start + light * TWO_WAY_VERTEX * (1.0 + TEXTURED * textured) + light_media * TWO_WAY_MEDIUM;
        self.of(candidate, settings, film) + beyond * path * self.factor
    }

    /// Core-seconds of an iteration of a picture of so many pixels, which is no window of another.
    pub fn of(&self, candidate: Candidate, settings: &Settings, pixels: f64) -> f64 {
        let VertexCounts { camera: camera_vertices, camera_to_broad, light, light_to_broad, merged, textured, .. } =
            self.lengths;
        let VertexCounts { camera_media, light_media, media_samples, camera_connectable, light_connectable, .. } =
            self.lengths;
        let paths = pixels * eye_paths(settings);
        // Photons that nobody wants are not sent, and light that was scattered before is not looked for in vain.
        let unwanted = candidate.method.gathers() && settings.photon_classes(&self.survey).is_empty();
        let photons = if unwanted { 0.0 } else { f64::from(settings.photons) };
        let wanted = |classes: ClassSet| !(settings.classes & classes_in(&self.survey) & classes).is_empty();
        let (camera_alone, camera_media_alone) =
            if wanted(SCATTERED) { (camera_vertices, camera_media) } else { (camera_to_broad, 0.0) };
        let scattered = wanted(SCATTERED.and(REFLECTED));
        let (light_alone, light_media_alone) = if scattered { (light, light_media) } else { (light_to_broad, 0.0) };
        let start = LIGHT_PATH + if candidate.guided { GUIDE } else { 0.0 };
        let [eye_vertex, light_vertex, two_way_vertex] =
            [EYE_VERTEX, LIGHT_VERTEX, TWO_WAY_VERTEX].map(|vertex| vertex * (1.0 + TEXTURED * textured));
        let gather = match candidate.method.rules() {
            _ if unwanted => 0.0,
            [BandwidthRule::ChiSquared] => GATHER + COUNTING,
            _ => GATHER,
        };
        let all = match (candidate.method, candidate.indirect) {
            (method, _) if method.search() == Search::CameraPaths => {
                pixels * (EYE_PATH + camera_alone * eye_vertex + camera_media_alone * EYE_MEDIUM)
            }
            (method, Indirect::Photons) if method.gathers() => {
                paths * (EYE_PATH + camera_to_broad * (eye_vertex + gather) + media_samples * ON_THE_WAY)
                    + photons * (start + light_alone * light_vertex + light_media_alone * LIGHT_VERTEX)
            }
            (method, Indirect::Paths) if method.gathers() => {
                paths * (EYE_PATH + camera_alone * eye_vertex + camera_connectable * gather)
                    + photons * (start + light_to_broad * light_vertex)
            }
            (method, _) => {
                // Without light that was scattered before, few pairs are left.
                let (from_camera, from_light) = match wanted(SCATTERED) {
                    true => (camera_connectable + camera_media, light_connectable + light_media),
                    false => (camera_to_broad, light_to_broad),
                };
                let merges = if method.has_bandwidths() { from_camera * LOOK + merged * MERGE } else { 0.0 };
                let vertices =
                    (camera_vertices + light) * two_way_vertex + (camera_media + light_media) * TWO_WAY_MEDIUM;
                paths * (EYE_PATH + start + vertices + from_camera * from_light * CONNECTION + merges)
            }
        };
        let left_out =
            if wanted(ClassSet::of(Effect::Direct)) { 0.0 } else { paths * camera_to_broad.min(1.0) * DIRECT };
        (all - left_out).max(0.0) * self.factor
    }
}
