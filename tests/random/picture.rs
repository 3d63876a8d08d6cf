//! Pictures of several seeds, and the test whether two sets of them differ.

use super::usd;
use super::world::World;
use super::write::glb;
use crate::support::stats::mean_and_error;
use caustique::camera::Camera;
use caustique::material::{Material, MediumGrids};
use caustique::math::Vec3;
use caustique::medium::{DensityGrid, EmissionGrid, Grid};
use caustique::path_class::{Effect, Switches};
use caustique::plan::switch::Removed;
use caustique::plan::{EffectPlan, Plan, PlanRequest};
use caustique::render::{
    Control, Levels, Method, Motion, RenderInput, Rendered, Session, Settings, render, run_session,
};
use caustique::scene::gltf::{self, FileMoments, FrameTime, MovingFile, ReadOptions};
use caustique::scene::{CameraRequest, Crop, Description, MomentBuilder, Scene, light_preset};
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::path::Path;
use std::sync::Arc;

/// Side of a picture (pixels).
pub const SIZE: u32 = 24;
/// Number of tiles per side.
pub const TILES: u32 = 4;
/// Number of means of a picture: each channel of each tile, then each channel of the whole.
pub const MEANS: usize = (3 * TILES * TILES + 3) as usize;
/// Number of pictures of a set.
pub const SEEDS: u64 = 8;
/// Number of seeds of the set that confirms a difference, relative to the first set.
pub const CONFIRMING: u64 = 4;
/// Largest number of iterations of sparse pictures, relative to that of others.
const MAX_EFFORT: f64 = 16.0;
/// Probability that one comparison of means of two equal sets exceeds the critical value.
pub const SIGNIFICANCE: f64 = 1e-6;
/// Relative difference of means above which a significant difference is a fault.
pub const TOLERANCE: f64 = 0.03;
/// Share of a hemisphere's projected solid angle below which random paths hit a light too rarely.
const SMALL_LIGHT: f64 = 0.01;
/// Tiles darker than this share of the picture's mean are compared relative to that share.
const DARK: f64 = 0.02;

/// Settings of pictures.
#[derive(Clone, Debug)]
pub struct Shot {
    pub method: Method,
    /// Name of the camera.
    pub camera: String,
    /// A crop window in tiles: left, top, width, height.
    pub window: Option<[u32; 4]>,
    /// Factor on the iterations.
    pub effort: f64,
    /// Factor on the photons per iteration, for methods with photons.
    pub photons: u32,
    /// Number of segments of the longest paths.
    pub max_depth: u32,
    /// Whether the scene is read as a USD stage.
    pub usd: bool,
}

impl Shot {
    pub fn new(method: Method, camera: &str) -> Shot {
        Shot { method, camera: camera.into(), window: None, effort: 1.0, photons: 1, max_depth: u32::MAX, usd: false }
    }

    pub fn settings(&self, seed: u64) -> Settings {
        let iterations = match self.method {
            Method::Path => 24,
            Method::Bdpt | Method::Light => 12,
            Method::Vcm | Method::Bpm => 8,
            Method::Mlt => 24,
            Method::Pm => 4,
            _ => 8,
        };
        let photons = if self.method == Method::Pm { 40_000 } else { 4000 };
        Settings {
            method: self.method,
            seed,
            photons: photons * self.photons,
            levels: Levels::new(1),
            iterations: Some((f64::from(iterations) * self.effort).ceil() as u64),
            alpha: self.method.default_alpha(),
            max_depth: self.max_depth,
            ..Settings::default()
        }
    }

    pub fn view(&self, world: &World) -> CameraRequest {
        let tile = SIZE / TILES;
        CameraRequest {
            camera: Some(if self.usd { usd::camera(&self.camera) } else { self.camera.clone() }),
            width: Some(SIZE),
            height: Some(SIZE),
            crop: self.window.map(|window| Crop::Pixels(window.map(|side| side * tile))),
            filter: world.filter,
            ..CameraRequest::default()
        }
    }
}

