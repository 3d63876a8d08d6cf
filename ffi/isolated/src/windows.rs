//! Work in a program of its own.

use std::io::{self, Read, Write};
use std::os::windows::process::CommandExt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::Stdio;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use caustique_system::Job;

use crate::{Ending, Helper, Limits, WAITING_FACTOR};

/// Flag of a program without a window of its own (`CREATE_NO_WINDOW`). Ctrl-C does not reach it.
const NO_WINDOW: u32 = 0x0800_0000;

/// Exit code of a process that has reached the limit of its processor time (`ERROR_NOT_ENOUGH_QUOTA`).
const OUT_OF_TIME: i32 = 1816;
/// Exit codes of a process that has aborted, which Rust does when an allocation fails (`STATUS_STACK_BUFFER_OVERRUN`), and
/// of one that has panicked.
const ABORTED: [i32; 2] = [0xC000_0409_u32 as i32, 101];

/// Runs the helper's program with limits, and `read` here on what it writes. The program ends when `read` returns. Without
/// a helper, `work` runs in this process without limits, and a panic ends the work alone.
///
/// # Errors
/// The system starts no process.
pub fn run<T>(
    limits: Limits,
    work: impl FnOnce(&mut dyn Write),
    helper: impl FnOnce() -> Option<Helper>,
    read: impl FnOnce(&mut dyn Read) -> T,
) -> io::Result<(T, Ending)> {
    let Some(Helper { mut command, input }) = helper() else {
        let mut written = Vec::new();
        let done = catch_unwind(AssertUnwindSafe(|| work(&mut written))).is_ok();
        return Ok((read(&mut written.as_slice()), if done { Ending::Finished } else { Ending::Aborted }));
    };
    // The program has its input, too.
    let job = Job::limited(limits.bytes.saturating_add(input.len() as u64), limits.seconds)?;
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).creation_flags(NO_WINDOW);
    let mut child = command.spawn()?;
    // It waits for its input, so that the limits apply before it works.
    if let Err(error) = job.add(&child) {
        let _ = child.kill();
        return Err(error);
    }
    let (stop, stopped) = channel::<()>();
    let watchdog = thread::spawn(move || {
        let seconds = limits.seconds.saturating_mul(WAITING_FACTOR);
        let is_late = stopped.recv_timeout(Duration::from_secs(seconds.into())) == Err(RecvTimeoutError::Timeout);
        // The processes of a job end with its handle, which must therefore live until here.
        drop(job);
        is_late
    });
    let (input_pipe, output) = (child.stdin.take(), child.stdout.take());
    // It writes nothing before it has read all, so that neither waits for the other. It may end before: `read` notices.
    let _ = input_pipe.map(|mut pipe| pipe.write_all(&input));
    let result = catch_unwind(AssertUnwindSafe(|| match output {
        Some(mut pipe) => read(&mut pipe),
        None => read(&mut io::empty()),
    }));
    let status = child.wait();
    drop(stop);
    let is_late = watchdog.join().unwrap_or(false);
    let ending = match status?.code() {
        _ if is_late => Ending::OutOfTime,
        Some(0) => Ending::Finished,
        Some(OUT_OF_TIME) => Ending::OutOfTime,
        Some(code) if ABORTED.contains(&code) => Ending::Aborted,
        _ => Ending::Crashed,
    };
    match result {
        Ok(value) => Ok((value, ending)),
        Err(panic) => std::panic::resume_unwind(panic),
    }
}
