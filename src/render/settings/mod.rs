//! Settings of a render: the method and its parameters, stop conditions, and the shard.

mod candidate;
mod check;
mod counts;
mod levels;
mod method;
mod request;
mod shard;
mod values;

pub use candidate::Candidate;
pub use counts::{Counts, LIGHT_PATH_STEPS, MAX_CONNECTIONS, MAX_LIGHT_PATHS_PER_PIXEL};
pub use levels::Levels;
pub use method::{BandwidthRule, DEFAULT_KNN, DEFAULT_MAP_KNN, DEFAULT_MAP_PHOTONS, DEFAULT_PHOTONS, Method};
pub use request::SettingsRequest;
pub use shard::{MAX_SHARDS, Shard};
pub use values::{BandwidthChoice, GridChoice, MethodChoice, OnOff};

use crate::camera::Camera;
use crate::estimator::rule::chi_squared::ChiSquaredSettings;
use crate::estimator::rule::{memoryless, volume};
use crate::estimator::{PixelAccumulator, Schedule};
use crate::path_class::{ClassSet, classes_in};
use crate::photon::{ByKind, Kernel};
use crate::plan::{Owner, Search};
use crate::render::{InitialBandwidth, SCREEN_CAP};
use crate::scene::{Scene, Survey};
use crate::stop::Stop;
use crate::transport::{CameraPaths, Indirect, InitialMedia, MAX_LEVELS, MAX_SPLITS};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Number of iterations of a render without a stop condition.
pub const DEFAULT_ITERATIONS: u64 = 64;
/// Largest default number of light paths per iteration, so that the photon maps of huge pictures fit into memory.
const MAX_DEFAULT_PHOTONS: u32 = 10_000_000;
/// Pixels that are made between two polls of the user's request to stop.
const PIXELS_PER_STEP: usize = 1 << 15;
/// Default of [`Settings::photon_memory`] (bytes).
pub const DEFAULT_MAP_MEMORY: u64 = 1 << 30;

/// Rule that bandwidths of [`Method::Sppm`] follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum RadiusRule {
    /// By the number of the iteration alone
    ///
    /// See [`memoryless`].
    #[default]
    Memoryless,
    /// By the number of photons found
    ///
    /// See [`local`](crate::estimator::rule::local).
    Local,
}

impl From<RadiusRule> for BandwidthRule {
    fn from(rule: RadiusRule) -> Self {
        match rule {
            RadiusRule::Memoryless => BandwidthRule::Memoryless,
            RadiusRule::Local => BandwidthRule::Local,
        }
    }
}

/// Settings of a render.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Settings {
    /// Algorithm that finds the light.
    pub method: Method,
    /// Seed of all random numbers of the render.
    pub seed: u64,
    /// Number of light paths per iteration; for [`Method::Pm`], of the whole render.
    pub photons: u32,
    /// Numbers of samples of the techniques of [`Method::Bdpt`] and [`Method::Vcm`].
    pub counts: Counts,
    /// Most bytes that the photon map of [`Method::Pm`] may take while it is built.
    pub photon_memory: u64,
    /// Light that photons of [`Method::Sppm`] carry: all indirect light, or caustics alone.
    pub indirect: Indirect,
    /// Classes of light paths (such as caustics) that the render finds.
    pub classes: ClassSet,
    /// Whether light paths start preferably towards objects that focus light, as far as a pilot (a short render before
    /// the first iteration) finds that this reduces the noise. See [`Method::supports_guiding`].
    pub guided: bool,
    /// Bandwidth levels: pictures with different kernel bandwidths that one render makes.
    pub levels: Levels,
    /// Also record the light by the lobe of the first hit, for the layers that this fills.
    #[serde(default)]
    pub lobes: bool,
    /// Also make a picture per sampling technique ([`Method::has_techniques`]).
    pub techniques: bool,
    /// Rule for the largest initial bandwidth. [`Method::Pm`] takes from it the number of neighbours whose distance is the
    /// bandwidth.
    pub initial_bandwidth: InitialBandwidth,
    /// Upper bound of initial bandwidths on surfaces and in media, relative to the width of the picture.
    pub max_initial_bandwidth: [f32; 2],
    /// Reduction rate of bandwidths under the memoryless rule and the rule of local statistics, in (0, 1].
    pub alpha: f64,
    /// Reduction rate of bandwidths in media, in (0, 1].
    pub volume_alpha: f64,
    /// Bandwidth rule of [`Method::Sppm`].
    pub radius_rule: RadiusRule,
    /// Kernel of [`Method::Sppm`] with the memoryless rule, and of [`Method::Appm`]. Other methods use the box kernel.
    pub kernel: Kernel,
    /// Parameters of the bandwidth rule of [`Method::Cppm`].
    pub chi_squared: ChiSquaredSettings,
    /// Most segments of a path, from the camera to the light.
    pub max_depth: u32,
    /// Stop after this many iterations of the whole render, all shards together; `None`: no limit.
    pub iterations: Option<u64>,
    /// Stop after this many wall-clock seconds; `None`: no limit.
    pub time: Option<f64>,
    /// Number of threads that the user asks for; 0: as many as there are cores. They decide how much work `auto` expects
    /// within [`Settings::time`].
    #[serde(skip)]
    pub threads: usize,
    /// Stop when the estimated relative error is at most this; `None`: no target.
    pub target_error: Option<f64>,
    /// Part of the render's iterations that this process renders.
    pub shard: Shard,
    /// Flag by which the user ends the current iteration early.
    #[serde(skip)]
    pub stop: Stop,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            method: Method::default(),
            seed: 0,
            photons: DEFAULT_PHOTONS,
            counts: Counts::default(),
            photon_memory: DEFAULT_MAP_MEMORY,
            indirect: Indirect::Photons,
            classes: ClassSet::ALL,
            guided: false,
            levels: Levels::new(5),
            lobes: false,
            techniques: false,
            initial_bandwidth: InitialBandwidth::Nearest(DEFAULT_KNN.0),
            max_initial_bandwidth: [SCREEN_CAP; 2],
            alpha: memoryless::ALPHA,
            volume_alpha: volume::ALPHA,
            radius_rule: RadiusRule::Memoryless,
            kernel: Kernel::Box,
            chi_squared: ChiSquaredSettings::default(),
            max_depth: u32::MAX,
            iterations: Some(DEFAULT_ITERATIONS),
            time: None,
            threads: 0,
            target_error: None,
            shard: Shard { index: 0, count: 1 },
            stop: Stop::default(),
        }
    }
}

