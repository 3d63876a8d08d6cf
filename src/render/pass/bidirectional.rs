//! The methods that walk pairs of paths: light tracing, bidirectional path tracing, bidirectional photon mapping, and
//! vertex connection and merging.
//!
//! The unit of work is a tile of constant size. For each of its pixels a tile walks light paths and then a camera path.
//! Neighbouring pixels share light paths if there are fewer of them than pixels, or if a camera path connects to more
//! than its own. If the film is a window and nothing is merged, the light paths of all other pixels are walked, too, so
//! that the window has the bits of the whole picture. Each tile lists the light that its light paths send to other
//! pixels; the receiving tiles add it in the order of the sending tiles, so sums do not depend on threads. Photons are
//! concatenated likewise, for the next iteration.
//!
//! With bandwidth levels every pixel has two pairs of paths. Level 1 comes from the first pair, the other levels from
//! the second. The pairs share nothing but the photons, which both light paths leave.

use super::guiding::{guide_at, learn_guide};
use super::integrator::{Integrator, Work};
use super::light_cells::{LightCells, TracedPaths};
use super::photon_counts::PhotonCounts;
use super::sample_buffer::{self, SampleBuffer, SampleBufferPart};
use super::techniques::{FilmRecorder, TechniquePicture, TileRecorder};
use super::tiles::{PixelBlock, SlotPixel, TILE_PIXELS, Tiles, WholeTile};
use crate::camera::{GROUP_SIZE, TilePixel};
use crate::estimator::{PixelAccumulator, Schedule, level_factor2};
use crate::light::Guide;
use crate::path_class::{CameraSuffix, Event, Part};
use crate::photon::{ByKind, PhotonMap};
use crate::random::{Domain, Purpose, Streams};
use crate::render::clock::{Phases, cpu_seconds};
use crate::render::initial_bandwidth::{FOOTPRINT_PIXELS, InitialBandwidth, initial_bandwidths};
use crate::render::input::RenderInput;
use crate::render::settings::Settings;
use crate::spectrum::{IterationWavelengths, WavelengthSample};
use crate::stat::median;
use crate::transport::bidirectional::mis::Eta;
use crate::transport::{
    Bidirectional, CameraPathStart, CameraWalkContext, Deposits, FirstScatter, LightPaths, LightVertex, LightVertices,
    MergeLevels, MergePhoton, PixelSample, SPARED_BY_ROULETTE, Splat, TechniqueSet,
};
use bumpalo::Bump;
use rayon::prelude::*;
use std::sync::Arc;

/// Random numbers of the one light path and one camera path that an iteration traces for every pixel, and the bandwidth
/// levels that this pair of paths samples.
struct Pair {
    light: Domain,
    camera: Domain,
    /// Index of the first bandwidth level that the pair samples, and number of levels.
    levels: (usize, usize),
}

impl Pair {
    /// Index of the picture's level `own` among the levels of the pair; `None` if the pair does not sample it.
    fn own(&self, own: usize) -> Option<usize> {
        own.checked_sub(self.levels.0).filter(|level| *level < self.levels.1)
    }
}

/// Integrator of the bidirectional methods (bdpt, bpm, vcm).
pub struct Passes {
    techniques: TechniqueSet,
    guide: Option<Arc<Guide>>,
    pairs: Vec<Pair>,
    tiles: Tiles,
    cells: LightCells,
    /// Tiles whose light paths are traced, and, in `left`, the photons and splats of these paths. The lists keep their
    /// capacity over iterations.
    sources: Vec<WholeTile>,
    left: Vec<Deposits>,
    /// Samples of all pixels in the current iteration, for each pair of paths.
    samples: Vec<SampleBuffer>,
    /// Number of the iteration that traced the photons, and their map; `None` before the first one.
    photons: Option<(u64, PhotonMap<MergePhoton>)>,
    recorder: FilmRecorder,
    /// Number of pixels that the largest initial bandwidth covers, and expected number of photons within it if one light
    /// path starts per pixel.
    covered: f32,
    /// Initial bandwidths of the largest bandwidth level of all pixels (scene units), apart from the accumulators: every
    /// iteration reads them before its camera paths, and the accumulators, a kilobyte each, would miss the cache.
    initial: Vec<f32>,
}

