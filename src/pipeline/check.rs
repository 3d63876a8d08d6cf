//! What a method cannot do in a scene, found before anything is rendered.

use crate::error::{Error, Kind, Result};
use crate::estimator::InitialBandwidth;
use crate::estimator::bandwidth::LEAST_ASKED;
use crate::render::{Method, Settings};
use crate::scene::Scene;
use crate::transport::Indirect;
use std::path::Path;

/// Whether the method can do without what media scatter, or finds it.
///
/// # Errors
/// Media scatter, and the method gathers photons on surfaces only, or photons of caustics alone.
pub fn media(path: &Path, settings: &Settings, scene: &Scene) -> Result<()> {
    let method = settings.method;
    let (option, hint) = match method {
        _ if !scene.survey.scattering => return Ok(()),
        Method::Pm | Method::Bpm => {
            (format!("--method {}", method.name()), "choose --method sppm, cppm, vcm, bdpt or path")
        }
        _ if settings.indirect == Indirect::Paths => ("--indirect paths".into(), "leave --indirect paths out"),
        _ => return Ok(()),
    };
    let cause = format!("{option} does not render media that scatter light");
    Err(Error::new(Kind::Usage, path.display(), cause).hint(hint))
}

/// Whether photons can be found within the bandwidth that was asked for.
///
/// # Errors
/// It is smaller than positions in this scene can be told apart.
pub fn bandwidth(path: &Path, settings: &Settings, scene: &Scene) -> Result<()> {
    let radius = scene.lights.sky().radius;
    let least = LEAST_ASKED * radius;
    match settings.initial {
        InitialBandwidth::Fixed(asked) if asked < least => {
            let cause = format!(
                "--initial-bandwidth {asked}: in a scene of radius {radius:.3} single precision does not tell such lengths apart"
            );
            let error = Error::new(Kind::Usage, path.display(), cause);
            Err(error.hint(format!("ask for {least:.1e} at least, or leave --initial-bandwidth out")))
        }
        _ => Ok(()),
    }
}
