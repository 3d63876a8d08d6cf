//! Axis-aligned boxes: a lower and an upper corner.

use super::{DVec3, Vec3};

/// The bounding box of points. Without points, its lower corner is above the upper one.
pub fn bounding_box(points: impl IntoIterator<Item = Vec3>) -> (Vec3, Vec3) {
    let nothing = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    points.into_iter().fold(nothing, |(low, high), p| (low.min(p), high.max(p)))
}

/// [`bounding_box`] in f64.
pub fn bounding_box_f64(points: impl IntoIterator<Item = DVec3>) -> (DVec3, DVec3) {
    let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    points.into_iter().fold(nothing, |(low, high), p| (low.min(p), high.max(p)))
}

/// The corners of a box.
pub fn corners((low, high): (Vec3, Vec3)) -> [Vec3; 8] {
    std::array::from_fn(|i| Vec3::select(glam::BVec3::new(i & 1 == 1, i & 2 == 2, i & 4 == 4), high, low))
}
