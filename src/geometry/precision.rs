//! Bounds on the rounding errors of positions on triangles, and ray origins and ends that are offset by them.

use crate::math::Vec3;

/// Relative rounding error of a coordinate computed from barycentric coordinates and a transform: eight roundings, of
/// which four are in the transform, two in the barycentric interpolation, and two in the corners that Embree computes.
const POSITION_ERROR: f32 = 8.0 * f32::EPSILON;

/// Rounding error of a component of the triangle normal that Embree computes, relative to the products that it is a
/// difference of: two roundings for the products and the difference, two for the edges.
const NORMAL_ERROR: f32 = 4.0 * f32::EPSILON;

/// Rounding error of the distance between a plane and the end of a ray, relative to the length of the ray: four
/// roundings in the direction and four in Embree's distance to the triangle.
const RAY_ERROR: f32 = 8.0 * f32::EPSILON;

/// Smallest bound on rounding errors (m), so that ray origins are off the surface even at the origin of the scene.
const MIN_ERROR: f32 = 1e-30;

/// The size and position of a triangle, which determine the rounding errors of points on it.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Largest absolute coordinate per axis, of the corners and of all terms that they were computed from.
    pub largest: Vec3,
    /// Two edges of the triangle.
    pub edges: [Vec3; 2],
}

impl Extent {
    /// The extent of a triangle with these corners.
    #[inline]
    pub fn from_corners(corners: [Vec3; 3]) -> Extent {
        let [a, b, c] = corners.map(Vec3::abs);
        Extent { largest: a.max(b).max(c), edges: [corners[1] - corners[0], corners[2] - corners[0]] }
    }

    /// Bound (m) on the distance of a computed position from the triangle's plane as Embree's arithmetic sees it.
    /// Errors within the plane do not matter, so a wide flat floor has the small error of its height.
    ///
    /// The distance to a plane is the sum over axes of normal times coordinate, so each term contributes the error of
    /// its normal and of its coordinate.
    #[inline]
    pub fn plane_error(&self) -> f32 {
        let [a, b] = self.edges;
        let normal = a.cross(b);
        let (a, b) = (a.abs(), b.abs());
        let products = Vec3::new(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x);
        let from_position = POSITION_ERROR * self.largest.dot(normal.abs());
        let from_normal = NORMAL_ERROR * a.max(b).dot(products);
        // The bound is too wide for slivers. Eight roundings of the largest coordinate were enough in all tests.
        let bound = (from_position + from_normal) / normal.length();
        bound.min(POSITION_ERROR * self.largest.max_element())
    }
}

/// Bound (m) on the distance between coinciding objects at `p` that is due to the rounding of their coordinates.
#[inline]
pub fn coordinate_error(p: Vec3) -> f32 {
    f32::EPSILON * p.abs().max_element() + MIN_ERROR
}

/// Bound (m) on the distance of a computed position from the plane of a triangle with these corners.
#[inline]
pub fn triangle_error(corners: [Vec3; 3]) -> f32 {
    let extent = Extent::from_corners(corners);
    extent.plane_error() + coordinate_error(extent.largest)
}

/// Origin of a ray along `direction` from a point `p` of a triangle with unit normal `ng`: moved off the triangle by
/// `error` (m) to the side that the direction points to.
#[inline]
pub fn offset_origin(p: Vec3, ng: Vec3, direction: Vec3, error: f32) -> Vec3 {
    p + ng * error.copysign(direction.dot(ng))
}

/// End of a shadow ray of length `distance` at a point `p`, with error bound `error`, of a triangle with unit normal
/// `ng`. The end is moved off the triangle to the side that `direction` (back along the ray) points to, so that the
/// triangle does not block the ray.
#[inline]
pub fn shadow_end(p: Vec3, ng: Vec3, direction: Vec3, error: f32, distance: f32) -> Vec3 {
    offset_origin(p, ng, direction, error + RAY_ERROR * distance)
}
