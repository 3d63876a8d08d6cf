//! The C functions and structures of Embree that this crate uses.
//!
//! Source: `rtcore_*.h` of Embree 3.13.5 and 4.3.3. Definitions that are equal in both versions exist once.

use std::ffi::{c_char, c_void};

/// `RTCDevice`, `RTCScene` or `RTCGeometry`: an opaque pointer, null on failure.
pub type Handle = *mut c_void;

pub const INVALID_GEOMETRY_ID: u32 = u32::MAX;

pub const DEVICE_PROPERTY_VERSION_MAJOR: u32 = 1;
pub const DEVICE_PROPERTY_VERSION_MINOR: u32 = 2;
pub const DEVICE_PROPERTY_VERSION_PATCH: u32 = 3;
/// Device property of Embree: whether the device traces packets of eight rays natively.
pub const DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED: u32 = 33;

pub const GEOMETRY_TYPE_TRIANGLE: u32 = 0;
pub const GEOMETRY_TYPE_INSTANCE: u32 = 121;

pub const BUFFER_TYPE_INDEX: u32 = 0;
pub const BUFFER_TYPE_VERTEX: u32 = 1;

pub const FORMAT_UINT3: u32 = 0x5003;
pub const FORMAT_FLOAT3: u32 = 0x9003;
pub const FORMAT_FLOAT3X4_COLUMN_MAJOR: u32 = 0x9234;

pub const BUILD_QUALITY_MEDIUM: u32 = 1;
pub const SCENE_FLAG_ROBUST: u32 = 1 << 2;
/// Enables per-ray filters: `RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION` of Embree 3, and
/// `RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS` of Embree 4.
pub const SCENE_FLAG_RAY_FILTER: u32 = 1 << 3;

/// The meaning of an `RTCError` code, in words.
pub fn error_name(code: u32) -> &'static str {
    match code {
        2 => "invalid argument",
        3 => "invalid operation",
        4 => "out of memory",
        5 => "this processor is not supported",
        6 => "cancelled",
        _ => "unknown error",
    }
}

/// Embree's structure `RTCRay`.
#[repr(C, align(16))]
#[derive(Clone, Copy)]
pub struct RawRay {
    pub origin: [f32; 3],
    pub tnear: f32,
    pub direction: [f32; 3],
    pub time: f32,
    pub tfar: f32,
    pub mask: u32,
    pub id: u32,
    pub flags: u32,
}

/// Embree's structure `RTCHit` of version 4.3 and later. Earlier versions end before `instance_primitive`.
#[repr(C, align(16))]
#[derive(Clone, Copy)]
pub struct RawHit {
    pub ng: [f32; 3],
    pub u: f32,
    pub v: f32,
    pub primitive: u32,
    pub geometry: u32,
    pub instance: u32,
    pub instance_primitive: u32,
}

/// Embree's structure `RTCRayHit`, a ray and its hit.
#[repr(C, align(16))]
#[derive(Clone, Copy)]
pub struct RawRayHit {
    pub ray: RawRay,
    pub hit: RawHit,
}

const _: () = assert!(size_of::<RawRay>() == 48);
const _: () = assert!(size_of::<RawRayHit>() == 96 && align_of::<RawRayHit>() == 16);
const _: () = assert!(std::mem::offset_of!(RawRayHit, hit.instance_primitive) == 80);

impl RawHit {
    pub const MISS: RawHit = RawHit {
        ng: [0.0; 3],
        u: 0.0,
        v: 0.0,
        primitive: INVALID_GEOMETRY_ID,
        geometry: INVALID_GEOMETRY_ID,
        instance: INVALID_GEOMETRY_ID,
        instance_primitive: INVALID_GEOMETRY_ID,
    };
}

