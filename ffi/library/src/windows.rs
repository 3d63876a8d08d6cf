//! The loader of Windows.

use std::ffi::OsString;
use std::os::windows::ffi::OsStringExt;
use std::path::{Path, PathBuf};

use libloading::Library;
use libloading::os::windows::{
    LOAD_LIBRARY_SEARCH_DEFAULT_DIRS, LOAD_LIBRARY_SEARCH_DLL_LOAD_DIR, Library as WindowsLibrary,
};
use windows_sys::Win32::System::LibraryLoader::{
    GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS, GET_MODULE_HANDLE_EX_FLAG_UNCHANGED_REFCOUNT, GetModuleFileNameW,
    GetModuleHandleExW,
};

/// Most UTF-16 units in the path of a file.
const MAX_PATH: usize = 1 << 15;

/// Loads a library file, see [`crate::open`]. It finds the libraries that it needs in its own folder.
///
/// # Safety
/// The file must be trusted.
pub unsafe fn open(path: &Path) -> Result<Library, libloading::Error> {
    // The folder of a library is searched only if its path is absolute.
    let own = if path.is_absolute() { LOAD_LIBRARY_SEARCH_DLL_LOAD_DIR } else { 0 };
    // SAFETY: the caller guarantees that the file is trusted.
    unsafe { WindowsLibrary::load_with_flags(path, own | LOAD_LIBRARY_SEARCH_DEFAULT_DIRS) }.map(Library::from)
}

pub fn file_containing(address: usize) -> Option<PathBuf> {
    let flags = GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS | GET_MODULE_HANDLE_EX_FLAG_UNCHANGED_REFCOUNT;
    let mut module = std::ptr::null_mut();
    // SAFETY: by the flags, the name is an address, which is only looked up.
    if unsafe { GetModuleHandleExW(flags, address as *const u16, &raw mut module) } == 0 {
        return None;
    }
    let mut name = vec![0; MAX_PATH];
    // SAFETY: `name` has room for as many units as the call is told.
    let length = unsafe { GetModuleFileNameW(module, name.as_mut_ptr(), name.len() as u32) } as usize;
    (1..MAX_PATH).contains(&length).then(|| OsString::from_wide(&name[..length]).into())
}
