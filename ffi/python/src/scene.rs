//! A scene, and what can be done with it.

use crate::converge;
use crate::error::{raised, usage};
use crate::image::{Image, radiance};
use crate::job::{self, Approach, Common};
use crate::keywords::Keywords;
use crate::progress::Progress;
use crate::value::{to_json, to_python};
use crate::work::{Caller, warn, work};
use caustique::error::{Error, Result};
use caustique::film::Naming;
use caustique::image::atomic;
use caustique::pipeline::load::{self, Environment, load, load_bytes};
use caustique::pipeline::{self, Auto, Delivery, Loaded, Order, Saving, Wait, Watch, check, checkpoint};
use caustique::plan::{Plan, Switches};
use caustique::render::auto::{Choice, choose};
use caustique::render::{Rendered, Settings};
use caustique::scene::description::EnvironmentSource;
use caustique::scene::{Scene as Built, gltf};
use caustique::stop::Stop;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBytes, PyDict};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::Arc;

/// Seconds between two saves unless told otherwise.
const EVERY: f64 = 300.0;

/// A scene that has been read and built; it can be rendered as often as one likes, from several threads at once.
#[pyclass(frozen, subclass, module = "caustique")]
pub struct Scene {
    pub(crate) loaded: Loaded,
    pub(crate) path: PathBuf,
    pub(crate) switches: Switches,
    said: Said,
}

/// What tells a scene from others: the options it was read with, as JSON, and the environment's file, if it has one.
struct Said {
    options: Value,
    environment: Option<PathBuf>,
    /// Files hold all of it, so that another process can read the same scene.
    of_files: bool,
}

