//! Variances of every choice of numbers of samples, from one proxy render with one sample of each technique
//! \[Grittmann et al. 2022, "Efficiency-aware multiple importance sampling for bidirectional rendering algorithms"\].
//!
//! Let B be the sum over techniques of number of samples times density times worth (1, or less for merges) of the proxy,
//! and C that of a candidate. A sample of the proxy with the weighted contribution V and the worth w adds `V^2 B / (C w)`
//! to an estimate of the candidate's second moment, and `V B / C` to the value of its camera path, whose samples are
//! correlated; see docs/theory.md. B and C are affine in the numbers of light paths, connections and merges. The
//! coefficients are differences between the weights of the same paths with other numbers of light paths and connections.
//!
//! Camera paths of the proxy have the roulette of path tracing. A candidate whose roulette ends a path more often, by the
//! ratio R of the probabilities to get as far as a sample, has R times the second moment there. A candidate of camera
//! paths alone does without the roulette of light paths.
//!
//! Direct light is sampled alike by all candidates. Its variance is measured, and is the same for all of them.

use super::guiding::learn_guide;
use super::survival::{CameraSurvival, LightSurvival, PhotonSurvival};
use crate::camera::{Camera, GROUP_SIZE, TilePixel};
use crate::estimator::level_factor2;
use crate::film::Size;
use crate::finish::window;
use crate::light::Guide;
use crate::math::{Rgb, Vec3};
use crate::path_class::{Part, PathClass};
use crate::photon::PhotonMap;
use crate::random::{Domain, Streams};
use crate::render::initial_bandwidth::{FOOTPRINT_PIXELS, InitialBandwidth, initial_bandwidths};
use crate::render::settings::{Counts, Settings};
use crate::scene::Scene;
use crate::spectrum::IterationWavelengths;
use crate::stat::{floor, median};
use crate::transport::bidirectional::mis::{Eta, Merges, Ratios};
use crate::transport::{
    Bidirectional, CameraPathStart, CameraWalkContext, Deposits, InitialMedia, LightPaths, LightVertices, MergeLevels,
    MergePhoton, PathKind, PathRecorder, PixelSample, SPARED_BY_ROULETTE, Technique, TechniqueSet,
};
use bumpalo::Bump;
use rayon::prelude::*;

/// Side of a block of pixels of the render, for which moments are averaged.
const BLOCK: f64 = 8.0;
/// Share of the blocks, those with the largest moments, that the mean over blocks leaves out.
const TRIMMED_SHARE: f64 = 0.001;
/// Density of a sample of the proxy over that of a candidate above which the candidate samples this light poorly.
const POOR: f64 = 16.0;
/// Numbers of light paths (relative) and connections of the three sets of weights of a path.
const VARIANTS: [(f32, f32); 3] = [(1.0, 1.0), (1.0, 2.0), (2.0, 1.0)];

/// Sums of densities of all techniques that sample a path, by kind of technique, for one sample of each, relative to
/// the density of the technique at hand.
#[derive(Clone, Copy, Debug, Default)]
struct Densities {
    /// Emission that the camera path hits, and next-event estimation.
    camera: f64,
    connections: f64,
    /// Light vertices seen by the camera.
    light: f64,
    /// Coefficients of eta.
    merges: Merges,
}

impl Densities {
    /// Separates the ratios of the same path under [`VARIANTS`].
    fn of(technique: Technique, ratios: [Ratios; 3]) -> Densities {
        let [one, connected, lit] = ratios.map(|ratios| ratios.plain);
        // Ratios are relative to a technique with all of its samples.
        let connected = if matches!(technique, Technique::Connect { .. }) { 2.0 * connected } else { connected };
        let lit = if matches!(technique, Technique::Camera { .. }) { 2.0 * lit } else { lit };
        let [connections, light] = [connected - one, lit - one].map(|difference| difference.max(0.0));
        // Densities of photons are stored in single precision, which resolves no smaller differences.
        let camera = (one - connections - light).max(f64::from(f32::EPSILON) * one);
        Densities { camera, connections, light, merges: ratios[0].merged }
    }
}

