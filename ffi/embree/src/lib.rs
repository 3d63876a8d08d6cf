//! Safe bindings to the parts of Intel Embree 3 and 4 that `caustique` uses.
//!
//! The library is looked for when the program runs, not when it is built, so one binary serves
//! Debian 12 (`libembree3.so.3`, package `libembree3-3`), Debian 13 (`libembree4.so.4`, package
//! `libembree4-4`) and everything else that ships Embree 3 or 4. [`Library::load`] finds it, or
//! returns an error whose [`Error::hint`] says what to install. The environment variable
//! [`LIBRARY_VARIABLE`] names a library file to use instead.
//!
//! ```no_run
//! use caustique_embree::{Device, GeometryId, Library, Ray, SceneBuilder};
//!
//! # fn main() -> Result<(), caustique_embree::Error> {
//! let library = Library::load()?;
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
//! [`Library`] -> [`Device`] -> [`SceneBuilder`] -> [`Scene`] -> [`Hit`]. Each keeps alive what it
//! needs, so values may be dropped in any order. A [`Scene`] is immutable and may be traced from any
//! number of threads.
//!
//! # Why not an existing crate
//!
//! `embree4-rs` and `embree4-sys` link Embree 4 when they are built, which leaves Debian 12 out, and
//! the structures of `embree4-sys` 0.0.10 lack `RTCHit::instPrimID`, which Embree has had since
//! 4.3: the library writes it 4 bytes past the end of their 80-byte `RTCRayHit`. The structures here
//! have room for it whatever version is loaded (96 bytes, aligned to 16), and every library is
//! tried once on a small scene, with guard bytes behind the structure, before it is used
//! (see [`Library::hit_extent`]).
//!
//! # What is unsafe
//!
//! This crate trusts two things it cannot prove: that the file found under Embree's name is Embree (loading it runs its initialisers), and
//! that its C interface is the one its version number promises, of which the trial above checks what
//! can be checked. A loaded library is never unloaded: Embree's worker threads outlive its devices.

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

pub use caustique_library::Version;
pub use device::Device;
pub use error::Error;
pub use filter::{Candidate, Filter};
pub use geometry::{Bounds, GeometryId, MAX_GEOMETRY_ID};
pub use library::{LIBRARY_VARIABLE, Library};
pub use ray::{Hit, Ray};
pub use scene::{Scene, SceneBuilder};
