//! Light transport: the one bounce loop, and the visitors that make algorithms of it.

mod bandwidths;
pub mod bidirectional;
mod bidirectional_camera;
mod bidirectional_light;
mod boundary_kernel;
mod camera_paths;
mod cause;
mod direct;
mod flight;
mod gather;
mod glint;
mod initial_media;
mod interior;
mod light;
mod light_vertex;
pub mod mis;
mod pass_through;
mod path;
mod path_history;
mod photon_merge;
mod probe;
mod roulette;
mod scattering_vertex;
mod segment;
mod shares;
mod vertex;
mod vertex_counts;
mod volume;
mod walk;

pub use bandwidths::{Bandwidths, Counter, FoundPhotons, LevelRadii, MAX_LEVELS};
pub use bidirectional::{Bidirectional, Division, MergeLevels, Record, Technique, TechniqueSet};
pub use bidirectional_camera::CameraWalkContext;
pub use bidirectional_light::{Deposits, LightVertices, Splat};
pub use camera_paths::{CameraPaths, Features, Indirect, PixelSample};
pub use cause::Cause;
pub use direct::{balance, direct_light};
pub use gather::Scratch;
pub use initial_media::{InitialMedia, InitialMedium};
pub use interior::{Crossing, Interior};
pub use light::{Emitted, EqualFlux, LightPaths, Photons, emitted_flux, light_path};
pub use light_vertex::{LightVertex, Scatterer};
pub use pass_through::PassThroughHit;
pub use path::{path_radiance, path_sample};
pub use photon_merge::MergePhoton;
pub use probe::{GatherPoint, Probe};
pub use scattering_vertex::{ScatterPoint, lit_side};
pub use segment::{
    Arrival, Between, End, FirstHit, MediumArrival, PrecomputedHit, ShadowRay, Start, next_surface, shadow_ray,
};
pub use vertex::{MediumVertex, Next, Scattered, Vertex, Visitor};
pub use vertex_counts::VertexCounts;
pub use volume::Volume;
pub use walk::{PathStart, walk};
