//! Light transport: the bounce loop ([`walk()`]), and the visitors that make algorithms of it.

pub mod bidirectional;
mod gather;
mod light;
mod walk;

pub use bidirectional::camera_walk::CameraWalkContext;
pub use bidirectional::light_vertex::{LightVertex, Scatterer};
pub use bidirectional::light_walk::{Deposits, LightVertices, Splat};
pub use bidirectional::path::{path_radiance, path_sample};
pub use bidirectional::photon_merge::MergePhoton;
pub use bidirectional::{Bidirectional, Division, MergeLevels, PathKind, PathRecorder, Technique, TechniqueSet};
pub use gather::bandwidths::{FoundPhotons, GatherBandwidths, LevelBandwidths, PhotonCounter};
pub use gather::photon_batch::Scratch;
pub use gather::volume::Volume;
pub use light::vertex_counts::VertexCounts;
pub use light::{Emitted, EqualFlux, LightPaths, Photons, emitted_flux, light_path};
pub use walk::camera_paths::{CameraPathStart, CameraPaths, Indirect};
pub use walk::cause::Cause;
pub use walk::direct::{balance, direct_light};
pub use walk::initial_media::{InitialMedia, InitialMedium};
pub use walk::interior::{Crossing, Interior};
pub use walk::light_samples::LightBinsOf;
pub use walk::lobe_layers::{FirstScatter, LobeLayer, LobeLight, LobeRecord};
pub use walk::pass_through::{BulbHit, PassThroughHit};
pub use walk::pixel_sample::{Features, INNER_AREAS, MAX_LEVELS, PixelSample};
pub use walk::probe::{GatherPoint, Probe};
pub use walk::roulette::{MAX_SPLITS, SPARED_BY_ROULETTE};
pub use walk::scattering_vertex::{ScatterPoint, lit_side};
pub use walk::segment::{
    Arrival, End, FirstHit, HOLE, MediumArrival, PrecomputedHit, ShadowRay, Start, Visibility, next_surface, shadow_ray,
};
pub use walk::vertex::{MediumLight, MediumVertex, Next, Scattered, Vertex, Visitor};
pub use walk::visible::{PointOnRay, Through, Visible, last_ray, visible_surface};
pub use walk::{CUT_INTERVAL, PathStart, walk};
