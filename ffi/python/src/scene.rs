//! The class `Scene`: reading, planning, rendering and comparing.

use crate::converge::{self, Compared};
use crate::error::{raised, usage};
use crate::image::{Image, radiance};
use crate::keywords::Keywords;
use crate::options;
use crate::progress::Progress;
use crate::value::{to_json, to_python};
use crate::work::{Caller, warn, work};
use caustique::error::Error as Fault;
use caustique::files;
use caustique::film::Naming;
use caustique::image::{Outputs, atomic};
use caustique::options::SceneOptions;
use caustique::pipeline::finish::missing_denoiser;
use caustique::pipeline::load::{Environment, load, load_bytes};
use caustique::pipeline::plan::plan_picture;
use caustique::pipeline::{
    self, Delivery, Event, Loaded, Observer, Request, Saving, SceneRequest, checkpoint, scene_info,
};
use caustique::scene::description::EnvironmentSource;
use caustique::stop::Stop;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBool, PyBytes, PyDict};
use serde_json::{Value, json};
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;

/// A scene that has been read and built. It can be rendered repeatedly, also from several threads at the same time.
#[pyclass(frozen, subclass, module = "caustique")]
pub struct Scene {
    pub(crate) loaded: Loaded,
    pub(crate) path: PathBuf,
    pub(crate) options: SceneOptions,
    identity: Identity,
    /// The arguments of the call that made the scene, with absolute paths: another process can repeat it.
    made_from: (Py<PyAny>, Py<PyDict>),
}

/// Identity of a scene for headers, checkpoints and shards: its options, as JSON, and the file of its environment.
struct Identity {
    options: Value,
    environment: Option<PathBuf>,
    /// Whether the scene was read only from files, so that another process can read the same scene.
    of_files: bool,
}

