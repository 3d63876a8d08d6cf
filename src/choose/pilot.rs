//! Candidates of a scene, and the pilot that estimates the noise of each: size of its picture, and iterations.

use super::pilot_settings::{EFFECTS_PHOTON_SHARE, pilot_settings};
use super::trial::{self, Trial};
use super::weights::{self, WeighedEffect};
use crate::camera::Camera;
use crate::path_class::Effect;
use crate::plan::Presence;
use crate::render::{Candidate, Cost, Counts, DEFAULT_ITERATIONS, Method, Proxy, Settings};
use crate::scene::{Scene, View};

/// Share of the render's work that the pilot (a proxy render in a small picture) and the measurement of effects may take
/// together.
const PILOT_WORK_SHARE: f64 = 0.05;
/// Share of [`PILOT_WORK_SHARE`] that the measurement of effects may take.
const EFFECTS_WORK_SHARE: f64 = 0.2;
/// Share of the render's work that the pilot may take with the trials, or if it is the smallest possible one. It is larger
/// than [`PILOT_WORK_SHARE`] because in a short render a wrong choice costs more than a pilot.
const MAX_PILOT_WORK_SHARE: f64 = 0.1;
/// Smallest number of pixels of a pilot's picture.
const MIN_PIXELS: f64 = 1024.0;
/// Largest number of pixels of a pilot's picture: more would leave fewer iterations.
const MAX_PIXELS: f64 = 16384.0;
/// Number of pixels of the pictures that measure the effects of a scene.
const EFFECTS_PIXELS: f64 = 768.0;
/// Smallest number of iterations of a pilot.
const MIN_ITERATIONS: u64 = 4;
/// Largest number of iterations of a pilot.
const MAX_ITERATIONS: u64 = 256;
/// Number of iterations of a pilot whose picture has neither the smallest nor the largest size.
const ITERATIONS: f64 = 16.0;
/// Work of an iteration of a pilot, which finds three weights of every path, over that of a render's iteration.
const PILOT_COST: f64 = 4.0;
/// Share of the render's work that trials of the best candidates may take together.
const TRIALS_WORK_SHARE: f64 = 0.04;
/// Largest share of the picture's light that a candidate may sample poorly and have a trial. A trial that misses light
/// looks better than one that finds it.
const MAX_POORLY_SAMPLED: f64 = 0.02;
/// Numbers of light paths per pixel that are compared, in sixteenths.
const LIGHT_PATHS: [u32; 7] = [1, 2, 4, 8, 16, 32, 64];
/// Numbers of connections that are compared.
const CONNECTIONS: [u32; 4] = [0, 1, 2, 4];
/// Core-seconds that one second of the time limit `--time` counts as, on every machine, unless the user names a number of
/// threads. It is small, so that on most machines pilots take less than their share; on one core they take twice their
/// share.
const ASSUMED_CORES: f64 = 2.0;
/// Largest share of the time limit that an iteration may take, so that a picture has the iterations that its finish and
/// its error estimate need.
const MAX_ITERATION_SHARE: f64 = 1.0 / 16.0;
/// Largest cost of an iteration relative to the cheapest one, if all take more than [`MAX_ITERATION_SHARE`].
const MAX_LONG_RATIO: f64 = 2.0;
/// Largest cost of an iteration relative to the cheapest one that is not too long for a render without a pilot. The cost
/// of connections grows with the square of the length of paths, which closed white rooms make thousands of segments.
pub(super) const MAX_COST_RATIO: f64 = 16.0;
/// Numbers of samples of cheaper and cheaper candidates, for renders that are too short for a pilot.
const CHEAPER: [Counts; 6] = [
    Counts { light_paths: 8, ..Counts::DEFAULT },
    Counts { light_paths: 4, ..Counts::DEFAULT },
    Counts { light_paths: 2, ..Counts::DEFAULT },
    Counts { light_paths: 1, ..Counts::DEFAULT },
    Counts { light_paths: 1, connections: 0, merging: 1.0 },
    Counts::PATHS,
];
/// Most core-seconds that a render without limits of time and iterations counts as. It counts as one of
/// [`DEFAULT_ITERATIONS`] iterations, because the work until a target error is unknown.
const UNLIMITED_CORE_SECONDS: f64 = 1000.0;

