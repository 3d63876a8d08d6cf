//! Choosing how to render: a short pilot tries every candidate on a small picture of the same view, and takes the one that is expected to come
//! closest within what the render may cost.
//!
//! The cost of an iteration is counted, never timed: mean numbers of vertices ([`Lengths`]) times constants (`cost`). So the same arguments give the
//! same choice on any machine and any number of threads. What a candidate is expected to reach comes from its own variances: noise falls as
//! 1/n where paths are whole, and as n^-alpha where photons are gathered; the squared bias there as the area n^-(1 - alpha) to an exponent that levels
//! tell (`bias`) \[Knaus and Zwicker 2011\]. Light that connections hardly ever find is told by merging (`missing`).
//!
//! Where photons are gathered the pilot also balances: noise that bandwidths can smooth against the bias they bring, and light paths against eye paths
//! ([`Balance`]).

mod balance;
mod bias;
pub(super) mod cost;
mod missing;
mod tail;
mod trial;
mod weights;

pub use balance::Balance;
pub use trial::Trial;
pub use weights::Weight;

use super::control::{Clock, cpu_seconds};
use super::guiding::ROUNDS;
use super::method::Method;
use super::output::Present;
use super::session::{Session, Spent, Stage};
use super::settings::Settings;
use crate::camera::Camera;
use crate::estimator::InitialBandwidth;
use crate::estimator::bandwidth::footprint;
use crate::light::Guide;
use crate::plan::Presence;
use crate::scene::Scene;
use crate::transport::{Eye, Indirect, Lengths, Surroundings};
use cost::Cost;
use missing::Caustics;

/// Share of the render's cost that the pilot may take.
const SHARE: f64 = 0.05;
/// Share of that which may go to weighing the effects.
const WEIGHING: f64 = 0.2;
/// Pixels of the pilot's picture.
const PIXELS: (f64, f64) = (768.0, 4096.0);
/// Iterations of a candidate: as many as its share of the pilot allows.
const ITERATIONS: (u64, u64) = (6, 64);
/// What a second of `--time` is taken for (core-seconds), whatever the machine: a small one, so that the pilot takes no more than its share of any.
const CORES: f64 = 2.0;
/// What a render until an error is reached is taken for (core-seconds).
const UNLIMITED: f64 = 1000.0;
/// A candidate that finds less than this share of the caustics that photons find has not seen them all, and its noise is not known.
const FOUND: f64 = 0.7;
/// The same for one that sends photons, of the caustics that guided ones find: those of either kind are a few bright discs where they are rare.
const SENT: f64 = 0.25;

/// A way to render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Way {
    /// How light is found.
    pub method: Method,
    /// What photons bring, where they are gathered.
    pub indirect: Indirect,
    /// Light paths are guided.
    pub guided: bool,
}

impl Way {
    /// What is done where a render is too short to try anything: stochastic progressive photon mapping, which finds all light.
    pub const UNTRIED: Way = Way { method: Method::Sppm, indirect: Indirect::Photons, guided: false };

    /// A way in words.
    pub fn name(self) -> String {
        let what = match self.indirect {
            Indirect::Photons => "",
            Indirect::Paths => " for caustics, path tracing for the rest",
        };
        format!("{}{what}{}", self.method.name(), if self.guided { ", guided" } else { "" })
    }
}

/// Settings that the user leaves to the choice.
#[derive(Clone, Copy, Debug)]
pub struct Free {
    /// Light paths of an iteration.
    pub photons: bool,
    /// Neighbours that set bandwidths.
    pub neighbours: bool,
}

/// What was chosen.
pub struct Choice {
    /// Settings of the render.
    pub settings: Settings,
    /// The way.
    pub way: Way,
    /// All that were tried; none where the render is too short.
    pub trials: Vec<Trial>,
    /// Index of the one chosen.
    pub chosen: Option<usize>,
    /// What effects of light mean to the picture; none where the render is too short.
    pub weights: Vec<Weight>,
    /// Why.
    pub because: String,
    /// Time that it took.
    pub spent: Spent,
}

impl Choice {
    /// The trial of what was chosen.
    pub fn trial(&self) -> Option<&Trial> {
        self.chosen.map(|chosen| &self.trials[chosen])
    }
}

fn focuses(scene: &Scene) -> bool {
    !scene.lights.targets().spheres().is_empty()
}

/// The ways worth trying in a scene; `gathering` is the method where photons bring all light.
fn candidates(scene: &Scene, gathering: Method) -> Vec<Way> {
    let focusing = focuses(scene);
    let (sizeless, scattering) = (Presence::has_sizeless_lights(scene), scene.survey.scattering());
    let plain = |method| Way { method, indirect: Indirect::Photons, guided: false };
    let mut ways = vec![plain(gathering)];
    if focusing {
        // Photons of all light are not guided: as few as a fifth of them would be left for what is no caustic, and guided paths take longer.
        if !scattering {
            ways.push(Way { method: Method::Sppm, indirect: Indirect::Paths, guided: true });
        }
        ways.push(plain(Method::Vcm));
    }
    // What photons alone find, these leave out.
    if !(focusing && sizeless) {
        ways.extend([plain(Method::Path), plain(Method::Bdpt)]);
    }
    ways
}

