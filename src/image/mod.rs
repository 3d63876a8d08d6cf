//! Pictures in files: EXR in and out, PNG, tone mapping, error metrics.

pub mod atomic;
pub mod exr;
pub mod png;
pub mod tonemap;