/// Numbers of samples that are compared: each number of light paths with each number of connections, with and without
/// merging, and path tracing.
fn all_counts() -> Vec<Counts> {
    let mut all = vec![Counts::PATHS];
    for light_paths in LIGHT_PATHS {
        for connections in CONNECTIONS {
            all.extend([1.0, 0.0].map(|merging| Counts { light_paths, connections, merging }));
        }
    }
    all
}

/// Result of the pilot for a candidate.
#[derive(Clone, Copy, Debug)]
pub struct PilotResult {
    /// The candidate (method and settings).
    pub candidate: Candidate,
    /// Expected squared relative noise of the render before the finish: the relative variance of an iteration over the
    /// number of iterations. Infinite if the candidate misses light.
    pub squared_error: f64,
    /// Core-seconds of an iteration of the whole picture, predicted from counted vertices.
    pub seconds_per_iteration: f64,
    /// Share of the picture's light that the candidate samples so rarely that a trial may miss it.
    pub(super) poorly_sampled: f64,
    /// Whether `auto` has chosen this candidate for the render.
    pub chosen: bool,
}

impl PilotResult {
    /// The expected relative noise: the root of [`PilotResult::squared_error`].
    pub fn error(&self) -> f64 {
        self.squared_error.sqrt()
    }
}

/// Candidates (methods with settings) for a scene where glass or mirrors focus light, the best one first; empty for
/// other scenes.
pub(super) fn candidates_for_focused_light(scene: &Scene) -> &'static [Candidate] {
    if scene.lights.targets().spheres().is_empty() {
        &[]
    } else if default_misses_light(scene) {
        &[Candidate::GUIDED_GATHERING, Candidate::GATHERING, Candidate::GUIDED, Candidate::DEFAULT]
    } else {
        &[Candidate::GUIDED, Candidate::DEFAULT]
    }
}

/// Whether the default candidate misses caustics behind glass or in mirrors that guided photons find.
pub(super) fn default_misses_light(scene: &Scene) -> bool {
    !Method::Vcm.search().finds(Effect::Sds, &scene.survey)
}

/// Core-seconds that one second of the time limit counts as. Shards of a render choose the same method, with any numbers
/// of threads.
fn cores(settings: &Settings) -> f64 {
    if settings.threads == 0 || settings.shard.count > 1 { ASSUMED_CORES } else { settings.threads as f64 }
}

fn pixel_count(camera: &Camera) -> f64 {
    let (width, height) = camera.size();
    f64::from(width) * f64::from(height)
}

/// Plans and runs the pilot of a render, by which `auto` chooses numbers of samples.
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

