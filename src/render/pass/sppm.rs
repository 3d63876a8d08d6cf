//! Stochastic progressive photon mapping with bandwidth levels \[post-reconstruction 2021, sections 3 and 4.1\].
//!
//! An iteration traces light paths, builds a photon map, and then two camera paths per pixel that share nothing but
//! the photons: one measures level 1, the other levels 2 and up, each set of levels with one query per vertex.

use super::chunks::chunks;
use super::guiding::learn_guide;
use super::integrator::{Integrator, Work};
use super::region::region;
use super::sample_buffer::{self, SampleBuffer};
use super::volume::{Maps, VolumeMap};
use crate::camera::{Camera, par_pixels, pixels_per_band};
use crate::estimator::bandwidth::{initial_bandwidths, initial_volume_bandwidths, usual_radius2};
use crate::estimator::{InitialBandwidth, PixelAccumulator};
use crate::light::{Guide, Region};
use crate::photon::{ByKind, Kernel, Kind, PhotonMap, kernel, kind};
use crate::random::{Domain, Streams};
use crate::render::clock::Phases;
use crate::render::clock::cpu_seconds;
use crate::render::settings::{KernelChoice, Settings};
use crate::scene::Scene;
use crate::spectrum::IterationWavelengths;
use crate::transport::{
    CameraPaths, EqualFlux, Indirect, InitialMedia, LevelRadii, LightPaths, PathStart, Photons, Scratch, light_path,
};
use bumpalo::Bump;
use rayon::prelude::*;
use std::ops::Range;

/// Traces all light paths of a pass; the photons are ordered by path and vertex.
pub fn trace_photons(scene: &Scene, initial_media: &InitialMedia, pass: &LightPaths) -> Photons {
    trace_some(scene, initial_media, pass, 0..pass.paths())
}

/// Traces some of the light paths of a pass.
pub(super) fn trace_some(scene: &Scene, initial_media: &InitialMedia, pass: &LightPaths, paths: Range<u32>) -> Photons {
    trace_by(pass, paths, |arena, index, photons| {
        light_path(scene, arena, initial_media, pass, index, photons);
    })
}

/// Calls `light_path` for some paths of a pass; photons are in the order of paths.
fn trace_by(pass: &LightPaths, paths: Range<u32>, light_path: impl Fn(&mut Bump, u32, &mut Photons) + Sync) -> Photons {
    let parts: Vec<Photons> = chunks(paths.len() as u32)
        .map_init(Bump::new, |arena, part| {
            let mut photons = Photons::default();
            for index in part.take_while(|index| !pass.is_given_up(*index)) {
                light_path(arena, paths.start + index, &mut photons);
                arena.reset();
            }
            photons
        })
        .collect();
    let mut photons = Photons::default();
    for part in parts {
        photons.lost += part.lost;
        kind::append(&mut photons.surface, part.surface);
        photons.volume.extend(part.volume);
    }
    photons
}

/// One camera pass: measures iteration `i` (from 1) of all pixels.
fn eye_pass(
    camera_paths: &CameraPaths<'_>,
    settings: &Settings,
    i: u64,
    later2: f32,
    maps: &Maps,
    (pixels, samples): (&[PixelAccumulator], &mut [SampleBuffer]),
    kernel: impl Kernel,
) {
    let photons = &maps.surface;
    let size = camera_paths.camera.size();
    let levels = settings.levels;
    let schedule = settings.schedule(i);
    let [independent, correlated] = [Domain::CameraIndependent, Domain::CameraCorrelated]
        .map(|domain| Streams::in_sequence(settings.seed, i, domain));
    let band = pixels_per_band(size.0);
    let bands = pixels.par_chunks(band).zip(SampleBuffer::par_of_paths(samples, band));
    par_pixels(bands, size, Scratch::default, |scratch, (pixels, (samples, others)), places| {
        if camera_paths.is_given_up() {
            return;
        }
        let independent = maps.tune(camera_paths.starts(places, independent));
        let correlated = levels.two_paths.then(|| maps.tune(camera_paths.starts(places, correlated)));
        for (k, place) in places.iter().enumerate() {
            let (Some(place), Some(start)) = (place, &independent[k]) else { continue };
            let pixel = &pixels[place.at];
            let radii = |range: Range<usize>| {
                pixel.bandwidths.map(|bandwidth| {
                    let radii2 = range.clone().map(|level| schedule.radius2(bandwidth, level));
                    LevelRadii::new(radii2).later(later2 * schedule.factor2())
                })
            };
            let mut sample = |start: &(PathStart, _), levels: Range<usize>| {
                let volume = maps.volume(pixel, levels.clone());
                camera_paths.sample(scratch, start, photons, volume, &radii(levels), kernel)
            };
            match (correlated.as_ref().and_then(|starts| starts[k].as_ref()), &mut *others) {
                (Some(correlated), Some(others)) => {
                    samples.set(place.at, &sample(start, 0..1));
                    others.set(place.at, &sample(correlated, usize::from(levels.count > 1)..levels.count));
                }
                _ => samples.set(place.at, &sample(start, 0..levels.count)),
            }
        }
    });
}

