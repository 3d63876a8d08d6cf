//! The plan of a render: from the options to what the library plans, and its warnings told.

use super::options::{Method, RenderArgs};
use crate::cli::say;
use caustique::camera::Camera;
use caustique::error::{Error, Kind, Result};
use caustique::plan::switch::Removed;
use caustique::plan::{Asked, Plan, Search, Switches};
use caustique::render;
use caustique::scene::Scene;
use std::path::Path;

/// Options that decide what a plan says.
#[derive(Clone, Copy)]
pub struct Wishes {
    /// `--method`.
    pub method: Method,
    /// `--max-depth`.
    pub max_depth: Option<u32>,
    /// `--effects`.
    pub switches: Switches,
}

impl Wishes {
    /// Those of a render.
    pub fn of(args: &RenderArgs) -> Wishes {
        Wishes { method: args.method, max_depth: args.max_depth, switches: args.scene.switches() }
    }
}

/// The plan of a render of a scene that was built without what is `removed`.
pub fn plan(wishes: &Wishes, scene: &Scene, camera: &Camera, removed: &Removed) -> Plan {
    let method = wishes.method.chosen();
    let because = match wishes.method {
        Method::Auto => {
            "auto: the one method here that reaches every class of light paths, caustics behind glass and in mirrors too"
        }
        _ => "asked for",
    };
    let (search, max_depth, switches) = (search(method), wishes.max_depth, wishes.switches);
    Plan::new(scene, camera, &Asked { method: method.name(), because, search, max_depth, switches, removed })
}

/// How a method looks for light.
fn search(method: render::Method) -> Search {
    use render::Method as M;
    match method {
        M::Path => Search::EyePaths,
        M::Light => Search::LightPaths,
        M::Bdpt => Search::Connections,
        M::Pm => Search::Map,
        M::Ppm | M::Sppm | M::Appm | M::Cppm => Search::Photons,
        M::Bpm => Search::Merging,
        M::Vcm => Search::ConnectionsAndMerging,
    }
}

/// Whether the method can do without what media scatter, or finds it.
///
/// # Errors
/// Media scatter, and the method gathers photons on surfaces only.
pub fn check_media(args: &RenderArgs, scene: &Scene) -> Result<()> {
    let method = args.method.chosen();
    if !scene.survey.scattering || !matches!(method, render::Method::Pm | render::Method::Bpm) {
        return Ok(());
    }
    let cause = format!("--method {} does not render media that scatter light", method.name());
    let error = Error::new(Kind::Usage, args.scene.path.display(), cause);
    Err(error.hint("choose --method sppm, cppm, vcm, bdpt or path"))
}

/// Prints what the plan warns of.
pub fn tell(scene: &Path, warnings: &[String]) {
    for warning in warnings {
        say(&format!("warning: {}: {warning}", scene.display()));
    }
}