impl<'a> Pilot<'a> {
    pub fn new(view: View<'a>, gathering: &'a Settings) -> Pilot<'a> {
        let pixels = pixel_count(view.camera);
        let cost = Cost::count(view.scene, view.camera, gathering, None);
        let seconds = |candidate: Candidate| {
            let settings = Settings { method: candidate.method, ..gathering.clone() };
            cost.iteration_seconds(candidate, &settings, pixels)
        };
        let longest = MAX_COST_RATIO * seconds(Candidate::CAMERA_PATHS);
        let work = |n: u64| n as f64 * seconds(Candidate::DEFAULT).min(longest);
        let within_time = gathering.time.map(|seconds| seconds * cores(gathering));
        let budget = match (gathering.iterations, within_time) {
            (Some(n), limit) => limit.map_or(work(n), |limit| work(n).min(limit)),
            (None, Some(limit)) => limit,
            (None, None) => work(DEFAULT_ITERATIONS).min(UNLIMITED_CORE_SECONDS),
        };
        Pilot { view, gathering, cost, pixels, budget }
    }

    /// Largest core-seconds of an iteration of a candidate, if the cheapest candidate takes `least` and the pilot
    /// `pilot`; infinite without a time limit.
    pub fn longest_iteration(&self, least: f64, pilot: f64) -> f64 {
        let limit = |seconds: f64| MAX_ITERATION_SHARE * (seconds * cores(self.gathering) - pilot);
        self.gathering.time.map_or(f64::INFINITY, |seconds| limit(seconds).max(MAX_LONG_RATIO * least))
    }

    /// Candidates that find all light, each with a cheaper iteration than the one before.
    pub fn cheaper_candidates(
        &self,
        settings_of: &impl Fn(Candidate) -> Option<Settings>,
    ) -> impl Iterator<Item = Candidate> {
        let presence = Presence::of(self.view.scene, self.view.camera);
        let finds_all = move |candidate: &Candidate| {
            settings_of(*candidate).is_some_and(|settings| self.finds_all(settings.method, &presence))
        };
        CHEAPER.into_iter().map(|counts| Candidate::with_counts(counts, false)).filter(finds_all)
    }

    /// Shortest time limit of a render whose pilot measures light effects, in seconds.
    pub fn seconds_to_measure(&self) -> f64 {
        let least = weights::MAX_LIGHT_PICTURES as f64 * self.effects_picture_seconds();
        least / (EFFECTS_WORK_SHARE * PILOT_WORK_SHARE * cores(self.gathering))
    }

    /// Core-seconds of one of the pictures that measure the effects of the scene.
    fn effects_picture_seconds(&self) -> f64 {
        let settings = weights::settings(self.gathering, EFFECTS_PHOTON_SHARE);
        let pixels = EFFECTS_PIXELS.min(self.pixels);
        self.cost.iteration_seconds(Candidate::GATHERING, &settings, pixels) * weights::ITERATIONS as f64
    }

    /// Measures what each effect of the scene adds to the picture. Also returns the predicted core-seconds of the
    /// measurement. If the render is too short for all of it, measures light effects only, or nothing.
    pub fn weigh_effects(&self) -> (Vec<WeighedEffect>, f64) {
        let settings = weights::settings(self.gathering, EFFECTS_PHOTON_SHARE);
        let pixels = EFFECTS_PIXELS.min(self.pixels);
        let picture_seconds = self.effects_picture_seconds();
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
        let weighed = weights::weigh(view, &settings, &presence, &scene_effects, count).unwrap_or_default();
        (weighed, seconds)
    }

    /// Estimates the noise of all candidates of `vcm` with the work that the measurement of effects (`effects_seconds`)
    /// has left. Returns the results of the chosen one and of those that a user would compare it with, or the reason why
    /// there are none.
    pub fn run(
        &self,
        effects_seconds: f64,
        settings_of: &impl Fn(Candidate) -> Option<Settings>,
        late: &dyn Fn() -> bool,
    ) -> (Vec<PilotResult>, Option<&'static str>) {
        let scene = self.view.scene;
        let misses_light = default_misses_light(scene);
        let focused = !candidates_for_focused_light(scene).is_empty();
        if misses_light && focused {
            return (
                Vec::new(),
                Some("a lamp without size shines into cloudy glass, where vcm does not find all light"),
            );
        }
        // Without a guide a pilot may miss the focused light, and would prefer not to look for it.
        let proxy = |guided| Some((guided, settings_of(Candidate::with_counts(Counts::DEFAULT, guided))?));
        let Some((guided, settings)) = proxy(focused).or_else(|| proxy(false)) else {
            return (Vec::new(), Some("the only candidate that these options leave"));
        };
        let Some(size) = self.size(&settings, effects_seconds) else {
            return (Vec::new(), Some("the render is too short to try others"));
        };
        let mut results = self.results(&size, guided, &settings, settings_of, late);
        let complete = results.iter().filter(|result| result.squared_error.is_finite());
        let least = complete.map(|result| result.seconds_per_iteration).fold(f64::INFINITY, f64::min);
        let longest = self.longest_iteration(least, effects_seconds + size.seconds);
        let left = MAX_PILOT_WORK_SHARE * self.budget - effects_seconds - size.seconds;
        let seconds = left.min(TRIALS_WORK_SHARE * self.budget);
        self.try_finalists(&mut results, longest, &size.camera, seconds, settings_of, late);
        (chosen_and_usual(results, longest), None)
    }

    /// Expected noise of all candidates with or without guided light paths, from one proxy render by `settings`; nothing
    /// if the user stops it.
    fn results(
        &self,
        size: &PilotSize,
        guided: bool,
        settings: &Settings,
        settings_of: &impl Fn(Candidate) -> Option<Settings>,
        late: &dyn Fn() -> bool,
    ) -> Vec<PilotResult> {
        let View { scene, camera } = self.view;
        let counts = all_counts();
        let of_pilot = pilot_settings(settings, pixel_count(&size.camera) / self.pixels);
        let seconds = self.cost.film_seconds(Candidate::DEFAULT, settings, camera);
        let proxy = Proxy {
            scene,
            camera: &size.camera,
            settings: &of_pilot,
            render_width: camera.size().0,
            typical_iteration: ((0.5 * self.budget / seconds) as u64).max(1),
            candidates: &counts,
        };
        let guide = proxy.learn_guide();
        // Guided light paths are longer, because most of them meet glass.
        let guided_cost = guide.as_ref().map(|guide| Cost::count(scene, camera, self.gathering, Some(guide)));
        let moments = proxy.measure(guide.as_ref(), size.iterations, late);
        if settings.stop.requested() {
            return Vec::new();
        }
        let (variances, poorly_sampled) = (moments.relative(), moments.poorly_sampled());
        let presence = Presence::of(scene, camera);
        let result = |((counts, variance), poorly_sampled): ((Counts, f64), f64)| {
            let candidate = Candidate::with_counts(counts, guided && counts.light_paths > 0);
            let settings = settings_of(candidate)?;
            let cost = guided_cost.as_ref().filter(|_| candidate.guided).unwrap_or(&self.cost);
            let seconds_per_iteration = cost.film_seconds(candidate, &settings, camera);
            let finds_all = self.finds_all(settings.method, &presence);
            let squared_error = if finds_all { variance * seconds_per_iteration / self.budget } else { f64::INFINITY };
            Some(PilotResult { candidate, squared_error, seconds_per_iteration, poorly_sampled, chosen: false })
        };
        counts.into_iter().zip(variances).zip(poorly_sampled).filter_map(result).collect()
    }

    /// Renders a trial of the best candidate of each [`Kind`], and puts the ratio of their measured errors in the place of
    /// the predicted one. The prediction does not see that camera paths are stratified over the iterations and light
    /// paths are not. The trials take `seconds` core-seconds at most.
    fn try_finalists(
        &self,
        results: &mut [PilotResult],
        longest: f64,
        camera: &Camera,
        seconds: f64,
        settings_of: &impl Fn(Candidate) -> Option<Settings>,
        late: &dyn Fn() -> bool,
    ) {
        let Some(best) = best_of(results, longest, |_| true) else { return };
        let finds_all = |one: &PilotResult| one.squared_error.is_finite() && one.poorly_sampled < MAX_POORLY_SAMPLED;
        let of_kind = |kind| best_of(results, longest, |one| Kind::of(&one.candidate) == kind && finds_all(one));
        let mut finalists: Vec<usize> = Kind::ALL.into_iter().filter_map(of_kind).collect();
        if !finalists.contains(&best) {
            finalists.push(best);
        }
        let (seconds, pixels) = (seconds / finalists.len() as f64, pixel_count(camera));
        let trial = |&index: &usize| {
            let candidate = results[index].candidate;
            let settings = pilot_settings(&settings_of(candidate)?, pixels / self.pixels);
            let iterations = trial::iterations(seconds / self.cost.iteration_seconds(candidate, &settings, pixels))?;
            Some((index, Trial { scene: self.view.scene, camera, settings, iterations }))
        };
        let trials: Vec<(usize, Trial<'_>)> = finalists.iter().filter_map(trial).collect();
        if trials.len() < 2 || trials.iter().all(|(index, _)| *index != best) {
            return;
        }
        let Some(variances) = trial::relative_variances(trials.iter().map(|(_, trial)| trial), late) else { return };
        let errors: Vec<(usize, f64)> = (trials.iter().zip(variances))
            .map(|((index, _), variance)| (*index, variance * results[*index].seconds_per_iteration))
            .collect();
        let own = errors.iter().find(|(index, _)| *index == best).map_or(0.0, |(_, error)| *error);
        let predicted = results[best].squared_error;
        for (index, error) in errors.into_iter().filter(|_| own > 0.0) {
            results[index].squared_error = predicted * error / own;
        }
    }

    /// Whether a method finds all light of the present effects that `vcm` finds. A pilot may miss light that is rare.
    fn finds_all(&self, method: Method, presence: &Presence) -> bool {
        let survey = &self.view.scene.survey;
        Effect::ALL
            .into_iter()
            .filter(|effect| presence.has(*effect))
            .all(|effect| method.search().finds(effect, survey) || !Method::Vcm.search().finds(effect, survey))
    }

    /// Picture and iterations of the proxy; `None` if the smallest one takes too much of the render.
    fn size(&self, settings: &Settings, effects_seconds: f64) -> Option<PilotSize> {
        let [wanted, most] =
            [PILOT_WORK_SHARE, MAX_PILOT_WORK_SHARE].map(|share| share * self.budget - effects_seconds);
        let iteration = |pixels: f64| PILOT_COST * self.cost.iteration_seconds(Candidate::DEFAULT, settings, pixels);
        let least = MIN_PIXELS.min(self.pixels);
        let pixels = (self.pixels * wanted / (ITERATIONS * iteration(self.pixels))).clamp(least, MAX_PIXELS.max(least));
        let pixels = pixels.min(self.pixels);
        let iterations = ((wanted / iteration(pixels)) as u64).clamp(MIN_ITERATIONS, MAX_ITERATIONS);
        let seconds = (iterations + 1) as f64 * iteration(pixels);
        let camera = || self.view.camera.downscale((pixels / self.pixels).sqrt());
        (seconds <= most.max(wanted)).then(|| PilotSize { camera: camera(), iterations, seconds })
    }
}

