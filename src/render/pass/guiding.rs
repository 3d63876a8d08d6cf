//! Learning the guide of light paths, in rounds of a few light and camera paths before the first iteration.
//!
//! A round samples light paths with the guide of the previous rounds and gathers their photons along camera paths. For
//! each cell of the guide it sums the squared relative error that the photons cause in the picture: the square of a
//! photon's fraction of the pixel, because the photon may or may not be there. The value of the pixel is estimated in
//! the same round.
//!
//! The weights of the same photons give the error of unguided light paths. If the learnt guide does not reduce the
//! error, it is dropped.

use super::cost::{Cost, GUIDED_START};
use super::light_path_ranges::light_path_ranges;
use crate::camera::Camera;
use crate::light::{Guide, Region};
use crate::math::{Rgb, Vec3, luminance};
use crate::path_class::ClassSet;
use crate::photon::{ByKind, Located, Nearest, Photon, PhotonMap, kind};
use crate::random::{Domain, Purpose, Stream};
use crate::render::initial_bandwidth::{SCREEN_CAP, picture_width_at};
use crate::render::input::RenderInput;
use crate::render::settings::{Candidate, Settings};
use crate::transport::{CameraPathStart, CameraPaths, Indirect, InitialMedia, LightPaths, Photons, Probe, light_path};
use bumpalo::Bump;
use rayon::prelude::*;
use std::borrow::Cow;
use std::f32::consts::PI;

pub(super) const ROUNDS: u64 = 5;
/// Number of light paths of a round of learning over that of an iteration, and bounds of the number.
const LIGHT_PATHS_RATIO: f64 = 0.25;
const MIN_LIGHT_PATHS: u32 = 1 << 12;
const MAX_LIGHT_PATHS: u32 = 1 << 15;
/// Largest number of camera paths of a round of learning, and the number of pixels per camera path in small pictures.
const MAX_CAMERA_PATHS: u32 = 1 << 13;
const PIXELS_PER_CAMERA_PATH: u64 = 4;
/// Camera paths per parallel task.
const CHUNK: u32 = 256;
/// Number of photons of each kind (caustic, indirect) that a pixel gathers.
const NEIGHBOURS: usize = 16;
/// Added to a pixel's squared value by which squared errors are divided, as in the papers' relMSE. It makes this error
/// depend on the unit of radiance; that only affects how well light paths are guided, not the reported error.
const DARK_OFFSET: f32 = 0.01;

/// Largest squared error times cost of an iteration, relative to the unguided one, at which a guide is used.
const MAX_ERROR_COST_RATIO: f64 = 0.9;

/// A photon, and the cell of the guide (a part of the distribution of starts) that sampled its light path.
#[derive(Clone, Copy)]
struct GuidedPhoton {
    photon: Photon,
    cell: u32,
}

impl Located for GuidedPhoton {
    fn position(&self) -> Vec3 {
        self.photon.p
    }

    fn normal(&self) -> Vec3 {
        self.photon.ng
    }

    fn is_finite(&self) -> bool {
        self.photon.is_finite()
    }
}

/// Learns where light paths should start for a scene and camera; `None` if there is nothing to choose, or no gain.
pub(super) fn learn_guide(
    camera_paths: &CameraPaths<'_>,
    initial_media: &InitialMedia,
    settings: &Settings,
    region: Option<Region>,
) -> Option<Guide> {
    let seed = settings.seed;
    let light_paths = ((light_paths_of_iteration(camera_paths.camera, settings) * LIGHT_PATHS_RATIO) as u32)
        .clamp(MIN_LIGHT_PATHS, MAX_LIGHT_PATHS);
    let mut guide = Guide::new(&camera_paths.scene.lights, camera_paths.indirect == Indirect::Photons)?;
    for round in 0..ROUNDS {
        let (maps, walked) =
            trace_photons(camera_paths, initial_media, &Round { seed, index: round, light_paths, region }, &guide);
        let error = estimate_error(camera_paths, seed, round, &maps, guide.cells());
        if camera_paths.is_stopped() {
            // Some paths are missing. The first iteration is aborted, too.
            return None;
        }
        let paths: Vec<f64> = walked.iter().map(|of| of.paths).collect();
        let work: Vec<f64> = walked.iter().map(|of| of.work).collect();
        if round + 1 == ROUNDS
            && error.ratio() * guiding_cost_ratio(camera_paths, settings, &guide) > MAX_ERROR_COST_RATIO
        {
            return None;
        }
        guide.learn(&error.of_cells, &paths, &work);
    }
    Some(guide)
}

