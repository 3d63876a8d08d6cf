//! Accuracy against time.

use crate::error::{raised, usage};
use crate::image::{Image, picture};
use crate::job;
use crate::keywords::{Keywords, choice};
use crate::value::to_python;
use crate::work::{Caller, work};
use caustique::camera::Camera;
use caustique::error::Result;
use caustique::finish::Finish;
use caustique::options::{MethodChoice, RenderOptions, SceneOptions};
use caustique::pipeline::check::check_settings;
use caustique::pipeline::choose::{Chosen, choose};
use caustique::pipeline::plan::{self, PlanInput};
use caustique::pipeline::{Loaded, OpenFinish, finish, memory, with_light_paths};
use caustique::plan::{Effect, Presence};
use caustique::render::{Control, Method, Settings};
use caustique::report::crop::Look;
use caustique::report::data;
use caustique::report::entry::{Entry, Metric};
use caustique::report::equal_time::{Participants, Rules, render_in_turns};
use caustique::report::reference::{Halves, Reference};
use caustique::report::summary::{ReportOptions, Subject, summarize};
use caustique::scene::View;
use caustique::stat::sum::MAX_TERMS;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict};
use serde_json::{Value, json};
use std::ops::Bound::{Excluded, Unbounded};
use std::path::Path;
use std::sync::Arc;

/// Seconds of each run where nothing says when to stop, as on the command line.
const DEFAULT_TIME: f64 = 60.0;
/// Options of a render that all runs have in common.
const COMMON: [&str; 10] =
    ["seed", "max_depth", "iterations", "time", "target_error", "width", "height", "camera", "crop", "filter"];
/// Methods where none are named, as there.
const USUAL: [&str; 4] = ["path", "sppm", "cppm", "vcm"];

/// A run and how it was asked for.
struct Run {
    name: String,
    options: RenderOptions,
}

/// A comparison that is asked for.
struct Comparison {
    runs: Vec<Run>,
    /// Seed, longest path and ends, which all runs have in common.
    common: RenderOptions,
    moments: f64,
    seeds: u64,
    metric: Metric,
    /// How a reference is made, where none is given.
    own: Own,
}

/// A reference to be made.
struct Own {
    method: Option<Method>,
    iterations: Option<u64>,
    time: Option<f64>,
}

/// The scene that methods are compared on.
pub struct Compared<'a> {
    pub path: &'a Path,
    pub loaded: &'a Loaded,
    /// The options that the scene was read with.
    pub asked: &'a SceneOptions,
}

/// The method `converge` of `Scene`.
pub fn converge<'py>(
    scene: &Compared<'_>,
    py: Python<'py>,
    options: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let mut keywords = Keywords::of(py, "converge", options);
    let given: Option<Bound<'_, PyAny>> = keywords.take("reference")?;
    let (common, _) = job::take(&mut keywords, &job::named(&COMMON), scene.asked)?;
    let own = Own {
        method: keywords.choice::<MethodChoice>("reference_method")?.and_then(|method| method.0),
        iterations: keywords.number("reference_iterations", 1..=MAX_TERMS, "a whole number above 0")?,
        time: keywords.number("reference_time", (Excluded(0.0), Unbounded), "a number of seconds above 0")?,
    };
    let comparison = Comparison {
        runs: runs(py, &mut keywords, &common)?,
        common,
        moments: keywords
            .number("moments", 1.001..=10.0, "a ratio from 1.001 to 10")?
            .unwrap_or(std::f64::consts::SQRT_2),
        seeds: keywords.number("seeds", 1..=1000, "from 1 to 1000")?.unwrap_or(1),
        metric: keywords.choice("metric")?.unwrap_or_default(),
        own,
    };
    let threads = keywords.take("threads")?.unwrap_or(0);
    let progress = keywords.take::<Py<PyAny>>("progress")?.map(Arc::new);
    keywords.finish()?;
    let camera = scene.loaded.scene.camera(&comparison.common.camera_request().map_err(raised)?).map_err(raised)?;
    let reference = given.map(|given| reference(&given, camera.size())).transpose()?;
    let settled = comparison.settle()?;
    let done = work(py, threads, |caller| {
        let told = ErrorCoverage { caller, progress };
        comparison.run((scene, &camera), settled, reference, &told)
    })?;
    to_python(py, &done.whole()?)
}

