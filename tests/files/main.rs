//! What is read and written: scenes, pictures, and what is said of them before a render.

#[path = "../support/mod.rs"]
mod support;

mod cryptomatte;
mod exr;
mod gltf;
mod messages;
mod metrics;
mod plan;
