//! The bandwidths of all pixels, by rule: the memoryless rule derives them from the iteration's number ([`Scheduled`]),
//! the other rules keep a state for every pixel, channel, kind of photons and level ([`Counted`]).
//!
//! In media all methods follow the memoryless rule of volumes.

use crate::estimator::rule::CountingRule;
use crate::estimator::{PixelAccumulator, Schedule, level_factor2};
use crate::math::{Frame, Vec3};
use crate::photon::{ByKind, Kind, PhotonMap};
use crate::processor::prefetch;
use crate::render::initial_bandwidth::InitialBandwidth;
use crate::render::settings::Settings;
use crate::transport::{FoundPhotons, GatherBandwidths, LevelBandwidths, PhotonCounter};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// The bandwidths of all pixels under one rule.
pub(super) trait PixelBandwidths: Clone {
    /// Bandwidths of the pixels of one parallel task.
    type Chunk<'c>: BandwidthChunk
    where
        Self: 'c;

    /// Sets the bandwidths of all pixels before the first iteration. `indirect_cap2` is the largest squared bandwidth
    /// after a camera path's first broad bounce.
    fn start(&mut self, pixels: &[PixelAccumulator], indirect_cap2: f32);

    /// The bandwidths of iteration `i`, divided into parallel tasks of `size` pixels.
    fn par_chunks(&mut self, i: u64, size: usize) -> impl IndexedParallelIterator<Item = Self::Chunk<'_>>;

    /// Squared bandwidths after the last iteration by kind of photons, of every pixel and level (square scene units); `None` if
    /// they follow from the iteration's number.
    fn bandwidths2(&self) -> Option<ByKind<Vec<f32>>>;

    /// The state of the bandwidths that the next iteration needs, serialized.
    ///
    /// # Errors
    /// None: it is written to memory.
    fn state(&self) -> postcard::Result<Vec<u8>>;

    /// Restores a serialized state of the bandwidths. Returns false if it belongs to another render.
    fn restore(&mut self, state: &[u8]) -> bool;
}

/// Bandwidths of the pixels of one parallel task.
pub(super) trait BandwidthChunk: Send {
    /// Bandwidths that one camera path uses.
    type Path<'p>: PathBandwidths
    where
        Self: 'p;

    /// Loads the state of the pixel at index `at` of the task into the cache.
    #[inline(always)]
    fn prefetch(&self, _at: usize) {}

    /// The bandwidths of a camera path of the pixel at index `at` of the task that samples `levels` of a colour channel.
    fn path(&mut self, at: usize, channel: usize, levels: Range<usize>) -> Self::Path<'_>;
}

/// Bandwidths that one camera path uses.
pub(super) trait PathBandwidths: GatherBandwidths {
    /// Updates the bandwidths of the pixel after the camera path has ended.
    #[inline(always)]
    fn finish(&mut self) {}
}

/// Bandwidths of all pixels under the memoryless rule, which only needs the number of the iteration.
#[derive(Clone)]
pub(super) struct Scheduled<'a> {
    settings: &'a Settings,
    /// Initial bandwidths of all pixels by kind of photons (scene units), apart from the accumulators: every iteration reads
    /// them before its camera paths, and the accumulators, a kilobyte each, would miss the cache.
    initial: Arc<[ByKind<f32>]>,
    indirect_cap2: f32,
}

impl<'a> Scheduled<'a> {
    pub fn new(settings: &'a Settings) -> Scheduled<'a> {
        Scheduled { settings, initial: Arc::default(), indirect_cap2: f32::INFINITY }
    }
}

impl PixelBandwidths for Scheduled<'_> {
    type Chunk<'c>
        = ScheduledChunk<'c>
    where
        Self: 'c;

    fn start(&mut self, pixels: &[PixelAccumulator], indirect_cap2: f32) {
        self.initial = pixels.iter().map(|pixel| pixel.bandwidths).collect();
        self.indirect_cap2 = indirect_cap2;
    }

