//! The face of the library: a render in a few lines.

use crate::error::{Error, ErrorKind, Result};
use crate::film::{Layer, LayerSet, Naming, Selection};
use crate::finish::DenoiserChoice;
use crate::image::exr::{self, Attributes};
use crate::image::{png, tonemap::Look};
use crate::pipeline::finish::missing_denoiser;
use crate::pipeline::load::{self, Loaded, SceneRequest};
use crate::pipeline::shard::ShardSums;
use crate::pipeline::{self, Delivery, Event, FinishRequest, Observer, PictureRequest, Request};
use crate::render::{Method, MethodChoice, Progress, SettingsRequest};
use crate::scene::{CameraRequest, Scene};
use crate::stop::Stop;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A render of a scene that has been read: its settings are set one after the other, then [`run`](Render::run) makes the
/// [`Image`].
///
/// Without settings it is the render of `caustique render`: 1280 pixels wide, 64 iterations, by the method that a pilot
/// finds best, denoised as far as the estimated error allows. It runs on the threads of the current
/// [rayon](https://docs.rs/rayon) pool, and the picture does not depend on their number.
///
/// ```no_run
/// # fn main() -> caustique::Result<()> {
/// let image = caustique::Render::open("gems.glb")?.width(320).iterations(16).run()?;
/// image.save("gems.exr")?;
/// # Ok(())
/// # }
/// ```
pub struct Render<'a> {
    loaded: Loaded,
    path: PathBuf,
    camera: CameraRequest,
    settings: SettingsRequest,
    denoiser: Option<DenoiserChoice>,
    layers: Selection,
    reports: Reports<'a>,
}

/// A function that is told how a render goes, and whether it is to go on.
type Callback<'a> = Box<dyn FnMut(&Progress) -> bool + 'a>;

impl<'a> Render<'a> {
    /// Reads a scene: .glb, .gltf, or a stage of USD (which needs Python with the package `usd-core`).
    ///
    /// # Errors
    /// The file, or one that it names, is missing, malformed or outside the scene's folder; Embree is missing.
    pub fn open(path: impl AsRef<Path>) -> Result<Render<'a>> {
        let request = SceneRequest { path: path.as_ref().into(), ..SceneRequest::default() };
        Ok(Render::of(load::load(&request, rayon::current_num_threads(), &Stop::default())?, request.path))
    }

    /// Reads a scene from the bytes of a .glb or .gltf file, such as one that a program has made.
    ///
    /// # Errors
    /// Errors of [`Render::open`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Render<'a>> {
        let request = SceneRequest { path: "scene.glb".into(), ..SceneRequest::default() };
        Ok(Render::of(load::load_bytes(bytes, &request, rayon::current_num_threads())?, request.path))
    }

    fn of(loaded: Loaded, path: PathBuf) -> Render<'a> {
        Render {
            loaded,
            path,
            camera: CameraRequest::default(),
            settings: SettingsRequest::default(),
            denoiser: Some(DenoiserChoice::default()),
            layers: Selection::default(),
            reports: Reports { progress: None, stop: Arc::default(), warnings: Vec::new() },
        }
    }

    /// Sets the width in pixels; the height follows from the camera.
    #[must_use]
    pub fn width(mut self, pixels: u32) -> Self {
        self.camera.width = Some(pixels);
        self
    }

    /// Sets the height in pixels; the width follows from the camera.
    #[must_use]
    pub fn height(mut self, pixels: u32) -> Self {
        self.camera.height = Some(pixels);
        self
    }

    /// Chooses a camera of the scene by its name; otherwise it is the first.
    #[must_use]
    pub fn camera(mut self, name: impl Into<String>) -> Self {
        self.camera.camera = Some(name.into());
        self
    }

    /// Chooses the method that finds the light; otherwise a pilot does.
    #[must_use]
    pub fn method(mut self, method: Method) -> Self {
        self.settings.method = MethodChoice(Some(method));
        self
    }

    /// Stops after this many iterations.
    #[must_use]
    pub fn iterations(mut self, count: u64) -> Self {
        self.settings.iterations = Some(count);
        self
    }

    /// Stops after this many seconds. The iteration that runs then is discarded, unless it is the first.
    #[must_use]
    pub fn time(mut self, seconds: f64) -> Self {
        self.settings.time = Some(seconds);
        self
    }

    /// Stops at this estimated relative error of the finished picture (the root of relMSE); 0.05 is 5 %.
    #[must_use]
    pub fn target_error(mut self, error: f64) -> Self {
        self.settings.target_error = Some(error);
        self
    }

    /// Sets the seed of the noise: equal seeds and settings give equal pictures, to the last bit.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.settings.seed = seed;
        self
    }

    /// Leaves the picture unfinished: it is the method's own estimate, with its noise.
    #[must_use]
    pub fn unfinished(mut self) -> Self {
        self.denoiser = None;
        self
    }

    /// Selects the layers of the image by name, separated by commas, or `all` (the default), `comp`, `beauty`.
    ///
    /// # Errors
    /// No layer has such a name; the hint has the nearest one.
    pub fn layers(mut self, names: &str) -> Result<Self> {
        self.layers = Selection::parse(names)?;
        Ok(self)
    }

    /// Calls a function after each iteration; the render stops, and keeps its picture, when it returns false.
    #[must_use]
    pub fn progress(mut self, callback: impl FnMut(&Progress) -> bool + 'a) -> Self {
        self.reports.progress = Some(Box::new(callback));
        self
    }

    /// Ends the render, also within an iteration, once another thread sets this flag to true; the image then has the
    /// iterations before.
    #[must_use]
    pub fn stop(mut self, flag: Arc<AtomicBool>) -> Self {
        self.reports.stop = flag;
        self
    }

    /// Renders. Everything that can be wrong is found before the first light path.
    ///
    /// # Errors
    /// Settings that contradict each other or the scene, memory, a stop before the first iteration, or a finish that
    /// fails.
    pub fn run(self) -> Result<Image> {
        let Render { loaded, path, camera, settings, denoiser, layers, mut reports } = self;
        let request = Request {
            scene: SceneRequest { path, ..SceneRequest::default() },
            picture: PictureRequest { camera, settings: settings.clone() },
            finish: denoiser.map(|denoiser| FinishRequest { denoiser, model: None }),
            layers,
            naming: Naming::Plain,
            arguments: json!(settings),
            reproducible: false,
            memory: None,
            saving: None,
            resume: None,
        };
        let delivery = pipeline::render_loaded(request, &loaded, &mut reports)?;
        let Delivery { set, attributes, reached, finish_error, .. } = delivery;
        let error = reached.map(|reached| reached.error());
        finish_error.map_or(Ok(Image { set, attributes, error, warnings: reports.warnings }), Err)
    }
}