impl Settings {
    /// Default settings of a candidate, one of the methods that `auto` compares.
    pub fn for_candidate(candidate: Candidate) -> Settings {
        let method = candidate.method;
        let levels = Levels::new(if method.has_levels() { MAX_LEVELS } else { 1 });
        Settings {
            method,
            indirect: candidate.indirect,
            guided: candidate.guided,
            counts: candidate.counts,
            levels,
            photons: method.default_photons(),
            initial_bandwidth: if method.takes_photon_count() {
                InitialBandwidth::Nearest(method.default_neighbours(levels.count))
            } else {
                InitialBandwidth::Footprint
            },
            alpha: method.default_alpha(),
            ..Settings::default()
        }
        .without_unused_techniques()
    }

    /// The settings with the method that remains if some techniques have no samples.
    #[must_use]
    pub fn without_unused_techniques(self) -> Settings {
        let method = self.method.with_counts(&self.counts);
        let levels = if method.has_levels() { self.levels } else { Levels::new(1) };
        Settings { method, levels, guided: self.guided && method.supports_guiding(), ..self }
    }

    /// Default number of light paths per iteration for a whole picture of this size: one per pixel, as for camera
    /// paths, and in small pictures the number of the papers. If photons carry caustics alone, most of the error comes from
    /// camera paths, and guided light paths cost several times as much as unguided ones, because most of them hit glass.
    /// So their default is one per pixel in small pictures, too.
    pub fn default_photons(&self, (width, height): (u32, u32)) -> u32 {
        let pixels = width.saturating_mul(height).min(MAX_DEFAULT_PHOTONS);
        if self.method.has_one_map() {
            self.method.default_photons()
        } else if self.guided && self.indirect == Indirect::Paths {
            pixels
        } else {
            pixels.max(self.method.default_photons())
        }
    }

    /// The settings with a number of light paths per iteration: `photons`, or if it is `None` the default for a whole
    /// picture of this width and height.
    #[must_use]
    pub fn with_light_paths(self, photons: Option<u32>, size: (u32, u32)) -> Settings {
        Settings { photons: photons.unwrap_or(self.default_photons(size)), ..self }
    }

