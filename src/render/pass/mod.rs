//! The integrator of each method, and modules that integrators share.

mod bidirectional;
mod choice;
mod cost;
mod forecast;
mod groups;
mod guiding;
mod integrator;
mod learnt_light;
mod light_cells;
mod light_path_ranges;
mod metropolis;
mod path;
mod photon_counts;
mod photon_tracer;
mod pixel_bandwidths;
mod pm;
mod region;
mod sample_buffer;
mod second_moments;
mod sppm;
mod survival;
mod techniques;
mod tiles;
mod volume;

pub use bidirectional::bytes_per_whole_tile;
pub(super) use choice::integrator;
pub(crate) use cost::Cost;
pub use forecast::photons_per_path;
pub(super) use integrator::{Integrator, Work};
pub use learnt_light::learn_light;
pub use photon_counts::PhotonCounts;
pub use pm::PHOTON_BYTES;
pub use sample_buffer::sample_bytes;
pub use second_moments::{Proxy, SecondMoments};
pub use techniques::{MAX_TECHNIQUES, TechniquePicture};
pub use tiles::TILE as WHOLE_TILE;
