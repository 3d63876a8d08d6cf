//! Compares methods by their accuracy against time.

use crate::error::{raised, usage};
use crate::image::{Image, picture};
use crate::keywords::{Keywords, choice};
use crate::options;
use crate::value::to_python;
use crate::work::{Caller, work};
use caustique::camera::Camera;
use caustique::error::Result;
use caustique::finish::Finish;
use caustique::image::tonemap::Look;
use caustique::options::{RenderOptions, SceneOptions};
use caustique::path_class::Effect;
use caustique::pipeline::check::check_settings;
use caustique::pipeline::choose::{Chosen, choose};
use caustique::pipeline::learn::Learnt;
use caustique::pipeline::plan::{self, PlanInput};
use caustique::pipeline::{Loaded, OpenFinish, finish, memory};
use caustique::plan::Presence;
use caustique::render::{Control, Method, MethodChoice, Settings, SettingsRequest, TimeSpent};
use caustique::report::data;
use caustique::report::entry::{Entry, Metric};
use caustique::report::equal_time::{Participants, Rules, render_in_turns};
use caustique::report::inside::shows_glass_or_mirror;
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

/// Seconds of each run if no argument limits it, as on the command line.
const DEFAULT_TIME: f64 = 60.0;
/// Names of the options of a render that all runs of a comparison share.
const SHARED_OPTIONS: [&str; 10] =
    ["seed", "max_depth", "iterations", "time", "target_error", "width", "height", "camera", "crop", "filter"];
/// Names of the methods that are compared if the caller names no runs, as on the command line.
const DEFAULT_METHODS: [&str; 4] = ["path", "sppm", "cppm", "vcm"];

/// A run of a comparison: its name and the options of its render.
struct Run {
    name: String,
    options: RenderOptions,
}

/// The arguments of a comparison of methods, from Python.
struct Comparison {
    runs: Vec<Run>,
    /// Options that all runs share: seed, longest path and limits.
    common: RenderOptions,
    moments: f64,
    seeds: u64,
    metric: Metric,
    /// Method and limits for rendering a reference, if the caller gives none.
    reference: ReferenceOptions,
}

/// Method and limits for rendering a reference picture.
struct ReferenceOptions {
    method: Option<Method>,
    iterations: Option<u64>,
    time: Option<f64>,
}

/// The scene in which methods are compared.
pub struct Compared<'a> {
    pub path: &'a Path,
    pub loaded: &'a Loaded,
    /// The options that the scene was read with.
    pub options: &'a SceneOptions,
}

/// Implements the method `converge` of `Scene`.
pub fn converge<'py>(
    scene: &Compared<'_>,
    py: Python<'py>,
    options: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let mut keywords = Keywords::of(py, "converge", options);
    let given: Option<Bound<'_, PyAny>> = keywords.take("reference")?;
    let (common, _) = options::take(&mut keywords, &options::named(&SHARED_OPTIONS), scene.options)?;
    let reference_options = ReferenceOptions {
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
        reference: reference_options,
    };
    let threads = keywords.take("threads")?.unwrap_or(0);
    let progress = keywords.take::<Py<PyAny>>("progress")?.map(Arc::new);
    keywords.check_all_taken()?;
    let camera = scene.loaded.scene.camera(&comparison.common.camera_request().map_err(raised)?).map_err(raised)?;
    let reference = given.map(|given| reference(&given, camera.size())).transpose()?;
    let (settings, own) = comparison.settings()?;
    let done = work(py, threads, |caller| {
        let callback = Callback { caller, progress };
        comparison.run(scene, &camera, settings, own, reference, &callback)
    })?;
    to_python(py, &done.whole()?)
}

