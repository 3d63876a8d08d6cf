//! From a scene file and the options about it to a scene, with its warnings told.

use super::frames::{Frames, numbered};
use super::number::{finite, positive, rgb, strength};
use super::output::lossy;
use super::progress::{Form, Waiting};
use super::say;
use caustique::error::{Error, Kind, Result};
use caustique::pipeline::Loaded;
use caustique::pipeline::load::{Environment, Order, load};
use caustique::plan::Switches;
use caustique::scene::gltf;
use caustique::stop::Stop;
use clap::ValueEnum;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A scene file and how it is read.
#[derive(clap::Args, Clone, Serialize)]
#[serde(rename_all = "kebab-case")]
#[command(next_help_heading = "Light and glass")]
pub struct SceneArgs {
    /// Scene: .glb or .gltf, as Blender exports it, or a stage of USD (.usd, .usda, .usdc, .usdz)
    #[arg(value_name = "SCENE", help_heading = None::<&str>)]
    #[serde(rename = "scene", serialize_with = "lossy")]
    pub path: PathBuf,
    /// Frames of the scene's animation, such as 5, 1-100 or 1-100,2. In the names of files, also in that of the scene,
    /// '####' stands for the frame's number [default: the moment of the first key]
    #[arg(long, value_name = "A-B[,STEP]", help_heading = "Picture")]
    pub frames: Option<Frames>,
    /// Frames a second, where the scene does not tell: frame N is at N / FPS seconds [default: 24]
    #[arg(long, value_name = "FPS", value_parser = positive, requires = "frames", help_heading = "Picture")]
    pub frame_rate: Option<f64>,
    /// The file is one of a sequence, of which each has a frame to itself
    #[arg(skip)]
    #[serde(skip)]
    of_sequence: bool,
    /// Light from all around: a latitude-longitude image (.exr or .hdr), or one colour R,G,B (radiance)
    #[arg(long, value_name = "FILE|R,G,B")]
    pub env: Option<EnvironmentChoice>,
    /// Turn the environment about the vertical, counter-clockwise seen from above (degrees)
    #[arg(long, value_name = "DEG", value_parser = finite, allow_negative_numbers = true)]
    pub env_rotation: Option<f64>,
    /// Make the environment so many times as bright
    #[arg(long, value_name = "S", value_parser = strength)]
    pub env_strength: Option<f64>,
    /// Units of lamps: 'photometric' is what Blender's exporter writes unless told otherwise, 683 lumen to the watt
    #[arg(long, value_enum, default_value_t = LightUnits::Auto)]
    pub light_units: LightUnits,
    /// Glass whose file does not say whether it is solid: 'auto' makes closed meshes solid, so that they bend light,
    /// and says so
    #[arg(long, value_enum, default_value_t = Glass::Auto)]
    pub glass: Glass,
    /// Switch effects off (-) or ask for them (+) by name, such as -dispersion,+volume: classes of light paths
    /// (emission, direct, indirect, glossy, caustic, sds), and dispersion, volume (or medium), depth_of_field,
    /// environment, alpha (cut-outs), textures. 'caustique plan' lists what a scene calls for [default: all that it
    /// calls for]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true, help_heading = "Effects")]
    pub effects: Option<Switches>,
    /// Let the scene name files (buffers, textures, its environment) outside its own folder
    #[arg(long)]
    pub allow_outside: bool,
    /// Take anything in the scene that is ignored or approximated as an error
    #[arg(long)]
    pub strict: bool,
}

/// Units of punctual lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LightUnits {
    /// By the program that wrote the file
    Auto,
    /// Watts
    Radiometric,
    /// Lumens, 683 to the watt
    Photometric,
}

/// What transmissive meshes without a volume are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Glass {
    /// Solid if closed
    Auto,
    /// Solid
    Solid,
    /// Thin panes that do not bend light
    Thin,
}

