//! An Embree device: a set of worker threads, and its error callback.

use std::ffi::{CStr, CString, c_char, c_void};
use std::sync::{Arc, Mutex, PoisonError};

use crate::api::{self, Common, Handle};
use crate::error::Error;
use crate::library::Library;

/// An Embree device. Clones share it; it may be used from several threads.
#[derive(Clone)]
pub struct Device {
    inner: Arc<Inner>,
}

struct Inner {
    raw: Handle,
    library: Library,
    /// The first error that Embree has reported since the last check. Embree holds its address, which the `Arc` keeps
    /// stable.
    error: Arc<ErrorSlot>,
}

type ErrorSlot = Mutex<Option<String>>;

// SAFETY: Embree's devices may be used from several threads at once, and the error is behind a mutex.
unsafe impl Send for Inner {}
// SAFETY: as above.
unsafe impl Sync for Inner {}

impl Device {
    /// Creates a device that builds scenes with `threads` threads; 0 means one per processor. Rays are traced by the
    /// calling threads.
    ///
    /// # Errors
    ///
    /// [`Error::Embree`], for instance when the processor lacks SSE2.
    pub fn new(library: &Library, threads: usize) -> Result<Device, Error> {
        let during = "make a device";
        let common = library.common();
        let configuration = CString::new(format!("threads={threads}")).unwrap_or_default();
        // SAFETY: the string outlives the call, which does not keep it.
        let raw = unsafe { (common.new_device)(configuration.as_ptr()) };
        if raw.is_null() {
            // SAFETY: a null device returns the error of the last failed creation on this thread.
            let code = unsafe { (common.device_error)(raw) };
            return Err(Error::Embree { during, message: api::error_name(code).into() });
        }
        let inner = Inner { raw, library: library.clone(), error: Arc::default() };
        let slot = Arc::as_ptr(&inner.error);
        // SAFETY: the slot is owned by `inner`, does not move, and is dropped after the device is released.
        unsafe { (common.set_error_function)(raw, record_error, slot as *mut c_void) };
        let device = Device { inner: Arc::new(inner) };
        device.check(during)?;
        Ok(device)
    }

    /// The Embree library that this device belongs to.
    pub fn library(&self) -> &Library {
        &self.inner.library
    }

    pub(crate) fn raw(&self) -> Handle {
        self.inner.raw
    }

    pub(crate) fn common(&self) -> &Common {
        self.inner.library.common()
    }

    pub(crate) fn is(&self, other: &Device) -> bool {
        Arc::ptr_eq(&self.inner, &other.inner)
    }

    /// Returns the first error that Embree has reported since the last check. `during` names the operation for the
    /// error.
    pub(crate) fn check(&self, during: &'static str) -> Result<(), Error> {
        match self.inner.error.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(message) => Err(Error::Embree { during, message }),
            None => Ok(()),
        }
    }

    /// The handle that Embree returned, or the error that it reported instead of a null handle. `during` names the
    /// operation.
    pub(crate) fn check_handle(&self, handle: Handle, during: &'static str) -> Result<Handle, Error> {
        self.check(during)?;
        if handle.is_null() {
            return Err(Error::Embree { during, message: api::error_name(1).into() });
        }
        Ok(handle)
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        // SAFETY: the handle came from `new_device` and is released once. No scene is left, because scenes hold a
        // `Device`.
        unsafe { (self.library.common().release_device)(self.raw) }
    }
}

/// Embree's error callback, which any of its threads may call; stores the first error in `slot`.
unsafe extern "C" fn record_error(slot: *mut c_void, code: u32, text: *const c_char) {
    // SAFETY: the pointer is the one given in `Device::new`, alive as long as the device.
    let slot = unsafe { &*(slot as *const ErrorSlot) };
    let mut message = api::error_name(code).to_owned();
    if !text.is_null() {
        // SAFETY: Embree gives a C string.
        let text = unsafe { CStr::from_ptr(text) }.to_string_lossy();
        if !text.is_empty() {
            message = format!("{message} ({text})");
        }
    }
    slot.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(message);
}