    fn par_chunks(&mut self, i: u64, size: usize) -> impl IndexedParallelIterator<Item = ScheduledChunk<'_>> {
        let schedule = self.settings.schedule(i);
        let indirect_cap2 = self.indirect_cap2 * schedule.factor2();
        self.initial.par_chunks(size).map(move |initial| ScheduledChunk { initial, schedule, indirect_cap2 })
    }

    fn bandwidths2(&self) -> Option<ByKind<Vec<f32>>> {
        None
    }

    fn state(&self) -> postcard::Result<Vec<u8>> {
        Ok(Vec::new())
    }

    fn restore(&mut self, state: &[u8]) -> bool {
        state.is_empty()
    }
}

/// Bandwidths of the pixels of one parallel task under the memoryless rule, in one iteration.
#[derive(Clone, Copy)]
pub(super) struct ScheduledChunk<'c> {
    initial: &'c [ByKind<f32>],
    schedule: Schedule,
    indirect_cap2: f32,
}

impl BandwidthChunk for ScheduledChunk<'_> {
    type Path<'p>
        = ByKind<LevelBandwidths>
    where
        Self: 'p;

    #[inline(always)]
    fn path(&mut self, at: usize, _: usize, levels: Range<usize>) -> ByKind<LevelBandwidths> {
        self.initial[at].map(|bandwidth| {
            let bandwidths2 = levels.clone().map(|level| self.schedule.bandwidth2(bandwidth, level));
            LevelBandwidths::new(bandwidths2).capped_after_broad_bounce(self.indirect_cap2)
        })
    }
}

impl PathBandwidths for ByKind<LevelBandwidths> {}

/// Arrangement in memory of the bandwidths of a pixel: by colour channel, then by kind of photons, then by level.
#[derive(Clone, Copy)]
struct Layout {
    /// For each kind of photons, whether it exists and has bandwidths.
    kinds: ByKind<bool>,
    levels: usize,
    /// Number of photon counts per bandwidth.
    counts: usize,
    channels: usize,
}

impl Layout {
    /// Number of bandwidths for a kind of photons in one colour channel.
    #[inline(always)]
    fn kind_len(&self, kind: Kind) -> usize {
        if self.kinds[kind as usize] { self.levels } else { 0 }
    }

    /// Number of bandwidths in one colour channel.
    #[inline(always)]
    fn channel_len(&self) -> usize {
        self.kind_len(Kind::Indirect) + self.kind_len(Kind::Caustic)
    }

    /// Number of bandwidths of a pixel.
    #[inline(always)]
    fn pixel_len(&self) -> usize {
        self.channel_len() * self.channels
    }

    /// The bandwidths and counts of some levels of a colour channel by kind of photons, out of all those of a pixel.
    #[inline(always)]
    fn states<'a, R: CountingRule>(
        &self,
        channel: usize,
        levels: Range<usize>,
        bandwidths: &'a mut [R::Bandwidth],
        counts: &'a mut [R::Count],
    ) -> ByKind<KindBandwidths<'a, R>> {
        let own = channel * self.channel_len()..(channel + 1) * self.channel_len();
        let first = self.kind_len(Kind::Indirect);
        let (indirect, caustic) = bandwidths[own.clone()].split_at_mut(first);
        let counts = &mut counts[own.start * self.counts..own.end * self.counts];
        let (indirect_counts, caustic_counts) = counts.split_at_mut(first * self.counts);
        [(indirect, indirect_counts), (caustic, caustic_counts)].map(|(bandwidths, counts)| {
            let levels = levels.start.min(bandwidths.len())..levels.end.min(bandwidths.len());
            let counts = &mut counts[levels.start * self.counts..levels.end * self.counts];
            KindBandwidths { bandwidths: &mut bandwidths[levels], counts, tally: R::Tally::default() }
        })
    }
}

/// Bandwidths of all pixels under a rule that counts photons.
#[derive(Clone)]
pub(super) struct Counted<'a, R: CountingRule> {
    settings: &'a Settings,
    rule: R,
    layout: Layout,
    /// Bandwidth of every pixel, colour channel, kind of photons and level, in this order.
    bandwidths: Vec<R::Bandwidth>,
    /// Photon counts, [`CountingRule::counts`] for each of `bandwidths`.
    counts: Vec<R::Count>,
}

