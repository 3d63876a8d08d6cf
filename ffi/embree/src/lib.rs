//! Safe bindings to the parts of Intel Embree 3 and 4 that `caustique` uses.
//!
//! The library is loaded when the program runs, not linked when it is built. So one binary works on Debian 12
//! (`libembree3.so.3`, package `libembree3-3`), on Debian 13 (`libembree4.so.4`, package `libembree4-4`) and on every
//! system that ships Embree 3 or 4. [`Library::load`] finds the library, or returns an error whose [`Error::hint`] says
//! what to install. The environment variable [`LIBRARY_VARIABLE`] names a library file to use instead.
//!
//! ```no_run
//! use caustique_embree::{Device, Folders, GeometryId, Library, Ray, SceneBuilder};
//!
//! # fn main() -> Result<(), caustique_embree::Error> {
//! let library = Library::load(&Folders::default())?;
//! let device = Device::new(&library, 0)?;
//! let mut builder = SceneBuilder::new(&device)?;
//! let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! builder.triangles(GeometryId(0), &corners, &[[0, 1, 2]])?;
//! let scene = builder.commit()?;
//! let ray = Ray {
//!     origin: [0.25, 0.25, 1.0],
//!     direction: [0.0, 0.0, -1.0],
//!     tmin: 0.0,
//!     tmax: f32::INFINITY,
//!     token: 0,
//! };
//! assert!(scene.intersect(&ray).is_some_and(|hit| (hit.t - 1.0).abs() < 1e-6));
//! # Ok(())
//! # }
//! ```
//!
//! # Order of the types
//!
//! [`Library`] -> [`Device`] -> [`SceneBuilder`] -> [`Scene`] -> [`Hit`]. Each value keeps alive the values that it
//! depends on, so they may be dropped in any order. A [`Scene`] is immutable, and any number of threads may trace it.
//!
//! # Why not an existing crate
//!
//! `embree4-rs` and `embree4-sys` link Embree 4 when they are built, which excludes Debian 12. The structures of
//! `embree4-sys` 0.0.10 lack `RTCHit::instPrimID`, which Embree has since 4.3, so the library writes 4 bytes past the
//! end of their 80-byte `RTCRayHit`. The structures here have room for it in every version (96 bytes, aligned to 16).
//! Before a library is used, a ray is traced in a small scene with guard bytes behind the structure (see
//! [`Library::hit_extent`]).
//!
//! # Unsafe code
//!
//! This crate relies on two assumptions that it cannot prove. The file found under Embree's name must be Embree,
//! because loading it runs its initialisers. Its C interface must be that of its version number; the test ray checks a
//! part of it. A loaded library is never unloaded, because Embree's worker threads outlive its devices.

mod api;
mod device;
mod error;
mod filter;
mod geometry;
mod library;
mod load;
mod probe;
mod query;
mod ray;
mod scene;
mod transform;

pub use caustique_library::{Folders, Version};
pub use device::Device;
pub use error::Error;
pub use filter::{Candidate, Filter};
pub use geometry::{Bounds, GeometryId, MAX_GEOMETRY_ID};
pub use library::{LIBRARY_VARIABLE, Library};
pub use ray::{Hit, Ray};
pub use scene::{Scene, SceneBuilder};
