//! How exact positions on triangles are, and how far off them rays start and end.

use crate::math::Vec3;

/// Relative error of a coordinate computed from barycentric coordinates and a transform: eight roundings, which are the
/// products and sums of a transform (four), of barycentric coordinates (two), and those of Embree's own corners (two).
const POSITION_ERROR: f32 = 8.0 * f32::EPSILON;

/// Relative error of a triangle's normal, as Embree computes it, in units of the products that its components are the
/// differences of: two products and a difference (two), and edges that are differences themselves (two).
const NORMAL_ERROR: f32 = 4.0 * f32::EPSILON;

/// Relative error of the distance between a plane and the end of a ray, in units of the ray's length: roundings of its
/// direction (four) and of Embree's own distance to the triangle (four).
const RAY_ERROR: f32 = 8.0 * f32::EPSILON;

/// Rays start off every surface by more than nothing.
const LEAST: f32 = 1e-30;

/// A triangle in world space, as far as the error of positions on it goes.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Largest coordinates of its corners by axis, and of all that they were computed from.
    pub largest: Vec3,
    /// Two of its edges.
    pub edges: [Vec3; 2],
}

impl Extent {
    /// Of a triangle with these corners.
    #[inline]
    pub fn of(corners: [Vec3; 3]) -> Extent {
        let [a, b, c] = corners.map(Vec3::abs);
        Extent { largest: a.max(b).max(c), edges: [corners[1] - corners[0], corners[2] - corners[0]] }
    }

    /// How far computed positions may be off the triangle's plane, and Embree may see that plane from them. A shift
    /// within the plane hides nothing, so that the floor of a wide landscape is as exact as its height.
    ///
    /// A plane's distance is a sum over axes of normal times coordinate: each term is off by the errors of both.
    #[inline]
    pub fn plane_error(&self) -> f32 {
        let [a, b] = self.edges;
        let normal = a.cross(b);
        let (a, b) = (a.abs(), b.abs());
        let products = Vec3::new(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x);
        let by_position = POSITION_ERROR * self.largest.dot(normal.abs());
        let by_normal = NORMAL_ERROR * a.max(b).dot(products);
        // The sum is a bound, wide for slivers; eight roundings of the largest coordinate have always been enough.
        let bound = (by_position + by_normal) / normal.length();
        bound.min(POSITION_ERROR * self.largest.max_element())
    }
}

/// How far objects at a point `p` may be off each other because their coordinates are rounded.
#[inline]
pub fn coordinate_error(p: Vec3) -> f32 {
    f32::EPSILON * p.abs().max_element() + LEAST
}

/// How far off the plane of a triangle with these corners a position on it may be (scene units).
#[inline]
pub fn triangle_error(corners: [Vec3; 3]) -> f32 {
    let extent = Extent::of(corners);
    extent.plane_error() + coordinate_error(extent.largest)
}

/// [`Surface::ray_origin`](super::Surface::ray_origin) for a point of a triangle with unit normal `ng` that may be off by `error`.
#[inline]
pub fn offset_origin(p: Vec3, ng: Vec3, direction: Vec3, error: f32) -> Vec3 {
    p + ng * error.copysign(direction.dot(ng))
}

/// The end of a shadow ray of length `distance` towards a point of a triangle with unit normal `ng` that may be off by
/// `error`: moved off the triangle, to the side that `direction` points to (back along the ray), so that the triangle
/// does not block the ray that ends on it.
#[inline]
pub fn shadow_end(p: Vec3, ng: Vec3, direction: Vec3, error: f32, distance: f32) -> Vec3 {
    offset_origin(p, ng, direction, error + RAY_ERROR * distance)
}
