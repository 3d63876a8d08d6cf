//! The operating system: files and their identities, processes, memory, signals, and names of libraries. Only this
//! module asks on which system it runs. `unix` and `windows` hold the same functions; `linux` and `macos` hold those that
//! differ between the two kinds of Unix.

#[cfg(target_os = "linux")]
mod linux;
#[cfg(target_os = "macos")]
mod macos;
#[cfg(unix)]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(target_os = "linux")]
pub use linux::*;
#[cfg(target_os = "macos")]
pub use macos::*;
#[cfg(unix)]
pub use unix::*;
#[cfg(windows)]
pub use windows::*;