#[pymethods]
impl Scene {
    /// Reads a scene: a path of a .glb or .gltf file, or the bytes of a .glb.
    #[new]
    #[pyo3(
        signature = (source, **options),
        text_signature = "(source, *, environment=None, environment_rotation=None, environment_strength=None, \
            light_units='auto', glass='auto', effects=None, frame=None, allow_outside=False, strict=False, threads=0)"
    )]
    fn new(py: Python<'_>, source: &Bound<'_, PyAny>, options: Option<&Bound<'_, PyDict>>) -> PyResult<Scene> {
        let mut keywords = Keywords::of(py, "Scene", options);
        let bytes = source.cast::<PyBytes>().ok().map(|bytes| PyBackedBytes::from(bytes.clone()));
        let path = match &bytes {
            Some(_) => PathBuf::from("scene.glb"),
            None => source.extract::<PathBuf>()?,
        };
        let switches = match keywords.take::<String>("effects")? {
            None => Switches::default(),
            Some(text) => text
                .parse()
                .map_err(|cause| usage(format!("Scene: effects='{text}': {cause}"), "such as '-dispersion,+volume'"))?,
        };
        let said = Said::of(py, bytes.is_none(), options)?;
        let order = load::Order {
            path: path.clone(),
            environment: keywords.take::<Bound<'_, PyAny>>("environment")?.map(environment).transpose()?,
            rotation: keywords.take("environment_rotation")?,
            strength: keywords.take("environment_strength")?,
            options: read_options(&mut keywords)?,
            off: switches.off,
        };
        let strict = keywords.take("strict")?.unwrap_or(false);
        let threads = keywords.take("threads")?.unwrap_or(0);
        keywords.finish()?;
        let finite = |x: Option<f64>| x.is_none_or(f64::is_finite);
        if !finite(order.rotation) || !finite(order.strength) || order.strength.is_some_and(|s| s < 0.0) {
            return Err(usage(
                "Scene: environment_rotation and environment_strength are finite, and the strength not negative",
                "degrees, and a factor from 0 up",
            ));
        }
        let done = work(py, threads, |_| match &bytes {
            Some(bytes) => load_bytes(bytes, &order, rayon::current_num_threads()),
            None => load(&order, rayon::current_num_threads(), &Stop::default()),
        })?;
        let loaded = done.whole()?;
        if strict && !loaded.scene.warnings.is_empty() {
            let list = loaded.scene.warnings.join("\n");
            return Err(usage(format!("strict=True, and something is ignored or approximated:\n{list}"), "mend it"));
        }
        warn(py, &loaded.scene.warnings)?;
        Ok(Scene { loaded, path, switches, said })
    }

    /// Whatever of the scene is ignored or approximated, a sentence each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.loaded.scene.warnings.clone()
    }

    /// Names of the cameras; the first is the usual one.
    #[getter]
    fn cameras(&self) -> Vec<String> {
        self.loaded.scene.cameras.iter().map(|camera| camera.name.clone()).collect()
    }

    /// Renders the scene and returns an Image.
    ///
    /// The options are those of `caustique render`; the same ones with the same seed give the same bytes in every
    /// layer, here and there, whatever the number of threads.
    ///
    /// method                    'auto', 'path', 'light', 'bdpt', 'pm', 'ppm', 'sppm', 'appm', 'cppm', 'bpm', 'vcm' or 'mlt'
    /// iterations, time,         when to stop: after so many iterations, seconds, or at an estimated relative error,
    /// target_error              whichever comes first; after 64 iterations if none is given
    /// width, height             pixels; one given keeps the camera's aspect
    /// camera                    by name; else the first
    /// crop                      a window (left, top, width, height) in pixels, or in shares of the picture
    /// filter                    pixel filter: 'box', 'gaussian' or 'blackman-harris', or one with its width in pixels,
    ///                           ('gaussian', 2.0)
    /// seed                      another number, other noise
    /// max_depth                 longest light path in segments
    /// photons                   light paths of an iteration
    /// levels                    bandwidth levels, 1 to 5, each 1/sqrt(2) of the next larger
    /// alpha                     how fast bandwidths shrink, in (0, 1]
    /// initial_bandwidth         'knn', 'footprint', or a length in metres
    /// knn                       photons within the largest bandwidth to begin with
    /// guide                     True or False: whether light paths start towards mirrors and glass
    /// cppm_grid                 of cppm: (annuli, sectors) in which photons are counted, (2, 6) if not given
    /// cppm_k, cppm_beta,        of cppm: factor of a reduction (0.8), growth of the counts for a test (1.2), and
    /// cppm_significance         probability of taking uniform photons for others (0.05)
    /// cppm_plus                 of cppm: red, green and blue apart
    /// finish                    False leaves the estimate as it is
    /// denoise                   'auto', 'oidn', 'own' or 'none'
    /// model                     'compact' or a path: the network that combines levels
    /// layers                    'all', 'comp', 'beauty', or names separated by commas
    /// reproducible              leave clocks and threads out of the header
    /// shard                     (index, count): every count-th iteration alone; `merge` joins what the shards save
    /// checkpoint                a file that the state is saved to; it stays, so that the render can be extended
    /// checkpoint_every          seconds between two saves
    /// overwrite                 start anew although the checkpoint of a render that was stopped is there
    /// resume                    a checkpoint to go on from: the same options, but for when to stop
    /// threads                   0 takes all cores
    /// progress                  called with a Progress after every iteration, in the calling thread; False ends it
    ///
    /// An exception of `progress`, or Ctrl-C, ends the render: the running iteration is given up, and what is finished, if
    /// anything is, is the attribute `image` of the exception. Other threads of Python run meanwhile.
    #[pyo3(
        signature = (**options),
        text_signature = "($self, *, method='auto', iterations=None, time=None, target_error=None, width=None, \
            height=None, camera=None, crop=None, filter=None, seed=0, max_depth=None, photons=None, levels=None, \
            alpha=None, initial_bandwidth=None, knn=None, guide=None, cppm_grid=None, cppm_k=None, cppm_beta=None, \
            cppm_significance=None, cppm_plus=False, finish=None, denoise=None, model=None, layers='all', \
            reproducible=False, shard=None, checkpoint=None, checkpoint_every=300.0, overwrite=False, \
            resume=None, threads=0, progress=None)"
    )]
    fn render(&self, py: Python<'_>, options: Option<&Bound<'_, PyDict>>) -> PyResult<Image> {
        let mut keywords = Keywords::of(py, "render", options);
        let approach = Approach::take(&mut keywords, &Approach::usual())?;
        let shard = job::shard(&mut keywords)?;
        let common = Common { shard, ..Common::take(&mut keywords, self.switches)? };
        let view = job::view(&mut keywords)?;
        let saving = saving(&mut keywords)?;
        let resume: Option<PathBuf> = keywords.take("resume")?;
        let overwrite = keywords.take("overwrite")?.unwrap_or(false);
        let goes_on =
            |saving: &Saving| resume.as_ref().is_some_and(|resume| atomic::is_same_file(resume, &saving.path));
        if let Some(Saving { path, .. }) = saving.as_ref().filter(|saving| !goes_on(saving)) {
            let remedy = format!("go on with resume='{}', or start anew with overwrite=True", path.display());
            checkpoint::check_replaceable(path, overwrite, &remedy).map_err(raised)?;
        }
        let layers = keywords.take("layers")?.unwrap_or_else(|| "all".to_string());
        let reproducible = keywords.take("reproducible")?.unwrap_or(false);
        let threads = keywords.take("threads")?.unwrap_or(0);
        let progress: Option<Py<PyAny>> = keywords.take("progress")?;
        keywords.finish()?;
        if !self.said.of_files && (shard.is_some() || saving.is_some() || resume.is_some()) {
            let cause = "render: shard, checkpoint and resume need a scene that another process can read";
            return Err(usage(
                cause,
                "write caustique.pack's bytes and an environment's array to files, and read them",
            ));
        }
        let settings = approach.settings(&common, approach.way())?;
        let arguments = self.arguments(py, options)?;
        let progress = progress.map(Arc::new);
        let done = work(py, threads, |caller| {
            let allowed = |way, size| approach.allowed(&common, way, size);
            let auto = match approach.method {
                None => Some(Auto { allowed: &allowed, finish: approach.pilot_finish() }),
                Some(_) => None,
            };
            let order = Order {
                scene: self.order(),
                view,
                settings,
                photons: approach.photons,
                max_depth: common.max_depth,
                switches: self.switches,
                auto,
                finish: approach.finish_order(),
                layers,
                naming: Naming::Plain,
                arguments,
                reproducible,
                memory: None,
                saving,
                resume,
            };
            pipeline::render_loaded(order, &self.loaded, &mut Watcher { caller, progress })
        })?;
        let delivery = match (done.result, done.raised) {
            (Ok(delivery), None) => delivery,
            (Ok(delivery), Some(error)) => {
                // What is finished goes with the exception that ended it.
                let (image, _) = Image::of(delivery);
                error.value(py).setattr("image", Bound::new(py, image)?)?;
                return Err(error);
            }
            (Err(_), Some(error)) => return Err(error),
            (Err(error), None) => return Err(raised(error)),
        };
        delivered(py, delivery)
    }

    /// What a render would simulate, why, and what it warns of: the object of `caustique plan --json`, a dict. The
    /// options are those of `render`.
    #[pyo3(
        signature = (**options),
        text_signature = "($self, *, method='auto', iterations=None, time=None, target_error=None, width=None, \
            height=None, camera=None, crop=None, filter=None, seed=0, max_depth=None, photons=None, levels=None, \
            alpha=None, initial_bandwidth=None, knn=None, guide=None, cppm_grid=None, cppm_k=None, cppm_beta=None, \
            cppm_significance=None, cppm_plus=False, finish=None, denoise=None, model=None, threads=0)"
    )]
    fn plan<'py>(&self, py: Python<'py>, options: Option<&Bound<'py, PyDict>>) -> PyResult<Bound<'py, PyAny>> {
        let mut keywords = Keywords::of(py, "plan", options);
        let approach = Approach::take(&mut keywords, &Approach::usual())?;
        let common = Common::take(&mut keywords, self.switches)?;
        let view = job::view(&mut keywords)?;
        let threads = keywords.take("threads")?.unwrap_or(0);
        keywords.finish()?;
        let settings = approach.settings(&common, approach.way())?;
        let Loaded { scene, removed } = &self.loaded;
        let done = work(py, threads, |caller| {
            let camera = scene.camera(&view)?;
            check::media(&self.path, &settings, scene)?;
            let choice = match approach.method {
                Some(_) => None,
                None => {
                    let make = |way| approach.allowed(&common, way, camera.size());
                    choose((scene, &camera), &mut approach.pilot_finish(), make, || caller.stops())
                }
            };
            let Common { max_depth, switches, .. } = common;
            let asked = pipeline::plan::Asked { choice: choice.as_ref(), max_depth, switches };
            let mut plan = pipeline::plan::plan(&asked, settings.method, (scene, &camera), removed);
            plan.warnings.splice(0..0, scene.warnings.iter().cloned());
            Ok(json!(plan))
        })?;
        to_python(py, &done.whole()?)
    }

    /// Accuracy against time of several methods: the object of `points.json` of `caustique converge`, a dict.
    ///
    /// methods                   names, each with its defaults, one bandwidth level and no finish
    /// runs                      {name: options of render that are about the method or the finish}
    /// iterations, time          when each run stops; after 60 seconds if neither is given
    /// reference                 an Image, a path, or an array (H, W, 3); one is made if there is none
    /// reference_method, reference_iterations, reference_time
    ///                           of the two halves of one that is made
    /// metric                    'relmse', 'relmse_trimmed' or 'mse'
    /// moments                   ratio of the iterations after which runs are measured; sqrt(2) if not given
    /// seed, seeds               the first seed, and how many races
    /// progress                  called with a dict after every iteration: run (None: the reference), iterations,
    ///                           seconds, and of runs fraction and relmse; False ends it and keeps what is measured
    ///
    /// 'points' is a list of dicts with run, seed, iterations, light_paths, seconds, cpu_seconds, relmse, mse, and
    /// figure, the metric without the reference's own error. 'runs' tells of each method what theory expects and what
    /// is fitted. A run that finishes its picture is two: NAME, the estimate, and 'NAME, finished'.
    #[pyo3(
        signature = (**options),
        text_signature = "($self, *, methods=None, runs=None, iterations=None, time=None, reference=None, \
            reference_method=None, reference_iterations=None, reference_time=None, metric='relmse', moments=None, \
            seed=0, seeds=1, max_depth=None, width=None, height=None, camera=None, threads=0, progress=None)"
    )]
    fn converge<'py>(&self, py: Python<'py>, options: Option<&Bound<'py, PyDict>>) -> PyResult<Bound<'py, PyAny>> {
        converge::converge(self, py, options)
    }

    fn __repr__(&self) -> String {
        let scene = &self.loaded.scene;
        let (objects, cameras) = (scene.objects.len(), scene.cameras.len());
        format!("<caustique.Scene: {}, {objects} objects, {cameras} cameras>", self.path.display())
    }
}

