//! Multiplexed Metropolis light transport: Markov chains over the paths of bidirectional path tracing \[Veach and Guibas
//! 1997; Kelemen et al. 2002; Hachisuka, Kaplanyan and Dachsbacher 2014, "Multiplexed Metropolis Light Transport"\].
//!
//! A state is a point of primary sample space ([`Chain`]), a path length, and a [`Division`] of the path among the two
//! walks. Its target density is the light that this technique finds, weighted by the balance heuristic. Proposals keep
//! the path length and may change everything else.
//!
//! An iteration is a complete render. So iterations are independent, their scatter gives the variance, and several
//! machines can share them:
//!
//! 1. A pair of walks for every pixel with all techniques, as in bidirectional path tracing. They sample directly
//!    visible light, direct light and G-buffers, and estimate the mean of all other light, `b`.
//! 2. Chains start at paths found in step 1, sampled in proportion to their light by a stratified sequence. Such chains
//!    are in equilibrium on average, and `b` makes the sum unbiased \[Veach 1997, 11.3.1\].
//! 3. Chains take one step per pixel in total. State and proposal both contribute, each with the probability that it is
//!    the next state \[expected values, Veach 1997, 11.5\].

use super::integrator::{Integrator, Work};
use super::tiles::{TILE_PIXELS, Tiles};
use crate::camera::Camera;
use crate::estimator::PixelAccumulator;
use crate::math::{Rgb, UVec2, Vec2};
use crate::path_class::{Part, PathClass};
use crate::random::{Chain, Domain, Purpose, Stream, Streams, mix};
use crate::render::clock::{Phases, cpu_seconds};
use crate::render::input::RenderInput;
use crate::render::settings::Settings;
use crate::transport::bidirectional::mis::Eta;
use crate::transport::{
    Bidirectional, CameraPathStart, CameraWalkContext, Deposits, Division, FirstScatter, LightPaths, LightVertices,
    LobeLight, MergeLevels, PathKind, PathRecorder, PixelSample, Splat, Technique, TechniqueSet,
};
use bumpalo::Bump;
use rayon::prelude::*;
use smallvec::SmallVec;

/// Steps of a Markov chain in large pictures. Each iteration starts new chains in proportion to light, so many short
/// chains are better stratified: 512 steps gave 1.1 to 1.2 times the error.
const STEPS: usize = 64;
/// Vertex number under which a chain draws the random numbers that select the pixel and the division of a path into
/// subpaths.
const CHAIN_VERTEX: u32 = u32::MAX;

/// Smallest number of chains in an iteration.
const MIN_CHAINS: usize = 16;

/// Light that a path adds to a pixel.
#[derive(Clone, Copy, Debug)]
struct Deposit {
    pixel: u32,
    part: Part,
    value: Rgb,
}

/// Whether Markov chains sample light of this class: all light except directly visible lights and direct light.
fn is_sampled_by_chains(class: PathClass) -> bool {
    !matches!(class.part(), Part::Emission | Part::Direct)
}

/// A path of step 1, which samples all pixels as usual, at which a Markov chain may start.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    /// Index of the pixel in which the path starts.
    path: u32,
    division: Division,
    importance: f32,
}

/// How the first vertex of a path scatters its light, and whether the light has no other bounce.
type LobeOfDeposit = (FirstScatter, bool);

/// Light of one path, as far as Markov chains sample it.
#[derive(Default)]
struct Found {
    /// Index of the pixel in which the camera subpath starts.
    pixel: u32,
    deposits: SmallVec<[(Technique, Deposit); 4]>,
    /// For each deposit its lobe, if light is recorded by the lobe of the first hit; otherwise empty.
    lobes: Vec<LobeOfDeposit>,
    /// Whether light is recorded by the lobe of the first hit.
    records_lobes: bool,
    /// Light that chains do not sample, by the lobe of the first hit.
    others: LobeLight,
}

/// Target density of Markov chains at a path with this light: the sum of the channels.
fn importance(value: Rgb) -> f32 {
    let sum = value.element_sum();
    if sum.is_finite() { sum } else { 0.0 }
}