impl Passes {
    /// Makes the integrator. `settings.levels` must be one level unless the method has levels.
    pub fn new(input: &RenderInput<'_>, techniques: TechniqueSet) -> Passes {
        let RenderInput { scene, camera, settings, initial_media, .. } = input;
        let levels = settings.levels;
        let mut pairs =
            vec![Pair { light: Domain::Light, camera: Domain::CameraIndependent, levels: (0, levels.count) }];
        if levels.two_paths && levels.count > 1 {
            pairs[0].levels = (0, 1);
            let rest = (1, levels.count - 1);
            pairs.push(Pair { light: Domain::LightCorrelated, camera: Domain::CameraCorrelated, levels: rest });
        }
        let tiles = Tiles::new(camera);
        let sources: Vec<WholeTile> =
            if techniques.merge { tiles.film_tiles().collect() } else { tiles.whole_tiles().collect() };
        let [film, whole] = [(camera.whole()[1], camera.size()), ((0, 0), camera.whole()[0])];
        let (at, size) = if techniques.merge { film } else { whole };
        let cells = LightCells::new(settings.counts, at, size);
        let learn = || learn_guide(&input.camera_paths(), initial_media, settings, None);
        let guide = settings.guided.then(learn).flatten().map(Arc::new);
        let samples = pairs.iter().map(|pair| SampleBuffer::new(tiles.count() * TILE_PIXELS, pair.levels.1)).collect();
        Passes {
            techniques,
            guide,
            pairs,
            tiles,
            cells,
            left: sources.iter().map(|_| Deposits::default()).collect(),
            sources,
            samples,
            photons: None,
            recorder: FilmRecorder::new(settings, scene, &tiles),
            covered: 0.0,
            initial: Vec::new(),
        }
    }

    /// Data that all pairs of paths share.
    fn shared<'i>(&self, input: &'i RenderInput<'_>) -> Bidirectional<'i> {
        let (light_paths, counts) = (self.cells.count() as f32, input.settings.counts);
        Bidirectional {
            camera_paths: input.camera_paths(),
            initial_media: &input.initial_media,
            techniques: self.techniques,
            light_paths,
            connections: counts.connections as f32,
            merged_paths: light_paths * self.pairs.len() as f32,
            spared: if counts.leave_camera_paths_alone(self.techniques.merge) { SPARED_BY_ROULETTE } else { 1.0 },
            only: None,
        }
    }