/// The passes of a render.
pub(super) struct Sppm<'a> {
    camera_paths: CameraPaths<'a>,
    settings: &'a Settings,
    initial_media: &'a InitialMedia,
    guide: Option<Guide>,
    /// Where light from infinity is wanted.
    region: Option<Region>,
    /// Largest initial bandwidth, squared, beyond a camera path's first broad bounce.
    later2: f32,
    /// Of the iteration, by camera path.
    samples: Vec<SampleBuffer>,
}

impl<'a> Sppm<'a> {
    /// Nothing done yet but the guide, if there is to be one.
    pub fn new(
        scene: &'a Scene,
        camera: &'a Camera,
        settings: &'a Settings,
        initial_media: &'a InitialMedia,
    ) -> Sppm<'a> {
        let camera_paths = settings.camera_paths(scene, camera, initial_media);
        let guided = settings.guided && !settings.photon_classes(&scene.survey).is_empty();
        let region = region(&camera_paths, settings.seed);
        let guide = guided.then(|| learn_guide(&camera_paths, initial_media, settings, region)).flatten();
        let samples = SampleBuffer::of_paths(camera.size().0 as usize * camera.size().1 as usize, settings.levels);
        Sppm { camera_paths, settings, initial_media, guide, region, later2: f32::INFINITY, samples }
    }

    /// Camera paths.
    pub fn camera_paths(&self) -> CameraPaths<'a> {
        self.camera_paths
    }

    /// Kinds of photons that there are.
    pub fn kinds(&self) -> ByKind<bool> {
        self.settings.bandwidth_kinds(&self.camera_paths.scene.survey)
    }

    /// What an iteration is to measure.
    pub fn samples(&mut self) -> &mut [SampleBuffer] {
        &mut self.samples
    }

    /// Adds iteration `i`, as it is measured, to the pixels, and the photons they have met to `work`; `None` where it was
    /// given up.
    pub fn add(&self, i: u64, pixels: &mut [PixelAccumulator], mut work: Work) -> Option<Work> {
        let done = !self.settings.stop.aborted();
        done.then(|| {
            work.counts.gathered =
                sample_buffer::add(&self.samples, (&self.camera_paths, i), pixels, |index| index, |_| &[]);
            work
        })
    }

    /// The photons of an iteration by channel, each from a third of the light paths; `flux` is what they carry.
    pub fn channel_maps(&self, i: u64, flux: &[Option<EqualFlux>; 3], phases: &mut Phases) -> ([Maps; 3], Work) {
        let mut work = Work::default();
        let each = (self.settings.photons / 3).max(1);
        let Settings { seed, max_depth, .. } = *self.settings;
        let maps = std::array::from_fn(|channel| {
            let start = cpu_seconds();
            // The channels share no random numbers.
            let pass = LightPaths::new(seed, 3 * i + channel as u64, Domain::Light, each, max_depth);
            let pass = pass
                .with(IterationWavelengths::new(seed, i))
                .stopped_by(&self.settings.stop)
                .wanting(self.settings.photon_classes(&self.camera_paths.scene.survey), Indirect::Photons);
            let each = pass.paths();
            let photons = flux[channel].map_or(Photons::default(), |flux| {
                trace_by(&pass, 0..each, |arena, index, photons| {
                    flux.light_path(self.camera_paths.scene, arena, self.initial_media, &pass, index, photons);
                })
            });
            let traced = cpu_seconds();
            let maps = self.build(photons, 0, i);
            phases.light += traced - start;
            phases.map += cpu_seconds() - traced;
            work.light_paths += u64::from(each);
            work.photons += maps.len();
            work.rejected += maps.rejected();
            work.counts.add(&maps.counts());
            maps
        });
        (maps, work)
    }

    /// What photons of equal flux carry, by channel.
    pub fn equal_flux(&self) -> [Option<EqualFlux>; 3] {
        std::array::from_fn(|channel| EqualFlux::new(self.camera_paths.scene, self.initial_media, channel))
    }

    /// The photons of an iteration.
    pub fn map(&self, i: u64, phases: &mut Phases) -> (Maps, Work) {
        let t0 = cpu_seconds();
        let pass = self.light_pass(i, Domain::Light);
        let photons = trace_photons(self.camera_paths.scene, self.initial_media, &pass);
        let t1 = cpu_seconds();
        let maps = self.build(photons, pass.paths(), i);
        phases.light += t1 - t0;
        phases.map += cpu_seconds() - t1;
        let (photons, rejected, counts) = (maps.len(), maps.rejected(), maps.counts());
        let work = Work { light_paths: u64::from(pass.paths()), photons, rejected, counts };
        (maps, work)
    }

    /// Maps of the photons of iteration `i`, and of how many light paths, if sharp lobes may merge them: those of
    /// caustics, if they are sent.
    fn build(&self, photons: Photons, paths: u32, i: u64) -> Maps {
        let (scatters, lost) = (self.camera_paths.scene.survey.scattering, photons.lost);
        let volume = scatters.then(|| VolumeMap::new(photons.volume, i, self.settings));
        let [others, caustics] = photons.surface.map(PhotonMap::build);
        let [_, caustics_sent] = self.kinds();
        let surface = [others, caustics.of_paths(if caustics_sent { paths } else { 0 })];
        Maps { surface, volume, wavelengths: IterationWavelengths::new(self.settings.seed, i), lost }
    }

    fn light_pass(&self, i: u64, domain: Domain) -> LightPaths<'_> {
        let Settings { seed, photons, max_depth, .. } = *self.settings;
        LightPaths::new(seed, i, domain, photons, max_depth)
            .guided(self.guide.as_ref())
            .lighting(self.region)
            .wanting(self.settings.photon_classes(&self.camera_paths.scene.survey), self.settings.indirect)
            .with(IterationWavelengths::new(seed, i))
            .stopped_by(&self.settings.stop)
    }
}