impl<'a, R: CountingRule> Counted<'a, R> {
    /// Makes the bandwidths for photons of these `kinds`, in each of `channels` colour channels.
    pub fn new(settings: &'a Settings, kinds: ByKind<bool>, channels: usize, rule: R) -> Counted<'a, R> {
        // Without photons pixels still have a state.
        let kinds = if kinds == [false; 2] { [true, false] } else { kinds };
        let layout = Layout { kinds, levels: settings.levels.count, counts: rule.counts(), channels };
        Counted { settings, rule, layout, bandwidths: Vec::new(), counts: Vec::new() }
    }
}

impl<R: CountingRule> PixelBandwidths for Counted<'_, R> {
    type Chunk<'c>
        = CountedChunk<'c, R>
    where
        Self: 'c;

    fn start(&mut self, pixels: &[PixelAccumulator], _: f32) {
        let levels = self.settings.levels;
        let neighbours = match self.settings.initial_bandwidth {
            InitialBandwidth::Nearest(k) => k as f32,
            _ => 0.0,
        };
        let initial = |bandwidth: f32, level: usize| {
            // A level has half the area of the next larger one, and so half its expected number of photons.
            let scale = level_factor2(level, levels.count);
            let above = level as i32 - levels.picture_level() as i32;
            self.rule.initial(bandwidth * bandwidth * scale, neighbours * scale, above)
        };
        let mut bandwidths = Vec::with_capacity(pixels.len() * self.layout.pixel_len());
        for pixel in pixels {
            for _ in 0..self.layout.channels {
                for kind in Kind::ALL {
                    let bandwidth = pixel.bandwidths[kind as usize];
                    bandwidths.extend((0..self.layout.kind_len(kind)).map(|level| initial(bandwidth, level)));
                }
            }
        }
        self.counts = vec![R::Count::default(); bandwidths.len() * self.rule.counts()];
        self.bandwidths = bandwidths;
    }

    fn par_chunks(&mut self, i: u64, size: usize) -> impl IndexedParallelIterator<Item = CountedChunk<'_, R>> {
        let (rule, layout, states) = (&self.rule, self.layout, self.layout.pixel_len());
        let counts = self.counts.par_chunks_mut(size * states * layout.counts);
        let chunks = self.bandwidths.par_chunks_mut(size * states).zip(counts);
        chunks.map(move |(bandwidths, counts)| CountedChunk { rule, i, layout, bandwidths, counts })
    }

    fn bandwidths2(&self) -> Option<ByKind<Vec<f32>>> {
        // Of three channels the middle one.
        let channel = self.layout.channels / 2;
        let count = self.layout.channel_len();
        let of_pixels = self.bandwidths.chunks(self.layout.pixel_len()).map(|all| &all[channel * count..][..count]);
        let first = self.layout.kind_len(Kind::Indirect);
        let by_kind = [0..first, first..count].map(|of_kind| {
            let bandwidths = of_pixels.clone().flat_map(|all| &all[of_kind.clone()]);
            bandwidths.map(R::squared).collect()
        });
        Some(by_kind)
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
}

/// Bandwidths of the pixels of one parallel task in iteration `i`, under a rule that counts photons.
pub(super) struct CountedChunk<'c, R: CountingRule> {
    rule: &'c R,
    i: u64,
    layout: Layout,
    bandwidths: &'c mut [R::Bandwidth],
    counts: &'c mut [R::Count],
}

impl<R: CountingRule> BandwidthChunk for CountedChunk<'_, R> {
    type Path<'p>
        = CountedPath<'p, R>
    where
        Self: 'p;

    #[inline(always)]
    fn prefetch(&self, at: usize) {
        let counts_per_line = (64 / size_of::<R::Count>().max(1)).max(1);
        let first = at * self.layout.pixel_len();
        // Counts of the first kind, which most pixels see. The last count may lie in a cache line of its own.
        let counts = &self.counts[first * self.layout.counts..][..self.layout.levels * self.layout.counts];
        prefetch(counts.iter().step_by(counts_per_line).chain(counts.last()).copied());
        prefetch([R::squared(&self.bandwidths[first])]);
    }

    #[inline(always)]
    fn path(&mut self, at: usize, channel: usize, levels: Range<usize>) -> CountedPath<'_, R> {
        let (states, each) = (self.layout.pixel_len(), self.layout.counts);
        let bandwidths = &mut self.bandwidths[at * states..][..states];
        let counts = &mut self.counts[at * states * each..][..states * each];
        CountedPath { rule: self.rule, i: self.i, kinds: self.layout.states(channel, levels, bandwidths, counts) }
    }
}

