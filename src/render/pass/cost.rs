//! Counted cost of an iteration: numbers of vertices times constants. The constants are core-seconds, fitted on one
//! machine by `cargo bench --bench cost`; choices depend on their ratios only.

use crate::camera::Camera;
use crate::light::Guide;
use crate::path_class::{ClassSet, Effect, PathClass, classes_in};
use crate::plan::Search;
use crate::render::initial_bandwidth::{InitialBandwidth, footprint};
use crate::render::settings::{BandwidthRule, Candidate, Settings};
use crate::scene::{Scene, Survey};
use crate::transport::{CameraPaths, Indirect, InitialMedia, VertexCounts};

/// Core-seconds for the start of a camera path: its ray, the pixel, and the pixel's statistics.
const CAMERA_PATH: f64 = 0.135e-6;
/// Core-seconds for a vertex of a camera path with its light sample.
const CAMERA_VERTEX: f64 = 0.83e-6;
/// Core-seconds for the light sample at the first vertex with broad lobes, included in [`CAMERA_VERTEX`].
const DIRECT_LIGHT: f64 = 0.2e-6;
/// Core-seconds for the gathering of photons at a vertex.
const GATHER: f64 = 0.047e-6;
/// Core-seconds for the start of a light path.
const LIGHT_PATH: f64 = 0.17e-6;
/// Core-seconds for the guiding of a light path's start, on top of [`LIGHT_PATH`].
const GUIDE: f64 = 0.11e-6;
/// Core-seconds for a vertex of a light path with its photon and the photon's share of building the map, on surfaces
/// and in media.
const LIGHT_VERTEX: f64 = 0.7e-6;
/// Core-seconds for a vertex of a camera or light path in methods that store both with their MIS weights.
const TWO_WAY_VERTEX: f64 = 0.78e-6;
/// Core-seconds for a vertex of a camera path with MIS weights and hardly any connections or merges. Roulette spares such
/// paths longer than the counted ones, as in path tracing; their vertices count here.
const UNCONNECTED_VERTEX: f64 = 0.92e-6;
/// Core-seconds for the connection of two vertices.
const CONNECTION: f64 = 0.51e-6;
/// Core-seconds for the query for photons to merge with at a vertex.
const MERGE_QUERY: f64 = 0.155e-6;
/// Core-seconds for the merging of one photon.
const MERGE: f64 = 0.039e-6;
/// Core-seconds for the counting of photons at a vertex, on top of [`GATHER`].
const COUNTING: f64 = 0.04e-6;
/// Core-seconds for a vertex of a camera path in a medium.
const CAMERA_MEDIUM_VERTEX: f64 = 0.89e-6;
/// Core-seconds for a vertex in a medium of a camera or light path in methods that store both.
const TWO_WAY_MEDIUM_VERTEX: f64 = 1.05e-6;
/// Core-seconds for a point on a camera ray through a medium, with the photons gathered around it.
const MEDIUM_SAMPLE: f64 = 1.04e-6;
/// Extra cost of a vertex on a textured surface, relative to an untextured one.
const TEXTURED: f64 = 0.4;
/// Factor on all costs in a scene with dispersion.
const DISPERSION: f64 = 1.1;
/// Number of triangles in the scenes that the constants were fitted in.
const FITTED_TRIANGLES: f64 = 50_000.0;
/// Exponent of the number of triangles: costs grow as the number to this power.
const TRIANGLES_POWER: f64 = 0.1;
/// Cost of the start of a guided light path, in units of the cost of a light path's vertex.
pub(super) const GUIDED_START: f64 = (LIGHT_PATH + GUIDE) / LIGHT_VERTEX;
/// Classes of light that a broad lobe or a medium has scattered before it arrives at the surface that the camera path
/// sees.
const SCATTERED: ClassSet = ClassSet::one(PathClass::Indirect)
    .and(ClassSet::one(PathClass::IndirectFocus))
    .and(ClassSet::one(PathClass::Volume));
/// Classes of scattered light that the camera sees by narrow lobes.
const REFLECTED: ClassSet = ClassSet::one(PathClass::ReflectedIndirect).and(ClassSet::one(PathClass::ReflectedFocus));