/// Tries the candidates and takes the best. `make` gives the settings of a way, `None` where other wishes rule it out.
pub fn choose(scene: &Scene, camera: &Camera, free: Free, make: impl Fn(Way) -> Option<Settings>) -> Option<Choice> {
    let (clock, cpu_start) = (Clock::start(), cpu_seconds());
    let untried = make(Way::UNTRIED)?;
    let pilot = Pilot::new(scene, camera, &untried);
    let mut weights = pilot.weigh();
    let left = SHARE * pilot.budget - if weights.is_empty() { 0.0 } else { pilot.weighing_cost() };
    let (trials, because) = pilot.try_all(left, free, &make);
    let best = (0..trials.len()).min_by(|&a, &b| trials[a].expected.total_cmp(&trials[b].expected));
    let way = best.map_or(Way::UNTRIED, |best| trials[best].way);
    let mut settings = make(way)?;
    if let Some(best) = best {
        trials[best].balance.apply(&mut settings);
    }
    let cost = best.map_or(pilot.cost, |best| trials[best].cost);
    for weight in &mut weights {
        weight.saved = weights::saved(&cost, (way, &settings), weight.effect, pilot.pixels);
    }
    let spent = Spent { seconds: clock.seconds(), cpu_seconds: cpu_seconds() - cpu_start };
    settings.decided = spent;
    Some(Choice { settings, way, trials, chosen: best, weights, because, spent })
}

/// Core-seconds that an iteration is taken to cost, by counted work.
pub fn counted_cost(scene: &Scene, camera: &Camera, way: Way, settings: &Settings) -> f64 {
    let (width, height) = camera.size();
    let stage = Stage::new(scene, camera, settings);
    let session = Session::new(&stage);
    counts(scene, camera, settings, session.guide()).of(way, settings, f64::from(width) * f64::from(height))
}

fn counts(scene: &Scene, camera: &Camera, settings: &Settings, guide: Option<&Guide>) -> Cost {
    let surroundings = Surroundings::new(scene, camera.position());
    let Settings { max_depth, seed, classes, .. } = *settings;
    let eye = Eye { scene, camera, interior: surroundings.eye, max_depth, indirect: Indirect::Photons, classes };
    let reach = |length: f32| match settings.initial {
        InitialBandwidth::Fixed(radius) => radius,
        _ => footprint(camera, length),
    };
    let lengths = Lengths::new(&eye, &surroundings, seed, guide, reach);
    Cost { lengths, present: Present::of(scene) }
}

/// What a pilot is of.
struct Pilot<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    /// Settings of [`Way::UNTRIED`].
    untried: &'a Settings,
    cost: Cost,
    /// Pixels of the whole picture.
    pixels: f64,
    /// What the render may take (core-seconds).
    budget: f64,
}

