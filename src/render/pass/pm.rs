//! Classical photon mapping \[Jensen 1996\]: photons traced once, and the nearest of caustics and of all others around
//! every point that a camera path sees.
//!
//! As comparisons of progressive methods show it \[Hachisuka 2013\], without final gathering: direct light by
//! next-event estimation, caustics and all other indirect light from the maps. Camera paths accumulate over iterations,
//! the maps stay. So the picture tends to their own blurred and blotched one, never to the truth: only more photons
//! help, and memory bounds their number. The estimated error, which is told from differences between iterations, does
//! not know of it.
//!
//! Of light in media it has single scattering alone, no photons: not for scenes whose media scatter.
//!
//! Where the memory is full, tracing ends with the last light path whose photons all fit, and fluxes are divided by the
//! number of paths that were traced.

use super::integrator::{Integrator, Work};
use super::photon_tracer::trace_range;
use super::sample_buffer::{self, SampleBuffer};
use crate::camera::{Camera, par_pixels, pixels_per_band};
use crate::estimator::bandwidth::{MIN_RADIUS_RATIO, SCREEN_CAP, picture_width_at};
use crate::estimator::{InitialBandwidth, PixelAccumulator};
use crate::math::Vec3;
use crate::photon::{ByKind, Kind, MAX_NEIGHBOURS, Nearest, Photon, PhotonMap, PhotonMaps, kernel, kind};
use crate::random::{Domain, Streams};
use crate::render::clock::Phases;
use crate::render::clock::cpu_seconds;
use crate::render::settings::Settings;
use crate::scene::Scene;
use crate::transport::{
    CameraPaths, GatherBandwidths, Indirect, InitialMedia, LevelRadii, LightPaths, Photons, Scratch, light_path,
};
use bumpalo::Bump;

/// Light paths traced between two looks at the memory.
const BATCH: u32 = 1 << 16;
/// Bytes per photon while the map is built: the photon as traced and as sorted, its place on the curve, its share of
/// the tree.
pub const PHOTON_BYTES: u64 = 2 * size_of::<Photon>() as u64 + 16 + 32;

/// The photons of a pass that fit into `most`, and the number of light paths that left them. Their flux is divided by
/// it. Last, light paths that ended because they were not finite.
fn trace(
    scene: &Scene,
    initial_media: &InitialMedia,
    pass: &LightPaths,
    most: usize,
) -> (ByKind<Vec<Photon>>, u32, u64) {
    let (mut photons, mut traced, mut lost): (ByKind<Vec<Photon>>, _, _) = (ByKind::default(), 0, 0);
    while traced < pass.count() {
        let paths = traced..pass.count().min(traced.saturating_add(BATCH));
        let end = paths.end;
        let batch = trace_range(scene, initial_media, pass, paths);
        if kind::count(&photons) + kind::count(&batch.surface) > most {
            break;
        }
        kind::append(&mut photons, batch.surface);
        lost += batch.lost;
        traced = end;
    }
    // The memory ends within a batch: path by path.
    let mut arena = Bump::new();
    let mut path = Photons::default();
    while traced < pass.count() {
        light_path(scene, &arena, initial_media, pass, traced, &mut path);
        arena.reset();
        if kind::count(&photons) + kind::count(&path.surface) > most {
            break;
        }
        kind::append(&mut photons, std::mem::take(&mut path.surface));
        path.volume.clear();
        lost += std::mem::take(&mut path.lost);
        traced += 1;
    }
    let more = pass.count() as f32 / traced.max(1) as f32;
    photons.iter_mut().flatten().for_each(|photon| photon.flux *= more);
    (photons, traced, lost)
}

/// The distance to the k-th nearest photon is the bandwidth; it is not inside, so `k - 1` are, which is as many as this
/// area holds on average.
struct Neighbours<'a> {
    count: usize,
    nearest: &'a mut ByKind<Nearest>,
    camera: &'a Camera,
    least: f32,
}

impl GatherBandwidths for Neighbours<'_> {
    type Frame = ();
    type Counter<'c>
        = ()
    where
        Self: 'c;

    fn frame(_: Vec3) {}

    fn radii(&mut self, kind: Kind, photons: &PhotonMap, p: Vec3, ng: Vec3, length: f32) -> LevelRadii {
        let cap = (SCREEN_CAP * picture_width_at(self.camera, length)).max(self.least);
        let cap2 = cap * cap;
        let nearest = &mut self.nearest[kind as usize];
        let radius2 = nearest.radius2(photons, p, ng, self.count, cap2).unwrap_or(cap2);
        LevelRadii::new(std::iter::once(radius2.max(self.least * self.least)))
    }

    fn counter(&mut self, _: Kind, (): &()) {}
}

