//! Rays and what they hit. The hot path: no allocation, no lock, one call through a C function pointer.

use crate::api::{INVALID_GEOMETRY_ID, RawHit, RawRay, RawRayHit};
use crate::filter;
use crate::scene::{GeometryId, Scene};

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

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least x, y and z.
    pub min: [f32; 3],
    /// Greatest x, y and z.
    pub max: [f32; 3],
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
    fn is_valid(&self, reach: f32) -> bool {
        // Written so that NaN is invalid, and without branches.
        let within = |x: f32| x.abs() <= reach;
        let [a, b, c] = self.origin.map(within);
        let [d, e, f] = self.direction.map(within);
        a & b & c & d & e & f & (self.tnear <= self.tfar)
    }
}

impl Scene {
    /// The nearest hit, or none.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut raw = RawRayHit { ray: RawRay::new(ray), hit: RawHit::MISS };
        if !raw.ray.is_valid(self.reach) {
            return None;
        }
        // SAFETY: the scene is committed and alive; the structure is initialised and as large as any
        // version's, which was tried when the library was loaded.
        unsafe { self.trace.intersect(self.raw, &mut raw) };
        if self.filtered {
            filter::resume_panic();
        }
        let RawRayHit { ray, hit } = raw;
        if hit.geometry == INVALID_GEOMETRY_ID {
            return None;
        }
        Some(Hit {
            t: ray.tfar,
            u: hit.u,
            v: hit.v,
            ng: hit.ng,
            primitive: hit.primitive,
            geometry: GeometryId(hit.geometry),
            instance: (hit.instance != INVALID_GEOMETRY_ID).then_some(GeometryId(hit.instance)),
        })
    }

    /// Whether anything lies on the segment.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut raw = RawRay::new(ray);
        if !raw.is_valid(self.reach) {
            return false;
        }
        // SAFETY: as in `intersect`.
        unsafe { self.trace.occluded(self.raw, &mut raw) };
        if self.filtered {
            filter::resume_panic();
        }
        // Embree sets `tfar` to minus infinity, and leaves it as it was otherwise.
        raw.tfar < 0.0
    }
}