/// Reads a scene like a file.
///
/// # Errors
/// The reader refuses the file.
pub fn read(world: &World) -> Result<Scene, String> {
    let description = gltf::read_bytes(&glb(world), Path::new("random.glb"), &ReadOptions::default());
    let mut description = description.map_err(|error| error.to_string())?;
    add_fires(world, &mut description);
    build(description)
}

/// Gives media their grids, which a file of its own would hold.
fn add_fires(world: &World, description: &mut Description) {
    let grid = || Grid::new([2; 3], 1, [Vec3::splat(-0.5), Vec3::splat(0.5)], vec![1.0; 8]);
    for thing in &world.things {
        let Some(fire) = world.matter(thing).and_then(|matter| matter.fire) else { continue };
        let Some(placed) = description.instances.iter_mut().find(|placed| placed.name == thing.name) else { continue };
        let density = DensityGrid::new(grid().expect("it is valid")).expect("it has one channel");
        let emission = EmissionGrid::new(grid().expect("it is valid"), fire.as_vec3());
        let material = description.materials[placed.material as usize].clone();
        let grids = Some(Arc::new(MediumGrids { density, emission }));
        placed.material = description.materials.len() as u32;
        description.materials.push(Material { grids, ..material });
    }
}

fn build(description: Description) -> Result<Scene, String> {
    Scene::build(description, 1).map_err(|error| error.to_string())
}

/// Means of one picture per seed. Tiles outside of a crop window are NaN.
pub type Set = Vec<Vec<f64>>;

/// Renders one picture per seed.
///
/// # Errors
/// The renderer refuses the scene, or rejects samples.
pub fn renders(world: &World, shot: &Shot, seeds: std::ops::Range<u64>) -> Result<Vec<Rendered>, String> {
    if world.later.is_some() {
        return later(world, shot, seeds);
    }
    let scene = if shot.usd { build(usd::read(world)?)? } else { read(world)? };
    let camera = scene.camera(&shot.view(world)).map_err(|error| error.to_string())?;
    seeds.map(|seed| accepted(render(&scene, &camera, &shot.settings(seed), |_, _| Control::Continue))).collect()
}

/// The render, or an error if samples are rejected.
fn accepted(rendered: Rendered) -> Result<Rendered, String> {
    match rendered.rejected() {
        0 => Ok(rendered),
        rejected => Err(format!("{rejected} samples are not finite")),
    }
}

/// The moments of a scene while its shutter is open.
struct Moving<'a> {
    moments: FileMoments<'a>,
    builder: MomentBuilder<'a>,
    shutter: [f64; 2],
    view: CameraRequest,
}

impl Motion for Moving<'_> {
    fn at(&self, time: f64) -> caustique::error::Result<(Scene, Camera)> {
        let [open, close] = self.shutter;
        let scene = self.builder.build(self.moments.describe(open + (close - open) * time, self.builder.meshes())?)?;
        let camera = scene.camera(&self.view)?;
        Ok((scene, camera))
    }
}

/// Renders a scene that appears after the frame, as the command line does: with the studio if it seems to have no light.
fn later(world: &World, shot: &Shot, seeds: std::ops::Range<u64>) -> Result<Vec<Rendered>, String> {
    let text = |error: caustique::error::Error| error.to_string();
    let frame = Some(FrameTime { number: 0, rate: Some(1.0), of_sequence: false });
    let options = ReadOptions { frame, shutter: world.later.map(|later| later.shutter), ..ReadOptions::default() };
    let read = MovingFile::from_bytes(glb(world).into(), Path::new("random.glb"), &options);
    let (mut description, file) = read.map_err(text)?;
    light_preset::apply(&mut description, None);
    let scene = build(description)?;
    let camera = scene.camera(&shot.view(world)).map_err(text)?;
    let moving = match (&file, scene.shutter) {
        (Some(file), Some(shutter)) => {
            let (moments, builder) = (file.moments().map_err(text)?, MomentBuilder::new(&scene));
            Some(Moving { moments, builder, shutter, view: shot.view(world) })
        }
        _ => None,
    };
    seeds
        .map(|seed| {
            let settings = shot.settings(seed);
            let motion = moving.as_ref().map(|moving| moving as &dyn Motion);
            let input = RenderInput::new(&scene, &camera, &settings).with_motion(motion);
            let mut session = Session::new(&input);
            let stop = run_session(&mut session, |_, _| Control::Continue);
            accepted(session.finish(stop))
        })
        .collect()
}