#[pymethods]
impl Scene {
    /// Reads a scene: a path of a .glb or .gltf file, or the bytes of a .glb.
    #[new]
    #[pyo3(
        signature = (source, **options),
        text_signature = "(source, *, environment=None, environment_rotation=None, environment_strength=None, \
            light_preset=None, background=None, light_units='auto', glass='auto', \
            effects=None, frame=None, frame_rate=None, \
            scene_name=None, animation=None, variant=None, pose='animated', shutter=None, allow_outside=False, strict=False, threads=0)"
    )]
    fn new(py: Python<'_>, source: &Bound<'_, PyAny>, options: Option<&Bound<'_, PyDict>>) -> PyResult<Scene> {
        let mut keywords = Keywords::of(py, "Scene", options);
        let bytes = source.cast::<PyBytes>().ok().map(|bytes| PyBackedBytes::from(bytes.clone()));
        let path = match &bytes {
            Some(_) => PathBuf::from("scene.glb"),
            None => source.extract::<PathBuf>()?,
        };
        let threads = keywords.take("threads")?.unwrap_or(0);
        let environment = keywords.take::<Bound<'_, PyAny>>("environment")?;
        let array = environment.as_ref().map(environment_array).transpose()?.flatten();
        let word = environment.filter(|_| array.is_none()).map(|given| environment_word(&given)).transpose()?;
        let mut scene_options = options::take_scene(&mut keywords, word.into_iter().collect())?;
        keywords.check_all_taken()?;
        if scene_options.frames.is_some_and(|frames| frames.single().is_none()) {
            return Err(usage("Scene: a scene is one frame", "give frame a whole number from 0 up"));
        }
        scene_options.path.clone_from(&path);
        let identity = Identity::of(py, bytes.is_none(), options)?;
        let mut request = scene_options.request();
        request.environment = array.or(request.environment);
        // Whether a render will ask for motion vectors is not known yet.
        request.options.motion_vectors = true;
        let done = work(py, threads, |_| match &bytes {
            Some(bytes) => load_bytes(bytes, &request, rayon::current_num_threads()).map_err(about_arrays),
            None => load(&request, rayon::current_num_threads(), &Stop::default()),
        })?;
        let loaded = done.whole()?;
        if scene_options.strict && !loaded.scene.warnings.is_empty() {
            let list = loaded.scene.warnings.join("\n");
            return Err(usage(format!("strict=True, and something is ignored or approximated:\n{list}"), "mend it"));
        }
        warn(py, &loaded.scene.warnings)?;
        Ok(Scene { loaded, path, options: scene_options, identity, made_from: made_from(source, options)? })
    }

    /// Pickles a scene as its source (the path or the bytes) and its options. Unpickling builds it again.
    fn __reduce__<'py>(this: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Py<PyAny>,))> {
        let (source, options) = &this.get().made_from;
        let partial = this.py().import("functools")?.getattr("partial")?;
        let build = partial.call((this.get_type(),), Some(options.bind(this.py())))?;
        Ok((build, (source.clone_ref(this.py()),)))
    }

    /// Warnings: everything in the scene that is ignored or approximated.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.loaded.scene.warnings.clone()
    }

    /// Names of the cameras. The first is the default.
    #[getter]
    fn cameras(&self) -> Vec<String> {
        self.loaded.scene.cameras.iter().map(|camera| camera.name.clone()).collect()
    }

    /// The scenes, animations, material variants and extensions of the file, and the index of the scene that was read.
    #[getter]
    fn contents<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &json!(self.loaded.scene.contents))
    }

    // The signature and the text are generated from the definitions of the options: scripts/generate.sh.
    #[doc = include_str!("render.txt")]
    #[pyo3(signature = (**options), text_signature = None)]
    fn render(&self, py: Python<'_>, options: Option<&Bound<'_, PyDict>>) -> PyResult<Image> {
        let mut keywords = Keywords::of(py, "render", options);
        let threads = keywords.take("threads")?.unwrap_or(0);
        let progress: Option<Py<PyAny>> = keywords.take("progress")?;
        let (render, run) = options::take(&mut keywords, &options::of_render(), &self.options)?;
        keywords.check_all_taken()?;
        let saving = run.saving(None);
        saving.iter().try_for_each(|saving| atomic::check_writable(&saving.path)).map_err(raised)?;
        let outputs = Outputs::new(saving.iter().map(|saving| saving.path.clone())).map_err(raised)?;
        outputs.check(self.loaded.scene.files.iter().map(PathBuf::as_path)).map_err(raised)?;
        let goes_on = |saving: &Saving| run.resume.as_ref().is_some_and(|resume| files::is_same(resume, &saving.path));
        if let Some(Saving { path, .. }) = saving.as_ref().filter(|saving| !goes_on(saving)) {
            let remedy = format!("go on with resume='{}', or start anew with overwrite=True", path.display());
            checkpoint::check_replaceable(path, run.overwrite, &remedy).map_err(raised)?;
        }
        if !self.identity.of_files && (render.settings.shard.is_some() || saving.is_some() || run.resume.is_some()) {
            let cause = "render: shard, checkpoint and resume need a scene that another process can read";
            return Err(usage(
                cause,
                "write caustique.pack's bytes and an environment's array to files, and read them",
            ));
        }
        let layers = run.selection().map_err(raised)?;
        let arguments = self.arguments(py, options)?;
        let progress = progress.map(Arc::new);
        let done = work(py, threads, |caller| {
            let mut picture = render.picture_request()?;
            picture.settings.threads = threads;
            let request = Request {
                scene: self.request(),
                picture,
                finish: (!render.no_finish).then(|| render.finish.request()),
                layers,
                naming: Naming::Plain,
                arguments,
                reproducible: run.reproducible,
                memory: run.memory_limit(),
                saving,
                resume: run.resume.clone(),
            };
            pipeline::render_loaded(request, &self.loaded, &mut CallerReports { caller, progress })
        })?;
        let delivery = match (done.result, done.raised) {
            (Ok(delivery), None) => delivery,
            (Ok(delivery), Some(error)) => {
                // The exception that stopped the render carries the picture so far.
                let (image, _) = Image::of(delivery);
                error.value(py).setattr("image", Bound::new(py, image)?)?;
                return Err(error);
            }
            (Err(_), Some(error)) => return Err(error),
            (Err(error), None) => return Err(raised(error)),
        };
        delivered(py, delivery)
    }

    /// Objects, materials, lights and the rest of the scene: what `caustique info --json` prints, as a dict.
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &scene_info(&self.path, &self.loaded.scene))
    }

    #[doc = include_str!("plan.txt")]
    #[pyo3(signature = (**options), text_signature = None)]
    fn plan<'py>(&self, py: Python<'py>, options: Option<&Bound<'py, PyDict>>) -> PyResult<Bound<'py, PyAny>> {
        let mut keywords = Keywords::of(py, "plan", options);
        let threads = keywords.take("threads")?.unwrap_or(0);
        let (render, _) = options::take(&mut keywords, &options::of_plan(), &self.options)?;
        keywords.check_all_taken()?;
        let done = work(py, threads, |caller| {
            let mut picture = render.picture_request()?;
            picture.settings.threads = threads;
            let planned = plan_picture(&picture, &self.path, &self.loaded, &caller.stop())?;
            Ok(json!(planned.plan))
        })?;
        to_python(py, &done.whole()?)
    }

    /// Compares methods by their accuracy against time: the object of `points.json` of `caustique converge`, a dict.
    ///
    /// methods                   names of methods, with their defaults, one bandwidth level and no finish
    /// runs                      {name: options of render about the method or the finish}
    /// iterations, time          limits of each run; 60 seconds if neither is given
    /// reference                 an Image, a path, or an array (H, W, 3); rendered if missing
    /// reference_method, reference_iterations, reference_time
    ///                           options of the two halves of a rendered reference
    /// metric                    'relmse', 'relmse_trimmed' or 'mse'
    /// moments                   factor between the iterations of two measurements; sqrt(2) by default
    /// seed, seeds               the first seed, and the number of seeds
    /// progress                  called with a dict after every iteration: run (None: the reference), iterations,
    ///                           seconds, and for runs fraction and relmse; False stops and keeps the measurements
    ///
    /// 'points' is a list of dicts with run, seed, iterations, light_paths, seconds, cpu_seconds, relmse, mse, and
    /// figure, the metric without the error of the reference. 'runs' has for each method the exponent of the theory and
    /// the fitted one. A run with a finish has two entries: NAME, the estimate, and 'NAME, finished'.
    #[pyo3(
        signature = (**options),
        text_signature = "($self, *, methods=None, runs=None, iterations=None, time=None, reference=None, \
            reference_method=None, reference_iterations=None, reference_time=None, metric='relmse', moments=None, \
            seed=0, seeds=1, max_depth=None, width=None, height=None, camera=None, threads=0, progress=None)"
    )]
    fn converge<'py>(&self, py: Python<'py>, options: Option<&Bound<'py, PyDict>>) -> PyResult<Bound<'py, PyAny>> {
        let Scene { path, loaded, options: scene_options, .. } = self;
        converge::converge(&Compared { path, loaded, options: scene_options }, py, options)
    }

    fn __repr__(&self) -> String {
        let scene = &self.loaded.scene;
        let (objects, cameras) = (scene.objects.len(), scene.cameras.len());
        format!("<caustique.Scene: {}, {objects} objects, {cameras} cameras>", self.path.display())
    }
}

