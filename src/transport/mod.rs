//! Light transport: the one bounce loop, and the visitors that make algorithms of it.

pub mod bidirectional;
mod bidirectional_eye;
mod bidirectional_light;
mod direct;
mod eye;
mod flight;
mod gather;
mod interior;
mod lengths;
mod light;
pub mod mis;
mod path;
mod photon_merge;
mod probe;
mod segment;
mod shares;
mod site;
mod volume;
mod walk;

pub use bidirectional::{Bidirectional, LightVertex, MergeLevels, Record, Scatterer, Strategies, Technique};
pub use bidirectional_eye::Meets;
pub use bidirectional_light::{Left, LightVertices, Splat};
pub use direct::{balance, direct_light};
pub use eye::{Bandwidths, Eye, EyeMeasure, Features, FirstHit, Found, Indirect, LevelRadii, MAX_LEVELS};
pub use gather::Scratch;
pub use interior::{Crossing, Interior, Surroundings};
pub use lengths::Lengths;
pub use light::{Emitted, EqualFlux, LightPass, Photons, light_path};
pub use path::{path_measure, path_radiance};
pub use photon_merge::MergePhoton;
pub use probe::{GatherPoint, Probe};
pub use segment::{Arrival, End, Known, MediumArrival, Way, next_surface, transmittance, way};
pub use site::{MediumVertex, Site, lit_side};
pub use volume::Volume;
pub use walk::{Next, PathStart, Scattered, Vertex, Visitor, walk};
