//! Stochastic progressive photon mapping with bandwidth levels \[post-reconstruction 2021, sections 3 and 4.1\], under
//! any bandwidth rule ([`PixelBandwidths`]).
//!
//! An iteration traces light paths, builds a photon map, and traces one or two camera paths per pixel. Two camera paths
//! share nothing but the photons: the first samples level 1, the second levels 2 and up. All levels of a path need one
//! query per vertex.

use super::integrator::{Integrator, Work};
use super::photon_tracer::{InitialPixels, PhotonTracer};
use super::pixel_bandwidths::{BandwidthChunk, PathBandwidths, PixelBandwidths};
use super::sample_buffer::{self, SampleBuffer};
use super::volume::Maps;
use crate::camera::{par_pixels, pixels_per_band};
use crate::estimator::PixelAccumulator;
use crate::light::Guide;
use crate::photon::{ByKind, Kernel};
use crate::random::{Domain, Streams};
use crate::render::clock::{Phases, cpu_seconds};
use crate::render::input::RenderInput;
use crate::render::settings::Settings;
use crate::transport::{CameraPathStart, LobeLight, PixelSample, Scratch};
use rayon::prelude::*;
use std::ops::Range;

/// Integrator of progressive photon mapping with the bandwidth rule `B`.
pub(super) struct Sppm<B> {
    tracer: PhotonTracer,
    bandwidths: B,
    kernel: Kernel,
    /// Samples of all pixels in the current iteration, for each of a pixel's camera paths.
    samples: Vec<SampleBuffer>,
}

impl<B: PixelBandwidths> Sppm<B> {
    pub fn new(input: &RenderInput<'_>, tracer: PhotonTracer, bandwidths: B, kernel: Kernel) -> Sppm<B> {
        let (width, height) = input.size();
        let samples = SampleBuffer::of_paths(width as usize * height as usize, input.settings.levels);
        let samples = SampleBuffer::with_lobes(samples, input.settings.lobes);
        Sppm { tracer, bandwidths, kernel, samples }
    }

    /// Random numbers of the camera paths of `domain` in iteration `i`: for their points on film and lens, and for
    /// everything else.
    fn streams(settings: &Settings, i: u64, domain: Domain) -> [Streams; 2] {
        // Measurement points of `ppm` stay where they are \[Hachisuka, Ogaki, Jensen 2008\]: at everything that one point
        // of the film sees, which may be several points if it sees glass.
        let film = if settings.method.has_fixed_points() { 1 } else { i };
        [film, i].map(|i| Streams::in_sequence(settings.seed, i, domain))
    }