/// Bandwidths of some levels for one kind of photons at a pixel, and the photons counted within them.
struct KindBandwidths<'a, R: CountingRule> {
    bandwidths: &'a mut [R::Bandwidth],
    counts: &'a mut [R::Count],
    /// Photons that the current camera path has found.
    tally: R::Tally,
}

impl<R: CountingRule> KindBandwidths<'_, R> {
    /// The bandwidths of the levels in ascending order. Levels shrink independently, so their order may change.
    #[inline(always)]
    fn levels(&self) -> LevelBandwidths {
        if let [only] = &self.bandwidths {
            return LevelBandwidths::new(std::iter::once(R::squared(only)));
        }
        if self.bandwidths.is_sorted_by_key(R::squared) {
            return LevelBandwidths::new(self.bandwidths.iter().map(R::squared));
        }
        let mut order = std::array::from_fn(|level| level as u8);
        let bandwidth2 = |level: u8| R::squared(&self.bandwidths[usize::from(level)]);
        let ascending = &mut order[..self.bandwidths.len()];
        ascending.sort_by(|&a, &b| bandwidth2(a).total_cmp(&bandwidth2(b)));
        LevelBandwidths::new(ascending.iter().map(|&level| bandwidth2(level))).with_order(order)
    }
}

/// Bandwidths that one camera path uses, under a rule that counts photons.
pub(super) struct CountedPath<'a, R: CountingRule> {
    rule: &'a R,
    i: u64,
    kinds: ByKind<KindBandwidths<'a, R>>,
}

impl<R: CountingRule> PathBandwidths for CountedPath<'_, R> {
    #[inline(always)]
    fn finish(&mut self) {
        for KindBandwidths { bandwidths, counts, tally } in &mut self.kinds {
            self.rule.update(self.i, bandwidths, counts, tally);
        }
    }
}

impl<'a, R: CountingRule> GatherBandwidths for CountedPath<'a, R> {
    type Frame = Frame;
    type Counter<'c>
        = VertexCounter<'c, 'a, R>
    where
        Self: 'c;

    /// Makes the frame in which photons around a point with the normal `ng` are counted. It depends on the normal
    /// alone, because counts of different gathering points are added.
    #[inline(always)]
    fn frame(ng: Vec3) -> Frame {
        Frame::from_normal(ng)
    }

    #[inline(always)]
    fn levels(&mut self, kind: Kind, _: &PhotonMap, _: Vec3, _: Vec3, _: f32) -> LevelBandwidths {
        self.kinds[kind as usize].levels()
    }

    #[inline(always)]
    fn counter<'c>(&'c mut self, kind: Kind, frame: &'c Frame) -> VertexCounter<'c, 'a, R> {
        VertexCounter { rule: self.rule, of_kind: &mut self.kinds[kind as usize], frame }
    }
}

/// Counts the photons of one kind around a vertex of a camera path.
pub(super) struct VertexCounter<'c, 'a, R: CountingRule> {
    rule: &'a R,
    of_kind: &'c mut KindBandwidths<'a, R>,
    frame: &'c Frame,
}

impl<R: CountingRule> PhotonCounter for VertexCounter<'_, '_, R> {
    const BEYOND: bool = R::BEYOND;
    const NEEDS_THINNING_KEYS: bool = R::NEEDS_THINNING_KEYS;

    #[inline(always)]
    fn count(&mut self, photons: &FoundPhotons) {
        let KindBandwidths { bandwidths, counts, tally } = &mut *self.of_kind;
        self.rule.count(bandwidths, counts, tally, self.frame, photons);
    }

    #[inline]
    fn reach2(&self, largest2: f32) -> f32 {
        self.rule.reach2(self.of_kind.bandwidths, largest2)
    }
}
