//! The C functions and constants of Open Image Denoise that this crate uses. All exist in every version 2.

use std::ffi::{c_char, c_int, c_void};

/// A device or a filter of Open Image Denoise: an opaque pointer, null on failure.
pub type Handle = *mut c_void;

/// Function that the library calls while a filter works, with a user's pointer and the work done from 0 to 1; the filter
/// ends early if it returns false. The library calls it from any of its threads, one call at a time.
pub type Monitor = unsafe extern "C" fn(*mut c_void, f64) -> bool;

/// Open Image Denoise's device type of the CPU.
pub const DEVICE_TYPE_CPU: c_int = 1;

/// Pixel format of three floats per pixel.
pub const FORMAT_FLOAT3: c_int = 3;

/// Quality for previews, which exists from version 2.3 of Open Image Denoise on.
pub const QUALITY_FAST: c_int = 4;
pub const QUALITY_BALANCED: c_int = 5;
pub const QUALITY_HIGH: c_int = 6;

/// Code that [`Functions::device_error`] returns if there is no error.
pub const NO_ERROR: c_int = 0;

/// The meaning of an error code of Open Image Denoise, in words.
pub fn error_name(code: c_int) -> &'static str {
    match code {
        2 => "invalid argument",
        3 => "invalid operation",
        4 => "out of memory",
        5 => "this processor is not supported",
        6 => "cancelled",
        _ => "unknown error",
    }
}

/// Declares a table of function pointers and the function that fills it from a library.
macro_rules! functions {
    ($(#[$doc:meta])* $table:ident { $($field:ident = $symbol:literal ($($argument:ty),*) $(-> $result:ty)?;)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub struct $table { $(pub $field: unsafe extern "C" fn($($argument),*) $(-> $result)?),* }

        impl $table {
            /// # Safety
            /// The library's symbols of these names must be Open Image Denoise's, and the library must stay loaded.
            pub unsafe fn load(library: &libloading::Library) -> Result<Self, libloading::Error> {
                // SAFETY: the caller guarantees the symbols' types and the library's lifetime.
                Ok(unsafe { Self { $($field: *library.get($symbol)?),* } })
            }
        }
    };
}

functions! {
    /// The functions of Open Image Denoise. Versions before 2.0 lack the typed setters and are therefore refused.
    Functions {
        new_device = b"oidnNewDevice\0" (c_int) -> Handle;
        release_device = b"oidnReleaseDevice\0" (Handle);
        commit_device = b"oidnCommitDevice\0" (Handle);
        device_error = b"oidnGetDeviceError\0" (Handle, *mut *const c_char) -> c_int;
        device_int = b"oidnGetDeviceInt\0" (Handle, *const c_char) -> c_int;
        set_device_int = b"oidnSetDeviceInt\0" (Handle, *const c_char, c_int);
        set_device_bool = b"oidnSetDeviceBool\0" (Handle, *const c_char, bool);
        new_filter = b"oidnNewFilter\0" (Handle, *const c_char) -> Handle;
        release_filter = b"oidnReleaseFilter\0" (Handle);
        // Filter, name, pixels, format, width, height, then offset, pixel stride and row stride in bytes (0: packed).
        set_image = b"oidnSetSharedFilterImage\0"
            (Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize);
        unset_image = b"oidnUnsetFilterImage\0" (Handle, *const c_char);
        set_filter_bool = b"oidnSetFilterBool\0" (Handle, *const c_char, bool);
        set_filter_int = b"oidnSetFilterInt\0" (Handle, *const c_char, c_int);
        // Filter, function (null for none), the user's pointer.
        set_monitor = b"oidnSetFilterProgressMonitorFunction\0" (Handle, Option<Monitor>, *mut c_void);
        commit_filter = b"oidnCommitFilter\0" (Handle);
        execute_filter = b"oidnExecuteFilter\0" (Handle);
    }
}
