//! What a pilot may take, and what for: its candidates, the size of its picture, the number of its light paths.

use super::contest;
use super::trial::{self, Plan, Running, Trial};
use super::weights::{self, Weighed};
use super::{Free, Way};
use crate::camera::Camera;
use crate::estimator::InitialBandwidth;
use crate::light::Guide;
use crate::plan::Presence;
use crate::render::cost::Cost;
use crate::render::guiding::ROUNDS;
use crate::render::method::Method;
use crate::render::session::Stage;
use crate::render::settings::Settings;
use crate::scene::Scene;
use crate::transport::Indirect;

/// Share of the render's cost that the pilot may take.
const SHARE: f64 = 0.05;
/// Share of that which may go to weighing the effects.
const WEIGHING: f64 = 0.2;
/// Share of the render's cost that the least of all pilots may take: in a render that short a wrong way costs more.
const LEAST_SHARE: f64 = 0.1;
/// Pixels of the pilot's picture.
const PIXELS: (f64, f64) = (768.0, 4096.0);
/// What a second of `--time` is taken for (core-seconds), whatever the machine: a small one, so that the pilot takes no more than its share of it. One core takes twice
/// that share.
const CORES: f64 = 2.0;
/// What a render until an error is reached is taken for (core-seconds).
const UNLIMITED: f64 = 1000.0;

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

/// The candidates that other wishes leave, with their settings.
fn ways(scene: &Scene, make: &impl Fn(Way) -> Option<Settings>) -> Vec<(Way, Settings)> {
    // Bandwidths that shrink only where photons do not look uniform are better ones. Of several levels each would shrink on its own, and the combiner has
    // learnt on levels that keep their ratios.
    let counted = make(Way { method: Method::Cppm, ..Way::UNTRIED }).is_some_and(|settings| settings.levels.count == 1);
    let gathering = if counted { Method::Cppm } else { Method::Sppm };
    candidates(scene, gathering).into_iter().filter_map(|way| make(way).map(|settings| (way, settings))).collect()
}

/// What a trial takes before it begins, in iterations of it.
fn setup((way, settings): &(Way, Settings)) -> f64 {
    // Learning a guide takes about as much as an iteration every other round; initial bandwidths by neighbours need photons and eye paths.
    let learning = if way.guided { ROUNDS as f64 / 2.0 } else { 0.0 };
    let bandwidths = way.method.gathers() && matches!(settings.initial, InitialBandwidth::Nearest(_));
    learning + if bandwidths { 1.0 } else { 0.0 }
}

/// What a pilot is of.
pub(super) struct Pilot<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    /// Settings of [`Way::UNTRIED`].
    untried: &'a Settings,
    pub cost: Cost,
    /// Pixels of the whole picture.
    pub pixels: f64,
    /// What the render may take (core-seconds).
    budget: f64,
}

impl<'a> Pilot<'a> {
    pub fn new(scene: &'a Scene, camera: &'a Camera, untried: &'a Settings) -> Pilot<'a> {
        let (width, height) = camera.size();
        let pixels = f64::from(width) * f64::from(height);
        let cost = Cost::count(scene, camera, untried, None);
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

    /// What effects mean to the picture, and the core-seconds that finding out is counted to take. Where the render is too short, only those of light are weighed, or none.
    pub fn weigh(&self) -> (Vec<Weighed>, f64) {
        let settings = weights::settings(self.untried, trial::PHOTONS.0);
        let once = self.cost.of(Way::UNTRIED, &settings, self.least()) * contest::ITERATIONS.0 as f64;
        let most = WEIGHING * SHARE * self.budget;
        let mut taken = weights::PICTURES as f64 * once;
        if taken > most {
            return (Vec::new(), 0.0);
        }
        let presence = Presence::of(self.scene, self.camera);
        let mut properties = weights::properties(&presence);
        properties.retain(|effect| {
            let more = once + weights::making(self.scene, *effect);
            let affordable = taken + more <= most;
            taken += if affordable { more } else { 0.0 };
            affordable
        });
        let small = self.camera.sparse((self.least() / self.pixels).sqrt().min(1.0));
        let count = |scene: &Scene, camera: &Camera| Cost::count(scene, camera, self.untried, None);
        (weights::weigh(self.scene, &small, &settings, &presence, &properties, count), taken)
    }

    /// Tries what there is, with what weighing the effects has left of the pilot; returns the trials, or why there are none.
    pub fn try_all(
        &self,
        weighing: f64,
        free: Free,
        make: &impl Fn(Way) -> Option<Settings>,
        stop: &dyn Fn() -> bool,
    ) -> (Vec<Trial>, Option<&'static str>) {
        let Pilot { scene, camera, untried, cost, pixels, budget } = *self;
        let ways = ways(scene, make);
        if ways.len() < 2 {
            return (Vec::new(), Some("the one way that these options leave"));
        }
        let allowed = SHARE * budget - weighing;
        let Some((small, photons)) = self.size(&ways, allowed, LEAST_SHARE * budget - weighing) else {
            return (Vec::new(), Some("the render is too short to try others"));
        };
        let (width, height) = small.size();
        let plan = Plan { photons, budget: (1.0 - SHARE) * budget, free, pixels };
        let stages: Vec<Stage<'_>> =
            ways.iter().map(|(_, settings)| Stage::new(scene, &small, &trial::settings(settings, photons))).collect();
        let cost_with =
            |guide: Option<&Guide>| guide.map_or(cost, |guide| Cost::count(scene, camera, untried, Some(guide)));
        let mut running: Vec<Running<'_>> = stages
            .iter()
            .zip(&ways)
            .map(|(stage, tried @ (way, _))| {
                let once = cost.of(*way, stage.settings(), f64::from(width) * f64::from(height));
                Running::new(stage, tried, (once, setup(tried)), cost_with)
            })
            .collect();
        (contest::hold(&mut running, &plan, allowed, stop), None)
    }

    /// The picture that is tried and the share of the render's light paths, where a few iterations of all `ways` take half of what is allowed, or more where that is too
    /// little; `None` where even the least picture takes more than `most`.
    fn size(&self, ways: &[(Way, Settings)], allowed: f64, most: f64) -> Option<(Camera, f64)> {
        let trial_cost = |pixels: f64, photons: f64| -> f64 {
            let each = |tried @ (way, settings): &(Way, Settings)| {
                let once = self.cost.of(*way, &trial::settings(settings, photons), pixels);
                (contest::ITERATIONS.0 as f64 + setup(tried)) * once
            };
            ways.iter().map(each).sum()
        };
        let (least, few) = (self.least(), trial::PHOTONS.0);
        if trial_cost(least, few) > most {
            return None;
        }
        // The cost grows linearly with pixels.
        let allowed = 0.5 * allowed;
        let slope = (trial_cost(2.0 * least, few) - trial_cost(least, few)) / least;
        let pixels = least + (allowed - trial_cost(least, few)).max(0.0) / slope.max(1e-12);
        let factor = (pixels.clamp(least, PIXELS.1.max(least)) / self.pixels).sqrt().min(1.0);
        let small = self.camera.sparse(factor);
        let (width, height) = small.size();
        // What is left makes the light paths as many as in the render, so that bandwidths are as wide.
        let spare = allowed / trial_cost(f64::from(width) * f64::from(height), few);
        Some((small, (few * spare).clamp(few, trial::PHOTONS.1)))
    }
}
