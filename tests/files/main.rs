//! Tests of files: scenes, pictures, and plans of scenes.

#[path = "../support/mod.rs"]
mod support;

mod cryptomatte;
mod exr;
mod git_lfs;
mod gltf;
mod messages;
mod metrics;
mod plan;
