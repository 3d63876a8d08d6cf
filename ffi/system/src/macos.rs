//! Calls of macOS.

use std::mem::MaybeUninit;

/// Peak resident memory of the process (bytes); `None` if the system does not say.
pub fn peak_memory() -> Option<u64> {
    let mut usage = MaybeUninit::<libc::rusage>::uninit();
    // SAFETY: `usage` has room for the answer, which is there if the call succeeds.
    let usage = unsafe { (libc::getrusage(libc::RUSAGE_SELF, usage.as_mut_ptr()) == 0).then(|| usage.assume_init()) }?;
    u64::try_from(usage.ru_maxrss).ok()
}

/// Memory of the machine that is free, or that holds pages which the system can drop (bytes); `None` if the system does
/// not say.
#[allow(deprecated, reason = "its successor is another crate, for one call")]
pub fn free_memory() -> Option<u64> {
    let mut statistics = MaybeUninit::<libc::vm_statistics64>::zeroed();
    let mut count = libc::HOST_VM_INFO64_COUNT;
    // SAFETY: `statistics` has room for `count` integers, all of which may be zero.
    let statistics = unsafe {
        let host = libc::mach_host_self();
        let answer =
            libc::host_statistics64(host, libc::HOST_VM_INFO64, statistics.as_mut_ptr().cast(), &raw mut count);
        (answer == libc::KERN_SUCCESS).then(|| statistics.assume_init())
    }?;
    // SAFETY: `sysconf` has no preconditions.
    let page = u64::try_from(unsafe { libc::sysconf(libc::_SC_PAGESIZE) }).ok()?;
    let pages = [statistics.free_count, statistics.inactive_count, statistics.purgeable_count];
    Some(pages.into_iter().map(u64::from).sum::<u64>() * page)
}
