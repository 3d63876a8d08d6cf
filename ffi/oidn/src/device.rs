//! A device: a set of worker threads of the library.

use std::ffi::{CStr, c_char, c_int};
use std::sync::Arc;

use caustique_library::Version;

use crate::api::{self, Functions, Handle};
use crate::error::Error;
use crate::library::Library;
use crate::limits::MAX_THREADS;

/// A device that denoises on the CPU. Clones share it. Several threads may use it; their pictures are denoised one
/// after the other.
#[derive(Clone)]
pub struct Device {
    inner: Arc<Inner>,
}

struct Inner {
    raw: Raw,
    library: Library,
}

/// A raw device of the library, released when it is dropped.
struct Raw {
    handle: Handle,
    release: unsafe extern "C" fn(Handle),
}

// SAFETY: the library locks a device in every call, stores errors per thread, and its objects belong to no thread.
unsafe impl Send for Raw {}
// SAFETY: as above.
unsafe impl Sync for Raw {}

impl Device {
    /// Creates a device that denoises with `threads` threads; 0 means one per core. Threads are not pinned to cores,
    /// because other programs may use them. The library's own environment variables (`OIDN_NUM_THREADS` and others)
    /// take precedence.
    ///
    /// # Errors
    ///
    /// [`Error::TooManyThreads`]; [`Error::Oidn`], for instance when the processor lacks SSE4.1.
    pub fn new(library: &Library, threads: usize) -> Result<Device, Error> {
        if threads > MAX_THREADS {
            return Err(Error::TooManyThreads(threads));
        }
        let functions = library.functions();
        let raw = Raw::open(functions, threads as c_int)
            .map_err(|message| Error::Oidn { during: "make a device", message })?;
        Ok(Device { inner: Arc::new(Inner { raw, library: library.clone() }) })
    }

    /// The Open Image Denoise library that this device belongs to.
    pub fn library(&self) -> &Library {
        &self.inner.library
    }

    pub(crate) fn raw(&self) -> Handle {
        self.inner.raw.handle
    }

    pub(crate) fn functions(&self) -> &Functions {
        self.inner.library.functions()
    }

    /// Returns the first error that the library has reported on this thread since the last check. `during` names the
    /// operation.
    pub(crate) fn check(&self, during: &'static str) -> Result<(), Error> {
        match take_error(self.functions(), self.raw()) {
            Some(message) => Err(Error::Oidn { during, message }),
            None => Ok(()),
        }
    }
}

impl Raw {
    /// Creates and commits a device with this number of threads. The error is the library's message.
    fn open(functions: &Functions, threads: c_int) -> Result<Raw, String> {
        // SAFETY: the argument is a device type of the library.
        let handle = unsafe { (functions.new_device)(api::DEVICE_TYPE_CPU) };
        if handle.is_null() {
            // A null device returns the error of the last failed creation on this thread.
            let unknown = || "it made none and did not say why".into();
            return Err(take_error(functions, handle).unwrap_or_else(unknown));
        }
        let raw = Raw { handle, release: functions.release_device };
        // SAFETY: the handle is a device, not yet committed; the names are C strings.
        unsafe {
            (functions.set_device_int)(handle, c"numThreads".as_ptr(), threads);
            (functions.set_device_bool)(handle, c"setAffinity".as_ptr(), false);
            (functions.commit_device)(handle);
        }
        match take_error(functions, handle) {
            Some(message) => Err(message),
            None => Ok(raw),
        }
    }
}

impl Drop for Raw {
    fn drop(&mut self) {
        // SAFETY: the handle came from `new_device` and is released once. No filter is left, because filters hold a
        // `Device`.
        unsafe { (self.release)(self.handle) }
    }
}

/// Creates a device and reads the library's version. This fails if the library does not find its modules.
pub(crate) fn probe(functions: &Functions) -> Result<Version, String> {
    let device = Raw::open(functions, 1).map_err(|reason| format!("makes no device for this processor: {reason}"))?;
    let number = |name: &CStr| {
        // SAFETY: the handle is a device, the name a C string.
        let number = unsafe { (functions.device_int)(device.handle, name.as_ptr()) };
        match take_error(functions, device.handle) {
            Some(message) => Err(format!("does not tell its version: {message}")),
            None => u32::try_from(number).map_err(|_| format!("tells a version of {number}")),
        }
    };
    let (major, minor, patch) = (number(c"versionMajor")?, number(c"versionMinor")?, number(c"versionPatch")?);
    Ok(Version { major, minor, patch })
}

/// Takes the first error that the library has recorded on this thread since the last call; `None` if there is none.
fn take_error(functions: &Functions, device: Handle) -> Option<String> {
    let mut text: *const c_char = std::ptr::null();
    // SAFETY: `device` is a device or null. The library sets the pointer or leaves it null.
    let code = unsafe { (functions.device_error)(device, &mut text) };
    if code == api::NO_ERROR {
        return None;
    }
    let name = api::error_name(code);
    if text.is_null() {
        return Some(name.to_owned());
    }
    // SAFETY: the library returns a C string that is valid until the next call on this thread.
    let text = unsafe { CStr::from_ptr(text) }.to_string_lossy();
    Some(if text.is_empty() { name.to_owned() } else { format!("{name} ({text})") })
}
