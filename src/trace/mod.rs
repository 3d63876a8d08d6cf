//! Ray tracing: the scene's geometry in Embree.

mod tracer;

pub use tracer::{CAMERA_RAY_BIT, Hit, HitFilter, LINKING_BITS, LINKING_SHIFT, Ray, Tracer, library, origin};
