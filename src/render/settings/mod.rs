//! What a render is asked to do.

mod candidate;
mod method;

pub use candidate::Candidate;
pub use method::{BandwidthRule, DEFAULT_KNN, DEFAULT_MAP_KNN, DEFAULT_MAP_PHOTONS, DEFAULT_PHOTONS, Method};

use crate::camera::Camera;
use crate::estimator::bandwidth::SCREEN_CAP;
use crate::estimator::rule::chi_squared::ChiSquaredSettings;
use crate::estimator::rule::{memoryless, volume};
use crate::estimator::{InitialBandwidth, PixelAccumulator, Schedule};
use crate::photon::ByKind;
#[cfg(doc)]
use crate::photon::kernel;
use crate::plan::{ClassSet, Owner, Search, classes_in};
use crate::scene::{Scene, Survey};
use crate::stop::Stop;
use crate::transport::{CameraPaths, Indirect, InitialMedia, MAX_LEVELS};
use serde::{Deserialize, Serialize};

/// Iterations when no stop condition is given.
pub const DEFAULT_ITERATIONS: u64 = 64;
/// Bytes that their photons may take.
pub const DEFAULT_MAP_MEMORY: u64 = 1 << 30;

/// Most shards that a render may have.
pub const MAX_SHARDS: u64 = 1_000_000;

/// Which iterations to render: those with `i mod count = index`, i from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    /// Index of this shard, below `count`.
    pub index: u64,
    /// Number of shards.
    pub count: u64,
}

impl Shard {
    /// Whether there can be such a shard.
    pub fn is_sound(self) -> bool {
        self.index < self.count && self.count <= MAX_SHARDS
    }
}

/// Bandwidth levels, each 1/sqrt(2) of the next larger.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Levels {
    /// Number of levels, 1 to [`MAX_LEVELS`].
    pub count: usize,
    /// Trace a second eye path that decorrelates level 1 from the others \[post-reconstruction 2021, 3\], which
    /// equation (6) wants; without it all levels share one path, which costs a little more than half as much.
    pub two_paths: bool,
}

impl Levels {
    /// `count` levels that share one eye path.
    pub fn new(count: usize) -> Levels {
        Levels { count: count.clamp(1, MAX_LEVELS), two_paths: false }
    }

    /// `count` levels; with more than one, level 1 has an eye path of its own.
    pub fn decorrelated(count: usize) -> Levels {
        Levels { two_paths: count > 1, ..Levels::new(count) }
    }

    /// The level (from 0) that is the method's own image: the second largest, whose bandwidth is the usual one (k = 10
    /// where the largest is set by k = 20).
    pub fn picture_level(&self) -> usize {
        self.count.saturating_sub(2)
    }
}

/// Kernel of density estimation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum KernelChoice {
    /// Alike within the bandwidth
    ///
    /// [`kernel::Box`].
    #[default]
    Box,
    /// Falling with the squared distance
    ///
    /// [`kernel::Epanechnikov`].
    Epanechnikov,
    /// A normal distribution cut off at three standard deviations
    ///
    /// [`kernel::Gaussian`].
    Gaussian,
}