impl Found {
    /// Adds light of a class to a pixel, which the first vertex scatters by `first`.
    fn add(
        &mut self,
        technique: Technique,
        class: PathClass,
        pixel: u32,
        value: Rgb,
        first: impl FnOnce() -> FirstScatter,
    ) {
        if is_sampled_by_chains(class) && importance(value) > 0.0 {
            self.deposits.push((technique, Deposit { pixel, part: class.part(), value }));
            if self.records_lobes {
                self.lobes.push((first(), technique.is_direct()));
            }
        }
    }

    /// Adds the light that light paths send to the film. `first`: how their light vertices scatter it, if that is recorded.
    fn splats(&mut self, splats: &[Splat], first: &[FirstScatter]) {
        for (index, splat) in splats.iter().enumerate() {
            let value = splat.value * splat.ratios.weight(Eta::NONE);
            let first = || first.get(index).copied().unwrap_or_default();
            self.add(Technique::Camera { light: splat.light }, splat.class, splat.pixel, value, first);
        }
    }
}

impl PathRecorder for Found {
    fn arrival(&mut self, technique: Technique, of: PathKind, _: usize, value: Rgb, weight: f32) {
        if self.records_lobes && !is_sampled_by_chains(of.class) {
            self.others.add(&of.first, technique.is_direct(), value * weight);
        }
        self.add(technique, of.class, self.pixel, value * weight, || of.first);
    }

    fn first_surface(&mut self, colors: [Rgb; 3]) {
        self.others.colors = colors;
    }
}

/// A state of a Markov chain, or the proposal of one: a path's light in pixels.
#[derive(Default)]
struct State {
    deposits: SmallVec<[Deposit; 4]>,
    /// For each deposit its lobe, if that is recorded.
    lobes: Vec<LobeOfDeposit>,
    importance: f32,
}

/// The light that a Markov chain leaves in pixels.
#[derive(Default)]
struct Left {
    deposits: Vec<Deposit>,
    /// For each deposit its lobe, if that is recorded.
    lobes: Vec<LobeOfDeposit>,
}

/// Integrator of Metropolis light transport.
pub(super) struct Metropolis {
    tiles: Tiles,
    samples: Vec<PixelSample>,
    /// Light of the samples by the lobe of the first hit; empty unless it is recorded.
    lobes: Vec<LobeLight>,
    levels: MergeLevels,
}

/// Random numbers and shared data for the paths of one iteration.
struct Walks<'i, 'a> {
    shared: &'i Bidirectional<'a>,
    light_paths: LightPaths<'i>,
    levels: &'i MergeLevels,
    cameras: Streams,
    lights: Streams,
    size: UVec2,
}

/// Random numbers of the camera subpath and the light subpath of a path.
#[derive(Clone, Copy)]
struct PairStreams {
    camera: Stream,
    light: Stream,
}

/// Start of the camera subpath and the light subpath of a path.
struct PairStart {
    pixel: UVec2,
    /// Start point within the pixel, uniform on the unit square.
    within: Vec2,
    streams: PairStreams,
}

impl Walks<'_, '_> {
    fn streams(&self, path: u32) -> PairStreams {
        PairStreams { camera: self.cameras.path(u64::from(path)), light: self.lights.path(u64::from(path)) }
    }

