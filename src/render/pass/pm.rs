//! Classical photon mapping \[Jensen 1996\]: photons are traced once, and the nearest photons of each kind are gathered
//! around every point that a camera path sees.
//!
//! As in comparisons of progressive methods \[Hachisuka 2013\], there is no final gathering: next-event estimation
//! finds direct light, the maps give all indirect light. Iterations trace new camera paths with the same maps. So the
//! picture converges to the blurred estimate of the maps; only more photons, limited by memory, reduce that bias. The
//! estimated error comes from differences between iterations and does not contain it.
//!
//! In media it finds single scattering only, without photons, so it is not meant for scattering scenes.
//!
//! When memory is full, tracing ends with the last light path whose photons all fit, and fluxes are divided by the
//! number of traced paths.

use super::integrator::{Integrator, Work};
use super::photon_tracer::trace_range;
use super::sample_buffer::{self, SampleBuffer};
use crate::camera::{Camera, par_pixels, pixels_per_band};
use crate::estimator::PixelAccumulator;
use crate::math::Vec3;
use crate::photon::{ByKind, Kernel, Kind, MAX_NEIGHBOURS, Nearest, Photon, PhotonMap, PhotonMaps, kind};
use crate::random::{Domain, Streams};
use crate::render::clock::{Phases, cpu_seconds};
use crate::render::initial_bandwidth::{InitialBandwidth, MIN_BANDWIDTH_RATIO, SCREEN_CAP, picture_width_at};
use crate::render::input::RenderInput;
use crate::render::settings::Settings;
use crate::scene::Scene;
use crate::transport::{
    GatherBandwidths, Indirect, InitialMedia, LevelBandwidths, LightPaths, Photons, Scratch, light_path,
};
use bumpalo::Bump;

/// Light paths traced between two checks of the photons' memory.
const BATCH: u32 = 1 << 16;
/// Bytes per photon while the map is built: the photon in the order of tracing and sorted, its Morton code, and its
/// share of the tree.
pub const PHOTON_BYTES: u64 = 2 * size_of::<Photon>() as u64 + 16 + 32;
/// The help of `--photon-memory` repeats this number.
const _: () = assert!(PHOTON_BYTES == 160);

/// Traces light paths until there are `most` photons or all paths are traced.
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
    // The limit lies within this batch, so its paths are added one by one.
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

/// Bandwidths of classical photon mapping: the distance to the k-th nearest photon. That photon is outside, so `k - 1`
/// are inside, which is the expected number in this area.
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

    fn levels(&mut self, kind: Kind, photons: &PhotonMap, p: Vec3, ng: Vec3, length: f32) -> LevelBandwidths {
        let cap = (SCREEN_CAP * picture_width_at(self.camera, length)).max(self.least);
        let cap2 = cap * cap;
        let nearest = &mut self.nearest[kind as usize];
        let bandwidth2 = nearest.bandwidth2(photons, p, ng, self.count, cap2).unwrap_or(cap2);
        LevelBandwidths::new(std::iter::once(bandwidth2.max(self.least * self.least)))
    }

    fn counter(&mut self, _: Kind, (): &()) {}
}

/// Integrator of classical photon mapping.
pub(super) struct Pm {
    /// Photon maps of the render; `None` before the first iteration, which builds them.
    maps: Option<PhotonMaps>,
    /// Whether the light paths of the maps have been reported in the counts of an iteration.
    counted: bool,
    samples: Vec<SampleBuffer>,
}

impl Pm {
    pub fn new(camera: &Camera, lobes: bool) -> Pm {
        let samples = vec![SampleBuffer::new(camera.size().0 as usize * camera.size().1 as usize, 1)];
        let samples = SampleBuffer::with_lobes(samples, lobes);
        Pm { maps: None, counted: false, samples }
    }

    /// Traces photons and builds the maps of the render.
    fn build(input: &RenderInput<'_>, phases: &mut Phases) -> (PhotonMaps, u32, u64) {
        let RenderInput { scene, settings, initial_media, .. } = input;
        let Settings { seed, photons, photon_memory, max_depth, .. } = *settings;
        let start = cpu_seconds();
        let pass = LightPaths::new(seed, 1, Domain::Light, photons, max_depth)
            .wanting(settings.photon_classes(&scene.survey), Indirect::Photons)
            .stopped_by(Some(&settings.stop));
        let most = usize::try_from(photon_memory / PHOTON_BYTES).unwrap_or(usize::MAX).min(u32::MAX as usize);
        let (photons, traced, lost) = trace(scene, initial_media, &pass, most);
        phases.light += cpu_seconds() - start;
        let start = cpu_seconds();
        let maps = photons.map(PhotonMap::build);
        phases.map += cpu_seconds() - start;
        let rejected = lost + maps.iter().map(PhotonMap::rejected).sum::<u64>();
        (maps, traced, rejected)
    }
}

impl Integrator for Pm {
    fn pixels(&mut self, input: &RenderInput<'_>) -> Vec<PixelAccumulator> {
        input.initial_pixels()
    }

    fn iterate(
        &mut self,
        input: &RenderInput<'_>,
        i: u64,
        pixels: &mut [PixelAccumulator],
        phases: &mut Phases,
    ) -> Option<Work> {
        let settings = &input.settings;
        let (maps, traced, rejected) = match self.maps.take() {
            Some(maps) if !input.moves() => (maps, 0, 0),
            _ => Pm::build(input, phases),
        };
        if settings.stop.aborted() {
            return None;
        }
        let start = cpu_seconds();
        let (camera_paths, camera) = (&input.camera_paths(), input.camera);
        let count = match settings.initial_bandwidth {
            InitialBandwidth::Nearest(k) => k.clamp(2, MAX_NEIGHBOURS),
            _ => settings.method.default_neighbours(1),
        };
        let least = MIN_BANDWIDTH_RATIO * camera_paths.scene.lights.sky().radius;
        let streams = Streams::in_sequence(settings.seed, i, Domain::CameraIndependent);
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
                    scratch.lobes.start(Some(0));
                    let sample = camera_paths.sample(scratch, start, &maps, None, &mut neighbours, Kernel::Box);
                    samples.set(place.at, &sample);
                    samples.set_lobes(place.at, &scratch.lobes.all());
                }
            },
        );
        if !settings.stop.aborted() {
            sample_buffer::add(&self.samples, camera_paths, i, pixels, |index| index, |_| (&[], None));
        }
        phases.eye += cpu_seconds() - start;
        let photons = maps.iter().map(|map| map.photons().len()).sum();
        self.maps = Some(maps);
        if settings.stop.aborted() {
            return None;
        }
        // A resumed render traces the same maps again without counting them twice.
        let (light_paths, rejected) = if std::mem::replace(&mut self.counted, true) && !input.moves() {
            (0, 0)
        } else {
            (u64::from(traced), rejected)
        };
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
