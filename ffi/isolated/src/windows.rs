//! Work in the program itself.

use std::io::{self, Read, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::{Ending, Limits};

/// Runs `work`, and then `read` on what it has written. A panic ends the work alone; there are no limits.
///
/// # Errors
/// None.
pub fn run<T>(
    _limits: Limits,
    work: impl FnOnce(&mut dyn Write),
    read: impl FnOnce(&mut dyn Read) -> T,
) -> io::Result<(T, Ending)> {
    let mut written = Vec::new();
    let done = catch_unwind(AssertUnwindSafe(|| work(&mut written))).is_ok();
    Ok((read(&mut written.as_slice()), if done { Ending::Finished } else { Ending::Aborted }))
}
