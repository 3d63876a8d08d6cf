//! Every option of a render, once: its name, default, unit, range and help, and which methods take it.
//!
//! The command line parses these types, Python's keyword arguments become words of the same options ([`parse`]), and
//! [`catalogue`] describes them for what is generated: the add-on's panel, render settings of USD, stubs and tables.

pub mod catalogue;
mod check;
mod finish;
mod frames;
pub mod number;
mod parse;
mod render;
mod run;
mod scene;
mod values;

pub use check::takes;
pub use clap::ValueEnum;
pub use finish::FinishOptions;
pub use frames::{Frames, is_pattern, numbered};
pub use parse::{InvalidOption, one_of, parse};
pub use render::RenderOptions;
pub use run::RunOptions;
pub use scene::{EnvironmentChoice, SceneOptions};
pub use values::{BandwidthChoice, CropChoice, FrameSeed, GridChoice, MethodChoice, OnOff};
