//! The methods whose bandwidths follow from the photons found: the passes of stochastic progressive photon mapping with a state of its own for every
//! pixel and level, and a [`CountingRule`] that says what becomes of it.
//!
//! An iteration depends on all before it, so shards cannot share them out.

use super::control::cpu_seconds;
use super::drive::{Iterate, Work};
use super::method::Method;
use super::result::Phases;
use super::settings::Settings;
use super::sppm::{Sppm, keep_first_hit};
use crate::camera::{band, par_pixels};
use crate::estimator::rule::CountingRule;
use crate::estimator::{InitialBandwidth, Pixel};
use crate::math::{Frame, Vec3};
use crate::photon::{Kernel, PhotonMap};
use crate::random::{Domain, Streams};
use crate::transport::{Bandwidths, EyeMeasure, Found, LevelRadii, MAX_LEVELS, PathStart, Scratch};
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
    fn new(rule: &'a R, bandwidths: &'a [R::Bandwidth], tallies: &'a mut [R::Tally]) -> Counter<'a, R> {
        let mut order = std::array::from_fn(|k| k);
        let radius2 = |level: usize| R::radius2(&bandwidths[level]);
        order[..bandwidths.len()].sort_by(|&a, &b| radius2(a).total_cmp(&radius2(b)));
        Counter { rule, bandwidths, order, tallies, frame: Frame::from_normal(Vec3::Z) }
    }

    fn ascending(&self) -> impl Iterator<Item = usize> {
        self.order.into_iter().take(self.bandwidths.len())
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
    /// Of every pixel and level.
    bandwidths: Vec<R::Bandwidth>,
    /// Of every pixel and level.
    tallies: Vec<R::Tally>,
}

impl<'a, R: CountingRule, K: Kernel> Counting<'a, R, K> {
    /// Nothing done yet.
    pub fn new(sppm: Sppm<'a>, settings: &'a Settings, rule: R, kernel: K) -> Self {
        Counting { sppm, settings, rule, kernel, bandwidths: Vec::new(), tallies: Vec::new() }
    }

    /// Random numbers of the eye paths of a domain in iteration `i`.
    fn streams(&self, i: u64, domain: Domain) -> Streams {
        let seed = self.settings.seed;
        if self.settings.method == Method::Ppm {
            // Measurement points stay where they are \[Hachisuka, Ogaki, Jensen 2008\].
            Streams::new(seed, 1, domain).redrawn(i)
        } else {
            Streams::new(seed, i, domain)
        }
    }

    fn eye_pass(&mut self, i: u64, photons: &PhotonMap, pixels: &mut [Pixel]) {
        let [independent, correlated] =
            [Domain::EyeIndependent, Domain::EyeCorrelated].map(|domain| self.streams(i, domain));
        let Counting { sppm, settings, rule, kernel, bandwidths, tallies } = self;
        let (eye, rule, kernel, levels) = (sppm.eye(), &*rule, *kernel, settings.levels);
        let (size, count, each) = (eye.camera.size(), levels.count, rule.tallies());
        let bands = pixels
            .par_chunks_mut(band(size.0))
            .zip(bandwidths.par_chunks_mut(band(size.0) * count))
            .zip(tallies.par_chunks_mut(band(size.0) * count * each));
        par_pixels(bands, size, Scratch::default, |scratch, ((pixels, bandwidths), tallies), places| {
            let independent = eye.starts(places, independent);
            let correlated = levels.two_paths.then(|| eye.starts(places, correlated));
            for (k, place) in places.iter().enumerate() {
                let (Some(place), Some(start)) = (place, &independent[k]) else { continue };
                let bandwidths = &mut bandwidths[place.at * count..][..count];
                let tallies = &mut tallies[place.at * count * each..][..count * each];
                // Measures some levels by one eye path, and updates them.
                let mut measure = |start: &(PathStart, _), levels: Range<usize>| {
                    let tallies = &mut tallies[levels.start * each..levels.end * each];
                    let bandwidths = &mut bandwidths[levels];
                    let mut counter = Counter::new(rule, bandwidths, tallies);
                    let measure = eye.measure(scratch, start, photons, &mut counter, kernel);
                    let measure = by_level(measure, counter.ascending());
                    rule.update(i, bandwidths, tallies);
                    measure
                };
                let pixel = &mut pixels[place.at];
                match correlated.as_ref().and_then(|starts| starts[k].as_ref()) {
                    Some(correlated) => {
                        let first = measure(start, 0..1);
                        let others = measure(correlated, 1..count);
                        keep_first_hit(&eye, pixel, &first);
                        pixel.add(&first, Some(&others), count, levels.own());
                    }
                    None => {
                        let all = measure(start, 0..count);
                        keep_first_hit(&eye, pixel, &all);
                        pixel.add(&all, None, count, levels.own());
                    }
                }
            }
        });
    }
}

/// A measure whose levels are `ascending` in bandwidth, by level.
fn by_level(mut measure: EyeMeasure, ascending: impl Iterator<Item = usize>) -> EyeMeasure {
    let (caustic, indirect) = (measure.caustic_photons, measure.indirect_photons);
    for (at, level) in ascending.enumerate() {
        measure.caustic_photons[level] = caustic[at];
        measure.indirect_photons[level] = indirect[at];
    }
    measure
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
        self.bandwidths =
            pixels.iter().flat_map(|pixel| (0..levels.count).map(move |level| begin(pixel, level))).collect();
        self.tallies = vec![R::Tally::default(); self.bandwidths.len() * self.rule.tallies()];
        pixels
    }

    fn iterate(&mut self, i: u64, pixels: &mut [Pixel], phases: &mut Phases) -> Work {
        let (map, work) = self.sppm.map(i, phases);
        let start = cpu_seconds();
        self.eye_pass(i, &map, pixels);
        phases.eye += cpu_seconds() - start;
        work
    }

    fn radii(&mut self) -> Vec<f32> {
        self.bandwidths.iter().map(|bandwidth| R::radius2(bandwidth).sqrt()).collect()
    }
}