    fn light_pass<'g>(&self, settings: &Settings, i: u64, pair: &Pair, guide: Option<&'g Guide>) -> LightPaths<'g> {
        let Settings { seed, max_depth, .. } = *settings;
        let pass = LightPaths::new(seed, i, pair.light, self.cells.count(), max_depth).guided(guide);
        // Methods without merging connect paths of one pixel only, so any wavelength will do, and light paths of a
        // pixel can follow a low-discrepancy sequence over iterations. Photons serve all pixels and gain nothing from
        // that.
        if self.techniques.merge {
            pass.with(IterationWavelengths::drifting(seed, i))
        } else {
            pass.drawing(Streams::in_sequence(seed, i, pair.light))
        }
    }

    /// Traces the photons of iteration `i`, if it was not rendered in this process.
    fn photons_of(&self, input: &RenderInput<'_>, i: u64) -> PhotonMap<MergePhoton> {
        let Passes { tiles, cells, .. } = *self;
        let shared = self.shared(input);
        let guide = guide_at(self.guide.as_deref(), input);
        let mut parts = Vec::new();
        // In the order of an iteration, so that sums over coincident photons have equal bits.
        for pair in &self.pairs {
            let pass = self.light_pass(&input.settings, i, pair, guide.as_deref());
            let walk = |tile: &WholeTile| {
                let (mut left, mut arena, mut traced) = (Deposits::default(), Bump::new(), TracedPaths::new());
                for pixel in tiles.blocks(*tile).flat_map(|block| block.pixels) {
                    if shared.camera_paths.is_given_up() {
                        break;
                    }
                    arena.reset();
                    let mut vertices = LightVertices::new_in(&arena);
                    let tracer = LightTracer { shared: &shared, cells: &cells, paths: &pass, photons_only: true };
                    tracer.trace_cell_at(pixel, &mut vertices, &mut traced, &mut left);
                }
                left.photons
            };
            parts.par_extend(self.sources.par_iter().map(walk));
        }
        PhotonMap::build(parts.concat())
    }

    /// Adds iteration `i` (from 1) to all pixels; `None` if the iteration was aborted.
    fn pass<W: TileRecorder>(
        &mut self,
        input: &RenderInput<'_>,
        i: u64,
        pixels: &mut [PixelAccumulator],
        recorders: &mut [W],
    ) -> Option<Work> {
        let (shared, settings) = (self.shared(input), &input.settings);
        if shared.techniques.merge && self.photons.as_ref().is_none_or(|(pass, _)| pass + 1 != i) {
            // Also before the first iteration: without photons it would lack the light that only photons find.
            let photons = self.photons_of(input, i - 1);
            if settings.stop.aborted() {
                return None;
            }
            self.photons = Some((i - 1, photons));
        }
        let map = self.photons.as_ref().map(|(_, map)| map);
        let merges = map.map_or(0, |map| map.photons().len());
        let mut rejected = map.map_or(0, PhotonMap::rejected);
        let stored = map.map_or([0; 2], count_by_kind);
        let mut photons: Vec<MergePhoton> = Vec::new();
        let guide = self.guide.clone();
        let guide = guide_at(guide.as_deref(), input);
        let light: Vec<_> =
            self.pairs.iter().map(|pair| self.light_pass(settings, i, pair, guide.as_deref())).collect();
        let iteration = Iteration {
            shared,
            tiles: self.tiles,
            cells: self.cells,
            map,
            merging: settings.counts.merging,
            schedule: settings.schedule(i),
            covered: self.covered,
            light_paths: (self.pairs.len() as f64 * settings.counts.light_paths_per_pixel()) as f32,
            initial: &self.initial,
        };
        for ((pair, light_paths), samples) in self.pairs.iter().zip(&light).zip(&mut self.samples) {
            let own = pair.own(settings.levels.picture_level());
            let streams = Streams::in_sequence(settings.seed, i, pair.camera);
            let walks = PairWalks { pair, light_paths, own, streams };
            let mut on_film = samples.par_tiles().zip(recorders.par_iter_mut()).collect::<Vec<_>>().into_iter();
            let film: Vec<_> = self.sources.iter().map(|tile| tile.tile.and_then(|_| on_film.next())).collect();
            self.sources
                .par_iter()
                .zip(film)
                .zip(&mut self.left)
                .for_each(|((tile, film), left)| iteration.walk_tile(&walks, *tile, film, left));
            if settings.stop.aborted() {
                return None;
            }
            let splats = SplatsByTile::new(&self.left, &self.tiles);
            samples.par_tiles().zip(recorders.par_iter_mut()).enumerate().for_each(|(tile, (samples, recorder))| {
                iteration.add_splats(&walks, splats.of(tile), samples, recorder)
            });
            rejected += self.left.iter().map(|left| left.lost).sum::<u64>();
            photons.reserve(self.left.iter().map(|left| left.photons.len()).sum());
            self.left.iter().for_each(|left| photons.extend_from_slice(&left.photons));
        }
        let walked = self.pairs.len() as u64 * u64::from(light[0].count());
        let (tiles, camera_paths) = (self.tiles, &shared.camera_paths);
        let groups = |slot: usize| recorders[slot / TILE_PIXELS].group_light(slot % TILE_PIXELS);
        let slot = |index: usize| tiles.slot(index as u32);
        let gathered = sample_buffer::add(&self.samples, camera_paths, i, pixels, slot, groups);
        // Photons of another moment would be at the wrong place.
        if shared.techniques.merge && settings.shard.count == 1 && !input.moves() {
            self.photons = Some((i, PhotonMap::build(photons)));
        }
        Some(Work { light_paths: walked, photons: merges, rejected, counts: PhotonCounts { stored, gathered } })
    }
}

