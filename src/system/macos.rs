//! What macOS tells. It has no `/proc`.

use std::path::PathBuf;

use rustix::process::Pid;

/// Begin of the file names of ONNX Runtime's library.
pub const ONNXRUNTIME: &str = "libonnxruntime.";

/// File names of ONNX Runtime for the system's loader: Homebrew's folders are not among its own.
pub fn onnxruntime_names(_minors: impl Iterator<Item = u32>) -> Vec<String> {
    ["", "/opt/homebrew/lib/", "/usr/local/lib/"].map(|folder| format!("{folder}{ONNXRUNTIME}dylib")).into()
}

/// The file that contains the code at `address`: the program, or a shared library.
pub fn file_with_code(address: usize) -> Option<PathBuf> {
    caustique_library::file_containing(address)?.canonicalize().ok()
}

/// Name of the processor's model; the system does not tell without a call of its own.
pub fn processor_name() -> Option<String> {
    None
}

/// Names of the instructions that the processor has; `None`: all that the program is built for have them.
pub fn processor_features() -> Option<Vec<String>> {
    None
}

/// Peak resident memory of the process (bytes); 0 if the system does not tell.
pub fn peak_memory() -> u64 {
    caustique_system::peak_memory().unwrap_or(0)
}

/// Bytes that limits of memory leave, where they can be read, and the limits in words that follow the amount.
pub fn memory_limits() -> [(Option<u64>, &'static str); 1] {
    [(caustique_system::free_memory(), "available")]
}

/// Whether a limit of memory counts addresses that are reserved and never used.
pub fn counts_unused_addresses() -> bool {
    false
}

/// Name of this machine.
pub fn host() -> String {
    rustix::system::uname().nodename().to_string_lossy().into_owned()
}

/// Identifies the machine. After a restart, another process may have the number of an old one.
pub fn machine() -> String {
    host()
}

/// Whether a process has ended, and its parent has not asked for its exit code yet; the system does not tell.
pub(super) fn is_zombie(_process: Pid) -> bool {
    false
}
