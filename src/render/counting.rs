//! The methods whose bandwidths follow from the photons found: the passes of stochastic progressive photon mapping with a state of its own for every
//! pixel and level, and a [`CountingRule`] that says what becomes of it.
//!
//! In media the rules are not defined, and bandwidths follow the memoryless rule of volumes.
//!
//! An iteration depends on all before it, so shards cannot share them out.

use super::control::cpu_seconds;
use super::drive::{Iterate, Work};
use super::method::Method;
use super::result::Phases;
use super::settings::Settings;
use super::sppm::{Sppm, keep_first_hit};
use super::volume::Maps;
use crate::camera::{band, par_pixels};
use crate::estimator::rule::CountingRule;
use crate::estimator::{InitialBandwidth, Pixel};
use crate::math::{Frame, Vec3};
use crate::photon::{Kernel, PhotonMap};
use crate::random::{Domain, Streams};
use crate::transport::{Bandwidths, EqualFlux, EyeMeasure, Found, LevelRadii, MAX_LEVELS, PathStart, Scratch};
use rayon::prelude::*;
use std::ops::Range;

/// The bandwidths of some levels, and what is counted within them.
struct Counter<'a, R: CountingRule> {
    rule: &'a R,
    bandwidths: &'a [R::Bandwidth],
    /// Levels by ascending bandwidth: each may shrink on its own, so they may change places.
    order: [usize; MAX_LEVELS],
    tallies: &'a mut [R::Tally],
    frame: Frame,
}

impl<'a, R: CountingRule> Counter<'a, R> {
    #[inline]
    fn new(rule: &'a R, bandwidths: &'a [R::Bandwidth], tallies: &'a mut [R::Tally]) -> Counter<'a, R> {
        let mut order = std::array::from_fn(|k| k);
        let radius2 = |level: usize| R::radius2(&bandwidths[level]);
        if !bandwidths.is_sorted_by(|a, b| R::radius2(a) <= R::radius2(b)) {
            order[..bandwidths.len()].sort_by(|&a, &b| radius2(a).total_cmp(&radius2(b)));
        }
        Counter { rule, bandwidths, order, tallies, frame: Frame::from_normal(Vec3::Z) }
    }

    fn ascending(&self) -> impl Iterator<Item = usize> {
        self.order.into_iter().take(self.bandwidths.len())
    }

    /// Puts the levels of photons on surfaces, which are in the order of bandwidths, where they belong.
    #[inline]
    fn by_level(&self, measure: &mut EyeMeasure) {
        if self.order.is_sorted() {
            return;
        }
        let (caustic, indirect) = (measure.caustic_photons, measure.indirect_photons);
        for (at, level) in self.ascending().enumerate() {
            measure.caustic_photons[level] = caustic[at];
            measure.indirect_photons[level] = indirect[at];
        }
    }
}

impl<R: CountingRule> Bandwidths for &mut Counter<'_, R> {
    const COUNTS: bool = true;

    #[inline]
    fn at(&mut self, _: &PhotonMap, _: Vec3, ng: Vec3, _: f32) -> LevelRadii {
        // One function of the normal in all iterations: counts of different gathering points are added.
        self.frame = Frame::from_normal(ng);
        LevelRadii::new(self.ascending().map(|level| R::radius2(&self.bandwidths[level])))
    }

    #[inline]
    fn reach2(&self, largest2: f32) -> f32 {
        self.rule.reach2(self.bandwidths, largest2)
    }

    #[inline]
    fn count(&mut self, photon: &Found) {
        self.rule.count(self.bandwidths, self.tallies, &self.frame, photon);
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
    /// Of every pixel, channel and level.
    bandwidths: Vec<R::Bandwidth>,
    /// Of every pixel, channel and level.
    tallies: Vec<R::Tally>,
}

impl<'a, R: CountingRule, K: Kernel> Counting<'a, R, K> {
    /// Nothing done yet.
    pub fn new(sppm: Sppm<'a>, settings: &'a Settings, rule: R, kernel: K) -> Self {
        let apart = settings.method == Method::Cppm && settings.chi_squared.plus;
        let channels = apart.then(|| sppm.equal_flux());
        Counting { sppm, settings, rule, kernel, channels, bandwidths: Vec::new(), tallies: Vec::new() }
    }

    /// Random numbers of the eye paths of a domain in iteration `i`: for their points on film and lens, and for all else.
    fn streams(&self, i: u64, domain: Domain) -> [Streams; 2] {
        // Measurement points stay where they are \[Hachisuka, Ogaki, Jensen 2008\]: what one point of the film sees, all of it if it is by glass.
        let film = if self.settings.method == Method::Ppm { 1 } else { i };
        [film, i].map(|pass| Streams::new(self.settings.seed, pass, domain))
    }