    /// Traces the camera paths of iteration `i` (from 1) and stores their samples. `maps` has the photons of the
    /// iteration: one map, or one for each colour channel.
    fn trace_camera_paths(&mut self, input: &RenderInput<'_>, i: u64, maps: &[Maps], pixels: &[PixelAccumulator]) {
        let settings = &input.settings;
        let [independent, correlated] =
            [Domain::CameraIndependent, Domain::CameraCorrelated].map(|domain| Self::streams(settings, i, domain));
        let Sppm { bandwidths, kernel, samples, .. } = self;
        let (camera_paths, levels, kernel) = (input.camera_paths(), settings.levels, *kernel);
        let (size, own) = (camera_paths.camera.size(), levels.picture_level());
        let band = pixels_per_band(size.0);
        let bands =
            pixels.par_chunks(band).zip(SampleBuffer::par_of_paths(samples, band)).zip(bandwidths.par_chunks(i, band));
        let scratches = || maps.iter().map(|_| Scratch::default()).collect::<Vec<_>>();
        par_pixels(bands, size, scratches, |scratches, ((pixels, (first, second)), bandwidths), places| {
            if camera_paths.is_given_up() {
                return;
            }
            places.iter().flatten().for_each(|place| bandwidths.prefetch(place.at));
            let starts =
                |[film, streams]: [Streams; 2]| maps[0].tune(camera_paths.starts_through(places, film, streams));
            let independent = starts(independent);
            let correlated = levels.two_paths.then(|| starts(correlated));
            for (k, place) in places.iter().enumerate() {
                let (Some(place), Some(start)) = (place, &independent[k]) else { continue };
                let pixel = &pixels[place.at];
                // Samples some levels by one camera path, with the photons of each channel. The path is the same each
                // time; only the photons differ, and photons of a channel carry light of that channel only.
                let mut sample = |start: &CameraPathStart, levels: Range<usize>, lobes: &mut LobeLight| {
                    let own = own.checked_sub(levels.start).filter(|own| *own < levels.len());
                    let mut of_channel = |channel: usize| {
                        let (maps, scratch) = (&maps[channel], &mut scratches[channel]);
                        scratch.lobes.start(own);
                        let volume = maps.volume(pixel, levels.clone());
                        let mut own = bandwidths.path(place.at, channel, levels.clone());
                        let sample = camera_paths.sample(scratch, start, &maps.surface, volume, &mut own, kernel);
                        own.finish();
                        if camera_paths.lobes {
                            scratch.lobes.add_to(lobes, channel == 0);
                        }
                        sample
                    };
                    let mut sample = of_channel(0);
                    (1..maps.len()).for_each(|channel| add_photons(&mut sample, &of_channel(channel)));
                    sample
                };
                let (mut lobes, mut other) = (LobeLight::default(), LobeLight::default());
                match (correlated.as_ref().and_then(|starts| starts[k].as_ref()), &mut *second) {
                    (Some(correlated), Some(second)) => {
                        first.set(place.at, &sample(start, 0..1, &mut other));
                        let rest = usize::from(levels.count > 1)..levels.count;
                        second.set(place.at, &sample(correlated, rest, &mut lobes));
                        second.set_lobes(place.at, &lobes);
                    }
                    _ => {
                        first.set(place.at, &sample(start, 0..levels.count, &mut lobes));
                        first.set_lobes(place.at, &lobes);
                    }
                }
            }
        });
    }
}

/// Adds the light of photons in `sample` to `all`, a sample of the same camera path.
fn add_photons(all: &mut PixelSample, sample: &PixelSample) {
    let sums = all.caustic_photons.iter_mut().chain(&mut all.indirect_photons).chain(&mut all.volume_photons);
    let photons = sample.caustic_photons.iter().chain(&sample.indirect_photons).chain(&sample.volume_photons);
    for (sum, light) in sums.zip(photons) {
        *sum += *light;
    }
    all.rejection = all.rejection.or(sample.rejection);
}

impl<B: PixelBandwidths> Integrator for Sppm<B> {
    fn pixels(&mut self, input: &RenderInput<'_>) -> Vec<PixelAccumulator> {
        let InitialPixels { pixels, indirect_cap2 } = self.tracer.initial_pixels(input);
        self.bandwidths.start(&pixels, indirect_cap2);
        pixels
    }

    fn iterate(
        &mut self,
        input: &RenderInput<'_>,
        i: u64,
        pixels: &mut [PixelAccumulator],
        phases: &mut Phases,
    ) -> Option<Work> {
        let (maps, mut work) = self.tracer.maps(input, i, phases);
        let start = cpu_seconds();
        let before = self.bandwidths.clone();
        self.trace_camera_paths(input, i, &maps, pixels);
        let aborted = input.settings.stop.aborted();
        if aborted {
            self.bandwidths = before;
        } else {
            let camera_paths = input.camera_paths();
            work.counts.gathered =
                sample_buffer::add(&self.samples, &camera_paths, i, pixels, |index| index, |_| (&[], None));
        }
        phases.eye += cpu_seconds() - start;
        (!aborted).then_some(work)
    }

    fn guide(&self) -> Option<&Guide> {
        self.tracer.guide()
    }

    fn state(&self) -> postcard::Result<Vec<u8>> {
        self.bandwidths.state()
    }

    fn restore(&mut self, state: &[u8]) -> bool {
        self.bandwidths.restore(state)
    }

    fn counted(&self) -> Option<ByKind<Vec<f32>>> {
        self.bandwidths.bandwidths2()
    }
}
