//! Vectors (glam), frames, transforms, warps, colour.

mod frame;
mod rgb;
pub mod warp;

pub use frame::{Frame, orthonormal_basis};
pub use glam::{Affine3A, DAffine3, DMat3, DMat4, DVec2, DVec3, DVec4, Mat3, Mat3A, UVec2, Vec2, Vec3, Vec3A, Vec4};
pub use rgb::{Rgb, is_lit, luminance};

/// `x * x`.
#[inline]
pub fn sqr(x: f32) -> f32 {
    x * x
}

/// 1 - cos of the angle between unit vectors, from the chord: exact for small angles, where the cosine itself has no
/// digits left.
#[inline]
pub fn one_minus_cos(a: Vec3, b: Vec3) -> f32 {
    0.5 * (a - b).length_squared()
}