impl Scene {
    /// Where it is from: for messages, and for what tells it from other scenes.
    fn order(&self) -> load::Order {
        load::Order {
            path: self.path.clone(),
            environment: self.said.environment.clone().map(Environment::File),
            rotation: None,
            strength: None,
            options: gltf::ReadOptions::default(),
            off: self.switches.off,
        }
    }

    /// What was asked for, for the header, by the names of the command line.
    fn arguments(&self, py: Python<'_>, options: Option<&Bound<'_, PyDict>>) -> PyResult<Value> {
        let own = ["progress", "threads", "checkpoint", "checkpoint_every", "overwrite", "resume"];
        let mut arguments = said(py, options, &own)?;
        if let (Value::Object(arguments), Value::Object(of_scene)) = (&mut arguments, &self.said.options) {
            arguments.extend(of_scene.clone());
        }
        if arguments["finish"] == false {
            arguments["no-combine"] = true.into();
        }
        arguments["scene"] = self.path.display().to_string().into();
        Ok(arguments)
    }
}

impl Said {
    fn of(py: Python<'_>, of_file: bool, options: Option<&Bound<'_, PyDict>>) -> PyResult<Said> {
        let given = options.map(|options| options.get_item("environment")).transpose()?.flatten();
        let given = given.filter(|given| !given.is_none());
        let environment = given.as_ref().and_then(|given| given.extract::<PathBuf>().ok());
        let array = given.is_some_and(|given| environment.is_none() && given.extract::<[f32; 3]>().is_err());
        let options =
            said(py, options, if array { &["threads", "strict", "environment"] } else { &["threads", "strict"] })?;
        Ok(Said { options, environment, of_files: of_file && !array })
    }
}

