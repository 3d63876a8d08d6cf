//! Options about a scene: where it is, how it is read, and which of its effects are simulated.

use super::frames::{Frames, path_of_frame};
use crate::argument::{Elsewhere, Ranged, rgb, strength};
use crate::path_class::Switches;
use crate::pipeline::load::{Environment, SceneRequest};
use crate::scene::LightPreset;
use crate::scene::gltf::{self, Glass, LightUnits, Pose};
use serde::{Serialize, Serializer};
use std::ops::Bound::{Excluded, Unbounded};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A scene file and how it is read.
#[derive(clap::Args, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
#[command(next_help_heading = "Light and glass")]
pub struct SceneOptions {
    /// Scene: .glb or .gltf, Blender's .blend, or a stage of USD (.usd, .usda, .usdc, .usdz)
    #[arg(value_name = "SCENE", help_heading = None::<&str>)]
    #[serde(rename = "scene", serialize_with = "lossy")]
    pub path: PathBuf,
    /// Frames of the scene's animation, such as 5, 1-100 or 1-100,2 [default: the time of the first key]
    ///
    /// '####' in the names of files, also of the scene, stands for the number of the frame
    #[arg(long, value_name = "A-B[,STEP]", help_heading = "Picture")]
    #[arg(of_scene = "frame")]
    pub frames: Option<Frames>,
    /// Frames per second, if the scene does not say: frame N is at N / FPS seconds [default: 24]
    #[arg(long, value_name = "FPS", between = (Excluded(0.0), Unbounded), requires = "frames", help_heading = "Picture")]
    #[arg(hide_short_help = true)]
    #[arg(of_scene = "frame_rate")]
    pub frame_rate: Option<f64>,
    /// Name of the scene to render, in a file with several [default: the file's default scene]
    #[arg(long = "scene", value_name = "NAME", help_heading = "Picture")]
    #[arg(hide_short_help = true)]
    #[arg(of_scene = "scene_name")]
    pub scene_name: Option<String>,
    /// Name of the only animation that moves the scene [default: all do]
    #[arg(long, value_name = "NAME", help_heading = "Picture")]
    #[arg(hide_short_help = true)]
    #[arg(of_scene = "animation")]
    pub animation: Option<String>,
    /// Name of the material variant to render (KHR_materials_variants) [default: the materials without a variant]
    #[arg(long, value_name = "NAME", help_heading = "Picture")]
    #[arg(hide_short_help = true)]
    #[arg(of_scene = "variant")]
    pub variant: Option<String>,
    /// Pose of what the file animates: 'rest' is the file without its animations
    #[arg(long, value_enum, default_value_t, help_heading = "Picture")]
    #[arg(hide_short_help = true)]
    #[arg(of_scene = "pose")]
    pub pose: Pose,
    /// Motion blur: when the shutter opens and closes, in frames relative to the frame, such as -0.25,0.25; 0 is none
    /// [default: what the scene says]
    #[arg(long, value_name = "OPEN,CLOSE", allow_hyphen_values = true, help_heading = "Picture")]
    #[arg(of_scene = "shutter")]
    pub shutter: Option<Shutter>,
    /// The file is one of a sequence, of which each has a frame to itself
    #[arg(skip)]
    #[serde(skip)]
    of_sequence: bool,
    /// Environment light: a latitude-longitude image (.exr or .hdr), or one radiance R,G,B
    #[arg(long, value_name = "FILE|R,G,B")]
    #[arg(of_scene = "environment", in_stages = false)]
    pub env: Option<EnvironmentChoice>,
    /// Rotation of the environment about the vertical, counter-clockwise seen from above (degrees)
    #[arg(long, value_name = "DEG", between = (Unbounded, Unbounded), allow_negative_numbers = true)]
    #[arg(hide_short_help = true)]
    #[arg(of_scene = "environment_rotation")]
    pub env_rotation: Option<f64>,
    /// Factor on the radiance of the environment
    #[arg(long, value_name = "S", value_parser = strength)]
    #[arg(hide_short_help = true)]
    #[arg(of_scene = "environment_strength")]
    pub env_strength: Option<f64>,
    /// Procedural environment in place of the scene's own [default: 'studio' if the scene has no light at all]
    #[arg(long, value_enum, conflicts_with = "env")]
    #[arg(hide_short_help = true)]
    #[arg(of_scene = "light_preset", in_stages = false)]
    pub light_preset: Option<LightPreset>,
    /// Environment behind the scene: 'hide' makes the background transparent, in the EXR and the PNG [default: as the
    /// scene says, else 'show']
    #[arg(long, value_enum, help_heading = "Picture")]
    #[arg(hide_short_help = true)]
    #[arg(of_scene = "background")]
    pub background: Option<Background>,
    /// Units of lamps: 'auto' decides by the program that wrote the file; 'photometric' is the default of Blender's
    /// exporter, 683 lumen per watt
    #[arg(long, value_enum, default_value_t)]
    #[arg(hide_short_help = true)]
    #[arg(of_scene = "light_units", in_stages = false)]
    pub light_units: LightUnits,
    /// Glass if the file does not say whether it is solid: 'auto' makes closed meshes solid, so that they refract
    /// light, and says so
    #[arg(long, value_enum, default_value_t)]
    #[arg(hide_short_help = true)]
    #[arg(of_scene = "glass")]
    pub glass: Glass,
    /// Switch effects off (-) or on (+) by name, such as -dispersion,+volume [default: all that the scene calls for]
    ///
    /// Classes of light paths: emission, direct, indirect, glossy, caustic, sds. Others: dispersion, volume (or
    /// medium), depth_of_field, environment, alpha (cut-outs), textures. 'caustique plan' lists the effects of a scene
    #[arg(long, value_name = "LIST", allow_hyphen_values = true, help_heading = "Effects")]
    #[arg(of_scene = "effects")]
    pub effects: Option<Switches>,
    /// Allow the scene to name files (buffers, textures, its environment) outside its own folder
    #[arg(long)]
    #[arg(hide_short_help = true)]
    #[arg(of_scene = "allow_outside", in_stages = false)]
    pub allow_outside: bool,
    /// Make an error of anything in the scene that is ignored or approximated
    #[arg(long)]
    #[arg(hide_short_help = true)]
    #[arg(of_scene = "strict", in_stages = false)]
    pub strict: bool,
    /// Print each warning; without it, the warnings of one kind are one line
    #[arg(long, help_heading = "Running")]
    #[serde(skip)]
    #[arg(hide_short_help = true)]
    #[arg(not_in_python = "Python's warnings are not grouped")]
    pub verbose: bool,
}