/// What [`Method::Sppm`]'s bandwidths follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum RadiusRule {
    /// The iteration's number alone
    ///
    /// [`memoryless`].
    #[default]
    Memoryless,
    /// The photons found
    ///
    /// [`local`](crate::estimator::rule::local).
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
    /// How light is found.
    pub method: Method,
    /// Seed.
    pub seed: u64,
    /// Light paths per iteration; with [`Method::Pm`] of the whole render.
    pub photons: u32,
    /// Most bytes that the map of [`Method::Pm`] may take, while it is built.
    pub photon_memory: u64,
    /// What [`Method::Sppm`]'s photons bring: all indirect light, or caustics alone.
    pub indirect: Indirect,
    /// Classes of light paths to be found.
    pub classes: ClassSet,
    /// Light paths start toward what makes caustics, where a pilot has found them to matter. The methods that count
    /// photons have none of it.
    pub guided: bool,
    /// Bandwidth levels.
    pub levels: Levels,
    /// Also make a picture per sampling technique ([`Method::has_techniques`]).
    pub techniques: bool,
    /// What sets the largest initial bandwidth. [`Method::Pm`] takes from it the number of neighbours whose distance is
    /// its bandwidth.
    pub initial_bandwidth: InitialBandwidth,
    /// Largest initial bandwidth over the picture's width: on surfaces and in media.
    pub max_initial_bandwidth: [f32; 2],
    /// Reduction rate of the memoryless rule and that of local statistics, in (0, 1].
    pub alpha: f64,
    /// The same for photons in media.
    pub volume_alpha: f64,
    /// Rule of [`Method::Sppm`].
    pub radius_rule: RadiusRule,
    /// Kernel of [`Method::Sppm`] with the memoryless rule, and of [`Method::Appm`]; the other methods have the box
    /// kernel.
    pub kernel: KernelChoice,
    /// Parameters of [`Method::Cppm`]'s rule.
    pub chi_squared: ChiSquaredSettings,
    /// Longest path in segments.
    pub max_depth: u32,
    /// Stop after this many iterations (of the whole render, not of the shard).
    pub iterations: Option<u64>,
    /// Stop after this many seconds.
    pub time: Option<f64>,
    /// Stop at this estimated relative error.
    pub target_error: Option<f64>,
    /// Part of the iterations to render.
    pub shard: Shard,
    /// What ends an iteration that is under way.
    #[serde(skip)]
    pub stop: Stop,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            method: Method::default(),
            seed: 0,
            photons: DEFAULT_PHOTONS,
            photon_memory: DEFAULT_MAP_MEMORY,
            indirect: Indirect::Photons,
            classes: ClassSet::ALL,
            guided: false,
            levels: Levels::new(5),
            techniques: false,
            initial_bandwidth: InitialBandwidth::Nearest(DEFAULT_KNN.0),
            max_initial_bandwidth: [SCREEN_CAP; 2],
            alpha: memoryless::ALPHA,
            volume_alpha: volume::ALPHA,
            radius_rule: RadiusRule::Memoryless,
            kernel: KernelChoice::Box,
            chi_squared: ChiSquaredSettings::default(),
            max_depth: u32::MAX,
            iterations: Some(DEFAULT_ITERATIONS),
            time: None,
            target_error: None,
            shard: Shard { index: 0, count: 1 },
            stop: Stop::default(),
        }
    }
}

