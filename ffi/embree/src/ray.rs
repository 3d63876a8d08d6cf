//! Rays and hits.

use crate::api::{INVALID_GEOMETRY_ID, RawHit, RawRay};
use crate::geometry::GeometryId;

/// A segment of a ray: the points `origin + t * direction` with `tmin <= t <= tmax`.
///
/// A ray with NaN or too large a coordinate hits nothing. Coordinates up to 1e9 are never too large; the limit is
/// 1.844e18 in scenes without instances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where t = 0.
    pub origin: [f32; 3],
    /// Need not be of unit length; t counts in its lengths.
    pub direction: [f32; 3],
    /// Least t of a hit. Values below 0 act as 0.
    pub tmin: f32,
    /// Greatest t of a hit; may be infinite. Below `tmin` there is nothing to hit.
    pub tmax: f32,
    /// Handed to filters as [`Candidate::token`](crate::Candidate::token), and of no other effect.
    pub token: u32,
}

/// The nearest hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance from the origin, in lengths of the ray's direction. Off by a few units in the last place, as u
    /// and v are: Embree divides by an approximate reciprocal.
    pub t: f32,
    /// Barycentric coordinate of the triangle's second corner: the point hit is
    /// `(1 - u - v) * p0 + u * p1 + v * p2`.
    pub u: f32,
    /// Barycentric coordinate of the triangle's third corner.
    pub v: f32,
    /// The triangle's normal `cross(p1 - p0, p2 - p0)`, not normalised, facing wherever the corners' order says.
    /// In the space of the mesh: for a hit in an instance, before its transform.
    pub ng: [f32; 3],
    /// The triangle's place among the mesh's triangles.
    pub primitive: u32,
    /// The mesh, by its id in the scene it was added to.
    pub geometry: GeometryId,
    /// The instance it was reached through, by its id in the scene traced; none for that scene's own meshes.
    pub instance: Option<GeometryId>,
}

impl Hit {
    /// What Embree has written, at `t`.
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

    /// Whether the segment holds any point, and all its numbers are such as Embree takes.
    ///
    /// Asked before Embree is: a library built with assertions, as Debian's 3.13.5 is, aborts the program
    /// on any other ray, and `occluded` tells the answer by the sign of `tfar`.
    #[inline(always)]
    pub(crate) fn is_valid(&self, reach: f32) -> bool {
        // Written so that NaN is invalid, and without branches.
        let within = |x: f32| x.abs() <= reach;
        let [a, b, c] = self.origin.map(within);
        let [d, e, f] = self.direction.map(within);
        a & b & c & d & e & f & (self.tnear <= self.tfar)
    }
}