/// Numbers of samples of a candidate as factors of [`Densities`].
#[derive(Clone, Copy, Debug)]
struct Factors {
    connections: f64,
    light: f64,
    /// Number of merges for one light path per pixel.
    merged: f64,
    /// Coefficients of eta for one light path per pixel: merges times their worth.
    merges: Merges,
    /// Whether roulette spares camera paths as in path tracing.
    spares: bool,
}

impl Factors {
    /// `covered` is the number of pixels in a merging disc, and the expected number of photons in it with one light path per
    /// pixel.
    fn new(counts: Counts, covered: f64) -> Factors {
        let light = counts.light_paths_per_pixel();
        let merged = light * f64::from(counts.merging);
        let connections = if counts.light_paths == 0 { 0.0 } else { f64::from(counts.connections) };
        let merges = Merges::new(merged / (1.0 + covered), merged / (1.0 + light * covered));
        Factors { connections, light, merged, merges, spares: counts.leave_camera_paths_alone(counts.merging > 0.0) }
    }

    #[inline]
    fn sum(&self, densities: &Densities, eta: f64) -> f64 {
        let plain = densities.camera + self.connections * densities.connections + self.light * densities.light;
        plain + eta * self.merges.dot(densities.merges)
    }
}

/// A contribution of the proxy to a pixel.
#[derive(Clone, Copy)]
struct Contribution {
    technique: Technique,
    ratios: Ratios,
    /// Weighted contribution.
    value: Rgb,
    is_direct: bool,
    /// The connected light vertex, or the merged photon.
    from: Vec3,
    survival: CameraSurvival,
}

/// Records the contributions of a camera path.
struct Contributions {
    list: Vec<Contribution>,
    survival: CameraSurvival,
    /// [`Contributions::survival`] where the current branches of the path began.
    branches: Vec<CameraSurvival>,
}

impl Contributions {
    fn new() -> Contributions {
        Contributions { list: Vec::new(), survival: CameraSurvival::START, branches: Vec::new() }
    }
}

impl PathRecorder for Contributions {
    fn contribution(&mut self, technique: Technique, _: Rgb, from: Vec3, ratios: Ratios) {
        let (value, survival) = (Rgb::ZERO, self.survival);
        self.list.push(Contribution { technique, ratios, value, is_direct: false, from, survival });
    }

    fn continues(&mut self, survival: impl Fn(f32) -> f32) {
        self.survival.continues(survival);
    }

    fn begin_branch(&mut self) {
        self.branches.push(self.survival);
    }

    fn end_branch(&mut self) {
        self.survival = self.branches.pop().unwrap_or(CameraSurvival::START);
    }

    fn arrival(&mut self, _: Technique, of: PathKind, _: usize, value: Rgb, weight: f32) {
        if let Some(last) = self.list.last_mut() {
            last.value += value * weight;
            last.is_direct |= is_direct(of.class);
        }
    }
}

fn is_direct(class: PathClass) -> bool {
    matches!(class.part(), Part::Emission | Part::Direct)
}

/// Samples that share a camera path, whose correlation is estimated.
#[derive(Clone, Copy, PartialEq)]
enum Correlated {
    /// Hits and next-event estimation.
    Camera,
    Connections,
    /// Merges that share a random camera path.
    Merges,
    /// Independent samples: light vertices seen by the camera, and merges at what the pixel shows.
    None,
}

/// A weighted contribution of the proxy, with the densities of its path.
struct Sample {
    group: Correlated,
    value: Rgb,
    eta: f64,
    /// Sum of the proxy's densities.
    proxy: f64,
    worth: f64,
    densities: Densities,
    /// Factors of the second moment by the roulette of a candidate: if it spares no camera path (or samples all of the
    /// path by a light path), and if it spares them and samples all of the path by a camera path.
    unspared: f64,
    by_camera: f64,
}