/// Data that all tiles read in an iteration.
struct Iteration<'i, 'a> {
    shared: Bidirectional<'a>,
    tiles: Tiles,
    cells: LightCells,
    /// Map of the photons of the previous iteration; `None` without merging.
    map: Option<&'i PhotonMap<MergePhoton>>,
    /// Probability that a camera path merges with photons.
    merging: f32,
    schedule: Schedule,
    /// Number of pixels within the largest initial bandwidth.
    covered: f32,
    /// Light paths per pixel.
    light_paths: f32,
    /// Initial bandwidths of the largest bandwidth level of all pixels (scene units); empty without merging.
    initial: &'i [f32],
}

/// The paths of one pair, a light path and a camera path for every pixel, in one iteration.
struct PairWalks<'i> {
    pair: &'i Pair,
    light_paths: &'i LightPaths<'i>,
    /// Index of the picture's level among the levels of the pair; `None` if the pair does not sample it.
    own: Option<usize>,
    /// Random numbers of the camera paths.
    streams: Streams,
}

/// Traces the light paths of cells of pixels in one iteration.
struct LightTracer<'t, 'a> {
    shared: &'t Bidirectional<'a>,
    cells: &'t LightCells,
    paths: &'t LightPaths<'t>,
    photons_only: bool,
}

impl<'a> LightTracer<'_, 'a> {
    /// Traces the light paths of the cell whose first pixel this is, if it is one.
    #[inline]
    fn trace_cell_at<'s>(
        &self,
        pixel: SlotPixel,
        vertices: &mut LightVertices<'s>,
        traced: &mut TracedPaths,
        left: &mut Deposits,
    ) where
        'a: 's,
    {
        let Some(cell) = self.cells.starting_at(pixel) else { return };
        traced.start_cell(cell);
        for index in self.cells.paths(cell) {
            if let Some(mut emitted) = self.paths.emit(self.shared.camera_paths.scene, self.shared.initial_media, index)
            {
                let wavelength = self.cells.wavelength_of_path(cell, index);
                emitted.start.wavelength_sample = self.paths.wavelength(wavelength);
                self.shared.light_path(self.paths, &emitted, self.photons_only, vertices, left, &mut ());
            }
            traced.end_path(vertices.len());
        }
    }

    /// The wavelength of the camera path of a pixel.
    #[inline]
    fn wavelength(&self, pixel: SlotPixel) -> WavelengthSample {
        self.paths.wavelength(self.cells.wavelength_of_pixel(pixel))
    }
}

impl Iteration<'_, '_> {
    /// Merging bandwidths of a pixel at the bandwidth levels that a pair of paths samples.
    #[inline]
    fn levels(&self, pixel: u32, pair: &Pair) -> MergeLevels {
        let bandwidth = self.initial.get(pixel as usize).copied().unwrap_or_default();
        let Iteration { shared, schedule, .. } = self;
        MergeLevels::new((pair.levels.0..pair.levels.0 + pair.levels.1).map(|level| {
            let bandwidth2 = schedule.bandwidth2(bandwidth, level);
            let shrunk = schedule.factor2() * level_factor2(level, schedule.levels());
            let eta = match (self.map.is_some(), shared.techniques.connect) {
                (false, _) => Eta::NONE,
                (true, true) => {
                    let merges = shared.merged_paths * self.merging;
                    let pixels = self.covered * shrunk;
                    Eta::new(bandwidth2, merges).sharing(pixels * self.merging, pixels * self.light_paths)
                }
                (true, false) => Eta::MERGE_ONLY,
            };
            (bandwidth2, eta)
        }))
        .with_probability(self.merging)
    }

    /// The photons that a camera path merges with: all, or none if the random number `u` is above the probability.
    fn photons_of_path(&self, u: impl FnOnce() -> f32) -> Option<&PhotonMap<MergePhoton>> {
        self.map.filter(|_| self.merging >= 1.0 || u() < self.merging)
    }

