//! The glTF reader: supported input, warnings and errors, and damaged files, none of which crash it.

pub mod glb;

mod animation;
mod bad_input;
mod choice;
pub mod compressed;
pub mod everything;
mod fuzz;
mod geometry;
pub mod images;
mod lights;
mod materials;
mod outside;
mod profiles;
mod scenes;
mod seen;
mod valid;

use caustique::error::Error;
use caustique::scene::Description;
use caustique::scene::gltf::{ReadOptions, read_bytes};
use glb::Glb;
use std::path::Path;

/// Reads a file from memory.
fn read(file: &Glb) -> Description {
    try_read(file).unwrap_or_else(|e| panic!("{e}"))
}

fn try_read(file: &Glb) -> Result<Description, Error> {
    read_bytes(&file.bytes(), Path::new("pool.glb"), &ReadOptions::default())
}

/// An error as the command line prints it.
fn message(error: &Error) -> String {
    let hint = error.hint.as_ref().map_or_else(String::new, |h| format!("\nhint: {h}"));
    format!("{error}{hint}")
}
