//! Moments of a scene that moves while the shutter is open.

use super::load::{SceneRequest, load_moment};
use super::request::Request;
use crate::camera::Camera;
use crate::error::{Error, ErrorKind, Result};
use crate::render::Motion;
use crate::scene::gltf::SceneFile;
use crate::scene::{CameraRequest, Scene, View};
use crate::stop::Stop;

/// A scene with motion blur, which is built anew for every moment.
pub(super) struct MovingScene<'a> {
    request: &'a SceneRequest,
    file: Option<&'a SceneFile>,
    camera: &'a CameraRequest,
    /// The scene at the frame itself, which settings and layers are made for.
    at_frame: &'a Scene,
    /// Times at which the shutter opens and closes, relative to the frame (frames).
    shutter: [f64; 2],
    stop: Stop,
}

impl<'a> MovingScene<'a> {
    /// The moving scene of a request; `None` if nothing moves, or the shutter is open for no time.
    ///
    /// # Errors
    /// The scene is invalid when the shutter opens or closes, or has other objects then.
    pub fn new(
        request: &'a Request<'_>,
        view: View<'a>,
        file: Option<&'a SceneFile>,
        stop: Stop,
    ) -> Result<Option<MovingScene<'a>>> {
        let shutter = request.scene.shutter.or(view.scene.shutter).unwrap_or_default();
        if shutter[0] == shutter[1] || !view.scene.animated {
            return Ok(None);
        }
        let (scene, camera) = (&request.scene, &request.picture.camera);
        let moving = MovingScene { request: scene, file, camera, at_frame: view.scene, shutter, stop };
        // Faults are found before the first iteration.
        moving.at(0.0)?;
        moving.at(1.0)?;
        Ok(Some(moving))
    }
}

impl Motion for MovingScene<'_> {
    fn at(&self, time: f64) -> Result<(Scene, Camera)> {
        let [open, close] = self.shutter;
        let after_frame = open + (close - open) * time;
        let scene = load_moment(self.request, self.file, after_frame, &self.stop)?;
        if let Some(name) = different_object(self.at_frame, &scene) {
            let cause = format!("object \"{name}\" is there only for a part of the time for which the shutter is open");
            let error = Error::new(ErrorKind::Scene, self.request.path.display(), cause);
            return Err(error.hint("let it appear between two frames' shutters, or render without blur: --shutter 0"));
        }
        let camera = scene.camera(self.camera)?;
        Ok((scene, camera))
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