/// Sums over the samples of the proxy for a candidate.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    /// Second moments, and products of different samples of one camera path.
    moment: f64,
    /// Values of the samples of camera, connections and merges.
    values: [Rgb; 3],
    /// Light of the samples that the candidate hardly ever takes.
    poorly_sampled: f64,
}

impl Sums {
    /// Adds the samples of one path, in the order of its vertices.
    #[inline]
    fn add(&mut self, samples: &[Sample], factors: &Factors) {
        let (c, n) = (factors.connections as f32, factors.merged as f32);
        // Numbers of pairs of a sample with samples of camera, connections and merges.
        let pairs = [[1.0, c, n], [c, c, c * n], [n, c * n, 0.0]];
        // Sums over the samples so far, times the ratio of their survival.
        let mut before = [Rgb::ZERO; 3];
        for sample in samples {
            let density = factors.sum(&sample.densities, sample.eta);
            let ratio = sample.proxy / density;
            let roulette = if factors.spares {
                let camera = sample.densities.camera / density;
                let light = factors.light * sample.densities.light / density;
                1.0 + camera * (sample.by_camera - 1.0) + light * (sample.unspared - 1.0)
            } else {
                sample.unspared
            };
            self.moment += mean_square(sample.value) * ratio / sample.worth * roulette;
            if ratio > POOR {
                self.poorly_sampled += mean(sample.value);
            }
            if sample.group == Correlated::None {
                continue;
            }
            let (group, value) = (sample.group as usize, sample.value * ratio as f32);
            let [camera, connections, merges] = pairs[group];
            let paired = before[0] * camera + before[1] * connections + before[2] * merges;
            // A path that gets as far as the later sample of a pair has survived to the earlier one.
            self.moment += 2.0 * f64::from((value * paired).element_sum()) / 3.0;
            before[group] += if factors.spares { value } else { value * sample.unspared as f32 };
            self.values[group] += value;
        }
    }

    /// The variance of an iteration, from the sums of `count` paths.
    fn variance(&self, count: f64, factors: &Factors) -> f64 {
        let [camera, connections, merges] = self.values.map(|sum| sum / count as f32);
        let c = factors.connections;
        let mean = camera + connections * c as f32 + merges * factors.merged as f32;
        self.moment / count - mean_square(mean) + c * (c - 1.0) * mean_square(connections)
    }
}

fn mean(value: Rgb) -> f64 {
    f64::from(value.element_sum()) / 3.0
}

fn mean_square(value: Rgb) -> f64 {
    f64::from((value * value).element_sum()) / 3.0
}

/// Sums over the samples of the proxy, by block of pixels.
#[derive(Clone, Debug, Default)]
struct Block {
    /// Indirect light, by candidate.
    sums: Vec<Sums>,
    light: f64,
    /// Sum over pixels of the variance of direct light in an iteration.
    direct_variance: f64,
    pixels: f64,
}

/// Second moments of all candidates.
pub struct SecondMoments {
    blocks: Vec<Block>,
    size: Size,
    iterations: f64,
    candidates: Vec<Factors>,
}

/// A proxy render in a small picture, which estimates the second moments of other renders.
pub struct Proxy<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The camera with the size of the small picture.
    pub camera: &'a Camera,
    /// Settings of `vcm`.
    pub settings: &'a Settings,
    /// Width of the picture that will be rendered (pixels).
    pub render_width: u32,
    /// Iteration of the render whose bandwidths the proxy takes.
    pub typical_iteration: u64,
    /// Numbers of samples of the other renders.
    pub candidates: &'a [Counts],
}

