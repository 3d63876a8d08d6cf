//! caustique renders caustics, and caustics seen through glass, water and mirrors, and says how large its error is.
//!
//! [`Render`] reads a scene and renders it; [`Image`] is the picture with its layers. Shapes, units and errors stand at
//! their functions. The file formats, the layers and the methods are described in the project's `docs`.
//!
//! ```no_run
//! # fn main() -> caustique::Result<()> {
//! let image = caustique::Render::open("gems.glb")?.width(320).iterations(16).run()?;
//! println!("error: {:?}, {} layers", image.error(), image.layers().len());
//! image.save("gems.exr")?;
//! image.save("gems.png")?;
//! # Ok(())
//! # }
//! ```
//!
//! A scene can come from memory ([`Render::from_bytes`]), a function can watch the render and end it
//! ([`Render::progress`], [`Render::stop`]), and each layer is an array ([`Image::layer`]). The folder `examples` has a
//! program for each.
//!
//! The picture is the same for any number of threads. Embree has to be installed; Open Image Denoise and ONNX Runtime are
//! used where they are found.
//!
//! All other modules are hidden here: they are the program's own, and change without notice. Data flows one way: scene
//! file -> [`scene::Description`] -> scene -> plan -> iterations -> estimator -> layers -> finish -> EXR. Each module uses
//! only modules declared above it; all may use [`error`].

#[doc(hidden)]
pub mod error;

#[doc(hidden)]
pub mod system;

#[doc(hidden)]
pub mod files;

#[doc(hidden)]
pub mod git_lfs;

#[doc(hidden)]
pub mod processor;

#[doc(hidden)]
pub mod installed;

#[doc(hidden)]
pub mod memory;

#[doc(hidden)]
pub mod stop;

#[doc(hidden)]
pub mod temporary;

#[doc(hidden)]
pub mod limits;

#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod argument;

#[doc(hidden)]
pub mod math;

#[doc(hidden)]
pub mod random;

#[doc(hidden)]
pub mod spectrum;

#[doc(hidden)]
pub mod stat;

#[doc(hidden)]
pub mod geometry;

#[doc(hidden)]
pub mod trace;

#[doc(hidden)]
pub mod medium;

#[doc(hidden)]
pub mod texture;

#[doc(hidden)]
pub mod bsdf;

#[doc(hidden)]
pub mod material;

#[doc(hidden)]
pub mod light;

#[doc(hidden)]
pub mod camera;

#[doc(hidden)]
pub mod scene;

#[doc(hidden)]
pub mod path_class;

#[doc(hidden)]
pub mod photon;

#[doc(hidden)]
pub mod transport;

#[doc(hidden)]
pub mod estimator;

#[doc(hidden)]
pub mod film;

#[doc(hidden)]
pub mod image;

#[doc(hidden)]
pub mod combine;

#[doc(hidden)]
pub mod finish;

#[doc(hidden)]
pub mod plan;

#[doc(hidden)]
pub mod render;

#[doc(hidden)]
pub mod choose;

#[doc(hidden)]
pub mod advice;

#[doc(hidden)]
pub mod pipeline;

#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod options;

#[doc(hidden)]
pub mod face;

#[doc(hidden)]
pub mod peers;

#[doc(hidden)]
pub mod report;

pub use error::{Error, ErrorKind, Result};
pub use face::{Image, Render};
pub use film::{Layer, Plane, Sample};
pub use render::{ErrorCoverage, ExpectedError, Method, Progress};
