//! What a scene answers for a ray. The hot path: no allocation, no lock, one call through a C function pointer.

use crate::api::{INVALID_GEOMETRY_ID, RawHit, RawRay, RawRayHit, RawRayHit8, Valid8};
use crate::filter;
use crate::geometry::GeometryId;
use crate::ray::{Hit, Ray};
use crate::scene::Scene;

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