/// Keyword arguments as JSON by the names of the command line, but for some.
fn said(py: Python<'_>, options: Option<&Bound<'_, PyDict>>, but: &[&str]) -> PyResult<Value> {
    let asked = options.map_or_else(|| Ok(PyDict::new(py)), |options| options.copy())?;
    for own in but {
        if asked.contains(own)? {
            asked.del_item(own)?;
        }
    }
    Ok(match to_json(&asked)? {
        Value::Object(asked) => asked.into_iter().map(|(key, value)| (key.replace('_', "-"), value)).collect(),
        other => other,
    })
}

/// Where and how often a render is saved, from the keywords `checkpoint checkpoint_every`.
fn saving(keywords: &mut Keywords<'_>) -> PyResult<Option<Saving>> {
    let path: Option<PathBuf> = keywords.take("checkpoint")?;
    let every = job::seconds(keywords, "checkpoint_every")?.unwrap_or(EVERY);
    if let Some(path) = &path {
        atomic::check_writable(path).map_err(raised)?;
    }
    Ok(path.map(|path| Saving { path, every, keep: true }))
}

/// The image of a render; of one that could not be finished the error, with the image as its attribute.
pub fn delivered(py: Python<'_>, delivery: Delivery) -> PyResult<Image> {
    let (image, refusal) = Image::of(delivery);
    let Some(error) = refusal.map(raised) else { return Ok(image) };
    error.value(py).setattr("image", Bound::new(py, image)?)?;
    Err(error)
}