impl Scene {
    /// Where the scene was read from, for messages and for the identity of checkpoints and shards.
    fn request(&self) -> SceneRequest {
        SceneRequest {
            path: self.path.clone(),
            environment: self.identity.environment.clone().map(Environment::File),
            rotation: None,
            strength: None,
            light_preset: None,
            background_hidden: None,
            options: self.options.read_options(),
            off: self.options.switches().off,
        }
    }

    /// The arguments of a render for the header, as JSON, under the names of the command line.
    fn arguments(&self, py: Python<'_>, options: Option<&Bound<'_, PyDict>>) -> PyResult<Value> {
        let own = ["progress", "threads", "checkpoint", "checkpoint_every", "overwrite", "resume"];
        let mut arguments = arguments_as_json(py, options, &own)?;
        if let (Value::Object(arguments), Value::Object(of_scene)) = (&mut arguments, &self.identity.options) {
            arguments.extend(of_scene.clone());
        }
        if arguments["finish"] == false {
            arguments["no-combine"] = true.into();
        }
        arguments["scene"] = self.path.display().to_string().into();
        Ok(arguments)
    }
}

impl Identity {
    fn of(py: Python<'_>, of_file: bool, options: Option<&Bound<'_, PyDict>>) -> PyResult<Identity> {
        let given = options.map(|options| options.get_item("environment")).transpose()?.flatten();
        let given = given.filter(|given| !given.is_none());
        let environment = given.as_ref().and_then(|given| given.extract::<PathBuf>().ok());
        let array = given.is_some_and(|given| environment.is_none() && given.extract::<[f32; 3]>().is_err());
        let options = arguments_as_json(
            py,
            options,
            if array { &["threads", "strict", "environment"] } else { &["threads", "strict"] },
        )?;
        Ok(Identity { options, environment, of_files: of_file && !array })
    }
}