/// Camera paths per pixel in an iteration.
fn camera_paths_per_pixel(settings: &Settings) -> f64 {
    if settings.levels.count > 1 && settings.levels.two_paths { 2.0 } else { 1.0 }
}

fn light_start_seconds(candidate: Candidate) -> f64 {
    LIGHT_PATH + if candidate.guided { GUIDE } else { 0.0 }
}

/// Cost model of an iteration, by the counted vertices of sampled paths of a scene and camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cost {
    /// Mean numbers of vertices per camera path and light path.
    counts: VertexCounts,
    /// Features of the scene.
    survey: Survey,
    /// Cost relative to a scene of [`FITTED_TRIANGLES`] without dispersion.
    factor: f64,
}

impl Cost {
    /// Counts the vertices of sampled paths of the scene from the camera. Light paths are guided if there is a guide.
    pub fn count(scene: &Scene, camera: &Camera, settings: &Settings, guide: Option<&Guide>) -> Cost {
        let initial_media = InitialMedia::of(scene, camera);
        let camera_paths =
            CameraPaths { indirect: Indirect::Photons, ..settings.camera_paths(scene, camera, &initial_media) };
        let reach = |length: f32| match settings.initial_bandwidth {
            InitialBandwidth::Fixed(bandwidth) => bandwidth,
            _ => footprint(camera, length),
        };
        let counts = VertexCounts::new(&camera_paths, &initial_media, settings.seed, guide, reach);
        let triangles = scene.shapes.triangles().max(1) as f64;
        let dispersion = if scene.survey.dispersion { DISPERSION } else { 1.0 };
        let factor = dispersion * (triangles / FITTED_TRIANGLES).powf(TRIANGLES_POWER);
        Cost { counts, survey: scene.survey, factor }
    }

    /// Core-seconds of an iteration of the camera's film with the candidate's method. If the film is a window, some
    /// methods also trace the light paths of the whole picture.
    pub fn film_seconds(&self, candidate: Candidate, settings: &Settings, camera: &Camera) -> f64 {
        let [film, whole] = camera.sizes().map(|(width, height)| f64::from(width) * f64::from(height));
        let outside = if settings.method.walks_whole_picture() { whole - film } else { 0.0 };
        let outside = outside * settings.counts.light_paths_per_pixel();
        let VertexCounts { light, light_media, textured, .. } = self.counts;
        let path = light_start_seconds(candidate)
            + light * TWO_WAY_VERTEX * (1.0 + TEXTURED * textured)
            + light_media * TWO_WAY_MEDIUM_VERTEX;
        self.iteration_seconds(candidate, settings, film) + outside * path * self.factor
    }

    /// Core-seconds of an iteration of a whole picture of `pixels` pixels with the candidate's method.
    pub fn iteration_seconds(&self, candidate: Candidate, settings: &Settings, pixels: f64) -> f64 {
        let camera_paths = pixels * camera_paths_per_pixel(settings);
        let method = settings.method;
        let sum = if method.search() == Search::CameraPaths {
            pixels * self.path_tracing_seconds(settings)
        } else if method.gathers() {
            let camera = camera_paths * self.gathering_path_seconds(candidate, settings);
            camera + self.light_paths(settings) * self.photon_path_seconds(candidate, settings)
        } else {
            camera_paths * self.two_way_seconds(candidate, settings)
        };
        let unused = if self.finds_any(settings, ClassSet::of(Effect::Direct)) {
            0.0
        } else {
            camera_paths * self.counts.camera_to_broad.min(1.0) * DIRECT_LIGHT
        };
        (sum - unused).max(0.0) * self.factor
    }

    /// Whether the render finds light of any of these classes and the scene has it.
    fn finds_any(&self, settings: &Settings, classes: ClassSet) -> bool {
        !(settings.classes & classes_in(&self.survey) & classes).is_empty()
    }

    /// Number of light paths in an iteration of a method that gathers photons; 0 if no class of light needs photons.
    fn light_paths(&self, settings: &Settings) -> f64 {
        if settings.photon_classes(&self.survey).is_empty() { 0.0 } else { f64::from(settings.photons) }
    }