/// A path, a colour (r, g, b), or an array (H, W, 3).
fn environment(given: Bound<'_, PyAny>) -> PyResult<Environment> {
    if let Ok(path) = given.extract::<PathBuf>() {
        return Ok(Environment::File(path));
    }
    if let Ok(color) = given.extract::<[f32; 3]>() {
        return match color.iter().all(|x| *x >= 0.0 && x.is_finite()) {
            true => Ok(Environment::Color(color.into())),
            false => Err(usage("environment: a colour is not finite or negative", "radiance (r, g, b) from 0 up")),
        };
    }
    let (width, height, texels) = radiance("environment", &given)?;
    Ok(Environment::Image(EnvironmentSource::Image { width, height, texels }))
}

fn read_options(keywords: &mut Keywords<'_>) -> PyResult<gltf::ReadOptions> {
    let units = [
        ("auto", gltf::LightUnits::Auto),
        ("radiometric", gltf::LightUnits::Radiometric),
        ("photometric", gltf::LightUnits::Photometric),
    ];
    let glass = [("auto", gltf::Glass::Auto), ("solid", gltf::Glass::Solid), ("thin", gltf::Glass::Thin)];
    Ok(gltf::ReadOptions {
        light_units: keywords.choice("light_units", &units)?.unwrap_or_default(),
        glass: keywords.choice("glass", &glass)?.unwrap_or_default(),
        allow_outside: keywords.take("allow_outside")?.unwrap_or(false),
        frame: keywords.take("frame")?.map(|number| gltf::Frame { number, rate: None, of_sequence: false }),
    })
}

/// Tells Python how a render goes.
struct Watcher<'a> {
    caller: &'a Caller,
    progress: Option<Arc<Py<PyAny>>>,
}

impl Watch for Watcher<'_> {
    fn waits(&mut self, _: Option<Wait>) {}

    fn loaded(&mut self, _: &Built) -> Result<()> {
        Ok(())
    }

    fn stop(&self) -> Stop {
        self.caller.stop()
    }

    fn chosen(&mut self, _: Option<&Choice>) -> Result<()> {
        match self.caller.stops() {
            true => Err(Error::new(caustique::error::Kind::Interrupted, "", "interrupted before the first iteration")),
            false => Ok(()),
        }
    }

    fn finishes(&mut self, error: Option<&Error>) {
        self.caller.warn(&error.map(job::missing).into_iter().collect::<Vec<_>>());
    }

    fn begins(&mut self, plan: &Plan, _: &Settings) {
        self.caller.warn(&plan.warnings);
    }

    fn progress(&mut self, progress: &caustique::render::Progress) {
        let Some(callback) = self.progress.clone() else { return };
        let progress = Progress::from(progress);
        self.caller
            .ask(move |py| Ok(!callback.call1(py, (progress,))?.bind(py).is(pyo3::types::PyBool::new(py, false))));
    }

    fn unsaved(&mut self, error: &Error) {
        self.caller.warn(&[format!("the state of the render is not saved: {error}; the render goes on")]);
    }

    fn rendered(&mut self, _: &Rendered) {}
}
