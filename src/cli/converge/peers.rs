//! Prepares the other renderers of `--with`.

use super::options::ConvergeArgs;
use crate::cli::say;
use crate::cli::signals::Interrupt;
use caustique::error::{Error, Result};
use caustique::finish::{Denoiser, DenoiserChoice};
use caustique::options::SceneOptions;
use caustique::peers::{Drivers, Renderer};
use caustique::report::peer_renders::{Driver, PeerDenoiser, PeerRenders};
use caustique::scene::gltf::{Glass, LightUnits};
use caustique::scene::{View, blend, usd};

/// Prepares the other renderers of `--with`; `None` if there are none.
///
/// # Errors
/// A renderer is not installed, or `--time` is missing.
pub fn prepare(
    args: &ConvergeArgs,
    View { scene, camera }: View<'_>,
    threads: usize,
    interrupt: &Interrupt,
    notes: &mut Vec<String>,
) -> Result<Option<PeerRenders>> {
    let mut renderers: Vec<Renderer> = args.with.clone();
    renderers.dedup();
    if renderers.is_empty() {
        return Ok(None);
    }
    let Some(time) = super::time(args) else {
        let error = Error::usage("--with needs --time: other renderers count no iterations");
        return Err(error.hint("add --time SECONDS"));
    };
    let drivers = Drivers::new(&renderers, &args.scene.path, args.camera.as_deref(), camera.size(), threads)?;
    let driver = match unsupported(args) {
        Some(why) => {
            say(&format!("warning: --with: {why}; other renderers are left out"));
            Driver::Refused(why)
        }
        None => Driver::Ready(drivers),
    };
    let denoising = match Denoiser::open(DenoiserChoice::Oidn) {
        Ok((denoiser, _)) if matches!(driver, Driver::Ready(_)) => {
            Some(PeerDenoiser::new(denoiser, scene, camera, args.seed)?)
        }
        Ok(_) => None,
        Err(error) => {
            say(&format!("warning: --with: {error}; other renderers' pictures are not denoised"));
            notes.push(format!("Other renderers' pictures are not denoised: {error}."));
            None
        }
    };
    let interrupt = interrupt.clone();
    let stop = Box::new(move || interrupt.requested());
    let peers = renderers.into_iter().flat_map(Renderer::peers).collect();
    Ok(Some(PeerRenders { peers, driver, denoiser: denoising, time, stop }))
}

/// An option or a kind of file that the drivers of other renderers do not support, so that these would render another
/// scene; `None` if all are supported.
fn unsupported(args: &ConvergeArgs) -> Option<String> {
    let SceneOptions { path, frames, env, env_rotation, env_strength, light_units, glass, effects, .. } = &args.scene;
    let option = [
        ("--env", env.is_some()),
        ("--env-rotation", env_rotation.is_some()),
        ("--env-strength", env_strength.is_some()),
        ("--light-units", *light_units != LightUnits::Auto),
        ("--glass", *glass != Glass::Auto),
        ("--effects", effects.is_some()),
        ("--frames", frames.is_some()),
        ("--max-depth", args.max_depth.is_some()),
    ];
    let given = option.iter().find(|(_, given)| *given).map(|(name, _)| format!("drivers do not know {name}"));
    given
        .or_else(|| usd::is_stage(path).then(|| "drivers read no stages of USD".into()))
        .or_else(|| blend::is_blend(path).then(|| "drivers read no files of Blender; export one to .glb".into()))
}