/// Data that the walks of all iterations read.
struct Walks<'w, 'a> {
    proxy: &'w Proxy<'a>,
    variants: [Bidirectional<'w>; 3],
    guide: Option<&'w Guide>,
    bandwidth2: Vec<f32>,
    covered: f64,
    /// Side of a block in pixels of the proxy.
    side: u32,
    blocks: Size,
    candidates: Vec<Factors>,
    of_proxy: Factors,
}

/// Sums and photons of one row of blocks in an iteration.
#[derive(Default)]
struct RowOutput {
    /// Sums of the row's blocks.
    blocks: Vec<Vec<Sums>>,
    /// Samples that light paths send to blocks of all rows.
    splats: Vec<(usize, Sample)>,
    /// Light by pixel.
    light: Vec<(usize, f64)>,
    /// Direct light of every pixel of the row.
    direct: Vec<(usize, Rgb)>,
    photons: [Vec<MergePhoton>; 3],
    survival: PhotonSurvival,
}

/// Photons of the previous iteration: the maps of the three sets of weights, and the survival of their light paths.
#[derive(Default)]
struct Photons {
    lists: [Vec<MergePhoton>; 3],
    survival: PhotonSurvival,
}

/// [`Photons`] in maps.
struct PhotonMaps {
    maps: [PhotonMap<MergePhoton>; 3],
    survival: PhotonSurvival,
}

impl Photons {
    fn build(mut self) -> PhotonMaps {
        self.survival.sort();
        PhotonMaps { maps: self.lists.map(PhotonMap::build), survival: self.survival }
    }

    fn append(&mut self, row: &RowOutput) {
        (0..3).for_each(|k| self.lists[k].extend_from_slice(&row.photons[k]));
        self.survival.append(&row.survival);
    }
}

impl Proxy<'_> {
    /// Learns where the light paths of the proxy start; `None` if they are not guided.
    pub fn learn_guide(&self) -> Option<Guide> {
        let initial_media = InitialMedia::of(self.scene, self.camera);
        let camera_paths = self.settings.camera_paths(self.scene, self.camera, &initial_media);
        self.settings.guided.then(|| learn_guide(&camera_paths, &initial_media, self.settings, None)).flatten()
    }

    /// Renders `iterations` iterations, or fewer, but at least two, once `late` returns true. The result is useless if the
    /// user stops the render ([`Settings::stop`]).
    pub fn measure(&self, guide: Option<&Guide>, iterations: u64, late: &dyn Fn() -> bool) -> SecondMoments {
        let initial_media = InitialMedia::of(self.scene, self.camera);
        let camera_paths = self.settings.camera_paths(self.scene, self.camera, &initial_media);
        let (width, height) = self.camera.size();
        let pixels = (width * height) as f32;
        let variants = VARIANTS.map(|(light_paths, connections)| Bidirectional {
            camera_paths,
            initial_media: &initial_media,
            techniques: TechniqueSet::VCM,
            light_paths: light_paths * pixels,
            connections,
            merged_paths: pixels,
            spared: SPARED_BY_ROULETTE,
            only: None,
        });
        let (schedule, level) = (self.settings.schedule(self.typical_iteration), self.settings.levels.picture_level());
        let none = PhotonMap::build(Vec::new());
        let [widest, _] = self.settings.max_initial_bandwidth;
        let bandwidths =
            initial_bandwidths(&camera_paths, InitialBandwidth::Footprint, widest, self.settings.seed, [&none; 1]);
        let shrunk = schedule.factor2() * level_factor2(level, schedule.levels());
        let covered = std::f64::consts::PI * f64::from(FOOTPRINT_PIXELS * FOOTPRINT_PIXELS * shrunk);
        let side = (BLOCK * f64::from(width) / f64::from(self.render_width)).round().max(1.0) as u32;
        let blocks = Size { width: width.div_ceil(side) as usize, height: height.div_ceil(side) as usize };
        let walks = Walks {
            proxy: self,
            variants,
            guide,
            bandwidth2: bandwidths.iter().map(|[bandwidth]| schedule.bandwidth2(*bandwidth, level)).collect(),
            covered,
            side,
            blocks,
            candidates: self.candidates.iter().map(|counts| Factors::new(*counts, covered)).collect(),
            of_proxy: Factors::new(Counts::DEFAULT, covered),
        };
        walks.run(iterations, late)
    }
}