impl Settings {
    /// Those of a way to render when nothing else is asked for.
    pub fn for_candidate(candidate: Candidate) -> Settings {
        let method = candidate.method;
        let levels = Levels::new(if method.has_levels() { MAX_LEVELS } else { 1 });
        Settings {
            method,
            indirect: candidate.indirect,
            guided: candidate.guided,
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
    }

    /// Light paths of an iteration of a picture of that size where no number is asked for. Where they bring caustics
    /// alone, eye paths bring the rest and are what most of the error is left by: guided ones, which meet glass at once
    /// and take several times as long, are no more than those.
    pub fn default_photons(&self, (width, height): (u32, u32)) -> u32 {
        let usual = self.method.default_photons();
        if self.guided && self.indirect == Indirect::Paths { usual.min(width.saturating_mul(height)) } else { usual }
    }

    /// The eye of a render with these settings.
    pub(in crate::render) fn camera_paths<'a>(
        &'a self,
        scene: &'a Scene,
        camera: &'a Camera,
        initial_media: &InitialMedia,
    ) -> CameraPaths<'a> {
        let Settings { max_depth, indirect, classes, .. } = *self;
        // Pictures per technique are summed at once, and cannot do without part of an iteration.
        let stop = (!self.techniques).then_some(&self.stop);
        CameraPaths { scene, camera, interior: initial_media.camera, max_depth, indirect, classes, stop }
    }

    /// What makes its pixels before the first iteration, from their largest initial bandwidths.
    pub(in crate::render) fn pixel_factory(&self, scene: &Scene) -> impl Fn(ByKind<f32>) -> PixelAccumulator + use<> {
        let (levels, exponent) = (self.levels.count, scene.lights.power_exponent());
        let groups = self.light_groups(scene);
        move |bandwidths| PixelAccumulator::new(levels, exponent, bandwidths).with_groups(groups)
    }

    /// All pixels before the first iteration, of methods without bandwidths of pixels.
    pub(in crate::render) fn initial_pixels(&self, scene: &Scene, camera: &Camera) -> Vec<PixelAccumulator> {
        let (width, height) = camera.size();
        vec![self.pixel_factory(scene)([0.0; 2]); width as usize * height as usize]
    }

    /// Groups of lights whose light is told apart: by methods that know of each light where it comes from.
    pub(in crate::render) fn light_groups(&self, scene: &Scene) -> usize {
        if self.method.has_techniques() { scene.lights.groups().names.len() } else { 0 }
    }

    /// The number (from 1) of the last of so many iterations of this shard.
    pub fn last_iteration(&self, done: u64) -> u64 {
        self.shard.index + done.saturating_sub(1) * self.shard.count + 1
    }

    /// What the memoryless rules make of bandwidths at iteration `i` (from 1).
    pub fn schedule(&self, i: u64) -> Schedule {
        Schedule::new(i, self.levels.count, self.alpha, self.volume_alpha)
    }

    /// Whether other machines render other iterations.
    pub fn is_shard(&self) -> bool {
        self.shard.count > 1
    }

    /// Iterations of this shard, when their number is what stops the render.
    pub fn iterations_of_shard(&self) -> Option<u64> {
        self.iterations.map(|n| n.saturating_sub(self.shard.index).div_ceil(self.shard.count))
    }

    /// How it looks for light.
    pub fn search(&self) -> Search {
        let with_paths = self.method.search_with_paths().filter(|_| self.indirect == Indirect::Paths);
        with_paths.unwrap_or(self.method.search())
    }

    /// Classes of light that photons are to bring to eye paths that gather them.
    pub fn photon_classes(&self, survey: &Survey) -> ClassSet {
        self.search().owned_by(Owner::Photons) & self.classes & classes_in(survey)
    }

    /// Kinds of photons that have bandwidths; where light paths are merged, which tells no kinds apart, the first.
    pub fn bandwidth_kinds(&self, survey: &Survey) -> ByKind<bool> {
        if self.method.gathers() {
            self.indirect.kinds(self.photon_classes(survey))
        } else {
            [self.method.has_bandwidths(), false]
        }
    }

    /// The rule that its bandwidths follow, if they follow one.
    pub fn bandwidth_rule(&self) -> Option<BandwidthRule> {
        self.method.rule(self.radius_rule.into())
    }

    /// Whether red, green and blue have photons and bandwidths of their own.
    pub fn has_channels(&self) -> bool {
        self.bandwidth_rule() == Some(BandwidthRule::ChiSquared) && self.chi_squared.plus
    }

    /// Whether an iteration's bandwidths follow from its number alone, so that iterations may run anywhere and in any
    /// order.
    pub fn is_memoryless(&self) -> bool {
        self.bandwidth_rule().is_none_or(|rule| rule == BandwidthRule::Memoryless)
    }

    /// Levels whose bandwidths are in the fixed ratio from which their bias can be told: all, or, where each shrinks on
    /// its own, those up to the method's own image, which leaves none to compare it with.
    pub fn compared_levels(&self) -> usize {
        if self.is_memoryless() || self.bandwidth_rule() == Some(BandwidthRule::Adaptive) {
            self.levels.count
        } else {
            self.levels.picture_level() + 1
        }
    }
}