/// A set of pictures.
///
/// # Errors
/// See [`renders`].
pub fn pictures(world: &World, shot: &Shot, seeds: std::ops::Range<u64>) -> Result<Set, String> {
    Ok(renders(world, shot, seeds)?.iter().map(|rendered| means(rendered, shot.window)).collect())
}

/// Means of a whole picture or of a crop window in tiles.
fn means(rendered: &Rendered, window: Option<[u32; 4]>) -> Vec<f64> {
    let own = rendered.settings.levels.picture_level();
    let [left, top, width, _] = window.unwrap_or([0, 0, TILES, TILES]);
    let tile = SIZE / TILES;
    let mut means = vec![f64::NAN; MEANS];
    for (index, pixel) in (0..).zip(&rendered.pixels) {
        let (x, y) = (left + index % (width * tile) / tile, top + index / (width * tile) / tile);
        let mean = pixel.mean(own);
        for channel in 0..3 {
            let of_tile = &mut means[(3 * (y * TILES + x)) as usize + channel];
            *of_tile = if of_tile.is_nan() { 0.0 } else { *of_tile } + mean[channel] / f64::from(tile * tile);
        }
    }
    for channel in 0..3 {
        let tiles = (0..TILES * TILES).map(|at| means[3 * at as usize + channel]);
        means[MEANS - 3 + channel] = tiles.sum::<f64>() / f64::from(TILES * TILES);
    }
    means
}

/// Whether the method finds all light of the scene, often enough for a t test. Methods without photons find caustics
/// seen through glass with a probability proportional to the solid angle of the light, and so does `vcm` in media, where
/// it merges nothing. For a small light a set may have no such sample, and then its estimated standard error is too small
/// as well.
pub fn finds_all(world: &World, scene: &Scene, shot: &Shot) -> bool {
    let removed = Removed::default();
    let asked = PlanRequest {
        method: shot.method.name(),
        because: "",
        search: shot.method.search(),
        max_depth: None,
        switches: Switches::default(),
        removed: &removed,
    };
    let without_photons =
        matches!(shot.method, Method::Path | Method::Bdpt) || (shot.method == Method::Vcm && scene.survey.scattering);
    let by_chance = without_photons && world.smallest_light() < SMALL_LIGHT;
    let found = |e: &EffectPlan| !e.present || (e.simulated && !(by_chance && e.effect == Effect::Sds));
    scene.camera(&shot.view(world)).is_ok_and(|camera| Plan::new(scene, &camera, &asked).effects.iter().all(found))
}

/// A mean in which two sets differ.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Difference {
    /// `tile 5, red`.
    pub place: String,
    pub index: usize,
    pub means: [f64; 2],
    pub errors: [f64; 2],
    /// Probability that equal sets have a difference of this size.
    pub probability: f64,
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let Difference { place, means: [a, b], errors: [ea, eb], probability, .. } = self;
        write!(f, "{place}: {a:.5} +- {ea:.5} and {b:.5} +- {eb:.5} (ratio {:.3}, p {probability:.1e})", b / a)
    }
}

/// Differences between sets of pictures.
pub struct Found {
    pub differences: Vec<Difference>,
    /// Whether some picture is black where the sets differ: too few light paths reach that place for a t test. If one
    /// does with probability q, n black pictures have the probability (1 - q)^n, and an estimated error of 0.
    pub sparse: bool,
}

impl Found {
    pub fn new(differences: Vec<Difference>, sets: &[&Set]) -> Found {
        let black = |means: &Vec<f64>| differences.iter().any(|difference| means[difference.index] == 0.0);
        let sparse = sets.iter().any(|set| set.iter().any(black));
        Found { differences, sparse }
    }
}