impl Walks<'_, '_> {
    fn run(&self, iterations: u64, late: &dyn Fn() -> bool) -> SecondMoments {
        let none = Block { sums: vec![Sums::default(); self.candidates.len()], ..Block::default() };
        let mut blocks = vec![none; self.blocks.pixels()];
        let mut direct = vec![[Rgb::ZERO; 2]; self.bandwidth2.len()];
        let mut photons = Photons::default();
        let mut done = 0;
        // The first iteration leaves the photons for the second, and is not counted.
        for iteration in 0..=iterations {
            if self.proxy.settings.stop.requested() || (done >= 2 && late()) {
                break;
            }
            let maps = photons.build();
            let rows: Vec<RowOutput> =
                (0..self.blocks.height).into_par_iter().map(|row| self.row(row, iteration, &maps)).collect();
            photons = Photons::default();
            rows.iter().for_each(|row| photons.append(row));
            if iteration > 0 {
                done += 1;
                self.add_rows(rows, &mut blocks, &mut direct);
            }
        }
        let n = done as f32;
        for (pixel, [sum, squares]) in direct.into_iter().enumerate() {
            let variance = (squares - sum * sum / n) / (n - 1.0).max(1.0);
            let block = &mut blocks[self.block_of(pixel)];
            block.direct_variance += f64::from(variance.element_sum().max(0.0) / 3.0);
            block.pixels += 1.0;
        }
        SecondMoments { blocks, size: self.blocks, iterations: f64::from(n), candidates: self.candidates.clone() }
    }

    /// Adds the sums of an iteration, row by row.
    fn add_rows(&self, rows: Vec<RowOutput>, blocks: &mut [Block], direct: &mut [[Rgb; 2]]) {
        for (pixel, light) in rows.iter().flat_map(|row| &row.light) {
            blocks[self.block_of(*pixel)].light += light;
        }
        for (pixel, light) in rows.iter().flat_map(|row| &row.direct) {
            direct[*pixel][0] += *light;
            direct[*pixel][1] += *light * *light;
        }
        for (block, sums) in blocks.iter_mut().zip(rows.iter().flat_map(|row| &row.blocks)) {
            for (total, sums) in block.sums.iter_mut().zip(sums) {
                total.moment += sums.moment;
                total.poorly_sampled += sums.poorly_sampled;
                total.values.iter_mut().zip(sums.values).for_each(|(total, value)| *total += value);
            }
        }
        for (block, sample) in rows.iter().flat_map(|row| &row.splats) {
            let sums = blocks[*block].sums.iter_mut().zip(&self.candidates);
            sums.for_each(|(sums, factors)| sums.add(std::slice::from_ref(sample), factors));
        }
    }

    fn block_of(&self, pixel: usize) -> usize {
        let width = self.proxy.camera.size().0 as usize;
        let (x, y) = (pixel % width, pixel / width);
        y / self.side as usize * self.blocks.width + x / self.side as usize
    }

    fn levels(&self, pixel: usize) -> MergeLevels {
        let bandwidth2 = self.bandwidth2[pixel];
        let eta = Eta::new(bandwidth2, self.variants[0].merged_paths).sharing(self.covered as f32, self.covered as f32);
        MergeLevels::new(std::iter::once((bandwidth2, eta)))
    }

    /// Traces the light paths and camera paths of a row of blocks.
    fn row(&self, row: usize, iteration: u64, maps: &PhotonMaps) -> RowOutput {
        let Settings { seed, max_depth, .. } = *self.proxy.settings;
        let (width, height) = self.proxy.camera.size();
        let count = width * height;
        let light_paths = LightPaths::new(seed, iteration, Domain::PilotLight, count, max_depth)
            .guided(self.guide)
            .with(IterationWavelengths::drifting(seed, iteration));
        let streams = Streams::new(seed, iteration, Domain::PilotCamera);
        let sums = vec![Sums::default(); self.candidates.len()];
        let mut output = RowOutput { blocks: vec![sums; self.blocks.width], ..RowOutput::default() };
        let mut arena = Bump::new();
        let first = row as u32 * self.side;
        for y in first..(first + self.side).min(height) {
            for x0 in (0..width).step_by(GROUP_SIZE) {
                if self.proxy.settings.stop.requested() {
                    return output;
                }
                let places = std::array::from_fn(|k| {
                    let x = x0 + k as u32;
                    let index = u64::from(y * width + x);
                    (x < width).then_some(TilePixel { pixel: (x, y), index, at: index as usize })
                });
                let starts = self.variants[0].camera_paths.starts(&places, streams);
                for (place, start) in places.iter().flatten().zip(starts.into_iter().flatten()) {
                    arena.reset();
                    self.pair(&arena, place.index as u32, &light_paths, start, maps, &mut output);
                }
            }
        }
        output
    }

