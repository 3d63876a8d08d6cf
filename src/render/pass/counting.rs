//! The methods whose bandwidths follow from the photons found: the passes of stochastic progressive photon mapping with
//! a state of its own for every pixel, kind of photons and level, and a [`CountingRule`] that says what becomes of it.
//!
//! In media the rules are not defined, and bandwidths follow the memoryless rule of volumes.
//!
//! An iteration depends on all before it, so shards cannot share them out.

use super::integrator::{Integrator, Work};
use super::sample_buffer::SampleBuffer;
use super::sppm::Sppm;
use super::volume::Maps;
use crate::camera::{par_pixels, pixels_per_band};
use crate::estimator::rule::CountingRule;
use crate::estimator::{InitialBandwidth, PixelAccumulator, level_factor2};
use crate::math::{Frame, Vec3};
use crate::photon::{ByKind, Kernel, Kind, PhotonMap};
use crate::processor::prefetch;
use crate::random::{Domain, Streams};
use crate::render::clock::Phases;
use crate::render::clock::cpu_seconds;
use crate::render::settings::Settings;
use crate::transport::{Bandwidths, Counter, EqualFlux, FoundPhotons, LevelRadii, PathStart, PixelSample, Scratch};
use rayon::prelude::*;
use std::ops::Range;

/// The bandwidths of some levels for one kind of photons, and what is counted within them.
struct LevelBandwidths<'a, R: CountingRule> {
    bandwidths: &'a mut [R::Bandwidth],
    counts: &'a mut [R::Count],
    /// Of the camera path.
    tally: R::Tally,
}

impl<R: CountingRule> LevelBandwidths<'_, R> {
    /// Each level may shrink on its own, so they may change places.
    #[inline(always)]
    fn radii(&self) -> LevelRadii {
        if let [only] = &self.bandwidths {
            return LevelRadii::new(std::iter::once(R::radius2(only)));
        }
        if self.bandwidths.is_sorted_by_key(R::radius2) {
            return LevelRadii::new(self.bandwidths.iter().map(R::radius2));
        }
        let mut order = std::array::from_fn(|level| level as u8);
        let radius2 = |level: u8| R::radius2(&self.bandwidths[usize::from(level)]);
        let ascending = &mut order[..self.bandwidths.len()];
        ascending.sort_by(|&a, &b| radius2(a).total_cmp(&radius2(b)));
        LevelRadii::new(ascending.iter().map(|&level| radius2(level))).of(order)
    }
}

/// Where the states of a pixel and channel are among those of the pixel: by kind, and then by level.
#[derive(Clone, Copy)]
struct Layout {
    /// Kinds of photons that there are.
    kinds: ByKind<bool>,
    levels: usize,
    /// Counts per bandwidth.
    counts: usize,
}

impl Layout {
    /// Bandwidths of a kind of a channel.
    #[inline(always)]
    fn of_kind(&self, kind: Kind) -> usize {
        if self.kinds[kind as usize] { self.levels } else { 0 }
    }

    /// Bandwidths of a channel.
    #[inline(always)]
    fn count(&self) -> usize {
        self.of_kind(Kind::Indirect) + self.of_kind(Kind::Caustic)
    }

    /// Some levels of a channel, of all that a pixel has.
    #[inline(always)]
    fn states<'a, R: CountingRule>(
        &self,
        channel: usize,
        levels: Range<usize>,
        bandwidths: &'a mut [R::Bandwidth],
        counts: &'a mut [R::Count],
    ) -> ByKind<LevelBandwidths<'a, R>> {
        let own = channel * self.count()..(channel + 1) * self.count();
        let first = self.of_kind(Kind::Indirect);
        let (indirect, caustic) = bandwidths[own.clone()].split_at_mut(first);
        let counts = &mut counts[own.start * self.counts..own.end * self.counts];
        let (indirect_counts, caustic_counts) = counts.split_at_mut(first * self.counts);
        [(indirect, indirect_counts), (caustic, caustic_counts)].map(|(bandwidths, counts)| {
            let levels = levels.start.min(bandwidths.len())..levels.end.min(bandwidths.len());
            let counts = &mut counts[levels.start * self.counts..levels.end * self.counts];
            LevelBandwidths { bandwidths: &mut bandwidths[levels], counts, tally: R::Tally::default() }
        })
    }
}