/// The source and the options of a scene, with absolute paths.
fn made_from(source: &Bound<'_, PyAny>, options: Option<&Bound<'_, PyDict>>) -> PyResult<(Py<PyAny>, Py<PyDict>)> {
    let py = source.py();
    let absolute = |given: &Bound<'_, PyAny>| -> PyResult<Py<PyAny>> {
        match given.extract::<PathBuf>() {
            Ok(path) => Ok(std::path::absolute(path)?.into_pyobject(py)?.into_any().unbind()),
            Err(_) => Ok(given.clone().unbind()),
        }
    };
    let options = options.map_or_else(|| Ok(PyDict::new(py)), |options| options.copy())?;
    if let Some(environment) = options.get_item("environment")? {
        options.set_item("environment", absolute(&environment)?)?;
    }
    Ok((absolute(source)?, options.unbind()))
}

/// An error in a scene of arrays or bytes: it has no file that can be exported again.
fn about_arrays(mut fault: Fault) -> Fault {
    let place = fault.place.strip_prefix("scene.glb").unwrap_or(&fault.place);
    fault.place = place.trim_start_matches(": ").to_owned();
    fault.hint = fault.hint.map(|hint| match hint.contains("export") {
        true => "correct the mesh arrays, or the bytes of the .glb".into(),
        false => hint,
    });
    fault
}

/// Keyword arguments as JSON, under the names of the command line, without those in `but`.
fn arguments_as_json(py: Python<'_>, options: Option<&Bound<'_, PyDict>>, but: &[&str]) -> PyResult<Value> {
    let arguments = options.map_or_else(|| Ok(PyDict::new(py)), |options| options.copy())?;
    for own in but {
        if arguments.contains(own)? {
            arguments.del_item(own)?;
        }
    }
    Ok(match to_json(&arguments)? {
        Value::Object(arguments) => arguments.into_iter().map(|(key, value)| (key.replace('_', "-"), value)).collect(),
        other => other,
    })
}

/// The image that a render gives. If its finish failed, an exception with the image as its attribute.
pub fn delivered(py: Python<'_>, delivery: Delivery) -> PyResult<Image> {
    let (image, finish_error) = Image::of(delivery);
    let Some(error) = finish_error.map(raised) else { return Ok(image) };
    error.value(py).setattr("image", Bound::new(py, image)?)?;
    Err(error)
}

/// The argument of the command line for an environment that is a path or a radiance (r, g, b).
fn environment_word(given: &Bound<'_, PyAny>) -> PyResult<OsString> {
    let mut word = OsString::from("--env=");
    match given.extract::<[f32; 3]>() {
        Ok(color) => word.push(color.map(|c| c.to_string()).join(",")),
        Err(_) => word.push(given.extract::<PathBuf>()?),
    }
    Ok(word)
}

/// The environment as a picture; `None` unless it is given as an array (H, W, 3).
fn environment_array(given: &Bound<'_, PyAny>) -> PyResult<Option<Environment>> {
    if given.extract::<PathBuf>().is_ok() || given.extract::<[f32; 3]>().is_ok() {
        return Ok(None);
    }
    let (width, height, texels) = radiance("environment", given)?;
    Ok(Some(Environment::Image(EnvironmentSource::Image { width, height, texels })))
}

/// Passes the events of a render on to Python: warnings, and progress to the callback.
struct CallerReports<'a> {
    caller: &'a Caller,
    progress: Option<Arc<Py<PyAny>>>,
}

impl Observer for CallerReports<'_> {
    fn event(&mut self, event: Event<'_>) {
        match event {
            Event::FinishOpened { missing } => {
                self.caller.warn(&missing.map(missing_denoiser).into_iter().collect::<Vec<_>>());
            }
            Event::Begins { plan, .. } => self.caller.warn(&plan.warnings),
            Event::Progress(progress) => self.call_back(progress),
            Event::SaveFailed(error) => {
                self.caller.warn(&[format!("the state of the render is not saved: {error}; the render goes on")]);
            }
            Event::Warning(warning) => self.caller.warn(&[warning.into()]),
            Event::MomentFailed(error) => {
                self.caller.warn(&[format!("{error}; the render ends here, with the iterations so far")]);
            }
            _ => {}
        }
    }

    fn stop(&self) -> Stop {
        self.caller.stop()
    }
}

impl CallerReports<'_> {
    /// Calls the user's function with the progress of a render; the function stops the render by returning False.
    fn call_back(&self, progress: &caustique::render::Progress) {
        let Some(callback) = self.progress.clone() else { return };
        let progress = Progress::from(progress);
        self.caller.run(move |py| Ok(!callback.call1(py, (progress,))?.bind(py).is(PyBool::new(py, false))));
    }
}