/// Runs by method and by name.
fn runs(py: Python<'_>, keywords: &mut Keywords<'_>, common: &RenderOptions) -> PyResult<Vec<Run>> {
    let methods: Option<Vec<String>> = keywords.take("methods")?;
    let named: Option<Bound<'_, PyDict>> = keywords.take("runs")?;
    let usual = || if named.is_none() { USUAL.map(String::from).to_vec() } else { Vec::new() };
    let mut runs = Vec::new();
    for name in methods.unwrap_or_else(usual) {
        let method: MethodChoice = choice("converge: methods", &name)?;
        runs.push(Run { options: with(single(method)?, common), name });
    }
    for (name, options) in named.iter().flat_map(|named| named.iter()) {
        let mut options = Keywords::of(py, "run", Some(options.cast::<PyDict>()?));
        let (asked, _) = job::take(&mut options, &job::of_run(), &common.scene)?;
        options.finish()?;
        runs.push(Run { name: name.extract()?, options: with(asked, common) });
    }
    match (1..runs.len()).find(|&run| runs[..run].iter().any(|other| other.name == runs[run].name)) {
        Some(twice) => Err(usage(
            format!("two runs are called '{}'", runs[twice].name),
            "give each a name of its own in runs={...}",
        )),
        None => Ok(runs),
    }
}

/// A method with one level and no finish.
fn single(method: MethodChoice) -> PyResult<RenderOptions> {
    job::single(method.name(), method.0.is_none_or(Method::has_levels))
}

/// A run's options with those that all runs have in common.
fn with(run: RenderOptions, common: &RenderOptions) -> RenderOptions {
    let RenderOptions { seed, frame_seed, max_depth, iterations, time, target_error, .. } = *common;
    RenderOptions { seed, frame_seed, max_depth, iterations, time, target_error, scene: common.scene.clone(), ..run }
}

/// A reference that is given: an image, a file, or an array (H, W, 3).
fn reference(given: &Bound<'_, PyAny>, size: (u32, u32)) -> PyResult<Reference> {
    let header = given.cast::<Image>().ok().and_then(|image| image.get().attributes.object()).unwrap_or(Value::Null);
    let set = picture("reference", given, None)?;
    Reference::of(&set, &header, size, "reference".into()).map_err(raised)
}

/// Who is told how it goes.
struct ErrorCoverage<'a> {
    caller: &'a Caller,
    progress: Option<Arc<Py<PyAny>>>,
}

impl ErrorCoverage<'_> {
    /// Tells, and whether to go on.
    fn tell(&self, state: Value) -> Control {
        if let Some(callback) = self.progress.clone() {
            self.caller.ask(move |py| {
                let answer = callback.call1(py, (to_python(py, &state)?,))?;
                Ok(!answer.bind(py).is(PyBool::new(py, false)))
            });
        }
        if self.caller.stops() { Control::Stop } else { Control::Continue }
    }
}

impl Comparison {
    /// Settings of all runs, and those of a reference, as far as they do not depend on the scene.
    fn settle(&self) -> PyResult<(Vec<Settings>, Settings)> {
        let of = |options: &RenderOptions| options.settings().map_err(raised);
        let settings = self.runs.iter().map(|run| of(&run.options)).collect::<PyResult<_>>()?;
        let method = self.own.method.unwrap_or(Method::Vcm);
        if method.has_one_map() {
            return Err(usage("pm does not converge: it makes no reference", "choose another reference_method"));
        }
        Ok((settings, of(&with(single(MethodChoice(Some(method)))?, &self.common))?))
    }

    /// Seconds of each run.
    fn time(&self) -> Option<f64> {
        self.common.time.or(self.common.iterations.is_none().then_some(DEFAULT_TIME))
    }

