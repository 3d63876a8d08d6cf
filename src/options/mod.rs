//! The options of a render. Each is defined once, with its name, default, unit, range and help, and with what Python and
//! USD make of it. Those of the method are [`SettingsRequest`](crate::render::SettingsRequest).
//!
//! The command line parses these types. Python's keyword arguments are turned into command-line arguments and parsed by
//! [`parse()`]. [`catalogue`] describes the options for generated files: the add-on's panel, the options in a USD stage,
//! stubs and tables.

pub mod catalogue;
mod finish;
mod frames;
mod parse;
mod render;
mod run;
mod scene;
mod values;

pub use clap::ValueEnum;
pub use finish::FinishOptions;
pub use frames::{Frames, files_of_frames, is_pattern, no_frames, path_of_frame};
pub use parse::{InvalidOption, one_of, parse};
pub use render::{RenderOptions, SizeOptions};
pub use run::RunOptions;
pub use scene::{Background, EnvironmentChoice, SceneOptions};
pub use values::{CropChoice, FrameSeed};
