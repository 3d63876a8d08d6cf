//! The starts of camera paths, and what all camera paths of a render share.

use super::PathStart;
use super::initial_media::InitialMedium;
use super::pixel_sample::PixelSample;
use super::segment::{HOLE, PrecomputedHit, camera_token};
use crate::camera::{Camera, GROUP_SIZE, TilePixel};
use crate::math::{Rgb, Vec2, Vec3};
use crate::path_class::{ClassSet, PathClass};
use crate::photon::ByKind;
use crate::random::{Purpose, Stream, Streams};
use crate::scene::Scene;
use crate::spectrum::WavelengthSample;
use crate::stop::Stop;
use crate::trace::Ray;
use serde::{Deserialize, Serialize};

/// Technique for light that was scattered broadly before it arrives at the camera path's first broad bounce.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Indirect {
    /// Photons
    #[default]
    Photons,
    /// Camera paths, which go on; photons bring caustics alone
    Paths,
}

impl Indirect {
    /// For each kind of photons, whether they are needed to find light of the path classes in `wanted`.
    pub fn kinds(self, wanted: ClassSet) -> ByKind<bool> {
        let caustics: ClassSet = match self {
            Indirect::Photons => [PathClass::Caustic, PathClass::Sds].into_iter().collect(),
            Indirect::Paths => ClassSet::ALL,
        };
        let others = PathClass::ALL.into_iter().any(|class| wanted.has(class) && !caustics.has(class));
        [others, !(wanted & caustics).is_empty()]
    }
}

/// The start of a camera path.
pub struct CameraPathStart {
    /// The first ray.
    pub ray: PathStart,
    /// The random numbers of the path.
    pub stream: Stream,
}

/// Settings and shared data of all camera paths of a render.
#[derive(Clone, Copy)]
pub struct CameraPaths<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The camera.
    pub camera: &'a Camera,
    /// The solids around the origins of camera rays.
    pub interior: InitialMedium,
    /// Largest number of segments of a path.
    pub max_depth: u32,
    /// Number of smooth interfaces at which a path may be split into reflection and transmission; 0 for paths of one
    /// branch.
    pub splits: u32,
    /// Technique for indirect light in methods that gather photons.
    pub indirect: Indirect,
    /// Classes of paths (by kinds of bounces) whose light the picture shows.
    pub classes: ClassSet,
    /// Whether the light is recorded by the lobe of the first hit, too.
    pub lobes: bool,
    /// The switch that aborts an iteration before its end; `None` if there is none.
    pub stop: Option<&'a Stop>,
}

impl CameraPaths<'_> {
    /// Whether the current iteration is aborted before its end.
    #[inline]
    pub fn is_given_up(&self) -> bool {
        self.stop.is_some_and(Stop::should_abort)
    }

    /// Whether the user has stopped the render. Work before the first iteration, which has no deadline, polls this.
    #[inline]
    pub fn is_stopped(&self) -> bool {
        self.stop.is_some_and(Stop::requested)
    }

    /// Depth along the camera axis and position of the first hit of a sample (scene units, in the coordinates of the
    /// scene file); `None` if it hits nothing.
    pub fn first_hit(&self, sample: &PixelSample) -> Option<(f32, Vec3)> {
        let p = sample.first.filter(|first| first.instance != HOLE)?.p;
        Some((self.camera.depth(p), (p.as_dvec3() + self.scene.origin).as_vec3()))
    }

    /// The first ray of a camera path through a uniform point of pixel `(x, y)`.
    #[inline]
    pub fn start(&self, pixel: (u32, u32), stream: Stream) -> PathStart {
        self.start_at(pixel, stream.vertex(0).two(Purpose::Pixel), stream)
    }

    /// The first ray of a camera path through the point of pixel `(x, y)` that `within`, uniform on the unit square,
    /// selects.
    #[inline]
    pub fn start_at(&self, pixel: (u32, u32), within: Vec2, stream: Stream) -> PathStart {
        self.start_from(self.camera.film_point(pixel, within), stream)
    }

    /// The first ray of a camera path through a point of the whole picture (pixels).
    #[inline]
    pub fn start_from(&self, film: Vec2, stream: Stream) -> PathStart {
        let draws = stream.vertex(0);
        let ray = self.camera.ray(film, draws.two(Purpose::Lens));
        let interior = self.interior.at(self.scene, ray.origin).decided(self.scene, draws);
        let seen = if self.scene.survey.hidden_solids { interior.seen_radiance(self.scene) } else { 1.0 };
        PathStart {
            origin: ray.origin,
            direction: ray.direction,
            throughput: Rgb::splat(if ray.seen { seen } else { 0.0 }),
            interior,
            leaving: None,
            first: PrecomputedHit::Unknown,
            far: false,
            channel: None,
            wavelength_sample: WavelengthSample::new(draws.one(Purpose::Wavelength)),
            linked: None,
        }
    }

    /// The starts of the camera paths of neighbouring pixels, whose first rays are traced together.
    #[inline]
    pub fn starts(
        &self,
        places: &[Option<TilePixel>; GROUP_SIZE],
        streams: Streams,
    ) -> [Option<CameraPathStart>; GROUP_SIZE] {
        self.starts_through(places, streams, streams)
    }

    /// The starts of the camera paths of neighbouring pixels. `film` draws the points on film and lens, `streams` all
    /// other random numbers.
    pub fn starts_through(
        &self,
        places: &[Option<TilePixel>; GROUP_SIZE],
        film: Streams,
        streams: Streams,
    ) -> [Option<CameraPathStart>; GROUP_SIZE] {
        let mut starts = [const { None }; GROUP_SIZE];
        for (start, place) in starts.iter_mut().zip(places) {
            if let Some(place) = place {
                let key = self.camera.pixel_key(place.pixel);
                let stream = streams.path(key);
                let first = PrecomputedHit::Nothing;
                let film = film.path(key);
                let ray = PathStart { first, ..self.start(place.pixel, film) };
                *start = Some(CameraPathStart { ray, stream });
            }
        }
        let mut hits = [const { None }; GROUP_SIZE];
        let ray = |k: usize| {
            starts[k].as_ref().map(|CameraPathStart { ray, stream }| Ray {
                origin: ray.origin,
                direction: ray.direction,
                tmax: f32::INFINITY,
                token: camera_token(self.scene, stream.vertex(0), Purpose::Alpha),
            })
        };
        self.scene.tracer.intersect8(ray, |k, hit| hits[k] = Some(hit));
        let triangles = hits.iter().flatten().map(|hit| (hit.instance, hit.primitive));
        self.scene.shapes.prefetch(triangles);
        for (start, hit) in starts.iter_mut().zip(hits) {
            if let (Some(start), Some(hit)) = (start, hit) {
                start.ray.first = PrecomputedHit::Hit(hit);
            }
        }
        starts
    }
}