    fn run(
        self,
        (scene, camera): (&Compared<'_>, &Camera),
        (settings, own): (Vec<Settings>, Settings),
        reference: Option<Reference>,
        told: &ErrorCoverage<'_>,
    ) -> Result<Value> {
        let built = &scene.loaded.scene;
        for of in &settings {
            check_settings(of, scene.path, built)?;
        }
        let (entries, mut finishes) = self.entries((scene, camera), settings, told)?;
        memory::check_all(View::new(built, camera), entries.iter().map(|entry| &entry.settings))?;
        let reference = reference.unwrap_or_else(|| self.make(own, View::new(built, camera), told));
        let RenderOptions { seed, iterations, .. } = self.common;
        let rules = Rules {
            time: self.time(),
            iterations,
            ratio: self.moments,
            extra_moments: Vec::new(),
            seeds: (0..self.seeds).map(|i| seed.wrapping_add(i)).collect(),
        };
        // Where pictures of the race are kept meanwhile.
        let folder = caustique::temporary::create_folder("caustique-")?;
        let view = View::new(built, camera);
        let participants = Participants { entries: &entries, finishes: &mut finishes, peers: None };
        let mut outcome = render_in_turns(view, participants, &rules, &reference, folder.path(), |step| {
            told.tell(json!({
                "run": step.name,
                "iterations": step.iterations,
                "seconds": step.seconds,
                "fraction": step.fraction,
                "relmse": step.point.map(|point| point.errors.relmse),
            }))
        })?;
        let subject = Subject {
            scene: scene.path.display().to_string(),
            size: camera.size(),
            machine: Vec::new(),
            settings: Vec::new(),
            metric: self.metric,
            lines: outcome.lines.clone(),
            peers: Vec::new(),
            entries,
            rules,
            reference,
        };
        let look = Look { exposure: 0.0, tonemap: Default::default() };
        let none =
            ReportOptions { targets: Vec::new(), targets_of: Vec::new(), windows: Vec::new(), look, notes: Vec::new() };
        let summary = summarize(&subject, &mut outcome, &none)?;
        match outcome.failures.pop() {
            Some(error) => Err(error),
            None => Ok(data::json(&subject, &outcome, &summary)),
        }
    }

    /// What competes: with auto settled, and finishes opened.
    fn entries(
        &self,
        (scene, camera): (&Compared<'_>, &Camera),
        settings: Vec<Settings>,
        told: &ErrorCoverage<'_>,
    ) -> Result<(Vec<Entry>, Vec<Option<Finish>>)> {
        let view = View::new(&scene.loaded.scene, camera);
        let (mut entries, mut finishes, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
        for (Run { name, options }, settings) in self.runs.iter().zip(settings) {
            let settings = with_light_paths(settings, options.photons, camera.size());
            let limited = RenderOptions { time: self.time(), ..options.clone() };
            let mut method = limited.method_request()?;
            let chosen = choose(&mut method, settings, view, |_| true, || told.caller.stops());
            let decided = chosen.spent();
            let (max_depth, switches) = (self.common.max_depth, scene.asked.switches());
            let plan = plan::plan(PlanInput { chosen: &chosen, max_depth, switches }, view, &scene.loaded.removed);
            let Chosen { settings, .. } = chosen;
            warnings
                .extend(plan.warnings.into_iter().filter(|warning| !warnings.contains(warning)).collect::<Vec<_>>());
            let request = (!options.no_finish).then(|| options.finish.request());
            let opened = request.map(|request| finish::open(&request, Some(settings.levels.count))).transpose()?;
            let missing = opened.as_ref().and_then(|finish| finish.missing.as_ref());
            warnings.extend(missing.map(job::missing));
            let settings = Settings { iterations: None, time: None, ..settings };
            let finish = opened.as_ref().map(OpenFinish::name);
            entries.push(Entry { name: name.clone(), options: String::new(), settings, decided, finish });
            finishes.push(opened.map(OpenFinish::into_finish));
        }
        told.caller.warn(&warnings);
        Ok((entries, finishes))
    }

    /// Makes a reference: two halves.
    fn make(&self, settings: Settings, View { scene, camera }: View<'_>, told: &ErrorCoverage<'_>) -> Reference {
        let seen_through_glass = Presence::of(scene, camera).has(Effect::Sds);
        let plain = self.own.method.is_none() && !seen_through_glass;
        let method = if plain { Method::Bdpt } else { settings.method };
        let ends = match (self.own.iterations, self.own.time) {
            (None, None) => match self.time() {
                Some(time) => (None, Some(8.0 * time)),
                None => (self.common.iterations.map(|n| n.saturating_mul(16).max(2)), None),
            },
            asked => asked,
        };
        let settings = Settings { method, iterations: ends.0, time: ends.1, target_error: None, ..settings };
        let settings = with_light_paths(settings, None, camera.size());
        let halves = Halves::render(scene, camera, &settings, |iterations, seconds| {
            told.tell(json!({"run": null, "iterations": iterations, "seconds": seconds}))
        });
        halves.reference()
    }
}
