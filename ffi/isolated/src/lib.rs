//! Runs work in a process of its own, with limits of memory and time.
//!
//! Rust aborts a process whose allocation fails, and no code can catch that. A decoder that believes the sizes in a
//! damaged file, or that indexes without checks, therefore runs in a fork of the process: the fork ends, and the program
//! goes on with an error. Windows has no forks: there a [`Helper`] does the work.

use std::process::Command;

#[cfg(unix)]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(unix)]
pub use unix::run;
#[cfg(windows)]
pub use windows::run;

/// A program that does the work, for systems without forks: it reads `input` from standard input up to the end, and
/// writes to standard output what the work writes.
pub struct Helper {
    /// How to start it.
    pub command: Command,
    /// The work.
    pub input: Vec<u8>,
}

/// Most that a process may take.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Bytes that it may allocate besides what the program has allocated before.
    pub bytes: u64,
    /// Seconds of processor time.
    pub seconds: u32,
}

/// Seconds after which a process ends that does nothing, as a multiple of its limit of processor time. A fork has the
/// locks of its parent's other threads: one that waits for such a lock would wait for ever.
const WAITING_FACTOR: u32 = 10;

/// How a process has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It has done its work, or had written what the reader wanted.
    Finished,
    /// It asked for more memory than its limit, or panicked without a handler.
    Aborted,
    /// It reached the limit of its time.
    OutOfTime,
    /// A fault of memory, or another signal, has ended it.
    Crashed,
}
