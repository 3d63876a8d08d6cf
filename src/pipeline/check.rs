//! What a method cannot do in a scene, found before anything is rendered.

use crate::error::{Error, ErrorKind, Result};
use crate::estimator::InitialBandwidth;
use crate::estimator::bandwidth::LEAST_ASKED;
use crate::plan::Search;
use crate::render::Settings;
use crate::scene::Scene;
use crate::transport::Indirect;
use std::path::Path;

/// Whether the method can do without what media scatter, or finds it.
///
/// # Errors
/// Media scatter, and the method gathers photons on surfaces only, or photons of caustics alone.
pub fn media(path: &Path, settings: &Settings, scene: &Scene) -> Result<()> {
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

/// Whether photons within the bandwidth that was asked for tell of the light there.
///
/// # Errors
/// It is smaller than positions in this scene can be told apart, or larger than the scene: what is found is then spread
/// over an area of which the scene is nothing.
pub fn bandwidth(path: &Path, settings: &Settings, scene: &Scene) -> Result<()> {
    let radius = scene.lights.sky().radius;
    let least = LEAST_ASKED * radius;
    match settings.initial_bandwidth {
        InitialBandwidth::Fixed(asked) if asked < least => {
            let cause = format!(
                "--initial-bandwidth {asked}: in a scene of radius {radius:.3} single precision does not tell such lengths apart"
            );
            let error = Error::new(ErrorKind::Usage, path.display(), cause);
            Err(error.hint(format!("ask for {least:.1e} at least, or leave --initial-bandwidth out")))
        }
        InitialBandwidth::Fixed(asked) if asked > radius => {
            let cause = format!("--initial-bandwidth {asked}: the scene has a radius of {radius:.3}");
            let error = Error::new(ErrorKind::Usage, path.display(), cause);
            Err(error.hint(format!("ask for {radius:.3} at most, or leave --initial-bandwidth out")))
        }
        _ => Ok(()),
    }
}
