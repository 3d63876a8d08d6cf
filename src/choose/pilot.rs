//! What a pilot may take, and what for: its candidates, the size of its picture, the number of its light paths.

use super::compare::{self, CandidateRun, PilotResult};
use super::pilot_settings::{self, pilot_settings};
use super::weights::{self, Weighed};
use crate::camera::Camera;
use crate::finish::Finish;
use crate::plan::{Effect, Presence};
use crate::render::{Candidate, Cost, Method, RenderInput, Settings};
use crate::scene::Scene;

/// Share of the render's cost that the pilot may take.
const SHARE: f64 = 0.05;
/// Share of that which may go to weighing the effects.
const WEIGHING: f64 = 0.2;
/// Share of the render's cost that the least of all pilots may take: in a render that short a wrong way costs more.
const LEAST_SHARE: f64 = 0.1;
/// Pixels of the pilot's picture: fewer show a denoiser nothing, more would take their time from iterations.
const PIXELS: (f64, f64) = (1024.0, 16384.0);
/// Pixels of the picture by which effects are weighed.
const WEIGHED: f64 = 768.0;
/// Iterations of a candidate over those of the render: near to the render's own, so that what they leave is what the
/// render will, and few enough that the picture is not much smaller.
const ITERATIONS: f64 = 0.25;
/// What a second of `--time` is taken for (core-seconds), whatever the machine: a small one, so that the pilot takes no
/// more than its share of it. One core takes twice that share.
const CORES: f64 = 2.0;
/// What a render until an error is reached is taken for (core-seconds).
const UNLIMITED: f64 = 1000.0;

/// The ways to take where glass or mirrors focus light, the best one first; none elsewhere.
pub(super) fn focused(scene: &Scene) -> &'static [Candidate] {
    if scene.lights.targets().spheres().is_empty() {
        &[]
    } else if Method::Vcm.search().finds(Effect::Sds, &scene.survey) {
        &[Candidate::GUIDED, Candidate::DEFAULT]
    } else {
        &[Candidate::GUIDED_GATHERING, Candidate::GATHERING, Candidate::GUIDED, Candidate::DEFAULT]
    }
}

/// The ways worth trying in a scene, with their settings, of those that other wishes leave. Where glass or mirrors
/// focus light it is one: what connections and photons leave out there a pilot is too short to miss, and would praise
/// them for it.
fn candidates(scene: &Scene, make: &impl Fn(Candidate) -> Option<Settings>) -> Vec<(Candidate, Settings)> {
    let with_settings = |candidate: &Candidate| make(*candidate).map(|settings| (*candidate, settings));
    let focused = focused(scene);
    if !focused.is_empty() {
        return focused.iter().find_map(with_settings).into_iter().collect();
    }
    [Candidate::DEFAULT, Candidate::unguided(Method::Path), Candidate::unguided(Method::Bdpt)]
        .iter()
        .filter_map(with_settings)
        .collect()
}

/// What a pilot is of.
pub(super) struct Pilot<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    /// Settings of [`Candidate::GATHERING`].
    gathering: &'a Settings,
    pub cost: Cost,
    /// Pixels of the whole picture.
    pub pixels: f64,
    /// What the render may take (core-seconds).
    budget: f64,
}

