//! Windows, from version 10.

use std::fs::{File, Metadata, Permissions};
use std::io;
use std::os::windows::fs::OpenOptionsExt;
use std::os::windows::io::AsHandle;
use std::os::windows::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use caustique_system::Job;
use raw_cpuid::CpuId;

/// Name of the program that runs Python.
pub const PYTHON: &str = "python";
/// Path of that program in a virtual environment.
pub const PYTHON_OF_ENVIRONMENT: &str = "Scripts/python.exe";

/// Begin of the file names of ONNX Runtime's library.
pub const ONNXRUNTIME: &str = "onnxruntime.dll";

/// Flag that opens folders as files are opened (`FILE_FLAG_BACKUP_SEMANTICS`).
const OPENS_FOLDERS: u32 = 0x0200_0000;
/// Flag of a program in a process group of its own (`CREATE_NEW_PROCESS_GROUP`).
const OWN_GROUP: u32 = 0x0000_0200;

/// File names of ONNX Runtime for the system's loader. It searches the program's folder first; the version in Windows
/// itself is too old.
pub fn onnxruntime_names(_minors: impl Iterator<Item = u32>) -> Vec<String> {
    vec![ONNXRUNTIME.into()]
}

/// A number that only one file or folder of the machine has: its volume, and its number there.
pub type FileId = (u64, u64);

/// The number of the file or folder at a path.
///
/// # Errors
/// There is none, or it cannot be reached.
pub fn file_id(path: &Path) -> io::Result<FileId> {
    // Without any right to its contents, a file can be opened that others keep open.
    open_file_id(&File::options().access_mode(0).custom_flags(OPENS_FOLDERS).open(path)?)
}

/// The number of an open file.
///
/// # Errors
/// The file system has no such numbers.
pub fn open_file_id(file: &File) -> io::Result<FileId> {
    caustique_system::file_id(file)
}

/// Whether a file is a pipe. Pipes have paths of their own here, and are no files.
pub fn is_pipe(_data: &Metadata) -> bool {
    false
}

/// Opens a file.
///
/// # Errors
/// The file cannot be opened.
pub fn open_without_waiting(path: &Path) -> io::Result<File> {
    File::open(path)
}

/// Waits for the lock of a file, which is free when the file is closed. Others may read and write the file, which the
/// locks of the standard library prevent.
///
/// # Errors
/// The file system has no locks.
pub fn lock(file: &File) -> io::Result<()> {
    caustique_system::lock(file, true)
}

/// Takes the lock of a file if it is free.
///
/// # Errors
/// Another process has the lock, or the file system has no locks.
pub fn try_lock(file: &File) -> io::Result<()> {
    caustique_system::lock(file, false)
}

/// Whether everybody may create files in a folder: in the root of a drive.
pub fn is_shared(folder: &Path) -> bool {
    folder.parent().is_none()
}

/// Whether a folder allows only the owner to replace a file in it, and the owner is another user. The rights of the file
/// itself decide here.
pub fn is_protected(_file: &Metadata, _folder: &Path) -> bool {
    false
}

/// Permissions of a new file of the user's; `None`: the folder determines them.
pub fn user_permissions() -> Option<Permissions> {
    None
}

/// Permissions of a folder that only the user may enter; `None`: temporary folders are private.
pub fn private_permissions() -> Option<Permissions> {
    None
}

/// Standard output as a file.
///
/// # Errors
/// It is closed.
pub fn stdout_file() -> io::Result<File> {
    Ok(File::from(io::stdout().as_handle().try_clone_to_owned()?))
}

/// Loads a library whose own folder has libraries that it needs. Other loaders search for these elsewhere.
pub fn preload(library: &Path) {
    // Who uses the library reports the error.
    let _ = caustique_library::preload(library);
}

/// Does nothing: only a library of Debian's prints to stderr.
pub struct SilencedStderr;

impl SilencedStderr {
    /// Does nothing.
    pub fn start() -> SilencedStderr {
        SilencedStderr
    }
}