/// Those of a camera path, by kind; of one that is not there, no levels.
struct CameraPathBandwidths<'a, R: CountingRule> {
    rule: &'a R,
    states: ByKind<LevelBandwidths<'a, R>>,
}

impl<R: CountingRule> CameraPathBandwidths<'_, R> {
    /// After the camera path of iteration `i`.
    #[inline(always)]
    fn finish(&mut self, i: u64) {
        for LevelBandwidths { bandwidths, counts, tally } in &mut self.states {
            self.rule.update(i, bandwidths, counts, tally);
        }
    }
}

impl<'a, R: CountingRule> Bandwidths for &mut CameraPathBandwidths<'a, R> {
    type Place = Frame;
    type Counter<'c>
        = VertexCounter<'c, 'a, R>
    where
        Self: 'c;

    /// One function of the normal in all iterations: counts of different gathering points are added.
    #[inline(always)]
    fn place(ng: Vec3) -> Frame {
        Frame::from_normal(ng)
    }

    #[inline(always)]
    fn at(&mut self, kind: Kind, _: &PhotonMap, _: Vec3, _: Vec3, _: f32) -> LevelRadii {
        self.states[kind as usize].radii()
    }

    #[inline(always)]
    fn counter<'c>(&'c mut self, kind: Kind, frame: &'c Frame) -> VertexCounter<'c, 'a, R> {
        VertexCounter { rule: self.rule, states: &mut self.states[kind as usize], frame }
    }
}

/// Those of a kind, where a camera path gathers it.
struct VertexCounter<'c, 'a, R: CountingRule> {
    rule: &'a R,
    states: &'c mut LevelBandwidths<'a, R>,
    frame: &'c Frame,
}

impl<R: CountingRule> Counter for VertexCounter<'_, '_, R> {
    const BEYOND: bool = R::BEYOND;
    const NEEDS_THINNING_KEYS: bool = R::NEEDS_THINNING_KEYS;

    #[inline(always)]
    fn count(&mut self, photons: &FoundPhotons) {
        let LevelBandwidths { bandwidths, counts, tally } = &mut *self.states;
        self.rule.count(bandwidths, counts, tally, self.frame, photons);
    }

    #[inline]
    fn reach2(&self, largest2: f32) -> f32 {
        self.rule.reach2(self.states.bandwidths, largest2)
    }
}

/// The passes of a render.
pub(super) struct Counting<'a, R: CountingRule, K> {
    /// Its light passes and pilot.
    sppm: Sppm<'a>,
    settings: &'a Settings,
    rule: R,
    kernel: K,
    /// What photons of each channel carry, where channels are apart; then each has bandwidths of its own.
    channels: Option<[Option<EqualFlux>; 3]>,
    layout: Layout,
    /// Of every pixel, channel, kind and level.
    bandwidths: Vec<R::Bandwidth>,
    /// Of every pixel, channel, kind and level.
    counts: Vec<R::Count>,
}

impl<'a, R: CountingRule, K: Kernel> Counting<'a, R, K> {
    /// Nothing done yet.
    pub fn new(sppm: Sppm<'a>, settings: &'a Settings, rule: R, kernel: K) -> Self {
        let channels = settings.has_channels().then(|| sppm.equal_flux());
        // Where photons bring nothing, pixels still have a state.
        let kinds = match sppm.kinds() {
            [false, false] => [true, false],
            kinds => kinds,
        };
        let layout = Layout { kinds, levels: settings.levels.count, counts: rule.counts() };
        Counting { sppm, settings, rule, kernel, channels, layout, bandwidths: Vec::new(), counts: Vec::new() }
    }

