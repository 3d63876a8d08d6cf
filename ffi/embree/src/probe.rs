//! Tests a library before it is used: reads its version, and checks that its structures have the expected layout.
//!
//! A C library does not report its build options. Some of them move fields (more than one level of instances) or
//! disable filter functions. So a ray is traced to a triangle in an instance, with guard bytes behind the structure
//! that Embree fills.

use std::mem::offset_of;
use std::sync::Arc;

use caustique_library::Version;

use crate::api::{self, Common, RawRay, RawRayHit};
use crate::device::Device;
use crate::error::Error;
use crate::geometry::GeometryId;
use crate::library::Library;
use crate::ray::Ray;
use crate::scene::{Scene, SceneBuilder};

/// The version of Embree that a device of the library reports, or the reason why it cannot be found.
pub fn version(common: &Common) -> Result<Version, String> {
    // SAFETY: the configuration is a C string, a null device is not used further, and the device is released once.
    unsafe {
        let device = (common.new_device)(c"threads=1".as_ptr());
        if device.is_null() {
            let reason = api::error_name((common.device_error)(device));
            return Err(format!("Embree cannot make a device: {reason}"));
        }
        let property = |name| (common.device_property)(device, name) as u32;
        let version = Version {
            major: property(api::DEVICE_PROPERTY_VERSION_MAJOR),
            minor: property(api::DEVICE_PROPERTY_VERSION_MINOR),
            patch: property(api::DEVICE_PROPERTY_VERSION_PATCH),
        };
        (common.release_device)(device);
        Ok(version)
    }
}

/// Tests the library in a small scene. Returns the number of bytes of Embree's structure `RTCRayHit` that it writes, or
/// the reason why it cannot be used.
pub fn try_out(library: &Library) -> Result<usize, String> {
    let scene = trial_scene(library).map_err(|error| format!("the trial scene failed: {error}"))?;
    let ray = Ray { origin: [5.25, 0.25, 2.0], direction: [0.0, 0.0, -1.0], tmin: 0.0, tmax: 9.0, token: 0 };
    let (raw, extent) = guarded_intersect(&scene, &ray);
    let (hit, room) = (raw.hit, size_of::<RawRayHit>());
    if extent > room {
        return Err(format!("it writes {extent} bytes of a structure that should have at most {room}"));
    }
    let ids = (hit.geometry, hit.instance, hit.primitive);
    let numbers = [raw.ray.tfar, hit.u, hit.v];
    // Not exactly equal, because Embree divides by an approximate reciprocal.
    let close = numbers.iter().zip([2.0, 0.25, 0.25]).all(|(a, b)| (a - b).abs() < 1e-4);
    if ids != (3, 7, 1) || !close {
        return Err(format!(
            "it does not find the trial triangle where it is, but {ids:?} at {numbers:?}: unknown build options"
        ));
    }
    if !scene.occluded(&ray) || scene.intersect(&Ray { token: 1, ..ray }).is_some() {
        return Err("it does not test occlusion or call filters as it should: unknown build options".into());
    }
    let mut reported = Vec::new();
    scene.each_hit(&ray, &mut |hit| reported.push((hit.geometry.0, hit.instance.map(|id| id.0), hit.primitive, hit.t)));
    if !matches!(reported[..], [(3, Some(7), 1, t)] if (t - 2.0).abs() < 1e-4) {
        return Err(format!(
            "it does not call filters of rays as it should, but reports {reported:?}: unknown build options"
        ));
    }
    Ok(extent)
}

/// A scene for the test: triangle 1 of mesh 3 inside instance 7, moved 5 along x, invisible to rays of token 1.
fn trial_scene(library: &Library) -> Result<Scene, Error> {
    let device = Device::new(library, 1)?;
    let mut child = SceneBuilder::new(&device)?;
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
    child.triangles(GeometryId(3), &corners, &[[0, 2, 3], [0, 1, 2]])?;
    child.filter(GeometryId(3), Arc::new(|candidate| candidate.token != 1))?;
    let child = child.commit()?;
    let mut parent = SceneBuilder::new(&device)?;
    let moved = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 5.0, 0.0, 0.0];
    parent.instance(GeometryId(7), &child, &moved)?;
    parent.commit()
}

const GUARD: u8 = 0xAB;

/// Memory for Embree's structure `RTCRayHit` and for bytes that a library might write behind it.
#[repr(C, align(64))]
struct Guarded([u8; 512]);

/// Traces a ray with guard bytes in place of the hit and behind it. Returns the ray and hit, and the offset behind the
/// last byte that changed.
fn guarded_intersect(scene: &Scene, ray: &Ray) -> (RawRayHit, usize) {
    let mut buffer = Guarded([GUARD; 512]);
    let start = buffer.0.as_mut_ptr();
    // SAFETY: both writes are aligned and inside `buffer`. Embree requires an invalid id of the geometry. The pointer
    // is valid for all of `buffer`, so the library may write behind the structure.
    unsafe {
        start.cast::<RawRay>().write(RawRay::new(ray));
        start.add(offset_of!(RawRayHit, hit.geometry)).cast::<u32>().write(api::INVALID_GEOMETRY_ID);
        scene.trace.intersect(scene.raw, start.cast());
    }
    let end = buffer.0.iter().rposition(|&byte| byte != GUARD).map_or(0, |last| last + 1);
    // SAFETY: `buffer` is large enough, aligned and initialised, and all bit patterns are valid for `RawRayHit`.
    (unsafe { buffer.0.as_ptr().cast::<RawRayHit>().read() }, end)
}