    /// Traces the light paths of a tile, and its camera paths if the tile is on the film.
    fn walk_tile<W: TileRecorder>(
        &self,
        walks: &PairWalks<'_>,
        tile: WholeTile,
        mut film: Option<(SampleBufferPart<'_>, &mut W)>,
        left: &mut Deposits,
    ) {
        let Iteration { shared, cells, tiles, .. } = self;
        left.clear();
        let tracer = LightTracer { shared, cells, paths: walks.light_paths, photons_only: false };
        let (mut arenas, mut traced) = ([Bump::new(), Bump::new()], TracedPaths::new());
        let whole_tile = Bump::new();
        let mut of_tile = LightVertices::new_in(&whole_tile);
        if !cells.are_pixels() {
            for pixel in tiles.blocks(tile).flat_map(|block| block.pixels) {
                tracer.trace_cell_at(pixel, &mut of_tile, &mut traced, left);
            }
        }
        for PixelBlock { pixels, places } in tiles.blocks(tile) {
            if shared.camera_paths.is_given_up() {
                return;
            }
            let mut starts =
                film.as_ref().map(|_| shared.camera_paths.starts(&places, walks.streams)).unwrap_or_default();
            for k in 0..GROUP_SIZE {
                let [light_arena, camera_arena] = &mut arenas;
                light_arena.reset();
                let mut of_pixel = LightVertices::new_in(light_arena);
                if cells.are_pixels() {
                    traced.clear();
                    tracer.trace_cell_at(pixels[k], &mut of_pixel, &mut traced, left);
                }
                let vertices = if cells.are_pixels() { &of_pixel } else { &of_tile };
                let (Some((samples, recorder)), Some(place), Some(start)) = (&mut film, &places[k], &mut starts[k])
                else {
                    continue;
                };
                camera_arena.reset();
                let connected = &vertices[traced.connected(cells, pixels[k])];
                // A camera path and the light paths of its group take one wavelength, so that they can be connected.
                start.ray.wavelength_sample = tracer.wavelength(pixels[k]);
                let sample = self.camera_path(walks, camera_arena, place, start, connected, *recorder);
                samples.set(place.at, &sample);
            }
        }
    }

    /// Traces the camera path of a pixel, connected to `vertices` of light paths.
    #[inline]
    fn camera_path<W: TileRecorder>(
        &self,
        walks: &PairWalks<'_>,
        arena: &Bump,
        place: &TilePixel,
        start: &CameraPathStart,
        vertices: &[LightVertex<'_>],
        recorder: &mut W,
    ) -> PixelSample {
        let levels = self.levels(place.index as u32, walks.pair);
        let photons = self.photons_of_path(|| start.stream.vertex(0).one(Purpose::Merging));
        let context = CameraWalkContext { vertices, photons, levels: &levels };
        recorder.select_pixel(place.at, walks.own);
        let mut sample = PixelSample::default();
        self.shared.camera_path(arena, start, &context, recorder, &mut sample);
        sample
    }

    /// Adds to the samples of a tile the splats that it receives: light that light paths send to the film.
    fn add_splats<'l, W: TileRecorder>(
        &self,
        walks: &PairWalks<'_>,
        splats: impl Iterator<Item = (&'l Splat, FirstScatter)>,
        mut samples: SampleBufferPart<'_>,
        recorder: &mut W,
    ) {
        for (splat, first) in splats {
            let levels = self.levels(splat.pixel, walks.pair);
            let (_, slot) = self.tiles.place(splat.pixel);
            recorder.record_splat(slot, walks.own, splat, first, &levels);
            let mut sample = samples.get(slot);
            splat.apply(&levels, &mut sample);
            samples.set(slot, &sample);
        }
    }
}

/// Number of photons by kind (caustic, indirect), classified as a surface with broad lobes would see them.
fn count_by_kind(map: &PhotonMap<MergePhoton>) -> ByKind<u64> {
    let suffix = CameraSuffix::START.then(Event::Broad);
    let caustics =
        map.photons().par_iter().filter(|photon| suffix.class_with(photon.prefix).part() == Part::Caustic).count();
    [map.photons().len() - caustics, caustics].map(|count| count as u64)
}

/// Bytes that each tile of the whole picture takes while its light paths are traced, without splats and photons.
pub fn bytes_per_whole_tile() -> u64 {
    (size_of::<WholeTile>() + size_of::<Deposits>()) as u64
}

/// Splats (light that light paths send to the film) by receiving tile, in the order of the sending tiles, so that sums
/// do not depend on threads.
struct SplatsByTile<'l> {
    left: &'l [Deposits],
    /// For each splat, the index of the sending tile and the index in that tile's list.
    order: Vec<(u32, u32)>,
    /// For each receiving tile, the end of its range in `order`.
    ends: Vec<usize>,
}

impl<'l> SplatsByTile<'l> {
    fn new(left: &'l [Deposits], tiles: &Tiles) -> SplatsByTile<'l> {
        let all =
            || left.iter().enumerate().flat_map(|(from, left)| left.splats.iter().enumerate().map(move |s| (from, s)));
        // A counting sort.
        let mut ends = vec![0; tiles.count() + 1];
        all().for_each(|(_, (_, splat))| ends[tiles.place(splat.pixel).0 + 1] += 1);
        for tile in 0..tiles.count() {
            ends[tile + 1] += ends[tile];
        }
        let mut order = vec![(0, 0); ends[tiles.count()]];
        for (from, (at, splat)) in all() {
            let next = &mut ends[tiles.place(splat.pixel).0];
            order[*next] = (from as u32, at as u32);
            *next += 1;
        }
        SplatsByTile { left, order, ends }
    }

    /// The splats that a tile receives, and how the light vertex of each scatters its light, if that is recorded.
    fn of(&self, tile: usize) -> impl Iterator<Item = (&'l Splat, FirstScatter)> {
        let start = if tile == 0 { 0 } else { self.ends[tile - 1] };
        let left = self.left;
        self.order[start..self.ends[tile]].iter().map(move |&(from, at)| {
            let (left, at) = (&left[from as usize], at as usize);
            (&left.splats[at], left.first.get(at).copied().unwrap_or_default())
        })
    }
}

impl Integrator for Passes {
    fn pixels(&mut self, input: &RenderInput<'_>) -> Vec<PixelAccumulator> {
        let RenderInput { scene, camera, settings, .. } = input;
        if !settings.method.has_bandwidths() {
            return input.initial_pixels();
        }
        // Merging is one of many techniques, and small kernels suffice \[Georgiev et al. 2012\].
        let initial = match settings.initial_bandwidth {
            InitialBandwidth::Fixed(bandwidth) => InitialBandwidth::Fixed(bandwidth),
            _ => InitialBandwidth::Footprint,
        };
        let Settings { max_initial_bandwidth: [widest, _], seed, .. } = *settings;
        let (none, camera_paths) = (PhotonMap::build(Vec::new()), input.camera_paths());
        let all = initial_bandwidths(&camera_paths, initial, widest, seed, [&none; 2]);
        // A footprint covers the same number of pixels everywhere; a fixed bandwidth is compared with the median
        // footprint.
        let covered = match initial {
            InitialBandwidth::Fixed(bandwidth) => {
                let footprints =
                    initial_bandwidths(&camera_paths, InitialBandwidth::Footprint, f32::INFINITY, seed, [&none; 1]);
                let mut footprints = footprints.into_flattened();
                FOOTPRINT_PIXELS * bandwidth / median(&mut footprints, f32::total_cmp).unwrap_or(f32::INFINITY)
            }
            _ => FOOTPRINT_PIXELS.min(widest * camera.whole_width()),
        };
        self.covered = std::f32::consts::PI * covered * covered;
        let pixels = settings.pixels(scene, &all);
        self.initial = pixels.iter().map(|pixel| pixel.bandwidths[0]).collect();
        pixels
    }

    fn guide(&self) -> Option<&Guide> {
        self.guide.as_deref()
    }

    fn iterate(
        &mut self,
        input: &RenderInput<'_>,
        i: u64,
        pixels: &mut [PixelAccumulator],
        phases: &mut Phases,
    ) -> Option<Work> {
        let start = cpu_seconds();
        let mut recorder = std::mem::take(&mut self.recorder);
        let work = match recorder.start_iteration() {
            Some(recorders) => self.pass(input, i, pixels, recorders),
            None => self.pass(input, i, pixels, &mut vec![(); self.tiles.count()]),
        };
        self.recorder = recorder;
        // Light and camera paths alternate within a pixel, so their times are not separated.
        phases.eye += cpu_seconds() - start;
        work
    }

    fn techniques(&mut self, iterations: u64) -> Vec<TechniquePicture> {
        self.recorder.take_pictures(&self.tiles, iterations)
    }
}
