//! Chi-squared progressive photon mapping \[CPPM 2020\]: the passes of stochastic progressive photon mapping with a bandwidth of its own for every pixel and
//! level, which shrinks only where the photons counted so far do not look uniform. In media the test is not defined, and bandwidths
//! follow the memoryless rule of volumes.
//!
//! An iteration depends on all before it, so shards cannot share them out.

use super::control::cpu_seconds;
use super::drive::{Iterate, Work};
use super::result::Phases;
use super::settings::Settings;
use super::sppm::{Sppm, keep_first_hit};
use super::volume::Maps;
use crate::camera::{band, par_pixels};
use crate::estimator::rule::chi_squared::{Bandwidth, ChiSquared, LEAST_BOUND};
use crate::estimator::{InitialBandwidth, Pixel};
use crate::math::{Frame, Vec3};
use crate::photon::PhotonMap;
use crate::random::{Domain, Streams};
use crate::transport::{Bandwidths, EyeMeasure, LevelRadii, MAX_LEVELS, PathStart, Scratch};
use rayon::prelude::*;
use std::ops::Range;

/// The bandwidths of some levels, and what is counted within them.
struct Counter<'a> {
    rule: &'a ChiSquared,
    bandwidths: &'a [Bandwidth],
    /// Levels by ascending bandwidth: each shrinks on its own, so they may change places.
    order: [usize; MAX_LEVELS],
    counts: &'a mut [u32],
    frame: Frame,
}

impl<'a> Counter<'a> {
    fn new(rule: &'a ChiSquared, bandwidths: &'a [Bandwidth], counts: &'a mut [u32]) -> Counter<'a> {
        let mut order = std::array::from_fn(|k| k);
        order[..bandwidths.len()].sort_by(|&a, &b| bandwidths[a].radius2.total_cmp(&bandwidths[b].radius2));
        Counter { rule, bandwidths, order, counts, frame: Frame::from_normal(Vec3::Z) }
    }

    fn ascending(&self) -> impl Iterator<Item = usize> {
        self.order.into_iter().take(self.bandwidths.len())
    }
}

impl Bandwidths for &mut Counter<'_> {
    const COUNTS: bool = true;

    #[inline]
    fn at(&mut self, _: &PhotonMap, _: Vec3, ng: Vec3, _: f32) -> LevelRadii {
        // One function of the normal in all iterations: counts of different gathering points are added.
        self.frame = Frame::from_normal(ng);
        LevelRadii::new(self.ascending().map(|level| self.bandwidths[level].radius2))
    }

    #[inline]
    fn count(&mut self, offset: Vec3, distance2: f32) {
        let sector = self.rule.sector(&self.frame, offset);
        for (level, bandwidth) in self.bandwidths.iter().enumerate() {
            if distance2 < bandwidth.radius2 {
                self.counts[level * self.rule.cells() + self.rule.cell(sector, distance2, bandwidth.radius2)] += 1;
            }
        }
    }
}

/// The passes of a render.
pub(super) struct Cppm<'a> {
    /// Its light passes and pilot.
    sppm: Sppm<'a>,
    settings: &'a Settings,
    rule: ChiSquared,
    /// Of every pixel and level.
    bandwidths: Vec<Bandwidth>,
    /// Of every pixel, level and cell.
    counts: Vec<u32>,
}

impl<'a> Cppm<'a> {
    /// Nothing done yet.
    pub fn new(sppm: Sppm<'a>, settings: &'a Settings) -> Cppm<'a> {
        let rule = ChiSquared::new(&settings.chi_squared);
        Cppm { sppm, settings, rule, bandwidths: Vec::new(), counts: Vec::new() }
    }

    fn eye_pass(&mut self, i: u64, maps: &Maps, pixels: &mut [Pixel]) {
        let Cppm { sppm, settings, rule, bandwidths, counts } = self;
        let (eye, rule, levels) = (sppm.eye(), &*rule, settings.levels);
        let (size, count, cells) = (eye.camera.size(), levels.count, rule.cells());
        let [independent, correlated] =
            [Domain::EyeIndependent, Domain::EyeCorrelated].map(|domain| Streams::new(settings.seed, i, domain));
        let bands = pixels
            .par_chunks_mut(band(size.0))
            .zip(bandwidths.par_chunks_mut(band(size.0) * count))
            .zip(counts.par_chunks_mut(band(size.0) * count * cells));
        par_pixels(bands, size, Scratch::default, |scratch, ((pixels, bandwidths), counts), places| {
            let independent = eye.starts(places, independent);
            let correlated = levels.two_paths.then(|| eye.starts(places, correlated));
            for (k, place) in places.iter().enumerate() {
                let (Some(place), Some(start)) = (place, &independent[k]) else { continue };
                let bandwidths = &mut bandwidths[place.at * count..][..count];
                let counts = &mut counts[place.at * count * cells..][..count * cells];
                let pixel = &mut pixels[place.at];
                let mut measure = |pixel: &Pixel, start: &(PathStart, _), levels: Range<usize>| {
                    let first = levels.start;
                    let counts = &mut counts[levels.start * cells..levels.end * cells];
                    let mut counter = Counter::new(rule, &bandwidths[levels], counts);
                    // In the order of the surfaces' bandwidths, though its own follow the levels.
                    let volume = maps.volume(pixel, counter.ascending().map(|level| first + level));
                    let measure = eye.measure(scratch, start, &maps.surface, volume, &mut counter);
                    by_level(measure, counter.ascending())
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
                for (bandwidth, counts) in bandwidths.iter_mut().zip(counts.chunks_mut(cells)) {
                    rule.update(bandwidth, counts);
                }
            }
        });
    }
}

/// A measure whose levels are `ascending` in bandwidth, by level.
fn by_level(mut measure: EyeMeasure, ascending: impl Iterator<Item = usize>) -> EyeMeasure {
    let (caustic, indirect, volume) = (measure.caustic_photons, measure.indirect_photons, measure.volume_photons);
    for (at, level) in ascending.enumerate() {
        measure.caustic_photons[level] = caustic[at];
        measure.indirect_photons[level] = indirect[at];
        measure.volume_photons[level] = volume[at];
    }
    measure
}

impl Iterate for Cppm<'_> {
    fn pixels(&mut self) -> Vec<Pixel> {
        let pixels = self.sppm.pixels();
        let count = self.settings.levels.count;
        let neighbours = match self.settings.initial {
            InitialBandwidth::Nearest(k) => k as f32,
            _ => 0.0,
        };
        // Each level's area is half that of the next larger, and so is the number of photons it began with.
        let scale = |level: usize| 0.5f32.powi((count - 1 - level) as i32);
        let of = |pixel: &Pixel, level: usize| Bandwidth {
            radius2: pixel.bandwidth * pixel.bandwidth * scale(level),
            bound: (neighbours * scale(level)).max(LEAST_BOUND),
        };
        self.bandwidths = pixels.iter().flat_map(|pixel| (0..count).map(move |level| of(pixel, level))).collect();
        self.counts = vec![0; self.bandwidths.len() * self.rule.cells()];
        pixels
    }

    fn iterate(&mut self, i: u64, pixels: &mut [Pixel], phases: &mut Phases) -> Work {
        let (maps, work) = self.sppm.map(i, phases);
        let start = cpu_seconds();
        self.eye_pass(i, &maps, pixels);
        phases.eye += cpu_seconds() - start;
        work
    }

    fn radii(&mut self) -> Vec<f32> {
        self.bandwidths.iter().map(|bandwidth| bandwidth.radius2.sqrt()).collect()
    }
}