    /// Traces both subpaths of a path. Their light goes to `left`, `found` and `sample`.
    fn walk<'s>(
        &self,
        shared: &Bidirectional<'s>,
        arena: &'s Bump,
        start: &PairStart,
        left: &mut Deposits,
        found: &mut Found,
        sample: &mut PixelSample,
    ) {
        let PairStart { pixel, within, streams: PairStreams { camera, light } } = *start;
        let mut vertices = LightVertices::new_in(arena);
        if shared.only.is_none_or(|only| only.light().is_some_and(|depth| depth > 0))
            && let Some(emitted) = self.light_paths.emit_from(shared.camera_paths.scene, shared.initial_media, light)
        {
            shared.light_path(&self.light_paths, &emitted, false, &mut vertices, left, &mut ());
        }
        if shared.only.is_none_or(|only| only.camera > 0) {
            let mut ray = shared.camera_paths.start_at((pixel.x, pixel.y), within, camera);
            ray.wavelength_sample = self.light_paths.wavelength_sample_of(light);
            let context = CameraWalkContext { vertices: &vertices, photons: None, levels: self.levels };
            shared.camera_path(arena, &CameraPathStart { ray, stream: camera }, &context, found, sample);
        }
    }

    /// Samples the path of a pixel with all techniques, and appends to `candidates` the paths at which chains may
    /// start.
    fn ordinary(
        &self,
        arena: &mut Bump,
        path: u32,
        pixel: UVec2,
        left: &mut Deposits,
        candidates: &mut Vec<Candidate>,
    ) -> (PixelSample, LobeLight) {
        arena.reset();
        let streams = self.streams(path);
        let records_lobes = self.shared.camera_paths.lobes;
        let mut found = Found { pixel: path, records_lobes, ..Found::default() };
        let mut sample = PixelSample::default();
        let first = left.splats.len();
        let within = streams.camera.vertex(0).two(Purpose::Pixel);
        self.walk(self.shared, arena, &PairStart { pixel, within, streams }, left, &mut found, &mut sample);
        found.splats(&left.splats[first..], left.first.get(first..).unwrap_or_default());
        candidates.extend(found.deposits.iter().filter_map(|(technique, deposit)| {
            let division = Division::of(*technique)?;
            Some(Candidate { path, division, importance: importance(deposit.value) })
        }));
        (sample, found.others)
    }

    /// Evaluates the path that a chain's random numbers give: its light in pixels.
    fn state(&self, arena: &mut Bump, chain: &mut Chain, segments: u32, streams: PairStreams) -> State {
        arena.reset();
        let own = streams.camera.vertex(CHAIN_VERTEX);
        let records_lobes = self.shared.camera_paths.lobes;
        let (mut left, mut found) = (Deposits::default(), Found { records_lobes, ..Found::default() });
        chain.run(|| {
            let camera = ((own.one(Purpose::Division) * (segments + 1) as f32) as u32).min(segments);
            let film = own.two(Purpose::Film) * self.size.as_vec2();
            let pixel = film.as_uvec2().min(self.size - 1);
            found.pixel = pixel.y * self.size.x + pixel.x;
            let shared = Bidirectional { only: Some(Division { segments, camera }), ..*self.shared };
            let within = (film - pixel.as_vec2()).clamp(Vec2::ZERO, Vec2::splat(1.0 - f32::EPSILON));
            let start = PairStart { pixel, within, streams };
            self.walk(&shared, arena, &start, &mut left, &mut found, &mut PixelSample::default());
        });
        found.splats(&left.splats, &left.first);
        let deposits: SmallVec<[Deposit; 4]> = found.deposits.into_iter().map(|(_, deposit)| deposit).collect();
        let importance = deposits.iter().map(|deposit| importance(deposit.value)).sum();
        State { deposits, lobes: found.lobes, importance }
    }

    /// Runs a Markov chain of `steps` steps from `candidate`. Returns its light in pixels, divided by its importance,
    /// with weights that sum to one for each step.
    fn chain(&self, arena: &mut Bump, number: u64, candidate: &Candidate, steps: usize) -> Left {
        let Candidate { path, division: Division { segments, camera }, .. } = *candidate;
        let PairStreams { camera: camera_stream, light: light_stream } = self.streams(path);
        let streams = PairStreams { camera: camera_stream.chained(), light: light_stream.chained() };
        let mut chain = Chain::new(mix(camera_stream.vertex(CHAIN_VERTEX).bits(Purpose::Film) ^ mix(number)));
        let own = streams.camera.vertex(CHAIN_VERTEX);
        let place = UVec2::new(path % self.size.x, path / self.size.x).as_vec2();
        chain.set_initial(
            own.id(Purpose::Film),
            (place + camera_stream.vertex(0).two(Purpose::Pixel)) / self.size.as_vec2(),
        );
        chain.set_initial(own.id(Purpose::Division), Vec2::splat((camera as f32 + 0.5) / (segments + 1) as f32));
        let mut left = Left::default();
        let mut leave = |state: &State, weight: f32| {
            if weight > 0.0 && state.importance > 0.0 {
                let scale = weight / state.importance;
                left.deposits.extend(state.deposits.iter().map(|d| Deposit { value: d.value * scale, ..*d }));
                left.lobes.extend(&state.lobes);
            }
        };
        let mut current = self.state(arena, &mut chain, segments, streams);
        let mut stayed = 0.0;
        for _ in 0..steps {
            if self.shared.camera_paths.is_given_up() {
                break;
            }
            chain.propose();
            let proposal = self.state(arena, &mut chain, segments, streams);
            // Rounding may have extinguished the chain's first path. Then any other is accepted.
            let acceptance = match current.importance {
                0.0 => 1.0,
                importance => (proposal.importance / importance).min(1.0),
            };
            if chain.accept_or_reject(acceptance) {
                leave(&current, stayed + 1.0 - acceptance);
                (current, stayed) = (proposal, acceptance);
            } else {
                leave(&proposal, acceptance);
                stayed += 1.0 - acceptance;
            }
        }
        leave(&current, stayed);
        left
    }
}

