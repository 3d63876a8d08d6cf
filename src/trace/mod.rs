//! Rays and what they hit: the scene's geometry committed to Embree.

mod tracer;

pub use tracer::{CAMERA_RAY_BIT, Hit, HitFilter, Ray, Tracer};