    /// Random numbers of the camera paths of a domain in iteration `i`: for their points on film and lens, and for all
    /// else.
    fn streams(&self, i: u64, domain: Domain) -> [Streams; 2] {
        // Measurement points stay where they are \[Hachisuka, Ogaki, Jensen 2008\]: what one point of the film sees,
        // all of it if it is by glass.
        let film = if self.settings.method.has_fixed_points() { 1 } else { i };
        [film, i].map(|pass| Streams::in_sequence(self.settings.seed, pass, domain))
    }

    /// `maps` holds the photons, or those of each channel.
    fn eye_pass(&mut self, i: u64, maps: &[Maps], pixels: &[PixelAccumulator]) {
        let [independent, correlated] =
            [Domain::CameraIndependent, Domain::CameraCorrelated].map(|domain| self.streams(i, domain));
        let Counting { sppm, settings, rule, kernel, layout, bandwidths, counts, .. } = self;
        let (camera_paths, rule, kernel, layout, levels) =
            (sppm.camera_paths(), &*rule, *kernel, *layout, settings.levels);
        let (size, count, each) = (camera_paths.camera.size(), levels.count, layout.counts);
        let states = layout.count() * maps.len();
        let line = (64 / size_of::<R::Count>().max(1)).max(1);
        let bands = pixels
            .par_chunks(pixels_per_band(size.0))
            .zip(SampleBuffer::par_of_paths(sppm.samples(), pixels_per_band(size.0)))
            .zip(bandwidths.par_chunks_mut(pixels_per_band(size.0) * states))
            .zip(counts.par_chunks_mut(pixels_per_band(size.0) * states * each));
        let scratches = || maps.iter().map(|_| Scratch::default()).collect::<Vec<_>>();
        par_pixels(bands, size, scratches, |scratches, (((pixels, samples), bandwidths), counts), places| {
            if camera_paths.is_given_up() {
                return;
            }
            for place in places.iter().flatten() {
                let first = place.at * states;
                // The counts of the first kind of photon, which most pixels see. The last may be in a line of its own.
                let counts = &counts[first * each..][..count * each];
                prefetch(counts.iter().step_by(line).chain(counts.last()).copied());
                prefetch([R::radius2(&bandwidths[first])]);
            }
            let starts =
                |[film, streams]: [Streams; 2]| maps[0].tune(camera_paths.starts_through(places, film, streams));
            let independent = starts(independent);
            let correlated = levels.two_paths.then(|| starts(correlated));
            for (k, place) in places.iter().enumerate() {
                let (Some(place), Some(start)) = (place, &independent[k]) else { continue };
                let pixel = &pixels[place.at];
                let bandwidths = &mut bandwidths[place.at * states..][..states];
                let counts = &mut counts[place.at * states * each..][..states * each];
                // Measures some levels by one camera path, with the photons of a channel, and updates them.
                let mut sample =
                    |pixel: &PixelAccumulator, start: &(PathStart, _), channel: usize, levels: Range<usize>| {
                        let (maps, scratch) = (&maps[channel], &mut scratches[channel]);
                        let volume = maps.volume(pixel, levels.clone());
                        let states = layout.states(channel, levels, bandwidths, counts);
                        let mut own = CameraPathBandwidths { rule, states };
                        let sample = camera_paths.sample(scratch, start, &maps.surface, volume, &mut own, kernel);
                        own.finish(i);
                        sample
                    };
                let correlated = correlated.as_ref().and_then(|starts| starts[k].as_ref());
                let own = if correlated.is_some() { 0..1 } else { 0..count };
                let mut first = sample(pixel, start, 0, own.clone());
                let mut others = correlated.map(|start| sample(pixel, start, 0, 1..count));
                // The same camera paths each time: only the photons differ, and those of one channel bring light to it
                // alone.
                for channel in 1..maps.len() {
                    add_photons(&mut first, &sample(pixel, start, channel, own.clone()));
                    if let (Some(others), Some(start)) = (&mut others, correlated) {
                        add_photons(others, &sample(pixel, start, channel, 1..count));
                    }
                }
                samples.0.set(place.at, &first);
                if let (Some(into), Some(others)) = (&mut samples.1, &others) {
                    into.set(place.at, others);
                }
            }
        });
    }
}

