//! Ray queries. This is the hot path: it has no allocation and no lock, and one call through a C function pointer.

use crate::api::{INVALID_GEOMETRY_ID, RawHit, RawRay, RawRayHit, RawRayHit8, Valid8};
use crate::filter;
use crate::geometry::GeometryId;
use crate::ray::{Hit, Ray};
use crate::scene::Scene;

impl Scene {
    /// The nearest hit on the ray's segment; `None` if nothing is hit.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut raw = RawRayHit { ray: RawRay::new(ray), hit: RawHit::MISS };
        if !raw.ray.is_valid(self.max_ray_coordinate) {
            return None;
        }
        // SAFETY: the scene is committed and alive. The structure is initialised and large enough for the library,
        // which was tested when the library was loaded.
        unsafe { self.trace.intersect(self.raw, &mut raw) };
        if self.filtered {
            filter::resume_panic();
        }
        (raw.hit.geometry != INVALID_GEOMETRY_ID).then(|| Hit::new(raw.ray.tfar, &raw.hit))
    }

    /// Calls `each` with every hit on the ray's segment, in arbitrary order. Slow, because each hit is a callback from
    /// Embree: meant for few and short rays.
    pub fn each_hit(&self, ray: &Ray, each: &mut dyn FnMut(Hit)) {
        let mut raw = RawRayHit { ray: RawRay::new(ray), hit: RawHit::MISS };
        if !raw.ray.is_valid(self.max_ray_coordinate) {
            return;
        }
        let mut each = each;
        // SAFETY: as in `intersect`. The user data has the type that the filters expect.
        unsafe { self.trace.intersect_filtered(self.raw, &mut raw, filter::REPORT_FILTERS, &raw mut each) };
        filter::resume_panic();
    }

    /// Traces up to eight rays of similar directions, such as those of neighbouring pixels, and calls `each` with the
    /// number, 0 to 7, and nearest hit of every ray that hits. Faster than [`Scene::intersect`] for each ray. `ray(k)`
    /// is ray k of 8, if there is one.
    ///
    /// For ties and rays through edges, the hit may differ from that of [`Scene::intersect`]. It depends only on the
    /// rays of the packet.
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
            // Rays that are not traced have a direction and a negative length.
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
            let Some(raw) = ray(k).map(|ray| RawRay::new(&ray)).filter(|ray| ray.is_valid(self.max_ray_coordinate))
            else {
                continue;
            };
            valid.0[k] = -1;
            for a in 0..3 {
                all.origin[a][k] = raw.origin[a];
                all.direction[a][k] = raw.direction[a];
            }
            (all.tnear[k], all.tfar[k], all.id[k]) = (raw.tnear, raw.tfar, raw.id);
        }
        // SAFETY: the scene is committed and alive. The structure is initialised and large enough for all versions.
        // `packets` is true, so the device supports packets.
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

    /// Whether anything is hit on the ray's segment.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut raw = RawRay::new(ray);
        if !raw.is_valid(self.max_ray_coordinate) {
            return false;
        }
        // SAFETY: as in `intersect`.
        unsafe { self.trace.occluded(self.raw, &mut raw) };
        if self.filtered {
            filter::resume_panic();
        }
        // Embree sets `tfar` to minus infinity if there is a hit, and else leaves it unchanged.
        raw.tfar < 0.0
    }
}
