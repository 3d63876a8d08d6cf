//! Rays and what they hit. The hot path: no allocation, no lock, one call through a C function pointer.

use crate::api::{INVALID_GEOMETRY_ID, RawHit, RawRay, RawRayHit, RawRayHit8, Valid8};
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
        (raw.hit.geometry != INVALID_GEOMETRY_ID).then(|| Hit::new(raw.ray.tfar, &raw.hit))
    }

    /// Calls `each` with every hit on the segment, in no order. For few and short rays: each hit is a call back from
    /// Embree.
    pub fn each_hit(&self, ray: &Ray, each: &mut dyn FnMut(Hit)) {
        let mut raw = RawRayHit { ray: RawRay::new(ray), hit: RawHit::MISS };
        if !raw.ray.is_valid(self.reach) {
            return;
        }
        let mut each = each;
        // SAFETY: as in `intersect`; the filters take what they are given here.
        unsafe { self.trace.intersect_filtered(self.raw, &mut raw, filter::REPORT, &raw mut each) };
        filter::resume_panic();
    }

    /// Calls `each` with the nearest hits of up to eight rays that go much the same way, as those of neighbouring
    /// pixels do: faster than one by one. `ray(k)` is ray k of 8, if there is one.
    ///
    /// Ties and rays through edges may be decided otherwise than by [`Scene::intersect`]; which rays are traced
    /// together decides, nothing else.
    #[inline]
    pub fn intersect8(&self, ray: impl Fn(usize) -> Option<Ray>, mut each: impl FnMut(usize, Hit)) {
        if !self.packets {
            for k in 0..8 {
                if let Some(hit) = ray(k).and_then(|ray| self.intersect(&ray)) {
                    each(k, hit);
                }
            }
            return;
        }
        let missed = [INVALID_GEOMETRY_ID; 8];
        let mut valid = Valid8([0; 8]);
        let mut all = RawRayHit8 {
            origin: [[0.0; 8]; 3],
            tnear: [0.0; 8],
            // Rays that are not traced are given a direction and no length.
            direction: [[0.0; 8], [0.0; 8], [1.0; 8]],
            time: [0.0; 8],
            tfar: [-1.0; 8],
            mask: [u32::MAX; 8],
            id: [0; 8],
            flags: [0; 8],
            ng: [[0.0; 8]; 3],
            u: [0.0; 8],
            v: [0.0; 8],
            primitive: missed,
            geometry: missed,
            instance: missed,
            instance_primitive: missed,
        };
        for k in 0..8 {
            let Some(raw) = ray(k).map(|ray| RawRay::new(&ray)).filter(|ray| ray.is_valid(self.reach)) else {
                continue;
            };
            valid.0[k] = -1;
            for a in 0..3 {
                all.origin[a][k] = raw.origin[a];
                all.direction[a][k] = raw.direction[a];
            }
            (all.tnear[k], all.tfar[k], all.id[k]) = (raw.tnear, raw.tfar, raw.id);
        }
        // SAFETY: the scene is committed and alive; the structure is initialised and as large as any version's;
        // `packets` says that the device supports them.
        unsafe { self.trace.intersect8(&valid, self.raw, &mut all) };
        for k in 0..8 {
            if all.geometry[k] == INVALID_GEOMETRY_ID {
                continue;
            }
            let hit = Hit {
                t: all.tfar[k],
                u: all.u[k],
                v: all.v[k],
                ng: all.ng.map(|n| n[k]),
                primitive: all.primitive[k],
                geometry: GeometryId(all.geometry[k]),
                instance: (all.instance[k] != INVALID_GEOMETRY_ID).then_some(GeometryId(all.instance[k])),
            };
            each(k, hit);
        }
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