/// Chooses the starts of chains: `count` of the candidates, sampled in proportion to importance by a stratified
/// sequence with the random number `u`. Also returns the sum of all importances.
fn starts(candidates: &[Candidate], count: usize, u: f64) -> (Vec<Candidate>, f64) {
    let total: f64 = candidates.iter().map(|candidate| f64::from(candidate.importance)).sum();
    let step = total / count as f64;
    let (mut found, mut sum) = (Vec::with_capacity(count), 0.0);
    for candidate in candidates {
        sum += f64::from(candidate.importance);
        while found.len() < count && (found.len() as f64 + u) * step < sum {
            found.push(*candidate);
        }
    }
    // Rounding may leave the sequence one short.
    if let Some(last) = candidates.last() {
        found.resize(count, *last);
    }
    (found, total)
}

impl Metropolis {
    pub fn new(camera: &Camera, lobes: bool) -> Metropolis {
        let tiles = Tiles::new(camera);
        let lobes = vec![LobeLight::default(); if lobes { tiles.count() * TILE_PIXELS } else { 0 }];
        let samples = vec![PixelSample::default(); tiles.count() * TILE_PIXELS];
        let levels = MergeLevels::new(std::iter::once((0.0, Eta::NONE)));
        Metropolis { tiles, samples, lobes, levels }
    }

    /// Samples the paths of all pixels as usual (step 1). Returns the paths at which chains may start, and the number
    /// of light paths that ended because they were not finite.
    fn walk_all(&mut self, walks: &Walks<'_, '_>) -> (Vec<Candidate>, u64) {
        let (tiles, width) = (self.tiles, walks.size.x);
        let mut lobes: Vec<&mut [LobeLight]> = self.lobes.chunks_mut(TILE_PIXELS).collect();
        lobes.resize_with(self.samples.len() / TILE_PIXELS, Default::default);
        let left: Vec<(Deposits, Vec<Candidate>)> = self
            .samples
            .par_chunks_mut(TILE_PIXELS)
            .zip(lobes)
            .enumerate()
            .map(|(tile, (samples, lobes))| {
                let (mut arena, mut left, mut found) = (Bump::new(), Deposits::default(), Vec::new());
                for place in tiles.pixels(tile) {
                    if walks.shared.camera_paths.is_given_up() {
                        break;
                    }
                    let index = place.index as u32;
                    let pixel = UVec2::new(index % width, index / width);
                    let (sample, light) = walks.ordinary(&mut arena, index, pixel, &mut left, &mut found);
                    if let Some(lobes) = lobes.get_mut(place.at) {
                        *lobes = light;
                    }
                    let PixelSample { emission, direct, features, first, rejection, .. } = sample;
                    samples[place.at] =
                        PixelSample { emission, direct, features, first, rejection, ..PixelSample::default() };
                }
                (left, found)
            })
            .collect();
        let (mut candidates, mut lost) = (Vec::new(), 0);
        for (left, found) in left {
            lost += left.lost;
            for (index, splat) in left.splats.iter().enumerate().filter(|(_, splat)| !is_sampled_by_chains(splat.class))
            {
                let slot = tiles.slot(splat.pixel);
                splat.apply(&self.levels, &mut self.samples[slot]);
                if let Some((lobes, first)) = self.lobes.get_mut(slot).zip(left.first.get(index)) {
                    let technique = Technique::Camera { light: splat.light };
                    lobes.add(first, technique.is_direct(), splat.value * splat.ratios.weight(Eta::NONE));
                }
            }
            candidates.extend(found);
        }
        (candidates, lost)
    }
}

