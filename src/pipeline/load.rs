//! The first step: reads a scene file and builds the scene, with the environment and the effects of the request.

use crate::error::{Error, ErrorKind, Result};
use crate::math::Rgb;
use crate::memory;
use crate::path_class::EffectSet;
use crate::plan::switch::{self, Removed};
use crate::scene::description::{Description, EnvironmentDescription, EnvironmentSource};
use crate::scene::{LightPreset, Scene, blend, environment_file, gltf, light_preset, usd};
use crate::stop::Stop;
use std::path::{Path, PathBuf};

/// Bytes kept free for Embree's library, and for each of its threads: Embree ends the process if they get none. Bounds
/// found by lowering `ulimit -v` (`no_limit_of_memory_aborts` in `tests/cli/limits.rs`).
const EMBREE_BYTES: u64 = 256 << 20;
const EMBREE_BYTES_PER_THREAD: u64 = 16 << 20;

/// Largest radiance of an environment (W/(sr m^2)), so that sums over many pixels do not overflow single precision.
const MAX_RADIANCE: f32 = 1e30;

/// A scene file, and how it is read.
#[derive(Default)]
pub struct SceneRequest {
    /// Path of the scene file.
    pub path: PathBuf,
    /// The environment light that replaces the scene's own; `None`: the scene's own.
    pub environment: Option<Environment>,
    /// Rotation of the environment about the vertical (degrees); `None`: the scene's own.
    pub rotation: Option<f64>,
    /// Factor on the environment's radiance; `None`: the scene's own.
    pub strength: Option<f64>,
    /// The environment for a scene without a light, or instead of the scene's own; `None`: the studio, for a scene
    /// without a light.
    pub light_preset: Option<LightPreset>,
    /// Whether camera rays do not see the environment, and the background is transparent; `None`: as the scene says.
    pub background_hidden: Option<bool>,
    /// Choices about reading that the file leaves open.
    pub options: gltf::ReadOptions,
    /// Effects, such as dispersion, that are switched off.
    pub off: EffectSet,
}

/// An environment light.
pub enum Environment {
    /// Equal radiance from all directions (linear Rec. 709).
    Color(Rgb),
    /// Path of a latitude-longitude image.
    File(PathBuf),
    /// Texels of a latitude-longitude image: finite and not negative.
    Image(EnvironmentSource),
}

/// A scene that has been read and built.
pub struct Loaded {
    /// The scene, ready to be rendered.
    pub scene: Scene,
    /// Effects that were switched off and so removed from the scene.
    pub removed: Removed,
    /// The glTF file of the scene, if it is read again for other moments; otherwise `None`.
    pub file: Option<gltf::MovingFile>,
    /// Hash of the scene's files, hexadecimal. `None` if the scene did not come from files that can be read again, or
    /// has been edited.
    pub hash: Option<String>,
}

/// Reads and builds a scene. Embree builds with `threads` threads.
///
/// # Errors
/// The file, or a file that it names, is malformed; the request changes an environment that the scene does not have;
/// `stop` is set.
pub fn load(request: &SceneRequest, threads: usize, stop: &Stop) -> Result<Loaded> {
    let (description, file) = read(request, threads, stop)?;
    let hash = hash(request, &description)?;
    Ok(Loaded { file, hash, ..build(description, request, threads)? })
}

/// Hash of the files of a scene, or of the .glb that a converter has turned them into, and of the environment that the
/// request names.
///
/// # Errors
/// The scene cannot be read.
pub(super) fn hash(request: &SceneRequest, description: &Description) -> Result<Option<String>> {
    if !request.path.is_file() {
        return Ok(None);
    }
    let scene = match &description.converted {
        Some(hash) => hash.clone(),
        None => gltf::hash(&request.path, request.options.allow_outside)?,
    };
    let mut hasher = blake3::Hasher::new();
    hasher.update(scene.as_bytes());
    if let Some(Environment::File(path)) = &request.environment
        && path.is_file()
        && let Ok(bytes) = std::fs::read(path)
    {
        hasher.update(&bytes);
    }
    Ok(Some(hasher.finalize().to_hex().to_string()))
}

/// Reads the description of a scene, and the file of its moments.
///
/// # Errors
/// Errors of [`load`].
pub(super) fn read(
    request: &SceneRequest,
    threads: usize,
    stop: &Stop,
) -> Result<(Description, Option<gltf::MovingFile>)> {
    check_memory(request, threads)?;
    read_file(&request.path, &request.options, stop)
}

