//! Safe bindings to the parts of Intel Open Image Denoise 2 that `caustique` uses.
//!
//! The library is loaded when the program runs, not linked when it is built, and the program renders without it.
//! [`Library::load`] finds the library, or returns an error whose [`Error::hint`] says what to do. The environment
//! variable [`LIBRARY_VARIABLE`] names a library file to use instead.
//!
//! ```no_run
//! use caustique_oidn::{Device, Folders, Input, Library};
//!
//! # fn main() -> Result<(), caustique_oidn::Error> {
//! let library = Library::load(&Folders::default())?;
//! let device = Device::new(&library, 2)?;
//! let (width, height) = (64, 48);
//! let (noisy, albedo) = (vec![[0.5; 3]; width * height], vec![[0.8; 3]; width * height]);
//! let input = Input { albedo: Some(&albedo), ..Input::new(width, height, &noisy) };
//! // For several pictures of one size and with the same guides, one filter prepares the network once.
//! let mut filter = device.filter()?;
//! let first = filter.denoise(&input)?;
//! let second = filter.denoise(&Input { color: &first, ..input })?;
//! assert_eq!(second.len(), width * height);
//! # Ok(())
//! # }
//! ```
//!
//! # Order of the types
//!
//! [`Library`] -> [`Device`] -> [`Filter`]. Each value keeps alive the values that it depends on, so they may be
//! dropped in any order. Several threads may use a library and a device at once. A filter may move to another thread,
//! but only one thread at a time may use it.
//!
//! # Determinism
//!
//! With version 2.5.1 the result has the same bytes with 1, 2, 3, 5 and 8 threads (on a machine with two cores), in
//! repeated calls, from a new filter and from a used one, at all qualities, with and without guides, from 1x1 to
//! 1280x720. A memory limit, and so tiles, does not change the bytes, but takes a fifth longer. The tests check this
//! for the library that they find; for 1280x720 only at [`Quality::Fast`], to save time. Another processor may give
//! other bytes, because the library may use other instructions there; so may another version of the library.
//!
//! # Costs and limitations
//!
//! A picture of 1280x720 on one or two cores with AVX-512 takes 1.2 core-seconds and 0.33 GiB at [`Quality::Fast`], and
//! 2.3 core-seconds and 0.56 GiB at the other two qualities, which give identical bits on a CPU. Guides have no
//! measurable cost. `cargo run --release -p caustique-oidn --example denoise` measures this.
//!
//! Pictures with a side below about 8 pixels get a wrong brightness. With [`Input::hdr`] the library computes its
//! exposure from the mean of the logarithms, so a value that is infinite or above about 1e6 spoils its surroundings,
//! and many of them spoil the whole picture. Such values must be clamped before.
//!
//! # Unsafe code
//!
//! This crate relies on two assumptions that it cannot prove. The file found under the library's name must be Open
//! Image Denoise, because loading it runs its initialisers. Its C interface must be that of its version number. The
//! crate passes only pictures of checked sizes, which stay borrowed until the call returns. It reads the library's
//! error after every call that can fail, and releases every object once. A loaded library is never unloaded, because
//! its worker threads outlive its devices.

mod api;
mod device;
mod error;
mod filter;
mod library;
mod limits;
mod load;

pub use caustique_library::{Folders, Version};
pub use device::Device;
pub use error::Error;
pub use filter::{Content, Filter, Input, Quality};
pub use library::{LIBRARY_VARIABLE, Library};
pub use limits::{MAX_SIDE, MAX_THREADS};