impl<'a> Pilot<'a> {
    fn new(scene: &'a Scene, camera: &'a Camera, untried: &'a Settings) -> Pilot<'a> {
        let (width, height) = camera.size();
        let pixels = f64::from(width) * f64::from(height);
        let cost = counts(scene, camera, untried, None);
        let budget = match (untried.iterations, untried.time) {
            (Some(n), time) => {
                let work = n as f64 * cost.of(Way::UNTRIED, untried, pixels);
                time.map_or(work, |seconds| work.min(seconds * CORES))
            }
            (None, Some(seconds)) => seconds * CORES,
            (None, None) => UNLIMITED,
        };
        Pilot { scene, camera, untried, cost, pixels, budget }
    }

    /// Pixels of the smallest picture that says anything.
    fn least(&self) -> f64 {
        PIXELS.0.min(self.pixels)
    }

    /// Core-seconds that weighing the effects takes.
    fn weighing_cost(&self) -> f64 {
        let settings = trial::settings(self.untried, trial::PHOTONS.0);
        (weights::PICTURES as u64 * ITERATIONS.0) as f64 * self.cost.of(Way::UNTRIED, &settings, self.least())
    }

    /// What effects of light mean to the picture; nothing where the render is too short.
    fn weigh(&self) -> Vec<Weight> {
        if self.weighing_cost() > WEIGHING * SHARE * self.budget {
            return Vec::new();
        }
        let small = self.camera.sparse((self.least() / self.pixels).sqrt().min(1.0));
        let presence = Presence::of(self.scene, self.camera);
        let settings = trial::settings(self.untried, trial::PHOTONS.0);
        weights::weigh(self.scene, &small, &settings, |effect| !presence.because(effect).is_empty())
    }

    /// Tries what there is for so many core-seconds; returns the trials and why one of them is to be taken, or none.
    fn try_all(&self, allowed: f64, free: Free, make: &impl Fn(Way) -> Option<Settings>) -> (Vec<Trial>, String) {
        let Pilot { scene, camera, untried, cost, pixels, .. } = *self;
        // Bandwidths that shrink only where photons do not look uniform are better ones. Of several levels each would shrink on its own, and the combiner has
        // learnt on levels that keep their ratios.
        let counted =
            make(Way { method: Method::Cppm, ..Way::UNTRIED }).is_some_and(|settings| settings.levels.count == 1);
        let gathering = if counted { Method::Cppm } else { Method::Sppm };
        let ways: Vec<(Way, Settings)> = candidates(scene, gathering)
            .into_iter()
            .filter_map(|way| make(way).map(|settings| (way, settings)))
            .collect();
        if ways.len() < 2 {
            return (Vec::new(), "the one way that these options leave".into());
        }
        let trial_cost = |pixels: f64, photons: f64| -> f64 {
            let each = |(way, settings): &(Way, Settings)| {
                // Learning a guide takes about as much as an iteration of a trial every other round.
                let learning = if way.guided { ROUNDS as f64 / 2.0 } else { 0.0 };
                (ITERATIONS.0 as f64 + learning) * cost.of(*way, &trial::settings(settings, photons), pixels)
            };
            ways.iter().map(each).sum()
        };
        let (least, few) = (self.least(), trial::PHOTONS.0);
        if trial_cost(least, few) > allowed {
            return (Vec::new(), "the render is too short to try others".into());
        }
        // The cost grows linearly with pixels. Half of it goes to what makes all equal: cheap ones run for longer.
        let allowed_once = 0.5 * allowed;
        let slope = (trial_cost(2.0 * least, few) - trial_cost(least, few)) / least;
        let most = least + (allowed_once - trial_cost(least, few)).max(0.0) / slope.max(1e-12);
        let factor = (most.clamp(least, PIXELS.1.max(least)) / pixels).sqrt().min(1.0);
        let small = camera.sparse(factor);
        let small_pixels = f64::from(small.size().0) * f64::from(small.size().1);
        // What is left makes the light paths as many as in the render, so that bandwidths are as wide.
        let spare = allowed_once / trial_cost(small_pixels, few);
        let photons = (few * spare).clamp(few, trial::PHOTONS.1);
        let plan = trial::Plan { photons, budget: (1.0 - SHARE) * self.budget, free, pixels };
        let mut values = Vec::new();
        let (mut trials, found): (Vec<Trial>, Vec<Caustics>) = ways
            .iter()
            .map(|(way, settings)| {
                let once = cost.of(*way, &trial::settings(settings, photons), small_pixels);
                let iterations = (allowed / (ways.len() as f64 * once)) as u64;
                let iterations = iterations.clamp(ITERATIONS.0, ITERATIONS.1);
                let guided = |guide: &Guide| counts(scene, camera, untried, Some(guide));
                let cost_with = |guide: Option<&Guide>| guide.map_or(cost, guided);
                Trial::new(scene, &small, (*way, settings), cost_with, (&plan, iterations), &mut values)
            })
            .unzip();
        rule_out(&mut trials);
        add_missing(&mut trials, &found, (&values, small.size().0 as usize));
        (trials, "least expected error".into())
    }
}

/// Adds what connections leave out of what merging finds: `found` has the caustics of each. `values` are what the pixels of the pilot's picture are worth, which is so wide.
fn add_missing(trials: &mut [Trial], found: &[Caustics], (values, width): (&[f64], usize)) {
    let Some(merging) = trials.iter().position(|trial| trial.way.method == Method::Vcm) else { return };
    for (trial, own) in trials.iter_mut().zip(found) {
        if matches!(trial.way.method, Method::Path | Method::Bdpt) {
            trial.expected += own.missing(&found[merging], values, width);
        }
    }
}

/// Rules out what has not seen the caustics that photons show.
fn rule_out(trials: &mut [Trial]) {
    let most = |guided: bool| {
        let gathers = |trial: &&Trial| trial.way.method.gathers() && trial.way.guided == guided;
        trials.iter().filter(gathers).map(|trial| trial.caustics).fold(0.0, f64::max)
    };
    let [unguided, guided] = [false, true].map(most);
    for trial in trials.iter_mut().filter(|trial| !trial.way.guided) {
        let least = if trial.way.method.has_bandwidths() { SENT * guided } else { FOUND * unguided.max(guided) };
        if trial.caustics < least {
            trial.expected = f64::INFINITY;
        }
    }
}