/// Reads the description of a scene file of any format, and the file of its moments.
///
/// # Errors
/// The file, or a file that it names, is malformed; `stop` is set.
pub(super) fn read_file(
    path: &Path,
    options: &gltf::ReadOptions,
    stop: &Stop,
) -> Result<(Description, Option<gltf::MovingFile>)> {
    if usd::is_stage(path) {
        Ok((usd::read(path, options, 0.0, stop)?, None))
    } else if blend::is_blend(path) {
        blend::read(path, options, stop)
    } else {
        gltf::MovingFile::open(path, options)
    }
}

/// Reads and builds the scene of a USD stage as it is `after_frame` frames after the frame of the request.
///
/// # Errors
/// Errors of [`load`].
pub(super) fn load_stage_moment(request: &SceneRequest, after_frame: f64, stop: &Stop) -> Result<Scene> {
    let description = usd::read(&request.path, &request.options, after_frame, stop)?;
    Ok(build(description, request, rayon::current_num_threads())?.scene)
}

/// Builds a scene from the bytes of a .glb file. `request.path` names it in messages.
///
/// # Errors
/// Errors of [`load`].
pub fn load_bytes(bytes: &[u8], request: &SceneRequest, threads: usize) -> Result<Loaded> {
    check_memory(request, threads)?;
    let (description, file) = gltf::MovingFile::from_bytes(bytes.into(), &request.path, &request.options)?;
    Ok(Loaded { file, ..build(description, request, threads)? })
}

fn check_memory(request: &SceneRequest, threads: usize) -> Result<()> {
    memory::require(EMBREE_BYTES + threads as u64 * EMBREE_BYTES_PER_THREAD, "Embree and its threads")
        .map_err(|e| e.within(request.path.display()).hint("give the program more memory, or fewer --threads"))
}

/// Builds the scene of a description, with the environment and the effects of the request.
pub(super) fn build(mut description: Description, request: &SceneRequest, threads: usize) -> Result<Loaded> {
    set_environment(&mut description, request)?;
    if let Some(hidden) = request.background_hidden {
        description.picture.film_transparent = hidden;
    }
    let removed = switch::remove_effects(&mut description, request.off);
    Ok(Loaded { scene: Scene::build(description, threads)?, removed, file: None, hash: None })
}

/// Replaces the environment of a scene description and changes it, as the request says.
fn set_environment(description: &mut Description, request: &SceneRequest) -> Result<()> {
    if let Some(choice) = &request.environment {
        let source = match choice {
            Environment::Color(color) => EnvironmentSource::Color(*color),
            Environment::File(path) => {
                description.files.push(path.clone());
                environment_file::read(path, &mut description.warnings)?
            }
            Environment::Image(source) => source.clone(),
        };
        description.environment = Some(EnvironmentDescription { source, rotation_deg: 0.0, strength: 1.0 });
        description.environment_hidden_from_camera = false;
        description.background = None;
        description.environment_unknown = false;
    } else {
        light_preset::apply(description, request.light_preset);
    }
    set_rotation_and_strength(description, request)?;
    let brightness = |environment: &EnvironmentDescription| {
        environment.strength
            * match &environment.source {
                EnvironmentSource::Color(color) => color.max_element(),
                EnvironmentSource::Image { texels, .. } => texels.as_flattened().iter().copied().fold(0.0, f32::max),
            }
    };
    let all = [&description.environment, &description.background];
    if all.into_iter().flatten().all(|environment| brightness(environment) <= MAX_RADIANCE) {
        return Ok(());
    }
    let cause = format!("its environment is brighter than {MAX_RADIANCE:e} W/(sr m^2)");
    Err(Error::new(ErrorKind::Scene, request.path.display(), cause).hint("lower --env or --env-strength"))
}

/// Sets rotation and strength of the environment that the request names, also of the scene's own environment.
fn set_rotation_and_strength(description: &mut Description, request: &SceneRequest) -> Result<()> {
    let given = [("--env-rotation", request.rotation), ("--env-strength", request.strength)];
    let Some((option, _)) = given.iter().find(|(_, value)| value.is_some()) else { return Ok(()) };
    let Some(environment) = &mut description.environment else {
        let error =
            Error::new(ErrorKind::Usage, request.path.display(), format!("{option}: the scene has no environment"));
        return Err(error.hint("give one with --env"));
    };
    for environment in [environment].into_iter().chain(&mut description.background) {
        if let Some(degrees) = request.rotation {
            environment.rotation_deg = degrees as f32;
        }
        if let Some(strength) = request.strength {
            environment.strength = strength as f32;
        }
    }
    Ok(())
}