/// The value of `--env`, the environment light.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum EnvironmentChoice {
    /// The environment has equal radiance R,G,B from all directions.
    Color([f32; 3]),
    /// The environment is a latitude-longitude image in this file.
    File(#[serde(serialize_with = "lossy")] PathBuf),
}

impl FromStr for EnvironmentChoice {
    type Err = String;
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match rgb(text) {
            Some(color) => color.map(EnvironmentChoice::Color),
            None => Ok(EnvironmentChoice::File(text.into())),
        }
    }
}

/// Whether the environment is seen behind the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Background {
    /// Camera rays see the environment
    Show,
    /// The background is transparent; the environment lights the scene anyway
    Hide,
}

/// Times at which the camera's shutter opens and closes, relative to the frame (frames).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Shutter(pub [f64; 2]);

impl FromStr for Shutter {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let times = text.split(',').map(|part| part.trim().parse().ok().filter(|time: &f64| time.is_finite()));
        match times.collect::<Option<Vec<f64>>>().as_deref() {
            Some([0.0]) => Ok(Shutter([0.0; 2])),
            Some(&[open, close]) if open <= close => Ok(Shutter([open, close])),
            Some([_, _]) => Err("the shutter must not close before it opens".into()),
            _ => Err("it must be two numbers OPEN,CLOSE, such as -0.25,0.25, or 0 for no motion blur".into()),
        }
    }
}

impl SceneOptions {
    /// Default options for a scene file; `allow_outside`: the file may name files outside its folder.
    pub fn of(path: &Path, allow_outside: bool) -> SceneOptions {
        SceneOptions {
            path: path.into(),
            frames: None,
            frame_rate: None,
            scene_name: None,
            animation: None,
            variant: None,
            pose: Pose::default(),
            shutter: None,
            of_sequence: false,
            env: None,
            env_rotation: None,
            env_strength: None,
            light_preset: None,
            background: None,
            light_units: LightUnits::default(),
            glass: Glass::default(),
            effects: None,
            allow_outside,
            strict: false,
            verbose: false,
        }
    }

    /// The options for one frame of the animation. If the name of the scene is a pattern such as `a.####.glb`, and no
    /// file has exactly this name, each frame is a file by itself.
    pub fn at(&self, frame: u32) -> SceneOptions {
        let file = path_of_frame(&self.path, frame).filter(|_| !self.path.exists());
        let of_sequence = self.of_sequence || file.is_some();
        let path = file.unwrap_or_else(|| self.path.clone());
        SceneOptions { path, frames: Some(Frames::one(frame)), of_sequence, ..self.clone() }
    }

    /// The request for the pipeline to read this scene.
    pub fn request(&self) -> SceneRequest {
        let environment = self.env.clone().map(|choice| match choice {
            EnvironmentChoice::Color(color) => Environment::Color(color.into()),
            EnvironmentChoice::File(path) => Environment::File(path),
        });
        SceneRequest {
            path: self.path.clone(),
            environment,
            rotation: self.env_rotation,
            strength: self.env_strength,
            light_preset: self.light_preset,
            background_hidden: self.background.map(|background| background == Background::Hide),
            options: self.read_options(),
            off: self.switches().off,
        }
    }

    /// The effects, such as dispersion, that the user switches off or asks for.
    pub fn switches(&self) -> Switches {
        self.effects.unwrap_or_default()
    }

    /// Choices about reading the scene file.
    pub fn read_options(&self) -> gltf::ReadOptions {
        gltf::ReadOptions {
            light_units: self.light_units,
            glass: self.glass,
            allow_outside: self.allow_outside,
            scene: self.scene_name.clone(),
            animation: self.animation.clone(),
            variant: self.variant.clone(),
            pose: self.pose,
            frame: self.frames.and_then(Frames::single).map(|number| gltf::FrameTime {
                number,
                rate: self.frame_rate,
                of_sequence: self.of_sequence,
            }),
            shutter: self.shutter.map(|Shutter(times)| times),
            motion_vectors: false,
        }
    }
}

/// Serializes a path as text; bytes that are not text are replaced.
fn lossy<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&path.display())
}
