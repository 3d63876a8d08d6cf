//! caustique renders caustics, and caustics seen through glass, water and mirrors.
//!
//! Data flows one way: scene file -> [`scene::Description`] -> scene -> plan -> iterations -> estimator -> layers ->
//! finish -> EXR. Each module uses only modules declared above it; all may use [`error`].

pub mod error;

pub mod files;

pub mod git_lfs;

pub mod processor;

pub mod installed;

pub mod memory;

pub mod stop;

pub mod temporary;

pub mod limits;

#[cfg(feature = "cli")]
pub mod argument;

pub mod math;

pub mod random;

pub mod spectrum;

pub mod stat;

pub mod geometry;

pub mod trace;

pub mod medium;

pub mod texture;

pub mod bsdf;

pub mod material;

pub mod light;

pub mod camera;

pub mod scene;

pub mod path_class;

pub mod photon;

pub mod transport;

pub mod estimator;

pub mod film;

pub mod image;

pub mod combine;

pub mod finish;

pub mod plan;

pub mod render;

pub mod choose;

pub mod advice;

pub mod pipeline;

#[cfg(feature = "cli")]
pub mod options;

pub mod peers;

pub mod report;
