//! Checks of free memory before large allocations.
//!
//! A few numbers in a scene or on the command line (copies, vertices, pixels, light paths) can request any amount of
//! memory. Rust and Embree abort the process if an allocation fails, and Linux kills it if memory is overcommitted. So
//! large amounts are computed and compared with the free memory first: the least of the memory that the machine has
//! left, that `ulimit -v` leaves, and that `memory.max` of the control groups (containers, batch systems, systemd)
//! leaves.

use crate::error::{Error, ErrorKind, Result};
use crate::system;
use std::fmt::Display;

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
    let limits =
        system::memory_limits().into_iter().filter_map(|(bytes, source)| Some(Available { bytes: bytes?, source }));
    limits.min_by_key(|limit| limit.bytes)
}

/// Checks that `bytes` of memory are free. `what` names their users in the message, in the plural: "9 copies".
///
/// # Errors
/// Less memory is free. The error names both amounts; the caller adds place and hint.
pub fn require(bytes: u64, what: impl Display) -> Result<()> {
    match available() {
        Some(Available { bytes: left, source }) if bytes > left => {
            let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
            let cause = format!("{what} need about {:.2} GiB of memory, {:.2} GiB are {source}", gib(bytes), gib(left));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_name_the_amount_that_does_not_fit() {
        assert!(available().expect("a limit").bytes > 0);
        assert!(require(1 << 20, "few").is_ok());
        let error = require(1 << 60, "9 copies").expect_err("no machine has that");
        assert!(error.cause.starts_with("9 copies need about 1073741824.00 GiB of memory, "), "{error}");
        assert_eq!(reserve::<u64>(3, "numbers").map(|items| items.capacity() >= 3), Ok(true));
        let error = reserve::<u64>(1 << 59, "numbers").expect_err("no machine has that");
        assert_eq!(error.cause, format!("there is no memory for {} numbers ({} MiB)", 1u64 << 59, 1u64 << 42));
    }
}
