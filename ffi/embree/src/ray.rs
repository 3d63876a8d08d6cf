//! Rays and hits.

use crate::api::{INVALID_GEOMETRY_ID, RawHit, RawRay};
use crate::geometry::GeometryId;

/// A segment of a ray: the points `origin + t * direction` with `tmin <= t <= tmax`.
///
/// A ray with NaN or with a coordinate beyond the limit of the scene hits nothing. The limit is 1.844e18 in scenes
/// without instances, and at least 1e9 in others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Origin of the ray, the point at t = 0.
    pub origin: [f32; 3],
    /// Direction of the ray, of any length. The length is the unit of t.
    pub direction: [f32; 3],
    /// Smallest t of a hit. Negative values count as 0.
    pub tmin: f32,
    /// Largest t of a hit; may be infinite. A ray with `tmax < tmin` hits nothing.
    pub tmax: f32,
    /// Caller's number for the ray, passed to filters as [`Candidate::token`](crate::Candidate::token). It has no other
    /// effect.
    pub token: u32,
}

/// The nearest hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance from the origin in units of the length of the ray's direction. Like u and v, it has an error of a few
    /// units in the last place, because Embree divides by an approximate reciprocal.
    pub t: f32,
    /// Barycentric coordinate of the triangle's second corner: the point hit is
    /// `(1 - u - v) * p0 + u * p1 + v * p2`.
    pub u: f32,
    /// Barycentric coordinate of the triangle's third corner.
    pub v: f32,
    /// Normal of the triangle, `cross(p1 - p0, p2 - p0)`, not normalized. For a hit in an instance, in the space of the
    /// mesh before the transform.
    pub ng: [f32; 3],
    /// Index of the triangle in the mesh.
    pub primitive: u32,
    /// Id of the mesh in the scene that it was added to.
    pub geometry: GeometryId,
    /// Id of the instance in the traced scene; `None` for meshes of that scene.
    pub instance: Option<GeometryId>,
}

impl Hit {
    /// The hit that Embree has written to `hit`, at the distance `t`.
    #[inline(always)]
    pub(crate) fn new(t: f32, hit: &RawHit) -> Hit {
        Hit {
            t,
            u: hit.u,
            v: hit.v,
            ng: hit.ng,
            primitive: hit.primitive,
            geometry: GeometryId(hit.geometry),
            instance: (hit.instance != INVALID_GEOMETRY_ID).then_some(GeometryId(hit.instance)),
        }
    }
}

impl RawRay {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> RawRay {
        RawRay {
            origin: ray.origin,
            tnear: ray.tmin.max(0.0),
            direction: ray.direction,
            time: 0.0,
            tfar: ray.tmax,
            mask: u32::MAX,
            id: ray.token,
            flags: 0,
        }
    }

    /// Whether the ray's segment is not empty and its coordinates are at most `max_coordinate`.
    ///
    /// Embree must not trace any other ray: a library built with assertions, such as Debian's 3.13.5, aborts the
    /// program, and `occluded` needs a `tfar` that is not negative.
    #[inline(always)]
    pub(crate) fn is_valid(&self, max_coordinate: f32) -> bool {
        // This form rejects NaN and has no branches.
        let within = |x: f32| x.abs() <= max_coordinate;
        let [a, b, c] = self.origin.map(within);
        let [d, e, f] = self.direction.map(within);
        a & b & c & d & e & f & (self.tnear <= self.tfar)
    }
}
