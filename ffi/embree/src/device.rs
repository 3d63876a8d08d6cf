//! A device: one set of Embree's worker threads, and the place its errors are collected.

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
    /// The first error since the last check. An `Arc`, and so at an address that stays: Embree holds it.
    error: Arc<ErrorSlot>,
}

type ErrorSlot = Mutex<Option<String>>;

// SAFETY: Embree's devices may be used from several threads at once, and what it reports is behind a mutex.
unsafe impl Send for Inner {}
// SAFETY: as above.
unsafe impl Sync for Inner {}

impl Device {
    /// Makes a device whose scenes are built by `threads` threads, 0 for as many as there are processors.
    /// Rays are traced by the threads that ask.
    ///
    /// # Errors
    ///
    /// [`Error::Embree`], for instance when the processor lacks SSE2.
    pub fn new(library: &Library, threads: usize) -> Result<Device, Error> {
        let during = "make a device";
        let common = library.common();
        let configuration = CString::new(format!("threads={threads}")).unwrap_or_default();
        // SAFETY: the string lives through the call, which copies what it needs.
        let raw = unsafe { (common.new_device)(configuration.as_ptr()) };
        if raw.is_null() {
            // SAFETY: null asks for the error of the last failed creation on this thread.
            let code = unsafe { (common.device_error)(raw) };
            return Err(Error::Embree { during, message: api::error_name(code).into() });
        }
        let inner = Inner { raw, library: library.clone(), error: Arc::default() };
        let slot = Arc::as_ptr(&inner.error);
        // SAFETY: the slot is owned by `inner`, stays where it is, and is dropped after the device is released.
        unsafe { (common.set_error_function)(raw, record_error, slot as *mut c_void) };
        let device = Device { inner: Arc::new(inner) };
        device.check(during)?;
        Ok(device)
    }

    /// The library this device is of.
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

    /// Turns what Embree has reported since the last check into an error.
    pub(crate) fn check(&self, during: &'static str) -> Result<(), Error> {
        match self.inner.error.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(message) => Err(Error::Embree { during, message }),
            None => Ok(()),
        }
    }

    /// A handle that Embree returned, or the error it reported instead.
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
        // SAFETY: the handle came from `new_device` and is released once; scenes hold a `Device`, so none is
        // left.
        unsafe { (self.library.common().release_device)(self.raw) }
    }
}

/// Embree's error callback; may come from any of its threads.
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
