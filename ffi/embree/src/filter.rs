//! Filters: closures that reject hits, such as those on the clear parts of an alpha cut-out.

use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;

use crate::api::{self, FilterArguments, FilterFunction, INVALID_GEOMETRY_ID, RawHit};
use crate::geometry::GeometryId;
use crate::ray::Hit;

/// A possible hit of a ray with a triangle, which a filter accepts or rejects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Id of the mesh that is hit.
    pub geometry: GeometryId,
    /// Id of the instance of the mesh; `None` if the mesh belongs to the traced scene itself.
    pub instance: Option<GeometryId>,
    /// Index of the triangle in the mesh.
    pub primitive: u32,
    /// Barycentric coordinate of the triangle's second corner.
    pub u: f32,
    /// Barycentric coordinate of the triangle's third corner.
    pub v: f32,
    /// Caller's number for the ray, its [`token`](crate::Ray::token).
    pub token: u32,
}

/// A callback that accepts a candidate, a possible hit, by returning true. If it returns false, the ray continues.
///
/// Must be a pure function of the candidate: Embree may call it several times for one intersection, in any order, and
/// for intersections behind the nearest one.
pub type Filter = Arc<dyn Fn(&Candidate) -> bool + Send + Sync>;

thread_local! {
    /// A panic of a filter on this thread, stored until Embree has returned, because it must not unwind through
    /// Embree's frames.
    static PANIC: Cell<Option<Box<dyn Any + Send>>> = const { Cell::new(None) };
}

/// The filter function that Embree calls for a mesh whose user data is a `*const Filter`.
///
/// # Safety
/// To be called by Embree only, for a ray of [`Scene::intersect`](crate::Scene::intersect) or
/// [`Scene::occluded`](crate::Scene::occluded).
pub unsafe extern "C" fn call(arguments: *const FilterArguments) {
    // SAFETY: Embree passes valid arguments. Meshes with a filter are traced by single rays only, so each pointer is to
    // one item laid out as in `RawRay` and `RawHit`. `instance_primitive`, which Embree 3 lacks, is not read.
    let (valid, filter, hit, token) = unsafe {
        let arguments = &*arguments;
        debug_assert_eq!(arguments.count, 1);
        (&mut *arguments.valid, &*(arguments.user as *const Filter), arguments.hit, (*arguments.ray).id)
    };
    if *valid == 0 {
        return;
    }
    // SAFETY: as above. Fields are read one by one, because the structure is shorter in Embree 3, and a reference would
    // claim all of it.
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
        // Accepting the hit ends the ray early.
        Err(panic) => PANIC.set(Some(panic)),
    }
}

/// Per-ray filters for Embree 3 and 4 that pass every hit to a closure `&mut dyn FnMut(Hit)`, which is the user data of
/// the ray's context, and then reject it.
pub const REPORT_FILTERS: [FilterFunction; 2] = [report::<3>, report::<4>];

/// # Safety
/// To be called by Embree only, for [`Scene::each_hit`](crate::Scene::each_hit).
unsafe extern "C" fn report<const MAJOR: u32>(arguments: *const FilterArguments) {
    // SAFETY: as for `call`. The user data of the context is a pointer to the closure, which outlives the call.
    let (valid, hit, t, each) = unsafe {
        let arguments = &*arguments;
        debug_assert_eq!(arguments.count, 1);
        let each = &mut *api::context_user_data::<MAJOR, &mut dyn FnMut(Hit)>(arguments);
        (&mut *arguments.valid, arguments.hit, (*arguments.ray).tfar, each)
    };
    if *valid == 0 {
        return;
    }
    *valid = 0;
    // SAFETY: as for `call`. All fields that are read exist in Embree 3, too.
    let hit = unsafe {
        let (ng, u, v) = ((*hit).ng, (*hit).u, (*hit).v);
        let (primitive, geometry, instance) = ((*hit).primitive, (*hit).geometry, (*hit).instance);
        Hit::new(t, &RawHit { ng, u, v, primitive, geometry, instance, instance_primitive: INVALID_GEOMETRY_ID })
    };
    if let Err(panic) = catch_unwind(AssertUnwindSafe(|| each(hit))) {
        PANIC.set(Some(panic));
    }
}

/// Resumes the stored panic of a filter on this thread, if any, after Embree has returned.
#[inline]
pub fn resume_panic() {
    if let Some(panic) = PANIC.take() {
        resume_unwind(panic);
    }
}