    /// `maps` holds the photons, or those of each channel.
    fn eye_pass(&mut self, i: u64, maps: &[Maps], pixels: &mut [Pixel]) {
        let [independent, correlated] =
            [Domain::EyeIndependent, Domain::EyeCorrelated].map(|domain| self.streams(i, domain));
        let Counting { sppm, settings, rule, kernel, bandwidths, tallies, .. } = self;
        let (eye, rule, kernel, levels) = (sppm.eye(), &*rule, *kernel, settings.levels);
        let (size, count, each) = (eye.camera.size(), levels.count, rule.tallies());
        let states = count * maps.len();
        let bands = pixels
            .par_chunks_mut(band(size.0))
            .zip(bandwidths.par_chunks_mut(band(size.0) * states))
            .zip(tallies.par_chunks_mut(band(size.0) * states * each));
        let scratches = || maps.iter().map(|_| Scratch::default()).collect::<Vec<_>>();
        par_pixels(bands, size, scratches, |scratches, ((pixels, bandwidths), tallies), places| {
            let waiting = places.iter().flatten().map(|place| {
                let (first, end) = (place.at * states, (place.at + 1) * states);
                std::hint::black_box((tallies[first * each], tallies[end * each - 1]));
                pixels[place.at].touch() + f64::from(R::radius2(&bandwidths[first]))
            });
            std::hint::black_box(waiting.sum::<f64>());
            let starts = |[film, streams]: [Streams; 2]| maps[0].tune(eye.starts_through(places, film, streams));
            let independent = starts(independent);
            let correlated = levels.two_paths.then(|| starts(correlated));
            for (k, place) in places.iter().enumerate() {
                let (Some(place), Some(start)) = (place, &independent[k]) else { continue };
                let pixel = &mut pixels[place.at];
                let bandwidths = &mut bandwidths[place.at * states..][..states];
                let tallies = &mut tallies[place.at * states * each..][..states * each];
                // Measures some levels by one eye path, and updates them.
                let mut measure = |pixel: &Pixel, start: &(PathStart, _), levels: Range<usize>| {
                    let mut channel = |channel: usize| {
                        let volume = maps[channel].volume(pixel, levels.clone());
                        let levels = channel * count + levels.start..channel * count + levels.end;
                        let tallies = &mut tallies[levels.start * each..levels.end * each];
                        let bandwidths = &mut bandwidths[levels];
                        let mut counter = Counter::new(rule, bandwidths, tallies);
                        let scratch = &mut scratches[channel];
                        let photons = &maps[channel].surface;
                        let mut measure = eye.measure(scratch, start, photons, volume, &mut counter, kernel);
                        counter.by_level(&mut measure);
                        rule.update(i, bandwidths, tallies);
                        measure
                    };
                    let mut all = channel(0);
                    // The same eye path each time: only the photons differ, and those of one channel bring light to it alone.
                    for other in 1..maps.len() {
                        add_photons(&mut all, &channel(other));
                    }
                    all
                };
                match correlated.as_ref().and_then(|starts| starts[k].as_ref()) {
                    Some(correlated) => {
                        let first = measure(pixel, start, 0..1);
                        let others = measure(pixel, correlated, 1..count);
                        keep_first_hit(&eye, pixel, &first);
                        pixel.add(&first, Some(&others), count, levels.own());
                    }
                    None => {
                        let all = measure(pixel, start, 0..count);
                        keep_first_hit(&eye, pixel, &all);
                        pixel.add(&all, None, count, levels.own());
                    }
                }
            }
        });
    }
}

/// Adds what photons brought to another measure of the same path.
fn add_photons(all: &mut EyeMeasure, measure: &EyeMeasure) {
    let sums = all.caustic_photons.iter_mut().chain(&mut all.indirect_photons).chain(&mut all.volume_photons);
    let photons = measure.caustic_photons.iter().chain(&measure.indirect_photons).chain(&measure.volume_photons);
    for (sum, light) in sums.zip(photons) {
        *sum += *light;
    }
}

impl<R: CountingRule, K: Kernel> Iterate for Counting<'_, R, K> {
    fn pixels(&mut self) -> Vec<Pixel> {
        let pixels = self.sppm.pixels();
        let levels = self.settings.levels;
        let neighbours = match self.settings.initial {
            InitialBandwidth::Nearest(k) => k as f32,
            _ => 0.0,
        };
        let begin = |pixel: &Pixel, level: usize| {
            // Each level's area is half that of the next larger, and so is the number of photons it begins with.
            let scale = 0.5f32.powi((levels.count - 1 - level) as i32);
            let above = level as i32 - levels.own() as i32;
            self.rule.begin(pixel.bandwidth * pixel.bandwidth * scale, neighbours * scale, above)
        };
        let states = levels.count * self.channels.map_or(1, |channels| channels.len());
        let bandwidths = pixels.iter().flat_map(|pixel| (0..states).map(move |k| begin(pixel, k % levels.count)));
        self.bandwidths = bandwidths.collect();
        self.tallies = vec![R::Tally::default(); self.bandwidths.len() * self.rule.tallies()];
        pixels
    }

    fn iterate(&mut self, i: u64, pixels: &mut [Pixel], phases: &mut Phases) -> Work {
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
        self.eye_pass(i, &maps, pixels);
        phases.eye += cpu_seconds() - start;
        work
    }

    fn radii(&mut self) -> Vec<f32> {
        let count = self.settings.levels.count;
        // Of three channels the one in the middle.
        let (all, shown) = if self.channels.is_some() { (3 * count, count..2 * count) } else { (count, 0..count) };
        let bandwidths = self.bandwidths.chunks(all).flat_map(|bandwidths| &bandwidths[shown.clone()]);
        bandwidths.map(|bandwidth| R::radius2(bandwidth).sqrt()).collect()
    }
}
