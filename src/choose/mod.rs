//! Choosing how to render. Vertex connection and merging, which weighs all techniques against each other for every
//! path, is taken where glass or mirrors focus light. Elsewhere a short pilot renders it and paths without photons on a
//! small picture of the same view, finished as the render will be, and another is taken where its picture is clearly
//! closer to the truth: further than the pilot's own noise can say.
//!
//! The cost of an iteration is counted, never timed: mean numbers of vertices ([`crate::transport::Lengths`]) times
//! constants (`crate::render::pass::cost`). So the same arguments give the same choice on any machine and any number of threads.
//! Candidates get the same work, near to the render's own work per pixel, and their pictures are judged without a
//! reference by iterations that they do not hold (`compare`).

mod compare;
mod pilot;
mod pilot_settings;
mod weights;

pub use compare::PilotResult;
pub use pilot_settings::pilot_settings;
pub use weights::EffectWeight;

use crate::camera::Camera;
use crate::finish::Finish;
use crate::render::{Candidate, Clock, Cost, RenderInput, Session, Settings, TimeSpent, cpu_seconds};
use crate::scene::{Scene, View};
use pilot::Pilot;
use weights::Weighed;

/// What was chosen.
pub struct Choice {
    /// Settings of the render.
    pub settings: Settings,
    /// The way.
    pub candidate: Candidate,
    /// All that were tried; none where the render is too short.
    pub pilots: Vec<PilotResult>,
    /// What effects of light mean to the picture; none where the render is too short.
    pub weights: Vec<EffectWeight>,
    /// Why nothing was tried.
    pub reason: Option<&'static str>,
    /// Counted core-seconds of an iteration.
    pub seconds_per_iteration: f64,
    /// Time that it took.
    pub spent: TimeSpent,
}

impl Choice {
    /// The trial of what was chosen.
    pub fn chosen_pilot(&self) -> Option<&PilotResult> {
        self.pilots.iter().find(|trial| trial.chosen)
    }
}

/// Tries the candidates and takes one by what `finish` makes of them. `make` gives the settings of a way, `None` where
/// other wishes rule it out. Once `stop` holds, what is tried ends as soon as it can, and the choice is worth nothing.
pub fn choose(
    View { scene, camera }: View<'_>,
    finish: &mut Finish,
    make: impl Fn(Candidate) -> Option<Settings>,
    stop: impl Fn() -> bool,
) -> Option<Choice> {
    let (clock, cpu_start) = (Clock::start(), cpu_seconds());
    let gathering = make(Candidate::GATHERING)?;
    let pilot = Pilot::new(scene, camera, &gathering);
    let (weighed, weighing) = pilot.weigh();
    let (pilots, reason) = pilot.try_all(weighing, finish, &make, &stop);
    let chosen = pilots.iter().find(|pilot| pilot.chosen);
    let untried = || {
        let candidates = pilot::focused(scene).iter().chain(&[Candidate::DEFAULT]);
        candidates.copied().find(|candidate| make(*candidate).is_some()).unwrap_or(Candidate::GATHERING)
    };
    let candidate = chosen.map_or_else(untried, |chosen| chosen.candidate);
    let settings = make(candidate)?;
    let saving = |weighed: Weighed| weighed.saving(&pilot.cost, candidate, &settings, pilot.pixels);
    let weights = weighed.into_iter().map(saving).collect();
    let seconds_per_iteration = pilot.cost.of_film(candidate, &settings, camera);
    let spent = TimeSpent { seconds: clock.seconds(), cpu_seconds: cpu_seconds() - cpu_start };
    Some(Choice { settings, candidate, pilots, weights, reason, seconds_per_iteration, spent })
}

/// Core-seconds that an iteration is taken to cost, by counted work.
pub fn counted_cost(scene: &Scene, camera: &Camera, candidate: Candidate, settings: &Settings) -> f64 {
    let stage = RenderInput::new(scene, camera, settings);
    let session = Session::new(&stage);
    Cost::count(scene, camera, settings, session.guide()).of_film(candidate, settings, camera)
}

/// What an iteration of a film costs, by counted work, over what it would cost if the film were the whole picture.
pub fn window_cost_ratio(scene: &Scene, camera: &Camera, settings: &Settings) -> f64 {
    let [film, whole] = camera.sizes();
    if film == whole || !settings.method.walks_whole_picture() {
        return 1.0;
    }
    let candidate = Candidate::unguided(settings.method);
    let cost = Cost::count(scene, camera, settings, None);
    cost.of_film(candidate, settings, camera) / cost.of(candidate, settings, f64::from(film.0) * f64::from(film.1))
}
