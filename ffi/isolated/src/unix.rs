//! Work in a fork of the process.

use std::fs::File;
use std::io::{self, Read, Write};
use std::os::fd::AsRawFd;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::{Ending, Helper, Limits, WAITING_FACTOR};

/// Runs `work` in a fork of this process, and `read` here on what `work` writes. The fork ends when `read` returns. No
/// helper is needed.
///
/// # Errors
/// The system gives no pipe or no process.
pub fn run<T>(
    limits: Limits,
    work: impl FnOnce(&mut dyn Write),
    _helper: impl FnOnce() -> Option<Helper>,
    read: impl FnOnce(&mut dyn Read) -> T,
) -> io::Result<(T, Ending)> {
    let (mut reader, mut writer) = io::pipe()?;
    let null = File::options().write(true).open("/dev/null")?;
    let address_space = address_space()?.saturating_add(limits.bytes);
    // SAFETY: the fork runs `work` and ends by `_exit`. It shares no memory with this process, and glibc lets a fork of
    // a process with several threads allocate memory.
    match unsafe { libc::fork() } {
        -1 => Err(io::Error::last_os_error()),
        0 => {
            drop(reader);
            let done = limit(limits, address_space, &null).is_ok()
                && catch_unwind(AssertUnwindSafe(|| work(&mut writer))).is_ok();
            // SAFETY: `_exit` ends the process without running the handlers of its parent.
            unsafe { libc::_exit(i32::from(!done)) }
        }
        child => {
            drop(writer);
            let result = catch_unwind(AssertUnwindSafe(|| read(&mut reader)));
            drop(reader);
            let ending = wait(child);
            match result {
                Ok(value) => Ok((value, ending)),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
    }
}

/// Bytes of address space that this process takes; `u64::MAX` on systems other than Linux, which do not limit it.
fn address_space() -> io::Result<u64> {
    if !cfg!(target_os = "linux") {
        return Ok(u64::MAX);
    }
    let text = std::fs::read_to_string("/proc/self/statm")?;
    let pages = text.split_whitespace().next().and_then(|pages| pages.parse::<u64>().ok()).unwrap_or(0);
    // SAFETY: `sysconf` has no preconditions.
    let page = unsafe { libc::sysconf(libc::_SC_PAGESIZE) };
    Ok(pages.saturating_mul(page.max(0) as u64))
}

/// Limits this process, and silences its messages: the program reports how it has ended.
fn limit(limits: Limits, address_space: u64, null: &File) -> io::Result<()> {
    set_limit(libc::RLIMIT_CORE as i32, 0)?;
    set_limit(libc::RLIMIT_AS as i32, address_space)?;
    set_limit(libc::RLIMIT_CPU as i32, u64::from(limits.seconds))?;
    // SAFETY: both descriptors are open, and signals have their default actions from here on.
    unsafe {
        libc::dup2(null.as_raw_fd(), libc::STDERR_FILENO);
        for signal in [libc::SIGALRM, libc::SIGXCPU, libc::SIGABRT, libc::SIGSEGV, libc::SIGBUS, libc::SIGPIPE] {
            libc::signal(signal, libc::SIG_DFL);
        }
        libc::alarm(limits.seconds.saturating_mul(WAITING_FACTOR));
    }
    Ok(())
}

/// Lowers a limit of this process to `most`, unless it is lower.
fn set_limit(resource: i32, most: u64) -> io::Result<()> {
    let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: `limit` is valid for reading and writing.
    let failed = unsafe {
        libc::getrlimit(resource as _, &raw mut limit) != 0 || {
            limit.rlim_cur = limit.rlim_cur.min(most);
            libc::setrlimit(resource as _, &raw const limit) != 0
        }
    };
    if failed { Err(io::Error::last_os_error()) } else { Ok(()) }
}

/// Waits for the end of a fork whose output nobody reads any longer.
fn wait(child: libc::pid_t) -> Ending {
    let mut status = 0;
    loop {
        // SAFETY: `status` is valid for writing.
        match unsafe { libc::waitpid(child, &raw mut status, 0) } {
            -1 if io::Error::last_os_error().kind() == io::ErrorKind::Interrupted => {}
            // The process ignores the ends of its children, so that there is no status.
            -1 => return Ending::Finished,
            _ => break,
        }
    }
    match (libc::WIFSIGNALED(status), libc::WTERMSIG(status)) {
        (false, _) if libc::WEXITSTATUS(status) == 0 => Ending::Finished,
        (true, libc::SIGPIPE) => Ending::Finished,
        (true, libc::SIGXCPU | libc::SIGALRM) => Ending::OutOfTime,
        (false, _) | (true, libc::SIGABRT) => Ending::Aborted,
        (true, _) => Ending::Crashed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::hint::black_box;

    const LIMITS: Limits = Limits { bytes: 64 << 20, seconds: 1 };

    /// What `work` has written, and how it has ended.
    fn outcome(work: impl FnOnce(&mut dyn Write)) -> (Vec<u8>, Ending) {
        let read = |reader: &mut dyn Read| {
            let mut bytes = Vec::new();
            reader.read_to_end(&mut bytes).expect("it can be read");
            bytes
        };
        run(LIMITS, work, || None, read).expect("there is a process")
    }

    #[test]
    fn work_that_ends_early_leaves_the_program_running() {
        let text = vec![7; 1 << 20];
        let fine = |writer: &mut dyn Write| writer.write_all(&text).expect("it is read");
        assert_eq!(outcome(fine), (text.clone(), Ending::Finished));
        // A table whose size an adversary has chosen; what was written before is kept.
        let greedy = |writer: &mut dyn Write| {
            writer.write_all(b"one").expect("it is read");
            drop(black_box(vec![0u8; black_box(1 << 40)]));
        };
        assert_eq!(outcome(greedy), (b"one".to_vec(), Ending::Aborted));
        assert_eq!(outcome(|_| panic!("planted")), (Vec::new(), Ending::Aborted));
        let mut count = 0u64;
        let endless = |_: &mut dyn Write| loop {
            count = black_box(count + 1);
        };
        assert_eq!(outcome(endless), (Vec::new(), Ending::OutOfTime));
        let crashes = |_: &mut dyn Write| {
            // SAFETY: the signal ends the fork.
            unsafe { libc::raise(libc::SIGSEGV) };
        };
        assert_eq!(outcome(crashes), (Vec::new(), Ending::Crashed));
    }

    /// A reader that has seen enough ends work that still writes.
    #[test]
    fn work_ends_when_nobody_reads() {
        let first = |reader: &mut dyn Read| {
            let mut byte = [0];
            reader.read_exact(&mut byte).expect("a byte");
            byte
        };
        let endless = |writer: &mut dyn Write| while writer.write_all(&[7; 4096]).is_ok() {};
        assert_eq!(run(LIMITS, endless, || None, first).expect("there is a process"), ([7], Ending::Finished));
    }

    #[test]
    fn several_threads_may_run_work() {
        std::thread::scope(|scope| {
            for value in 0..16u8 {
                scope.spawn(move || {
                    let work =
                        move |writer: &mut dyn Write| writer.write_all(&vec![value; 1 << 16]).expect("it is read");
                    assert_eq!(outcome(work), (vec![value; 1 << 16], Ending::Finished));
                });
            }
        });
    }
}
