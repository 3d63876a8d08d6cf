//! From a scene file and wishes about it to a scene.

use crate::error::{Error, ErrorKind, Result};
use crate::math::Rgb;
use crate::memory;
use crate::plan::EffectSet;
use crate::plan::switch::{self, Removed};
use crate::scene::description::{Description, EnvironmentDescription, EnvironmentSource};
use crate::scene::{Scene, environment_file, gltf, usd};
use crate::stop::Stop;
use std::path::PathBuf;

/// Room for Embree's library, and for each of its threads: it ends the process where they get none. A bound found by
/// lowering `ulimit -v` (`no_limit_of_memory_aborts` in `tests/cli/limits.rs`).
const START_BYTES: u64 = 256 << 20;
const THREAD_BYTES: u64 = 16 << 20;

/// Most radiance of an environment: sums of the light of many pixels have to be single precision.
const MAX_RADIANCE: f32 = 1e30;

/// A scene file and how it is read.
pub struct Order {
    /// The file.
    pub path: PathBuf,
    /// Light from all around in place of the scene's own.
    pub environment: Option<Environment>,
    /// Turn of the environment about the vertical (degrees).
    pub rotation: Option<f64>,
    /// Factor on the environment's radiance.
    pub strength: Option<f64>,
    /// What the file leaves open.
    pub options: gltf::ReadOptions,
    /// Effects to do without.
    pub off: EffectSet,
}

/// Light from all around.
pub enum Environment {
    /// One radiance from everywhere.
    Color(Rgb),
    /// A latitude-longitude image in a file.
    File(PathBuf),
    /// The same as texels: finite and not negative.
    Image(EnvironmentSource),
}

/// A scene as it was asked for.
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// What it was built without.
    pub removed: Removed,
}

/// Reads and builds the scene, with the environment that is asked for, without the effects that are off.
///
/// # Errors
/// The file or what it names, by place; an environment that is changed and is not there; `stop` asks for an end.
pub fn load(order: &Order, threads: usize, stop: &Stop) -> Result<Loaded> {
    check_memory(order, threads)?;
    let description = match usd::is_stage(&order.path) {
        true => usd::read(&order.path, &order.options, stop)?,
        false => gltf::read(&order.path, &order.options)?,
    };
    build(description, order, threads)
}

/// Like [`load`], from the bytes of a file that would stand at the order's path.
///
/// # Errors
/// Those of [`load`].
pub fn load_bytes(bytes: &[u8], order: &Order, threads: usize) -> Result<Loaded> {
    check_memory(order, threads)?;
    build(gltf::read_bytes(bytes, &order.path, &order.options)?, order, threads)
}

fn check_memory(order: &Order, threads: usize) -> Result<()> {
    memory::require(START_BYTES + threads as u64 * THREAD_BYTES, "Embree and its threads")
        .map_err(|e| e.within(order.path.display()).hint("give the program more memory, or fewer --threads"))
}

fn build(mut description: Description, order: &Order, threads: usize) -> Result<Loaded> {
    environment(&mut description, order)?;
    let removed = switch::off(&mut description, order.off);
    Ok(Loaded { scene: Scene::build(description, threads)?, removed })
}

/// The environment that is asked for, in place of the scene's own.
fn environment(description: &mut Description, order: &Order) -> Result<()> {
    if let Some(choice) = &order.environment {
        let source = match choice {
            Environment::Color(color) => EnvironmentSource::Color(*color),
            Environment::File(path) => environment_file::read(path, &mut description.warnings)?,
            Environment::Image(source) => source.clone(),
        };
        description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
        description.environment_hidden_from_camera = false;
        description.environment_unknown = false;
    }
    set_turn_and_strength(description, order)?;
    let Some(environment) = &description.environment else { return Ok(()) };
    let brightest = match &environment.source {
        EnvironmentSource::Color(color) => color.max_element(),
        EnvironmentSource::Image { texels, .. } => texels.as_flattened().iter().copied().fold(0.0, f32::max),
    };
    if brightest * environment.strength <= MAX_RADIANCE {
        return Ok(());
    }
    let cause = format!("its environment is brighter than {MAX_RADIANCE:e} W/(sr m^2)");
    Err(Error::new(ErrorKind::Scene, order.path.display(), cause).hint("lower --env or --env-strength"))
}

/// A turn and a strength also act on the scene's own environment.
fn set_turn_and_strength(description: &mut Description, order: &Order) -> Result<()> {
    let given = [("--env-rotation", order.rotation), ("--env-strength", order.strength)];
    let Some((option, _)) = given.iter().find(|(_, value)| value.is_some()) else { return Ok(()) };
    let Some(environment) = &mut description.environment else {
        let error =
            Error::new(ErrorKind::Usage, order.path.display(), format!("{option}: the scene has no environment"));
        return Err(error.hint("give one with --env"));
    };
    if let Some(degrees) = order.rotation {
        environment.rotation_deg = degrees as f32;
    }
    if let Some(strength) = order.strength {
        environment.strength = strength as f32;
    }
    Ok(())
}
