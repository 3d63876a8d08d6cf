//! Safe functions for calls of Windows and macOS that caustique needs and no other crate offers: memory and processor
//! time of the process, and on Windows also processes, jobs, locks and identities of files. Empty on Linux.

#[cfg(target_os = "macos")]
mod macos;
#[cfg(windows)]
mod windows;

#[cfg(target_os = "macos")]
pub use macos::*;
#[cfg(windows)]
pub use windows::*;