fn light_paths_of_iteration(camera: &Camera, settings: &Settings) -> f64 {
    if settings.method.takes_photon_count() {
        return f64::from(settings.photons);
    }
    let (width, height) = camera.size();
    f64::from(width) * f64::from(height) * settings.counts.light_paths_per_pixel()
}

/// The guide for the lights that an iteration sees: the learnt one, or one that is adapted to the moment of a moving
/// scene.
pub(super) fn guide_at<'g>(guide: Option<&'g Guide>, input: &RenderInput<'_>) -> Option<Cow<'g, Guide>> {
    if input.moves() { guide?.for_lights(&input.scene.lights).map(Cow::Owned) } else { guide.map(Cow::Borrowed) }
}

/// Cost of an iteration with the guide over that without, by counted vertices: guided light paths meet glass at once,
/// and are longer.
fn guiding_cost_ratio(camera_paths: &CameraPaths<'_>, settings: &Settings, guide: &Guide) -> f64 {
    let (width, height) = camera_paths.camera.size();
    let cost = |guide: Option<&Guide>| {
        let Settings { method, indirect, counts, .. } = *settings;
        let candidate = Candidate { method, indirect, guided: guide.is_some(), counts };
        Cost::count(camera_paths.scene, camera_paths.camera, settings, guide).iteration_seconds(
            candidate,
            settings,
            f64::from(width) * f64::from(height),
        )
    };
    cost(Some(guide)) / cost(None)
}

/// Light paths of a round that one cell of the guide has sampled.
#[derive(Clone, Copy, Default)]
struct CellPaths {
    paths: f64,
    /// Cost of these light paths, in units of the cost of a light path's vertex.
    work: f64,
}

/// Settings of the light paths in one round of learning.
struct Round {
    seed: u64,
    /// Number of the round of learning, from 0.
    index: u64,
    light_paths: u32,
    /// Sphere toward which lights at infinity send their light paths; `None`: the whole scene.
    region: Option<Region>,
}

/// Traces the photons of a round of learning. Returns their maps by kind, and the number and cost of light paths by
/// cell of the guide.
fn trace_photons(
    camera_paths: &CameraPaths<'_>,
    initial_media: &InitialMedia,
    round: &Round,
    guide: &Guide,
) -> (ByKind<PhotonMap<GuidedPhoton>>, Vec<CellPaths>) {
    let Round { seed, index, light_paths, region } = *round;
    let paths_of_round = LightPaths::new(seed, index, Domain::GuideLight, light_paths, camera_paths.max_depth)
        .guided(Some(guide))
        .lighting(region)
        .stopped_by(camera_paths.stop)
        .wanting(ClassSet::ALL, camera_paths.indirect);
    let trace = |paths: std::ops::Range<u32>| {
        let (mut photons, mut arena, mut guided) =
            (Photons::default(), Bump::new(), ByKind::<Vec<GuidedPhoton>>::default());
        let mut walked = vec![CellPaths::default(); guide.cells()];
        for index in paths.take_while(|_| !camera_paths.is_stopped()) {
            let path = light_path(camera_paths.scene, &arena, initial_media, &paths_of_round, index, &mut photons);
            let Some((cell, vertices)) = path else { continue };
            arena.reset();
            photons.volume.clear();
            for (guided, photons) in guided.iter_mut().zip(&mut photons.surface) {
                guided.extend(photons.drain(..).map(|photon| GuidedPhoton { photon, cell: cell as u32 }));
            }
            walked[cell].paths += 1.0;
            walked[cell].work += GUIDED_START + f64::from(vertices);
        }
        (guided, walked)
    };
    let parts: Vec<(ByKind<Vec<GuidedPhoton>>, Vec<CellPaths>)> = light_path_ranges(light_paths).map(trace).collect();
    let mut walked = vec![CellPaths::default(); guide.cells()];
    let mut all = ByKind::<Vec<GuidedPhoton>>::default();
    for (guided, part) in parts {
        kind::append(&mut all, guided);
        for (sum, part) in walked.iter_mut().zip(part) {
            sum.paths += part.paths;
            sum.work += part.work;
        }
    }
    (all.map(PhotonMap::build), walked)
}