/// The runs that the arguments `methods` and `runs` name.
fn runs(py: Python<'_>, keywords: &mut Keywords<'_>, common: &RenderOptions) -> PyResult<Vec<Run>> {
    let methods: Option<Vec<String>> = keywords.take("methods")?;
    let named: Option<Bound<'_, PyDict>> = keywords.take("runs")?;
    let default = || if named.is_none() { DEFAULT_METHODS.map(String::from).to_vec() } else { Vec::new() };
    let mut runs = Vec::new();
    for name in methods.unwrap_or_else(default) {
        let method: MethodChoice = choice("converge: methods", &name)?;
        runs.push(Run { options: with_shared(single(method)?, common), name });
    }
    for (name, options) in named.iter().flat_map(|named| named.iter()) {
        let mut options = Keywords::of(py, "run", Some(options.cast::<PyDict>()?));
        let (render, _) = options::take(&mut options, &options::of_run(), &common.scene)?;
        options.check_all_taken()?;
        runs.push(Run { name: name.extract()?, options: with_shared(render, common) });
    }
    match (1..runs.len()).find(|&run| runs[..run].iter().any(|other| other.name == runs[run].name)) {
        Some(twice) => Err(usage(
            format!("two runs are called '{}'", runs[twice].name),
            "give each a name of its own in runs={...}",
        )),
        None => Ok(runs),
    }
}

/// The options of a method with one level and no finish.
fn single(method: MethodChoice) -> PyResult<RenderOptions> {
    options::single(method.name(), method.0.is_none_or(Method::has_levels))
}

/// The options of a run, completed by the options that all runs share, `common`.
fn with_shared(run: RenderOptions, common: &RenderOptions) -> RenderOptions {
    let SettingsRequest { seed, max_depth, iterations, time, target_error, .. } = common.settings;
    let settings = SettingsRequest { seed, max_depth, iterations, time, target_error, ..run.settings };
    RenderOptions { settings, frame_seed: common.frame_seed, scene: common.scene.clone(), ..run }
}

/// Reads a reference picture of this size from an image, a file, or an array (H, W, 3).
fn reference(given: &Bound<'_, PyAny>, size: (u32, u32)) -> PyResult<Reference> {
    let header = given.cast::<Image>().ok().and_then(|image| image.get().attributes.object()).unwrap_or(Value::Null);
    let set = picture("reference", given, None)?;
    Reference::of(&set, &header, size, "reference".into()).map_err(raised)
}

/// Calls the user's Python function after each step of a comparison.
struct Callback<'a> {
    caller: &'a Caller,
    progress: Option<Arc<Py<PyAny>>>,
}

impl Callback<'_> {
    /// Calls the user's function with the comparison's state as a dict. Returns whether to continue.
    fn call(&self, state: Value) -> Control {
        if let Some(callback) = self.progress.clone() {
            self.caller.run(move |py| {
                let answer = callback.call1(py, (to_python(py, &state)?,))?;
                Ok(!answer.bind(py).is(PyBool::new(py, false)))
            });
        }
        if self.caller.stops() { Control::Stop } else { Control::Continue }
    }
}

impl Comparison {
    /// Settings of all runs, and of the reference, before the size of the picture and the choices of `auto`.
    fn settings(&self) -> PyResult<(Vec<Settings>, Settings)> {
        let of = |options: &RenderOptions| options.settings_request().resolve().map_err(raised);
        let settings = self.runs.iter().map(|run| of(&run.options)).collect::<PyResult<_>>()?;
        let method = self.reference.method.unwrap_or(Method::Vcm);
        if method.has_one_map() {
            return Err(usage("pm does not converge: it makes no reference", "choose another reference_method"));
        }
        Ok((settings, of(&with_shared(single(MethodChoice(Some(method)))?, &self.common))?))
    }

    /// Time limit of each run in seconds; `None`: only the iterations are limited.
    fn time(&self) -> Option<f64> {
        self.common.settings.time.or(self.common.settings.iterations.is_none().then_some(DEFAULT_TIME))
    }