/// The file that contains the code at `address`: the program, or a shared library.
pub fn file_with_code(address: usize) -> Option<PathBuf> {
    caustique_library::file_containing(address)
}

/// Name of the processor's model.
pub fn processor_name() -> Option<String> {
    CpuId::new().get_processor_brand_string().map(|name| name.as_str().trim().to_owned())
}

/// Those of the instructions of x86-64-v3 that the processor has.
pub fn processor_features() -> Option<Vec<String>> {
    let (basic, extended) = (CpuId::new().get_feature_info()?, CpuId::new().get_extended_feature_info()?);
    let known = [
        ("avx2", extended.has_avx2()),
        ("bmi2", extended.has_bmi2()),
        ("f16c", basic.has_f16c()),
        ("fma", basic.has_fma()),
        ("movbe", basic.has_movbe()),
    ];
    Some(known.into_iter().filter(|(_, has)| *has).map(|(name, _)| name.to_owned()).collect())
}

/// Processor time that the process has taken since it began (seconds).
pub fn cpu_seconds() -> f64 {
    caustique_system::cpu_seconds().unwrap_or(0.0)
}

/// Peak resident memory of the process (bytes); 0 if the system does not tell.
pub fn peak_memory() -> u64 {
    caustique_system::peak_memory().unwrap_or(0)
}

/// Bytes that limits of memory leave, where they can be read, and the limits in words that follow the amount.
pub fn memory_limits() -> [(Option<u64>, &'static str); 2] {
    let [free, page_file] = caustique_system::free_memory().map_or([None; 2], |free| free.map(Some));
    [(free, "available"), (page_file, "left in memory and page file")]
}

/// Whether a limit of memory counts addresses that are reserved and never used.
pub fn counts_unused_addresses() -> bool {
    false
}

/// Name of this machine.
pub fn host() -> String {
    std::env::var("COMPUTERNAME").unwrap_or_default()
}

/// Identifies the machine. After a restart, another process may have the number of an old one.
pub fn machine() -> String {
    host()
}

/// Whether no process has the number `id`, or one that has ended. A process that may not be opened exists.
pub fn is_process_gone(id: u32) -> bool {
    id != 0 && caustique_system::is_process_gone(id)
}

/// Gives a program its own process group, so that Ctrl-C in a terminal does not reach it.
pub fn shield_from_interrupts(command: &mut Command) -> &mut Command {
    command.creation_flags(OWN_GROUP)
}

/// A program that is killed with its children when this is dropped.
pub struct Group {
    child: Child,
    job: Option<Job>,
}

impl Group {
    /// Starts the program.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start(command: &mut Command) -> io::Result<Group> {
        let job = Job::new()?;
        let child = shield_from_interrupts(command).spawn()?;
        // A program that has ended already has no children to be killed.
        let _ = job.add(&child);
        Ok(Group { child, job: Some(job) })
    }

    /// How the program has ended; `None` while it runs.
    ///
    /// # Errors
    /// The system does not tell.
    pub fn try_wait(&mut self) -> io::Result<Option<ExitStatus>> {
        self.child.try_wait()
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        self.job = None;
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Sets `flag` at the first Ctrl-C or Ctrl-Break, and when the window is closed; the second ends the program at once, with
/// code 130. `answer` runs after the first.
///
/// # Errors
/// The handler cannot be installed.
pub fn on_interrupt(flag: &Arc<AtomicBool>, answer: impl FnOnce() + Send + 'static) -> io::Result<()> {
    let (flag, mut answer) = (Arc::clone(flag), Some(answer));
    let handler = move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        if let Some(answer) = answer.take() {
            answer();
        }
    };
    ctrlc::set_handler(handler).map_err(io::Error::other)
}

/// Does nothing: a file that is too large fails to be written.
///
/// # Errors
/// None.
pub fn survive_large_files() -> io::Result<()> {
    Ok(())
}