/// Sums of squared relative errors over the camera paths of a round of learning, by cell of the guide.
struct CellErrors {
    of_cells: Vec<f64>,
    /// Error of an equal number of unguided light paths at the same bandwidths: a photon of weight w represents w
    /// unguided ones, each 1 / w times as bright.
    unguided: f64,
}

impl CellErrors {
    fn zero(cells: usize) -> CellErrors {
        CellErrors { of_cells: vec![0.0; cells], unguided: 0.0 }
    }

    fn add(&mut self, other: &CellErrors) {
        self.of_cells.iter_mut().zip(&other.of_cells).for_each(|(sum, more)| *sum += more);
        self.unguided += other.unguided;
    }

    /// Squared error with the guide over that without.
    fn ratio(&self) -> f64 {
        self.of_cells.iter().sum::<f64>() / self.unguided
    }
}

/// Estimates the error that the photons of a round of learning cause along its camera paths.
fn estimate_error(
    camera_paths: &CameraPaths<'_>,
    seed: u64,
    round: u64,
    maps: &ByKind<PhotonMap<GuidedPhoton>>,
    cells: usize,
) -> CellErrors {
    let (width, height) = camera_paths.camera.size();
    let pixels = u64::from(width) * u64::from(height);
    let paths = u64::from(MAX_CAMERA_PATHS).min(pixels.div_ceil(PIXELS_PER_CAMERA_PATH)) as u32;
    // Evenly spaced pixels, with a random offset in each round.
    let offset = Stream::new(seed, round, Domain::GuideCamera, u64::MAX).vertex(0).one(Purpose::Pixel);
    let look = |first: u32| {
        let mut error = CellErrors::zero(cells);
        let (mut arena, mut nearest) = (Bump::new(), ByKind::<Nearest<GuidedPhoton>>::default());
        for index in (first..paths.min(first + CHUNK)).take_while(|_| !camera_paths.is_stopped()) {
            arena.reset();
            let stream = Stream::new(seed, round, Domain::GuideCamera, u64::from(index));
            let pixel = ((f64::from(index) + f64::from(offset)) * pixels as f64 / f64::from(paths)) as u64;
            let pixel = pixel.min(pixels - 1);
            let at = ((pixel % u64::from(width)) as u32, (pixel / u64::from(width)) as u32);
            let start = CameraPathStart { ray: camera_paths.start(at, stream), stream };
            if let Some(probe) = camera_paths.probe(&arena, &start) {
                add_errors(camera_paths, maps, &mut nearest, &probe, &mut error);
            }
        }
        error
    };
    let parts: Vec<CellErrors> = (0..paths).into_par_iter().step_by(CHUNK as usize).map(look).collect();
    let mut sum = CellErrors::zero(cells);
    parts.iter().for_each(|part| sum.add(part));
    sum
}

/// Adds to `error` the errors of the photons around a probe, a point of a camera path.
fn add_errors(
    camera_paths: &CameraPaths<'_>,
    maps: &ByKind<PhotonMap<GuidedPhoton>>,
    nearest: &mut ByKind<Nearest<GuidedPhoton>>,
    probe: &Probe,
    error: &mut CellErrors,
) {
    let point = &probe.point;
    let cap = SCREEN_CAP * picture_width_at(camera_paths.camera, point.length);
    let mut light = Vec::with_capacity(2 * NEIGHBOURS);
    let mut sum = Rgb::ZERO;
    for (map, nearest) in maps.iter().zip(nearest) {
        let bandwidth2 = nearest.bandwidth2(map, point.p, point.ng, NEIGHBOURS, cap * cap).unwrap_or(cap * cap);
        let scale = probe.weight / (PI * bandwidth2);
        map.within(point.p, bandwidth2, |guided, _| {
            let photon = &guided.photon;
            if photon.ng.dot(point.ng) > 0.0 {
                let found = scale * photon.flux;
                sum += found;
                light.push((guided.cell, luminance(found), photon.thinning_key.weight()));
            }
        });
    }
    let value = luminance(sum + probe.direct);
    let inverse = 1.0 / (value * value + DARK_OFFSET);
    for (cell, light, weight) in light {
        let share = f64::from(light * light * inverse);
        let unguided = share / f64::from(weight);
        if unguided.is_finite() {
            error.of_cells[cell as usize] += share;
            error.unguided += unguided;
        }
    }
}
