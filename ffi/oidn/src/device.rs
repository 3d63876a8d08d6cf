//! A device: one set of the library's worker threads.

use std::ffi::{CStr, c_char, c_int};
use std::sync::Arc;

use caustique_library::Version;

use crate::api::{self, Functions, Handle};
use crate::error::Error;
use crate::library::Library;
use crate::limits::MAX_THREADS;

/// A device that denoises on the processor. Clones share it; it may be used from several threads, whose pictures are
/// then denoised one after the other.
#[derive(Clone)]
pub struct Device {
    inner: Arc<Inner>,
}

struct Inner {
    raw: Raw,
    library: Library,
}

/// A device of the library, released when it is dropped.
struct Raw {
    handle: Handle,
    release: unsafe extern "C" fn(Handle),
}

// SAFETY: the library locks a device in every call that uses it, keeps errors apart by thread, and ties none of its
// objects to the thread that made them.
unsafe impl Send for Raw {}
// SAFETY: as above.
unsafe impl Sync for Raw {}

impl Device {
    /// Makes a device that denoises with `threads` threads, 0 for as many as the processor has cores. They are not
    /// tied to cores, which others may be using. The library's own environment variables (`OIDN_NUM_THREADS` and
    /// its like) have the last word.
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

    /// The library this device is of.
    pub fn library(&self) -> &Library {
        &self.inner.library
    }

    pub(crate) fn raw(&self) -> Handle {
        self.inner.raw.handle
    }

    pub(crate) fn functions(&self) -> &Functions {
        self.inner.library.functions()
    }

    /// Turns what the library has reported on this thread since the last check into an error.
    pub(crate) fn check(&self, during: &'static str) -> Result<(), Error> {
        match take_error(self.functions(), self.raw()) {
            Some(message) => Err(Error::Oidn { during, message }),
            None => Ok(()),
        }
    }
}

impl Raw {
    /// Makes a device and readies it, or says why not.
    fn open(functions: &Functions, threads: c_int) -> Result<Raw, String> {
        // SAFETY: a constant of the library's.
        let handle = unsafe { (functions.new_device)(api::DEVICE_TYPE_CPU) };
        if handle.is_null() {
            // Without a device, the error is that of the last failed creation on this thread.
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
        // SAFETY: the handle came from `new_device` and is released once; filters hold a `Device`, so none is left.
        unsafe { (self.release)(self.handle) }
    }
}

/// Makes a device and asks its version, which shows that the library finds its modules.
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

/// The first error on this thread since the last call, in words, and forgotten by the library then.
fn take_error(functions: &Functions, device: Handle) -> Option<String> {
    let mut text: *const c_char = std::ptr::null();
    // SAFETY: a device or null; the library fills in the pointer, or leaves it.
    let code = unsafe { (functions.device_error)(device, &mut text) };
    if code == api::NO_ERROR {
        return None;
    }
    let name = api::error_name(code);
    if text.is_null() {
        return Some(name.to_owned());
    }
    // SAFETY: the library gives a C string that lives until the next call on this thread.
    let text = unsafe { CStr::from_ptr(text) }.to_string_lossy();
    Some(if text.is_empty() { name.to_owned() } else { format!("{name} ({text})") })
}
