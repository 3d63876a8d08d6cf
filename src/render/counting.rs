//! The methods whose bandwidths follow from the photons found: the passes of stochastic progressive photon mapping with a state of its own for every
//! pixel, kind of photons and level, and a [`CountingRule`] that says what becomes of it.
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
use crate::photon::{ByKind, Kernel, Kind, PhotonMap};
use crate::random::{Domain, Streams};
use crate::transport::{Bandwidths, EqualFlux, EyeMeasure, Found, LevelRadii, MAX_LEVELS, PathStart, Scratch};
use rayon::prelude::*;
use std::ops::Range;

/// The bandwidths of some levels for one kind of photons, and what is counted within them.
struct States<'a, R: CountingRule> {
    bandwidths: &'a mut [R::Bandwidth],
    /// Levels by ascending bandwidth: each may shrink on its own, so they may change places.
    order: [usize; MAX_LEVELS],
    tallies: &'a mut [R::Tally],
}

impl<'a, R: CountingRule> States<'a, R> {
    #[inline]
    fn new(bandwidths: &'a mut [R::Bandwidth], tallies: &'a mut [R::Tally]) -> States<'a, R> {
        let mut order = std::array::from_fn(|k| k);
        let radius2 = |level: usize| R::radius2(&bandwidths[level]);
        if !bandwidths.is_sorted_by(|a, b| R::radius2(a) <= R::radius2(b)) {
            order[..bandwidths.len()].sort_by(|&a, &b| radius2(a).total_cmp(&radius2(b)));
        }
        States { bandwidths, order, tallies }
    }

    fn ascending(&self) -> impl Iterator<Item = usize> {
        self.order.into_iter().take(self.bandwidths.len())
    }
}

/// Both kinds; of one that is not there, no levels.
struct Counter<'a, R: CountingRule> {
    rule: &'a R,
    states: ByKind<States<'a, R>>,
    /// What is being counted, and where.
    kind: Kind,
    frame: Frame,
}

impl<'a, R: CountingRule> Counter<'a, R> {
    #[inline]
    fn new(rule: &'a R, states: ByKind<States<'a, R>>) -> Counter<'a, R> {
        Counter { rule, states, kind: Kind::Indirect, frame: Frame::from_normal(Vec3::Z) }
    }

    /// After the eye path of iteration `i`.
    #[inline]
    fn finish(self, i: u64) {
        for States { bandwidths, tallies, .. } in self.states {
            if !bandwidths.is_empty() {
                self.rule.update(i, bandwidths, tallies);
            }
        }
    }
}

impl<R: CountingRule> Bandwidths for &mut Counter<'_, R> {
    const COUNTS: bool = true;

    #[inline]
    fn at(&mut self, kind: Kind, _: &PhotonMap, _: Vec3, ng: Vec3, _: f32) -> LevelRadii {
        // One function of the normal in all iterations: counts of different gathering points are added.
        (self.kind, self.frame) = (kind, Frame::from_normal(ng));
        let states = &self.states[kind as usize];
        LevelRadii::new(states.ascending().map(|level| R::radius2(&states.bandwidths[level]))).of(states.order)
    }

    #[inline]
    fn reach2(&self, largest2: f32) -> f32 {
        self.rule.reach2(self.states[self.kind as usize].bandwidths, largest2)
    }

    #[inline]
    fn count(&mut self, photon: &Found) {
        let States { bandwidths, tallies, .. } = &mut self.states[self.kind as usize];
        self.rule.count(bandwidths, tallies, &self.frame, photon);
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
    /// Kinds of photons that there are.
    kinds: ByKind<bool>,
    /// Of every pixel, channel, kind and level.
    bandwidths: Vec<R::Bandwidth>,
    /// Of every pixel, channel, kind and level.
    tallies: Vec<R::Tally>,
}

impl<'a, R: CountingRule, K: Kernel> Counting<'a, R, K> {
    /// Nothing done yet.
    pub fn new(sppm: Sppm<'a>, settings: &'a Settings, rule: R, kernel: K) -> Self {
        let apart = settings.method == Method::Cppm && settings.chi_squared.plus;
        let channels = apart.then(|| sppm.equal_flux());
        // Where photons bring nothing, pixels still have a state.
        let kinds = match sppm.kinds() {
            [false, false] => [true, false],
            kinds => kinds,
        };
        Counting { sppm, settings, rule, kernel, channels, kinds, bandwidths: Vec::new(), tallies: Vec::new() }
    }

    /// Random numbers of the eye paths of a domain in iteration `i`: for their points on film and lens, and for all else.
    fn streams(&self, i: u64, domain: Domain) -> [Streams; 2] {
        // Measurement points stay where they are \[Hachisuka, Ogaki, Jensen 2008\]: what one point of the film sees, all of it if it is by glass.
        let film = if self.settings.method == Method::Ppm { 1 } else { i };
        [film, i].map(|pass| Streams::new(self.settings.seed, pass, domain))
    }