impl<'a> Pilot<'a> {
    pub fn new(scene: &'a Scene, camera: &'a Camera, gathering: &'a Settings) -> Pilot<'a> {
        let (width, height) = camera.size();
        let pixels = f64::from(width) * f64::from(height);
        let cost = Cost::count(scene, camera, gathering, None);
        let budget = match (gathering.iterations, gathering.time) {
            (Some(n), time) => {
                let work = n as f64 * cost.of(Candidate::GATHERING, gathering, pixels);
                time.map_or(work, |seconds| work.min(seconds * CORES))
            }
            (None, Some(seconds)) => seconds * CORES,
            (None, None) => UNLIMITED,
        };
        Pilot { scene, camera, gathering, cost, pixels, budget }
    }

    /// Pixels of the picture by which effects are weighed.
    fn least(&self) -> f64 {
        WEIGHED.min(self.pixels)
    }

    /// What effects mean to the picture, and the core-seconds that finding out is counted to take. Where the render is
    /// too short, only those of light are weighed, or none.
    pub fn weigh(&self) -> (Vec<Weighed>, f64) {
        let settings = weights::settings(self.gathering, pilot_settings::PHOTONS);
        let once = self.cost.of(Candidate::GATHERING, &settings, self.least()) * weights::ITERATIONS as f64;
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
        let small = self.camera.subsample((self.least() / self.pixels).sqrt().min(1.0));
        let count = |scene: &Scene, camera: &Camera| Cost::count(scene, camera, self.gathering, None);
        (weights::weigh(self.scene, &small, &settings, &presence, &properties, count), taken)
    }

    /// Tries what there is, with what weighing the effects has left of the pilot; returns the trials, or why there are
    /// none.
    pub fn try_all(
        &self,
        weighing: f64,
        finish: &mut Finish,
        make: &impl Fn(Candidate) -> Option<Settings>,
        stop: &dyn Fn() -> bool,
    ) -> (Vec<PilotResult>, Option<&'static str>) {
        let Pilot { scene, camera, cost, pixels, budget, .. } = *self;
        let (candidates, focuses) = (candidates(scene, make), !focused(scene).is_empty());
        if candidates.len() < 2 {
            let why = match candidates.first() {
                Some((Candidate { method: Method::Vcm, .. }, _)) if focuses => {
                    "light is focused here, which it finds by all techniques"
                }
                Some((Candidate { method: Method::Sppm, .. }, _)) if focuses => {
                    "a lamp without size shines into cloudy glass, where vcm does not find all light"
                }
                _ => "the only candidate that these options leave",
            };
            return (Vec::new(), Some(why));
        }
        let allowed = SHARE * budget - weighing;
        let Some((small, allowed)) = self.size(&candidates, allowed, LEAST_SHARE * budget - weighing) else {
            return (Vec::new(), Some("the render is too short to try others"));
        };
        let (width, height) = small.size();
        let few = f64::from(width) * f64::from(height);
        // As many light paths for a pixel as in the render.
        let stages: Vec<RenderInput<'_>> = candidates
            .iter()
            .map(|(_, settings)| RenderInput::new(scene, &small, &pilot_settings(settings, few / pixels)))
            .collect();
        let mut candidates: Vec<CandidateRun<'_>> = stages
            .iter()
            .zip(&candidates)
            .map(|(stage, (candidate, settings))| {
                let costs = [cost.of(*candidate, stage.settings(), few), cost.of_film(*candidate, settings, camera)];
                CandidateRun::new(stage, *candidate, costs)
            })
            .collect();
        (compare::hold(&mut candidates, finish, (allowed, budget), stop), None)
    }

    /// The picture that is tried and the core-seconds of all candidates together, `allowed` or more where that is too
    /// little for the smallest picture; `None` where even that takes more than `most`.
    fn size(&self, candidates: &[(Candidate, Settings)], allowed: f64, most: f64) -> Option<(Camera, f64)> {
        let once = |candidate: &Candidate, settings: &Settings, pixels: f64| {
            self.cost.of(*candidate, &pilot_settings(settings, pixels / self.pixels), pixels)
        };
        let dearest = |pixels: f64| {
            candidates.iter().map(|(candidate, settings)| once(candidate, settings, pixels)).fold(0.0, f64::max)
        };
        let count = candidates.len() as f64;
        // Work per pixel is the same as in the render, so iterations and pixels share what there is.
        let wanted = self.pixels * allowed / (count * ITERATIONS * self.budget);
        let least = PIXELS.0.min(self.pixels);
        let pixels = wanted.clamp(least, PIXELS.1.max(least)).min(self.pixels);
        let needed = |pixels: f64| count * compare::ITERATIONS.0 as f64 * dearest(pixels);
        let pixels = if needed(pixels) > allowed { least } else { pixels };
        (needed(pixels) <= most)
            .then(|| (self.camera.downscale((pixels / self.pixels).sqrt()), allowed.max(needed(pixels))))
    }
}
