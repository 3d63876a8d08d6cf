//! Safe bindings to the parts of Intel Open Image Denoise 2 that `caustique` uses.
//!
//! The library is looked for when the program runs, not when it is built, and the program renders without it.
//! [`Library::load`] finds it, or returns an error whose [`Error::hint`] says what to do. The environment variable
//! [`LIBRARY_VARIABLE`] names a library file to use instead.
//!
//! ```no_run
//! use caustique_oidn::{Device, Input, Library};
//!
//! # fn main() -> Result<(), caustique_oidn::Error> {
//! let library = Library::load(&[])?;
//! let device = Device::new(&library, 2)?;
//! let (width, height) = (64, 48);
//! let (noisy, albedo) = (vec![[0.5; 3]; width * height], vec![[0.8; 3]; width * height]);
//! let input = Input { albedo: Some(&albedo), ..Input::new(width, height, &noisy) };
//! // Several pictures of one size and with the same guides: what the network needs is made ready once.
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
//! [`Library`] -> [`Device`] -> [`Filter`]. Each keeps alive what it needs, so values may be dropped in any order. A
//! library and a device may be used from several threads; a filter may go to another, and serves one at a time.
//!
//! # The same bytes from any number of threads
//!
//! Version 2.5.1 gives the same bytes on 1, 2, 3, 5 and 8 threads (of which a machine of two cores ran them), each
//! time, from a new filter and from a used one, at all qualities, with and without guides, from 1x1 to 1280x720. A
//! limit of memory, and so tiles, does not change them either, but takes a fifth longer. The tests hold whatever
//! library they find to that; 1280x720 at [`Quality::Fast`] alone, for time. Another processor may give others, as it
//! may be given other instructions; so may another version of the library.
//!
//! # What it costs and what it is not good at
//!
//! 1280x720 on one or two cores with AVX-512: 1.2 core-seconds at [`Quality::Fast`], 2.3 at the other two, which are
//! bit for bit the same on a processor; guides add nothing that can be measured. The process has then had 0.33 and
//! 0.56 GiB at most. `cargo run --release -p caustique-oidn --example denoise` measures it.
//!
//! Pictures of less than about 8 pixels a side come out with the wrong brightness. With [`Input::hdr`] the library
//! takes its exposure from the mean of the logarithms, so a value that is infinite or beyond 1e6 or so spoils what is
//! around it, and enough of them the whole picture. Cut such values off before.
//!
//! # What is unsafe
//!
//! This crate trusts two things it cannot prove: that the file found under the library's name is Open Image Denoise
//! (loading it runs its initialisers), and that its C interface is the one its version number promises. It hands
//! over nothing but pictures whose sizes it has checked, borrowed until the call is over; asks for the library's
//! error after every call that can fail; and releases what it made, once. A loaded library is never unloaded: its
//! worker threads outlive its devices.

mod api;
mod device;
mod error;
mod filter;
mod library;
mod limits;
mod load;

pub use caustique_library::Version;
pub use device::Device;
pub use error::Error;
pub use filter::{Filter, Input, Quality};
pub use library::{LIBRARY_VARIABLE, Library};
pub use limits::{MAX_SIDE, MAX_THREADS};
