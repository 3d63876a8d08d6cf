//! What all kinds of Unix have in common.

use std::fs::{self, File, Metadata, Permissions};
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use rustix::io::Errno;
use rustix::process::{Pid, Signal, kill_process_group, test_kill_process};
use rustix::time::{ClockId, clock_gettime};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator::Signals;

/// Name of the program that runs Python.
pub const PYTHON: &str = "python3";
/// Path of that program in a virtual environment.
pub const PYTHON_OF_ENVIRONMENT: &str = "bin/python";

/// Mode bit of folders where everybody may create files, such as `/tmp`, and nobody may replace those of others.
const STICKY_BIT: u32 = 0o1000;

/// A number that only one file or folder of the machine has: its device, and its number there.
pub type FileId = (u64, u64);

/// The number of the file or folder at a path.
///
/// # Errors
/// There is none, or it cannot be reached.
pub fn file_id(path: &Path) -> io::Result<FileId> {
    fs::metadata(path).map(|data| (data.dev(), data.ino()))
}

/// The number of an open file.
///
/// # Errors
/// The file system does not tell.
pub fn open_file_id(file: &File) -> io::Result<FileId> {
    file.metadata().map(|data| (data.dev(), data.ino()))
}

/// Whether a file is a pipe.
pub fn is_pipe(data: &Metadata) -> bool {
    data.file_type().is_fifo()
}

/// Opens a file; a pipe without a writer is opened at once.
///
/// # Errors
/// The file cannot be opened.
pub fn open_without_waiting(path: &Path) -> io::Result<File> {
    let flags = rustix::fs::OFlags::NONBLOCK | rustix::fs::OFlags::NOCTTY;
    File::options().read(true).custom_flags(flags.bits() as i32).open(path)
}

/// Waits for the lock of a file, which is free when the file is closed. Others may read and write the file.
///
/// # Errors
/// The file system has no locks.
pub fn lock(file: &File) -> io::Result<()> {
    file.lock()
}

/// Takes the lock of a file if it is free.
///
/// # Errors
/// Another process has the lock, or the file system has no locks.
pub fn try_lock(file: &File) -> io::Result<()> {
    Ok(file.try_lock()?)
}

/// Whether everybody may create files in a folder.
pub fn is_shared(folder: &Path) -> bool {
    folder.metadata().is_ok_and(|data| data.mode() & STICKY_BIT != 0)
}

/// Whether a folder, such as `/tmp`, allows only the owner to replace a file in it, and the owner is another user.
pub fn is_protected(file: &Metadata, folder: &Path) -> bool {
    let user = rustix::process::geteuid().as_raw();
    let folder = fs::metadata(folder);
    folder.is_ok_and(|folder| folder.mode() & STICKY_BIT != 0 && ![0, file.uid(), folder.uid()].contains(&user))
}

/// Permissions of a new file of the user's, under the user's umask; `None`: the folder determines them.
pub fn user_permissions() -> Option<Permissions> {
    Some(Permissions::from_mode(0o666))
}

/// Permissions of a folder that only the user may enter; `None`: temporary folders are private.
pub fn private_permissions() -> Option<Permissions> {
    Some(Permissions::from_mode(0o700))
}

/// Standard output as a file.
///
/// # Errors
/// It is closed.
pub fn stdout_file() -> io::Result<File> {
    Ok(File::from(io::stdout().as_fd().try_clone_to_owned()?))
}

/// Does nothing: libraries name the folders of those that they need.
pub fn preload(_library: &Path) {}

/// Redirects stderr to `/dev/null` until it is dropped. Debian 13's ONNX Runtime is linked to a libonnx that has already
/// registered all operators, and prints some 500 lines about them past its own logger when the first session starts.
/// Errors are still returned as values.
pub struct SilencedStderr(Option<OwnedFd>);

impl SilencedStderr {
    /// Redirects stderr.
    pub fn start() -> SilencedStderr {
        let nowhere = File::options().write(true).open("/dev/null");
        let saved = rustix::io::fcntl_dupfd_cloexec(rustix::stdio::stderr(), 3);
        let (Ok(nowhere), Ok(saved)) = (nowhere, saved) else { return SilencedStderr(None) };
        SilencedStderr(rustix::stdio::dup2_stderr(nowhere).is_ok().then_some(saved))
    }
}

impl Drop for SilencedStderr {
    fn drop(&mut self) {
        if let Some(saved) = self.0.take() {
            // A failure cannot be reported: stderr is gone.
            let _ = rustix::stdio::dup2_stderr(saved);
        }
    }
}

/// Processor time that the process has taken since it began (seconds).
pub fn cpu_seconds() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Whether no process has the number `id`, or one that has ended. A process that may not be signalled exists, although
/// `/proc` may hide it.
pub fn is_process_gone(id: u32) -> bool {
    let process = i32::try_from(id).ok().and_then(Pid::from_raw);
    process.is_some_and(|process| test_kill_process(process) == Err(Errno::SRCH) || super::is_zombie(process))
}

/// Gives a program its own process group, so that Ctrl-C in a terminal does not reach it.
pub fn shield_from_interrupts(command: &mut Command) -> &mut Command {
    command.process_group(0)
}

/// A program in a process group of its own, which is killed with its children when this is dropped.
pub struct Group(Child);

impl Group {
    /// Starts the program.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start(command: &mut Command) -> io::Result<Group> {
        shield_from_interrupts(command).spawn().map(Group)
    }

    /// How the program has ended; `None` while it runs.
    ///
    /// # Errors
    /// The system does not tell.
    pub fn try_wait(&mut self) -> io::Result<Option<ExitStatus>> {
        self.0.try_wait()
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        if let Some(group) = i32::try_from(self.0.id()).ok().and_then(Pid::from_raw) {
            // An error means that all processes have ended.
            let _ = kill_process_group(group, Signal::KILL);
        }
        let _ = self.0.wait();
    }
}

/// Whether the program was started to ignore SIGHUP, as `nohup` starts programs. Known on Linux alone.
fn ignores_hangup() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (SIGHUP - 1) & 1 == 1)
}

/// Sets `flag` at the first SIGINT (Ctrl-C), SIGTERM or, unless `nohup` started the program, SIGHUP (the terminal is
/// closed); the second ends the program at once, with code 130. A thread runs `answer` after Ctrl-C, because signal
/// handlers may not print.
///
/// # Errors
/// A handler or the thread cannot be installed.
pub fn on_interrupt(flag: &Arc<AtomicBool>, answer: impl FnOnce() + Send + 'static) -> io::Result<()> {
    let hangup = (!ignores_hangup()).then_some(SIGHUP);
    for signal in [SIGINT, SIGTERM].into_iter().chain(hangup) {
        // In this order: a signal ends the program if the flag is set already, and else sets the flag.
        signal_hook::flag::register_conditional_shutdown(signal, 130, Arc::clone(flag))?;
        signal_hook::flag::register(signal, Arc::clone(flag))?;
    }
    let mut pressed = Signals::new([SIGINT])?;
    let answer = move || {
        if pressed.forever().next().is_some() {
            answer();
        }
    };
    std::thread::Builder::new().spawn(answer).map(drop)
}

/// Catches SIGXFSZ, so that a file that grows past `ulimit -f` fails to be written instead of ending the program.
///
/// # Errors
/// The handler cannot be installed.
pub fn survive_large_files() -> io::Result<()> {
    signal_hook::flag::register(SIGXFSZ, Arc::default()).map(drop)
}