    fn run(
        self,
        scene: &Compared<'_>,
        camera: &Camera,
        settings: Vec<Settings>,
        own: Settings,
        reference: Option<Reference>,
        callback: &Callback<'_>,
    ) -> Result<Value> {
        let built = &scene.loaded.scene;
        for of in &settings {
            check_settings(of, scene.path, built)?;
        }
        let learnt = Learnt::new(View::new(built, camera), &own, &callback.caller.stop());
        let seen = built.with_learnt(&learnt.light);
        let view = View::new(seen.as_ref().unwrap_or(built), camera);
        let (entries, mut finishes) = self.entries(scene, view, settings, learnt.spent, callback)?;
        let denoisers = self.runs.iter().map(|run| (!run.options.no_finish).then_some(run.options.finish.denoise));
        memory::check_all(view, entries.iter().map(|entry| &entry.settings).zip(denoisers))?;
        let reference = reference.unwrap_or_else(|| self.render_reference(own, view, callback));
        let SettingsRequest { seed, iterations, .. } = self.common.settings;
        let rules = Rules {
            time: self.time(),
            iterations,
            ratio: self.moments,
            extra_moments: Vec::new(),
            seeds: (0..self.seeds).map(|i| seed.wrapping_add(i)).collect(),
        };
        // Keeps the pictures of the runs until the errors are known.
        let folder = caustique::temporary::create_folder("caustique-")?;
        let participants = Participants { entries: &entries, finishes: &mut finishes, peers: None };
        let mut outcome = render_in_turns(view, participants, &rules, &reference, folder.path(), |step| {
            callback.call(json!({
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
            inside: shows_glass_or_mirror(view),
        };
        let look = Look::default();
        let none =
            ReportOptions { targets: Vec::new(), targets_of: Vec::new(), windows: Vec::new(), look, notes: Vec::new() };
        let summary = summarize(&subject, &mut outcome, &none)?;
        match outcome.failures.pop() {
            Some(error) => Err(error),
            None => Ok(data::json(&subject, &outcome, &summary)),
        }
    }

    /// Settles the methods by `auto`, opens the finishes, and issues the warnings of the plans.
    fn entries(
        &self,
        scene: &Compared<'_>,
        view: View<'_>,
        settings: Vec<Settings>,
        learning: TimeSpent,
        callback: &Callback<'_>,
    ) -> Result<(Vec<Entry>, Vec<Option<Finish>>)> {
        let (mut entries, mut finishes, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
        for (Run { name, options }, settings) in self.runs.iter().zip(settings) {
            let settings = settings.with_light_paths(options.settings.photons, view.camera.size());
            let limited = SettingsRequest { time: self.time(), ..options.settings_request() };
            let chosen = choose(&limited, settings, view, |_| true, &callback.caller.stop());
            let chosen = Chosen { learning, ..chosen };
            let decided = chosen.spent();
            let (max_depth, switches) = (self.common.settings.max_depth, scene.options.switches());
            let plan = plan::plan(PlanInput { chosen: &chosen, max_depth, switches }, view, &scene.loaded.removed);
            let Chosen { settings, .. } = chosen;
            warnings
                .extend(plan.warnings.into_iter().filter(|warning| !warnings.contains(warning)).collect::<Vec<_>>());
            let request = (!options.no_finish).then(|| options.finish.request());
            let opened = request.map(|request| finish::open(&request, Some(settings.levels.count))).transpose()?;
            let missing = opened.as_ref().and_then(|finish| finish.missing.as_ref());
            warnings.extend(missing.map(finish::missing_denoiser));
            let settings = Settings { iterations: None, time: None, ..settings };
            let finish = opened.as_ref().map(OpenFinish::name);
            entries.push(Entry { name: name.clone(), options: String::new(), settings, decided, finish });
            finishes.push(opened.map(OpenFinish::into_finish));
        }
        callback.caller.warn(&warnings);
        Ok((entries, finishes))
    }

    /// Renders a reference picture in two independent halves, which give its own error.
    fn render_reference(
        &self,
        settings: Settings,
        View { scene, camera }: View<'_>,
        callback: &Callback<'_>,
    ) -> Reference {
        let seen_through_glass = Presence::of(scene, camera).has(Effect::Sds);
        let plain = self.reference.method.is_none() && !seen_through_glass;
        let method = if plain { Method::Bdpt } else { settings.method };
        let ends = match (self.reference.iterations, self.reference.time) {
            (None, None) => match self.time() {
                Some(time) => (None, Some(8.0 * time)),
                None => (self.common.settings.iterations.map(|n| n.saturating_mul(16).max(2)), None),
            },
            limits => limits,
        };
        let settings = Settings { method, iterations: ends.0, time: ends.1, target_error: None, ..settings };
        let settings = settings.with_light_paths(None, camera.size());
        let halves = Halves::render(scene, camera, &settings, |iterations, seconds| {
            callback.call(json!({"run": null, "iterations": iterations, "seconds": seconds}))
        });
        halves.reference()
    }
}
