//! The samples of all pixels during an iteration. Light of one pixel's paths arrives in others, and an iteration that is
//! aborted counts for no pixel. A sample with one level takes half the bytes of one that has room for all levels.

use super::tiles::TILE_PIXELS;
use crate::estimator::PixelAccumulator;
use crate::math::{Rgb, is_lit};
use crate::photon::ByKind;
use crate::render::settings::{Levels, Settings};
use crate::transport::{CameraPaths, Cause, Features, FirstHit, LobeLight, PixelSample};
use rayon::prelude::*;
use std::mem::size_of;

/// Pixels that one parallel task updates after an iteration.
const PIXELS_PER_TASK: usize = 1024;

/// Parts of a pixel's sample that do not depend on the bandwidth level.
#[derive(Clone, Copy, Default)]
struct Shared {
    emission: Rgb,
    direct: Rgb,
    indirect: Rgb,
    volume: Rgb,
    merge_difference: Rgb,
    features: Features,
    first: Option<FirstHit>,
    rejection: Option<Cause>,
}

/// Parts of a pixel's sample that depend on the bandwidth level: caustics, indirect light and light from media.
type OfLevel = [Rgb; 3];

/// Bytes per pixel for the samples of one iteration, besides the pixel's sums over iterations.
pub fn sample_bytes(settings: &Settings) -> usize {
    let pairs = 1 + usize::from(settings.levels.two_paths);
    let lobes = if settings.lobes { size_of::<LobeLight>() } else { 0 };
    lobes
        + match settings.method.has_chains() {
            true => size_of::<PixelSample>(),
            false => pairs * size_of::<Shared>() + settings.levels.count * size_of::<OfLevel>(),
        }
}

/// Samples that one iteration has measured for all pixels, in the order of the parallel tasks.
pub(super) struct SampleBuffer {
    levels: usize,
    shared: Vec<Shared>,
    by_level: Vec<OfLevel>,
    /// Light by the lobe of the first hit; empty unless it is recorded here.
    lobes: Vec<LobeLight>,
}

impl SampleBuffer {
    /// Buffers for the samples of a render, one per camera path of a pixel: one or two.
    pub fn of_paths(pixels: usize, levels: Levels) -> Vec<SampleBuffer> {
        if levels.two_paths {
            vec![SampleBuffer::new(pixels, 1), SampleBuffer::new(pixels, levels.count.max(2) - 1)]
        } else {
            vec![SampleBuffer::new(pixels, levels.count)]
        }
    }

    /// A black buffer for the samples of `pixels` pixels at `levels` bandwidth levels.
    pub fn new(pixels: usize, levels: usize) -> SampleBuffer {
        let by_level = vec![OfLevel::default(); pixels * levels];
        SampleBuffer { levels, shared: vec![Shared::default(); pixels], by_level, lobes: Vec::new() }
    }

    /// The buffers of the camera paths of a pixel, which also have room for the light by the lobe of the first hit at the
    /// picture's level if `lobes` is true.
    pub fn with_lobes(mut all: Vec<SampleBuffer>, lobes: bool) -> Vec<SampleBuffer> {
        if let Some(last) = all.last_mut().filter(|_| lobes) {
            last.lobes = vec![LobeLight::default(); last.shared.len()];
        }
        all
    }

    /// The buffer divided into the samples of each tile, for parallel tasks.
    pub fn par_tiles(&mut self) -> impl IndexedParallelIterator<Item = SampleBufferPart<'_>> {
        self.par_parts(TILE_PIXELS)
    }

    /// The buffer divided into the samples of `pixels` pixels each, for parallel tasks.
    pub fn par_parts(&mut self, pixels: usize) -> impl IndexedParallelIterator<Item = SampleBufferPart<'_>> {
        let levels = self.levels;
        let by_level = self.by_level.par_chunks_mut(pixels * levels);
        let mut lobes: Vec<&mut [LobeLight]> = self.lobes.chunks_mut(pixels).collect();
        lobes.resize_with(self.shared.len().div_ceil(pixels), Default::default);
        let part = move |((shared, by_level), lobes)| SampleBufferPart { levels, shared, by_level, lobes };
        self.shared.par_chunks_mut(pixels).zip(by_level).zip(lobes).map(part)
    }

    /// The buffers of one or two camera paths, each divided into the samples of `pixels` pixels, for parallel tasks.
    /// The second part is `None` if pixels have one camera path.
    pub fn par_of_paths(
        all: &mut [SampleBuffer],
        pixels: usize,
    ) -> impl IndexedParallelIterator<Item = (SampleBufferPart<'_>, Option<SampleBufferPart<'_>>)> {
        let (first, others) = all.split_at_mut(1);
        let first: Vec<_> = first[0].par_parts(pixels).collect();
        let mut others: Vec<_> =
            others.iter_mut().flat_map(|others| others.par_parts(pixels).collect::<Vec<_>>()).map(Some).collect();
        others.resize_with(first.len(), || None);
        first.into_par_iter().zip(others)
    }

    /// The sample of the pixel at index `slot` of the buffer.
    #[inline]
    pub fn get(&self, slot: usize) -> PixelSample {
        unpack(&self.shared[slot], &self.by_level[slot * self.levels..][..self.levels])
    }
}

/// Samples of the pixels of one parallel task.
pub(super) struct SampleBufferPart<'m> {
    levels: usize,
    shared: &'m mut [Shared],
    by_level: &'m mut [OfLevel],
    lobes: &'m mut [LobeLight],
}