/// Picture and iterations of a proxy.
struct PilotSize {
    camera: Camera,
    iterations: u64,
    /// Core-seconds of the proxy, predicted from counted vertices.
    seconds: f64,
}

/// The techniques of a candidate besides those of path tracing.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    CameraPaths,
    LightPaths,
    Merges,
}

impl Kind {
    const ALL: [Kind; 3] = [Kind::CameraPaths, Kind::LightPaths, Kind::Merges];

    fn of(candidate: &Candidate) -> Kind {
        match candidate.counts {
            Counts { light_paths: 0, .. } => Kind::CameraPaths,
            Counts { merging: 0.0, .. } => Kind::LightPaths,
            _ => Kind::Merges,
        }
    }
}

/// Index of the result with the least expected error, of those whose iteration takes `longest` core-seconds at most.
fn best_of(results: &[PilotResult], longest: f64, among: impl Fn(&PilotResult) -> bool) -> Option<usize> {
    let allowed = |&index: &usize| results[index].seconds_per_iteration <= longest && among(&results[index]);
    let error = |index: usize| results[index].squared_error;
    (0..results.len()).filter(allowed).min_by(|&a, &b| error(a).total_cmp(&error(b)))
}

/// Marks the result with the least expected error as chosen, of those whose iteration takes `longest` core-seconds at
/// most. Returns it with the results of `vcm`, `path` and `bdpt` by default numbers.
fn chosen_and_usual(mut results: Vec<PilotResult>, longest: f64) -> Vec<PilotResult> {
    if let Some(best) = best_of(&results, longest, |_| true) {
        results[best].chosen = true;
    }
    let without_merging = Counts { merging: 0.0, ..Counts::DEFAULT };
    let usual = [Counts::DEFAULT, without_merging, Counts::PATHS];
    let is_usual = |one: &PilotResult| usual.contains(&one.candidate.counts);
    results.retain(|one| one.chosen || is_usual(one));
    results
}
