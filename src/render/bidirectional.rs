//! One iteration of the methods made of whole paths: path tracing, light tracing, bidirectional path tracing, bidirectional
//! photon mapping, vertex connection and merging.
//!
//! Tiles of constant size are the unit of work. A tile walks the light path and then the eye path of each of its pixels. What light paths
//! send to the film is a list per tile, added in the order of tiles, so the sums do not depend on threads; photons
//! are likewise concatenated and wait for the next iteration.
//!
//! With bandwidth levels every pixel has two light paths and two eye paths: level 1 is made of the first pair alone, the other levels of the
//! second. They share nothing but the photons, those of both light paths.

use super::control::cpu_seconds;
use super::drive::{Iterate, Work};
use super::result::Phases;
use super::settings::Settings;
use crate::camera::Camera;
use crate::estimator::bandwidth::initial_bandwidths;
use crate::estimator::rule::memoryless::radius2_factor;
use crate::estimator::{InitialBandwidth, Pixel};
use crate::photon::PhotonMap;
use crate::random::{Domain, Stream};
use crate::scene::Scene;
use crate::transport::mis::Eta;
use crate::transport::{
    Bidirectional, Eye, EyeMeasure, Left, LightPass, LightVertices, Meets, MergeLevels, MergePhoton, Splat,
    Surroundings, path_measure,
};
use bumpalo::Bump;
use rayon::prelude::*;

/// Width and height of a tile in pixels.
const TILE: u32 = 16;
const TILE_PIXELS: usize = (TILE * TILE) as usize;

/// The films' tiles.
#[derive(Clone, Copy)]
struct Tiles {
    width: u32,
    height: u32,
    across: u32,
}

impl Tiles {
    fn new(camera: &Camera) -> Tiles {
        let (width, height) = camera.size();
        Tiles { width, height, across: width.div_ceil(TILE) }
    }

    fn count(&self) -> usize {
        self.across as usize * self.height.div_ceil(TILE) as usize
    }

    /// Where pixel `index` (row by row) is kept, tile by tile.
    #[inline]
    fn slot(&self, index: u32) -> usize {
        let (x, y) = (index % self.width, index / self.width);
        (y / TILE * self.across + x / TILE) as usize * TILE_PIXELS + (y % TILE * TILE + x % TILE) as usize
    }

    /// Pixels of a tile: slot in the tile and place on the film.
    fn pixels(self, tile: usize) -> impl Iterator<Item = (usize, (u32, u32))> {
        let (x0, y0) = (tile as u32 % self.across * TILE, tile as u32 / self.across * TILE);
        (0..TILE * TILE)
            .map(move |i| (i as usize, (x0 + i % TILE, y0 + i / TILE)))
            .filter(move |(_, (x, y))| *x < self.width && *y < self.height)
    }
}

/// A light path and an eye path for every pixel, and the levels they make.
struct Pair {
    light: Domain,
    eye: Domain,
    /// First level and number of levels.
    levels: (usize, usize),
}

/// What iterations share.
pub struct Passes<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    settings: &'a Settings,
    surroundings: &'a Surroundings,
    shared: Option<Bidirectional<'a>>,
    pairs: Vec<Pair>,
    tiles: Tiles,
    /// Measures of the iteration, one list per pair.
    measures: Vec<Vec<EyeMeasure>>,
    /// Photons and the pass that left them.
    photons: Option<(u64, PhotonMap<MergePhoton>)>,
}

