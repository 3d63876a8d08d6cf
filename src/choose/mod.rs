//! `auto`: chooses the numbers of samples of a render.
//!
//! The estimator is vertex connection and merging, which weighs all techniques against each other for every path. Its
//! numbers of light paths, connections and merges decide where the work goes. A short proxy render of the same view in a
//! small picture (the pilot) estimates the variance of every choice, `crate::render::Proxy`. The choice with the least
//! product of relative variance and work of an iteration is taken. Path tracing and bidirectional path tracing
//! are choices without light paths and without merging.
//!
//! The cost of an iteration is counted, not timed: mean numbers of vertices ([`crate::transport::VertexCounts`]) times
//! constants (`crate::render::pass::cost`). So the same arguments give the same choice on any machine with any number of
//! threads, unless the render has a time limit: then the pilot ends after a tenth of it.

mod pilot;
mod pilot_settings;
mod trial;
mod weights;

pub use pilot::PilotResult;
pub use pilot_settings::pilot_settings;
pub use weights::EffectWeight;

use crate::camera::Camera;
use crate::render::{Candidate, Clock, Cost, RenderInput, Session, Settings, TimeSpent};
use crate::scene::{Scene, View};
use crate::stop::Stop;
use pilot::Pilot;

/// Share of the time limit of a render after which the pilot ends. The clock matters on slow or busy machines only:
/// otherwise counted work ends the pilot earlier.
pub const MAX_PILOT_TIME_SHARE: f64 = 0.1;

/// The candidate (method and settings) that `auto` has chosen, and why.
pub struct Choice {
    /// Settings of the render by the chosen candidate.
    pub settings: Settings,
    /// The chosen candidate, a method with settings.
    pub candidate: Candidate,
    /// Results of the pilots (short renders) of all compared candidates; empty if none was rendered.
    pub pilots: Vec<PilotResult>,
    /// Light, error and cost of each effect of the scene; empty if the render is too short to measure them.
    pub weights: Vec<EffectWeight>,
    /// Shortest time limit, in seconds, of a render that is long enough to measure light effects.
    pub seconds_to_measure: f64,
    /// Why no pilot was rendered; `None` if some were.
    pub reason: Option<&'static str>,
    /// Core-seconds of an iteration of the render, predicted from counted vertices.
    pub seconds_per_iteration: f64,
    /// Time that the choice took, pilots included.
    pub spent: TimeSpent,
}

impl Choice {
    /// The pilot result of the chosen candidate; `None` if no pilot was rendered.
    pub fn chosen_pilot(&self) -> Option<&PilotResult> {
        self.pilots.iter().find(|pilot| pilot.chosen)
    }
}

/// Chooses the candidate with the smallest expected error. `settings_of` returns the settings of a candidate, `None` if
/// the user's options exclude it. If `stop` is requested, the pilot ends as soon as it can, and the caller has to discard
/// the choice.
pub fn choose(view: View<'_>, settings_of: impl Fn(Candidate) -> Option<Settings>, stop: &Stop) -> Option<Choice> {
    let mut spent = TimeSpent::default();
    let choice = spent.measure(|| choose_untimed(view, &settings_of, stop));
    choice.map(|choice| Choice { spent, ..choice })
}

fn choose_untimed(view: View<'_>, settings_of: &impl Fn(Candidate) -> Option<Settings>, stop: &Stop) -> Option<Choice> {
    let settings_of_pilot = |candidate| Some(Settings { stop: stop.clone(), ..settings_of(candidate)? });
    let gathering = settings_of_pilot(Candidate::GATHERING)?;
    let clock = Clock::start();
    let pilot = Pilot::new(view, &gathering);
    let limit = gathering.time.map(|seconds| MAX_PILOT_TIME_SHARE * seconds);
    let late = || limit.is_some_and(|limit| clock.seconds() > limit);
    let (effects, effects_seconds) = if late() { (Vec::new(), 0.0) } else { pilot.weigh_effects() };
    let (pilots, reason) = if late() {
        (Vec::new(), Some("the time for a pilot is over"))
    } else {
        pilot.run(effects_seconds, &settings_of_pilot, &late)
    };
    let chosen = pilots.iter().find(|pilot| pilot.chosen);
    let without_pilot = || candidate_without_pilot(view, &pilot, settings_of);
    let candidate = chosen.map_or_else(without_pilot, |chosen| chosen.candidate);
    let settings = settings_of(candidate)?;
    let cost = &pilot.cost;
    let weights =
        effects.into_iter().map(|effect| effect.weight_for(cost, candidate, &settings, pilot.pixels)).collect();
    let predicted = |chosen: &PilotResult| chosen.seconds_per_iteration;
    let seconds_per_iteration = chosen.map_or_else(|| cost.film_seconds(candidate, &settings, view.camera), predicted);
    let (seconds_to_measure, spent) = (pilot.seconds_to_measure(), TimeSpent::default());
    Some(Choice { settings, candidate, pilots, weights, seconds_to_measure, reason, seconds_per_iteration, spent })
}

/// The candidate that is taken where no pilot is rendered: the first one whose iteration is not too long, or the one with
/// the shortest iteration, among those that the user's options allow.
fn candidate_without_pilot(
    view: View<'_>,
    pilot: &Pilot<'_>,
    settings_of: &impl Fn(Candidate) -> Option<Settings>,
) -> Candidate {
    let usual = pilot::candidates_for_focused_light(view.scene).iter().chain(&[Candidate::DEFAULT]).copied();
    let with_seconds = |candidate| {
        let settings = settings_of(candidate)?;
        Some((candidate, pilot.cost.film_seconds(candidate, &settings, view.camera)))
    };
    let cheaper = pilot.cheaper_candidates(settings_of);
    let all: Vec<(Candidate, f64)> = usual.chain(cheaper).filter_map(with_seconds).collect();
    let least = all.iter().map(|(_, seconds)| *seconds).fold(f64::INFINITY, f64::min);
    // Cheap candidates are no alternative where they miss light that the usual ones find.
    let misses_light = pilot::default_misses_light(view.scene);
    let most = if misses_light { f64::INFINITY } else { pilot::MAX_COST_RATIO * least };
    let longest = pilot.longest_iteration(least, 0.0).min(most);
    all.iter().find(|(_, seconds)| *seconds <= longest).map_or(Candidate::GATHERING, |(candidate, _)| *candidate)
}

/// Core-seconds of an iteration, predicted from the counted vertices of sampled paths.
pub fn counted_cost(scene: &Scene, camera: &Camera, candidate: Candidate, settings: &Settings) -> f64 {
    let input = RenderInput::new(scene, camera, settings);
    let session = Session::new(&input);
    Cost::count(scene, camera, settings, session.guide()).film_seconds(candidate, settings, camera)
}

/// Predicted cost of an iteration of the camera's film, relative to the cost if the film were the whole picture. It is
/// above 1 for windows of methods that trace the light paths of the whole picture.
pub fn window_cost_ratio(scene: &Scene, camera: &Camera, settings: &Settings) -> f64 {
    let [film, whole] = camera.sizes();
    if film == whole || !settings.method.walks_whole_picture() {
        return 1.0;
    }
    let candidate = Candidate::unguided(settings.method);
    let cost = Cost::count(scene, camera, settings, None);
    let pixels = f64::from(film.0) * f64::from(film.1);
    cost.film_seconds(candidate, settings, camera) / cost.iteration_seconds(candidate, settings, pixels)
}
