//! Vectors and transforms (from glam), orthonormal frames, angles, sample warps and colours.

mod angle;
mod bounds;
mod frame;
mod rgb;
mod spherical_triangle;
pub mod warp;

pub use angle::{atan2_turns, sin_cos_octant, sin_cos_turns};
pub use bounds::{bounding_box, bounding_box_f64, corners};
pub use frame::{Frame, orthonormal_basis};
pub use glam::{
    Affine3A, DAffine3, DMat3, DMat4, DVec2, DVec3, DVec4, Mat2, Mat3, Mat3A, UVec2, Vec2, Vec3, Vec3A, Vec4,
};
pub use rgb::{Rgb, is_lit, luminance};
pub use spherical_triangle::SphericalTriangle;

/// Square of a number.
#[inline]
pub fn sqr(x: f32) -> f32 {
    x * x
}

/// 1 minus the cosine of the angle between two unit vectors. It is computed from the chord, because 1 minus a dot
/// product loses all digits at small angles.
#[inline]
pub fn one_minus_cos(a: Vec3, b: Vec3) -> f32 {
    0.5 * (a - b).length_squared()
}
