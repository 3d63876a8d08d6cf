//! Filters: closures that reject hits, such as those on the clear parts of an alpha cut-out.

use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;

use crate::api::{self, FilterArguments, FilterFunction, INVALID_GEOMETRY_ID, RawHit};
use crate::geometry::GeometryId;
use crate::ray::Hit;

/// A hit that Embree proposes to a filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// The mesh.
    pub geometry: GeometryId,
    /// The instance the mesh was reached through, if any.
    pub instance: Option<GeometryId>,
    /// The triangle's place among the mesh's triangles.
    pub primitive: u32,
    /// Barycentric coordinate of the triangle's second corner.
    pub u: f32,
    /// Barycentric coordinate of the triangle's third corner.
    pub v: f32,
    /// The ray's [`token`](crate::Ray::token).
    pub token: u32,
}

/// Decides on a candidate: `false` rejects it, and the ray goes on.
///
/// Must be a pure function of the candidate: Embree may ask several times for one crossing, in any order, and
/// about crossings behind the nearest.
pub type Filter = Arc<dyn Fn(&Candidate) -> bool + Send + Sync>;

thread_local! {
    /// A panic on its way around Embree's frames, which it must not unwind.
    static PANIC: Cell<Option<Box<dyn Any + Send>>> = const { Cell::new(None) };
}

/// The function Embree calls for meshes with a filter, whose user data is a `*const Filter`.
///
/// # Safety
/// To be called by Embree only, for a ray of [`Scene::intersect`](crate::Scene::intersect) or
/// [`Scene::occluded`](crate::Scene::occluded).
pub unsafe extern "C" fn call(arguments: *const FilterArguments) {
    // SAFETY: Embree passes valid arguments; single rays only are traced, so each pointer is to one item laid
    // out as in `RawRay` and `RawHit` (of which `instance_primitive`, absent in Embree 3, is not read).
    let (valid, filter, hit, token) = unsafe {
        let arguments = &*arguments;
        debug_assert_eq!(arguments.count, 1);
        (&mut *arguments.valid, &*(arguments.user as *const Filter), arguments.hit, (*arguments.ray).id)
    };
    if *valid == 0 {
        return;
    }
    // SAFETY: as above. Fields are read one by one: a reference would claim the whole of a structure that
    // is shorter in Embree 3.
    let candidate = unsafe {
        let instance = (*hit).instance;
        Candidate {
            geometry: GeometryId((*hit).geometry),
            instance: (instance != INVALID_GEOMETRY_ID).then_some(GeometryId(instance)),
            primitive: (*hit).primitive,
            u: (*hit).u,
            v: (*hit).v,
            token,
        }
    };
    match catch_unwind(AssertUnwindSafe(|| filter(&candidate))) {
        Ok(true) => {}
        Ok(false) => *valid = 0,
        // The hit is accepted so that the ray soon ends.
        Err(panic) => PANIC.set(Some(panic)),
    }
}

/// Filters of a ray, for Embree 3 and 4, that hand every hit to the closure `&mut dyn FnMut(Hit)` beside them, and let
/// none stop the ray.
pub const REPORT: [FilterFunction; 2] = [report::<3>, report::<4>];

/// # Safety
/// To be called by Embree only, for [`Scene::each_hit`](crate::Scene::each_hit).
unsafe extern "C" fn report<const MAJOR: u32>(arguments: *const FilterArguments) {
    // SAFETY: as for `call`; beside the context is a pointer to the closure, which lives through the call.
    let (valid, hit, t, each) = unsafe {
        let arguments = &*arguments;
        debug_assert_eq!(arguments.count, 1);
        let each = &mut *api::beside::<MAJOR, &mut dyn FnMut(Hit)>(arguments);
        (&mut *arguments.valid, arguments.hit, (*arguments.ray).tfar, each)
    };
    if *valid == 0 {
        return;
    }
    *valid = 0;
    // SAFETY: as for `call`: what is read is there in Embree 3, too, and the rest is never looked at.
    let hit = unsafe {
        let (ng, u, v) = ((*hit).ng, (*hit).u, (*hit).v);
        let (primitive, geometry, instance) = ((*hit).primitive, (*hit).geometry, (*hit).instance);
        Hit::new(t, &RawHit { ng, u, v, primitive, geometry, instance, instance_primitive: INVALID_GEOMETRY_ID })
    };
    if let Err(panic) = catch_unwind(AssertUnwindSafe(|| each(hit))) {
        PANIC.set(Some(panic));
    }
}

/// Lets a panic of a filter go on, now that Embree has returned.
#[inline]
pub fn resume_panic() {
    if let Some(panic) = PANIC.take() {
        resume_unwind(panic);
    }
}
