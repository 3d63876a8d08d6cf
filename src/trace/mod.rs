//! Rays and what they hit: the scene's geometry committed to Embree.

mod tracer;

pub use tracer::{CAMERA, Hit, MeetsTest, Ray, Tracer};