    /// Mean cost of a vertex on a surface that costs `vertex` without textures, as a share of the vertices is textured.
    fn textured(&self, vertex: f64) -> f64 {
        vertex * (1.0 + TEXTURED * self.counts.textured)
    }

    /// Core-seconds of a camera path that is not connected to a light path. Without scattered light it ends at the
    /// first broad lobe.
    fn path_tracing_seconds(&self, settings: &Settings) -> f64 {
        let (vertices, media) = self.camera_vertices(settings);
        CAMERA_PATH + vertices * self.textured(CAMERA_VERTEX) + media * CAMERA_MEDIUM_VERTEX
    }

    /// Mean numbers of vertices on surfaces and in media of a camera path that is not connected to a light path.
    fn camera_vertices(&self, settings: &Settings) -> (f64, f64) {
        let VertexCounts { camera, camera_media, camera_to_broad, .. } = self.counts;
        if self.finds_any(settings, SCATTERED) { (camera, camera_media) } else { (camera_to_broad, 0.0) }
    }

    /// Core-seconds of a camera path that gathers photons.
    fn gathering_path_seconds(&self, candidate: Candidate, settings: &Settings) -> f64 {
        let VertexCounts { camera_to_broad, camera_connectable, media_samples, .. } = self.counts;
        let gather = match settings.method.rules() {
            _ if settings.photon_classes(&self.survey).is_empty() => 0.0,
            [BandwidthRule::ChiSquared] => GATHER + COUNTING,
            _ => GATHER,
        };
        let vertex = self.textured(CAMERA_VERTEX);
        match candidate.indirect {
            Indirect::Photons => CAMERA_PATH + camera_to_broad * (vertex + gather) + media_samples * MEDIUM_SAMPLE,
            Indirect::Paths => CAMERA_PATH + self.camera_vertices(settings).0 * vertex + camera_connectable * gather,
        }
    }

    /// Core-seconds of a light path that stores photons. Without scattered light it ends at the first broad lobe.
    fn photon_path_seconds(&self, candidate: Candidate, settings: &Settings) -> f64 {
        let VertexCounts { light, light_media, light_to_broad, .. } = self.counts;
        let (start, vertex) = (light_start_seconds(candidate), self.textured(LIGHT_VERTEX));
        match candidate.indirect {
            Indirect::Photons => {
                let scattered = self.finds_any(settings, SCATTERED.and(REFLECTED));
                let (vertices, media) = if scattered { (light, light_media) } else { (light_to_broad, 0.0) };
                start + vertices * vertex + media * LIGHT_VERTEX
            }
            Indirect::Paths => start + light_to_broad * vertex,
        }
    }

    /// Core-seconds of a camera path with its connections, its merges and its share of the light paths. Without
    /// scattered light few pairs of vertices are connected.
    fn two_way_seconds(&self, candidate: Candidate, settings: &Settings) -> f64 {
        let VertexCounts { camera, camera_media, camera_to_broad, light, light_media, light_to_broad, .. } =
            self.counts;
        let VertexCounts { camera_connectable, light_connectable, merged, .. } = self.counts;
        let (from_camera, from_light) = if self.finds_any(settings, SCATTERED) {
            (camera_connectable + camera_media, light_connectable + light_media)
        } else {
            (camera_to_broad, light_to_broad)
        };
        let light_paths = settings.counts.light_paths_per_pixel();
        let merges = if settings.method.has_bandwidths() {
            f64::from(settings.counts.merging) * (from_camera * MERGE_QUERY + light_paths * merged * MERGE)
        } else {
            0.0
        };
        let light_vertices = light * self.textured(TWO_WAY_VERTEX) + light_media * TWO_WAY_MEDIUM_VERTEX;
        let light_path = light_start_seconds(candidate) + light_vertices;
        let alone = settings.counts.leave_camera_paths_alone(settings.method.has_bandwidths());
        let vertex = if alone { UNCONNECTED_VERTEX } else { TWO_WAY_VERTEX };
        let camera_vertices = camera * self.textured(vertex) + camera_media * TWO_WAY_MEDIUM_VERTEX;
        let connections = f64::from(settings.counts.connections) * from_camera * from_light * CONNECTION;
        CAMERA_PATH + camera_vertices + light_paths * light_path + connections + merges
    }
}
