//! Candidates of a scene, and the work that goes to their pilots: size of the picture, iterations, light paths.

use super::compare::{Budget, MIN_ITERATIONS, PilotResult, PilotRun, run_pilots};
use super::pilot_settings::{EFFECTS_PHOTON_SHARE, pilot_settings};
use super::weights::{self, WeighedEffect};
use crate::camera::Camera;
use crate::finish::Finish;
use crate::plan::{Effect, Presence};
use crate::render::{Candidate, Cost, Method, RenderInput, Settings};
use crate::scene::{Scene, View};

/// Share of the render's work that pilots (short renders by the compared methods) and the measurement of effects may
/// take together.
const PILOT_WORK_SHARE: f64 = 0.05;
/// Share of [`PILOT_WORK_SHARE`] that the measurement of effects may take.
const EFFECTS_WORK_SHARE: f64 = 0.2;
/// Share of the render's work that the smallest possible pilots may take. It is larger than [`PILOT_WORK_SHARE`] because
/// in a short render a wrong choice costs more than a pilot.
const MAX_PILOT_WORK_SHARE: f64 = 0.1;
/// Smallest number of pixels of a pilot's picture: a denoiser needs them.
const MIN_PIXELS: f64 = 1024.0;
/// Largest number of pixels of a pilot's picture: more would leave fewer iterations.
const MAX_PIXELS: f64 = 16384.0;
/// Number of pixels of the pictures that measure the effects of a scene.
const EFFECTS_PIXELS: f64 = 768.0;
/// Number of a pilot's iterations over that of the render. Close to 1, so that the pilot's error is like the render's,
/// and small enough for a picture of some size.
const ITERATION_SHARE: f64 = 0.25;
/// Core-seconds that one second of the time limit `--time` counts as, on every machine. It is small, so that on most
/// machines pilots take less than their share; on one core they take twice their share.
const ASSUMED_CORES: f64 = 2.0;
/// Core-seconds that a render without limits of time and iterations counts as.
const UNLIMITED_CORE_SECONDS: f64 = 1000.0;

/// Candidates (methods with settings) for a scene where glass or mirrors focus light, the best one first; empty for
/// other scenes.
pub(super) fn candidates_for_focused_light(scene: &Scene) -> &'static [Candidate] {
    if scene.lights.targets().spheres().is_empty() {
        &[]
    } else if Method::Vcm.search().finds(Effect::Sds, &scene.survey) {
        &[Candidate::GUIDED, Candidate::DEFAULT]
    } else {
        &[Candidate::GUIDED_GATHERING, Candidate::GATHERING, Candidate::GUIDED, Candidate::DEFAULT]
    }
}

/// Candidates (methods with settings) to compare, as far as the user's options allow them. Where glass or mirrors focus
/// light it is the best one only: a pilot is too short to miss the light that other candidates do not find, and would
/// favour them for it.
fn candidates(scene: &Scene, settings_of: &impl Fn(Candidate) -> Option<Settings>) -> Vec<(Candidate, Settings)> {
    let with_settings = |candidate: &Candidate| settings_of(*candidate).map(|settings| (*candidate, settings));
    let focused = candidates_for_focused_light(scene);
    if !focused.is_empty() {
        return focused.iter().find_map(with_settings).into_iter().collect();
    }
    [Candidate::DEFAULT, Candidate::unguided(Method::Path), Candidate::unguided(Method::Bdpt)]
        .iter()
        .filter_map(with_settings)
        .collect()
}

/// Reason, for messages, why a single candidate is chosen without a pilot.
fn reason_without_pilot(candidate: Option<Candidate>, focused: bool) -> &'static str {
    match candidate.map(|candidate| candidate.method) {
        Some(Method::Vcm) if focused => "light is focused here, which it finds by all techniques",
        Some(Method::Sppm) if focused => {
            "a lamp without size shines into cloudy glass, where vcm does not find all light"
        }
        _ => "the only candidate that these options leave",
    }
}

fn pixel_count(camera: &Camera) -> f64 {
    let (width, height) = camera.size();
    f64::from(width) * f64::from(height)
}

/// Plans and runs the pilots of a render: short renders by which `auto` compares methods.
pub(super) struct Pilot<'a> {
    view: View<'a>,
    /// Settings of [`Candidate::GATHERING`].
    gathering: &'a Settings,
    /// Cost of iterations, from the counted vertices of sampled paths in the scene.
    pub cost: Cost,
    /// Number of pixels of the render.
    pub pixels: f64,
    /// Core-seconds that the render takes, as predicted from counted vertices and its limits.
    budget: f64,
}

/// Size of the pilots' picture, and their work.
struct PilotSize {
    camera: Camera,
    /// Core-seconds of all pilots together, as predicted from counted vertices.
    seconds: f64,
}

