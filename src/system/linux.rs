//! What Linux tells in `/proc` and `/sys`.

use std::fs;
use std::path::{Path, PathBuf};

use rustix::process::{Pid, Resource, getrlimit};

/// Begin of the file names of ONNX Runtime's library.
pub const ONNXRUNTIME: &str = "libonnxruntime.so";

/// File names of ONNX Runtime for the system's loader: without a version, and with each of the minor versions (Debian 13
/// installs libonnxruntime.so.1.21).
pub fn onnxruntime_names(minors: impl Iterator<Item = u32>) -> Vec<String> {
    let versioned = minors.map(|minor| format!("{ONNXRUNTIME}.1.{minor}"));
    [ONNXRUNTIME.into(), format!("{ONNXRUNTIME}.1")].into_iter().chain(versioned).collect()
}

/// The file that contains the code at `address`: the program, or a shared library.
pub fn file_with_code(address: usize) -> Option<PathBuf> {
    let path_if_mapped = |line: &str| {
        let (from, to) = line.split_whitespace().next()?.split_once('-')?;
        let [from, to] = [from, to].map(|digits| usize::from_str_radix(digits, 16).unwrap_or(0));
        (from..to).contains(&address).then(|| line.find('/').map(|at| PathBuf::from(&line[at..])))?
    };
    text("/proc/self/maps").lines().find_map(path_if_mapped)
}

/// Name of the processor's model.
pub fn processor_name() -> Option<String> {
    let cpuinfo = text("/proc/cpuinfo");
    let name = cpuinfo.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    name.map(|(_, name)| name.trim().to_string())
}

/// Names of the instructions that the first processor has; `None` if the system does not list them.
pub fn processor_features() -> Option<Vec<String>> {
    features_in(&text("/proc/cpuinfo"))
}

fn features_in(cpuinfo: &str) -> Option<Vec<String>> {
    let (_, flags) = cpuinfo.lines().find_map(|line| line.strip_prefix("flags")?.split_once(':'))?;
    Some(flags.split_whitespace().map(str::to_owned).collect())
}

/// Peak resident memory of the process (bytes); 0 without `/proc`.
pub fn peak_memory() -> u64 {
    parse_kib(&text("/proc/self/status"), "VmHWM:").unwrap_or(0)
}

/// Bytes that limits of memory leave, where they can be read, and the limits in words that follow the amount: what the
/// machine has left, `ulimit -v`, and the control groups (containers, batch systems, systemd).
pub fn memory_limits() -> [(Option<u64>, &'static str); 3] {
    let address_space = || {
        let most = getrlimit(Resource::As).current?;
        Some(most.saturating_sub(parse_kib(&text("/proc/self/status"), "VmSize:")?))
    };
    [
        (parse_kib(&text("/proc/meminfo"), "MemAvailable:"), "available"),
        (address_space(), "left by 'ulimit -v'"),
        (
            free_in_groups(&text("/proc/self/cgroup"), Path::new("/sys/fs/cgroup")),
            "left by the control group (a container's or a job's limit)",
        ),
    ]
}

/// Whether a limit of memory (`ulimit -v`) counts addresses that are reserved and never used.
pub fn counts_unused_addresses() -> bool {
    getrlimit(Resource::As).current.is_some()
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
    let number = |name: &str| fs::read_to_string(group.join(name)).ok()?.trim().parse::<u64>().ok();
    let (limit, usage) = (number(limit)?, number(usage)?);
    let stat = fs::read_to_string(group.join("memory.stat")).unwrap_or_default();
    let files = stat.lines().find_map(|line| line.strip_prefix(files)?.trim().parse().ok());
    Some(limit.saturating_sub(usage.saturating_sub(files.unwrap_or(0))))
}

/// Name of this machine.
pub fn host() -> String {
    text("/proc/sys/kernel/hostname").trim().to_owned()
}

/// Identifies the machine since its start, and the namespace of its process numbers, which containers have separately.
pub fn machine() -> String {
    let namespace = fs::read_link("/proc/self/ns/pid").unwrap_or_default();
    format!("{} {} {}", host(), text("/proc/sys/kernel/random/boot_id").trim(), namespace.display())
}

/// Whether a process has ended, and its parent has not asked for its exit code yet.
pub(super) fn is_zombie(process: Pid) -> bool {
    // The state follows the name, which is in brackets and may contain some.
    text(&format!("/proc/{process}/stat"))
        .rsplit_once(')')
        .is_some_and(|(_, state)| state.trim_start().starts_with(['Z', 'X']))
}

/// The text of a file of `/proc`; empty if it cannot be read.
fn text(path: &str) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_of_the_first_processor_are_listed() {
        let modern = "processor\t: 0\nflags\t\t: fpu avx2 fma\nbogomips\t: 1\nflags\t\t: fpu\n";
        assert_eq!(features_in(modern), Some(["fpu", "avx2", "fma"].map(String::from).into()));
        assert_eq!(features_in("no such line"), None);
    }

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

    /// A process that was killed, and whose parent has not noticed, is gone.
    #[test]
    fn zombies_are_gone() {
        let mut child = std::process::Command::new("sleep").arg("60").spawn().expect("it starts");
        assert!(!super::super::is_process_gone(child.id()));
        child.kill().expect("it can be killed");
        while !super::super::is_process_gone(child.id()) {
            std::thread::yield_now();
        }
        child.wait().expect("it has ended");
    }
}