    /// Traces the light path and the camera path of a pixel, with the weights of each variant.
    fn pair(
        &self,
        arena: &Bump,
        index: u32,
        light_paths: &LightPaths<'_>,
        mut start: CameraPathStart,
        photons: &PhotonMaps,
        output: &mut RowOutput,
    ) {
        let pixel = index as usize;
        start.ray.wavelength_sample = light_paths.wavelength(index);
        let emitted = light_paths.emit(self.proxy.scene, self.variants[0].initial_media, index);
        let levels = self.levels(pixel);
        let mut left: [Deposits; 3] = Default::default();
        let mut found = [(); 3].map(|()| Contributions::new());
        let mut sample = PixelSample::default();
        let mut survival = LightSurvival::default();
        for k in [2, 1, 0] {
            let shared = &self.variants[k];
            let mut vertices = LightVertices::new_in(arena);
            survival.restart();
            if let Some(emitted) = &emitted {
                shared.light_path(light_paths, emitted, false, &mut vertices, &mut left[k], &mut survival);
            }
            let context = CameraWalkContext { vertices: &vertices, photons: Some(&photons.maps[k]), levels: &levels };
            shared.camera_path(arena, &start, &context, &mut found[k], &mut sample);
            if k == 0 {
                let of_photons = left[0].photons.iter().map(|photon| (photon.p, survival.at(photon.depth.into())));
                of_photons.for_each(|(p, survival)| output.survival.push(p, survival));
            }
            output.photons[k].append(&mut left[k].photons);
        }
        let light_survival = |technique, from| {
            f64::from(match technique {
                Technique::Hit { .. } | Technique::NextEvent { .. } => 1.0,
                Technique::Connect { light, .. } | Technique::Camera { light } => survival.at(light),
                Technique::Merge { .. } => photons.survival.of(from),
            })
        };
        output.direct.push((pixel, sample.direct));
        let mut samples = Vec::new();
        for ((one, connected), lit) in found[0].list.iter().zip(&found[1].list).zip(&found[2].list) {
            let ratios = [one.ratios, connected.ratios, lit.ratios];
            output.light.extend(lit_pixel(pixel, one.value));
            let sample = self.sample(pixel, one.technique, ratios, one.value).filter(|_| !one.is_direct);
            samples.extend(sample.map(|sample| {
                let by_camera = one.survival.without_light_path(light_survival(one.technique, one.from));
                Sample { unspared: one.survival.ratio(), by_camera, ..sample }
            }));
        }
        let block = &mut output.blocks[self.block_of(pixel) % self.blocks.width];
        block.iter_mut().zip(&self.candidates).for_each(|(sums, factors)| sums.add(&samples, factors));
        for ((one, connected), lit) in left[0].splats.iter().zip(&left[1].splats).zip(&left[2].splats) {
            let (pixel, technique) = (one.pixel as usize, Technique::Camera { light: one.light });
            let value = one.value * one.ratios.weight(self.levels(pixel).eta()[0]);
            output.light.extend(lit_pixel(pixel, value));
            let sample = self.sample(pixel, technique, [one.ratios, connected.ratios, lit.ratios], value);
            let by_camera = CameraSurvival::START.without_light_path(light_survival(technique, Vec3::ZERO));
            let sample = sample.map(|sample| Sample { by_camera, ..sample });
            output.splats.extend(sample.filter(|_| !is_direct(one.class)).map(|one| (self.block_of(pixel), one)));
        }
    }

