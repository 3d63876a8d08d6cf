//! Moments of a scene that moves while the shutter is open.

use super::load::{SceneRequest, load_stage_moment};
use super::request::Request;
use crate::camera::Camera;
use crate::error::Result;
use crate::light::LearntLight;
use crate::plan::switch;
use crate::render::Motion;
use crate::scene::description::missing_at_moments;
use crate::scene::gltf::{FileMoments, MovingFile};
use crate::scene::{CameraRequest, MomentBuilder, Scene, View};
use crate::stop::Stop;

/// Number of moments below which the copies of a blurred object are visible.
const MIN_MOMENTS: u64 = 32;

/// A warning if a scene with motion blur is rendered in too few iterations, each of which shows one moment; otherwise
/// `None`.
pub(super) fn few_moments(scene: &Scene, iterations: u64) -> Option<String> {
    let few = scene.shutter.is_some() && iterations < MIN_MOMENTS;
    few.then(|| {
        let moments = if iterations == 1 { "1 moment".into() } else { format!("{iterations} moments") };
        format!(
            "motion blur is the mean of {moments}, one per iteration, which show as copies of what moves (ask for \
             --iterations {MIN_MOMENTS} or more, or more --time)"
        )
    })
}

/// A scene with motion blur.
pub(super) struct MovingScene<'a> {
    request: &'a SceneRequest,
    camera: &'a CameraRequest,
    /// The scene at the frame itself, for which settings and layers are made.
    at_frame: &'a Scene,
    /// Describes and builds moments of a glTF file; `None` for USD, whose stage is converted at every moment.
    moments: Option<(FileMoments<'a>, MomentBuilder<'a>)>,
    /// Times at which the shutter opens and closes, relative to the frame (frames).
    shutter: [f64; 2],
    /// Where light of the environment arrives; `None` if that is not known.
    learnt: LearntLight,
    stop: Stop,
}

impl<'a> MovingScene<'a> {
    /// The moving scene of a request; `None` if nothing moves while the shutter is open.
    ///
    /// # Errors
    /// The scene is invalid when the shutter opens or closes, or has other objects then.
    pub fn new(
        request: &'a Request,
        view: View<'a>,
        file: Option<&'a MovingFile>,
        stop: Stop,
    ) -> Result<Option<MovingScene<'a>>> {
        let Some(shutter) = view.scene.shutter else { return Ok(None) };
        let (scene, camera) = (&request.scene, &request.picture.camera);
        let moments =
            file.map(MovingFile::moments).transpose()?.map(|moments| (moments, MomentBuilder::new(view.scene)));
        let moving = MovingScene {
            request: scene,
            camera,
            at_frame: view.scene,
            moments,
            shutter,
            learnt: LearntLight::default(),
            stop,
        };
        // Faults are found before the first iteration.
        moving.at(0.0)?;
        moving.at(1.0)?;
        Ok(Some(moving))
    }

    /// The moving scene with what is known about where light arrives.
    pub fn with_learnt(self, learnt: LearntLight) -> MovingScene<'a> {
        MovingScene { learnt, ..self }
    }
}

impl Motion for MovingScene<'_> {
    fn at(&self, time: f64) -> Result<(Scene, Camera)> {
        let [open, close] = self.shutter;
        let after_frame = open + (close - open) * time;
        let scene = match &self.moments {
            Some((moments, builder)) => {
                let mut description = moments.describe(after_frame, builder.meshes())?;
                switch::remove_at_moment(&mut description, self.request.off);
                builder.build(description).map_err(|e| e.within(self.request.path.display()))?
            }
            None => {
                let scene = load_stage_moment(self.request, after_frame, &self.stop)?;
                if let Some(name) = different_object(self.at_frame, &scene) {
                    return Err(missing_at_moments(&name).within(self.request.path.display()));
                }
                scene
            }
        };
        let camera = scene.camera(self.camera)?;
        Ok((scene.with_learnt(&self.learnt).unwrap_or(scene), camera))
    }
}

/// The name of an object or light that only one of the scenes has; `None` if they have the same ones.
fn different_object(a: &Scene, b: &Scene) -> Option<String> {
    let (a, b) = (names(a), names(b));
    let longer = if a.len() >= b.len() { &a } else { &b };
    (0..longer.len()).find(|&i| a.get(i) != b.get(i)).map(|i| longer[i].clone())
}

/// The names of instances and lights, in their order.
fn names(scene: &Scene) -> Vec<String> {
    let instances = scene.shapes.instances.iter().map(|instance| instance.name.clone());
    instances.chain(scene.light_names.iter().cloned()).collect()
}