    /// Makes the tracer of camera paths for a render with these settings.
    pub(in crate::render) fn camera_paths<'a>(
        &'a self,
        scene: &'a Scene,
        camera: &'a Camera,
        initial_media: &InitialMedia,
    ) -> CameraPaths<'a> {
        let Settings { max_depth, indirect, classes, lobes, .. } = *self;
        // Pictures per technique are sums over paths, so an iteration cannot be taken back from them.
        let stop = (!self.techniques).then_some(&self.stop);
        // A Markov chain mutates a path of one branch.
        let splits = if self.method.has_chains() || !scene.survey.narrow_lobes { 0 } else { MAX_SPLITS };
        let interior = initial_media.camera;
        CameraPaths { scene, camera, interior, max_depth, splits, indirect, classes, lobes, stop }
    }

    /// Returns a function that makes a pixel before the first iteration, from its largest initial bandwidths by kind of
    /// photons.
    pub(in crate::render) fn pixel_factory(&self, scene: &Scene) -> impl Fn(&ByKind<f32>) -> PixelAccumulator + use<> {
        let (levels, exponent) = (self.levels.count, scene.lights.irradiance_exponent());
        let (groups, lobes, merges) = (self.light_groups(scene), self.lobes, self.merges_one_level());
        move |bandwidths| {
            let pixel = PixelAccumulator::new(levels, exponent, *bandwidths).with_merges(merges);
            pixel.with_groups(groups).with_lobes(lobes)
        }
    }

    /// All pixels before the first iteration, from their largest initial bandwidths by kind of photons; none if the user
    /// has stopped the render.
    pub(in crate::render) fn pixels(&self, scene: &Scene, bandwidths: &[ByKind<f32>]) -> Vec<PixelAccumulator> {
        let pixel = self.pixel_factory(scene);
        let mut pixels = Vec::with_capacity(bandwidths.len());
        // Most of the time goes to the system, which provides the memory when it is first written.
        for part in bandwidths.chunks(PIXELS_PER_STEP) {
            if self.stop.requested() {
                return Vec::new();
            }
            pixels.par_extend(part.par_iter().map(&pixel));
        }
        pixels
    }

    /// Number of light groups with layers of their own, and one more for the light on shadow catchers if there are any.
    /// Photons do not store the group of their light, so methods that gather them have none.
    pub(in crate::render) fn light_groups(&self, scene: &Scene) -> usize {
        let groups = scene.lights.groups().names.len() + usize::from(scene.survey.catchers);
        if self.method.has_techniques() { groups } else { 0 }
    }

    /// Number (from 1) of the last iteration after this shard has done `done` iterations.
    pub fn last_iteration(&self, done: u64) -> u64 {
        self.shard.index + done.saturating_sub(1) * self.shard.count + 1
    }

    /// Factors by which the memoryless rules have shrunk the bandwidths at iteration `i` (from 1).
    pub fn schedule(&self, i: u64) -> Schedule {
        Schedule::new(i, self.levels.count, self.alpha, self.volume_alpha)
    }

    /// Whether the render is divided among several shards.
    pub fn is_shard(&self) -> bool {
        self.shard.count > 1
    }

    /// Number of iterations of this shard; `None` if their number does not stop the render.
    pub fn iterations_of_shard(&self) -> Option<u64> {
        self.iterations.map(|n| n.saturating_sub(self.shard.index).div_ceil(self.shard.count))
    }

    /// Techniques by which the render finds the light.
    pub fn search(&self) -> Search {
        let with_paths = self.method.search_with_paths().filter(|_| self.indirect == Indirect::Paths);
        with_paths.unwrap_or(self.method.search())
    }

    /// Classes of light paths that photons carry to gathering camera paths.
    pub fn photon_classes(&self, survey: &Survey) -> ClassSet {
        self.search().owned_by(Owner::Photons) & self.classes & classes_in(survey)
    }

    /// For each kind of photons, whether it has bandwidths. Methods that merge light paths have one bandwidth for all
    /// photons, stored as the first kind.
    pub fn bandwidth_kinds(&self, survey: &Survey) -> ByKind<bool> {
        if self.method.gathers() {
            self.indirect.kinds(self.photon_classes(survey))
        } else {
            [self.method.has_bandwidths(), false]
        }
    }

    /// Rule by which bandwidths shrink; `None` if they do not.
    pub fn bandwidth_rule(&self) -> Option<BandwidthRule> {
        self.method.rule(self.radius_rule.into())
    }

    /// Whether red, green and blue have separate bandwidths.
    pub fn has_channels(&self) -> bool {
        self.bandwidth_rule() == Some(BandwidthRule::ChiSquared) && self.chi_squared.plus
    }

    /// Whether bandwidths depend on the number of the iteration alone, so that iterations may run in any order and on any
    /// machine.
    pub fn is_memoryless(&self) -> bool {
        self.bandwidth_rule().is_none_or(|rule| rule == BandwidthRule::Memoryless)
    }

    /// Whether photons are merged with one bandwidth, so that bias is estimated from the photons of its inner part.
    pub fn merges_one_level(&self) -> bool {
        let search = self.method.with_counts(&self.counts).search();
        self.levels.count == 1 && matches!(search, Search::Merging | Search::ConnectionsAndMerging)
    }

    /// Number of bandwidth levels that keep a fixed ratio of bandwidths, so that bias is estimated from them. Under
    /// rules that shrink each level on its own, it ends with the picture's level, so that there is no larger level to
    /// compare with.
    pub fn compared_levels(&self) -> usize {
        if self.is_memoryless() || self.bandwidth_rule() == Some(BandwidthRule::Adaptive) {
            self.levels.count
        } else {
            self.levels.picture_level() + 1
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_pictures_have_one_light_path_per_pixel() {
        let sppm = Settings::for_candidate(Candidate::GATHERING);
        let caustics = Settings { guided: true, indirect: Indirect::Paths, ..sppm.clone() };
        let pm = Settings { method: Method::Pm, ..sppm.clone() };
        for (settings, size, photons) in [
            (&sppm, (320, 180), 100_000),
            (&sppm, (1920, 1080), 1920 * 1080),
            (&sppm, (1 << 15, 1 << 15), MAX_DEFAULT_PHOTONS),
            (&caustics, (48, 36), 48 * 36),
            (&caustics, (1920, 1080), 1920 * 1080),
            (&pm, (1920, 1080), DEFAULT_MAP_PHOTONS),
        ] {
            assert_eq!(settings.default_photons(size), photons, "{:?} {size:?}", settings.method);
        }
    }
}
