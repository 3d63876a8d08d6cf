//! Calls of Windows.

use std::fs::File;
use std::io;
use std::os::windows::io::{AsRawHandle, FromRawHandle, OwnedHandle};
use std::process::Child;

use windows_sys::Win32::Foundation::{ERROR_INVALID_PARAMETER, FILETIME, WAIT_OBJECT_0};
use windows_sys::Win32::Storage::FileSystem::{
    BY_HANDLE_FILE_INFORMATION, GetFileInformationByHandle, LOCKFILE_EXCLUSIVE_LOCK, LOCKFILE_FAIL_IMMEDIATELY,
    LockFileEx,
};
use windows_sys::Win32::System::IO::OVERLAPPED;
use windows_sys::Win32::System::JobObjects::{
    AssignProcessToJobObject, CreateJobObjectW, JOB_OBJECT_LIMIT_DIE_ON_UNHANDLED_EXCEPTION,
    JOB_OBJECT_LIMIT_KILL_ON_JOB_CLOSE, JOB_OBJECT_LIMIT_PROCESS_MEMORY, JOB_OBJECT_LIMIT_PROCESS_TIME,
    JOBOBJECT_EXTENDED_LIMIT_INFORMATION, JobObjectExtendedLimitInformation, SetInformationJobObject,
};
use windows_sys::Win32::System::ProcessStatus::{K32GetProcessMemoryInfo, PROCESS_MEMORY_COUNTERS};
use windows_sys::Win32::System::SystemInformation::{GlobalMemoryStatusEx, MEMORYSTATUSEX};
use windows_sys::Win32::System::Threading::{
    GetCurrentProcess, GetProcessTimes, OpenProcess, PROCESS_SYNCHRONIZE, WaitForSingleObject,
};

/// Processor time that the process has taken since it began (seconds); `None` if the system does not say.
pub fn cpu_seconds() -> Option<f64> {
    let [mut created, mut ended, mut kernel, mut user] = [FILETIME::default(); 4];
    // SAFETY: all four times are valid for writing.
    let known = unsafe {
        let times = [&raw mut created, &raw mut ended, &raw mut kernel, &raw mut user];
        GetProcessTimes(GetCurrentProcess(), times[0], times[1], times[2], times[3]) != 0
    };
    let ticks = |time: FILETIME| (u64::from(time.dwHighDateTime) << 32) + u64::from(time.dwLowDateTime);
    // A tick is 100 ns.
    known.then(|| 1e-7 * (ticks(kernel) + ticks(user)) as f64)
}

/// Peak resident memory of the process (bytes); `None` if the system does not say.
pub fn peak_memory() -> Option<u64> {
    let mut counters =
        PROCESS_MEMORY_COUNTERS { cb: size_of::<PROCESS_MEMORY_COUNTERS>() as u32, ..Default::default() };
    // SAFETY: `counters` is valid for writing `cb` bytes.
    let known = unsafe { K32GetProcessMemoryInfo(GetCurrentProcess(), &raw mut counters, counters.cb) != 0 };
    known.then_some(counters.PeakWorkingSetSize as u64)
}

/// Free memory of the machine, and memory that the process may still commit (bytes); `None` if the system does not say.
pub fn free_memory() -> Option<[u64; 2]> {
    let mut status = MEMORYSTATUSEX { dwLength: size_of::<MEMORYSTATUSEX>() as u32, ..Default::default() };
    // SAFETY: `status` is valid for writing `dwLength` bytes.
    let known = unsafe { GlobalMemoryStatusEx(&raw mut status) != 0 };
    known.then_some([status.ullAvailPhys, status.ullAvailPageFile])
}

/// Whether no process has the number `id`, or one that has ended. A process that may not be opened exists.
pub fn is_process_gone(id: u32) -> bool {
    // SAFETY: `OpenProcess` has no preconditions, and the new handle has no other owner.
    let process = unsafe {
        let handle = OpenProcess(PROCESS_SYNCHRONIZE, 0, id);
        if handle.is_null() {
            return io::Error::last_os_error().raw_os_error() == Some(ERROR_INVALID_PARAMETER as i32);
        }
        OwnedHandle::from_raw_handle(handle)
    };
    // SAFETY: the handle is open.
    unsafe { WaitForSingleObject(process.as_raw_handle(), 0) == WAIT_OBJECT_0 }
}