/// Adds what photons brought to another measure of the same path.
fn add_photons(all: &mut PixelSample, sample: &PixelSample) {
    let sums = all.caustic_photons.iter_mut().chain(&mut all.indirect_photons).chain(&mut all.volume_photons);
    let photons = sample.caustic_photons.iter().chain(&sample.indirect_photons).chain(&sample.volume_photons);
    for (sum, light) in sums.zip(photons) {
        *sum += *light;
    }
    all.rejection = all.rejection.or(sample.rejection);
}

impl<R: CountingRule, K: Kernel> Integrator for Counting<'_, R, K> {
    fn pixels(&mut self) -> Vec<PixelAccumulator> {
        let pixels = self.sppm.pixels();
        let levels = self.settings.levels;
        let neighbours = match self.settings.initial_bandwidth {
            InitialBandwidth::Nearest(k) => k as f32,
            _ => 0.0,
        };
        let begin = |bandwidth: f32, level: usize| {
            // Each level's area is half that of the next larger, and so is the number of photons it begins with.
            let scale = level_factor2(level, levels.count);
            let above = level as i32 - levels.picture_level() as i32;
            self.rule.begin(bandwidth * bandwidth * scale, neighbours * scale, above)
        };
        let channels = self.channels.map_or(1, |channels| channels.len());
        self.bandwidths = Vec::with_capacity(pixels.len() * channels * self.layout.count());
        for pixel in &pixels {
            for _ in 0..channels {
                for kind in Kind::ALL {
                    let bandwidth = pixel.bandwidths[kind as usize];
                    self.bandwidths.extend((0..self.layout.of_kind(kind)).map(|level| begin(bandwidth, level)));
                }
            }
        }
        self.counts = vec![R::Count::default(); self.bandwidths.len() * self.rule.counts()];
        pixels
    }

    fn iterate(&mut self, i: u64, pixels: &mut [PixelAccumulator], phases: &mut Phases) -> Option<Work> {
        let (maps, work) = match &self.channels {
            None => {
                let (map, work) = self.sppm.map(i, phases);
                (vec![map], work)
            }
            Some(flux) => {
                let (maps, work) = self.sppm.channel_maps(i, flux, phases);
                (Vec::from(maps), work)
            }
        };
        let start = cpu_seconds();
        // Camera paths change them; an iteration that is given up must not have.
        let before = (self.bandwidths.clone(), self.counts.clone());
        self.eye_pass(i, &maps, pixels);
        let done = self.sppm.add(i, pixels, work);
        if done.is_none() {
            (self.bandwidths, self.counts) = before;
        }
        phases.eye += cpu_seconds() - start;
        done
    }

    fn state(&self) -> postcard::Result<Vec<u8>> {
        postcard::to_allocvec(&(&self.bandwidths, &self.counts))
    }

    fn restore(&mut self, state: &[u8]) -> bool {
        let Ok((bandwidths, counts)) = postcard::from_bytes::<(Vec<R::Bandwidth>, Vec<R::Count>)>(state) else {
            return false;
        };
        let fits = (bandwidths.len(), counts.len()) == (self.bandwidths.len(), self.counts.len());
        (self.bandwidths, self.counts) = (bandwidths, counts);
        fits
    }

    fn counted(&self) -> Option<ByKind<Vec<f32>>> {
        // Of three channels the one in the middle.
        let (channels, channel) = if self.channels.is_some() { (3, 1) } else { (1, 0) };
        let count = self.layout.count();
        let of_pixels = self.bandwidths.chunks(channels * count).map(|all| &all[channel * count..][..count]);
        let first = self.layout.of_kind(Kind::Indirect);
        let by_kind = [0..first, first..count].map(|of_kind| {
            let bandwidths = of_pixels.clone().flat_map(|all| &all[of_kind.clone()]);
            bandwidths.map(R::radius2).collect()
        });
        Some(by_kind)
    }
}