/// The differences that `found(effort, seeds)` finds in a set and again in a set of four times as many other seeds.
/// Sparse pictures are rendered with more iterations before they count.
///
/// # Errors
/// The errors of `found`.
pub fn confirmed(
    found: impl Fn(f64, std::ops::Range<u64>) -> Result<Found, String>,
) -> Result<Option<Vec<Difference>>, String> {
    let mut effort = 1.0;
    loop {
        let first = found(effort, 0..SEEDS)?;
        if first.differences.is_empty() {
            return Ok(None);
        }
        if !first.sparse || effort >= MAX_EFFORT {
            let mut again = found(effort, SEEDS..SEEDS * (1 + CONFIRMING))?;
            again
                .differences
                .retain(|difference| first.differences.iter().any(|other| other.index == difference.index));
            if again.differences.is_empty() {
                return Ok(None);
            }
            if !again.sparse || effort >= MAX_EFFORT {
                return Ok(Some(again.differences));
            }
        }
        effort *= 4.0;
    }
}

/// The means in which two sets differ by more than noise and a relative tolerance allow, by Welch's t test for each
/// mean.
pub fn differences(a: &Set, b: &Set, tolerance: f64, significance: f64) -> Vec<Difference> {
    let column = |set: &Set, index: usize| -> Vec<f64> { set.iter().map(|means| means[index]).collect() };
    (0..MEANS)
        .filter_map(|index| {
            let (of_a, of_b) = (mean_and_error(&column(a, index)), mean_and_error(&column(b, index)));
            let whole = mean_and_error(&column(b, MEANS - 3 + index % 3)).0;
            let scale = of_a.0.abs().max(of_b.0.abs()).max(DARK * whole);
            let apart = (of_a.0 - of_b.0).abs();
            // NaN means are outside of a crop window.
            if apart.is_nan() || apart <= tolerance * scale {
                return None;
            }
            let t_test = welch(apart, [of_a.1, of_b.1], [a.len(), b.len()]);
            let black = [(a, of_a, of_b.0), (b, of_b, of_a.0)].map(|(set, own, other)| {
                let whole = mean_and_error(&column(set, MEANS - 3 + index % 3));
                if own == (0.0, 0.0) { black_by_chance(other, whole) } else { 0.0 }
            });
            let probability = t_test.max(black[0]).max(black[1]);
            (probability < significance).then(|| Difference {
                place: place(index),
                index,
                means: [of_a.0, of_b.0],
                errors: [of_a.1, of_b.1],
                probability,
            })
        })
        .collect()
}

/// Probability that no light path reaches a tile of this mean, in pictures of which the whole has the mean and error
/// `whole`: the error tells how many light paths reach the whole picture, and the tile has its share of them.
fn black_by_chance(tile: f64, (mean, error): (f64, f64)) -> f64 {
    let paths = (mean / error).powi(2) * tile / (mean * f64::from(TILES * TILES));
    if paths.is_nan() { 0.0 } else { (-paths).exp() }
}

fn place(index: usize) -> String {
    let channel = ["red", "green", "blue"][index % 3];
    if index >= MEANS - 3 { format!("whole picture, {channel}") } else { format!("tile {}, {channel}", index / 3) }
}

/// Two-sided p-value of a difference of two means with these standard errors and numbers of values (Welch,
/// Satterthwaite).
pub fn welch(apart: f64, errors: [f64; 2], counts: [usize; 2]) -> f64 {
    let squares = errors.map(|error| error * error);
    let variance = squares[0] + squares[1];
    if variance == 0.0 {
        return if apart > 0.0 { 0.0 } else { 1.0 };
    }
    let spread: f64 = squares.iter().zip(counts).map(|(square, n)| square * square / (n as f64 - 1.0)).sum();
    let freedom = (variance * variance / spread).max(1.0);
    let t = StudentsT::new(0.0, 1.0, freedom).expect("a positive number of degrees of freedom");
    2.0 * t.sf(apart / variance.sqrt())
}