impl SampleBufferPart<'_> {
    /// The sample at index `slot` of this part.
    #[inline]
    pub fn get(&self, slot: usize) -> PixelSample {
        unpack(&self.shared[slot], &self.by_level[slot * self.levels..][..self.levels])
    }

    /// Stores light by the lobe of the first hit at index `slot` of this part, if the buffer has room for it.
    #[inline]
    pub fn set_lobes(&mut self, slot: usize, light: &LobeLight) {
        if let Some(lobes) = self.lobes.get_mut(slot) {
            *lobes = *light;
        }
    }

    /// Stores a sample at index `slot` of this part. Light at levels beyond those of the buffer is lost.
    #[inline]
    pub fn set(&mut self, slot: usize, sample: &PixelSample) {
        let &PixelSample { emission, direct, indirect, volume, merge_difference, features, first, rejection, .. } =
            sample;
        self.shared[slot] = Shared { emission, direct, indirect, volume, merge_difference, features, first, rejection };
        for (level, into) in self.by_level[slot * self.levels..][..self.levels].iter_mut().enumerate() {
            *into = [sample.caustic_photons[level], sample.indirect_photons[level], sample.volume_photons[level]];
        }
    }
}

/// Adds the samples of iteration `i`, by one or two camera paths, to the pixels. `slot` gives the place of a pixel in
/// the buffers, `groups` its light by light group and by the lobe of the first hit. Returns for each kind of photons the number of pixels to whose own
/// image it has brought light.
pub(super) fn add<'g>(
    samples: &[SampleBuffer],
    camera_paths: &CameraPaths<'_>,
    i: u64,
    pixels: &mut [PixelAccumulator],
    slot: impl Fn(usize) -> usize + Sync,
    groups: impl Fn(usize) -> (&'g [[Rgb; 2]], Option<&'g LobeLight>) + Sync,
) -> ByKind<u64> {
    let add = |(index, pixel): (usize, &mut PixelAccumulator)| {
        let slot = slot(index);
        let sample = samples[0].get(slot);
        pixel.record_first_hit(i, || camera_paths.first_hit(&sample));
        let others = samples.get(1).map(|samples| samples.get(slot));
        let (own, level) = pixel.picture_sample(&sample, others.as_ref());
        let light = [own.indirect_photons[level], own.caustic_photons[level]];
        let (groups, lobes) = groups(slot);
        let lobes = lobes.or_else(|| samples.last().and_then(|samples| samples.lobes.get(slot)));
        pixel.add_with_groups(i, &sample, others.as_ref(), groups, lobes);
        light.map(|light| u64::from(is_lit(light)))
    };
    let all = |(part, pixels): (usize, &mut [PixelAccumulator])| {
        let indices = part * PIXELS_PER_TASK..;
        indices.zip(pixels).map(add).fold([0; 2], |[a, b], [c, d]| [a + c, b + d])
    };
    let parts: Vec<ByKind<u64>> = pixels.par_chunks_mut(PIXELS_PER_TASK).enumerate().map(all).collect();
    parts.iter().fold([0; 2], |[a, b], [c, d]| [a + c, b + d])
}

#[inline]
fn unpack(shared: &Shared, by_level: &[OfLevel]) -> PixelSample {
    let Shared { emission, direct, indirect, volume, merge_difference, features, first, rejection } = *shared;
    let mut sample = PixelSample {
        emission,
        direct,
        indirect,
        volume,
        merge_difference,
        features,
        first,
        rejection,
        ..PixelSample::default()
    };
    for (level, &[caustic, indirect, volume]) in by_level.iter().enumerate() {
        sample.caustic_photons[level] = caustic;
        sample.indirect_photons[level] = indirect;
        sample.volume_photons[level] = volume;
    }
    sample
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::MAX_LEVELS;

    /// A sample is read as it was stored, whatever its neighbours are.
    #[test]
    fn a_measure_comes_back() {
        for levels in [1, 4, MAX_LEVELS] {
            let mut samples = SampleBuffer::new(2 * TILE_PIXELS, levels);
            let sample = |at: usize| {
                let value = |k: usize| Rgb::new(at as f32, k as f32, 0.5);
                let mut sample = PixelSample { emission: value(1), direct: value(2), ..PixelSample::default() };
                (sample.indirect, sample.volume, sample.merge_difference) = (value(3), value(4), value(6));
                sample.features.depth = at as f32;
                sample.first = at.is_multiple_of(2).then_some(FirstHit { p: value(5), instance: at as u32 });
                sample.rejection = at.is_multiple_of(3).then_some(Cause::Sum);
                for level in 0..levels {
                    sample.caustic_photons[level] = value(10 + level);
                    sample.indirect_photons[level] = value(20 + level);
                    sample.volume_photons[level] = value(30 + level);
                }
                sample
            };
            samples.par_tiles().enumerate().for_each(|(tile, mut samples)| {
                for slot in 0..TILE_PIXELS {
                    samples.set(slot, &sample(tile * TILE_PIXELS + slot));
                    let kept = samples.get(slot);
                    assert_eq!(format!("{kept:?}"), format!("{:?}", sample(tile * TILE_PIXELS + slot)));
                }
            });
            for at in 0..2 * TILE_PIXELS {
                assert_eq!(format!("{:?}", samples.get(at)), format!("{:?}", sample(at)));
            }
        }
    }
}