/// Processes that end when this is dropped.
pub struct Job(OwnedHandle);

impl Job {
    /// A job without processes.
    ///
    /// # Errors
    /// The system makes no job.
    pub fn new() -> io::Result<Job> {
        Job::within(JOBOBJECT_EXTENDED_LIMIT_INFORMATION::default())
    }

    /// A job without processes. Each process may commit `bytes` of memory and take `seconds` of processor time. A fault
    /// ends it without a window that waits for the user.
    ///
    /// # Errors
    /// The system makes no job.
    pub fn limited(bytes: u64, seconds: u32) -> io::Result<Job> {
        let mut limits = JOBOBJECT_EXTENDED_LIMIT_INFORMATION::default();
        limits.ProcessMemoryLimit = usize::try_from(bytes).unwrap_or(usize::MAX);
        // A tick is 100 ns.
        limits.BasicLimitInformation.PerProcessUserTimeLimit = i64::from(seconds) * 10_000_000;
        limits.BasicLimitInformation.LimitFlags = JOB_OBJECT_LIMIT_PROCESS_MEMORY
            | JOB_OBJECT_LIMIT_PROCESS_TIME
            | JOB_OBJECT_LIMIT_DIE_ON_UNHANDLED_EXCEPTION;
        Job::within(limits)
    }

    fn within(mut limits: JOBOBJECT_EXTENDED_LIMIT_INFORMATION) -> io::Result<Job> {
        // SAFETY: null: no attributes and no name. The new handle has no other owner.
        let job = unsafe {
            let handle = CreateJobObjectW(std::ptr::null(), std::ptr::null());
            if handle.is_null() {
                return Err(io::Error::last_os_error());
            }
            Job(OwnedHandle::from_raw_handle(handle))
        };
        limits.BasicLimitInformation.LimitFlags |= JOB_OBJECT_LIMIT_KILL_ON_JOB_CLOSE;
        // SAFETY: `limits` is the structure that this class of information takes, with its size.
        let done = unsafe {
            SetInformationJobObject(
                job.0.as_raw_handle(),
                JobObjectExtendedLimitInformation,
                (&raw const limits).cast(),
                size_of_val(&limits) as u32,
            )
        };
        check(done).map(|()| job)
    }

    /// Adds a process, whose future children belong to the job too.
    ///
    /// # Errors
    /// The process has ended.
    pub fn add(&self, process: &Child) -> io::Result<()> {
        // SAFETY: both handles are open.
        check(unsafe { AssignProcessToJobObject(self.0.as_raw_handle(), process.as_raw_handle()) })
    }
}

/// Volume and number of an open file or folder, which hard links share.
///
/// # Errors
/// The file system has no such numbers.
pub fn file_id(file: &File) -> io::Result<(u64, u64)> {
    let mut found = BY_HANDLE_FILE_INFORMATION::default();
    // SAFETY: the handle is open, and `found` is valid for writing.
    check(unsafe { GetFileInformationByHandle(file.as_raw_handle(), &raw mut found) })?;
    Ok((
        u64::from(found.dwVolumeSerialNumber),
        (u64::from(found.nFileIndexHigh) << 32) + u64::from(found.nFileIndexLow),
    ))
}

/// Locks a file until it is closed; waits for other locks if `waits`. Others may still read and write the file: Windows
/// keeps them from locked bytes, and this locks one beyond the end of any file.
///
/// # Errors
/// Another process has the lock, or the file system has no locks.
pub fn lock(file: &File, waits: bool) -> io::Result<()> {
    let flags = LOCKFILE_EXCLUSIVE_LOCK | if waits { 0 } else { LOCKFILE_FAIL_IMMEDIATELY };
    let mut place = OVERLAPPED::default();
    place.Anonymous.Anonymous.Offset = u32::MAX - 1;
    place.Anonymous.Anonymous.OffsetHigh = i32::MAX as u32;
    // SAFETY: the handle is open, and `place` is valid until the call returns.
    check(unsafe { LockFileEx(file.as_raw_handle(), flags, 0, 1, 0, &raw mut place) })
}

/// The system's last error if a call has `done` nothing.
fn check(done: i32) -> io::Result<()> {
    if done == 0 { Err(io::Error::last_os_error()) } else { Ok(()) }
}