impl<'a> Pilot<'a> {
    pub fn new(view: View<'a>, gathering: &'a Settings) -> Pilot<'a> {
        let pixels = pixel_count(view.camera);
        let cost = Cost::count(view.scene, view.camera, gathering, None);
        let budget = match (gathering.iterations, gathering.time) {
            (Some(n), time) => {
                let work = n as f64 * cost.iteration_seconds(Candidate::GATHERING, gathering, pixels);
                time.map_or(work, |seconds| work.min(seconds * ASSUMED_CORES))
            }
            (None, Some(seconds)) => seconds * ASSUMED_CORES,
            (None, None) => UNLIMITED_CORE_SECONDS,
        };
        Pilot { view, gathering, cost, pixels, budget }
    }

    /// Measures what each effect of the scene adds to the picture. Also returns the predicted core-seconds of the
    /// measurement. If the render is too short for all of it, measures light effects only, or nothing.
    pub fn weigh_effects(&self) -> (Vec<WeighedEffect>, f64) {
        let settings = weights::settings(self.gathering, EFFECTS_PHOTON_SHARE);
        let pixels = EFFECTS_PIXELS.min(self.pixels);
        let picture_seconds =
            self.cost.iteration_seconds(Candidate::GATHERING, &settings, pixels) * weights::ITERATIONS as f64;
        let allowed = EFFECTS_WORK_SHARE * PILOT_WORK_SHARE * self.budget;
        let mut seconds = weights::MAX_LIGHT_PICTURES as f64 * picture_seconds;
        if seconds > allowed {
            return (Vec::new(), 0.0);
        }
        let presence = Presence::of(self.view.scene, self.view.camera);
        let mut scene_effects = weights::scene_effects(&presence);
        scene_effects.retain(|effect| {
            let more = picture_seconds + weights::rebuild_seconds(self.view.scene, *effect);
            let affordable = seconds + more <= allowed;
            seconds += if affordable { more } else { 0.0 };
            affordable
        });
        let small = self.view.camera.subsample((pixels / self.pixels).sqrt().min(1.0));
        let count = |scene: &Scene, camera: &Camera| Cost::count(scene, camera, self.gathering, None);
        let view = View::new(self.view.scene, &small);
        (weights::weigh(view, &settings, &presence, &scene_effects, count), seconds)
    }

    /// Runs the pilots of all candidates, with the work that the measurement of effects (`effects_seconds`) has left.
    /// Returns their results, or the reason why there are none.
    pub fn run(
        &self,
        effects_seconds: f64,
        finish: &mut Finish,
        settings_of: &impl Fn(Candidate) -> Option<Settings>,
        stopped: &dyn Fn() -> bool,
    ) -> (Vec<PilotResult>, Option<&'static str>) {
        let View { scene, camera } = self.view;
        let candidates = candidates(scene, settings_of);
        if candidates.len() < 2 {
            let focused = !candidates_for_focused_light(scene).is_empty();
            let candidate = candidates.first().map(|(candidate, _)| *candidate);
            return (Vec::new(), Some(reason_without_pilot(candidate, focused)));
        }
        let [wanted, most] =
            [PILOT_WORK_SHARE, MAX_PILOT_WORK_SHARE].map(|share| share * self.budget - effects_seconds);
        let Some(size) = self.size(&candidates, wanted, most) else {
            return (Vec::new(), Some("the render is too short to try others"));
        };
        let pixels = pixel_count(&size.camera);
        // Light paths per pixel are the same as in the render.
        let inputs: Vec<RenderInput<'_>> = candidates
            .iter()
            .map(|(_, settings)| RenderInput::new(scene, &size.camera, &pilot_settings(settings, pixels / self.pixels)))
            .collect();
        let mut runs: Vec<PilotRun<'_>> = inputs
            .iter()
            .zip(&candidates)
            .map(|(input, (candidate, settings))| {
                let seconds = self.cost.iteration_seconds(*candidate, input.settings(), pixels);
                PilotRun::new(input, *candidate, seconds, self.cost.film_seconds(*candidate, settings, camera))
            })
            .collect();
        let budget = Budget { pilots: size.seconds, render: self.budget };
        (run_pilots(&mut runs, finish, budget, stopped), None)
    }

    /// Size of the pilots: `wanted` core-seconds, or more if the smallest picture needs more. `None` if that needs more
    /// than `most`.
    fn size(&self, candidates: &[(Candidate, Settings)], wanted: f64, most: f64) -> Option<PilotSize> {
        let count = candidates.len() as f64;
        let iteration_seconds = |(candidate, settings): &(Candidate, Settings), pixels: f64| {
            self.cost.iteration_seconds(*candidate, &pilot_settings(settings, pixels / self.pixels), pixels)
        };
        let needed = |pixels: f64| {
            let dearest = candidates.iter().map(|one| iteration_seconds(one, pixels)).fold(0.0, f64::max);
            count * MIN_ITERATIONS as f64 * dearest
        };
        // Work per pixel is the same as in the render, so iterations and pixels share the budget.
        let pixels = self.pixels * wanted / (count * ITERATION_SHARE * self.budget);
        let least = MIN_PIXELS.min(self.pixels);
        let pixels = pixels.clamp(least, MAX_PIXELS.max(least)).min(self.pixels);
        let pixels = if needed(pixels) > wanted { least } else { pixels };
        (needed(pixels) <= most).then(|| PilotSize {
            camera: self.view.camera.downscale((pixels / self.pixels).sqrt()),
            seconds: wanted.max(needed(pixels)),
        })
    }
}
