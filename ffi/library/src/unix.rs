//! The loader of Unix.

use std::ffi::{CStr, OsStr, c_char, c_int, c_void};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use libloading::Library;

#[repr(C)]
struct DlInfo {
    file_name: *const c_char,
    file_base: *mut c_void,
    symbol_name: *const c_char,
    symbol_address: *mut c_void,
}

unsafe extern "C" {
    fn dladdr(address: *const c_void, info: *mut DlInfo) -> c_int;
}

/// Loads a library file, see [`crate::open`].
///
/// # Safety
/// The file must be trusted.
pub unsafe fn open(path: &Path) -> Result<Library, libloading::Error> {
    // SAFETY: the caller guarantees that the file is trusted.
    unsafe { Library::new(OsStr::new(path)) }
}

pub fn file_containing(address: usize) -> Option<PathBuf> {
    let null = std::ptr::null_mut();
    let mut info =
        DlInfo { file_name: null as *const _, file_base: null, symbol_name: null as *const _, symbol_address: null };
    // SAFETY: `dladdr` only looks the address up, and fills in `info` when it returns non-zero.
    if unsafe { dladdr(address as *const c_void, &mut info) } == 0 || info.file_name.is_null() {
        return None;
    }
    // SAFETY: a non-null name is a C string that is valid while the library is loaded. The bindings never unload one.
    let name = unsafe { CStr::from_ptr(info.file_name) };
    Some(PathBuf::from(OsStr::from_bytes(name.to_bytes())))
}
