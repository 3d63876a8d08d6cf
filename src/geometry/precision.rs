//! How exact positions on triangles are, and how far off them rays start.

use crate::math::Vec3;

/// Relative error of a position computed from barycentric coordinates and a transform, in units of the largest
/// coordinate of the position and of its triangle's corners: eight roundings, where the products and sums of a
/// transform (four), of barycentric coordinates (two), and those of Embree's own corners (two) are.
const POSITION_ERROR: f32 = 8.0 * f32::EPSILON;

/// How far from its triangle a position may be, where no coordinate of either is larger than `largest` (scene units).
#[inline]
pub(super) fn error_within(largest: f32) -> f32 {
    POSITION_ERROR * largest
}

/// The same for the points of a triangle with these corners in world space.
#[inline]
pub fn error(corners: [Vec3; 3]) -> f32 {
    let [a, b, c] = corners.map(Vec3::abs);
    error_within(a.max(b).max(c).max_element())
}

/// Relative error of the distance between a plane and the end of a ray, in units of the ray's length: roundings of its
/// direction (four) and of Embree's own distance to the triangle (four).
const RAY_ERROR: f32 = 8.0 * f32::EPSILON;

/// [`Surface::spawn`](super::Surface::spawn) for a point of a triangle with unit normal `ng` that may be off by `error`.
#[inline]
pub fn spawn(p: Vec3, ng: Vec3, direction: Vec3, error: f32) -> Vec3 {
    p + ng * error.copysign(direction.dot(ng))
}

/// The end of a shadow ray of length `distance` towards a point of a triangle with unit normal `ng` that may be off by
/// `error`: moved off the triangle, to the side that `direction` points to (back along the ray), so that the triangle
/// does not block the ray that ends on it.
#[inline]
pub fn shadow_end(p: Vec3, ng: Vec3, direction: Vec3, error: f32, distance: f32) -> Vec3 {
    spawn(p, ng, direction, error + RAY_ERROR * distance)
}
