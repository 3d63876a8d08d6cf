//! Light transport: the one bounce loop, and the visitors that make algorithms of it.

mod direct;
mod eye;
mod interior;
mod light;
mod path;
mod segment;
mod walk;

pub use direct::{balance, direct_light};
pub use eye::{Eye, EyeMeasure, Features, FirstHit, GatherPoint, LevelRadii, MAX_LEVELS, same_surface};
pub use interior::{Crossing, Interior, Surroundings};
pub use light::{Emitted, LightPass, light_path};
pub use path::path_radiance;
pub use segment::{Arrival, End, next_surface, transmittance};
pub use walk::{Next, PathStart, Scattered, Vertex, Visitor, walk};
