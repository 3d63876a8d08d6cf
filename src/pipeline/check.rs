//! The second step: whether a request fits its scene and the memory, found before anything is rendered.

use super::memory::MemoryCheck;
use super::request::{PictureRequest, Request};
use super::{finish, layers};
use crate::camera::Camera;
use crate::error::{Error, ErrorKind, Result};
use crate::plan::Search;
use crate::render::output::layer_shape;
use crate::render::{Candidate, InitialBandwidth, MIN_USER_BANDWIDTH_RATIO, Settings};
use crate::scene::{Scene, View};
use crate::transport::Indirect;
use std::path::Path;

/// The camera and the settings of a picture that were found to fit its scene.
pub struct Checked {
    /// The camera, with the size of the picture that is rendered.
    pub camera: Camera,
    /// Settings of the method; default settings if `auto` is still to choose the method.
    pub settings: Settings,
}

/// Checks camera and method of a picture against the scene that was read from `path`.
///
/// # Errors
/// The scene has no such camera, or the method cannot render the scene.
pub fn check_picture(picture: &PictureRequest, path: &Path, scene: &Scene) -> Result<Checked> {
    let camera = scene.camera(&picture.camera)?;
    let (request, size) = (&picture.settings, camera.whole()[0]);
    let settings = match request.method.0 {
        None if scene.survey.needs_camera_paths() => request.for_candidate(Candidate::CAMERA_PATHS, size),
        _ => None,
    };
    let settings = settings.map_or_else(|| request.resolve(), Ok)?;
    check_settings(&settings, path, scene)?;
    Ok(Checked { camera, settings: settings.with_light_paths(request.photons, size) })
}

/// Checks a render before it starts: its picture, its network, its layers and its memory.
///
/// # Errors
/// Errors of [`check_picture`]; there is no such network; the scene has no such layer; the render does not fit into memory.
pub(super) fn check(request: &Request, scene: &Scene) -> Result<Checked> {
    let checked = check_picture(&request.picture, &request.scene.path, scene)?;
    request.finish_of(&checked.settings).map_or(Ok(()), finish::check)?;
    let (shape, finishes) = (layer_shape(&checked.settings, scene), request.finish.is_some());
    layers::check(&request.layers, &shape, finishes, true)?;
    layers::check_names(&request.layers, &shape, finishes, request.naming)?;
    let view = View::new(scene, &checked.camera);
    let (layers, finish) = (&request.layers, request.finish.as_ref().map(|finish| finish.denoiser));
    let method = request.picture.settings.method.name();
    let memory = MemoryCheck { view, method, layers, finish, limit: request.memory };
    memory.fit(checked.settings.clone())?;
    Ok(checked)
}

/// Checks that a method can render the scene that was read from `path`.
///
/// # Errors
/// The method does not render shadow catchers, shadow linking or scattering media, or the initial bandwidth does not suit
/// the scene.
pub fn check_settings(settings: &Settings, path: &Path, scene: &Scene) -> Result<()> {
    if !follows_camera_paths(settings, scene) {
        let what = if scene.survey.catchers { "shadow catchers" } else { "shadow linking" };
        let cause = format!("--method {} does not render {what}", settings.method.name());
        return Err(Error::new(ErrorKind::Usage, path.display(), cause).hint("choose --method path"));
    }
    check_media(settings, path, scene)?;
    check_bandwidth(settings, path, scene)
}

/// Whether the method is path tracing, or the scene does not need it. Other methods do not tell the light of a shadow
/// catcher from that of other objects, and their light paths do not pass objects for the light of some lights.
pub(super) fn follows_camera_paths(settings: &Settings, scene: &Scene) -> bool {
    !scene.survey.needs_camera_paths() || settings.method.search() == Search::CameraPaths
}

/// Rejects settings whose method stores photons on surfaces only, if the scene has scattering media.
fn check_media(settings: &Settings, path: &Path, scene: &Scene) -> Result<()> {
    let method = settings.method;
    let (option, hint) = match method.search() {
        _ if !scene.survey.scattering => return Ok(()),
        Search::Map | Search::Merging => {
            (format!("--method {}", method.name()), "choose --method sppm, cppm, vcm, bdpt or path")
        }
        _ if settings.indirect == Indirect::Paths => ("--indirect paths".into(), "leave --indirect paths out"),
        _ => return Ok(()),
    };
    let cause = format!("{option} does not render media that scatter light");
    Err(Error::new(ErrorKind::Usage, path.display(), cause).hint(hint))
}

/// Rejects an initial bandwidth that is below what single precision resolves in this scene, or larger than the scene,
/// so that most of the area of a density estimate lies outside.
fn check_bandwidth(settings: &Settings, path: &Path, scene: &Scene) -> Result<()> {
    let radius = scene.lights.sky().radius;
    let least = MIN_USER_BANDWIDTH_RATIO * radius;
    let (cause, bound) = match settings.initial_bandwidth {
        InitialBandwidth::Fixed(length) if length < least => (
            format!(
                "--initial-bandwidth {length}: in a scene of radius {radius:.3} single precision does not tell such lengths apart"
            ),
            format!("{least:.1e} at least"),
        ),
        InitialBandwidth::Fixed(length) if length > radius => (
            format!("--initial-bandwidth {length}: the scene has a radius of {radius:.3}"),
            format!("{radius:.3} at most"),
        ),
        _ => return Ok(()),
    };
    let error = Error::new(ErrorKind::Usage, path.display(), cause);
    Err(error.hint(format!("ask for {bound}, or leave --initial-bandwidth out")))
}