/// `--env`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum EnvironmentChoice {
    /// One radiance from everywhere.
    Color([f32; 3]),
    /// An image.
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

/// Reads and builds the scene as the options ask for it.
///
/// # Errors
/// See [`load`]; more than one frame.
pub fn read(args: &SceneArgs, form: Form, threads: usize) -> Result<Loaded> {
    let args = match args.frames {
        None => args,
        Some(frames) => match frames.single() {
            Some(frame) => &args.at(frame),
            None => {
                let error = Error::new(Kind::Usage, "command line", "--frames: this command looks at one frame");
                return Err(error.hint(format!("give one, such as --frames {}", frames.iter().next().unwrap_or(1))));
            }
        },
    };
    let _waiting = Waiting::begin(form, &format!("reading {}", args.path.display()));
    load(&args.order(), threads, &Stop::default())
}

/// Prints a line for each warning; with `--strict` they are an error that lists them all.
pub fn tell(args: &SceneArgs, warnings: &[String]) -> Result<()> {
    for warning in warnings {
        say(&format!("warning: {}: {warning}", args.path.display()));
    }
    if !args.strict || warnings.is_empty() {
        return Ok(());
    }
    Err(forbidden(args, warnings.len()))
}

/// What `--strict` makes of so many warnings.
pub fn forbidden(args: &SceneArgs, warnings: usize) -> Error {
    let things = if warnings == 1 { "1 thing is" } else { &format!("{warnings} things are") };
    let cause = format!("{things} ignored or approximated, and --strict forbids it");
    Error::new(Kind::Scene, args.path.display(), cause).hint("mend what the warnings above name, or leave --strict out")
}

impl SceneArgs {
    /// A file without any options but where what it names may lie.
    pub fn of(path: &Path, allow_outside: bool) -> SceneArgs {
        SceneArgs {
            path: path.into(),
            frames: None,
            frame_rate: None,
            of_sequence: false,
            env: None,
            env_rotation: None,
            env_strength: None,
            light_units: LightUnits::Auto,
            glass: Glass::Auto,
            effects: None,
            allow_outside,
            strict: false,
        }
    }

    /// The same of one frame: a scene whose name is a pattern is a file for each, unless there is a file of that very name.
    pub fn at(&self, frame: u32) -> SceneArgs {
        let file = numbered(&self.path, frame).filter(|_| !self.path.exists());
        let of_sequence = self.of_sequence || file.is_some();
        let path = file.unwrap_or_else(|| self.path.clone());
        SceneArgs { path, frames: Some(Frames::one(frame)), of_sequence, ..self.clone() }
    }

    /// What is asked of the pipeline.
    pub fn order(&self) -> Order {
        let environment = self.env.clone().map(|choice| match choice {
            EnvironmentChoice::Color(color) => Environment::Color(color.into()),
            EnvironmentChoice::File(path) => Environment::File(path),
        });
        Order {
            path: self.path.clone(),
            environment,
            rotation: self.env_rotation,
            strength: self.env_strength,
            options: self.read_options(),
            off: self.switches().off,
        }
    }

    /// `--effects`.
    pub fn switches(&self) -> Switches {
        self.effects.unwrap_or_default()
    }

    fn read_options(&self) -> gltf::ReadOptions {
        gltf::ReadOptions {
            light_units: match self.light_units {
                LightUnits::Auto => gltf::LightUnits::Auto,
                LightUnits::Radiometric => gltf::LightUnits::Radiometric,
                LightUnits::Photometric => gltf::LightUnits::Photometric,
            },
            glass: match self.glass {
                Glass::Auto => gltf::Glass::Auto,
                Glass::Solid => gltf::Glass::Solid,
                Glass::Thin => gltf::Glass::Thin,
            },
            allow_outside: self.allow_outside,
            frame: self.frames.and_then(Frames::single).map(|number| gltf::Frame {
                number,
                rate: self.frame_rate,
                of_sequence: self.of_sequence,
            }),
        }
    }
}