impl<'a> Passes<'a> {
    /// Nothing done yet. `settings.levels` must be one level unless the method has levels.
    pub fn new(
        scene: &'a Scene,
        camera: &'a Camera,
        settings: &'a Settings,
        surroundings: &'a Surroundings,
    ) -> Passes<'a> {
        let levels = settings.levels;
        let mut pairs = vec![Pair { light: Domain::Light, eye: Domain::EyeIndependent, levels: (0, levels.count) }];
        if levels.two_paths && levels.count > 1 {
            pairs[0].levels = (0, 1);
            let rest = (1, levels.count - 1);
            pairs.push(Pair { light: Domain::LightCorrelated, eye: Domain::EyeCorrelated, levels: rest });
        }
        let (width, height) = camera.size();
        let pixels = (width * height) as f32;
        let eye = Eye { scene, camera, interior: surroundings.eye, max_depth: settings.max_depth };
        let shared = settings.method.strategies(camera).map(|strategies| Bidirectional {
            eye,
            surroundings,
            strategies,
            light_paths: pixels,
            merged_paths: pixels * pairs.len() as f32,
        });
        let tiles = Tiles::new(camera);
        let measures = pairs.iter().map(|_| vec![EyeMeasure::default(); tiles.count() * TILE_PIXELS]).collect();
        Passes { scene, camera, settings, surroundings, shared, pairs, tiles, measures, photons: None }
    }

    fn eye(&self) -> Eye<'a> {
        let Passes { scene, camera, .. } = *self;
        Eye { scene, camera, interior: self.surroundings.eye, max_depth: self.settings.max_depth }
    }

    fn light_pass(&self, i: u64, pair: &Pair) -> LightPass {
        let (width, height) = self.camera.size();
        LightPass::new(self.settings.seed, i, pair.light, width * height, self.settings.max_depth)
    }

    /// The photons that pass `i` leaves, where it was not rendered here.
    fn photons_of(&self, i: u64, shared: &Bidirectional<'_>) -> PhotonMap<MergePhoton> {
        let (width, tiles) = (self.tiles.width, self.tiles);
        let mut parts = Vec::new();
        // In the order of `iterate`, so that even photons in one place are summed alike.
        for pair in &self.pairs {
            let pass = self.light_pass(i, pair);
            let walk = |tile| {
                let (mut left, mut arena) = (Left::default(), Bump::new());
                for (_, (x, y)) in tiles.pixels(tile) {
                    arena.reset();
                    let mut vertices = LightVertices::new_in(&arena);
                    shared.light_path(&pass, y * width + x, true, &mut vertices, &mut left, &mut ());
                }
                left.photons
            };
            parts.par_extend((0..tiles.count()).into_par_iter().map(walk));
        }
        PhotonMap::build(parts.concat())
    }

    /// Adds iteration `i` (from 1) to all pixels. Returns the number of light paths walked and of photons merged.
    fn pass(&mut self, i: u64, pixels: &mut [Pixel]) -> Work {
        let Some(shared) = self.shared else {
            self.paths(i);
            self.add(pixels);
            return Work { light_paths: 0, photons: 0 };
        };
        if shared.strategies.merge && self.photons.as_ref().is_none_or(|(pass, _)| pass + 1 != i) {
            // The first pass of all can do without photons if it connects.
            let first = i == 1 && shared.strategies.connect;
            self.photons = if first { None } else { Some((i - 1, self.photons_of(i - 1, &shared))) };
        }
        let factor = radius2_factor(i, self.settings.alpha) as f32;
        let merged = self.photons.is_some();
        let count = self.settings.levels.count;
        let levels = |bandwidth: f32, pair: &Pair| {
            let largest2 = bandwidth * bandwidth * factor;
            MergeLevels::new((pair.levels.0..pair.levels.0 + pair.levels.1).map(|level| {
                let radius2 = largest2 * 0.5f32.powi((count - 1 - level) as i32);
                let eta = match (merged, shared.strategies.connect) {
                    (false, _) => Eta::NONE,
                    (true, true) => Eta::new(radius2, shared.merged_paths),
                    (true, false) => Eta::MERGE_ONLY,
                };
                (radius2, eta)
            }))
        };
        let (width, seed, tiles) = (self.tiles.width, self.settings.seed, self.tiles);
        let map = self.photons.as_ref().map(|(_, map)| map);
        let merges = map.map_or(0, |map| map.photons().len());
        let bandwidths: &[Pixel] = pixels;
        let mut photons: Vec<Vec<MergePhoton>> = Vec::new();
        let passes: Vec<LightPass> = self.pairs.iter().map(|pair| self.light_pass(i, pair)).collect();
        for ((pair, pass), measures) in self.pairs.iter().zip(&passes).zip(&mut self.measures) {
            let left: Vec<(Vec<Splat>, Vec<MergePhoton>)> = measures
                .par_chunks_mut(TILE_PIXELS)
                .enumerate()
                .map(|(tile, measures)| {
                    let (mut left, mut arena) = (Left::default(), Bump::new());
                    for (slot, (x, y)) in tiles.pixels(tile) {
                        let index = y * width + x;
                        arena.reset();
                        let mut vertices = LightVertices::new_in(&arena);
                        shared.light_path(pass, index, false, &mut vertices, &mut left, &mut ());
                        let levels = levels(bandwidths[index as usize].bandwidth, pair);
                        let meets = Meets { vertices: &vertices, photons: map, levels: &levels };
                        let stream = Stream::new(seed, i, pair.eye, u64::from(index));
                        measures[slot] = shared.eye_path(&arena, (x, y), stream, &meets, &mut ());
                    }
                    (left.splats, left.photons)
                })
                .collect();
            for (splats, left) in left {
                for splat in splats {
                    let levels = levels(bandwidths[splat.pixel as usize].bandwidth, pair);
                    splat.apply(&levels, &mut measures[tiles.slot(splat.pixel)]);
                }
                photons.push(left);
            }
        }
        let walked = self.pairs.len() as u64 * u64::from(passes[0].paths());
        self.add(pixels);
        if shared.strategies.merge && self.settings.shard.count == 1 {
            self.photons = Some((i, PhotonMap::build(photons.concat())));
        }
        Work { light_paths: walked, photons: merges }
    }

    /// Path tracing.
    fn paths(&mut self, i: u64) {
        let (eye, tiles, seed) = (self.eye(), self.tiles, self.settings.seed);
        let domain = self.pairs[0].eye;
        self.measures[0].par_chunks_mut(TILE_PIXELS).enumerate().for_each(|(tile, measures)| {
            let mut arena = Bump::new();
            for (slot, (x, y)) in tiles.pixels(tile) {
                arena.reset();
                let stream = Stream::new(seed, i, domain, u64::from(y * tiles.width + x));
                measures[slot] = path_measure(&eye, &arena, (x, y), stream);
            }
        });
    }

    /// Adds the iteration's measures to the pixels.
    fn add(&self, pixels: &mut [Pixel]) {
        let levels = self.settings.levels;
        pixels.par_iter_mut().enumerate().with_min_len(1024).for_each(|(index, pixel)| {
            let slot = self.tiles.slot(index as u32);
            let measure = &self.measures[0][slot];
            if let (0, Some(first)) = (pixel.iterations, measure.first) {
                pixel.z = self.camera.depth(first.p);
                pixel.p = (first.p.as_dvec3() + self.scene.origin).as_vec3();
            }
            let others = self.measures.get(1).map(|measures| &measures[slot]);
            pixel.add(measure, others, levels.count, levels.own());
        });
    }
}

impl Iterate for Passes<'_> {
    fn pixels(&mut self) -> Vec<Pixel> {
        let (width, height) = self.camera.size();
        if !self.settings.method.has_bandwidths() {
            return vec![Pixel::new(0.0); width as usize * height as usize];
        }
        // Merging is one of many strategies, and small kernels suffice \[Georgiev et al. 2012\].
        let initial = match self.settings.initial {
            InitialBandwidth::Fixed(radius) => InitialBandwidth::Fixed(radius),
            _ => InitialBandwidth::Footprint,
        };
        let none = PhotonMap::build(Vec::new());
        initial_bandwidths(&self.eye(), initial, self.settings.seed, &none).into_iter().map(Pixel::new).collect()
    }

    fn iterate(&mut self, i: u64, pixels: &mut [Pixel], phases: &mut Phases) -> Work {
        let start = cpu_seconds();
        let work = self.pass(i, pixels);
        // Light and eye paths take turns within a pixel.
        phases.eye += cpu_seconds() - start;
        work
    }
}