/// Embree's structure `RTCRayHit8`, with one array per field. As in [`RawHit`], `instance_primitive` exists from Embree
/// 4.3 on.
#[repr(C, align(32))]
#[derive(Clone, Copy)]
pub struct RawRayHit8 {
    pub origin: [[f32; 8]; 3],
    pub tnear: [f32; 8],
    pub direction: [[f32; 8]; 3],
    pub time: [f32; 8],
    pub tfar: [f32; 8],
    pub mask: [u32; 8],
    pub id: [u32; 8],
    pub flags: [u32; 8],
    pub ng: [[f32; 8]; 3],
    pub u: [f32; 8],
    pub v: [f32; 8],
    pub primitive: [u32; 8],
    pub geometry: [u32; 8],
    pub instance: [u32; 8],
    pub instance_primitive: [u32; 8],
}

/// Mask of the rays to trace in a packet of eight: for each ray all bits set, or none.
#[repr(C, align(32))]
pub struct Valid8(pub [i32; 8]);

const _: () = assert!(size_of::<RawRayHit8>() == 21 * 32);

/// `RTCIntersectContext` of Embree 3. The last field exists only in builds with `RTC_MIN_WIDTH`; it is padding in
/// others.
#[repr(C)]
pub struct IntersectContext3 {
    flags: u32,
    filter: *const c_void,
    instance: u32,
    min_width_distance_factor: f32,
}

impl IntersectContext3 {
    const COHERENT: IntersectContext3 = IntersectContext3 { flags: 1, ..IntersectContext3::INCOHERENT };
    const INCOHERENT: IntersectContext3 = IntersectContext3 {
        flags: 0,
        filter: std::ptr::null(),
        instance: INVALID_GEOMETRY_ID,
        min_width_distance_factor: 0.0,
    };
}

/// The context of Embree 3, followed by user data for the filter of the ray.
#[repr(C)]
struct Context3 {
    context: IntersectContext3,
    user_data: *mut c_void,
}

/// `RTCRayQueryContext` of Embree 4, followed by user data for the filter of the ray. The second number of `instance`
/// exists only in builds with instance arrays; it is padding in others.
#[repr(C)]
struct Context4 {
    instance: [u32; 2],
    user_data: *mut c_void,
}

const _: () = assert!(std::mem::offset_of!(Context3, user_data) == 24);
const _: () = assert!(std::mem::offset_of!(Context4, user_data) == 8);

/// The user data that was passed to [`Trace::intersect_filtered`], for the major version of Embree.
///
/// # Safety
/// `arguments` must be the arguments with which Embree has called a filter of that function.
pub unsafe fn context_user_data<const MAJOR: u32, T>(arguments: &FilterArguments) -> *mut T {
    // SAFETY: the caller guarantees that the context is one of these structures.
    let user_data = unsafe {
        match MAJOR {
            3 => (*arguments.context.cast::<Context3>()).user_data,
            _ => (*arguments.context.cast::<Context4>()).user_data,
        }
    };
    user_data.cast()
}

/// `RTCIntersectArguments` of Embree 4. The last field exists only in builds with `RTC_MIN_WIDTH`; it is padding in
/// others.
#[repr(C)]
struct IntersectArguments4 {
    flags: u32,
    features: u32,
    context: *const c_void,
    filter: *const c_void,
    intersect: *const c_void,
    min_width_distance_factor: f32,
}

impl IntersectArguments4 {
    const COHERENT: IntersectArguments4 = IntersectArguments4 {
        flags: 1 << 16,
        features: u32::MAX,
        context: std::ptr::null(),
        filter: std::ptr::null(),
        intersect: std::ptr::null(),
        min_width_distance_factor: 0.0,
    };
}

/// Embree's structure `RTCFilterFunctionNArguments`. For single rays `count` is 1, and the structures `RTCRayN` and
/// `RTCHitN` are laid out as `RTCRay` and `RTCHit`.
#[repr(C)]
pub struct FilterArguments {
    pub valid: *mut i32,
    pub user: *const c_void,
    pub context: *const c_void,
    pub ray: *const RawRay,
    pub hit: *const RawHit,
    pub count: u32,
}