impl Integrator for Sppm<'_> {
    fn pixels(&mut self) -> Vec<PixelAccumulator> {
        let Settings { initial_bandwidth: initial, max_initial_bandwidth: widest, seed, .. } = *self.settings;
        let pilot = if matches!(initial, InitialBandwidth::Nearest(_)) {
            trace_photons(self.camera_paths.scene, self.initial_media, &self.light_pass(0, Domain::PilotLight))
        } else {
            Photons::default()
        };
        let maps = pilot.surface.map(PhotonMap::build);
        let bandwidths = initial_bandwidths(&self.camera_paths, initial, widest[0], seed, maps.each_ref());
        if let (InitialBandwidth::Nearest(k), Indirect::Paths) = (initial, self.settings.indirect) {
            self.later2 = usual_radius2(&maps[Kind::Caustic as usize], k);
        }
        let mut pixels: Vec<PixelAccumulator> =
            bandwidths.into_iter().map(self.settings.pixel_factory(self.camera_paths.scene)).collect();
        if self.camera_paths.scene.survey.scattering {
            let pilot = PhotonMap::build(pilot.volume);
            let bandwidths = initial_volume_bandwidths(&self.camera_paths, initial, widest[1], seed, &pilot);
            for (pixel, bandwidth) in pixels.iter_mut().zip(bandwidths) {
                pixel.volume_bandwidth = bandwidth;
            }
        }
        pixels
    }

    fn guide(&self) -> Option<&Guide> {
        self.guide.as_ref()
    }

    fn iterate(&mut self, i: u64, pixels: &mut [PixelAccumulator], phases: &mut Phases) -> Option<Work> {
        let (maps, work) = self.map(i, phases);
        let start = cpu_seconds();
        let Sppm { camera_paths, settings, later2, samples, .. } = self;
        let all = (&*pixels, &mut samples[..]);
        match settings.kernel {
            KernelChoice::Box => eye_pass(camera_paths, settings, i, *later2, &maps, all, kernel::Box),
            KernelChoice::Epanechnikov => {
                eye_pass(camera_paths, settings, i, *later2, &maps, all, kernel::Epanechnikov)
            }
            KernelChoice::Gaussian => eye_pass(camera_paths, settings, i, *later2, &maps, all, kernel::Gaussian),
        }
        let done = self.add(i, pixels, work);
        phases.eye += cpu_seconds() - start;
        done
    }
}