    /// A sample of the proxy; `None` without light.
    fn sample(&self, pixel: usize, technique: Technique, ratios: [Ratios; 3], value: Rgb) -> Option<Sample> {
        let square = mean_square(value);
        if !(square > 0.0 && square.is_finite()) {
            return None;
        }
        let (densities, own) = (Densities::of(technique, ratios), ratios[0].own);
        let eta = std::f64::consts::PI * f64::from(self.bandwidth2[pixel] * self.variants[0].merged_paths);
        let group = match technique {
            Technique::Hit { .. } | Technique::NextEvent { .. } => Correlated::Camera,
            Technique::Connect { .. } => Correlated::Connections,
            _ if own.y > 0.0 => Correlated::Merges,
            _ => Correlated::None,
        };
        let worth = if own == Merges::ZERO { 1.0 } else { 1.0 / (1.0 + self.covered) };
        let proxy = self.of_proxy.sum(&densities, eta);
        Some(Sample { group, value, eta, proxy, worth, densities, unspared: 1.0, by_camera: 1.0 })
    }
}

/// The light of a sample, with its pixel; `None` if it is not finite.
fn lit_pixel(pixel: usize, value: Rgb) -> Option<(usize, f64)> {
    let light = mean(value);
    light.is_finite().then_some((pixel, light))
}

impl SecondMoments {
    /// The variance of an iteration's indirect light for a candidate, summed over the pixels of a block.
    fn indirect_variance(&self, block: &Block, candidate: usize) -> f64 {
        block.pixels * block.sums[candidate].variance(block.pixels * self.iterations, &self.candidates[candidate])
    }

    /// Mean over pixels of the variance of an iteration's indirect light, by candidate.
    pub fn indirect_variances(&self) -> Vec<f64> {
        let pixels: f64 = self.blocks.iter().map(|block| block.pixels).sum();
        let sum = |candidate| self.blocks.iter().map(|block| self.indirect_variance(block, candidate)).sum::<f64>();
        (0..self.candidates.len()).map(|candidate| sum(candidate) / pixels).collect()
    }

    /// Share of the picture's light, by candidate, that the candidate samples with less than a sixteenth of the proxy's
    /// density. A short render by the candidate may miss it, and look free of noise.
    pub fn poorly_sampled(&self) -> Vec<f64> {
        let light: f64 = self.blocks.iter().map(|block| block.light).sum();
        let poor = |candidate: usize| self.blocks.iter().map(|block| block.sums[candidate].poorly_sampled).sum::<f64>();
        (0..self.candidates.len()).map(|candidate| poor(candidate) / light.max(f64::MIN_POSITIVE)).collect()
    }

    /// Mean relative variance of an iteration of each candidate over the picture, without the worst blocks.
    pub fn relative(&self) -> Vec<f64> {
        let means: Vec<f64> =
            self.blocks.iter().map(|block| block.light / (block.pixels * self.iterations).max(1.0)).collect();
        let floor = floor::relative_to_mean(means.iter().copied());
        let weight = |index: usize| {
            let mut near: Vec<f64> = window(self.size, index, 1).map(|near| means[near]).collect();
            let value = median(&mut near, f64::total_cmp).unwrap_or(0.0);
            1.0 / (value * value + floor)
        };
        let weights: Vec<f64> = (0..self.blocks.len()).map(weight).collect();
        let relative = |candidate: usize| {
            let of_block = |(block, weight): (&Block, &f64)| {
                let variance = self.indirect_variance(block, candidate).max(0.0) + block.direct_variance;
                weight * variance / block.pixels.max(1.0)
            };
            let mut all: Vec<f64> = self.blocks.iter().zip(&weights).map(of_block).collect();
            all.sort_unstable_by(f64::total_cmp);
            all.truncate(all.len() - (all.len() as f64 * TRIMMED_SHARE).ceil() as usize);
            all.iter().sum::<f64>() / all.len().max(1) as f64
        };
        (0..self.candidates.len()).map(relative).collect()
    }
}