pub type FilterFunction = unsafe extern "C" fn(*const FilterArguments);
pub type ErrorFunction = unsafe extern "C" fn(*mut c_void, u32, *const c_char);

/// Embree's structure `RTCBounds`, an axis-aligned box.
#[repr(C, align(16))]
pub struct RawBounds {
    pub lower: [f32; 4],
    pub upper: [f32; 4],
}

/// Declares a table of function pointers and the function that fills it from a library.
macro_rules! functions {
    ($(#[$doc:meta])* $table:ident { $($field:ident = $symbol:literal ($($argument:ty),*) $(-> $result:ty)?;)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub struct $table { $(pub $field: unsafe extern "C" fn($($argument),*) $(-> $result)?),* }

        impl $table {
            /// # Safety
            /// The library's symbols of these names must be Embree's, and the library must stay loaded.
            pub unsafe fn load(library: &libloading::Library) -> Result<Self, libloading::Error> {
                // SAFETY: the caller guarantees the symbols' types and the library's lifetime.
                Ok(unsafe { Self { $($field: *library.get($symbol)?),* } })
            }
        }
    };
}

functions! {
    /// Functions with equal signatures in Embree 3 and 4.
    Common {
        new_device = b"rtcNewDevice\0" (*const c_char) -> Handle;
        release_device = b"rtcReleaseDevice\0" (Handle);
        device_property = b"rtcGetDeviceProperty\0" (Handle, u32) -> isize;
        device_error = b"rtcGetDeviceError\0" (Handle) -> u32;
        set_error_function = b"rtcSetDeviceErrorFunction\0" (Handle, ErrorFunction, *mut c_void);
        new_scene = b"rtcNewScene\0" (Handle) -> Handle;
        release_scene = b"rtcReleaseScene\0" (Handle);
        set_scene_flags = b"rtcSetSceneFlags\0" (Handle, u32);
        set_scene_quality = b"rtcSetSceneBuildQuality\0" (Handle, u32);
        commit_scene = b"rtcCommitScene\0" (Handle);
        scene_bounds = b"rtcGetSceneBounds\0" (Handle, *mut RawBounds);
        attach_geometry = b"rtcAttachGeometryByID\0" (Handle, Handle, u32);
        new_geometry = b"rtcNewGeometry\0" (Handle, u32) -> Handle;
        release_geometry = b"rtcReleaseGeometry\0" (Handle);
        commit_geometry = b"rtcCommitGeometry\0" (Handle);
        new_buffer = b"rtcSetNewGeometryBuffer\0" (Handle, u32, u32, u32, usize, usize) -> *mut c_void;
        set_instanced_scene = b"rtcSetGeometryInstancedScene\0" (Handle, Handle);
        set_transform = b"rtcSetGeometryTransform\0" (Handle, u32, u32, *const f32);
        set_user_data = b"rtcSetGeometryUserData\0" (Handle, *const c_void);
        set_intersect_filter = b"rtcSetGeometryIntersectFilterFunction\0" (Handle, FilterFunction);
        set_occluded_filter = b"rtcSetGeometryOccludedFilterFunction\0" (Handle, FilterFunction);
    }
}

functions! {
    /// Ray queries of Embree 3.
    Trace3 {
        intersect = b"rtcIntersect1\0" (Handle, *mut IntersectContext3, *mut RawRayHit);
        occluded = b"rtcOccluded1\0" (Handle, *mut IntersectContext3, *mut RawRay);
        intersect8 = b"rtcIntersect8\0" (*const Valid8, Handle, *mut IntersectContext3, *mut RawRayHit8);
    }
}

functions! {
    /// Ray queries of Embree 4. The last argument may be null, which means incoherent rays and no per-ray filter.
    Trace4 {
        intersect = b"rtcIntersect1\0" (Handle, *mut RawRayHit, *mut c_void);
        occluded = b"rtcOccluded1\0" (Handle, *mut RawRay, *mut c_void);
        intersect8 = b"rtcIntersect8\0" (*const Valid8, Handle, *mut RawRayHit8, *mut c_void);
    }
}

/// Embree's functions whose signatures differ between versions 3 and 4. The branch on the version costs little, because
/// it always goes the same way.
#[derive(Clone, Copy)]
pub enum Trace {
    V3(Trace3),
    V4(Trace4),
}

impl Trace {
    /// # Safety
    /// `scene` must be a committed scene of the library this table was loaded from, and `ray` must point to
    /// an initialised [`RawRayHit`] that may be written.
    #[inline(always)]
    pub unsafe fn intersect(&self, scene: Handle, ray: *mut RawRayHit) {
        match self {
            Trace::V3(functions) => {
                let mut context = IntersectContext3::INCOHERENT;
                // SAFETY: the caller guarantees scene and ray. The context outlives the call.
                unsafe { (functions.intersect)(scene, &mut context, ray) }
            }
            // SAFETY: as above; Embree 4 documents null arguments as the defaults.
            Trace::V4(functions) => unsafe { (functions.intersect)(scene, ray, std::ptr::null_mut()) },
        }
    }

    /// # Safety
    /// As for [`Trace::intersect`].
    #[inline(always)]
    pub unsafe fn occluded(&self, scene: Handle, ray: *mut RawRay) {
        match self {
            Trace::V3(functions) => {
                let mut context = IntersectContext3::INCOHERENT;
                // SAFETY: the caller guarantees scene and ray. The context outlives the call.
                unsafe { (functions.occluded)(scene, &mut context, ray) }
            }
            // SAFETY: as above.
            Trace::V4(functions) => unsafe { (functions.occluded)(scene, ray, std::ptr::null_mut()) },
        }
    }

    /// Like [`Trace::intersect`], with a per-ray filter that is called for every hit that the filter of the geometry
    /// has accepted. `filters` has one filter for each version. It gets `user_data` by [`context_user_data`].
    ///
    /// # Safety
    /// As for [`Trace::intersect`]. The filters must be sound for this `user_data`.
    pub unsafe fn intersect_filtered<T>(
        &self,
        scene: Handle,
        ray: *mut RawRayHit,
        filters: [FilterFunction; 2],
        user_data: *mut T,
    ) {
        let [filter3, filter4] = filters.map(|filter| filter as *const c_void);
        let user_data = user_data.cast();
        match self {
            Trace::V3(functions) => {
                let context = IntersectContext3 { filter: filter3, ..IntersectContext3::INCOHERENT };
                let mut context = Context3 { context, user_data };
                // SAFETY: the caller guarantees scene and ray. The context outlives the call.
                unsafe { (functions.intersect)(scene, (&raw mut context).cast(), ray) }
            }
            Trace::V4(functions) => {
                let mut context = Context4 { instance: [INVALID_GEOMETRY_ID; 2], user_data };
                let mut arguments = IntersectArguments4 {
                    flags: 1 << 1,
                    context: (&raw mut context).cast(),
                    filter: filter4,
                    ..IntersectArguments4::COHERENT
                };
                // SAFETY: as above. Context and arguments outlive the call.
                unsafe { (functions.intersect)(scene, ray, (&raw mut arguments).cast()) }
            }
        }
    }

    /// Traces a packet of eight coherent rays.
    ///
    /// # Safety
    /// As for [`Trace::intersect`]. The device must support packets of eight.
    #[inline(always)]
    pub unsafe fn intersect8(&self, valid: &Valid8, scene: Handle, rays: *mut RawRayHit8) {
        match self {
            Trace::V3(functions) => {
                let mut context = IntersectContext3::COHERENT;
                // SAFETY: the caller guarantees scene and rays. The context outlives the call.
                unsafe { (functions.intersect8)(valid, scene, &mut context, rays) }
            }
            Trace::V4(functions) => {
                let mut arguments = IntersectArguments4::COHERENT;
                // SAFETY: as above. The arguments outlive the call.
                unsafe { (functions.intersect8)(valid, scene, rays, (&raw mut arguments).cast()) }
            }
        }
    }
}