impl Integrator for Metropolis {
    fn pixels(&mut self, input: &RenderInput<'_>) -> Vec<PixelAccumulator> {
        input.initial_pixels()
    }

    fn iterate(
        &mut self,
        input: &RenderInput<'_>,
        i: u64,
        pixels: &mut [PixelAccumulator],
        phases: &mut Phases,
    ) -> Option<Work> {
        let started = cpu_seconds();
        let RenderInput { settings, initial_media, .. } = input;
        let Settings { seed, max_depth, .. } = *settings;
        let (width, height) = input.size();
        let count = (width * height) as f32;
        let shared = Bidirectional {
            camera_paths: input.camera_paths(),
            initial_media,
            techniques: TechniqueSet::BDPT,
            light_paths: count,
            connections: 1.0,
            spared: 1.0,
            merged_paths: count,
            only: None,
        };
        let levels = self.levels;
        let walks = Walks {
            shared: &shared,
            light_paths: LightPaths::new(seed, i, Domain::Light, width * height, max_depth),
            levels: &levels,
            cameras: Streams::new(seed, i, Domain::CameraIndependent),
            lights: Streams::new(seed, i, Domain::Light),
            size: UVec2::new(width, height),
        };
        let (candidates, rejected) = self.walk_all(&walks);
        let count = (pixels.len() / STEPS).max(MIN_CHAINS);
        let steps = pixels.len().div_ceil(count);
        let u = walks.cameras.path(u64::MAX).vertex(CHAIN_VERTEX).one_fine(Purpose::Film);
        let (starts, total) = starts(&candidates, count, u);
        drop(candidates);
        let left: Vec<Left> = starts
            .par_iter()
            .enumerate()
            .map_init(Bump::new, |arena, (number, candidate)| walks.chain(arena, number as u64, candidate, steps))
            .collect();
        if settings.stop.aborted() {
            return None;
        }
        // The steps represent all pixels, and light over importance is scaled to the mean `b`.
        let scale = (total / (count * steps) as f64) as f32;
        for Left { deposits, lobes } in &left {
            for (Deposit { pixel, value, .. }, (first, direct)) in deposits.iter().zip(lobes) {
                self.lobes[self.tiles.slot(*pixel)].add(first, *direct, *value * scale);
            }
        }
        for Deposit { pixel, part, value } in left.into_iter().flat_map(|left| left.deposits) {
            let sample = &mut self.samples[self.tiles.slot(pixel)];
            let into = match part {
                Part::Caustic => &mut sample.caustic_photons[0],
                Part::Volume => &mut sample.volume_photons[0],
                _ => &mut sample.indirect_photons[0],
            };
            *into += value * scale;
        }
        let (camera_paths, tiles, samples, lobes) = (shared.camera_paths, self.tiles, &self.samples, &self.lobes);
        pixels.par_iter_mut().enumerate().with_min_len(1024).for_each(|(index, pixel)| {
            let slot = tiles.slot(index as u32);
            let sample = &samples[slot];
            pixel.record_first_hit(i, || camera_paths.first_hit(sample));
            pixel.add_with_groups(i, sample, None, &[], lobes.get(slot));
        });
        phases.eye += cpu_seconds() - started;
        Some(Work { light_paths: u64::from(width) * u64::from(height), rejected, ..Work::default() })
    }
}
