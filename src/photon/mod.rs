//! The photon map: photons in Morton order under an implicit 8-wide tree of boxes, and the kernels that weigh them.

pub mod kernel;
pub mod kind;
mod map;
mod near;
mod nearest;
pub mod thinning_key;
mod volume;

pub use kernel::Kernel;
pub use kind::{ByKind, Kind, PhotonMaps};
pub use map::{Located, Photon, PhotonFlags, PhotonMap, PhotonTag};
pub use near::{Near, same_surface};
pub use nearest::{MAX_NEIGHBOURS, Nearest};
pub use thinning_key::ThinningKey;
pub use volume::{NO_NORMAL, VolumePhoton};
