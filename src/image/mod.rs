//! Image files and their comparison: EXR, PNG, tone mapping, error metrics.

pub mod atomic;
pub mod exr;
mod filmic;
pub mod flip;
pub mod heat;
pub mod inside;
pub mod metrics;
pub mod outputs;
pub mod png;
pub mod tonemap;
pub mod usd_layer;
pub mod window;

pub use inside::{SMOOTH_MATERIALS, smooth_pixels};
pub use metrics::{
    Comparison, Errors, Floor, Inside, compare, compare_windows, compare_with_floor, errors, relative_squared_error,
};
pub use outputs::Outputs;
pub use window::Windowed;
