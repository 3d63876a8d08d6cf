//! Checks of free memory before large allocations.
//!
//! A few numbers in a scene or on the command line (copies, vertices, pixels, light paths) can request any amount of
//! memory. Rust and Embree abort the process if an allocation fails, and Linux kills it if memory is overcommitted. So
//! large amounts are computed and compared with the free memory first: the least of the memory that the machine has
//! left, that `ulimit -v` leaves, and that `memory.max` of the control groups (containers, batch systems, systemd)
//! leaves.

use crate::error::{Error, ErrorKind, Result};
use rustix::process::{Resource, getrlimit};
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// Allocations below this number of bytes are not checked against the free memory.
pub const MIN_CHECKED_BYTES: u64 = 16 << 20;

/// Largest compression ratio of an EXR: that of deflate (1032) over run lengths in blocks of 64 samples.
pub const MAX_EXR_RATIO: u64 = 1032 * 64;

/// Memory that the process may still allocate, and the limit that determines it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Available {
    /// Bytes that the process may still allocate.
    pub bytes: u64,
    /// The limit, in words that follow the amount: `available`, `left by 'ulimit -v'`.
    pub source: &'static str,
}

/// Free memory: the least that the machine, `ulimit -v` and the control groups leave. `None` if no limit can be read.
pub fn available() -> Option<Available> {
    let machine = || parse_kib(&std::fs::read_to_string("/proc/meminfo").ok()?, "MemAvailable:");
    let address_space = || {
        let most = getrlimit(Resource::As).current?;
        Some(most.saturating_sub(parse_kib(&std::fs::read_to_string("/proc/self/status").ok()?, "VmSize:")?))
    };
    let groups = || free_in_groups(&std::fs::read_to_string("/proc/self/cgroup").ok()?, Path::new("/sys/fs/cgroup"));
    let limits = [
        (machine(), "available"),
        (address_space(), "left by 'ulimit -v'"),
        (groups(), "left by the control group (a container's or a job's limit)"),
    ];
    let limits = limits.into_iter().filter_map(|(bytes, source)| Some(Available { bytes: bytes?, source }));
    limits.min_by_key(|limit| limit.bytes)
}

/// Whether a limit on addresses (`ulimit -v`) counts memory that is reserved and never used.
pub fn limits_addresses() -> bool {
    getrlimit(Resource::As).current.is_some()
}

/// Checks that `bytes` of memory are free. `what` names their users in the message, in the plural: "9 copies".
///
/// # Errors
/// Less memory is free. The error names both amounts; the caller adds place and hint.
pub fn require(bytes: u64, what: impl Display) -> Result<()> {
    match available() {
        Some(Available { bytes: left, source }) if bytes > left => {
            let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
            let cause = format!("{what} need about {:.1} GiB of memory, {:.1} GiB are {source}", gib(bytes), gib(left));
            Err(Error::new(ErrorKind::Scene, "", cause))
        }
        _ => Ok(()),
    }
}

/// An empty vector with capacity for `count` items. `what` names the items in the message.
///
/// # Errors
/// The allocation fails.
pub fn reserve<T>(count: usize, what: impl Display) -> Result<Vec<T>> {
    let mut items = Vec::new();
    match items.try_reserve_exact(count) {
        Ok(()) => Ok(items),
        Err(_) => {
            let mib = (count as u128 * size_of::<T>() as u128) >> 20;
            Err(Error::new(ErrorKind::Scene, "", format!("there is no memory for {count} {what} ({mib} MiB)")))
        }
    }
}

/// Parses a line of `/proc`, such as `MemAvailable:  123 kB`, and returns the bytes.
fn parse_kib(text: &str, key: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}

/// Bytes that the control groups leave. `text` is `/proc/self/cgroup` (version 2: `0::/path`; version 1:
/// `9:memory:/path`), `root` the mount point. The limits of a group and of all its ancestors apply. In a container, the
/// process's own group may be the root.
fn free_in_groups(text: &str, root: &Path) -> Option<u64> {
    let groups = text.lines().filter_map(|line| {
        let mut fields = line.splitn(3, ':').skip(1);
        let (controllers, path) = (fields.next()?, fields.next()?.trim_start_matches('/'));
        match controllers {
            "" => Some((root.to_owned(), path, ["memory.max", "memory.current", "inactive_file"])),
            list if list.split(',').any(|name| name == "memory") => {
                let names = ["memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"];
                Some((root.join("memory"), path, names))
            }
            _ => None,
        }
    });
    let left = groups.flat_map(|(mount, path, names)| {
        let around: Vec<PathBuf> = Path::new(path).ancestors().map(|group| mount.join(group)).collect();
        around.into_iter().filter_map(move |group| free_in_group(&group, names))
    });
    left.min()
}

/// The limit of a group minus the memory in use. Pages of inactive files are reclaimable and do not count as used.
fn free_in_group(group: &Path, [limit, usage, files]: [&str; 3]) -> Option<u64> {
    let number = |name: &str| std::fs::read_to_string(group.join(name)).ok()?.trim().parse::<u64>().ok();
    let (limit, usage) = (number(limit)?, number(usage)?);
    let stat = std::fs::read_to_string(group.join("memory.stat")).unwrap_or_default();
    let files = stat.lines().find_map(|line| line.strip_prefix(files)?.trim().parse().ok());
    Some(limit.saturating_sub(usage.saturating_sub(files.unwrap_or(0))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_limit_of_all_groups_applies() {
        let root = tempfile::tempdir().expect("a folder");
        let write = |path: &str, text: &str| {
            let path = root.path().join(path);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            std::fs::write(path, text).expect("it can be written");
        };
        let left = |text: &str| free_in_groups(text, root.path());
        assert_eq!(left("0::/jobs/7\n"), None);
        write("jobs/7/memory.max", "max\n");
        write("jobs/7/memory.current", "900\n");
        assert_eq!(left("0::/jobs/7\n"), None);
        write("jobs/memory.max", "5000\n");
        write("jobs/memory.current", "1700\n");
        write("jobs/memory.stat", "anon 900\ninactive_file 300\nactive_file 500\n");
        assert_eq!(left("0::/jobs/7\n"), Some(3600));
        write("jobs/7/memory.max", "1000\n");
        assert_eq!(left("0::/jobs/7\n"), Some(100));
        // Version 1, in a container that sees its own group as the root.
        write("memory/memory.limit_in_bytes", "4096\n");
        write("memory/memory.usage_in_bytes", "96\n");
        assert_eq!(left("4:cpu,cpuacct:/x\n3:memory:/docker/abc\n"), Some(4000));
    }

    #[test]
    fn errors_name_the_amount_that_does_not_fit() {
        assert!(available().expect("a limit").bytes > 0);
        assert!(require(1 << 20, "few").is_ok());
        let error = require(1 << 60, "9 copies").expect_err("no machine has that");
        assert!(error.cause.starts_with("9 copies need about 1073741824.0 GiB of memory, "), "{error}");
        assert_eq!(reserve::<u64>(3, "numbers").map(|items| items.capacity() >= 3), Ok(true));
        let error = reserve::<u64>(1 << 59, "numbers").expect_err("no machine has that");
        assert_eq!(error.cause, format!("there is no memory for {} numbers ({} MiB)", 1u64 << 59, 1u64 << 42));
    }
}