    /// Bandwidths of a pixel and channel.
    fn states(&self) -> usize {
        self.settings.levels.count * self.kinds.iter().filter(|there| **there).count()
    }

    /// `maps` holds the photons, or those of each channel.
    fn eye_pass(&mut self, i: u64, maps: &[Maps], pixels: &mut [Pixel]) {
        let [independent, correlated] =
            [Domain::EyeIndependent, Domain::EyeCorrelated].map(|domain| self.streams(i, domain));
        let each_map = self.states();
        let Counting { sppm, settings, rule, kernel, kinds, bandwidths, tallies, .. } = self;
        let (eye, rule, kernel, levels) = (sppm.eye(), &*rule, *kernel, settings.levels);
        let (size, count, each) = (eye.camera.size(), levels.count, rule.tallies());
        let states = each_map * maps.len();
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
                let mut measure =
                    |pixel: &Pixel, start: &(PathStart, _), levels: Range<usize>, into: &mut EyeMeasure| {
                        let mut channel = |channel: usize, into: &mut EyeMeasure| {
                            let volume = maps[channel].volume(pixel, levels.clone());
                            let own = channel * each_map..(channel + 1) * each_map;
                            let mut of_kinds = bandwidths[own.clone()]
                                .chunks_exact_mut(count)
                                .zip(tallies[own.start * each..own.end * each].chunks_exact_mut(count * each));
                            let mut counter = Counter::new(
                                rule,
                                kinds.map(|there| {
                                    let some = if there { of_kinds.next() } else { None };
                                    let (bandwidths, tallies) = some.unwrap_or_default();
                                    let levels = levels.start.min(bandwidths.len())..levels.end.min(bandwidths.len());
                                    let counted = levels.start * each..levels.end * each;
                                    States::new(&mut bandwidths[levels], &mut tallies[counted])
                                }),
                            );
                            let scratch = &mut scratches[channel];
                            let photons = &maps[channel].surface;
                            *into = eye.measure(scratch, start, photons, volume, &mut counter, kernel);
                            counter.finish(i);
                        };
                        channel(0, into);
                        // The same eye path each time: only the photons differ, and those of one channel bring light to it alone.
                        for other in 1..maps.len() {
                            let mut more = EyeMeasure::default();
                            channel(other, &mut more);
                            add_photons(into, &more);
                        }
                    };
                let (mut first, mut others) = (EyeMeasure::default(), EyeMeasure::default());
                match correlated.as_ref().and_then(|starts| starts[k].as_ref()) {
                    Some(correlated) => {
                        measure(pixel, start, 0..1, &mut first);
                        measure(pixel, correlated, 1..count, &mut others);
                        keep_first_hit(&eye, pixel, &first);
                        pixel.add(&first, Some(&others), count, levels.own());
                    }
                    None => {
                        measure(pixel, start, 0..count, &mut first);
                        keep_first_hit(&eye, pixel, &first);
                        pixel.add(&first, None, count, levels.own());
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
        let begin = |bandwidth: f32, level: usize| {
            // Each level's area is half that of the next larger, and so is the number of photons it begins with.
            let scale = 0.5f32.powi((levels.count - 1 - level) as i32);
            let above = level as i32 - levels.own() as i32;
            self.rule.begin(bandwidth * bandwidth * scale, neighbours * scale, above)
        };
        let channels = self.channels.map_or(1, |channels| channels.len());
        self.bandwidths = Vec::with_capacity(pixels.len() * channels * self.states());
        for pixel in &pixels {
            for _ in 0..channels {
                for kind in Kind::ALL.into_iter().filter(|kind| self.kinds[*kind as usize]) {
                    let bandwidth = pixel.bandwidths[kind as usize];
                    self.bandwidths.extend((0..levels.count).map(|level| begin(bandwidth, level)));
                }
            }
        }
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

    fn radii(&mut self) -> ByKind<Vec<f32>> {
        let (count, each) = (self.settings.levels.count, self.states());
        // Of three channels the one in the middle.
        let (all, first) = if self.channels.is_some() { (3 * each, each) } else { (each, 0) };
        let mut shown = first..first;
        self.kinds.map(|there| {
            if !there {
                return Vec::new();
            }
            shown = shown.end..shown.end + count;
            let bandwidths = self.bandwidths.chunks(all).flat_map(|bandwidths| &bandwidths[shown.clone()]);
            bandwidths.map(|bandwidth| R::radius2(bandwidth).sqrt()).collect()
        })
    }
}