/// The passes of a render.
pub(super) struct Pm<'a> {
    camera_paths: CameraPaths<'a>,
    settings: &'a Settings,
    initial_media: &'a InitialMedia,
    /// Built by the first iteration.
    maps: Option<PhotonMaps>,
    /// The light paths of the maps are counted.
    counted: bool,
    samples: [SampleBuffer; 1],
}

impl<'a> Pm<'a> {
    /// Nothing done yet.
    pub fn new(
        scene: &'a Scene,
        camera: &'a Camera,
        settings: &'a Settings,
        initial_media: &'a InitialMedia,
    ) -> Pm<'a> {
        let camera_paths = settings.camera_paths(scene, camera, initial_media);
        let samples = [SampleBuffer::new(camera.size().0 as usize * camera.size().1 as usize, 1)];
        Pm { camera_paths, settings, initial_media, maps: None, counted: false, samples }
    }

    /// The maps, how many light paths they are of, and what was left out.
    fn build(&self, phases: &mut Phases) -> (PhotonMaps, u32, u64) {
        let Settings { seed, photons, photon_memory, max_depth, .. } = *self.settings;
        let start = cpu_seconds();
        let pass = LightPaths::new(seed, 1, Domain::Light, photons, max_depth)
            .wanting(self.settings.photon_classes(&self.camera_paths.scene.survey), Indirect::Photons)
            .stopped_by(&self.settings.stop);
        let most = usize::try_from(photon_memory / PHOTON_BYTES).unwrap_or(usize::MAX).min(u32::MAX as usize);
        let (photons, traced, lost) = trace(self.camera_paths.scene, self.initial_media, &pass, most);
        phases.light += cpu_seconds() - start;
        let start = cpu_seconds();
        let maps = photons.map(PhotonMap::build);
        phases.map += cpu_seconds() - start;
        let rejected = lost + maps.iter().map(PhotonMap::rejected).sum::<u64>();
        (maps, traced, rejected)
    }
}

impl Integrator for Pm<'_> {
    fn pixels(&mut self) -> Vec<PixelAccumulator> {
        self.settings.initial_pixels(self.camera_paths.scene, self.camera_paths.camera)
    }

    fn iterate(&mut self, i: u64, pixels: &mut [PixelAccumulator], phases: &mut Phases) -> Option<Work> {
        let (maps, traced, rejected) = match self.maps.take() {
            Some(maps) => (maps, 0, 0),
            None => self.build(phases),
        };
        if self.settings.stop.aborted() {
            return None;
        }
        let start = cpu_seconds();
        let (camera_paths, camera) = (&self.camera_paths, self.camera_paths.camera);
        let count = match self.settings.initial_bandwidth {
            InitialBandwidth::Nearest(k) => k.clamp(2, MAX_NEIGHBOURS),
            _ => self.settings.method.default_neighbours(1),
        };
        let least = MIN_RADIUS_RATIO * camera_paths.scene.lights.sky().radius;
        let streams = Streams::in_sequence(self.settings.seed, i, Domain::CameraIndependent);
        let scratch = <(Scratch, ByKind<Nearest>)>::default;
        par_pixels(
            self.samples[0].par_parts(pixels_per_band(camera.size().0)),
            camera.size(),
            scratch,
            |(scratch, nearest), samples, places| {
                if camera_paths.is_given_up() {
                    return;
                }
                let starts = camera_paths.starts(places, streams);
                for (place, start) in places.iter().flatten().zip(starts.iter().flatten()) {
                    let mut neighbours = Neighbours { count, nearest: &mut *nearest, camera, least };
                    samples
                        .set(place.at, &camera_paths.sample(scratch, start, &maps, None, &mut neighbours, kernel::Box));
                }
            },
        );
        if !self.settings.stop.aborted() {
            sample_buffer::add(&self.samples, (camera_paths, i), pixels, |index| index, |_| &[]);
        }
        phases.eye += cpu_seconds() - start;
        let photons = maps.iter().map(|map| map.photons().len()).sum();
        self.maps = Some(maps);
        if self.settings.stop.aborted() {
            return None;
        }
        // After a pause the maps are made again, of the same paths.
        let (light_paths, rejected) =
            if std::mem::replace(&mut self.counted, true) { (0, 0) } else { (u64::from(traced), rejected) };
        Some(Work { light_paths, photons, rejected, ..Work::default() })
    }

    fn state(&self) -> postcard::Result<Vec<u8>> {
        postcard::to_allocvec(&self.counted)
    }

    fn restore(&mut self, state: &[u8]) -> bool {
        let Ok(counted) = postcard::from_bytes(state) else { return false };
        self.counted = counted;
        true
    }
}