/// Receives the events of a render.
struct Reports<'a> {
    progress: Option<Callback<'a>>,
    stop: Arc<AtomicBool>,
    warnings: Vec<String>,
}

impl Observer for Reports<'_> {
    fn accept(&mut self, scene: &Scene) -> Result<()> {
        self.warnings.extend(scene.warnings.iter().cloned());
        Ok(())
    }

    fn event(&mut self, event: Event<'_>) {
        match event {
            Event::FinishOpened { missing: Some(error) } => {
                self.warnings.push(missing_denoiser(error));
            }
            Event::Begins { plan, .. } => self.warnings.extend(plan.warnings.iter().cloned()),
            Event::Warning(warning) => self.warnings.push(warning.into()),
            Event::MomentFailed(error) => self.warnings.push(format!("{error}; the render has ended there")),
            Event::Progress(progress) => {
                let goes_on = self.progress.as_mut().is_none_or(|callback| callback(progress));
                self.stop.fetch_or(!goes_on, Ordering::Relaxed);
            }
            _ => {}
        }
    }

    fn stop(&self) -> Stop {
        Stop::from_flag(Arc::clone(&self.stop))
    }
}

/// A rendered picture with its layers. Rows run from the top; radiance is scene-linear Rec. 709 in W/(sr m2).
pub struct Image {
    set: LayerSet,
    attributes: Attributes,
    error: Option<f64>,
    warnings: Vec<String>,
}

impl Image {
    /// Width and height in pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.set.width, self.set.height)
    }

    /// The picture itself: red, green and blue of each pixel.
    ///
    /// # Errors
    /// The layers of the image do not include the picture.
    pub fn picture(&self) -> Result<Vec<[f32; 3]>> {
        Ok(self.set.beauty()?.into_iter().collect())
    }

    /// The layers: `""` is the picture, others are `Noisy`, `Caustic`, `Variance1`, `albedo`, `Z` and the like.
    pub fn layers(&self) -> &[Layer] {
        &self.set.layers
    }

    /// A layer by its name; `None` if the image has none of that name.
    pub fn layer(&self, name: &str) -> Option<&Layer> {
        self.set.get(name)
    }

    /// Estimated relative error of the finished picture (the root of relMSE without the worst 0.5 % of the pixels);
    /// `None` if it is unfinished, or has too few iterations to tell.
    pub fn error(&self) -> Option<f64> {
        self.error
    }

    /// Warnings about the scene and the render, one sentence each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The header of the EXR as JSON: plan, error against seconds, times, and more.
    pub fn header(&self) -> Value {
        self.attributes.object().unwrap_or(Value::Null)
    }

    /// Writes an EXR with all layers, or a tone-mapped PNG, by the extension of `path`.
    ///
    /// # Errors
    /// The name ends neither in .exr nor in .png, or the file cannot be written; a file of that name then stays as it
    /// was.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        write(path.as_ref(), &self.set, &self.attributes, None, exr::Options::default(), Look::default())
    }
}

/// Writes layers as an EXR, with the pixel sums of a shard behind it, or the picture as a tone-mapped PNG, by the extension
/// of `path`.
///
/// # Errors
/// Errors of [`Image::save`].
#[doc(hidden)]
pub fn write(
    path: &Path,
    set: &LayerSet,
    attributes: &Attributes,
    sums: Option<&ShardSums>,
    options: exr::Options,
    look: Look,
) -> Result<()> {
    let is = |extension: &str| path.extension().is_some_and(|own| own.eq_ignore_ascii_case(extension));
    if is("exr") {
        exr::write_followed(path, set, attributes, options, |file| sums.map_or(Ok(()), |sums| sums.write(file)))
    } else if is("png") {
        png::write_tonemapped(path, &set.beauty()?, look)
    } else {
        let error = Error::new(ErrorKind::Usage, path.display(), "the name ends neither in .exr nor in .png");
        Err(error.hint("an EXR holds all layers, a PNG is a picture to look at"))
    }
}
